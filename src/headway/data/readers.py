"""Readers: from a file as others publish it to a `Recording`.

Formats
- `headway`: the NetCDF file that `headway.save` writes. (Its CSV file is `tidy`.)
- `tidy`: CSV or Parquet, one row per vehicle and time: `time_s, vehicle, [position_m,] speed_mps, gap_m`, or any
  names and units through `columns` and `units`. Without a vehicle column it is one vehicle (a drive cycle).
- `openacc-astazero`: `Time, Speed1..n, IVS1..n-1`; seconds, m/s, m. IVS is the bumper-to-bumper spacing: its rate
  follows the speed difference with a slope of 1.00, and it is 2.6 to 4.7 m at standstill.
- `openacc-zalazone`: five header lines, then `Time, Speed1, E1, N1, Lon1, Lat1, Alt1, Speed2, …, IVS1…`; units as
  above. IVS is the straight distance between two antennas less a constant for each pair, bumper to bumper.
- `ngsim`: one row per vehicle and frame of 0.1 s; feet and ft/s; `Space_Headway` is front to front, so the gap is
  the headway less the length of the vehicle ahead.

Missing values stay NaN, and what was assumed is in `Recording.notes`.
"""

from __future__ import annotations

import os
import re
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from headway.checked import typed
from headway.data.ngsim import COLUMNS as NGSIM_COLUMNS
from headway.data.ngsim import canonical, read_ngsim
from headway.data.recording import DEFAULT_LENGTH, Floats, Recording, vehicle_lengths
from headway.data.tables import (
    UNITS,
    Head,
    checked_units,
    is_hdf,
    need_columns,
    need_plausible,
    need_rising,
    need_two_times,
    no_column,
    number_column,
    read_csv,
    read_head,
    read_parquet,
    to_si,
)
from headway.errors import HeadwayError, shorten, unknown_name
from headway.results import open_results

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["DEFAULT_LENGTH", "FORMATS", "UNITS", "Recording", "read"]

FORMATS = ("tidy", "openacc-astazero", "openacc-zalazone", "ngsim", "headway")

# Column names that say their unit; a bare `speed` does not, and is asked about instead of guessed.
_TIDY = {
    "time": {"time_s": "s", "time_ms": "ms", "time [s]": "s"},
    "vehicle": {"vehicle": ""},
    "speed": {"speed_mps": "m/s", "speed_kmh": "km/h", "speed_mph": "mph", "speed [m/s]": "m/s"},
    "gap": {"gap_m": "m", "gap_ft": "ft", "gap [m]": "m"},
    "position": {"position_m": "m", "position_ft": "ft", "position [m]": "m"},
}


@typed
def read(
    path: str | os.PathLike[str],
    *,
    format: str | None = None,
    columns: Mapping[str, str] | None = None,
    units: Mapping[str, str] | None = None,
    length: float | Sequence[float] = DEFAULT_LENGTH,
    vehicle: int | None = None,
    followers: int | None = None,
) -> Recording:
    """The recording in a file; times [s] as in the file, speeds [m/s], gaps [m] bumper to bumper.

    Args:
        path: the file.
        format: one of `FORMATS`; None looks at the file.
        columns: for `tidy`, the file's name of each of time, vehicle, speed, gap, position.
        units: of time, speed, gap, position where they are not SI, such as {"speed": "km/h"}.
        length: length of vehicles [m] > 0, one for all or one each, leader first, where the file has none (NGSIM has).
        vehicle: for `ngsim`, the id of the last follower.
        followers: for `ngsim`, at most how many followers up to it.

    Raises:
        HeadwayError: for a file that is missing, unreadable, empty, binary, unsorted or of an unknown format; for a
            column or unit that is not there; for a cell that is no number; for numbers that look like another unit.
    """
    if format is not None and format not in FORMATS:
        raise unknown_name("format", format, FORMATS)
    if is_hdf(path):
        if format not in (None, "headway") or columns or units or vehicle is not None or followers is not None:
            raise HeadwayError(
                f"{path}: is headway's own NetCDF file, which needs no format, columns, units or vehicle"
            )
        return _read_results(path, length)
    if format == "headway":
        raise HeadwayError(f"{path}: is not a NetCDF file, which the format 'headway' is; its CSV file is 'tidy'")
    head = read_head(path)
    frame = read_parquet(head) if head.parquet else None
    kind, line = _sniffed(head, frame, format, columns)
    if kind != "ngsim" and (vehicle is not None or followers is not None):
        raise HeadwayError(f"{head.place}: vehicle= and followers= belong to the format 'ngsim', and this is {kind!r}")
    if kind != "tidy" and columns:
        raise HeadwayError(f"{head.place}: columns= belongs to the format 'tidy', and this is {kind!r}")
    if kind == "ngsim":
        if frame is None:
            frame = read_csv(head) if line == 0 else read_csv(head, header=None, names=list(NGSIM_COLUMNS))
        return read_ngsim(frame, head.place, vehicle, followers, units)
    if frame is None:
        frame = read_csv(head, header=line)
    if kind == "tidy":
        return _read_tidy(frame, head.place, columns, units, length)
    return _read_openacc(frame, head, kind, line, units, length)


def _sniffed(
    head: Head, frame: pd.DataFrame | None, format: str | None, columns: Mapping[str, str] | None
) -> tuple[str, int]:
    """The format and the line (from 0) of the column names; -1 where there are none."""
    if frame is not None:
        header, line = [str(column) for column in frame.columns], 0
    else:
        line = next((k for k in range(len(head.lines)) if {"Time", "Speed1"} <= set(head.fields(k))), 0)
        header = head.fields(line)
    if format in (None, "ngsim") and len(header) == 1 and len(head.lines[0].split()) == len(NGSIM_COLUMNS):
        return "ngsim", -1
    if format is not None:
        return format, line
    names = set(header)
    if {"Time", "Speed1"} <= names and not columns:
        return ("openacc-zalazone" if line else "openacc-astazero"), line
    if {"Vehicle_ID", "Frame_ID", "Preceding"} <= {canonical(name) for name in header} and not columns:
        return "ngsim", 0
    if columns or (names & set(_TIDY["time"]) and names & set(_TIDY["speed"])):
        return "tidy", 0
    raise HeadwayError(
        f"{head.place}: the format is not known from its first line, {shorten(', '.join(header), 100)}; known are tidy "
        "(time_s, vehicle, speed_mps, gap_m, or other names through columns=), openacc-astazero (Time, Speed1, …, "
        "IVS1, …), openacc-zalazone (the same below five header lines) and ngsim (Vehicle_ID, Frame_ID, …)"
    )


def _read_results(path: str | os.PathLike[str], length: float | Sequence[float]) -> Recording:
    """Trajectories that `headway.save` wrote, as a recording."""
    dataset = open_results(path)
    place = os.path.basename(os.fspath(path))
    for name in ("position", "speed", "gap"):
        if name not in dataset or dataset[name].dims != ("vehicle", "time"):
            raise HeadwayError(f"{place}: the file has no {name!r} along vehicle and time, as headway.save writes it")
    speed, gap, position = (np.asarray(dataset[n].values, dtype=np.float64) for n in ("speed", "gap", "position"))
    return Recording.from_gaps(
        np.asarray(dataset.time.values, dtype=np.float64), speed, gap, leader_position=position[0], lengths=length,
        source=place, notes=("Simulated by headway.",),
    )  # fmt: skip


# -- tidy ---------------------------------------------------------------------------------------------------------


def _read_tidy(
    frame: pd.DataFrame,
    place: str,
    columns: Mapping[str, str] | None,
    units: Mapping[str, str] | None,
    length: float | Sequence[float],
) -> Recording:
    stated = checked_units(units, ("time", "speed", "gap", "position"))
    chosen = _tidy_columns(frame, place, columns)
    values: dict[str, Floats] = {}
    for quantity, (column, unit) in chosen.items():
        if quantity != "vehicle":
            cells = number_column(frame, column, place, missing=quantity != "time")
            values[quantity] = to_si(cells, quantity, stated.get(quantity, unit))
    names, index, notes = _vehicle_index(frame, chosen, place)
    time, tables, absent = _pivoted(values, index, names, np.asarray(frame.index), place)
    if absent:
        notes.append(f"{absent} rows are absent for vehicles that have no sample at a time of another; they are NaN.")
    need_plausible(time, tables["speed"], stated, place)
    return _assembled(time, tables, names, length, place, notes)


def _tidy_columns(frame: pd.DataFrame, place: str, columns: Mapping[str, str] | None) -> dict[str, tuple[str, str]]:
    """For each quantity that the file has, its column and the unit that the column's name or SI gives."""
    chosen: dict[str, tuple[str, str]] = {}
    for quantity, column in (columns or {}).items():
        if quantity not in _TIDY:
            raise unknown_name("columns", quantity, _TIDY)
        if column not in frame.columns:
            raise no_column(f"{place}: columns[{quantity!r}] = {column!r} is not there", column, frame)
        si = next(iter(_TIDY[quantity].values()))
        chosen[quantity] = (column, _TIDY[quantity].get(column, si))
    for quantity, aliases in _TIDY.items():
        for column, unit in aliases.items():
            if quantity not in chosen and column in frame.columns:
                chosen[quantity] = (column, unit)
    for quantity in ("time", "speed"):
        if quantity not in chosen:
            raise HeadwayError(
                f"{place}: there is no column for {quantity}; known names are {', '.join(_TIDY[quantity])}, the file "
                f"has {shorten(', '.join(frame.columns), 100)}, and columns={{{quantity!r}: …}} names another"
            )
    return chosen


def _vehicle_index(
    frame: pd.DataFrame, chosen: Mapping[str, tuple[str, str]], place: str
) -> tuple[list[str], Any, list[str]]:
    """Names of the vehicles, leader first: ascending numbers, or words as they appear; each row's vehicle; notes."""
    import pandas as pd

    if "vehicle" not in chosen:
        return ["vehicle 0"], np.zeros(len(frame), dtype=int), []
    column = chosen["vehicle"][0]
    cells = frame[column]
    if cells.isna().any():
        line = frame.index[int(np.argmax(np.asarray(cells.isna())))]
        raise HeadwayError(f"{place}, line {line}, column {column!r}: an empty cell, where a vehicle is needed")
    index, labels = pd.factorize(cells, sort=bool(pd.api.types.is_numeric_dtype(cells)))
    if list(labels) == list(range(len(labels))):
        return [f"vehicle {n}" for n in range(len(labels))], index, []
    names = [str(label).removesuffix(".0") for label in labels]
    return names, index, [f"Vehicle order, leader first: {', '.join(names)}."]


def _pivoted(
    values: Mapping[str, Floats], index: Any, names: list[str], lines: Any, place: str
) -> tuple[Floats, dict[str, Floats], int]:
    """Common times (T,), tables (V, T) of all else, and how many (vehicle, time) have no row."""
    rows_of = [np.flatnonzero(index == n) for n in range(int(index.max()) + 1)]
    for n, rows in enumerate(rows_of):
        need_rising(values["time"][rows], lines[rows], place, f" of {names[n]}" if len(rows_of) > 1 else "")
    time = np.unique(values["time"])
    need_two_times(time, place)
    finest = min((np.median(np.diff(values["time"][rows])) for rows in rows_of if rows.size > 1), default=0.0)
    if np.median(np.diff(time)) < 0.75 * finest:
        raise HeadwayError(
            f"{place}: the vehicles are not sampled at common times ({time.size} different ones, {finest:g} s apart "
            "for one vehicle); sample them at common times first"
        )
    tables = {}
    for quantity in values:
        if quantity != "time":
            tables[quantity] = np.full((len(rows_of), time.size), np.nan)
            for n, rows in enumerate(rows_of):
                tables[quantity][n, np.searchsorted(time, values["time"][rows])] = values[quantity][rows]
    return time, tables, len(rows_of) * time.size - index.size


def _assembled(
    time: Floats,
    tables: Mapping[str, Floats],
    names: list[str] | None,
    length: float | Sequence[float],
    place: str,
    notes: list[str],
) -> Recording:
    """The recording from tables of speed and of gap or position, positions rebuilt from gaps."""
    speed, position = tables["speed"], tables.get("position")
    vehicles = speed.shape[0]
    sizes = vehicle_lengths(length, vehicles, place)
    gap = tables["gap"].copy() if "gap" in tables else np.full_like(speed, np.nan)
    if np.isfinite(gap[0]).any():
        notes.append(f"{int(np.isfinite(gap[0]).sum())} gaps on the leader's rows are left out.")
    gap[0] = np.nan
    if vehicles > 1 and not np.isfinite(gap).any():
        if position is None or not np.isfinite(position[1:]).any():
            raise HeadwayError(f"{place}: {vehicles} vehicles have neither gaps nor positions; a column is needed")
        gap[1:] = position[:-1] - np.array(sizes[:-1])[:, None] - position[1:]
        notes.append("There are no gaps in the source: they are differences of its positions less vehicle lengths.")
    if vehicles > 1:
        notes.append(_length_note(sizes))
    leader = position[0] if position is not None and np.isfinite(position[0]).any() else None
    recording = Recording.from_gaps(
        time, speed, gap, leader_position=leader, names=names, lengths=sizes, source=place, notes=notes
    )
    if position is None or vehicles == 1:
        return recording
    away = np.abs(recording.position[1:] - position[1:])
    if np.isfinite(away).any() and np.nanmax(away) > 0.01:
        note = f"Positions rebuilt from gaps differ from those in the file by up to {np.nanmax(away):.3g} m."
        return Recording(**{**vars(recording), "notes": (*recording.notes, note)})
    return recording


def _length_note(sizes: tuple[float, ...]) -> str:
    what = f"{sizes[0]:g} m for every vehicle" if len(set(sizes)) == 1 else ", ".join(f"{s:g}" for s in sizes) + " m"
    return f"The source has no vehicle lengths: {what} is taken, which shifts rebuilt positions and no gap."


# -- OpenACC ------------------------------------------------------------------------------------------------------


def _read_openacc(
    frame: pd.DataFrame,
    head: Head,
    kind: str,
    line: int,
    units: Mapping[str, str] | None,
    length: float | Sequence[float],
) -> Recording:
    place = head.place
    stated = checked_units(units, ("time", "speed", "gap"))
    need_columns(frame, ["Time", "Speed1"], place)
    vehicles = 1
    while f"Speed{vehicles + 1}" in frame.columns:
        vehicles += 1
    spacings = [f"IVS{n}" for n in range(1, vehicles)]
    need_columns(frame, spacings, place)
    # a column in the middle that is gone must not make a shorter platoon in silence
    numbered = re.compile(r"(Speed|IVS)0*([0-9]{1,6})")
    last = {"Speed": vehicles, "IVS": vehicles - 1}
    for column in map(str, frame.columns):
        match = numbered.fullmatch(column.strip())
        if match is not None and int(match[2]) > last[match[1]]:
            missing = f"Speed{vehicles + 1}" if f"Speed{vehicles + 1}" not in frame.columns else f"IVS{vehicles}"
            raise HeadwayError(
                f"{place}: there is a column {column!r} but no {missing!r}; vehicles are numbered without a hole, the "
                "speeds Speed1 to SpeedN and the gaps IVS1 to IVS(N-1)"
            )
    time = to_si(number_column(frame, "Time", place, missing=False), "time", stated.get("time", "s"))
    need_rising(time, np.asarray(frame.index), place)
    need_two_times(time, place)
    speed = np.array([number_column(frame, f"Speed{n + 1}", place) for n in range(vehicles)])
    gap = np.full_like(speed, np.nan)
    for n, column in enumerate(spacings):
        gap[n + 1] = number_column(frame, column, place)
    tables = {
        "speed": to_si(speed, "speed", stated.get("speed", "m/s")),
        "gap": to_si(gap, "gap", stated.get("gap", "m")),
    }
    need_plausible(time, tables["speed"], stated, place)
    names, notes = _openacc_header(head, line, vehicles) if line else (None, [])
    return _assembled(time, tables, names, length, place, notes)


def _openacc_header(head: Head, line: int, vehicles: int) -> tuple[list[str] | None, list[str]]:
    """Vehicle names and notes from the lines above the column names."""
    header = {cells[0]: [cell for cell in cells[1:] if cell] for cells in map(head.fields, range(line)) if cells[0]}
    notes = [
        "Header: " + "; ".join(f"{key} {', '.join(header[key])}" for key in header if key != "Vehicle_order") + "."
    ]
    count = (header.get("Number_of_vehicles") or [str(vehicles)])[0]
    if count != str(vehicles):
        raise HeadwayError(
            f"{head.place}: Number_of_vehicles is {shorten(count)} and there are {vehicles} columns Speed1, Speed2, …"
        )
    names = header.get("Vehicle_order", [])
    if len(names) == vehicles:
        return names, notes
    if names:
        notes.append(f"Vehicle_order has {len(names)} names for {vehicles} vehicles, so the names are left out.")
    return None, notes
