"""How sure a fit is: a block bootstrap of its residuals, and the profile of each quantity."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from headway.arrays import Array
from headway.calibration.loop import Loop
from headway.calibration.polish import Problems, polish
from headway.data.recording import start_of

__all__ = ["Profile", "block_length", "bootstrap", "effective_samples", "profiles", "resampled"]


#: points of a profile, and the χ² with one degree of freedom that 95 % of draws stay below
_POINTS, _CHI2 = 15, 3.841

#: distance from a bound, in the unit cube, that counts as at it
_AT_BOUND = 2e-3


@dataclass(frozen=True)
class Profile:
    """The least objective with one quantity held, the others fitted anew.

    Attributes:
        name: the quantity that is held.
        values: its values, SI.
        objective: the least objective [1] at each.
        limit: the objective that 95 % confidence allows.
        words: what the profile says of the quantity.
    """

    name: str
    values: Array
    objective: Array
    limit: float
    words: str

    @property
    def identified(self) -> bool:
        """Whether the record bounds the quantity on both sides."""
        return self.words == "identified"


def block_length(residual: Array) -> int:
    """Samples a block of the circular block bootstrap should have, from the autocorrelation of `residual` (n,).

    At least 1, at most a sixth of n. Source: Politis and White, Econometric Reviews 23 (2004) 53, with the correction
    of Patton, Politis and White, 28 (2009) 372.
    """
    n = residual.size
    rho, variance = _autocorrelation(residual)
    quiet = max(5, math.ceil(math.sqrt(math.log10(n))))
    small = np.abs(rho[1:]) < 2.0 * math.sqrt(math.log10(n) / n)
    runs = np.flatnonzero(np.convolve(small, np.ones(quiet), "valid") == quiet)
    m = int(runs[0]) if runs.size else n // 12
    lags = np.arange(-2 * m, 2 * m + 1)
    flat_top = np.clip(2.0 * (1.0 - np.abs(lags) / max(2 * m, 1)), 0.0, 1.0)
    covariance = variance * rho[np.minimum(np.abs(lags), rho.size - 1)]
    g, spectrum = float(np.sum(flat_top * np.abs(lags) * covariance)), float(np.sum(flat_top * covariance))
    if spectrum <= 0:
        return max(1, n // 6)
    best = (1.5 * (g / spectrum) ** 2) ** (1 / 3) * n ** (1 / 3)
    return int(np.clip(math.ceil(best), 1, max(1, n // 6)))


def effective_samples(residual: Array) -> float:
    """How many independent samples tell as much as `residual` (n,): n over its integrated autocorrelation.

    Summed up to the first pair that is not positive (Geyer, Stat. Sci. 7, 1992, 473).
    """
    rho, _ = _autocorrelation(residual)
    pairs = rho[1 : 1 + (rho.size - 1) // 2 * 2].reshape(-1, 2).sum(axis=1)
    end = np.flatnonzero(pairs <= 0)
    return residual.size / (1.0 + 2.0 * max(float(pairs[: end[0] if end.size else None].sum()), 0.0))


def _autocorrelation(residual: Array) -> tuple[Array, float]:
    """Autocorrelation at lags 0 … n/3, and the variance."""
    x = residual - residual.mean()
    power = np.abs(np.fft.rfft(x, 2 * x.size)) ** 2
    covariance = np.fft.irfft(power)[: max(x.size // 3, 2)] / x.size
    return (covariance / covariance[0] if covariance[0] > 0 else np.zeros_like(covariance)), float(covariance[0])


def resampled(residual: Array, length: int, count: int, random: np.random.Generator) -> Array:
    """Circular blocks of a residual, centred, put side by side at random.

    Args:
        residual: (2, n) errors of gap and speed; NaN counts as none.
        length: samples of a block.
        count: how many resamples.
        random: the stream they are drawn from.

    Returns:
        (2, n, count).
    """
    n = residual.shape[1]
    centred = np.nan_to_num(residual - np.nanmean(residual, axis=1, keepdims=True))
    starts = random.integers(0, n, (math.ceil(n / length), count))
    index = (starts[:, None, :] + np.arange(length)[None, :, None]).reshape(-1, count)[:n] % n
    return centred[:, index]


def bootstrap(loop: Loop, best: Array, count: int, seed: int) -> tuple[Array, float]:
    """Refits to the best trajectory with resampled residuals.

    The initial state is taken from each resampled record as it was from the real one, so its uncertainty is included.

    Args:
        loop: the closed loop of candidates behind the recording.
        best: (p,) the best candidate, in the unit cube.
        count: how many refits.
        seed: of the resampling.

    Returns:
        Refits (p, count) in the unit cube, and the length of the blocks [s].
    """
    path = loop.paths(best[:, None])[0][:, :, 0]
    residual = np.where(loop.valid, loop.observed - path, np.nan)
    length = block_length(residual[0, loop.valid[0]])
    records = path[:, :, None] + resampled(residual, length, count, np.random.default_rng(seed))
    records = np.where(loop.valid[:, :, None], records, np.nan)
    starts = []
    for part in loop.parts_of:
        rows = np.moveaxis(records[:, part], 2, 1)
        starts.append(start_of(rows[0], rows[1]))
    at = np.repeat(best[:, None], count, axis=1)
    # a quantity that sits at a bound could not leave it by a slope of nought
    at = np.clip(at, 1e-6, 1.0 - 1e-6)
    refits, _ = polish(loop, Problems(at, np.ones(at.shape, bool), records, starts), 8)
    return refits, length * loop.segments[0].step


def profiles(loop: Loop, best: Array, value: float, refits: Array) -> tuple[Profile, ...]:
    """The profile of each quantity over its bounds, denser where the refits lie.

    Args:
        loop: the closed loop of candidates behind the recording.
        best: (p,) the best candidate, in the unit cube.
        value: its objective [1].
        refits: (p, R) refits of the bootstrap, in the unit cube.
    """
    p = best.size
    path = loop.paths(best[:, None])[0][:, :, 0]
    residual = (loop.observed - path)[0, loop.valid[0]]
    limit = value * math.sqrt(1.0 + _CHI2 / max(effective_samples(residual), 4.0))
    grids = np.array([_grid(float(best[i]), float(refits[i].std())) for i in range(p)])
    at = np.repeat(best[:, None], p * _POINTS, axis=1)
    free = np.ones(at.shape, bool)
    for i in range(p):
        own = slice(i * _POINTS, (i + 1) * _POINTS)
        at[i, own], free[i, own] = grids[i], False
    observed = loop.observed[:, :, None]
    points, values = polish(loop, Problems(at, free, observed), 8)
    # once more from the neighbour's answer on the side of the best, where that is nearer
    again = points.copy()
    for i in range(p):
        own = slice(i * _POINTS, (i + 1) * _POINTS)
        inner = np.arange(_POINTS)
        inner += np.sign(int(np.argmin(np.abs(grids[i] - best[i]))) - inner)
        again[:, own] = points[:, own][:, inner]
        again[i, own] = grids[i]
    _, values2 = polish(loop, Problems(again, free, observed), 8)
    values = np.minimum(values, values2)
    scale = loop.space.values(at)[np.repeat(np.arange(p), _POINTS), np.arange(p * _POINTS)].reshape(p, _POINTS)
    result = []
    for i, name in enumerate(loop.space.names):
        curve = values[i * _POINTS : (i + 1) * _POINTS]
        result.append(Profile(name, scale[i], curve, limit, _words(float(best[i]), scale[i], curve, limit)))
    return tuple(result)


def _grid(best: float, spread: float) -> Array:
    """Points from bound to bound, the middle ones about the best."""
    near = best + min(max(spread, 2e-3), 0.15) * np.array([-4.0, -2.0, -1.0, 0.0, 1.0, 2.0, 4.0])
    wide = np.linspace(0.0, 1.0, _POINTS - near.size)
    return np.sort(np.clip(np.concatenate((near, wide)), 0.0, 1.0))


def _words(best: float, values: Array, curve: Array, limit: float) -> str:
    """What a profile says of its quantity, in words."""
    good = curve <= limit
    low, high = bool(good[0]), bool(good[-1])
    if low and high:
        return "flat: any value in bounds fits as well"
    if low or high:
        edge = _edge(values, curve, limit, low)
        at = "at its bound; " if (best < _AT_BOUND if low else best > 1 - _AT_BOUND) else ""
        side = "below" if low else "above"
        return f"{at}open {'down' if low else 'up'}wards: any value {side} about {edge:.3g} fits as well"
    return "identified"


def _edge(values: Array, curve: Array, limit: float, low: bool) -> float:
    """Where the profile that starts below the limit at one bound first rises above it."""
    x, y = (values, curve) if low else (values[::-1], curve[::-1])
    i = int(np.argmax(y > limit))
    return float(np.interp(limit, [y[i - 1], y[i]], [x[i - 1], x[i]]))
