"""A study on disk: Zarr arrays allocated ahead, one region for each piece, and a mark for each piece that is complete.

A mark is written under another name and renamed after its region, so it stands for a region that is whole, whenever
a process is killed. It carries a digest of its region, bound to the study and to the place, so a region that was
damaged, exchanged or taken from elsewhere is noticed and done again, as what has no mark is. Processes that do
different pieces may share a store. Any reader of Zarr opens it: what is not an array stands in the group `complete`.
"""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import warnings
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np

from headway.errors import HeadwayError, shorten
from headway.study.work import OK, PENDING, STATUS, Piece

__all__ = ["Store"]

#: the group of the marks; its attributes describe the study
_MARKS = "complete"
_DESCRIPTION = "zarr.json"


class Store:
    """A study on disk: `Store.open` opens what exists, `Store.join` creates it or goes on with it."""

    def __init__(self, path: Path, about: dict[str, Any], arrays: dict[str, Any]) -> None:
        self.path, self.about, self.arrays = path, about, arrays

    @classmethod
    def open(cls, path: str | os.PathLike[str], mode: str = "r") -> Store:
        """The store at a path, which must exist.

        Args:
            path: its folder.
            mode: "r", or "r+" to write pieces.

        Raises:
            HeadwayError: if there is none, or its description or an array's shape or type is damaged.
        """
        place = _path(path)
        try:
            text = (place / _MARKS / _DESCRIPTION).read_text(encoding="utf-8")
        except (FileNotFoundError, NotADirectoryError):
            raise HeadwayError(f"{path}: is not a store of a study ({_MARKS}/{_DESCRIPTION} is missing)") from None
        except (OSError, ValueError) as error:
            raise HeadwayError(f"{path}: cannot be read as a store of a study ({shorten(str(error))})") from None
        about = _unsealed(text, "attributes")
        if about is None:
            raise HeadwayError(
                f"{path}: the description of the study in {_MARKS}/{_DESCRIPTION} is damaged; "
                "put it back, or remove the store and run the study anew"
            )
        return cls(place, about, _arrays(place, about, mode))

    @classmethod
    def join(
        cls, path: str | os.PathLike[str], about: dict[str, Any], axes: Mapping[str, np.ndarray], resume: bool = True
    ) -> Store:
        """The store of a study, created if there is none.

        Args:
            path: its folder.
            about: the description of the study; its `hash` says which study it is.
            axes: path → values along its dimension.
            resume: whether pieces that are done are kept.

        Raises:
            HeadwayError: if another study's store is there, or one that has begun and `resume` is off, or the disk
                refuses.
        """
        place = _path(path)
        with _writing(place):
            if not place.parent.is_dir():
                raise HeadwayError(f"{path}: the folder {place.parent} does not exist")
            if not place.exists():
                _create(place, about, axes)
        store = cls.open(place, "r+")
        if store.about["hash"] != about["hash"]:
            raise HeadwayError(
                f"{path}: is the store of another study ({shorten(store.about['title'])}, {store.about['points']} "
                f"points, headway {store.about['version']}); give another path or remove it"
            )
        if not resume and store.complete():
            raise HeadwayError(f"{path}: has {len(store.complete())} pieces already; resume it, or remove it")
        return store

    @property
    def pieces(self) -> int:
        """How many pieces the study has."""
        return -(-int(self.about["points"]) // int(self.about["chunk"]))

    def complete(self) -> set[int]:
        """Numbers of the pieces that have a mark."""
        try:
            names = os.listdir(self.path / _MARKS)
        except OSError as error:
            raise HeadwayError(f"{self.path}: cannot be read ({error.strerror or error})") from None
        numbers = (n.removesuffix(".json") for n in names if n.endswith(".json"))
        return {int(n) for n in numbers if n.isdecimal() and int(n) < self.pieces}

    def damaged(self, numbers: Iterable[int]) -> set[int]:
        """Which of the pieces numbered have a mark or values that are not what was written."""
        return {n for n in numbers if (mark := self._mark(n)) is None or not self._is_sound(n, mark, self._region(n))}

    def write(self, number: int, piece: Piece) -> None:
        """Write a piece to its region, then its mark.

        Args:
            number: number of the piece.
            piece: its values.

        Raises:
            HeadwayError: if the disk refuses; what is complete stays.
        """
        values = {n: np.where(np.isnan(v), np.nan, v) for n, v in piece.values.items()}  # one NaN, as Zarr fills in
        values["status"] = piece.status
        counts = np.bincount(piece.status, minlength=len(STATUS)).tolist()
        messages = {str(i): m for i, m in piece.messages.items()}
        record = {"status": counts, "messages": messages, "values": self._digest(number, values)}
        mark = self.path / _MARKS / f"{number}.json"
        temporary = mark.with_suffix(f".{os.getpid()}")
        start = number * self.about["chunk"]
        with _writing(self.path):
            mark.unlink(missing_ok=True)  # of a piece that was damaged
            for name, array in values.items():
                self.arrays[name][start : start + array.shape[0]] = array
            try:
                temporary.write_text(json.dumps(_sealed(record, self.about["hash"], number)), encoding="utf-8")
                os.replace(temporary, mark)
            finally:
                temporary.unlink(missing_ok=True)

    def read(self) -> tuple[dict[str, np.ndarray], dict[int, str], set[int]]:
        """Values by metric and `status` over all points, messages by point, and the numbers of damaged pieces.

        What is not done, or is damaged, is NaN and pending.
        """
        chunk, done = self.about["chunk"], self.complete()
        try:
            values = {name: np.asarray(array[:]) for name, array in self.arrays.items()}
        except Exception:  # a chunk is broken: which one, and with it which piece, shows one by one
            values = {
                n: np.full(a.shape, PENDING if n == "status" else np.nan, a.dtype) for n, a in self.arrays.items()
            }
            for number in done:
                for name, array in (self._region(number) or {}).items():
                    values[name][number * chunk : (number + 1) * chunk] = array
        messages: dict[int, str] = {}
        damaged: set[int] = set()
        for number in range(self.pieces):
            region = slice(number * chunk, (number + 1) * chunk)
            if number in done:
                mark = self._mark(number)
                if mark is not None and self._is_sound(number, mark, {n: a[region] for n, a in values.items()}):
                    messages |= {number * chunk + int(i): text for i, text in mark["messages"].items()}
                    continue
                damaged.add(number)
            for name, array in values.items():  # also a region that was interrupted
                array[region] = PENDING if name == "status" else np.nan
        return values, messages, damaged

    def axes(self) -> dict[str, np.ndarray]:
        """Values of each path along its dimension.

        Raises:
            HeadwayError: if they are damaged.
        """
        import zarr

        axes = {}
        for name, entry in self.about["axes"].items():
            if "values" in entry:
                axes[name] = np.empty(len(entry["values"]), dtype=object)
                axes[name][:] = entry["values"]
                continue
            try:
                axes[name] = np.asarray(zarr.open_array(self.path / _array_name(name), mode="r")[:])
            except Exception:  # of Zarr, of a codec, of the disk
                axes[name] = np.empty(0)
            if _of_values(axes[name]) != entry["digest"]:
                raise HeadwayError(f"{self.path}: the axis {name} is damaged; remove the store and run the study anew")
        return axes

    def status(self) -> dict[str, Any]:
        """What is done, without reading values: points, pieces, and how many points came to what."""
        counts = np.zeros(len(STATUS), dtype=int)
        marks = [mark for n in self.complete() if (mark := self._mark(n)) is not None]
        for mark in marks:
            counts += mark["status"]
        points = int(self.about["points"])
        counts[PENDING] = points - int(counts[OK:PENDING].sum())
        return {
            "title": self.about["title"],
            "points": points,
            "pieces": self.pieces,
            "complete": len(marks),
            **dict(zip(STATUS, counts.tolist(), strict=True)),
        }

    def _mark(self, number: int) -> dict[str, Any] | None:
        """What a mark says, if it is whole and this piece's."""
        try:
            text = (self.path / _MARKS / f"{number}.json").read_text(encoding="utf-8")
        except (OSError, ValueError):
            return None
        return _unsealed(text, None, self.about["hash"], number)

    def _region(self, number: int) -> dict[str, np.ndarray] | None:
        """Values of a piece by array, if they can be read."""
        region = slice(number * self.about["chunk"], (number + 1) * self.about["chunk"])
        try:
            return {name: np.asarray(array[region]) for name, array in self.arrays.items()}
        except Exception:  # of Zarr, of a codec, of the disk
            return None

    def _is_sound(self, number: int, mark: Mapping[str, Any], values: Mapping[str, np.ndarray] | None) -> bool:
        return values is not None and mark["values"] == self._digest(number, values)

    def _digest(self, number: int, values: Mapping[str, np.ndarray]) -> str:
        """SHA-256 of values by array, bound to the study and the piece."""
        digest = hashlib.sha256(f"{self.about['hash']} {number}".encode())
        for name in sorted(values):
            digest.update(f"\n{name}\n".encode())
            digest.update(values[name].tobytes())
        return digest.hexdigest()


def _path(path: Any) -> Path:
    if not isinstance(path, str | os.PathLike) or not os.fspath(path):
        raise HeadwayError(f"store = {shorten(path)} is not the path of a folder")
    return Path(path)


def _array_name(path: str) -> str:
    """The name of the array of an axis or metric, which may have any name."""
    return quote(path, safe="")


def _of_values(values: np.ndarray) -> str:
    return hashlib.sha256(f"{values.dtype} {values.shape}".encode() + values.tobytes()).hexdigest()


def _seal(content: Any, *bound: Any) -> str:
    return hashlib.sha256(json.dumps([*bound, content], sort_keys=True).encode()).hexdigest()


def _sealed(content: dict[str, Any], *bound: Any) -> dict[str, Any]:
    """A table with a seal: a digest of it and of what it is bound to."""
    return {**content, "seal": _seal(json.loads(json.dumps(content)), *bound)}


def _unsealed(text: str, key: str | None, *bound: Any) -> dict[str, Any] | None:
    """The table in a text of JSON (or that at `key` in it), if its seal fits."""
    try:
        table = json.loads(text)
        content = dict(table if key is None else table[key])
        return content if content.pop("seal") == _seal(content, *bound) else None
    except (ValueError, TypeError, KeyError, RecursionError):
        return None


def _shapes(about: Mapping[str, Any]) -> dict[str, tuple[tuple[int, ...], tuple[int, ...], str]]:
    """Shape, chunks and type of each array over points."""
    points, chunk = about["points"], min(about["chunk"], about["points"])
    wide = {name: (about["vehicles"],) if each else () for name, each in about["metrics"].items()}
    shapes = {name: ((points, *more), (chunk, *more), "float64") for name, more in wide.items()}
    return {**shapes, "status": ((points,), (chunk,), "int8")}


def _arrays(place: Path, about: Mapping[str, Any], mode: str) -> dict[str, Any]:
    """The arrays over points; `HeadwayError` if one is not what the description says."""
    import zarr

    arrays = {}
    for name, expected in _shapes(about).items():
        try:
            array = zarr.open_array(place / _array_name(name), mode=mode)
            actual: Any = (array.shape, array.chunks, str(array.dtype))
        except Exception:  # what Zarr says of metadata that are missing or broken is of many types
            actual = None
        if actual != expected:
            raise HeadwayError(
                f"{place}: the array {name} is missing or damaged; put its zarr.json back, "
                "or remove the store and run the study anew"
            )
        arrays[name] = array
    return arrays


def _create(place: Path, about: dict[str, Any], axes: Mapping[str, np.ndarray]) -> None:
    """Make a store beside its place and move it there, so that it is there as a whole or not at all."""
    import zarr
    from zarr.codecs import Crc32cCodec, ZstdCodec

    temporary = place.with_name(f".{place.name}.{os.getpid()}")
    checked: Any = {"compressors": [ZstdCodec(), Crc32cCodec()]}  # other readers notice a broken chunk too
    order = {"dimensions": list(about["dims"]), "shape": list(about["dims"].values())}
    try:
        group = zarr.create_group(temporary, attributes={**about["attrs"], **order, "title": about["title"]})
        for name, (shape, chunks, kind) in _shapes(about).items():
            unit, meaning = about["described"].get(name, ("", ""))
            attributes: dict[str, Any] = {"units": unit, "long_name": meaning} if meaning else {}
            if name == "status":
                attributes = {"flag_values": list(range(len(STATUS))), "flag_meanings": " ".join(STATUS)}
            group.create_array(
                _array_name(name), shape=shape, chunks=chunks, dtype=kind, attributes=attributes, **checked,
                fill_value=PENDING if name == "status" else np.nan, dimension_names=("point", "vehicle")[: len(shape)],
            )  # fmt: skip
        placed: dict[str, Any] = {}
        for name, values in axes.items():
            if values.dtype == object:
                placed[name] = {"values": values.tolist()}
                continue
            placed[name] = {"digest": _of_values(values)}
            array = group.create_array(
                _array_name(name), shape=values.shape, dtype=values.dtype, chunks=values.shape,
                dimension_names=(about["along"][name],), attributes={"long_name": name}, **checked,
            )  # fmt: skip
            array[:] = values
        group.create_group(_MARKS, attributes=_sealed({**about, "axes": placed}))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # that other readers than Zarr's and xarray's may not use it
            zarr.consolidate_metadata(group.store)
        try:
            os.rename(temporary, place)
        except OSError:
            if not (place / _MARKS / _DESCRIPTION).exists():  # else another process was faster
                raise
    finally:
        shutil.rmtree(temporary, ignore_errors=True)


@contextmanager
def _writing(path: Path) -> Iterator[None]:
    """Turn an error of the disk into one sentence."""
    try:
        yield
    except OSError as error:
        raise HeadwayError(
            f"{path}: cannot be written ({error.strerror or error}); what is complete stays; it can be resumed"
        ) from None
