"""Measured answer of one vehicle to the one ahead, by frequency, with its confidence; and how deviations grow.

Source: Bendat and Piersol, Random Data, 4th ed., ch. 9 (errors of frequency responses); Welch, IEEE Trans. Audio
Electroacoust. 15 (1967) 70.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from headway.arrays import Array
from headway.calibration.behind import part_of
from headway.calibration.segments import Window
from headway.calibration.uncertainty import block_length
from headway.checked import typed
from headway.data.recording import Recording
from headway.errors import HeadwayError

__all__ = ["Growth", "Transfer", "measured_growth", "measured_transfer", "spectra"]


#: length [s] of the stretches that are averaged, at most a third of the record
_STRETCH = 60.0

#: squared correlation of neighbouring stretches under a Hann window that overlap by half (Welch)
_SHARED = 1.0 / 36.0

#: coherence below which a measured gain says little
COHERENT = 0.5


@dataclass(frozen=True)
class Transfer:
    """Measured transfer function of one vehicle: its speed over that of the one ahead, at K frequencies.

    Attributes:
        vehicle: number of the follower.
        frequency: (K,) [rad/s].
        gain: (K,) |H1| [1].
        low: (K,) lower end of its 95 % interval.
        high: (K,) upper end.
        coherence: (K,) 0 to 1.
        averages: how many independent stretches count.
    """

    vehicle: int
    frequency: Array
    gain: Array
    low: Array
    high: Array
    coherence: Array
    averages: float

    @property
    def coherent(self) -> NDArray[np.bool_]:
        """Where the coherence is high enough for the gain to say something."""
        return self.coherence >= COHERENT


@typed
def measured_transfer(
    recording: Recording, vehicle: int, window: Window | None = None, highest: float = 2.0
) -> Transfer:
    """The transfer function between a vehicle and the one ahead, from recorded speeds.

    Hann stretches of 60 s (at most a third of the record) that overlap by half.

    Args:
        recording: the recorded platoon.
        vehicle: number of the follower, from 1.
        window: (start, end) [s of the recording]; all of it if None.
        highest: highest frequency [rad/s] > 0.

    Raises:
        HeadwayError: for a vehicle that is not there, and for a missing speed.
    """
    from scipy import signal

    if not 1 <= vehicle < recording.vehicles:
        raise HeadwayError(
            f"{recording.source}: there is no follower {vehicle}; allowed are 1 to {recording.vehicles - 1}"
        )
    part = part_of(recording, window)
    ahead, own = part.speed[vehicle - 1], part.speed[vehicle]
    options = _stretches(part, (ahead, own))
    f, pxx = signal.welch(ahead, **options)
    _, pyy = signal.welch(own, **options)
    _, pxy = signal.csd(ahead, own, **options)
    gain, coherence = np.abs(pxy) / pxx, np.abs(pxy) ** 2 / (pxx * pyy)
    stretches = 2 * ahead.size // options["nperseg"] - 1
    averages = stretches / (1.0 + 2.0 * _SHARED * (stretches - 1) / stretches)
    error = np.sqrt((1.0 - coherence) / (np.maximum(coherence, 1e-12) * 2.0 * averages))
    band = (f > 0) & (2 * np.pi * f <= highest)
    return Transfer(
        vehicle, 2 * np.pi * f[band], gain[band], (gain * np.exp(-1.96 * error))[band],
        (gain * np.exp(1.96 * error))[band], coherence[band], averages,
    )  # fmt: skip


def _rows(speeds: Array) -> Array:
    """Speeds as an array (vehicles, times); refused where they have another shape."""
    rows = np.asarray(speeds, dtype=float)
    if rows.ndim != 2 or rows.shape[1] < 2:
        raise HeadwayError(f"speeds have shape {rows.shape}; (vehicles, times) with two times or more is needed")
    return rows


@typed
def spectra(speeds: Array, time: Array) -> tuple[Array, Array]:
    """Power spectra of speeds down a string.

    Args:
        speeds: (V, T) [m/s].
        time: (T,) [s], uniform.

    Returns:
        Frequencies (K,) [rad/s] and power spectra (V, K) [(m/s)²/(rad/s)].
    """
    from scipy import signal

    speeds = _rows(speeds)
    options = _options(time)
    f, power = signal.welch(speeds, axis=1, **options)
    return 2 * np.pi * f, power / (2 * np.pi)


def _stretches(part: Recording, rows: Sequence[Array]) -> dict[str, Any]:
    for row in rows:
        if not np.isfinite(row).all():
            bad = float(part.time[int(np.argmax(~np.isfinite(row)))])
            raise HeadwayError(f"{part.source}: a speed is missing at {bad:g} s; choose a window without holes")
    return _options(part.time)


def _options(time: Array) -> dict[str, Any]:
    step = float((time[-1] - time[0]) / (time.size - 1))
    size = int(min(round(_STRETCH / step), time.size // 3))
    return {"fs": 1.0 / step, "window": "hann", "nperseg": size, "noverlap": size // 2, "detrend": "linear"}


@dataclass(frozen=True)
class Growth:
    """How deviations of speed change down a string, vehicles 0 … V-1; ratios are NaN for the leader.

    Attributes:
        deviation: (V,) standard deviation of speed [m/s].
        range: (V,) largest less least speed [m/s].
        ratio: (V,) deviation over that of the vehicle ahead [1].
        ratio_low: (V,) lower end of its 95 % interval, by resampling blocks of time.
        ratio_high: (V,) upper end.
        grows: (V,) share of resamples in which the ratio exceeds 1.
    """

    deviation: Array
    range: Array
    ratio: Array
    ratio_low: Array
    ratio_high: Array
    grows: Array


@typed
def measured_growth(speeds: Array, resamples: int = 400, seed: int = 0) -> Growth:
    """How speed deviations grow down a string.

    Blocks are as long as the leader's speed is correlated, and the resampled times are common to all vehicles.

    Args:
        speeds: (V, T) [m/s] at uniform times, leader first; NaN samples are left out.
        resamples: how many resamples make the intervals.
        seed: of the resampling.
    """
    speeds = _rows(speeds)
    deviation = np.nanstd(speeds, axis=1)
    extent = np.nanmax(speeds, axis=1) - np.nanmin(speeds, axis=1)
    rows = speeds[:, np.isfinite(speeds).all(axis=0)]
    n = rows.shape[1]
    length = block_length(rows[-1])
    random = np.random.default_rng(seed)
    index = (random.integers(0, n, (resamples, -(-n // length), 1)) + np.arange(length)).reshape(resamples, -1)[
        :, :n
    ] % n
    drawn = np.array([rows[:, i].std(axis=1) for i in index])  # (resamples, V)
    none = np.full((resamples, 1), np.nan)
    ratios = np.concatenate((none, drawn[:, 1:] / drawn[:, :-1]), axis=1)
    low, high = np.quantile(ratios, (0.025, 0.975), axis=0)
    grows = np.where(np.isnan(ratios).any(axis=0), np.nan, (ratios > 1.0).mean(axis=0))
    ratio = np.concatenate(([np.nan], deviation[1:] / deviation[:-1]))
    return Growth(deviation, extent, ratio, low, high, grows)
