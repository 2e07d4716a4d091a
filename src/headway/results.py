"""Trajectories on disk: NetCDF without loss, and CSV for everything else."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from headway.errors import HeadwayError

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["open_results", "save", "writing"]


@contextmanager
def writing(path: str | os.PathLike[str]) -> Iterator[Path]:
    """A temporary path beside `path` that takes its place if all goes well, and vanishes otherwise.

    Raises `HeadwayError` if the place cannot be written to.
    """
    target = Path(path)
    temporary: Path | None = None
    try:
        if target.is_dir():
            raise HeadwayError(f"{target}: cannot be written, it is a folder")
        handle, name = tempfile.mkstemp(prefix=f".{target.name}.", suffix=target.suffix, dir=target.parent)
        os.close(handle)
        temporary = Path(name)
        yield temporary
        os.chmod(temporary, 0o666 & ~_umask())
        os.replace(temporary, target)
    except OSError as error:
        raise HeadwayError(f"{target}: cannot be written ({error.strerror or error})") from None
    finally:
        if temporary is not None:
            temporary.unlink(missing_ok=True)


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask


def save(dataset: xr.Dataset, path: str | os.PathLike[str]) -> Path:
    """Write trajectories to `path`: NetCDF (.nc) without loss, or one row per vehicle and time (.csv).

    Raises `HeadwayError` for another suffix or a place that cannot be written to; nothing
    half-written is left behind.
    """
    target = Path(path)
    writers: dict[str, Callable[[xr.Dataset, Path], Any]] = {".nc": _netcdf, ".csv": _csv}
    if target.suffix not in writers:
        raise HeadwayError(
            f"{target}: results are written as {' or '.join(writers)}, not {target.suffix or 'without suffix'}"
        )
    with writing(target) as temporary:
        writers[target.suffix](dataset, temporary)
    return target


def _netcdf(dataset: xr.Dataset, path: Path) -> None:
    compressed = {"zlib": True, "complevel": 4, "shuffle": True}
    encoding = {n: compressed for n, v in dataset.variables.items() if v.dtype.kind == "f" and v.ndim > 1}
    dataset.to_netcdf(path, engine="h5netcdf", encoding=encoding)


def _csv(dataset: xr.Dataset, path: Path) -> None:
    names = [n for n, v in dataset.data_vars.items() if v.dims == ("vehicle", "time")]
    frame = dataset[names].to_dataframe().reset_index().sort_values(["vehicle", "time"])
    units = {n: str(dataset[n].attrs.get("units", "")) for n in frame.columns if n in dataset.variables}
    header = [f"{n} [{units[n]}]" if units.get(n, "1") not in ("", "1") else str(n) for n in frame.columns]
    keep = [n for n in ("time", "vehicle", *names) if n in frame.columns]
    frame[keep].to_csv(path, index=False, header=[header[list(frame.columns).index(n)] for n in keep])


def open_results(path: str | os.PathLike[str]) -> xr.Dataset:
    """Read trajectories written by `save` as NetCDF; raises `HeadwayError` if the file cannot be read."""
    import xarray as xr

    try:
        with xr.open_dataset(path, engine="h5netcdf") as dataset:
            return dataset.load()
    except (OSError, ValueError) as error:
        raise HeadwayError(f"{path}: is not a NetCDF file of results ({error})") from None
