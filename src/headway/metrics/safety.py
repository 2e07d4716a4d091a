"""How close to a collision: surrogate measures of every follower and the vehicle ahead of it.

Closing is `-relative_speed` > 0; the gap is bumper to bumper. A gap of zero or less is a collision: it is
reported on its own (`collided`, `collisions`), and nothing from that sample on enters any other measure,
so that none has a sign that it cannot have. As two vehicles touch while closing, their TTC is 0 and the
deceleration needed has no bound; those limits are given for a pair that collides. Vehicles behind a
collision are measured until then. The leader has no gap and is NaN.

Extremes are refined between samples. Between samples of an exposure (TET, TIT) gap and relative
speed are linear and the crossing of the threshold is found: its error falls with the square of the step.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from headway.arrays import Array
from headway.errors import HeadwayError
from headway.metrics.extremes import extreme_of
from headway.metrics.inputs import Signals, positive
from headway.metrics.reduction import EXTREMES, closest
from headway.metrics.registry import Reduced, metric
from headway.sampling import trapezoid

if TYPE_CHECKING:
    import xarray as xr

__all__ = [
    "collided", "collisions", "cpi", "drac", "least_gap", "mdrac", "picud", "rss_margin", "tet", "time_to_collision",
    "tit", "ttc",
]  # fmt: skip


@metric(
    "1",
    "collided with the vehicle ahead",
    formula="s ≤ 0",
    says="which vehicles hit the one ahead",
    threshold="0",
)
def collided(dataset: xr.Dataset) -> xr.DataArray:
    """Whether each vehicle hit the one ahead (true or false); `collision_time` of the dataset says when.

    Args:
        dataset: trajectories of a run, with `gap` and `relative_speed`, or a `Recording`.
    """
    pair = _pairs(dataset, "collided")
    return pair.signals.result(pair.hit)


@metric(
    "1",
    "number of collisions",
    formula="number of s ≤ 0",
    says="how many",
    threshold="0",
    per="run",
)
def collisions(dataset: xr.Dataset) -> xr.DataArray:
    """Number of collisions in the platoon, without the dimension vehicle.

    Args:
        dataset: as of `collided`.
    """
    return collided(dataset).sum("vehicle", keep_attrs=False)


@metric(
    "m",
    "least gap",
    formula="min s",
    says="how close",
    whose="least",
    reduced=Reduced("gap", EXTREMES, closest),
)
def least_gap(dataset: xr.Dataset) -> xr.DataArray:
    """Least gap [m] >= 0 over time; 0 for a pair that collided.

    Args:
        dataset: as of `collided`.
    """
    pair = _pairs(dataset, "least_gap")
    least = np.maximum(extreme_of(pair.time, pair.gap, -1.0), 0.0)
    return pair.signals.result(np.where(pair.hit, 0.0, least))


@metric(
    "s",
    "time to collision",
    formula="s / closing, if closing",
    says="over time; infinite if not closing",
    source="Hayward 1972",
    per="time",
)
def time_to_collision(dataset: xr.Dataset) -> xr.DataArray:
    """TTC = s / closing speed [s] > 0, (vehicle, time): infinite unless closing within an hour (Hayward 1972).

    Args:
        dataset: as of `collided`.
    """
    pair = _pairs(dataset, "time_to_collision")
    closing = pair.closing * _NEVER > pair.gap
    ratio = np.divide(pair.gap, pair.closing, out=np.full_like(pair.gap, np.inf), where=closing)
    return pair.signals.series(np.where(pair.valid, ratio, np.nan))


@metric(
    "s",
    "least time to collision",
    formula="min s / closing",
    says="time left if nobody reacts; infinite if it never closes",
    threshold="1.5 severe, 3–4 cautious",
    source="Hayward 1972; Minderhoud, Bovy 2001",
    whose="least",
)
def ttc(dataset: xr.Dataset) -> xr.DataArray:
    """Least time to collision [s] >= 0 over time: below 1.5 s severe, below 3 to 4 s calls for caution.

    Infinite if the gap would take more than an hour to close, 0 if it closed altogether. The highest 1/TTC is refined
    between samples, which is smooth where TTC is not (Hayward 1972; Minderhoud and Bovy 2001).

    Args:
        dataset: as of `collided`.
    """
    pair = _pairs(dataset, "ttc")
    return pair.signals.result(_least_ttc(pair))


@metric(
    "s",
    "time with TTC below {threshold:g} s",
    formula="time with TTC < 3 s",
    says="how long the danger lasts",
    threshold="TTC* = 3 s",
    source="Minderhoud, Bovy 2001",
)
def tet(dataset: xr.Dataset, threshold: float = 3.0) -> xr.DataArray:
    """Time exposed TET [s] >= 0: how long TTC is below a threshold (Minderhoud and Bovy 2001).

    Args:
        dataset: as of `collided`; time counts up to the last sample before a collision.
        threshold: TTC* [s] > 0.
    """
    pair = _pairs(dataset, "tet")
    width, _ = _exposure(pair, threshold)
    return pair.result(width)


@metric(
    "s²",
    "integral of TTC below {threshold:g} s",
    formula="∫ max(3 s − TTC, 0) dt",
    says="how long and how deep",
    threshold="TTC* = 3 s",
    source="Minderhoud, Bovy 2001",
)
def tit(dataset: xr.Dataset, threshold: float = 3.0) -> xr.DataArray:
    """Time integrated TIT = ∫ max(TTC* - TTC, 0) dt [s²] >= 0 (Minderhoud and Bovy 2001).

    Args:
        dataset: as of `collided`; time counts up to the last sample before a collision.
        threshold: TTC* [s] > 0.
    """
    pair = _pairs(dataset, "tit")
    _, area = _exposure(pair, threshold)
    return pair.result(area)


@metric(
    "m/s²",
    "largest deceleration to avoid a collision",
    formula="max closing² / (2 s)",
    says="braking needed at once",
    threshold="3.35",
    source="Cooper, Ferguson 1976",
)
def drac(dataset: xr.Dataset) -> xr.DataArray:
    """Largest deceleration rate to avoid a collision, `dv²/(2s)` while closing [m/s²] >= 0; above 3.35 is critical.

    0 if the gap never closes, infinite for a pair that collided (Cooper and Ferguson 1976; threshold: Archer 2005).

    Args:
        dataset: as of `collided`.
    """
    pair = _pairs(dataset, "drac")
    most = np.maximum(extreme_of(pair.time, _needed(pair), 1.0), 0.0)
    return pair.signals.result(np.where(pair.hit, np.inf, most))


@metric(
    "m/s²",
    "largest deceleration to avoid a collision after {reaction:g} s",
    formula="max closing / (2 (TTC − R)), R = 1 s",
    says="braking needed after a reaction; infinite if it would come too late",
    threshold="3.4",
)
def mdrac(dataset: xr.Dataset, reaction: float = 1.0) -> xr.DataArray:
    """Largest DRAC after a reaction time R, `closing / (2 (TTC - R))` [m/s²] >= 0; above 3.4 is critical.

    Infinite if TTC falls to R, where braking comes too late, and for a pair that collided; 0 if the gap never closes.

    Args:
        dataset: as of `collided`.
        reaction: reaction time R [s] > 0.
    """
    pair = _pairs(dataset, "mdrac")
    positive("mdrac", reaction=reaction)
    left = pair.gap - reaction * pair.closing
    with np.errstate(all="ignore"):
        rate = pair.closing * np.abs(pair.closing) / (2.0 * left)
    most = np.maximum(extreme_of(pair.time, np.where(left > 0, rate, np.nan), 1.0), 0.0)
    late = _least_ttc(pair) <= reaction
    return pair.result(np.where(late, np.inf, most))


@metric(
    "m",
    "least gap left after urgent braking (PICUD)",
    formula="min (v_l² − v²)/(2b) + s − v R, b = 3.3 m/s², R = 1 s",
    says="the gap left if the leader brakes hard",
    threshold="< 0",
    source="Uno et al. 2002",
    whose="least",
)
def picud(dataset: xr.Dataset, deceleration: float = 3.3, reaction: float = 1.0) -> xr.DataArray:
    """Least PICUD = (v_l² - v²)/(2b) + s - v R [m]: gap left if the leader brakes with b and the follower R later.

    Below 0 an emergency stop of the leader ends in a collision (Uno et al. 2002). Measured until a collision.

    Args:
        dataset: as of `collided`, with `speed`.
        deceleration: braking b of both [m/s²] > 0.
        reaction: reaction time R of the follower [s] > 0.
    """
    pair = _pairs(dataset, "picud", "speed")
    positive("picud", deceleration=deceleration, reaction=reaction)
    v = pair.signals["speed"]
    ahead = v - pair.closing
    left = (ahead * ahead - v * v) / (2.0 * deceleration) + pair.gap - v * reaction
    return pair.signals.result(extreme_of(pair.time, left, -1.0))


@metric(
    "1",
    "crash potential index",
    formula="mean over time of P(MADR ≤ DRAC), MADR ~ N(8.45, 1.4²) on [4.23, 12.68] m/s²",
    says="how likely the braking needed exceeds what the car can do",
    source="Cunto, Saccomanno 2008",
)
def cpi(
    dataset: xr.Dataset, mean: float = 8.45, deviation: float = 1.4, limits: tuple[float, float] = (4.23, 12.68)
) -> xr.DataArray:
    """Crash potential index: mean over time of P(MADR <= DRAC) [1], from 0 to 1.

    MADR, the deceleration that the vehicle has available, is a truncated normal variable. The mean runs over the
    time before a collision, by the trapezoid rule (Cunto and Saccomanno 2008).

    Args:
        dataset: as of `collided`.
        mean: mean of MADR [m/s²] > 0.
        deviation: its standard deviation [m/s²] > 0.
        limits: its least and largest value [m/s²], rising.
    """
    from scipy.special import ndtr

    pair = _pairs(dataset, "cpi")
    positive("cpi", mean=mean, deviation=deviation)
    low, high = limits
    if not low < high:
        raise HeadwayError(f"cpi: limits = {limits!r} do not rise")
    least, most = ndtr((low - mean) / deviation), ndtr((high - mean) / deviation)
    chance = (ndtr((np.clip(_needed(pair), low, high) - mean) / deviation) - least) / (most - least)
    weight = pair.valid * trapezoid(pair.time)
    with np.errstate(all="ignore"):
        share = (np.where(pair.valid, chance, 0.0) * weight).sum(axis=-1) / weight.sum(axis=-1)
    return pair.result(share)


@metric(
    "m",
    "least margin to the RSS distance",
    formula="min s − [v ρ + ρ² a/2 + (v + ρ a)²/(2b) − v_l²/(2 b_l)]₊, ρ = 1 s, a = 3.5, b = 4, b_l = 8 m/s²",
    says="the gap beyond the distance of Responsibility-Sensitive Safety",
    threshold="< 0 unsafe",
    source="Shalev-Shwartz, Shammah, Shashua 2017",
    whose="least",
)
def rss_margin(
    dataset: xr.Dataset,
    response: float = 1.0,
    acceleration: float = 3.5,
    brake: float = 4.0,
    leader_brake: float = 8.0,
) -> xr.DataArray:
    """Least gap less the safe distance of Responsibility-Sensitive Safety [m]; below 0 the gap is unsafe.

    `d = max(0, v ρ + ρ² a/2 + (v + ρ a)²/(2 b) - v_l²/(2 b_l))` (Shalev-Shwartz, Shammah, Shashua 2017, definition 1).
    The paper leaves the values open; the default ones are those that the library ad-rss-lib starts from. Measured
    until a collision.

    Args:
        dataset: as of `collided`, with `speed`.
        response: response time ρ [s] during which the follower speeds up.
        acceleration: a [m/s²], by which it does so at most.
        brake: b [m/s²], with which it then brakes at least.
        leader_brake: b_l [m/s²], with which the leader brakes at most.
    """
    pair = _pairs(dataset, "rss_margin", "speed")
    positive("rss_margin", response=response, acceleration=acceleration, brake=brake, leader_brake=leader_brake)
    v = pair.signals["speed"]
    ahead = np.maximum(v - pair.closing, 0.0)
    top = v + response * acceleration
    reach = v * response + 0.5 * acceleration * response**2 + top * top / (2.0 * brake)
    safe = np.maximum(reach - ahead * ahead / (2.0 * leader_brake), 0.0)
    return pair.signals.result(extreme_of(pair.time, pair.gap - safe, -1.0))


#: a gap that needs longer than this [s] to close does not close: what is left of its rate is rounding
_NEVER = 3600.0


class _Pairs(NamedTuple):
    """Gap [m] and closing speed [m/s], (…, vehicle, time), NaN from a collision on; where valid; who collided."""

    signals: Signals
    time: Array
    gap: Array
    closing: Array
    valid: NDArray[np.bool_]
    hit: NDArray[np.bool_]

    def result(self, values: Array) -> xr.DataArray:
        """As `Signals.result`, NaN where a pair has no valid sample."""
        there = self.valid.any(axis=-1) | self.hit
        return self.signals.result(np.where(there, values, np.nan))


def _pairs(dataset: xr.Dataset, measure: str, *more: str) -> _Pairs:
    signals = Signals(dataset, measure, "gap", "relative_speed", *more)
    time, gap, closing = signals.time, signals["gap"], -signals["relative_speed"]
    touched = np.logical_or.accumulate(gap <= 0, axis=-1)
    hit = touched.any(axis=-1)
    if "collision_time" in dataset:
        when = dataset["collision_time"].broadcast_like(signals.result(hit)).transpose(..., "vehicle")
        inside = (when.values >= time[0]) & (when.values <= time[-1])
        hit = hit | inside
        touched |= (inside[..., None]) & (time >= when.values[..., None])
    valid = np.isfinite(gap) & np.isfinite(closing) & ~touched
    nothing = ~valid
    return _Pairs(
        signals, time, np.where(nothing, np.nan, gap), np.where(nothing, np.nan, closing), valid, np.asarray(hit)
    )


def _needed(pair: _Pairs) -> Array:
    """DRAC while closing, and its negative mirror while opening, so that it is smooth."""
    return pair.closing * np.abs(pair.closing) / (2.0 * pair.gap)


def _least_ttc(pair: _Pairs) -> Array:
    most = extreme_of(pair.time, pair.closing / pair.gap, 1.0)
    with np.errstate(divide="ignore"):
        least = np.where(most * _NEVER > 1.0, 1.0 / most, np.where(np.isnan(most), np.nan, np.inf))
    return np.where(pair.hit, 0.0, least)


def _exposure(pair: _Pairs, threshold: float) -> tuple[Array, Array]:
    """Duration of TTC < threshold and the integral of what it lacks.

    TTC < TTC* where TTC* c - s > 0 for gap s and closing speed c. In every interval between samples s and c are linear,
    so that this part of it has ends u0 <= u1 in closed form; TTC = s/c is integrated there by Simpson's rule.
    """
    positive(pair.signals.measure, threshold=threshold)
    excess = threshold * pair.closing - pair.gap
    g0, g1 = excess[..., :-1], excess[..., 1:]
    with np.errstate(all="ignore"):
        crossing = g0 / (g0 - g1)
        u0 = np.where(g0 > 0, 0.0, crossing)
        u1 = np.where(g1 > 0, 1.0, crossing)
        inside = (g0 > 0) | (g1 > 0)
        inside &= np.isfinite(g0) & np.isfinite(g1)

        def lacking(u: Array) -> Array:
            s = (1.0 - u) * pair.gap[..., :-1] + u * pair.gap[..., 1:]
            c = (1.0 - u) * pair.closing[..., :-1] + u * pair.closing[..., 1:]
            return threshold - s / c

        mean = (lacking(u0) + 4.0 * lacking(0.5 * (u0 + u1)) + lacking(u1)) / 6.0
        width = np.where(inside, (u1 - u0) * np.diff(pair.time), 0.0)
        area = np.where(inside, mean * width, 0.0)
    return width.sum(axis=-1), area.sum(axis=-1)
