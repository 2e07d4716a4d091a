"""What a page shows, as plain tables: in a message, in the address of the page, and as a scenario.

A state is a table with `scenario` (as in a scenario file), `group` (the table of followers that sliders,
gain and map are about), `map` (two axes by name, least and largest value) and, where a run is pinned,
`pinned` (another scenario table). Its text in an address is JSON in URL-safe base64.
"""

from __future__ import annotations

import base64
import binascii
import json
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from headway.errors import HeadwayError, shorten
from headway.models import Law
from headway.scenario.document import from_table, to_table
from headway.scenario.leaders import KINDS, Disturbance
from headway.scenario.scenario import Scenario

__all__ = ["LIMITS", "Limits", "PageState", "checked_state", "decode", "encode", "finite_json", "start_state"]


@dataclass(frozen=True)
class Limits:
    """How much a page may ask for; more is refused with a sentence."""

    vehicles: int = 200
    duration: float = 3600.0  # [s]
    work: float = 2e7  # steps of vehicles
    corners: float = 2e4  # half periods or samples of the leader, times vehicles
    message: int = 65_536  # characters


LIMITS = Limits()


@dataclass(frozen=True)
class PageState:
    """A state that has been checked: the scenario, the group that is looked at, and the map's axes."""

    scenario: Scenario
    group: int
    first: int  # number of the group's first follower, from 0
    axes: tuple[tuple[str, float, float], ...]


def checked_state(
    state: Any, laws: Iterable[Law] = (), files: Iterable[str] = (), limits: Limits = LIMITS
) -> PageState:
    """The state of a table, checked.

    Args:
        state: The table, see the head of this module.
        laws: Laws of one's own that it may ask for.
        files: Recordings that its leader may name.
        limits: How much it may ask for.

    Raises:
        HeadwayError: For everything that a scenario file may not have either, for what is beyond the limits and for
            a recording that the explorer was not started with.
    """
    if not isinstance(state, Mapping) or not isinstance(state.get("scenario"), Mapping):
        raise HeadwayError(f"state = {shorten(state)} is not a table with a scenario")
    table = state["scenario"]
    _bound(table, limits)
    leader = table.get("leader")
    if isinstance(leader, Mapping) and leader.get("file") is not None and leader["file"] not in files:
        raise HeadwayError(f"leader.file = {shorten(leader['file'])}: the explorer was not started with this recording")
    scenario = from_table(table, laws)
    _bound_built(scenario, limits)
    tables = table["followers"] if isinstance(table["followers"], list) else [table["followers"]]
    group = state.get("group", 0)
    if isinstance(group, bool) or not isinstance(group, int) or not 0 <= group < len(tables):
        raise HeadwayError(f"group = {shorten(group)} is not one of the groups 0 to {len(tables) - 1}")
    first = sum(t.get("count", 1) for t in tables[:group])
    return PageState(scenario, group, first, _axes(state.get("map")))


def _axes(table: Any) -> tuple[tuple[str, float, float], ...]:
    if not table:
        return ()
    try:
        (x, *xs), (y, *ys) = table
        axes = tuple((str(n), float(low), float(high)) for n, (low, high) in ((x, xs), (y, ys)))
    except (TypeError, ValueError):
        raise HeadwayError(f"map = {shorten(table)}: write two axes, each with its name, low and high") from None
    if axes[0][0] == axes[1][0]:
        raise HeadwayError(f"map: both axes are {axes[0][0]}; the axes of a map differ")
    return axes


def _bound(table: Mapping[str, Any], limits: Limits) -> None:
    """Refuse what would take long to look at, before it is looked at."""
    groups = table.get("followers")
    groups = groups if isinstance(groups, list) else [groups]
    counts = [g.get("count", 1) for g in groups if isinstance(g, Mapping)]
    vehicles = sum(c for c in counts if isinstance(c, int))
    if vehicles > limits.vehicles:
        raise HeadwayError(
            f"{vehicles} vehicles are too many for the explorer, which takes {limits.vehicles}; use headway run"
        )
    leader = table.get("leader")
    leader = leader if isinstance(leader, Mapping) else {}
    seconds = _number(table.get("duration"), 0.0)
    if seconds > limits.duration:
        raise HeadwayError(
            f"duration = {seconds:g} s is too long for the explorer, which takes {limits.duration:g} s; use headway run"
        )
    _bound_work(
        max(vehicles, 1), seconds, _number(table.get("dt"), 0.0), _number(table.get("output_step"), 0.0), limits
    )
    halves = seconds * _number(leader.get("omega"), 0.0) / math.pi
    samples = seconds / max(_number(leader.get("sample"), 1.0), 1e-9)
    kind = KINDS.get(str(leader.get("kind")), Disturbance)
    if max(halves * max(vehicles, 1), samples) > limits.corners and not kind.harmonic:
        raise HeadwayError(f"the {shorten(leader.get('kind'))} leader changes too often for the explorer")


def _bound_built(scenario: Scenario, limits: Limits) -> None:
    if scenario.end > limits.duration:
        raise HeadwayError(
            f"the leader drives for {scenario.end:g} s; the explorer takes {limits.duration:g} s, so give a duration"
        )
    _bound_work(len(scenario.followers), scenario.end, scenario.step, scenario.output_step or 0.0, limits)


def _bound_work(vehicles: int, seconds: float, dt: float, output_step: float, limits: Limits) -> None:
    """Refuse too many steps of vehicles; a step of 0 is one that is not given."""
    step = min((x for x in (dt, output_step) if x > 0), default=math.inf)
    if (work := vehicles * seconds / step) > limits.work:
        raise HeadwayError(
            f"{vehicles} vehicles for {seconds:g} s in steps of {step:g} s are {work:.2g} steps; "
            f"the explorer takes {limits.work:.2g}; use headway run"
        )


def _number(value: Any, otherwise: float) -> float:
    """A number of a table that has not been checked yet."""
    return float(value) if isinstance(value, int | float) and not isinstance(value, bool) else otherwise


def start_state(scenario: Scenario) -> dict[str, Any]:
    """The state in which a page shows this scenario for the first time."""
    from headway.explorer.controls import map_axes

    return {"scenario": to_table(scenario), "group": 0, "map": map_axes(scenario.followers[0].model.law)}


def finite_json(text: str) -> Any:
    """The value of JSON whose numbers are all finite.

    Raises:
        HeadwayError: For any other text.
    """

    def refuse(name: str) -> Any:
        raise ValueError(f"{name} is not a number here")

    try:
        return json.loads(text, parse_constant=refuse)
    except (ValueError, RecursionError) as error:
        raise HeadwayError(f"the message is not JSON ({shorten(str(error))})") from None


def encode(state: Mapping[str, Any]) -> str:
    """The text of a state in an address, after its #."""
    text = json.dumps(state, ensure_ascii=False, separators=(",", ":"))
    return base64.urlsafe_b64encode(text.encode()).decode().rstrip("=")


def decode(text: str) -> dict[str, Any]:
    """The state of an address or of what follows its #.

    Raises:
        HeadwayError: If it holds none.
    """
    _, _, fragment = text.rpartition("#")
    try:
        state = finite_json(base64.urlsafe_b64decode(fragment + "=" * (-len(fragment) % 4)).decode())
    except (binascii.Error, ValueError):
        state = None
    if not isinstance(state, dict) or "scenario" not in state:
        raise HeadwayError(f"{shorten(text)}: the address holds no state of the explorer")
    return state
