"""How a disturbance dies: decrement, settling, overshoot, and norms from vehicle to vehicle."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from headway.arrays import Array
from headway.errors import HeadwayError
from headway.metrics.extremes import extreme_of, peak_of, refined
from headway.metrics.inputs import Reference, Signals, checked, positive
from headway.metrics.registry import metric
from headway.sampling import trapezoid

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["l2_ratio", "linf_ratio", "logarithmic_decrement", "overshoot", "settling_time"]

#: speeds [m/s] and errors [m] that differ by less are the same
_SAME = 1e-9


@metric(
    "1",
    "logarithmic decrement of {signal}",
    formula="−2 × slope of ln of successive swings, from the largest down to 2 % of it",
    says="damping of what remains after a disturbance: ξ = δ/√(4π² + δ²); NaN where nothing oscillates",
    threshold="< 0 grows",
    whose="least",
)
def logarithmic_decrement(
    dataset: xr.Dataset, signal: str = "spacing_error", after: float | None = None, floor: float = 0.02
) -> xr.DataArray:
    """Logarithm δ [1] of the ratio of successive peaks after a disturbance; negative if they grow.

    δ = -2 times the slope of ln |y_{j+1} - y_j| over j, by least squares over the swings between successive
    extremes (refined between samples), from the largest swing down to the share `floor` of it. Swings need no
    rest value, and of a damped cosine they shrink by e^{-δ/2} exactly. The damping ratio is δ/sqrt(4π² + δ²).

    Args:
        dataset: trajectories of a run, or a `Recording`.
        signal: the variable whose swings are measured.
        after: when the disturbance is over [s]; the time from which the leader's speed stays constant if None.
        floor: the least swing that counts, as a share of the largest, > 0.

    Returns:
        One value a vehicle; NaN where fewer than two swings are left (an aperiodic response), and after a collision.

    Raises:
        HeadwayError: if `after` is outside the record, or no follower has a whole record.
    """
    signals = Signals(dataset, "logarithmic_decrement", signal)
    positive("logarithmic_decrement", floor=floor)
    values = signals[signal]
    end = np.broadcast_to(_end_of_disturbance(dataset, signals, after), values.shape[:-1]).ravel()
    rows = values.reshape(-1, signals.time.size)
    whole = np.isfinite(rows).all(axis=1)
    signals.need_follower(whole.reshape(values.shape[:-1]), signal)
    decrements = np.full(rows.shape[0], np.nan)
    for i in np.flatnonzero(whole):
        decrements[i] = _decrement(_extremes(signals.time, rows[i], end[i]), floor)
    return signals.result(decrements.reshape(values.shape[:-1]))


@metric(
    "s",
    "settling time of {signal}",
    formula="from the end of the disturbance until the signal stays within ± 5 % of its largest deviation "
    "around its last value",
    says="how long the disturbance is felt; NaN if not settled",
)
def settling_time(
    dataset: xr.Dataset, signal: str = "spacing_error", after: float | None = None, band: float = 0.05
) -> xr.DataArray:
    """Time [s] >= 0 from the end of a disturbance until a signal stays near its last value.

    The last crossing of the band is located between samples.

    Args:
        dataset: trajectories of a run, or a `Recording`.
        signal: the variable that settles.
        after: when the disturbance is over [s]; the time from which the leader's speed stays constant if None.
        band: half width of the band, as a share of the largest deviation from the last value in the record, > 0.

    Returns:
        One value a vehicle; NaN where the signal still leaves the band in the last tenth of the record (not settled),
        and after a collision.

    Raises:
        HeadwayError: if `after` is outside the record, or no follower has a whole record.
    """
    signals = Signals(dataset, "settling_time", signal)
    positive("settling_time", band=band)
    time, values = signals.time, signals[signal]
    signals.need_follower(np.isfinite(values).all(axis=-1), signal)
    end = _end_of_disturbance(dataset, signals, after)
    away = np.abs(values - values[..., -1:])
    limit = np.maximum(band * away.max(axis=-1), _SAME)
    outside = away > limit[..., None]
    last = time.size - 1 - np.argmax(outside[..., ::-1], axis=-1)
    here = np.minimum(last, time.size - 2)
    y0, y1 = (np.take_along_axis(away, at[..., None], axis=-1)[..., 0] for at in (here, here + 1))
    with np.errstate(all="ignore"):
        crossing = time[here] + np.diff(time)[here] * (y0 - limit) / (y0 - y1)
    settled = np.where(outside.any(axis=-1), np.maximum(crossing - end, 0.0), 0.0)
    late = crossing > time[-1] - 0.1 * (time[-1] - time[0])
    bad = ~np.isfinite(values).all(axis=-1) | (outside.any(axis=-1) & late)
    return signals.result(np.where(bad, np.nan, settled))


@metric(
    "1",
    "overshoot of {signal} over the leader's range",
    formula="how far a car leaves the leader's range of speeds, over that range",
    says="whether a car goes faster or slower than the leader ever did",
    threshold="0: never",
)
def overshoot(dataset: xr.Dataset, signal: str = "speed") -> xr.DataArray:
    """How far [1] >= 0 the signal of each vehicle leaves the leader's range, as a share of that range.

    Behind a single step this is the usual overshoot; it means as much behind a step and back, a window or a
    recorded leader. Collided vehicles are measured until then.

    Args:
        dataset: trajectories of a run, or a `Recording`.
        signal: the variable that is compared.

    Returns:
        One value a vehicle, 0 for the leader.

    Raises:
        HeadwayError: if the leader's signal does not change.
    """
    signals = Signals(dataset, "overshoot", signal)
    high, low = (extreme_of(signals.time, signals[signal], s, signals.bounds(signal)) for s in (1.0, -1.0))
    top, bottom = signals.reference(high, "leader"), signals.reference(low, "leader")
    span = np.where(top - bottom > _SAME, top - bottom, np.nan)
    if not np.isfinite(span).any():
        raise HeadwayError(f"overshoot: the leader's {signal!r} does not change; there is nothing to overshoot")
    beyond = np.maximum(np.maximum(high - top, bottom - low), 0.0)
    return signals.result(beyond / span)


@metric(
    "1",
    "L2 norm of the deviation of {signal} over the {to}'s",
    formula="ratio of `sqrt(∫ (v − v(0))² dt)` to the predecessor, or the leader",
    says="energy of a disturbance of any shape",
    threshold="> 1 grows",
)
def l2_ratio(
    dataset: xr.Dataset, signal: str = "speed", to: Reference = "predecessor", about: float | None = None
) -> xr.DataArray:
    """Ratio [1] >= 0 of `sqrt(∫ (y - y(0))² dt)`, each vehicle to the one ahead or to the leader.

    Both norms run until the vehicle collides. Over a record that ends before the wave has passed the ratio is
    too small.

    Args:
        dataset: trajectories of a run, or a `Recording`.
        signal: the variable y.
        to: what each vehicle is compared with, `predecessor` or `leader`.
        about: the value that deviations are taken from, in the unit of the signal; y(0) of each vehicle if None.

    Returns:
        One value a vehicle; NaN for the leader to its predecessor and behind a vehicle that does not move.

    Raises:
        HeadwayError: if the first vehicle does not deviate.
    """
    return _norm_ratio(dataset, "l2_ratio", signal, to, about)


@metric(
    "1",
    "L∞ norm of the deviation of {signal} over the {to}'s",
    formula="ratio of `max |v − v(0)|`",
    says="its peak",
    threshold="> 1 grows",
)
def linf_ratio(
    dataset: xr.Dataset, signal: str = "speed", to: Reference = "predecessor", about: float | None = None
) -> xr.DataArray:
    """Ratio [1] >= 0 of `max |y - y(0)|`, refined between samples, each vehicle to the one ahead or to the leader.

    Args:
        dataset: trajectories of a run, or a `Recording`.
        signal: the variable y.
        to: what each vehicle is compared with, `predecessor` or `leader`.
        about: the value that deviations are taken from, in the unit of the signal; y(0) of each vehicle if None.

    Returns:
        One value a vehicle; NaN for the leader to its predecessor and behind a vehicle that does not move.

    Raises:
        HeadwayError: if the first vehicle does not deviate.
    """
    return _norm_ratio(dataset, "linf_ratio", signal, to, about)


def _norm_ratio(dataset: xr.Dataset, measure: str, signal: str, to: str, about: float | None) -> xr.DataArray:
    signals = Signals(dataset, measure, signal)
    values = signals[signal]
    middle = values[..., :1] if about is None else np.full((1,) * values.ndim, checked(measure, "about", about))
    away = values - middle
    reach = [np.broadcast_to(b, away.shape[:-1]) - middle[..., 0] for b in signals.bounds(signal)]
    weight = trapezoid(signals.time)

    def norm(y: Array, bounds: list[Array]) -> Array:
        if measure == "linf_ratio":
            return peak_of(signals.time, y, (bounds[0], bounds[1]))
        size = np.sqrt((np.where(np.isfinite(y), y, 0.0) ** 2 * weight).sum(axis=-1))
        return np.where(np.isfinite(y).any(axis=-1), size, np.nan)

    own = norm(away, reach)
    first = Signals.first(own)
    if not (own[..., first] > _SAME).any():
        raise HeadwayError(f"{measure}: {signal!r} of vehicle {signals.vehicle[first]} has an amplitude of zero")
    ahead = signals.reference(away.swapaxes(-1, -2), to).swapaxes(-1, -2)
    compared = norm(np.where(np.isfinite(away), ahead, np.nan), [signals.reference(b, to) for b in reach])
    ratio = own / np.where(compared > _SAME, compared, np.nan)
    return signals.result(ratio)


def _end_of_disturbance(dataset: xr.Dataset, signals: Signals, after: float | None) -> Array:
    """When the leader has reached its last speed for good, (…, 1); or `after`."""
    time, measure = signals.time, signals.measure
    if after is not None:
        if not time[0] <= checked(measure, "after", after) < time[-1]:
            raise HeadwayError(
                f"{measure}: after = {after:g} s is not within the record, {time[0]:g} to {time[-1]:g} s"
            )
        return np.array(float(after))
    speed = Signals(dataset, measure, "speed")["speed"][..., :1, :]
    if signals.vehicle[0] != 0:
        raise HeadwayError(f"{measure}: the leader, vehicle 0, is not in this dataset; give after")
    moving = np.abs(speed - speed[..., -1:]) > _SAME
    last = np.where(moving.any(axis=-1), time.size - 1 - np.argmax(moving[..., ::-1], axis=-1), -1)
    if (last >= time.size - 2).any():
        raise HeadwayError(f"{measure}: the leader's speed changes until the record ends; give after")
    return np.asarray(time[last + 1])


def _extremes(time: Array, y: Array, after: float) -> Array:
    """Local highest and least values of one signal later than `after`, in order, refined between samples."""
    step = np.diff(y)
    at = 1 + np.flatnonzero(((step[:-1] > 0) & (step[1:] <= 0)) | ((step[:-1] < 0) & (step[1:] >= 0)))
    at = at[time[at] > after]
    sign = np.where(step[at - 1] > 0, 1.0, -1.0)
    around = sign * y[np.clip(at + np.arange(-2, 3)[:, None], 0, time.size - 1)]
    return sign * refined(time, sign * y[at], at, around, ringing=True)


def _decrement(extremes: Array, floor: float) -> float:
    swings = np.abs(np.diff(extremes))
    if swings.size < 2:
        return np.nan
    swings = swings[np.argmax(swings) :]
    small = np.flatnonzero(swings < max(floor * swings[0], _SAME))
    swings = swings[: small[0] if small.size else None]
    if swings.size < 2:
        return np.nan
    return float(-2.0 * np.polyfit(np.arange(swings.size), np.log(swings), 1)[0])
