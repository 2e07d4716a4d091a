"""A simulated platoon against its recorded one."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from headway.checked import typed
from headway.data.recording import Floats, Recording
from headway.errors import HeadwayError

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["compare"]

_MEANINGS = {
    "rms_gap_error": ("m", "r.m.s. of simulated minus recorded gap"),
    "rms_speed_error": ("m/s", "r.m.s. of simulated minus recorded speed"),
    "max_gap_error": ("m", "largest magnitude of simulated minus recorded gap"),
    "max_speed_error": ("m/s", "largest magnitude of simulated minus recorded speed"),
    "nrmse_gap": ("1", "r.m.s. gap error over r.m.s. recorded gap"),
    "nrmse_speed": ("1", "r.m.s. speed error over r.m.s. recorded speed"),
    "samples": ("1", "recorded times in the common span"),
    "missing_gaps": ("1", "recorded gaps missing and left out"),
    "missing_speeds": ("1", "recorded speeds missing and left out"),
}


@typed
def compare(simulated: xr.Dataset, recording: Recording) -> xr.Dataset:
    """Errors of each follower, simulated minus recorded, over the time that both cover.

    Missing recorded samples are left out and counted. A follower whose simulated values end (a collision) has NaN
    errors: an error over the part before it would flatter. Times are compared as they are
    (`Recording.from_zero` moves them).

    Args:
        simulated: dataset with `speed` and `gap` along vehicle and time (vehicle 0 the leader); its values are
            interpolated linearly at the recorded times.
        recording: the recorded platoon, of as many vehicles.

    Returns:
        A dataset along `vehicle`; `nrmse_gap` = sqrt(mean e²)/sqrt(mean s_recorded²). The attribute
        `leader_rms_speed_error` [m/s] tells whether both have the same leader at the same times.

    Raises:
        HeadwayError: where variables are missing, the numbers of vehicles differ or there is no common time.

    Source: Punzo and Montanino, Transp. Res. B 91 (2016) 21-33, doi:10.1016/j.trb.2016.04.012.
    """
    import xarray as xr

    times, speed, gap = _simulated(simulated, recording)
    start, end = max(times[0], recording.time[0]), min(times[-1], recording.time[-1])
    inside = (recording.time >= start) & (recording.time <= end)
    if not inside.any():
        raise HeadwayError(
            f"compare: the simulation covers {times[0]:g} to {times[-1]:g} s and the recording {recording.time[0]:g} "
            f"to {recording.time[-1]:g} s, with no recorded time in common"
        )
    at = recording.time[inside]
    results: dict[str, list[float]] = {name: [] for name in _MEANINGS}
    for n in range(1, recording.vehicles):
        results["samples"].append(at.size)
        for name, rows, recorded in (("gap", gap, recording.gap), ("speed", speed, recording.speed)):
            rms, most, relative, missing = _errors(np.interp(at, times, rows[n]), recorded[n, inside])
            results[f"rms_{name}_error"].append(rms)
            results[f"max_{name}_error"].append(most)
            results[f"nrmse_{name}"].append(relative)
            results[f"missing_{name}s"].append(missing)
    leader = _errors(np.interp(at, times, speed[0]), recording.speed[0, inside])[0]
    return xr.Dataset(
        {
            name: ("vehicle", np.array(results[name]), {"units": unit, "long_name": text})
            for name, (unit, text) in _MEANINGS.items()
        },
        coords={
            "vehicle": np.arange(1, recording.vehicles),
            "name": ("vehicle", np.array(recording.names[1:], dtype=object)),
        },
        attrs={
            "source": recording.source,
            "start": float(at[0]),
            "end": float(at[-1]),
            "leader_rms_speed_error": leader,
        },
    )


def _simulated(simulated: xr.Dataset, recording: Recording) -> tuple[Floats, Floats, Floats]:
    """Times (T,), speeds and gaps (V, T) of the simulation, checked against the recording."""
    for name in ("time", "speed", "gap"):
        if name not in simulated.variables:
            raise HeadwayError(
                f"compare: the simulated dataset has no {name!r}; time, speed and gap along vehicle and time are needed"
            )
    speed, gap = (
        np.asarray(simulated[name].transpose("vehicle", "time"), dtype=np.float64) for name in ("speed", "gap")
    )
    if speed.shape[0] != recording.vehicles:
        raise HeadwayError(
            f"compare: the simulation has {speed.shape[0]} vehicles and {recording.source} has "
            f"{recording.vehicles}, the leader included; the numbers must be equal"
        )
    if recording.vehicles < 2:
        raise HeadwayError(f"compare: {recording.source} has no follower, so there is nothing to compare")
    return np.asarray(simulated["time"], dtype=np.float64), speed, gap


def _errors(simulated: Floats, recorded: Floats) -> tuple[float, float, float, int]:
    """r.m.s. and largest error, r.m.s. error over r.m.s. recorded, and the number of missing recorded values."""
    valid = np.isfinite(recorded)
    missing = int((~valid).sum())
    if not valid.any():
        return np.nan, np.nan, np.nan, missing
    error, scale = simulated[valid] - recorded[valid], float(np.sqrt(np.mean(recorded[valid] ** 2)))
    rms = float(np.sqrt(np.mean(error**2)))
    return rms, float(np.max(np.abs(error))), rms / scale if scale > 0 else np.nan, missing
