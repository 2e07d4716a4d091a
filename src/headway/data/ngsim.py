"""NGSIM's column layout: pick the string of vehicles ahead of one, as long as it stays the same.

Source of the layout: US DOT, Next Generation Simulation (NGSIM) vehicle trajectories, doi:10.21949/1504477.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from headway.data.recording import Floats, Recording
from headway.data.tables import checked_units, need_columns, need_plausible, number_column, to_si
from headway.errors import HeadwayError, did_you_mean

if TYPE_CHECKING:
    import pandas as pd

COLUMNS = (
    "Vehicle_ID", "Frame_ID", "Total_Frames", "Global_Time", "Local_X", "Local_Y", "Global_X", "Global_Y", "v_length",
    "v_Width", "v_Class", "v_Vel", "v_Acc", "Lane_ID", "Preceding", "Following", "Space_Headway", "Time_Headway",
)  # fmt: skip
"""The eighteen columns in the order of the headerless layout."""

FRAME = 0.1  # s

_USED = ("Vehicle_ID", "Frame_ID", "Local_Y", "v_length", "v_Vel", "Preceding", "Space_Headway")
_SPELLINGS = {name.lower(): name for name in COLUMNS} | {
    "space_hdwy": "Space_Headway",
    "time_hdwy": "Time_Headway",
    "lane_identification": "Lane_ID",
}


def canonical(column: str) -> str:
    """The layout's own spelling of a column name: releases of the data differ in case and in abbreviations."""
    return _SPELLINGS.get(column.lower(), column)


def read_ngsim(
    frame: pd.DataFrame, place: str, vehicle: int | None, followers: int | None, units: Mapping[str, str] | None
) -> Recording:
    """The recording of a vehicle and the string ahead of it over its longest stretch of frames without a change.

    The vehicle ahead is known by `Preceding`; a change of it ends the stretch and is said in `notes`.

    Args:
        frame: the table, with the columns of the layout; its index is the line number in the file.
        place: the name of the file in messages.
        vehicle: id of the last follower.
        followers: at most how many followers, 1 or more; None takes all.
        units: of position, gap, speed and length, where they are not feet and ft/s.

    Returns:
        The recording, leader first; its notes say which frames and why they begin and end there.

    Raises:
        HeadwayError: for an unknown or missing vehicle, one that follows nobody, and one that is there twice in a
            frame.
    """
    stated = {"position": "ft", "gap": "ft", "speed": "ft/s", "length": "ft"} | checked_units(
        units, ("position", "gap", "speed", "length")
    )
    frame = frame.rename(columns={name: canonical(name) for name in frame.columns})
    need_columns(frame, _USED, place)
    data = {name: number_column(frame, name, place) for name in _USED}
    for name in ("Vehicle_ID", "Frame_ID", "Preceding"):
        data[name] = number_column(frame, name, place, missing=False)
        odd = data[name] != np.floor(data[name])
        if odd.any():
            row = int(np.argmax(odd))
            raise HeadwayError(
                f"{place}, line {frame.index[row]}, column {name!r}: {data[name][row]:g} is not a whole number"
            )
    rows = _rows(data, place)
    if followers is not None and followers < 1:
        raise HeadwayError(f"followers: {followers!r} is not allowed; at least 1 is needed")
    chains = _chains(data, rows, _vehicle_id(vehicle, data, place), followers)
    frames, chain = _longest(chains)
    if len(chain) < 2 or len(frames) < 2:
        raise HeadwayError(
            f"{place}: vehicle {vehicle} has no vehicle ahead over two consecutive frames, so there is no platoon"
        )
    picked = np.array([[rows[member, k] for k in frames] for member in reversed(chain)])
    return _built(data, picked, chain, frames, stated, units, place, _story(chains, frames, chain))


def _rows(data: Mapping[str, Floats], place: str) -> dict[tuple[int, int], int]:
    """Row of each (vehicle, frame)."""
    rows: dict[tuple[int, int], int] = {}
    keys = zip(data["Vehicle_ID"].astype(int).tolist(), data["Frame_ID"].astype(int).tolist(), strict=True)
    for row, key in enumerate(keys):
        if rows.setdefault(key, row) != row:
            raise HeadwayError(
                f"{place}: vehicle {key[0]} is there twice in frame {key[1]}; keep one location and one period in a "
                "file"
            )
    return rows


def _vehicle_id(vehicle: int | None, data: Mapping[str, Floats], place: str) -> int:
    ids = np.unique(data["Vehicle_ID"]).astype(int)
    if vehicle is None:
        raise HeadwayError(
            f"{place}: NGSIM holds many platoons; say which with vehicle=, the id of the last follower (from "
            f"{ids[0]} to {ids[-1]}, {ids.size} of them)"
        )
    if vehicle not in ids:
        near = did_you_mean(vehicle, [str(k) for k in ids])
        raise HeadwayError(
            f"{place}: vehicle {vehicle!r} is not in the file, which has {ids.size} from {ids[0]} to {ids[-1]}{near}"
        )
    return int(vehicle)


def _chains(
    data: Mapping[str, Floats], rows: Mapping[tuple[int, int], int], vehicle: int, followers: int | None
) -> dict[int, tuple[int, ...]]:
    """For each frame of the vehicle, in order: itself, the one ahead, the one ahead of that, …."""
    ahead = data["Preceding"].astype(int)
    chains = {}
    for frame in sorted(frame for member, frame in rows if member == vehicle):
        chain = [vehicle]
        while followers is None or len(chain) <= followers:
            leader = int(ahead[rows[chain[-1], frame]])
            # 0 means nobody ahead; a leader without rows cannot be used; a circle would never end.
            if leader == 0 or leader in chain or (leader, frame) not in rows:
                break
            chain.append(leader)
        chains[frame] = tuple(chain)
    return chains


def _longest(chains: Mapping[int, tuple[int, ...]]) -> tuple[list[int], tuple[int, ...]]:
    """The longest run of consecutive frames with one chain of two or more, the first of equals, and that chain."""
    best: list[int] = []
    run: list[int] = []
    for frame, chain in chains.items():
        goes_on = run and frame == run[-1] + 1 and chain == chains[run[-1]]
        run = [*run, frame] if goes_on else [frame]
        if len(chain) > 1 and len(run) > len(best):
            best = run
    return best, chains[best[0]] if best else ()


def _story(chains: Mapping[int, tuple[int, ...]], frames: list[int], chain: tuple[int, ...]) -> list[str]:
    """What the stretch is and why it begins and ends where it does."""
    order = " → ".join(str(member) for member in reversed(chain))
    span = f"{frames[0]} to {frames[-1]}, of {len(chains)} frames"
    notes = [f"The string {order} (leader first) holds from frame {span}."]
    for frame, when in ((frames[0] - 1, "before"), (frames[-1] + 1, "after")):
        if frame in chains:
            notes.append(f"It is different {when}: {_difference(chain, chains[frame])} in frame {frame}.")
        elif any((k < frame) == (when == "before") and k != frame and k not in frames for k in chains):
            notes.append(f"Frame {frame} of vehicle {chain[0]} is absent.")
    return notes


def _difference(chain: tuple[int, ...], other: tuple[int, ...]) -> str:
    for k in range(1, max(len(chain), len(other))):
        mine, theirs = (c[k] if k < len(c) else None for c in (chain, other))
        if mine != theirs:
            return f"the vehicle ahead of {chain[k - 1]} is {theirs or 'nobody'} and not {mine or 'nobody'}"
    return "nothing"


def _built(
    data: Mapping[str, Floats],
    picked: np.ndarray,
    chain: tuple[int, ...],
    frames: list[int],
    stated: Mapping[str, str],
    units: Mapping[str, str] | None,
    place: str,
    notes: list[str],
) -> Recording:
    time = FRAME * np.array(frames, dtype=np.float64)
    speed = to_si(data["v_Vel"], "speed", stated["speed"])[picked]
    headway = to_si(data["Space_Headway"], "gap", stated["gap"])[picked]
    lengths = to_si(data["v_length"], "length", stated["length"])[picked]
    gap = np.full_like(speed, np.nan)
    gap[1:] = headway[1:] - lengths[:-1]
    need_plausible(time, speed, units or {}, place)
    notes.append("Gaps are Space_Headway, front to front, less the length of the vehicle ahead.")
    return Recording.from_gaps(
        time,
        speed,
        gap,
        leader_position=to_si(data["Local_Y"], "position", stated["position"])[picked][0],
        names=[str(member) for member in reversed(chain)],
        lengths=[float(size) for size in np.nanmedian(lengths, axis=1)],
        source=place,
        notes=notes,
    )
