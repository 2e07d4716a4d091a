"""The moving part of the page: a platoon's motion and |G|, as fast as a hand moves.

While a slider moves, the scenario runs with longer steps (`draft_step`: to a micrometre, to millimetres where vehicles
brake to a stop), and what runs of one structure share is kept from one to the next. When the hand rests it runs
exactly as `simulate` runs it.
"""

from __future__ import annotations

import copy
import math
import warnings
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from headway.engine.plan import Frame, Lanes, Plan, structure
from headway.engine.run import Prepared, Result, Run
from headway.engine.simulate import check_sound, solve
from headway.engine.trajectories import lengths
from headway.errors import HeadwayError, HeadwayWarning, LeaderHeardError
from headway.explorer.state import PageState
from headway.scenario.motion import Motion
from headway.scenario.scenario import Scenario
from headway.theory.linear import Linear
from headway.theory.platoon import head_to_tail

__all__ = ["Picture", "Quick", "draw", "linear_in_view", "marks", "thinned"]

Array = NDArray[np.float64]

#: longest step [s] of a draft, and the largest product of step and reaction rate of the law
_DRAFT, _STIFF = 0.1, 0.3

#: most times of a draft's curves: lines that move need fewer than lines that stand
_DRAFT_POINTS = 350

#: frequencies [rad/s] of the |G| curve
OMEGA = np.geomspace(0.01, 10.0, 240)


class Picture(NamedTuple):
    """What a page draws: words and numbers by name, and arrays by name."""

    header: dict[str, Any]
    arrays: dict[str, Array]


class _Shared(NamedTuple):
    """What runs of one structure behind one leader share."""

    key: tuple[Any, ...]
    frame: Frame
    motions: list[Motion]
    prepared: Prepared


class Quick:
    """Runs one scenario after another; those that differ in parameters only share all preparation."""

    def __init__(self) -> None:
        self._shared: _Shared | None = None

    def __call__(self, scenario: Scenario, stale: Callable[[], bool]) -> Result:
        """The result of `simulate`, with the same bits.

        Raises:
            CancelledError: When `stale()` turns true.
        """
        key = (structure(scenario), scenario.leader, scenario.cruise, scenario.seed)
        if self._shared is None or self._shared.key != key:
            self._shared = _Shared(key, Frame.of(scenario), [scenario.motion], {})
        _, frame, motions, prepared = self._shared
        result = Run(Plan.of_lanes(frame, motions, Lanes.of([scenario], motions)), prepared, stale).go()
        if result.unsettled.any():
            return solve(scenario, stale)
        check_sound(scenario, result)
        return result


def linear_in_view(state: PageState) -> Linear:
    """Linear theory of the vehicle that the page looks at."""
    scenario, n = state.scenario, state.first
    gap = scenario.initial_gaps()[n] if scenario.gaps is not None else None
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", HeadwayWarning)  # a corner of the law; `headway stability` tells of it
        return head_to_tail([scenario.followers[n]], scenario.cruise, gap).vehicles[0]


def draft_step(scenario: Scenario) -> float:
    """Step [s] of a draft: short enough for the fastest reaction of any vehicle at its equilibrium."""
    rate = 0.0
    for vehicle, gap in dict(zip(scenario.followers, scenario.initial_gaps(), strict=True)).items():
        slopes = vehicle.model.partials(scenario.cruise, gap)
        rate = max(
            rate, sum(abs(slopes.get(n, 0.0)) for n in ("v", "dv", "vl")), 1.0 / vehicle.lag if vehicle.lag else 0
        )
        rate = max(rate, math.sqrt(abs(slopes.get("s", 0.0))))
    own = scenario.step
    step = min(_DRAFT, _STIFF / rate) if math.isfinite(rate) and rate > 0 else _DRAFT
    return max(own, step)


def _stepped(scenario: Scenario, dt: float, output_step: float) -> Scenario:
    """The scenario with other steps; made without checking it again, and it keeps its leader's motion."""
    other = copy.copy(scenario)
    vars(other).update(dt=dt, output_step=output_step)
    return other


def draw(state: PageState, quick: Quick, points: int, draft: bool, stale: Callable[[], bool]) -> tuple[Picture, Result]:
    """The picture of a state, and the result that it shows.

    Args:
        state: What the page shows.
        quick: Keeps what runs of one structure share.
        points: About how many times the curves have.
        draft: Whether longer steps will do.
        stale: Turns true when nobody wants the picture any more.

    Raises:
        CancelledError: When it does, in the middle of a draft.
    """
    scenario = state.scenario
    if draft:
        step, points = draft_step(scenario), min(points, _DRAFT_POINTS)
        apart = step * max(1, math.ceil(scenario.end / step / points - 1e-9))
        result = quick(_stepped(scenario, min(step, scenario.end), min(apart, scenario.end)), stale)
    else:
        result = solve(scenario, stale)
    arrays = thinned(scenario, result, points)
    header = {
        "draft": draft,
        "lengths": lengths(scenario).tolist(),
        "collisions": [None if math.isnan(t) else float(t) for t in result.collision_time],
        "marks": marks(scenario),
        **_theory(state, arrays),
    }
    return Picture(header, arrays), result


def thinned(scenario: Scenario, result: Result, points: int) -> dict[str, Array]:
    """Time (T,), and position, speed, spacing error and acceleration (N+1, T), at about `points` times."""
    count = result.time.size
    keep = np.unique(np.append(np.arange(0, count, max(1, math.ceil(count / (points + 1)))), count - 1))
    x, v, a = (q[keep, :, 0].T for q in result.motion)
    gap = x[:-1] - lengths(scenario)[:-1, None] - x[1:]
    return {"time": result.time[keep], "position": x, "speed": v, "error": gap - gap[:, :1], "acceleration": a}


def _theory(state: PageState, arrays: dict[str, Array]) -> dict[str, Any]:
    """The verdict in a word, and the curve of |G| among the arrays."""
    from headway.theory import sweep

    try:
        linear = linear_in_view(state)
        row = sweep.rows_of([linear])
    except LeaderHeardError as error:
        return {"theory": {"error": str(error), "word": "no verdict on one vehicle"}}
    except HeadwayError as error:
        return {"theory": {"error": str(error)}}
    gain, where = sweep.peaks_of(row)
    arrays["omega"], arrays["gain"] = OMEGA, linear.gain(OMEGA)
    finite = bool(np.isfinite(gain[0]) and np.isfinite(where[0]))
    return {
        "theory": {
            "word": sweep.judge(row).words[0],
            "peak": [float(where[0]), float(gain[0])] if finite else None,
            "gap": linear.gap,
            "speed": linear.speed,
        }
    }


def marks(scenario: Scenario) -> list[float]:
    """Frequencies [rad/s] of the disturbance."""
    return [float(w) for w in scenario.leader.frequencies]
