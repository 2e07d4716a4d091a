"""Checks of a recording: what to know before trusting it. They report and never mend."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from headway.checked import typed
from headway.data.recording import Floats, Recording
from headway.sampling import areas

__all__ = ["Finding", "check"]

STANDSTILL = 0.1  # m/s; measured speeds of parked cars stay below a few cm/s
MISMATCH = 0.5  # m/s r.m.s. between the gap's rate and the speed difference
DRIFT = 2.0  # m between the gap and the integrated speed difference


@dataclass(frozen=True)
class Finding:
    """One thing to know before trusting a recording.

    Attributes:
        kind: time-order, time-step, missing, gap, speed, gap-speed, position-speed, units or motion.
        vehicle: number of the vehicle, 0 is the leader; None concerns all.
        time: where it first shows [s], or None.
        message: the finding in a sentence.
        severity: `error` (the numbers cannot be right), `warning` (look before use) or `info`.
    """

    kind: str
    vehicle: int | None
    time: float | None
    message: str
    severity: str


@typed
def check(recording: Recording) -> tuple[Finding, ...]:
    """All findings on a recording: times, holes, signs, and whether gaps, speeds and positions tell one story.

    Every follower gets one `gap-speed` finding with the r.m.s. mismatch [m/s] of d gap/dt against v[n-1] - v[n] and
    the drift of the integrated difference [m] over the record.

    Args:
        recording: the recording, which is not changed.
    """
    order = _time_order(recording)
    if order:  # rates and integrals mean nothing over times that go back
        return (*order, *_missing(recording), *_signs(recording))
    parts = (_time_step, _missing, _signs, _gap_against_speed, _position_against_speed, _motion)
    return tuple(finding for part in parts for finding in part(recording))


def _time_order(recording: Recording) -> tuple[Finding, ...]:
    back = np.flatnonzero(np.diff(recording.time) <= 0)
    if not back.size:
        return ()
    first = float(recording.time[back[0] + 1])
    message = f"Time does not rise at {back.size} of {recording.time.size - 1} steps, first at {first:g} s."
    return (Finding("time-order", None, first, message, "error"),)


def _time_step(recording: Recording) -> Iterator[Finding]:
    step = np.diff(recording.time)
    usual = float(np.median(step))
    # Printed times are rounded; a hundredth of a step, or the rounding of float64 at large times, is no unevenness.
    uneven = np.abs(step - usual) > 0.01 * usual + 1e-12 * np.abs(recording.time[-1])
    if uneven.any():
        at = float(recording.time[int(np.argmax(uneven))])
        message = (
            f"The step is not uniform: {step.min():g} to {step.max():g} s, usually {usual:g} s, different at "
            f"{int(uneven.sum())} of {step.size} steps, first after {at:g} s; `resampled` makes it uniform."
        )
        yield Finding("time-step", None, at, message, "warning")


def _missing(recording: Recording) -> Iterator[Finding]:
    for n in range(recording.vehicles):
        for name, row in (("speed", recording.speed[n]), ("gap", recording.gap[n])):
            hole = np.isnan(row)
            if not hole.any() or (name == "gap" and n == 0):
                continue
            edges = np.flatnonzero(np.diff(np.concatenate(([0], hole.astype(int), [0]))))
            starts, ends = recording.time[edges[::2]], recording.time[edges[1::2] - 1]
            where = ", ".join(f"{a:g} to {b:g} s" for a, b in list(zip(starts, ends, strict=True))[:3])
            more = f" and {starts.size - 3} more" if starts.size > 3 else ""
            message = f"{_who(recording, n)} has {int(hole.sum())} of {hole.size} {name}s missing: {where}{more}."
            yield Finding("missing", n, float(starts[0]), message, "error" if hole.all() else "warning")


def _signs(recording: Recording) -> Iterator[Finding]:
    for n in range(recording.vehicles):
        for kind, row, wrong, what in (
            ("gap", recording.gap[n], recording.gap[n] <= 0, "a gap that is not positive"),
            ("speed", recording.speed[n], recording.speed[n] < 0, "a negative speed"),
        ):
            if wrong.any():
                at = float(recording.time[int(np.argmax(wrong))])
                message = (
                    f"{_who(recording, n)} has {what} in {int(wrong.sum())} samples, first at {at:g} s, least "
                    f"{np.nanmin(row):g} {'m' if kind == 'gap' else 'm/s'}."
                )
                yield Finding(kind, n, at, message, "error" if kind == "gap" else "warning")


def _gap_against_speed(recording: Recording) -> Iterator[Finding]:
    for n in range(1, recording.vehicles):
        relative = recording.speed[n - 1] - recording.speed[n]
        change, expected, good = _increments(recording.time, recording.gap[n], relative)
        if not good.any():
            continue
        rms, drift = _mismatch(recording.time, change, expected, good)
        worst = float(drift[int(np.argmax(np.abs(drift)))])
        at = float(recording.time[1:][good][int(np.argmax(np.abs(drift)))])
        bad = rms > MISMATCH or abs(worst) > DRIFT
        message = (
            f"{_who(recording, n)}: the gap's rate differs from the speed difference by {rms:.3g} m/s r.m.s.; the gap "
            f"less the integrated speed difference drifts to {drift[-1]:.3g} m at the end, at most {worst:.3g} m."
        )
        yield Finding("gap-speed", n, at if bad else None, message, "warning" if bad else "info")
        yield from _units(recording, n, change[good], expected[good])


def _units(recording: Recording, n: int, change: Floats, expected: Floats) -> Iterator[Finding]:
    """A finding where a gap changes in step with the speeds, but at another scale, as in another unit."""
    power = float(expected @ expected)
    size = float(change @ change)
    if power < 1e-12 or size < 1e-12:
        return
    slope = float(change @ expected) / power
    correlation = float(change @ expected) / np.sqrt(power * size)
    if correlation > 0.7 and not 0.6 < slope < 1.6:
        message = (
            f"{_who(recording, n)}: the gap changes {slope:.3g} times as fast as the speeds say, as if a unit were "
            "confused (0.278: km/h read as m/s; 3.28: gaps in feet read as metres)."
        )
        yield Finding("units", n, None, message, "error")


def _position_against_speed(recording: Recording) -> Iterator[Finding]:
    for n in range(recording.vehicles):
        change, expected, good = _increments(recording.time, recording.position[n], recording.speed[n])
        if not good.any():
            continue
        rms, drift = _mismatch(recording.time, change, expected, good)
        worst = int(np.argmax(np.abs(drift)))
        if rms > MISMATCH or abs(drift[worst]) > DRIFT:
            message = (
                f"{_who(recording, n)}: the position's rate differs from the speed by {rms:.3g} m/s r.m.s., and the "
                f"position less the integrated speed drifts by up to {drift[worst]:.3g} m."
            )
            at = float(recording.time[1:][good][worst])
            yield Finding("position-speed", n, at, message, "warning")


def _motion(recording: Recording) -> Iterator[Finding]:
    for n in range(recording.vehicles):
        speed = recording.speed[n]
        still = speed < STANDSTILL
        if not still.any():
            continue
        if np.nanmax(speed) < STANDSTILL:
            yield Finding("motion", n, None, f"{_who(recording, n)} never moves.", "warning")
            continue
        seconds = float(np.diff(recording.time)[still[1:] & still[:-1]].sum())
        at = float(recording.time[int(np.argmax(still))])
        message = f"{_who(recording, n)} stands still (below {STANDSTILL:g} m/s) for {seconds:g} s, first at {at:g} s."
        yield Finding("motion", n, at, message, "info")


def _increments(time: Floats, value: Floats, rate: Floats) -> tuple[Floats, Floats, NDArray[np.bool_]]:
    """Change of `value` over each step, the trapezoid of `rate`, and where both are finite."""
    change = np.diff(value)
    expected = areas(time, rate)
    return change, expected, np.isfinite(change) & np.isfinite(expected)


def _mismatch(time: Floats, change: Floats, expected: Floats, good: NDArray[np.bool_]) -> tuple[float, Floats]:
    """r.m.s. difference of the rates, and the difference accumulated over the steps where both are finite."""
    off = (change - expected)[good]
    return float(np.sqrt(np.mean((off / np.diff(time)[good]) ** 2))), np.cumsum(off)


def _who(recording: Recording, n: int) -> str:
    name = recording.names[n]
    label = f"Vehicle {n}" if name == f"vehicle {n}" else f"Vehicle {n} ({name})"
    return label + (", the leader," if n == 0 else "")
