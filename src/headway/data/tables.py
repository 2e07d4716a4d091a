"""Tables as people keep them: text files and Parquet, read cell by cell with a place to every complaint."""

from __future__ import annotations

import codecs
import os
import warnings
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from headway.checked import as_path
from headway.errors import HeadwayError, did_you_mean, shorten, unknown_name

if TYPE_CHECKING:
    import pandas as pd

Floats = NDArray[np.float64]

_LENGTHS = {"m": (1.0, 1.0), "ft": (0.3048, 1.0), "km": (1000.0, 1.0), "cm": (1.0, 100.0), "mi": (1609.344, 1.0)}

UNITS: dict[str, dict[str, tuple[float, float]]] = {
    "time": {"s": (1.0, 1.0), "ms": (1.0, 1000.0), "us": (1.0, 1e6), "min": (60.0, 1.0), "h": (3600.0, 1.0)},
    "speed": {
        "m/s": (1.0, 1.0),
        "km/h": (1.0, 3.6),
        "mph": (0.44704, 1.0),
        "ft/s": (0.3048, 1.0),
        "kn": (1852.0, 3600.0),
    },
    "gap": _LENGTHS,
    "position": _LENGTHS,
    "length": _LENGTHS,
}
"""Units understood, as SI = value * first / second; a quotient keeps km/h correctly rounded."""


def checked_units(units: Mapping[str, str] | None, allowed: Iterable[str]) -> dict[str, str]:
    """The units of quantities, each quantity allowed and each unit understood.

    Args:
        units: quantity → unit, such as {"speed": "km/h"}; None counts as empty.
        allowed: quantities that may have one.

    Raises:
        HeadwayError: for another quantity, and for a unit that is not in `UNITS`.
    """
    units = dict(units or {})
    for quantity, unit in units.items():
        if quantity not in allowed:
            raise unknown_name("units", quantity, allowed)
        if unit not in UNITS[quantity]:
            raise unknown_name(f"units[{quantity!r}]", unit, UNITS[quantity])
    return units


def to_si(values: Floats, quantity: str, unit: str) -> Floats:
    """Values of a quantity (a key of `UNITS`) in one of its units, converted to SI."""
    times, over = UNITS[quantity][unit]
    return values * times / over if over != 1.0 else values * times


@dataclass(frozen=True)
class Head:
    """The first lines of a file, and whether it is Parquet.

    Attributes:
        path: the file.
        lines: its first lines, without line ends; empty for Parquet.
        parquet: whether it is a Parquet file.
    """

    path: Path
    lines: tuple[str, ...]
    parquet: bool = False

    @property
    def place(self) -> str:
        """The file's name, as messages call it."""
        return self.path.name

    def fields(self, line: int = 0) -> list[str]:
        """The cells of one of the first lines."""
        return [cell.strip().strip('"') for cell in self.lines[line].split(self.separator(line))]

    def separator(self, line: int = 0) -> str:
        """The delimiter that occurs most often in a line: comma, semicolon or tab."""
        return max(",;\t", key=self.lines[line].count)


def is_hdf(path: str | os.PathLike[str]) -> bool:
    """Whether a file begins as NetCDF 4 does; False where it cannot be read."""
    try:
        with as_path(path, "file").open("rb") as stream:
            return stream.read(8) == b"\x89HDF\r\n\x1a\n"
    except OSError:
        return False


def read_head(path: str | os.PathLike[str], lines: int = 12) -> Head:
    """The head of a file.

    Args:
        path: the file.
        lines: at most how many lines.

    Raises:
        HeadwayError: where it is missing, unreadable, empty or not text.
    """
    path = as_path(path, "file")
    try:
        with path.open("rb") as stream:
            start = stream.read(1 << 16)
    except FileNotFoundError:
        raise HeadwayError(f"{path}: there is no such file{_near_file(path)}") from None
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise HeadwayError(f"{path}: the file cannot be read ({reason})") from None
    if start[:4] == b"PAR1":
        return Head(path, (), parquet=True)
    if not start.strip(b"\xef\xbb\xbf \t\r\n"):
        raise HeadwayError(f"{path.name}: the file is empty")
    try:
        text = codecs.getincrementaldecoder("utf-8-sig")().decode(start)
    except UnicodeDecodeError:
        text = "\0"
    if "\0" in text:
        raise HeadwayError(f"{path.name}: the file is binary or not UTF-8 text; CSV text or Parquet is needed")
    return Head(path, tuple(text.splitlines()[:lines]))


def _near_file(path: Path) -> str:
    folder = path.parent
    return did_you_mean(path.name, (p.name for p in folder.iterdir())) if folder.is_dir() else ""


def read_parquet(head: Head) -> pd.DataFrame:
    """A Parquet file as a frame whose index is the row number from 1."""
    import pandas as pd

    try:
        frame = pd.read_parquet(head.path)
    except Exception as error:  # pyarrow raises many kinds; the sentence is the same
        raise HeadwayError(f"{head.place}: the Parquet file cannot be read ({_first_line(error)})") from None
    frame.columns = [str(column) for column in frame.columns]
    frame.index = np.arange(1, len(frame) + 1)
    return _not_empty(frame, head)


def read_csv(head: Head, *, header: int | None = 0, names: list[str] | None = None) -> pd.DataFrame:
    """A text table as a frame whose index is the line number in the file.

    Columns keep the type that pandas gives them; `number_column` complains about words in them.

    Args:
        head: the head of the file.
        header: the line (from 0) that holds the column names; None: there is none, and cells are separated by blanks.
        names: column names where the file has none.

    Raises:
        HeadwayError: for a column named twice, rows that do not fit, text that is not UTF-8, and no rows.
    """
    import pandas as pd

    if header is not None:
        repeated = sorted({name for name in head.fields(header) if name and head.fields(header).count(name) > 1})
        if repeated:
            raise HeadwayError(f"{head.place}: line {header + 1} names the column {repeated[0]!r} more than once")
    separator = r"\s+" if header is None else head.separator(header)
    try:
        with warnings.catch_warnings():
            # A row longer than the header would otherwise lose its last cells with a mere warning.
            warnings.simplefilter("error", pd.errors.ParserWarning)
            frame = pd.read_csv(
                head.path,
                sep=separator,
                skiprows=header or 0,
                header=None if header is None else 0,
                names=names,
                index_col=False,
                skip_blank_lines=False,
                skipinitialspace=True,
                low_memory=False,
                encoding="utf-8-sig",
            )
    except (pd.errors.ParserError, pd.errors.ParserWarning, pd.errors.EmptyDataError) as error:
        raise HeadwayError(f"{head.place}: the rows do not fit the header ({_first_line(error)})") from None
    except UnicodeDecodeError:
        raise HeadwayError(f"{head.place}: the file is not UTF-8 text throughout") from None
    frame.columns = [str(column).strip() for column in frame.columns]
    frame.index = np.arange(len(frame)) + (1 if header is None else header + 2)
    return _not_empty(frame.dropna(how="all"), head)


def _not_empty(frame: pd.DataFrame, head: Head) -> pd.DataFrame:
    if frame.empty:
        raise HeadwayError(f"{head.place}: the file has column names but no rows")
    return frame


def _first_line(error: object) -> str:
    text = " ".join(str(error).split()).rstrip(".")
    return text if len(text) <= 120 else text[:119] + "…"


def need_columns(frame: pd.DataFrame, columns: Iterable[str], place: str) -> None:
    """Refuse a frame that lacks one of the columns.

    Args:
        frame: the table.
        columns: names that it needs.
        place: the name of the file in messages.

    Raises:
        HeadwayError: naming the first that is missing, and the nearest that is there.
    """
    for column in columns:
        if column not in frame.columns:
            raise no_column(f"{place}: there is no column {column!r}", column, frame)


def no_column(complaint: str, column: str, frame: pd.DataFrame) -> HeadwayError:
    """The error for a column that is not in the frame; of a file with many columns it names a part."""
    has = shorten(", ".join(map(str, frame.columns)), 100)
    return HeadwayError(f"{complaint}; the file has {has}{did_you_mean(column, frame.columns)}")


def number_column(frame: pd.DataFrame, column: str, place: str, *, missing: bool = True) -> Floats:
    """A column as float64, NaN where a cell is empty.

    Args:
        frame: the table; its index is the line number in the file.
        column: name of the column.
        place: the name of the file in messages.
        missing: whether cells may be empty.

    Raises:
        HeadwayError: naming line and column of a cell that is no number, infinite or beyond any sensible size, and of
            an empty one where `missing` is false.
    """
    import pandas as pd

    cells = frame[column]
    if not (pd.api.types.is_numeric_dtype(cells) or pd.api.types.is_object_dtype(cells) or _is_text(cells)):
        raise HeadwayError(f"{place}: column {column!r} holds {cells.dtype}, and numbers are needed")
    try:
        values = np.asarray(pd.to_numeric(cells, errors="coerce"), dtype=np.float64)
    except (OverflowError, TypeError, ValueError):  # whole numbers without end, one by one
        values = np.array([_as_float(cell) for cell in cells], dtype=np.float64)
    wrong = (np.isnan(values) & ~np.asarray(cells.isna())) | np.isinf(values)
    if wrong.any():
        raise HeadwayError(f"{_cell(frame, column, wrong, place)} {_first(cells, wrong)} is not a finite number")
    vast = np.abs(values) > 1e18  # no time, length or id is; sums and products of such numbers overflow
    if vast.any():
        raise HeadwayError(f"{_cell(frame, column, vast, place)} {_first(cells, vast)} is beyond any sensible size")
    if not missing and np.isnan(values).any():
        raise HeadwayError(f"{_cell(frame, column, np.isnan(values), place)} an empty cell, where a number is needed")
    return values


def _as_float(cell: Any) -> float:
    """A cell as a number; infinite if it is too large for one, NaN if it is none."""
    try:
        return float(cell)
    except OverflowError:
        return float("inf")
    except (TypeError, ValueError):
        return float("nan")


def _is_text(cells: Any) -> bool:
    import pandas as pd

    return bool(pd.api.types.is_string_dtype(cells))


def _first(cells: Any, wrong: NDArray[np.bool_]) -> str:
    value = cells.iloc[int(np.argmax(wrong))]
    return shorten(value.item() if hasattr(value, "item") else value)


def _cell(frame: pd.DataFrame, column: str, wrong: NDArray[np.bool_], place: str) -> str:
    return f"{place}, line {frame.index[int(np.argmax(wrong))]}, column {column!r}:"


def need_rising(time: Floats, lines: NDArray[Any], place: str, who: str = "") -> None:
    """Refuse times that repeat or go back.

    Args:
        time: (T,) [s].
        lines: line numbers (T,) in the file.
        place: the name of the file in messages.
        who: whose times they are, for messages.

    Raises:
        HeadwayError: naming the first such line.
    """
    step = np.diff(time)
    if (step > 0).all():
        return
    k = int(np.argmax(step <= 0))
    fault = "is there twice" if step[k] == 0 else f"comes after {time[k]:.10g} s"
    raise HeadwayError(f"{place}, line {lines[k + 1]}: time {time[k + 1]:.10g} s{who} {fault}; times must rise")


def need_two_times(time: Floats, place: str) -> None:
    """Refuse a file whose rows (T,) [s] are all of one time.

    Raises:
        HeadwayError: naming that time.
    """
    if time.size < 2:
        raise HeadwayError(f"{place}: there is one time only, {time[0]:g} s; a recording needs at least two")


def need_plausible(time: Floats, speed: Floats, stated: Mapping[str, str], place: str) -> None:
    """Refuse numbers that look like another unit; a unit stated by the user is believed.

    Speeds above 70 m/s (252 km/h) look like km/h, and steps of 10 s or more look like milliseconds.

    Args:
        time: (T,) [s].
        speed: (V, T) [m/s].
        stated: quantity → unit, as stated by the user.
        place: the name of the file in messages.

    Raises:
        HeadwayError: for such numbers, and where there is no speed at all.
    """
    if np.isnan(speed).all():
        raise HeadwayError(f"{place}: there is no speed in any row")
    top = float(np.nanmax(np.abs(speed)))
    if "speed" not in stated and top > 70.0:
        raise HeadwayError(
            f"{place}: the highest speed is {top:g} m/s, which looks like km/h; say units={{'speed': 'km/h'}}, or "
            f"units={{'speed': 'm/s'}} if it is right"
        )
    step = float(np.median(np.diff(time)))
    if "time" not in stated and step >= 10.0:
        raise HeadwayError(
            f"{place}: the samples are {step:g} s apart, which looks like milliseconds; say units={{'time': 'ms'}}, or "
            f"units={{'time': 's'}} if it is right"
        )
