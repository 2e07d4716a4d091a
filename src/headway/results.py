"""Trajectories on disk: NetCDF without loss, and CSV for everything else."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from headway.checked import as_path, typed
from headway.errors import HeadwayError
from headway.schema import COORDINATES, VARIABLES, describe

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["header", "open_results", "save", "writing"]


#: as many characters of a file's name go into that of its unfinished one, which must not become too long
_NAME = 80


@contextmanager
def writing(path: str | os.PathLike[str]) -> Iterator[Path]:
    """A temporary path beside `path` that takes its place if all goes well, and vanishes otherwise.

    Args:
        path: The file to be written.

    Raises:
        HeadwayError: If the place cannot be written to.
    """
    target = as_path(path, "file to write")
    temporary: Path | None = None
    try:
        if target.is_dir():
            raise HeadwayError(f"{target}: cannot be written, it is a folder")
        handle, name = tempfile.mkstemp(prefix=f".{target.name[:_NAME]}.", suffix=target.suffix, dir=target.parent)
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


@typed
def save(dataset: xr.Dataset, path: str | os.PathLike[str]) -> Path:
    """Write trajectories to a file; nothing half-written is left behind.

    Args:
        dataset: Trajectories, as `headway.simulate` returns them.
        path: `.nc` for NetCDF without loss, `.csv` for one row per vehicle and time.

    Returns:
        The path.

    Raises:
        HeadwayError: For another suffix, a dataset that such a file cannot hold, or a place that cannot be written to.
    """
    target = as_path(path, "file to write")
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
    try:
        # made in memory: where a disk is full the HDF5 library itself ends the process when it closes its file
        content = dataset.to_netcdf(engine="h5netcdf", encoding=encoding)
    except (TypeError, ValueError) as error:
        raise HeadwayError(f"{path.suffix}: NetCDF cannot hold this dataset ({error})") from None
    path.write_bytes(content)


def _csv(dataset: xr.Dataset, path: Path) -> None:
    names = [n for n, v in dataset.data_vars.items() if v.dims == ("vehicle", "time")]
    if not names:
        raise HeadwayError("a CSV file holds variables along vehicle and time, and this dataset has none; write .nc")
    frame = dataset[names].to_dataframe().reset_index().sort_values(["vehicle", "time"])
    columns = ["time", "vehicle", *names]
    frame[columns].to_csv(path, index=False, header=[header(str(n), dataset[n].attrs) for n in columns])


def header(name: str, attributes: Mapping[Any, Any]) -> str:
    """What a variable is called in a CSV file: its name and, in brackets, its unit."""
    unit = str(attributes.get("units", ""))
    return f"{name} [{unit}]" if unit not in ("", "1") else name


@typed
def open_results(path: str | os.PathLike[str]) -> xr.Dataset:
    """Read trajectories that `save` wrote, as NetCDF without loss or as CSV.

    Args:
        path: The file. CSV holds the variables along vehicle and time only: no collision times and no scenario.

    Returns:
        The dataset, with units and names.

    Raises:
        HeadwayError: If the file cannot be read or holds no trajectories.
    """
    import xarray as xr

    file = as_path(path, "file of results")
    if file.suffix == ".csv":
        return _from_csv(file)
    try:
        with xr.open_dataset(file, engine="h5netcdf") as dataset:
            return dataset.load()
    except Exception as error:  # a damaged file makes its library raise anything
        raise HeadwayError(f"{file}: is not a NetCDF file of results ({type(error).__name__}: {error})") from None


def _from_csv(file: Path) -> xr.Dataset:
    import pandas as pd

    names = {header(n, {"units": v.unit}): n for n, v in {**COORDINATES, **VARIABLES}.items()}
    try:
        frame = pd.read_csv(file, encoding="utf-8-sig", float_precision="round_trip")
    except OSError as error:
        raise HeadwayError(f"{file}: cannot be read ({error.strerror or error})") from None
    except ValueError as error:  # also what is no text, has no columns or rows of unequal length
        raise HeadwayError(f"{file}: is not a CSV file of results ({error})") from None
    frame = frame.rename(columns=names)
    values = [n for n in VARIABLES if n in frame.columns]
    if not {"time", "vehicle"} <= set(frame.columns) or not values:
        raise HeadwayError(
            f"{file}: is not a CSV file of results; its columns are {', '.join(list(names)[:4])}, … as headway.save "
            "writes them (headway.data.read reads other tables)"
        )
    if not all(pd.api.types.is_numeric_dtype(frame[n]) for n in ("time", "vehicle", *values)):
        raise HeadwayError(f"{file}: a cell is not a number")
    index = frame.set_index(["vehicle", "time"])
    if index.index.has_duplicates:
        raise HeadwayError(f"{file}: a time of a vehicle stands there twice")
    return describe(index[values].astype(float).to_xarray())
