"""How a steady oscillation changes from vehicle to vehicle: amplitude, phase, shape.

Over a whole number of periods at the end of the record each signal is fitted by

    y(t) = c0 + c1 t + Σ_k Re(C_k e^{ikωt}),   k = 1 … K,

by least squares with the weights of the trapezoid rule; constant and trend are thus removed, and samples
need be neither dense nor evenly spaced. C_1 is the fundamental, which linear theory predicts
(`Linear.gain`, `Linear.phase_lag`); the other C_k are what the law's nonlinearity adds. A vehicle that is
NaN anywhere in the window (after a collision) is NaN here.
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from headway.arrays import Array
from headway.errors import HeadwayError
from headway.metrics.inputs import Reference, Signals, meaning, positive, trajectories, unit_of
from headway.metrics.registry import metric
from headway.sampling import trapezoid

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["amplitude_growth", "describing_function", "fundamental", "harmonic_distortion", "phase_lag", "time_lag"]

Window = tuple[float, float]

#: most harmonics that are fitted, the fundamental included
_HARMONICS = 10
#: amplitudes below this share of the signal's size are rounding
_NOTHING = 1e-11
#: what is no oscillation (r.m.s.) may be this share of the fundamental; less than this in the signal's unit is nothing
_UNSTEADY, _ROUNDING = 0.5, 1e-9
#: slower than this [m/s] a vehicle stands
_STANDSTILL = 1e-9
#: why a vehicle has no steady oscillation
_FLAWS = {
    1: "not known throughout (a collision)",
    2: "standing still for a time",
    3: "not swinging steadily (the record is too short, or what is left of a fit is large)",
}


@metric(
    "signal",
    "fundamental of {signal}",
    formula="C_1",
    says="amplitude and phase at the forcing frequency, as a complex number",
    per="phasor",
)
def fundamental(
    dataset: xr.Dataset, signal: str = "speed", omega: float | None = None, window: Window | None = None
) -> xr.DataArray:
    """Complex amplitude C_1 of a signal at the forcing frequency, in its unit: `y ≈ |C_1| cos(ωt + arg C_1)`.

    Args:
        dataset: trajectories of a run, or a `Recording`.
        signal: the variable y.
        omega: angular frequency ω [rad/s] > 0; that of the leader in the dataset's scenario if None.
        window: (start, end) [s] of the steady part, shortened at its start to whole periods; the whole periods in the
            second half of the record, at least the last one, if None.

    Raises:
        HeadwayError: if not a single period fits, if a period has fewer than 5 samples, or if no follower has a value
            throughout the window.
    """
    fit = _fit(dataset, "fundamental", signal, omega, window)
    return fit.signals.result(fit.parts[0])


@metric(
    "1",
    "amplitude of {signal} over that of the {to}",
    formula="|C_1| over that of the predecessor, or of the leader",
    says="whether the disturbance grows from car to car at this frequency",
    threshold="> 1 grows",
)
def amplitude_growth(
    dataset: xr.Dataset,
    signal: str = "speed",
    omega: float | None = None,
    window: Window | None = None,
    to: Reference = "predecessor",
) -> xr.DataArray:
    """Ratio [1] >= 0 of fundamentals |C_1|: each vehicle to the one ahead, or to the leader; above 1 it grew.

    For signals that the leader lacks, the first follower takes its place.

    Args:
        dataset: trajectories of a run, or a `Recording`.
        signal: the variable that oscillates.
        omega: angular frequency [rad/s], as in `fundamental`.
        window: (start, end) [s] of the steady part, as in `fundamental`.
        to: what each vehicle is compared with, `predecessor` or `leader`.

    Returns:
        One value a vehicle; NaN for the leader (to itself it is 1), for vehicles that collided, and behind one that
        does not oscillate.

    Raises:
        HeadwayError: as in `fundamental`, and if the first vehicle has no amplitude at this frequency.
    """
    fit = _fit(dataset, "amplitude_growth", signal, omega, window)
    c = fit.oscillating(signal)
    ratio = np.abs(c) / np.abs(fit.signals.reference(c, to))
    return fit.signals.result(ratio, fit.note())


@metric(
    "rad",
    "phase lag of {signal} to the {to}",
    formula="angle of C_1 behind the predecessor's, in −π/2 … 3π/2; to the leader: summed down the string",
    says="how far a car trails the wave",
)
def phase_lag(
    dataset: xr.Dataset,
    signal: str = "speed",
    omega: float | None = None,
    window: Window | None = None,
    to: Reference = "predecessor",
) -> xr.DataArray:
    """Angle [rad] by which each vehicle's fundamental lags behind the vehicle ahead, or the leader.

    A single run gives a lag up to whole turns only. From vehicle to vehicle the one between -π/2 and 3π/2
    is taken, as followers lag more than they lead; to the leader these are summed, so that the angle
    unwraps down the string.

    Args:
        dataset: trajectories of a run, or a `Recording`.
        signal: the variable that oscillates.
        omega: angular frequency [rad/s], as in `fundamental`.
        window: (start, end) [s] of the steady part, as in `fundamental`.
        to: what each vehicle is compared with, `predecessor` or `leader`.

    Raises:
        HeadwayError: as in `amplitude_growth`.
    """
    fit = _fit(dataset, "phase_lag", signal, omega, window)
    return fit.signals.result(_lags(fit, signal, to), fit.note())


@metric(
    "s",
    "time lag of {signal} to the {to}",
    formula="phase lag / ω",
    says="the same as a time",
)
def time_lag(
    dataset: xr.Dataset,
    signal: str = "speed",
    omega: float | None = None,
    window: Window | None = None,
    to: Reference = "predecessor",
) -> xr.DataArray:
    """Time [s] by which each vehicle lags behind: `phase_lag` over ω.

    Args:
        dataset: trajectories of a run, or a `Recording`.
        signal: the variable that oscillates.
        omega: angular frequency ω [rad/s], as in `fundamental`.
        window: (start, end) [s] of the steady part, as in `fundamental`.
        to: what each vehicle is compared with, `predecessor` or `leader`.
    """
    fit = _fit(dataset, "time_lag", signal, omega, window)
    return fit.signals.result(_lags(fit, signal, to) / fit.omega, fit.note())


@metric(
    "1",
    "harmonic distortion of {signal}",
    formula="`sqrt(Σ_{k≥2} |C_k|²) / |C_1|`",
    says="how nonlinear the answer is",
    threshold="0 for a linear law behind a sine",
)
def harmonic_distortion(
    dataset: xr.Dataset, signal: str = "speed", omega: float | None = None, window: Window | None = None
) -> xr.DataArray:
    """Total harmonic distortion THD_F [1] >= 0: `sqrt(Σ |C_k|², k = 2 … K) / |C_1|`, 0 for a pure sine.

    K is 10, or less where a period has fewer than 23 samples.

    Args:
        dataset: trajectories of a run, or a `Recording`.
        signal: the variable that oscillates.
        omega: angular frequency [rad/s], as in `fundamental`.
        window: (start, end) [s] of the steady part, as in `fundamental`.

    Raises:
        HeadwayError: as in `amplitude_growth`.
    """
    fit = _fit(dataset, "harmonic_distortion", signal, omega, window)
    overtones = np.sqrt(np.sum(np.abs(fit.parts[1:]) ** 2, axis=0))
    ratio = overtones / np.abs(fit.oscillating(signal))
    return fit.signals.result(ratio, fit.note())


def describing_function(
    runs: xr.Dataset | Sequence[xr.Dataset],
    signal: str = "speed",
    omega: float | None = None,
    window: Window | None = None,
    to: Reference = "predecessor",
) -> xr.DataArray:
    """Gain [1] against amplitude: `amplitude_growth` of runs that differ in the amplitude of their leader.

    A linear law gives the same gain at every amplitude.

    Args:
        runs: several datasets (the result gets the dimension `run`), or one with an extra dimension, which is kept.
        signal: the variable that oscillates.
        omega: angular frequency [rad/s], as in `fundamental`.
        window: (start, end) [s] of the steady part, as in `fundamental`.
        to: what each vehicle is compared with, `predecessor` or `leader`.

    Returns:
        Gains, with the coordinate `input_amplitude`: |C_1| of what the vehicle is compared with, in the unit of the
        signal.

    Raises:
        HeadwayError: as in `amplitude_growth`, and for runs that differ in their number of vehicles.
    """
    import xarray as xr

    if not isinstance(runs, Sequence):
        runs = trajectories(runs, "describing_function")
        fit = _fit(runs, "describing_function", signal, omega, window)
        c = fit.oscillating(signal)
        ahead = np.abs(fit.signals.reference(c, to))
        gain = fit.signals.result(np.abs(c) / ahead, fit.note())
        gain.attrs = {"units": "1", "long_name": f"gain of {meaning(runs, signal)} to the {to}", **gain.attrs}
        size = fit.signals.result(ahead)
        size.attrs = {"units": unit_of(runs, signal), "long_name": f"amplitude of the {to}"}
        return gain.assign_coords(input_amplitude=size)
    if not len(runs):
        raise HeadwayError("describing_function needs at least one run")
    parts = [describing_function(run, signal, omega, window, to) for run in runs]
    if len({part.sizes["vehicle"] for part in parts}) > 1:
        raise HeadwayError("describing_function: the runs differ in their number of vehicles")
    return xr.concat(parts, dim="run", coords=["input_amplitude"], compat="override", join="override")


@dataclass(frozen=True)
class _Fit:
    """Complex amplitudes `parts` (K, …, vehicle) of the harmonics of ω, and the size (…, vehicle) of the signal.

    `flaw` (…, vehicle) is why a vehicle has no steady oscillation, a number of `_FLAWS`; 0 if it has one.
    """

    signals: Signals
    omega: float
    start: float
    end: float
    parts: NDArray[np.complex128]
    size: Array
    flaw: NDArray[np.int64]

    def note(self) -> str:
        """Which vehicles have no value and why, in words; empty if there is none."""
        reasons = []
        for number, why in _FLAWS.items():
            which = self.signals.vehicle[(self.flaw == number).reshape(-1, self.flaw.shape[-1]).any(axis=0)]
            if which.size:
                reasons.append(f"{_listed(which.tolist())} {why}")
        return f"no steady oscillation from {self.start:g} to {self.end:g} s: {'; '.join(reasons)}" if reasons else ""

    def oscillating(self, name: str) -> NDArray[np.complex128]:
        """The fundamental, NaN where it is nothing but rounding; `HeadwayError` if it is that for the first vehicle."""
        c = np.where(np.abs(self.parts[0]) > _NOTHING * self.size, self.parts[0], np.nan)
        first = Signals.first(self.parts[0])
        flawed = np.where(self.flaw == 0, c, np.nan)
        if not np.isfinite(c[..., first]).any():
            raise HeadwayError(
                f"{self.signals.measure}: {name!r} of vehicle {self.signals.vehicle[first]} has an amplitude of zero "
                f"at {self.omega:g} rad/s from {self.start:g} to {self.end:g} s; nothing to compare with"
            )
        return flawed


def _fit(dataset: xr.Dataset, measure: str, signal: str, omega: float | None, window: Window | None) -> _Fit:
    signals = Signals(dataset, measure, signal)
    omega = _forcing(dataset, measure) if omega is None else omega
    positive(measure, omega=omega)
    start, end = _whole_periods(signals, omega, window)
    part = signals.within((start, end))
    time, rows = signals.time[part], np.ascontiguousarray(signals[signal][..., part])
    weights, columns = _weights(time, omega, _order(measure, time, omega, end - start))
    # row by row and sum by sum: a signal among many has the bits of one alone
    coefficients = [(rows * w).sum(axis=-1) for w in weights]
    parts = np.array([a - 1j * b for a, b in zip(coefficients[2::2], coefficients[3::2], strict=True)])
    signals.need_follower(np.isfinite(parts[0]), signal, start, end)
    rest = rows.copy()
    for share, column in zip(coefficients, columns, strict=True):
        rest -= share[..., None] * column
    flaw = _flaws(dataset, signals, part, np.sqrt((rest * rest).mean(axis=-1)), np.abs(parts[0]))
    return _Fit(signals, omega, start, end, parts, np.abs(rows).max(axis=-1), flaw)


def _flaws(dataset: xr.Dataset, signals: Signals, part: slice, rest: Array, amplitude: Array) -> NDArray[np.int64]:
    """Why each vehicle (…, vehicle) has no steady oscillation, by number of `_FLAWS`."""
    flaw = np.where(np.isfinite(amplitude), 0, 1)
    # the leader is as it is: only what follows it may fail to oscillate
    follows = signals.vehicle != 0
    flaw[(rest > _UNSTEADY * amplitude) & (rest > _ROUNDING) & follows & (flaw == 0)] = 3
    if "speed" in dataset:
        speed = Signals(dataset, signals.measure, "speed")["speed"][..., part]
        flaw[np.broadcast_to((np.abs(speed) <= _STANDSTILL).any(axis=-1) & follows, flaw.shape) & (flaw != 1)] = 2
    if signals.first(np.where(flaw == 1, np.nan, 1.0)) == 1:  # what a leader has not
        flaw[..., 0] = 0
    return flaw


def _listed(numbers: list[int]) -> str:
    """`vehicle 3`, `vehicles 1, 2, 3`, `vehicles 3 to 9`."""
    if len(numbers) == 1:
        return f"vehicle {numbers[0]}"
    if len(numbers) > 3 and numbers[-1] - numbers[0] == len(numbers) - 1:
        return f"vehicles {numbers[0]} to {numbers[-1]}"
    return f"vehicles {', '.join(map(str, numbers))}"


def _forcing(dataset: xr.Dataset, measure: str) -> float:
    """ω of the leader, as the scenario in the attributes says."""
    leader = tomllib.loads(dataset.attrs.get("scenario", "")).get("leader", {})
    if "omega" not in leader:
        kind = f"a {leader['kind']} leader has no single frequency" if leader else "the dataset has no scenario"
        raise HeadwayError(f"{measure} needs omega, the forcing frequency in rad/s; {kind}")
    return float(leader["omega"])


def _whole_periods(signals: Signals, omega: float, window: Window | None) -> tuple[float, float]:
    """The last part of the window that is a whole number of periods long."""
    period = 2.0 * math.pi / omega
    if window is None:
        start, end = signals.time[0], signals.time[-1]
        count = max(_count(0.5 * (end - start), period), min(1, _count(end - start, period)))
        place = "record"
    else:
        signals.within(window)
        start, end = window
        count, place = _count(end - start, period), "window"
    if count < 1:
        raise HeadwayError(
            f"{signals.measure}: the {place} from {start:g} to {end:g} s is shorter than one period of "
            f"{omega:g} rad/s, {period:.4g} s"
        )
    return max(float(end) - count * period, float(start)), float(end)


def _count(length: float, period: float) -> int:
    return math.floor(length / period + 1e-9)


def _order(measure: str, time: Array, omega: float, length: float) -> int:
    """How many harmonics can be told apart."""
    count = (time.size - 1) * 2.0 * math.pi / (omega * length)
    if count < 5 - 1e-9:
        raise HeadwayError(
            f"{measure}: {count:.1f} samples a period of {omega:g} rad/s are too few; at least 5 are needed"
        )
    return min(_HARMONICS, math.floor((count + 1e-9 - 3) / 2))


def _weights(time: Array, omega: float, order: int) -> tuple[Array, Array]:
    """Rows (2 + 2 order, T): what each sample adds to constant, trend, and cosine and sine of each harmonic.

    And these functions of time themselves, likewise.
    """
    span = time[-1] - time[0]
    columns = [np.ones_like(time), (time - time[0]) / span - 0.5]
    for k in range(1, order + 1):
        columns += [np.cos(k * omega * time), np.sin(k * omega * time)]
    rows = np.array(columns)
    weighted = rows * trapezoid(time)
    # over whole periods the columns are nearly orthogonal: normal equations lose nothing
    return np.linalg.solve(weighted @ rows.T, weighted), rows


def _lags(fit: _Fit, signal: str, to: str) -> Array:
    c = fit.oscillating(signal)
    ahead = fit.signals.reference(c, "predecessor")
    with np.errstate(invalid="ignore"):
        turned: NDArray[Any] = ahead / c
    steps = np.angle(turned)
    steps = np.where(steps < -0.5 * np.pi, steps + 2.0 * np.pi, steps)
    if to == "predecessor":
        return steps
    fit.signals.reference(c, to)
    first = Signals.first(c)
    steps[..., first] = np.where(np.isfinite(c[..., first]), 0.0, np.nan)
    steps[..., first:] = np.cumsum(steps[..., first:], axis=-1)
    return steps
