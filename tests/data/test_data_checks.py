"""Checks report what is wrong with a recording and change nothing."""

from __future__ import annotations

import numpy as np
import pytest
from conftest import shared_file

from headway.data import Recording, check, read


def platoon(**changes) -> Recording:
    """A leader with a wave of 1 m/s and a follower with half of it, the gap integrating the difference exactly."""
    time = changes.get("time", np.arange(0.0, 60.0, 0.1))
    wave = np.sin(0.5 * time)
    speed = np.array([15 + wave, 15 + wave / 2])
    closing = (speed[0] - speed[1])[1:] + (speed[0] - speed[1])[:-1]
    gap = np.array([np.full_like(time, np.nan), 20 + np.concatenate(([0], np.cumsum(np.diff(time) * closing / 2)))])
    return Recording.from_gaps(time, changes.get("speed", speed), changes.get("gap", gap))


def kinds(recording: Recording, severity: str | None = None) -> list[tuple[str, int | None]]:
    return [(f.kind, f.vehicle) for f in check(recording) if severity in (None, f.severity)]


def test_a_sound_recording_has_only_its_figures():
    (finding,) = check(platoon())
    assert (finding.kind, finding.vehicle, finding.severity) == ("gap-speed", 1, "info")
    assert "m/s r.m.s." in finding.message
    assert finding.message.endswith(".")


def test_time_that_goes_back_or_repeats():
    time = np.arange(0.0, 60.0, 0.1)
    time[7] = time[6]
    (finding,) = check(platoon(time=time))
    assert (finding.kind, finding.severity, finding.time) == ("time-order", "error", pytest.approx(0.6))


def test_uneven_step():
    time = np.arange(0.0, 60.0, 0.1)
    time[100:] += 3.0
    (finding,) = [f for f in check(platoon(time=time)) if f.kind == "time-step"]
    assert finding.time == pytest.approx(9.9)
    assert "0.1 to 3.1 s" in finding.message
    assert ("time-step", None) not in kinds(platoon(time=np.round(np.arange(600) / 30, 4)))


def test_holes_are_counted_and_placed():
    recording = platoon()
    gap = recording.gap.copy()
    gap[1, [5, 6, 50]] = np.nan
    (finding,) = [f for f in check(platoon(gap=gap)) if f.kind == "missing"]
    assert "3 of 600 gaps missing: 0.5 to 0.6 s, 5 to 5 s" in finding.message
    assert finding.severity == "warning"


def test_a_vehicle_without_any_gap_is_an_error():
    assert ("missing", 1) in kinds(platoon(gap=np.full((2, 600), np.nan)), "error")


def test_gaps_and_speeds_of_the_wrong_sign():
    recording = platoon()
    gap, speed = recording.gap.copy(), recording.speed.copy()
    gap[1, 30], speed[0, 40] = -0.5, -1.0
    found = {f.kind: f for f in check(platoon(gap=gap, speed=speed))}
    assert found["gap"].severity == "error"
    assert found["gap"].time == pytest.approx(3.0)
    assert "-0.5 m" in found["gap"].message
    assert found["speed"].time == pytest.approx(4.0)


def test_drift_of_the_speeds_is_measured_not_mended():
    recording = platoon()
    speed = recording.speed.copy()
    speed[1] += 0.1  # a biased speed sensor: 6 m in 60 s
    biased = platoon(speed=speed, gap=recording.gap)
    (finding,) = [f for f in check(biased) if f.kind == "gap-speed"]
    assert finding.severity == "warning"
    assert "drifts to 5.99 m" in finding.message
    np.testing.assert_array_equal(biased.gap, recording.gap)
    assert ("position-speed", 1) in kinds(biased, "warning")


@pytest.mark.parametrize(("scale", "says"), [(3.6, "0.278 times"), (0.3048, "3.28 times")])
def test_confused_units_show_in_the_rates(scale, says):
    recording = platoon()
    (finding,) = [f for f in check(platoon(speed=recording.speed * scale)) if f.kind == "units"]
    assert says in finding.message
    assert finding.severity == "error"


def test_position_that_disagrees_with_speed():
    recording = platoon()
    moved = Recording(**{**vars(recording), "position": recording.position * 1.1})
    assert ("position-speed", 0) in kinds(moved, "warning")


def test_standstill_and_no_motion():
    speed = platoon().speed.copy()
    speed[0, 100:200] = 0.0
    speed[1] = 0.0
    found = {f.vehicle: f for f in check(platoon(speed=speed)) if f.kind == "motion"}
    assert "stands still (below 0.1 m/s) for 9.9 s, first at 10 s" in found[0].message
    assert "never moves" in found[1].message
    assert found[1].severity == "warning"


def test_a_single_vehicle():
    time = np.arange(10.0)
    assert check(Recording.from_gaps(time, np.full((1, 10), 9.0), np.full((1, 10), np.nan))) == ()


def test_the_astazero_speeds_drift_by_sixteen_metres():
    path = shared_file("raw/astazero_data_example.csv")
    finding = next(f for f in check(read(path)) if f.kind == "gap-speed" and f.vehicle == 4)
    assert "drifts to 16 m at the end" in finding.message
    assert not [f for f in check(read(path)) if f.severity == "error"]
