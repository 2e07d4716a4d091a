"""Points of one structure as lanes: what varies from lane to lane is put into arrays, not into scenarios."""

from __future__ import annotations

import dataclasses
import functools
import threading
from collections.abc import Sequence
from concurrent.futures import CancelledError
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from headway.arrays import Array
from headway.engine.plan import Frame, Lanes, structure
from headway.engine.run import Prepared
from headway.errors import HeadwayError
from headway.study.paths import Target, parameter_of
from headway.study.starts import equilibrium_gaps
from headway.study.templates import Origin, Template

__all__ = ["Fast", "Kind", "Pool", "lanes_of", "out_of_bounds"]


#: most bytes of prepared steps that are kept for later batches
_KEPT_BYTES = 150_000_000

#: bytes that a step and a delay take there, about
_STEP_BYTES = 650


@dataclass(frozen=True)
class Fast:
    """A parameter of laws that every lane may have for itself.

    Attributes:
        path: name of the axis.
        targets: the fields it stands for.
        values: (lanes,) its values.
    """

    path: str
    targets: tuple[Target, ...]
    values: Array

    def of(self, origin: Origin) -> str | None:
        """Name of the parameter that the axis sets in vehicles described at `origin`, None if it sets none."""
        return next((parameter_of(t) for t in self.targets if t[:2] == origin), None)


@dataclass(eq=False)
class Kind:
    """A template and what the engine needs to know of it.

    Attributes:
        template: the scenario, and where its vehicles are described.
        structure: equal for those whose lanes can be integrated side by side.
        leader: equal for those behind one motion.
    """

    template: Template
    structure: tuple[Any, ...]
    leader: tuple[Any, ...]  # equal for those behind the same motion

    @classmethod
    def of(cls, template: Template) -> Kind:
        """The kind of a template: its structure and the motion of its leader."""
        s = template.scenario
        seed = s.seed if s.leader.random else 0
        return cls(template, structure(s), (s.leader, seed, s.end, s.cruise))

    @functools.cached_property
    def base(self) -> Lanes:
        """The template's own numbers, as one lane."""
        return Lanes.of([self.template.scenario], [self.template.scenario.motion])


@dataclass
class Pool:
    """Frames and prepared steps by structure and leader, the latest used; shared by threads.

    Attributes:
        frames: by structure.
        prepared: steps by structure and leader.
        bytes: how much memory the prepared steps take, about.
        stop: set where nobody waits for answers any more.
    """

    frames: dict[Any, Frame] = field(default_factory=dict)
    prepared: dict[Any, Prepared] = field(default_factory=dict)
    bytes: int = 0
    stop: threading.Event = field(default_factory=threading.Event)

    def go_on(self) -> None:
        """Raise `CancelledError` if nobody waits for answers any more."""
        if self.stop.is_set():
            raise CancelledError

    def frame(self, kind: Kind, extra: bool = False) -> Frame:
        """The frame of a structure.

        Args:
            kind: a kind of this structure.
            extra: whether late accelerations take a point between nodes.
        """
        key = (kind.structure, extra)
        frame = self.frames.get(key)
        if frame is None:
            if len(self.frames) >= 512:
                self.frames.clear()
            frame = dataclasses.replace(self.frame(kind), extra=True) if extra else Frame.of(kind.template.scenario)
            self.frames[key] = frame
        return frame

    def steps(self, kind: Kind, shared: bool, extra: bool = False) -> Prepared:
        """Prepared steps for batches behind one leader, or behind many.

        Args:
            kind: a kind of the batch.
            shared: whether all lanes are behind the leader of `kind`.
            extra: whether late accelerations take a point between nodes.
        """
        self.go_on()
        key = (kind.structure, kind.leader if shared else None, extra)
        prepared = self.prepared.get(key)
        if prepared is None:
            frame = self.frame(kind, extra)
            size = frame.mesh.steps * (1 + frame.delays.size) * _STEP_BYTES
            if self.bytes + size > _KEPT_BYTES:
                self.prepared, self.bytes = {}, 0  # runs under way keep theirs
            prepared = {}
            if size <= _KEPT_BYTES:
                self.prepared[key] = prepared
                self.bytes += size
        return prepared


def out_of_bounds(kind: Kind, fast: Sequence[Fast], lanes: int) -> dict[int, str]:
    """Why lanes are not allowed: parameters that are not numbers or out of their bounds.

    Args:
        kind: the kind of the lanes.
        fast: the parameters that vary from lane to lane.
        lanes: how many lanes there are.

    Returns:
        A sentence by number of the lane.
    """
    reasons: dict[int, str] = {}
    laws = {o: v.model.law for o, v in zip(kind.template.origins, kind.template.scenario.followers, strict=True)}
    for axis in fast:
        for origin, law in laws.items():
            name = axis.of(origin)
            if name is None:
                continue
            parameter = law.parameters[name]
            good = (axis.values >= parameter.info.low) & (axis.values <= parameter.info.high)
            for lane in np.flatnonzero(~(good & np.isfinite(axis.values))):
                try:
                    parameter.check(axis.values[lane], law.name)
                except HeadwayError as error:
                    reasons.setdefault(int(lane), f"{'.'.join(map(str, origin))}.parameters: {error}")
    return reasons


def lanes_of(kind: Kind, fast: Sequence[Fast], lanes: int) -> Lanes:
    """The numbers of lanes of one template.

    Args:
        kind: the kind of the lanes.
        fast: the parameters that vary from lane to lane.
        lanes: how many lanes there are.

    Returns:
        The lanes; gaps are NaN where the equilibrium has to be computed singly.
    """
    scenario, base = kind.template.scenario, kind.base

    def wide(array: Array) -> Array:
        return np.broadcast_to(array, (*array.shape[:-1], lanes))

    parameters = np.repeat(base.parameters, lanes, axis=2)
    gaps = np.repeat(base.gaps, lanes, axis=1)
    equilibria: dict[Origin, Array] = {}
    offsets = dict(scenario.gap_offsets)
    for n, (origin, vehicle) in enumerate(zip(kind.template.origins, scenario.followers, strict=True)):
        law = vehicle.model.law
        varied = {name: axis.values for axis in fast if (name := axis.of(origin)) is not None}
        if not varied:
            continue
        for i, name in enumerate(law.parameters):
            if name in varied:
                parameters[i, n] = varied[name]
        if scenario.gaps is None:
            if origin not in equilibria:
                equilibria[origin] = equilibrium_gaps(
                    law, {**vehicle.model.parameters, **varied}, scenario.cruise, lanes
                )
            gap = equilibria[origin]
            gap = np.where(gap > 0, gap, np.nan) + offsets.get(n + 1, 0.0)
            gaps[n] = np.where(gap > 0, gap, np.nan)
    return Lanes(
        gaps=gaps,
        lengths=wide(base.lengths),
        speeds=wide(base.speeds),
        cruise=wide(base.cruise),
        lead=wide(base.lead),
        parameters=parameters,
        lag=wide(base.lag),
        limits=wide(base.limits),
    )


def joined(parts: Sequence[Lanes]) -> Lanes:
    """Lanes of several templates of one structure, side by side."""
    if len(parts) == 1:
        return parts[0]
    return Lanes(**{n: np.concatenate([getattr(p, n) for p in parts], axis=-1) for n in Lanes.__dataclass_fields__})


def chosen_lanes(lanes: Lanes, which: Any) -> Lanes:
    """The lanes of a slice, or of an array of numbers."""
    return Lanes(**{n: getattr(lanes, n)[..., which] for n in Lanes.__dataclass_fields__})
