"""What a benchmark runs: the standard file and a person's own that joins it, read and checked."""

from __future__ import annotations

import dataclasses
import os
import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Annotated, Any

from headway.errors import HeadwayError, shorten, unknown_name
from headway.models import RADIO, Law, Model
from headway.models.registry import IDM
from headway.scenario.document import FOLLOWER_KEYS, assemble, read_table, vehicles
from headway.scenario.leaders import Disturbance
from headway.scenario.recorded import Recorded
from headway.scenario.validation import NonNegative, Numbers, Positive, build, field_names, spec, unit
from headway.scenario.vehicle import Vehicle

__all__ = ["Benchmark", "Course", "Entry", "Late", "MixedPlatoon", "load_benchmark"]


@dataclass(frozen=True)
class Entry:
    """A competitor: a model, its vehicle, and which of its signals are late.

    Attributes:
        name: of the entry.
        vehicle: the vehicle without delays.
        late: signals that the delays of the benchmark apply to.
        start_gap: gap [m] at the start; None for the equilibrium.
        tune: parameters that are scaled together to reach a common gap.
        adjust: parameters that guidance is about.
        note: where its values come from.
    """

    name: str
    vehicle: Vehicle
    late: tuple[str, ...]
    start_gap: float | None
    tune: tuple[str, ...]
    adjust: tuple[str, ...]
    note: str

    @property
    def model(self) -> Model:
        """The law of the entry with its parameters."""
        model: Model = self.vehicle.model
        return model

    @property
    def by_radio(self) -> bool:
        """Whether the late signals arrive by radio."""
        return bool(RADIO & set(self.late))

    def delay(self, onboard: float, radio: float) -> float:
        """Return the delay [s] of the late signals.

        Args:
            onboard: delay of on-board signals [s].
            radio: delay of radio signals [s].
        """
        return radio if self.by_radio else onboard

    def behind(self, onboard: float, radio: float) -> Vehicle:
        """Return the vehicle with its delay; see `delay`.

        Args:
            onboard: delay of on-board signals [s].
            radio: delay of radio signals [s].
        """
        return self.with_delay(self.delay(onboard, radio))

    def with_delay(self, seconds: float) -> Vehicle:
        """Return the vehicle with its late signals `seconds` [s] late."""
        return dataclasses.replace(self.vehicle, delay=dict.fromkeys(self.late, seconds))


@spec
class Late:
    """How late signals are, in one column of the board."""

    name: Annotated[str, unit("", "what it is called")]
    onboard: Annotated[NonNegative, unit("s", "delay of what a driver or a sensor perceives")] = 0.0
    radio: Annotated[NonNegative, unit("s", "delay of what arrives by radio")] = 0.0


@dataclass(frozen=True)
class Course:
    """A disturbance: a leader and how long it is followed.

    Attributes:
        name: of the disturbance.
        leader: the leader.
        duration: [s] for which it is followed.
        sweep: whether delays are swept behind it.
        quick: whether it is part of the short form.
    """

    name: str
    leader: Disturbance
    duration: float
    sweep: bool
    quick: bool


@dataclass(frozen=True)
class MixedPlatoon:
    """A mixed platoon.

    Attributes:
        name: of the platoon.
        order: names of entries, front to back.
    """

    name: str
    order: tuple[str, ...]


@spec
class _Numbers:
    """The plain numbers of a benchmark."""

    followers: int = 5
    speed: Positive = 23.0
    gap: Positive = 36.5
    dt: Positive = 0.02
    output_step: Positive = 0.1
    sweep: Numbers = (0.0,)

    def __post_init__(self) -> None:
        if not 1 <= self.followers <= 1000:
            raise HeadwayError(f"benchmark.followers = {self.followers} is not a whole number from 1 to 1000")
        if not self.sweep or min(self.sweep) < 0 or list(self.sweep) != sorted(set(self.sweep)):
            raise HeadwayError(f"benchmark.sweep = {list(self.sweep)} is not a rising list of delays of 0 s or more")


@dataclass(frozen=True)
class Benchmark:
    """Everything that a board consists of; see docs/benchmark.md.

    Attributes:
        entries: the competitors.
        courses: the disturbances.
        cases: the cases of delays.
        platoons: the mixed platoons.
        followers: number of vehicles behind each leader.
        speed: [m/s] of theory, advice and tuning.
        gap: [m] that entries are tuned to at that speed.
        dt: longest step [s].
        output_step: distance of samples [s].
        sweep: rising delays [s], swept behind some disturbances.
    """

    entries: tuple[Entry, ...]
    courses: tuple[Course, ...]
    cases: tuple[Late, ...]
    platoons: tuple[MixedPlatoon, ...]
    followers: int
    speed: float
    gap: float
    dt: float
    output_step: float
    sweep: tuple[float, ...]

    def entry(self, name: str) -> Entry:
        """Return the entry of this name."""
        return next(e for e in self.entries if e.name == name)

    def quick(self) -> Benchmark:
        """Return a short form: the disturbances marked `quick`, else the first, and few delays of the sweep."""
        chosen = tuple(c for c in self.courses if c.quick)
        step = max(1, (len(self.sweep) - 1) // 3)
        return dataclasses.replace(self, courses=chosen or self.courses[:1], sweep=self.sweep[::step])


_OF_VEHICLE = tuple(k for k in FOLLOWER_KEYS if k not in ("count", "delay"))
_LISTS: dict[str, tuple[str, ...]] = {
    "models": (*_OF_VEHICLE, "name", "late", "start_gap", "tune", "adjust", "note"),
    "disturbances": ("name", "leader", "duration", "sweep", "quick"),
    "delays": field_names(Late),
    "platoons": ("name", "order"),
}
_KEYS = ("without", *field_names(_Numbers), *_LISTS)


def load_benchmark(
    path: str | os.PathLike[str] | None = None, laws: Iterable[Law] = (), leaders: Iterable[str | os.PathLike[str]] = ()
) -> Benchmark:
    """Read the standard benchmark and a file that joins it.

    Args:
        path: a TOML file whose entries join the standard ones; one of the same name takes its place, and `without`
            takes entries out. The standard benchmark alone if None.
        laws: laws of one's own that the file may name.
        leaders: files of recorded leaders that join the disturbances.

    Raises:
        HeadwayError: naming the place, for everything that is not allowed.
    """
    laws = tuple(laws)
    text = (resources.files(__package__) / "standard.toml").read_text(encoding="utf-8")
    standard = tomllib.loads(text)
    own = read_table(path) if path is not None else {}
    folder = Path(path).parent if path is not None else Path()
    for key in own:
        if key not in _KEYS:
            raise unknown_name(f"key in {path}", key, _KEYS)
    without = _names(own.get("without", []), "without")
    lists: dict[str, dict[str, Any]] = {}
    for kind in _LISTS:
        rows: dict[str, Any] = {}
        for table, place in ((standard, Path()), (own, folder)):
            for i, row in enumerate(_rows(table.get(kind, []), kind)):
                item = _item(kind, row, f"{kind}.{i}", laws, place)
                rows[item.name] = item
        lists[kind] = rows
    for i, leader in enumerate(leaders):
        name = Path(leader).stem if i == 0 and Path(leader).stem not in lists["disturbances"] else f"recorded {i + 1}"
        recorded = Recorded(file=str(leader))
        lists["disturbances"][name] = Course(name, recorded, recorded.span, sweep=False, quick=True)
    for name in without:
        if not any(rows.pop(name, None) for rows in lists.values()):
            raise unknown_name("without", name, [n for rows in lists.values() for n in rows])
    numbers = build(_Numbers, {k: v for k, v in {**standard, **own}.items() if k in field_names(_Numbers)}, "benchmark")
    for kind in ("models", "disturbances", "delays"):
        if not lists[kind]:
            raise HeadwayError(f"benchmark: no {kind} are left; take some names out of without")
    platoons = _platoons(lists["platoons"], lists["models"], without)
    return Benchmark(
        entries=tuple(lists["models"].values()),
        courses=tuple(lists["disturbances"].values()),
        cases=tuple(lists["delays"].values()),
        platoons=platoons,
        **{name: getattr(numbers, name) for name in field_names(_Numbers)},
    )


def _rows(value: Any, kind: str) -> list[Mapping[str, Any]]:
    if not isinstance(value, list) or not all(isinstance(row, Mapping) for row in value):
        raise HeadwayError(f"{kind} must be one or more [[{kind}]] tables")
    return value


def _item(kind: str, row: Mapping[str, Any], place: str, laws: tuple[Law, ...], folder: Path) -> Any:
    for key in row:
        if key not in _LISTS[kind]:
            raise unknown_name(f"key in {place}", key, _LISTS[kind])
    name = row.get("name", row.get("model") if kind == "models" else None)
    if not isinstance(name, str) or not name.strip():
        raise HeadwayError(f"{place}.name is missing; every one of {kind} needs a name of its own")
    row = {**row, "name": name.strip()}
    match kind:
        case "models":
            return _entry(row, place, laws)
        case "disturbances":
            return _course(row, place, folder)
        case "delays":
            return build(Late, row, place)
        case _:
            return MixedPlatoon(row["name"], _names(row.get("order"), f"{place}.order"))


def _entry(row: Mapping[str, Any], place: str, laws: tuple[Law, ...]) -> Entry:
    vehicle = vehicles({k: v for k, v in row.items() if k in FOLLOWER_KEYS}, laws, place)[0]
    law = vehicle.model.law
    late = _names(row["late"], f"{place}.late") if "late" in row else _usually_late(law)
    for signal in late:
        if signal not in (*law.signals, "vl"):
            raise unknown_name(f"{place}.late", signal, law.signals)
    if RADIO & set(late) and set(late) - RADIO and not (set(late) & RADIO == {"vl"} and "vl" not in law.signals):
        raise HeadwayError(f"{place}.late = {list(late)} mixes radio with on-board signals; one delay serves one kind")
    chosen = {}
    for key in ("tune", "adjust"):
        chosen[key] = _names(row.get(key, []), f"{place}.{key}")
        for name in chosen[key]:
            if name not in law.parameters:
                raise unknown_name(f"{place}.{key}", name, law.parameters)
    gap = row.get("start_gap")
    if gap is not None and (isinstance(gap, bool) or not isinstance(gap, int | float) or not gap > 0):
        raise HeadwayError(f"{place}.start_gap = {shorten(gap)} is not a positive number of metres")
    note = row.get("note", "")
    return Entry(row["name"], vehicle, late, None if gap is None else float(gap), **chosen, note=str(note))


def _usually_late(law: Law) -> tuple[str, ...]:
    """Return the radio signals of a law that hears any, else all signals on board."""
    radio = tuple(s for s in law.signals if s in RADIO)
    return radio or law.signals


def _course(row: Mapping[str, Any], place: str, folder: Path) -> Course:
    if "leader" not in row:
        raise HeadwayError(f'{place}.leader is missing; write e.g. leader = {{ kind = "sine", mean = 23, … }}')
    table = {k: row[k] for k in ("leader", "duration") if k in row}
    try:
        # any follower will do: a scenario checks its leader
        scenario = assemble({**table, "gaps": 30.0}, [Vehicle(IDM())], folder)
    except HeadwayError as error:
        raise HeadwayError(f"{place}: {error}") from None
    marks = {"sweep": row.get("sweep", scenario.leader.span is None), "quick": row.get("quick", False)}
    for key, value in marks.items():
        if not isinstance(value, bool):
            raise HeadwayError(f"{place}.{key} = {shorten(value)} is neither true nor false")
    return Course(row["name"], scenario.leader, scenario.end, **marks)


def _platoons(
    rows: Mapping[str, MixedPlatoon], entries: Mapping[str, Entry], without: tuple[str, ...]
) -> tuple[MixedPlatoon, ...]:
    platoons = []
    for platoon in rows.values():
        if not set(platoon.order) & set(without):
            for name in platoon.order:
                if name not in entries:
                    raise unknown_name(f"platoon {platoon.name!r}", name, entries)
            platoons.append(platoon)
    return tuple(platoons)


def _names(value: Any, place: str) -> tuple[str, ...]:
    if isinstance(value, str):
        value = [value]
    if not isinstance(value, list) or not all(isinstance(v, str) for v in value):
        raise HeadwayError(f"{place} = {shorten(value)} is not a list of names")
    return tuple(value)
