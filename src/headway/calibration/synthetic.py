"""Simulated runs as recordings with measurement noise: data whose parameters are set."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from headway.arrays import Array
from headway.checked import typed
from headway.data.recording import Recording
from headway.errors import HeadwayError

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["as_recorded"]


@typed
def as_recorded(
    run: xr.Dataset,
    gap_noise: float = 0.1,
    speed_noise: float = 0.05,
    correlation: float = 0.5,
    seed: int = 0,
    leader: bool = True,
) -> Recording:
    """The trajectories of a simulated run as if they had been measured.

    Positions are rebuilt from the noisy gaps.

    Args:
        run: dataset of `headway.simulate`, at uniform times.
        gap_noise: standard deviation of Gaussian noise on every gap [m] >= 0.
        speed_noise: standard deviation of Gaussian noise on every speed [m/s] >= 0.
        correlation: e-folding time of the noise [s] >= 0, that of a filter in the sensor; 0 makes it white.
        seed: of the noise.
        leader: whether the leader's speed has noise too.

    Raises:
        HeadwayError: for negative numbers and for a run with a collision.
    """
    for name, x in (("gap_noise", gap_noise), ("speed_noise", speed_noise), ("correlation", correlation)):
        if not (math.isfinite(x) and x >= 0):
            raise HeadwayError(f"{name} = {x!r} is not allowed; it is a finite number, 0 or more")
    for name in ("time", "speed", "gap"):
        if name not in run.variables:
            raise HeadwayError(f"as_recorded: the dataset has no {name!r}, as one of headway.simulate has")
    time, speed = run.time.values, run.speed.transpose("vehicle", "time").values
    gap = run.gap.transpose("vehicle", "time").values
    if not np.isfinite(gap[1:]).all():
        raise HeadwayError("as_recorded: the run has a collision, after which there is nothing to record")
    random = np.random.default_rng(seed)
    scale = np.full((speed.shape[0], 1), speed_noise)
    scale[0] *= leader
    step = float((time[-1] - time[0]) / (time.size - 1))
    keep = math.exp(-step / correlation) if correlation > 0 else 0.0
    return Recording.from_gaps(
        time, speed + scale * _noise(speed.shape, keep, random), gap + gap_noise * _noise(gap.shape, keep, random),
        source="simulated, with noise",
    )  # fmt: skip


def _noise(shape: tuple[int, ...], keep: float, random: np.random.Generator) -> Array:
    """Autoregressive noise of unit variance along the last axis; `keep` is its correlation from sample to sample."""
    from scipy.signal import lfilter

    white = random.standard_normal(shape)
    white[..., 1:] *= math.sqrt(1.0 - keep * keep)
    return lfilter([1.0], [1.0, -keep], white, axis=-1)
