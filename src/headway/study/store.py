"""A study on disk: Zarr arrays allocated ahead, one region for each piece, and a mark for each piece that is complete.

A mark is written under another name and renamed after its region, so it stands for a region that is whole, whenever
a process is killed. What has no mark is done again. Processes that do different pieces may share a store.
"""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from headway.errors import HeadwayError
from headway.study.work import OK, PENDING, STATUS, Piece

__all__ = ["Store"]

_MARKS = "complete"


class Store:
    """The store at `path`. `Store.open` reads what it holds, `Store.join` creates it or goes on with it."""

    def __init__(self, path: Path, about: dict[str, Any]) -> None:
        self.path, self.about = path, about

    @classmethod
    def open(cls, path: str | os.PathLike[str]) -> Store:
        """An existing store; `HeadwayError` if there is none."""
        place = Path(path)
        try:
            about = json.loads((place / "study.json").read_text(encoding="utf-8"))
        except FileNotFoundError:
            raise HeadwayError(f"{path}: is not a store of a study") from None
        except (OSError, ValueError) as error:
            raise HeadwayError(f"{path}: cannot be read as a store of a study ({error})") from None
        return cls(place, about)

    @classmethod
    def join(
        cls, path: str | os.PathLike[str], about: dict[str, Any], axes: Mapping[str, np.ndarray], resume: bool = True
    ) -> Store:
        """The store of the study that `about` describes, made if there is none.

        Raises `HeadwayError` if another study's store is there, or one that has begun and `resume` is off.
        """
        place = Path(path)
        with _writing(place):
            if not place.parent.is_dir():
                raise HeadwayError(f"{path}: the folder {place.parent} does not exist")
            if not place.exists():
                _create(place, about, axes)
        store = cls.open(place)
        if store.about["hash"] != about["hash"]:
            raise HeadwayError(
                f"{path}: is the store of another study ({store.about['title']}, {store.about['points']} points, "
                f"headway {store.about['version']}); give another path or remove it"
            )
        if not resume and store.complete():
            raise HeadwayError(f"{path}: has {len(store.complete())} pieces already; resume it, or remove it")
        return store

    def complete(self) -> set[int]:
        """Numbers of the pieces that are done."""
        return {int(n.removesuffix(".json")) for n in os.listdir(self.path / _MARKS) if n.endswith(".json")}

    def write(self, number: int, piece: Piece) -> None:
        """Write a piece to its region, then its mark."""
        import zarr

        start = number * self.about["chunk"]
        region = slice(start, start + piece.status.size)
        with _writing(self.path):
            group = zarr.open_group(self.path, mode="r+")
            group["status"][region] = piece.status  # type: ignore[index]  # an array, as it was made
            for name, values in piece.values.items():
                group[name][region] = values  # type: ignore[index]
            counts = np.bincount(piece.status, minlength=len(STATUS)).tolist()
            told = {"status": counts, "messages": {str(i): m for i, m in piece.messages.items()}}
            mark = self.path / _MARKS / f"{number}.json"
            temporary = mark.with_suffix(f".{os.getpid()}")
            temporary.write_text(json.dumps(told), encoding="utf-8")
            os.replace(temporary, mark)

    def read(self) -> tuple[dict[str, np.ndarray], dict[int, str]]:
        """Values by metric and `status` over all points, and messages by point; what is not done is NaN and pending."""
        import zarr

        group = zarr.open_group(self.path, mode="r")
        values = {name: np.asarray(group[name][:]) for name in (*self.about["metrics"], "status")}  # type: ignore[index]
        messages: dict[int, str] = {}
        done = self.complete()
        chunk = self.about["chunk"]
        for number in sorted(done):
            told = json.loads((self.path / _MARKS / f"{number}.json").read_text(encoding="utf-8"))
            messages |= {number * chunk + int(i): text for i, text in told["messages"].items()}
        for number in range(-(-self.about["points"] // chunk)):
            if number not in done:  # a region that was interrupted
                region = slice(number * chunk, (number + 1) * chunk)
                for name, array in values.items():
                    array[region] = PENDING if name == "status" else np.nan
        return values, messages

    def axes(self) -> dict[str, np.ndarray]:
        """Values of each path along its dimension."""
        import zarr

        group = zarr.open_group(self.path, mode="r")
        found = {}
        for name, number in self.about["axes"].items():
            if isinstance(number, list):
                listed = np.empty(len(number), dtype=object)
                listed[:] = number
                found[name] = listed
            else:
                found[name] = np.asarray(group[f"axis_{number}"][:])  # type: ignore[index]
        return found

    def status(self) -> dict[str, Any]:
        """What is done, without reading values: points, pieces, and how many points came to what."""
        counts = np.zeros(len(STATUS), dtype=int)
        done = self.complete()
        for number in done:
            told = json.loads((self.path / _MARKS / f"{number}.json").read_text(encoding="utf-8"))
            counts += told["status"]
        points = int(self.about["points"])
        counts[PENDING] = points - int(counts[OK:PENDING].sum())
        return {
            "title": self.about["title"],
            "points": points,
            "pieces": -(-points // self.about["chunk"]),
            "complete": len(done),
            **dict(zip(STATUS, counts.tolist(), strict=True)),
        }


def _create(place: Path, about: dict[str, Any], axes: Mapping[str, np.ndarray]) -> None:
    """Make a store beside its place and move it there, so that it is there as a whole or not at all."""
    import zarr

    temporary = place.with_name(f".{place.name}.{os.getpid()}")
    try:
        group = zarr.create_group(temporary, attributes={"title": about["title"], "study": about["hash"]})
        shape, chunk = about["points"], min(about["chunk"], about["points"])
        for name, wide in about["metrics"].items():
            more, names = ((about["vehicles"],), ("point", "vehicle")) if wide else ((), ("point",))
            group.create_array(
                name, shape=(shape, *more), chunks=(chunk, *more), dtype="float64", fill_value=np.nan,
                dimension_names=names,
            )  # fmt: skip
        group.create_array(
            "status", shape=(shape,), chunks=(chunk,), dtype="int8", fill_value=PENDING, dimension_names=("point",),
            attributes={"flag_values": list(range(len(STATUS))), "flag_meanings": " ".join(STATUS)},
        )  # fmt: skip
        placed: dict[str, Any] = {}
        for number, (name, values) in enumerate(axes.items()):
            if values.dtype == object:
                placed[name] = values.tolist()
            else:
                placed[name] = number
                array = group.create_array(
                    f"axis_{number}", shape=values.shape, dtype=values.dtype, chunks=values.shape,
                    attributes={"path": name},
                )  # fmt: skip
                array[:] = values
        (temporary / _MARKS).mkdir()
        (temporary / "study.json").write_text(json.dumps({**about, "axes": placed}, indent=1), encoding="utf-8")
        try:
            os.rename(temporary, place)
        except OSError:
            if not (place / "study.json").exists():  # else another process was faster
                raise
    finally:
        shutil.rmtree(temporary, ignore_errors=True)


@contextmanager
def _writing(path: Path) -> Iterator[None]:
    """Turn what a disk says into one sentence."""
    try:
        yield
    except OSError as error:
        raise HeadwayError(
            f"{path}: cannot be written ({error.strerror or error}); what is complete stays; it can be resumed"
        ) from None
