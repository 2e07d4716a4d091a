"""A recording: the speeds and gaps of a real platoon, as they were measured.

A recording is never mended. What is missing is NaN, and what had to be done to read it is said in `notes`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from headway.errors import HeadwayError, shorten
from headway.sampling import areas
from headway.schema import describe

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["DEFAULT_LENGTH", "Recording", "start_of"]

Floats = NDArray[np.float64]

DEFAULT_LENGTH = 5.0
"""Vehicle length [m] where the source gives none. It shifts rebuilt positions and never a gap."""

_MOST_SAMPLES = 50_000_000  # a mistyped step must end in a sentence, not in a full memory


@dataclass(frozen=True, eq=False)
class Recording:
    """Trajectories of V vehicles at T times; row 0 is the leader. Arrays are read-only.

    Attributes:
        time: (T,) [s].
        speed: (V, T) [m/s].
        gap: (V, T) [m], bumper to bumper to the vehicle ahead, on the follower's row; row 0 is NaN.
        position: (V, T) [m], front bumpers.
        names: one for each vehicle.
        lengths: length of each vehicle [m] > 0.
        source: where it was read from.
        notes: sentences on what was assumed or done.

    Raises:
        HeadwayError: where shapes disagree, or there are fewer than two finite times.
    """

    time: Floats
    speed: Floats
    gap: Floats
    position: Floats
    names: tuple[str, ...]
    lengths: tuple[float, ...]
    source: str
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for field in ("time", "speed", "gap", "position"):
            try:
                array = np.array(getattr(self, field), dtype=np.float64)
            except (TypeError, ValueError, OverflowError):
                raise HeadwayError(f"{shorten(self.source)}: {field} is not an array of numbers") from None
            array.flags.writeable = False
            object.__setattr__(self, field, array)
        if not isinstance(self.names, list | tuple) or not isinstance(self.lengths, list | tuple):
            raise HeadwayError(f"{shorten(self.source)}: names and lengths are lists, one entry for each vehicle")
        samples = self.time.shape[0] if self.time.ndim == 1 else 0
        if samples < 2 or not np.isfinite(self.time).all():
            raise HeadwayError(f"{self.source}: a recording needs at least two finite times, and has {samples}")
        shape = (len(self.names), samples)
        for field in ("speed", "gap", "position"):
            if getattr(self, field).shape != shape:
                actual = getattr(self, field).shape
                raise HeadwayError(f"{self.source}: {field} has shape {actual}; (vehicles, times) = {shape} is needed")
        if len(self.lengths) != shape[0]:
            raise HeadwayError(f"{self.source}: {len(self.lengths)} lengths are given for {shape[0]} vehicles")

    @classmethod
    def from_gaps(
        cls,
        time: Floats,
        speed: Floats,
        gap: Floats,
        *,
        leader_position: Floats | None = None,
        names: Sequence[str] | None = None,
        lengths: float | Sequence[float] = DEFAULT_LENGTH,
        source: str = "recording",
        notes: Sequence[str] = (),
    ) -> Recording:
        """The recording whose positions are rebuilt from gaps.

        Followers: x[n] = x[n-1] - length[n-1] - gap[n]. Two measured speeds are never integrated against one another:
        they drift from the measured gap by many metres. A NaN gap leaves that vehicle and all behind it without a
        position at that time; a NaN leader speed, from then on.

        Args:
            time: (T,) [s].
            speed: (V, T) [m/s].
            gap: (V, T) [m]; row 0 is NaN.
            leader_position: (T,) [m]; the leader's speed integrated by the trapezoidal rule from 0 if None.
            names: one for each vehicle; `vehicle 0`, `vehicle 1`, … if None.
            lengths: length of vehicles [m] > 0, one for all or one each.
            source: where it comes from, for messages.
            notes: sentences on what was assumed or done.

        Raises:
            HeadwayError: where shapes disagree, or a length is not positive.
        """
        speed = np.asarray(speed, dtype=np.float64)
        vehicles = speed.shape[0]
        sizes = vehicle_lengths(lengths, vehicles, source)
        position = np.full_like(speed, np.nan)
        position[0] = _integral(time, speed[0]) if leader_position is None else leader_position
        for n in range(1, vehicles):
            position[n] = position[n - 1] - sizes[n - 1] - gap[n]
        labels = tuple(names) if names is not None else tuple(f"vehicle {n}" for n in range(vehicles))
        return cls(time, speed, gap, position, labels, sizes, source, tuple(notes))

    @property
    def vehicles(self) -> int:
        """Number of vehicles, the leader included."""
        return len(self.names)

    @property
    def duration(self) -> float:
        """Seconds from the first to the last sample."""
        return float(self.time[-1] - self.time[0])

    def between(self, start: float, end: float) -> Recording:
        """The samples with start <= time <= end.

        Args:
            start: first time [s, as in `time`].
            end: last time [s], later than `start`.

        Raises:
            HeadwayError: where fewer than two samples remain.
        """
        inside = (self.time >= start) & (self.time <= end)
        if not start < end or inside.sum() < 2:
            raise HeadwayError(
                f"{self.source}: between({start:g}, {end:g}) holds {int(inside.sum())} samples and at least two are "
                f"needed; the recording runs from {self.time[0]:g} to {self.time[-1]:g} s"
            )
        cut: dict[str, Any] = {
            field: getattr(self, field)[..., inside] for field in ("time", "speed", "gap", "position")
        }
        return replace(self, **cut, notes=(*self.notes, f"Cut to {start:g} to {end:g} s."))

    def from_zero(self) -> Recording:
        """The recording moved so that its first sample is at time 0, as simulations start."""
        start = float(self.time[0])
        if start == 0.0:
            return self
        return replace(self, time=self.time - start, notes=(*self.notes, f"Times moved by {-start:g} s to start at 0."))

    def resampled(self, step: float) -> Recording:
        """The recording at uniform steps from its first time on, by linear interpolation (said in `notes`).

        A NaN sample leaves NaN in both intervals that touch it.

        Args:
            step: the step [s] > 0.

        Raises:
            HeadwayError: for a step that is not positive, is longer than the recording or makes more than fifty million
                samples, and where times do not rise.
        """
        if not (math.isfinite(step) and 0.0 < step <= self.duration and self.duration / step < _MOST_SAMPLES):
            raise HeadwayError(
                f"{self.source}: step {step!r} s is not allowed; a positive one up to the recording's length of "
                f"{self.duration:g} s is needed, with at most {_MOST_SAMPLES} samples"
            )
        if not (np.diff(self.time) > 0).all():
            raise HeadwayError(f"{self.source}: times must rise for the recording to be resampled")
        grid = self.time[0] + step * np.arange(math.floor(self.duration / step + 1e-9) + 1)
        grid = _snapped(grid, self.time, 1e-9 * step)
        # Interpolation is linear and so is x[n] = x[n-1] - length - gap: positions still agree with gaps.
        fields: dict[str, Any] = {
            field: np.array([np.interp(grid, self.time, row) for row in getattr(self, field)])
            for field in ("speed", "gap", "position")
        }
        note = f"Resampled to a step of {step:g} s by linear interpolation; its median step was {self._step():g} s."
        return replace(self, time=grid, **fields, notes=(*self.notes, note))

    def to_dataset(self) -> xr.Dataset:
        """An xarray.Dataset with dims (vehicle, time): position, speed, acceleration, gap, relative_speed.

        relative_speed = v[n-1] - v[n] (positive: the gap opens), NaN for the leader. Acceleration is the central
        difference of measured speeds (one-sided at the two ends) and is labelled so.
        """
        import xarray as xr

        relative = np.full_like(self.speed, np.nan)
        relative[1:] = self.speed[:-1] - self.speed[1:]
        values = {
            "position": self.position,
            "speed": self.speed,
            "acceleration": np.gradient(self.speed, self.time, axis=1),
            "gap": self.gap,
            "relative_speed": relative,
        }
        dataset = xr.Dataset(
            {name: (("vehicle", "time"), array) for name, array in values.items()},
            coords={
                "vehicle": np.arange(self.vehicles),
                "time": self.time,
                "name": ("vehicle", list(self.names)),
                "length": ("vehicle", list(self.lengths), {"units": "m", "long_name": "vehicle length"}),
            },
            attrs={"source": self.source, "notes": "\n".join(self.notes), "kind": "recording"},
        )
        describe(dataset)
        dataset["acceleration"].attrs.update(
            long_name="acceleration, central differences of speed",
            comment="computed from measured speeds, not measured",
        )
        return dataset

    def _step(self) -> float:
        return float(np.median(np.diff(self.time)))

    def __repr__(self) -> str:
        return f"Recording({self.vehicles} vehicles, {self.time.size} samples, {self.duration:g} s, {self.source!r})"


def vehicle_lengths(lengths: float | Sequence[float], vehicles: int, source: str) -> tuple[float, ...]:
    """One finite positive length [m] for each vehicle.

    Args:
        lengths: one length [m] for all, or one each.
        vehicles: number of vehicles.
        source: where it comes from, for messages.

    Raises:
        HeadwayError: for another count, and for lengths that are not finite positive numbers.
    """
    try:
        sizes = np.atleast_1d(np.asarray(lengths, dtype=np.float64))
    except (TypeError, ValueError):
        raise HeadwayError(f"{source}: length {shorten(lengths)} is not a number of metres") from None
    if sizes.ndim == 1 and sizes.size == 1:
        sizes = np.repeat(sizes, vehicles)
    if sizes.shape != (vehicles,) or not (np.isfinite(sizes) & (sizes > 0)).all():
        raise HeadwayError(
            f"{source}: length {shorten(lengths)} is not allowed; one positive number of metres, or one for each of "
            f"the {vehicles} vehicles, is needed"
        )
    return tuple(float(size) for size in sizes)


def start_of(gap: Floats, speed: Floats) -> Floats:
    """Initial gap and speed of records: their first samples that are not missing.

    Args:
        gap: (…, n) [m].
        speed: (…, n) [m/s].

    Returns:
        (2, …).
    """
    both = np.stack((gap, speed))
    first = np.argmax(np.isfinite(both), axis=-1)[..., None]
    start: Floats = np.take_along_axis(both, first, axis=-1)[..., 0]
    return start


def _integral(time: Floats, speed: Floats) -> Floats:
    """Trapezoidal integral of speed from 0 at the first time; NaN from the first NaN on."""
    return np.concatenate(([0.0 * speed[0]], np.cumsum(areas(time, speed))))


def _snapped(grid: Floats, time: Floats, tolerance: float) -> Floats:
    """The points of `grid`, those within `tolerance` of a recorded time moved onto it.

    Without it a sample beside a NaN would be lost because 3 * 0.1 is not 0.3.
    """
    after = np.clip(np.searchsorted(time, grid), 1, time.size - 1)
    nearest = np.where(grid - time[after - 1] < time[after] - grid, time[after - 1], time[after])
    return np.where(np.abs(nearest - grid) <= tolerance, nearest, grid)
