"""A leader that drives a recorded speed."""

from __future__ import annotations

import functools
import hashlib
import os
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import BeforeValidator

from headway.checked import as_path
from headway.errors import HeadwayError
from headway.scenario.leaders import Disturbance, section
from headway.scenario.motion import Motion
from headway.scenario.validation import NonNegative, Numbers, Positive, spec, unit

__all__ = ["Recorded"]


def _pairs(value: Any) -> Any:
    if not isinstance(value, dict):
        return value
    if not all(isinstance(text, str) for pair in value.items() for text in pair):
        raise ValueError('is not a table of texts, e.g. {speed = "v"}')
    return tuple(sorted(value.items()))


Pairs = Annotated[tuple[tuple[str, str], ...], BeforeValidator(_pairs)]


@spec
class Recorded(Disturbance):
    """Recorded speed, from a file that `headway.data.read` understands or from `time` and `speed` given here.

    Between the samples the speed is a monotone cubic (`interpolation = "smooth"`) or linear.
    """

    file: Annotated[str | None, unit("", "file of trajectories; a relative path starts at the scenario's folder")] = (
        None
    )
    vehicle: Annotated[int, unit("", "which vehicle of the file, 0 is its leader", usual=[0, 0, 100])] = 0
    start: Annotated[
        NonNegative, unit("s", "start of the section, from the beginning of the record", usual=[0.0, 0.0, 1800.0])
    ] = 0.0
    end: Annotated[
        Positive | None, unit("s", "end of the section; the end of the record if not given", usual=[None, 1.0, 1800.0])
    ] = None
    interpolation: Literal["smooth", "linear"] = "smooth"
    format: Annotated[str | None, unit("", "file format; found by looking if not given")] = None
    columns: Annotated[Pairs, unit("", "our name = the file's name of a column")] = ()
    units: Annotated[Pairs, unit("", "column = its unit in the file")] = ()
    time: Annotated[Numbers, unit("s", "times of the samples, instead of a file")] = ()
    speed: Annotated[Numbers, unit("m/s", "speeds of the samples, instead of a file")] = ()
    kind: ClassVar[str] = "recorded"

    def __post_init__(self) -> None:
        if (self.file is None) == (not self.time and not self.speed):
            raise HeadwayError("recorded needs either a file, or time and speed")
        if self.vehicle < 0:
            raise HeadwayError(f"recorded.vehicle = {self.vehicle} is negative; 0 is the leader of the record")
        if self.file is None:
            if len(self.time) != len(self.speed) or len(self.time) < 2:
                raise HeadwayError(
                    f"recorded has {len(self.time)} times and {len(self.speed)} speeds; "
                    "allowed are two or more, equally many"
                )
            step = np.diff(self.time)
            if step.min() <= 0:
                bad = int(np.argmin(step)) + 1
                raise HeadwayError(f"recorded.time[{bad}] = {self.time[bad]:g} s does not rise")
        self._samples()

    @property
    def span(self) -> float:
        """Length [s], after which it ends."""
        time, _ = self._samples()
        return float(time[-1] if self.end is None else self.end) - self.start

    @property
    def digest(self) -> str:
        """SHA-256 of the samples, so that a scenario's hash changes with the file's content."""
        time, speed = self._samples()
        return hashlib.sha256(np.stack((time, speed)).tobytes()).hexdigest()

    def motion(self, seed: int, duration: float) -> Motion:
        """Exact motion for at least `duration` [s], see `Disturbance.motion`."""
        time, speed = self._samples()
        return section(time, speed, self.start, self.start + self.span, self.interpolation)

    def _samples(self) -> tuple[np.ndarray, np.ndarray]:
        """Times from 0 and speeds, without holes in the section asked for."""
        if self.file is None:
            time, speed = np.array(self.time), np.array(self.speed)
        else:
            time, speed = _from_file(self.file, self.vehicle, self.format, self.columns, self.units, _stamp(self.file))
        time = time - time[0]
        end = time[-1] if self.end is None else self.end
        if not self.start < end <= time[-1]:
            raise HeadwayError(
                f"recorded: the section from {self.start:g} to {end:g} s is not within 0 to {time[-1]:g} s"
            )
        section_speed = speed[(time >= self.start) & (time <= end)]
        if not np.all(np.isfinite(section_speed)):
            missing = int(np.sum(~np.isfinite(section_speed)))
            raise HeadwayError(f"recorded: {missing} speeds are missing in the section; choose another start and end")
        return time, speed


def _stamp(file: str) -> float:
    path = as_path(file, "recorded.file")
    return path.stat().st_mtime if os.path.exists(path) else 0.0


@functools.lru_cache(maxsize=16)
def _from_file(
    file: str, vehicle: int, form: str | None, columns: Pairs, units: Pairs, stamp: float
) -> tuple[np.ndarray, np.ndarray]:
    from headway.data.readers import read

    recording = read(Path(file), format=form, columns=dict(columns) or None, units=dict(units) or None)
    count = recording.speed.shape[0]
    if vehicle >= count:
        raise HeadwayError(f"recorded.vehicle = {vehicle} but {file} has vehicles 0 to {count - 1}")
    return np.array(recording.time), np.array(recording.speed[vehicle])
