"""Metrics of trajectories: functions of a dataset of a run, one file a subject."""

from __future__ import annotations

from headway.metrics.comfort import jerk, jerk_share, peak_jerk, rms_acceleration, rms_jerk
from headway.metrics.decay import l2_ratio, linf_ratio, logarithmic_decrement, overshoot, settling_time
from headway.metrics.energy import RoadLoad, combustion_energy, electric_energy, fuel, kamal
from headway.metrics.growth import (
    amplitude_growth,
    describing_function,
    fundamental,
    harmonic_distortion,
    phase_lag,
    time_lag,
)
from headway.metrics.registry import METRICS, Metric
from headway.metrics.safety import (
    collided,
    collisions,
    cpi,
    drac,
    least_gap,
    mdrac,
    picud,
    rss_margin,
    tet,
    time_to_collision,
    tit,
    ttc,
)
from headway.metrics.sizes import amplitude, amplitude_ratio, least, peak, rms, summary
from headway.metrics.spacing import least_time_gap, steady_error, throughput, time_gap

__all__ = [
    "METRICS", "Metric", "RoadLoad",
    "amplitude", "amplitude_growth", "amplitude_ratio", "collided", "collisions", "combustion_energy",
    "cpi", "describing_function", "drac", "electric_energy", "fuel", "fundamental", "harmonic_distortion", "jerk",
    "jerk_share", "kamal", "l2_ratio", "least", "least_gap", "least_time_gap", "linf_ratio", "logarithmic_decrement",
    "mdrac", "overshoot", "peak", "peak_jerk", "phase_lag", "picud", "rms", "rms_acceleration", "rms_jerk",
    "rss_margin", "settling_time", "steady_error", "summary", "tet", "throughput", "time_gap", "time_lag",
    "time_to_collision", "tit", "ttc",
]  # fmt: skip
