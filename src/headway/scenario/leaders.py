"""Leaders: what disturbs a platoon. Each is exact in position, speed and acceleration.

Every class is a description that a file can hold (`kind` is its name there) and gives its
`motion(seed, duration)`. All drive at their initial speed until t = 0.

Where a speed jumps (a window that is cut off, an edge time of 0) the acceleration has an impulse.
It is dropped: laws that hear the leader's acceleration get its finite limits on both sides of the
jump. Give an `edge` to let them feel it.
"""

from __future__ import annotations

import math
from typing import Annotated, ClassVar, Literal

import numpy as np

from headway.data.cycles import CYCLES, load_cycle
from headway.errors import HeadwayError, shorten, unknown_name
from headway.limits import check_size
from headway.scenario.motion import Motion, MotionPiece, polyline, smooth_curve
from headway.scenario.validation import Described, Finite, NonNegative, Numbers, Positive, spec, unit

__all__ = [
    "KINDS", "Brake", "Chirp", "Constant", "Cycle", "Disturbance", "Multisine", "Noise", "Sawtooth", "Sine", "Square",
    "Step", "Triangle", "Window",
]  # fmt: skip

Mean = Annotated[NonNegative, unit("m/s", "mean speed, also the speed before the start", usual=[23.0, 0.0, 45.0])]
Amplitude = Annotated[Finite, unit("m/s", "amplitude of the speed", usual=[2.0, 0.0, 10.0])]
Omega = Annotated[Positive, unit("rad/s", "angular frequency", usual=[0.63, 0.02, 6.0])]
Onset = Annotated[NonNegative, unit("s", "time at which it begins", usual=[5.0, 0.0, 100.0])]
_EDGE = [0.5, 0.0, 10.0]
Edge = Annotated[NonNegative, unit("s", "duration of each edge, centred on it; 0 is an ideal jump", usual=_EDGE)]


class Disturbance(metaclass=Described):
    """Base of all leaders.

    A leader says of itself what others need to know of it, so that nobody asks for its kind.
    """

    #: its name in a file
    kind: ClassVar[str]
    #: whether the motion depends on the scenario's seed
    random: ClassVar[bool] = False
    #: whether it returns to a steady speed by itself and keeps it, so that what follows can settle
    settles: ClassVar[bool] = False
    #: whether a sine is all that it is made of, so that its cost does not grow with its frequency
    harmonic: ClassVar[bool] = False
    #: where its numbers come from, to be cited
    source: ClassVar[str] = ""

    def motion(self, seed: int, duration: float) -> Motion:
        """The exact motion for at least `duration` [s]; `seed` matters to random leaders only."""
        raise NotImplementedError  # each kind below brings its own

    @property
    def span(self) -> float | None:
        """Length [s] of a leader that ends by itself, else None."""
        return None

    @property
    def fundamental(self) -> float | None:
        """Angular frequency [rad/s] with which it repeats itself for ever, else None."""
        return None

    @property
    def frequencies(self) -> tuple[float, ...]:
        """Angular frequencies [rad/s] that it is made of or sweeps between; empty where none stands out."""
        return () if self.fundamental is None else (self.fundamental,)


class Repeating(Disturbance):
    """Base of leaders that repeat themselves with the angular frequency `omega` from t = 0 on."""

    omega: Omega

    @property
    def fundamental(self) -> float:
        """Angular frequency [rad/s] with which it repeats itself."""
        return self.omega


@spec
class Constant(Disturbance):
    """Steady speed, for platoons that are disturbed by their initial state."""

    speed: Annotated[NonNegative, unit("m/s", "speed", usual=[23.0, 0.0, 45.0])]
    kind: ClassVar[str] = "constant"

    def motion(self, seed: int, duration: float) -> Motion:
        """Exact motion for at least `duration` [s], see `Disturbance.motion`."""
        return Motion.of(self.speed, [MotionPiece(0.0, (self.speed,))])


@spec
class Sine(Repeating):
    """Harmonic disturbance `v = mean + A sin(ω t)` from t = 0."""

    mean: Mean
    amplitude: Amplitude
    omega: Omega
    kind: ClassVar[str] = "sine"
    harmonic: ClassVar[bool] = True

    def motion(self, seed: int, duration: float) -> Motion:
        """Exact motion for at least `duration` [s], see `Disturbance.motion`."""
        return Motion.of(self.mean, [MotionPiece(0.0, (self.mean,), ((self.amplitude, self.omega, 0.0, 0.0),))])


@spec
class Window(Disturbance):
    """Windowed sine `v = mean + A sin(ω (t - onset))` for onset <= t < onset + duration, else the mean."""

    mean: Mean
    amplitude: Amplitude
    omega: Omega
    duration: Annotated[Positive, unit("s", "duration of the window", usual=[20.0, 0.5, 300.0])]
    onset: Onset = 0.0
    kind: ClassVar[str] = "window"
    harmonic: ClassVar[bool] = True
    settles: ClassVar[bool] = True

    @property
    def frequencies(self) -> tuple[float, ...]:
        """The one of its sine."""
        return (self.omega,)

    def motion(self, seed: int, duration: float) -> Motion:
        """Exact motion for at least `duration` [s], see `Disturbance.motion`."""
        pieces = [MotionPiece(self.onset, (self.mean,), ((self.amplitude, self.omega, 0.0, 0.0),))]
        if self.onset > 0:
            pieces.insert(0, MotionPiece(0.0, (self.mean,)))
        return Motion.of(self.mean, [*pieces, MotionPiece(self.onset + self.duration, (self.mean,))])


@spec
class Step(Disturbance):
    """Single step of the speed by `change`, as a linear ramp that takes `edge` from the onset on."""

    mean: Annotated[NonNegative, unit("m/s", "speed before the step", usual=[23.0, 0.0, 45.0])]
    change: Annotated[Finite, unit("m/s", "change of speed, negative to slow down", usual=[-5.0, -20.0, 20.0])]
    onset: Onset = 0.0
    edge: Annotated[
        NonNegative, unit("s", "duration of the ramp from the onset on; 0 is an ideal jump", usual=_EDGE)
    ] = 0.0
    kind: ClassVar[str] = "step"
    settles: ClassVar[bool] = True

    def motion(self, seed: int, duration: float) -> Motion:
        """Exact motion for at least `duration` [s], see `Disturbance.motion`."""
        after = self.mean + self.change
        return polyline(self.mean, [0.0, self.onset, self.onset + self.edge], [self.mean, self.mean, after])


@spec
class Brake(Disturbance):
    """Abrupt braking: ramp down by `drop`, hold, ramp back."""

    mean: Annotated[NonNegative, unit("m/s", "speed before and after", usual=[23.0, 0.0, 45.0])]
    drop: Annotated[Positive, unit("m/s", "by how much the speed falls", usual=[8.0, 0.1, 30.0])]
    hold: Annotated[NonNegative, unit("s", "how long the low speed is held", usual=[5.0, 0.0, 60.0])]
    ramp: Annotated[Positive, unit("s", "duration of the ramp down", usual=[2.0, 0.1, 20.0])] = 1.0
    recovery: Annotated[
        NonNegative, unit("s", "duration of the ramp back; 0 takes that of the ramp down", usual=[0.0, 0.0, 30.0])
    ] = 0.0
    onset: Onset = 0.0
    kind: ClassVar[str] = "brake"
    settles: ClassVar[bool] = True

    def motion(self, seed: int, duration: float) -> Motion:
        """Exact motion for at least `duration` [s], see `Disturbance.motion`."""
        low = self.mean - self.drop
        times = np.cumsum([0.0, self.onset, self.ramp, self.hold, self.recovery or self.ramp])
        return polyline(self.mean, times, [self.mean, self.mean, low, low, self.mean])


def _check_edge(kind: str, edge: float, omega: float) -> None:
    if edge > math.pi / omega:
        raise HeadwayError(f"{kind}.edge = {edge:g} s is longer than half a period, {math.pi / omega:g} s")


@spec
class Square(Repeating):
    """Square wave `mean ± A`, high first; each edge a ramp of `edge` seconds around the ideal jump."""

    mean: Mean
    amplitude: Amplitude
    omega: Omega
    edge: Edge = 0.0
    kind: ClassVar[str] = "square"

    def __post_init__(self) -> None:
        _check_edge(self.kind, self.edge, self.omega)

    def motion(self, seed: int, duration: float) -> Motion:
        """Exact motion for at least `duration` [s], see `Disturbance.motion`."""
        half, rim = math.pi / self.omega, 0.5 * self.edge
        check_size(f"square.omega = {self.omega:g} rad/s", 2 * duration / half, "knots of the leader")
        count = int(duration / half) + 2
        times, speeds = [0.0, rim], [self.mean, self.mean + self.amplitude]
        for i in range(1, count):
            level = self.amplitude * (-1.0) ** i
            times += [i * half - rim, i * half + rim]
            speeds += [self.mean - level, self.mean + level]
        return polyline(self.mean, times, speeds)


@spec
class Sawtooth(Repeating):
    """Sawtooth that rises through the mean at t = 0 and falls from +A to -A each half period later."""

    mean: Mean
    amplitude: Amplitude
    omega: Omega
    edge: Edge = 0.0
    kind: ClassVar[str] = "sawtooth"

    def __post_init__(self) -> None:
        _check_edge(self.kind, self.edge, self.omega)

    def motion(self, seed: int, duration: float) -> Motion:
        """Exact motion for at least `duration` [s], see `Disturbance.motion`."""
        period, rim = 2.0 * math.pi / self.omega, 0.5 * self.edge
        peak = self.amplitude * (1.0 - self.edge / period)
        check_size(f"sawtooth.omega = {self.omega:g} rad/s", 2 * duration / period, "knots of the leader")
        times, speeds = [0.0], [self.mean]
        for i in range(int(duration / period) + 2):
            middle = (i + 0.5) * period
            times += [middle - rim, middle + rim]
            speeds += [self.mean + peak, self.mean - peak]
        return polyline(self.mean, times, speeds)


@spec
class Triangle(Repeating):
    """Triangle wave that rises through the mean at t = 0; its speed has corners and no jumps."""

    mean: Mean
    amplitude: Amplitude
    omega: Omega
    kind: ClassVar[str] = "triangle"

    def motion(self, seed: int, duration: float) -> Motion:
        """Exact motion for at least `duration` [s], see `Disturbance.motion`."""
        quarter = 0.5 * math.pi / self.omega
        check_size(f"triangle.omega = {self.omega:g} rad/s", duration / quarter, "knots of the leader")
        corners = np.arange(int(duration / (2.0 * quarter)) + 2)
        times = np.concatenate(([0.0], (2 * corners + 1) * quarter))
        speeds = np.concatenate(([self.mean], self.mean + self.amplitude * (-1.0) ** corners))
        return polyline(self.mean, times, speeds)


@spec
class Multisine(Disturbance):
    """Sum of sines `mean + Σ A_k sin(ω_k t + φ_k)` from t = 0."""

    mean: Mean
    amplitudes: Annotated[Numbers, unit("m/s", "amplitude of each sine", usual=[[1.0, 0.6], 0.0, 0.0])]
    omegas: Annotated[Numbers, unit("rad/s", "angular frequency of each sine", usual=[[0.4, 1.1], 0.0, 0.0])]
    phases: Annotated[Numbers, unit("rad", "phase of each sine; empty for all zero")] = ()
    kind: ClassVar[str] = "multisine"

    def __post_init__(self) -> None:
        if not self.amplitudes:
            raise HeadwayError("multisine.amplitudes is empty; give at least one sine")
        for name, values in (("omegas", self.omegas), ("phases", self.phases or self.amplitudes)):
            if len(values) != len(self.amplitudes):
                raise HeadwayError(
                    f"multisine.{name} has {len(values)} values but amplitudes has {len(self.amplitudes)}"
                )
        if min(self.omegas) <= 0:
            raise HeadwayError(f"multisine.omegas = {shorten(list(self.omegas))} must all be greater than 0")

    @property
    def frequencies(self) -> tuple[float, ...]:
        """Those of its sines."""
        return self.omegas

    def motion(self, seed: int, duration: float) -> Motion:
        """Exact motion for at least `duration` [s], see `Disturbance.motion`."""
        phases = self.phases or (0.0,) * len(self.omegas)
        sines = tuple((a, w, p, 0.0) for a, w, p in zip(self.amplitudes, self.omegas, phases, strict=True))
        return Motion.of(self.mean, [MotionPiece(0.0, (self.mean,), sines)])


@spec
class Chirp(Disturbance):
    """Sine whose frequency goes linearly from `omega_start` to `omega_end` during `sweep`, then stays."""

    mean: Mean
    amplitude: Amplitude
    omega_start: Annotated[Positive, unit("rad/s", "angular frequency at t = 0", usual=[0.1, 0.02, 6.0])]
    omega_end: Annotated[Positive, unit("rad/s", "angular frequency at the end of the sweep", usual=[2.0, 0.02, 6.0])]
    sweep: Annotated[Positive, unit("s", "duration of the sweep", usual=[60.0, 1.0, 300.0])]
    kind: ClassVar[str] = "chirp"

    @property
    def frequencies(self) -> tuple[float, ...]:
        """The first and the last of the sweep."""
        return self.omega_start, self.omega_end

    def motion(self, seed: int, duration: float) -> Motion:
        """Exact motion for at least `duration` [s], see `Disturbance.motion`."""
        beta = (self.omega_end - self.omega_start) / self.sweep
        phase = 0.5 * (self.omega_start + self.omega_end) * self.sweep
        first = MotionPiece(0.0, (self.mean,), ((self.amplitude, self.omega_start, 0.0, beta),))
        then = MotionPiece(self.sweep, (self.mean,), ((self.amplitude, self.omega_end, phase, 0.0),))
        return Motion.of(self.mean, [first, then])


@spec
class Noise(Disturbance):
    """Ornstein-Uhlenbeck noise around the mean, seeded by the scenario; it starts at the mean.

    The process is sampled exactly every `sample` seconds (theory: w ← e^{-h/τ} w + sqrt(1 - e^{-2h/τ}) η)
    and joined by monotone cubics, so that speed and acceleration are continuous and the path does
    not depend on the time step.
    """

    mean: Mean
    sd: Annotated[NonNegative, unit("m/s", "standard deviation of the speed", usual=[1.0, 0.0, 5.0])]
    correlation_time: Annotated[Positive, unit("s", "correlation time τ", usual=[5.0, 0.1, 60.0])] = 5.0
    sample: Annotated[Positive, unit("s", "distance of the samples", usual=[0.5, 0.1, 5.0])] = 0.5
    kind: ClassVar[str] = "noise"
    random: ClassVar[bool] = True

    def motion(self, seed: int, duration: float) -> Motion:
        """Exact motion for at least `duration` [s], see `Disturbance.motion`."""
        check_size(f"noise.sample = {self.sample:g} s", duration / self.sample, "knots of the leader")
        # two samples beyond the end keep the path the same when only the duration changes
        count = math.ceil(duration / self.sample) + 3
        stream = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(0,)))
        decay = math.exp(-self.sample / self.correlation_time)
        kicks = math.sqrt(1.0 - decay * decay) * stream.standard_normal(count)
        path = np.zeros(count + 1)
        for i in range(count):
            path[i + 1] = decay * path[i] + kicks[i]
        return smooth_curve(self.mean, self.sample * np.arange(count + 1), self.mean + self.sd * path)


@spec
class Cycle(Disturbance):
    """A section of a standard drive cycle, from `start` to `end` of its own time.

    Between the published 1 Hz points the speed is linear, as the regulations define it, or a
    monotone cubic (`interpolation = "smooth"`).
    """

    name: Annotated[str, unit("", "name of the cycle", enum=list(CYCLES), usual=["udds", 0.0, 0.0])]
    start: Annotated[NonNegative, unit("s", "where the section begins", usual=[0.0, 0.0, 1800.0])] = 0.0
    end: Annotated[
        Positive | None, unit("s", "where it ends; the end of the cycle if not given", usual=[None, 1.0, 1800.0])
    ] = None
    interpolation: Literal["linear", "smooth"] = "linear"
    kind: ClassVar[str] = "cycle"
    source: ClassVar[str] = (
        "Driving cycles: UN Global Technical Regulation No. 15 (WLTC) and US EPA (US06, HWFET, UDDS)"
    )

    def __post_init__(self) -> None:
        length = float(load_cycle(self.name).time[-1])
        end = length if self.end is None else self.end
        if not self.start < end <= length:
            raise HeadwayError(
                f"cycle {self.name}: the section from {self.start:g} to {end:g} s is not within 0 to {length:g} s"
            )

    @property
    def span(self) -> float:
        """Length [s], after which it ends."""
        return (float(load_cycle(self.name).time[-1]) if self.end is None else self.end) - self.start

    def motion(self, seed: int, duration: float) -> Motion:
        """Exact motion for at least `duration` [s], see `Disturbance.motion`."""
        cycle = load_cycle(self.name)
        return section(cycle.time, cycle.speed, self.start, self.start + self.span, self.interpolation)


def section(time: np.ndarray, speed: np.ndarray, start: float, end: float, interpolation: str) -> Motion:
    """Motion along tabulated speeds from `start` to `end` of their own time, shifted to begin at 0."""
    inside = (time > start) & (time < end)
    knots = np.concatenate(([start], time[inside], [end])) - start
    speeds = np.concatenate(([np.interp(start, time, speed)], speed[inside], [np.interp(end, time, speed)]))
    curve = polyline if interpolation == "linear" else smooth_curve
    return curve(float(speeds[0]), knots, speeds)


KINDS: dict[str, type[Disturbance]] = {
    c.kind: c for c in (Constant, Sine, Window, Step, Brake, Square, Sawtooth, Triangle, Multisine, Chirp, Noise, Cycle)
}


def kind_named(name: object) -> type[Disturbance]:
    """The class of leader called `name` in a file."""
    if not isinstance(name, str) or name not in KINDS:
        raise unknown_name("leader.kind", name, KINDS)
    return KINDS[name]
