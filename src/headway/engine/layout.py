"""How runs are laid out in arrays: what is shared between the plan, the runs and the kernel."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

#: columns of the table of groups (consecutive vehicles with one law and one channel)
GROUP = {
    name: i
    for i, name in enumerate(
        ("row", "rows", "count", "lag", "limits", "serial", "chained", "pure", *(f"signal{i}" for i in range(8)))
    )
}
SIGNAL_CODES = {name: i for i, name in enumerate(("s", "v", "dv", "a", "vl", "al", "v0l", "a0l"))}

#: per step: it starts at a jump; a look-up falls inside it; its start is recorded
FLAG_JUMP, FLAG_INSIDE, FLAG_RECORD = 1, 2, 4

#: what to do about events: nothing; return at the first; return after every step without counting it; note them
IGNORE, STOP_AT_EVENT, TRIAL, NOTE = range(4)

ROW, ROWS, COUNT, LAG, LIMITS, SERIAL, CHAINED, PURE, SIGNAL0 = range(9)


class Platoon(NamedTuple):
    """What does not change during a run. M = followers × lanes, elements in the order [vehicle][lane]."""

    groups: np.ndarray  # (G, 16) whole numbers, columns GROUP
    slots: np.ndarray  # (G, 8, 2) delay slot of each signal (of both halves of dv), -1 = current
    addresses: np.ndarray  # (G, 2) compiled loops: plain, chained
    parameters: np.ndarray  # (parameters, M)
    length: np.ndarray  # (M,) length of the vehicle ahead [m]
    lag: np.ndarray  # (M,) [s]
    limits: np.ndarray  # (2, M) least and largest command [m/s²]
    needs: np.ndarray  # (S, 3) whether a slot is asked for positions, speeds, accelerations
    span: np.ndarray  # (S, 2) rows that a slot is asked for


class Steps(NamedTuple):
    """The steps of a chunk: their lengths, the leader, and how to read the past. c = position of `mesh.AT`."""

    step: np.ndarray  # (n,) [s]
    flags: np.ndarray  # (n,)
    lead: np.ndarray  # (n, c, 3, 1 or lanes) position, speed, acceleration of the leader
    delayed_lead: np.ndarray  # (S, n, c, 3, 1 or lanes) the same, late by each slot's delay
    row: np.ndarray  # (S, n, c) history row, counted from the row of the chunk's first step
    motion: np.ndarray  # (S, n, c, 4)
    speed: np.ndarray  # (S, n, c, 4)
    acceleration: np.ndarray  # (S, n, c, 5)
    node: np.ndarray  # (S, n, c) 1 where the look-up is a node of the past, 2 where the next one, else 0


class State(NamedTuple):
    """What a run carries from step to step."""

    ring: np.ndarray  # (5, R, (N+1) lanes): position, speed, acceleration (right limit, where two), (left), extra point
    two: np.ndarray  # (R,) 1 where the acceleration of a node has two limits; else only the left one is kept
    K: np.ndarray  # (6, (N+1) lanes) accelerations of the stages
    J: np.ndarray  # (6, M) rates of change of accelerations behind a lag; rows 0 and 4 of the start and the end
    actual: np.ndarray  # ((N+1) lanes,) accelerations at the start of a step, which are states behind a lag
    stage: np.ndarray  # (2, (N+1) lanes) positions and speeds of a stage
    leader: np.ndarray  # (8, M) what is heard of the platoon leader, for every follower
    looked: np.ndarray  # (S, 2, 3, (N+1) lanes) what was read of the past
    command: np.ndarray  # (3, M) what laws asked for at the start and the end of a step, and a spare row
    sources: np.ndarray  # (8, 3) addresses of what each signal is made of
    go: np.ndarray  # (M,) 0 where a vehicle stands
    watch: np.ndarray  # (M,) 0 where events are ignored
    happened: np.ndarray  # (M,) 1 where an event was noted
