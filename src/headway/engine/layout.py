"""How runs are laid out in arrays: what is shared between the plan, the runs and the kernel."""

from __future__ import annotations

from typing import Annotated, NamedTuple

import numpy as np

from headway.models.signal import SIGNALS

#: arrays without gaps by kind of number (floating, whole, boolean) and number of axes
F1 = Annotated[np.ndarray, "float64", 1]
F2 = Annotated[np.ndarray, "float64", 2]
F3 = Annotated[np.ndarray, "float64", 3]
F4 = Annotated[np.ndarray, "float64", 4]
F5 = Annotated[np.ndarray, "float64", 5]
I1 = Annotated[np.ndarray, "int64", 1]
I2 = Annotated[np.ndarray, "int64", 2]
I3 = Annotated[np.ndarray, "int64", 3]
B2 = Annotated[np.ndarray, "bool_", 2]

#: most signals of a law
MOST_SIGNALS = len(SIGNALS)

#: columns of the table of groups (consecutive vehicles with one law and one perception)
_COLUMNS = ("row", "rows", "count", "lag", "limits", "serial", "chained", "pure")
GROUP = {name: i for i, name in enumerate((*_COLUMNS, *(f"signal{i}" for i in range(MOST_SIGNALS))))}
SIGNAL_CODES = {name: i for i, name in enumerate(SIGNALS)}

#: of each signal, by its code: the derivative of a position that it is made of, whose, and less whose (NOTHING: none)
NOTHING = -9
SIGNAL_TABLE = np.array(
    [(s.order, s.of, NOTHING if s.less is None else s.less) for s in SIGNALS.values()], dtype=np.int64
)

#: per step: it starts at a jump; a look-up falls inside it; its start is recorded
FLAG_JUMP, FLAG_INSIDE, FLAG_RECORD = 1, 2, 4

#: what to do about events: step exactly onto them and past them; only note the lanes in which they happen
EXACT, NOTE = range(2)

#: numbers that a run counts: standing vehicles, lanes' steps with nodes inside them, work done by single lanes
STANDING, REFINED, WORK = range(3)

#: why a lane was given up: too many events in one step; no room to note their nodes
REPETITION, NO_ROOM = 1, 2

ROW, ROWS, COUNT, LAG, LIMITS, SERIAL, CHAINED, PURE, SIGNAL0 = range(9)


class Platoon(NamedTuple):
    """What does not change during a run. M = followers × lanes, elements in the order [vehicle][lane]."""

    groups: I2  # (G, columns) whole numbers, columns GROUP
    slots: I3  # (G, signals, 2) delay slot of each signal (of both halves of dv), -1 = current
    addresses: I2  # (G, 2) compiled loops: plain, chained
    parameters: F2  # (parameters, M)
    length: F1  # (M,) length of the vehicle ahead [m]
    lag: F1  # (M,) [s]
    limits: F2  # (2, M) least and largest command [m/s²]
    needs: B2  # (S, 3) whether a slot is asked for positions, speeds, accelerations
    span: I2  # (S, 2) rows that a slot is asked for
    delays: F1  # (S,) [s]
    hops: F4  # (G, 2, HOPS, 2) (delay, orders gained) of what is perceived of the vehicle ahead, and of itself
    end: float  # [s] of the run


#: most hops of a group, one for each signal (or half of one) that it may perceive; the rest has orders gained < 0
HOPS = MOST_SIGNALS


class Steps(NamedTuple):
    """The steps of a chunk: their lengths, the leader, and how to read the past. c = position of `mesh.AT`."""

    time: F1  # (n+1,) [s] nodes
    step: F1  # (n,) [s]
    flags: I1  # (n,)
    lead: F4  # (n, c, 3, 1 or lanes) position, speed, acceleration of the leader
    delayed_lead: F5  # (S, n, c, 3, 1 or lanes) the same, late by each slot's delay
    row: I3  # (S, n, c) history row, counted from the row of the chunk's first step
    motion: F4  # (S, n, c, 4)
    speed: F4  # (S, n, c, 4)
    acceleration: F4  # (S, n, c, 5)
    node: I3  # (S, n, c) 1 where the look-up is a node of the past, 2 where the next one, else 0


class State(NamedTuple):
    """What a run carries from step to step."""

    ring: F3  # (5, R, (N+1) lanes): position, speed, acceleration (right limit, where two), (left), extra point
    two: I1  # (R,) 1 where the acceleration of a node has two limits; else only the left one is kept
    K: F2  # (6, (N+1) lanes) accelerations of the stages
    J: F2  # (6, M) rates of change of accelerations behind a lag; rows 0 and 4 of the start and the end
    actual: F1  # ((N+1) lanes,) accelerations at the start of a step, which are states behind a lag
    stage: F2  # (2, (N+1) lanes) positions and speeds of a stage
    leader: F2  # (signals, M) what is heard of the platoon leader, for every follower
    looked: F4  # (S, 2, 3, (N+1) lanes) what was read of the past
    command: F2  # (3, M) what laws asked for at the start and the end of a step, and a spare row
    sources: I2  # (signals, 3) addresses of what each signal is made of
    go: F1  # (M,) 0 where a vehicle stands
    watch: F1  # (M,) 0 where events are ignored: beyond a collision, and for a moment after an event
    happened: F1  # (M,) 1 where an event was noted
    todo: I1  # (lanes,) 1 where a lane makes the step by itself
    time: F1  # (R,) [s] node of a row of the ring
    first: I2  # (R, lanes) first node inside the step that begins at a row, -1 where a lane has none
    lanes: I1  # (R,) lanes with nodes inside the step that begins at a row
    node: F3  # (5, C, N+1) states of one lane at such nodes, rows as in the ring
    node_time: F1  # (C,) [s]
    node_next: I1  # (C,) the next node of the same step and lane, -1 behind the last
    free: I1  # (C+1,) how many nodes are free, and their numbers
    pending: F3  # (lanes, P, 2) breaking points to come in a lane: time [s] and order
    pendings: I1  # (lanes,) how many there are
    earliest: F1  # (1,) [s] no pending breaking point is earlier
    front: F3  # (2, F, 2) where an event is felt: times and orders at one vehicle and the next
    ends: F3  # (2, 5, N+1) states at both ends of a step of the past, of one lane
    collision: F2  # (N+1, lanes) [s] NaN where there is none
    fault: I1  # (lanes,) why a lane was given up, 0 where it was not
    tally: I1  # (3,) STANDING, REFINED, WORK


class Alone(NamedTuple):
    """Where a lane of a batch makes a step by itself: a platoon, a step and a state of one lane."""

    platoon: Platoon
    steps: Steps
    state: State
    reserve: int  # nodes that must be free before a step
    piece: int  # address of the compiled `lane._piece`, 0 as long as nothing happened
