"""A simulated platoon against a recorded one."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

from headway.data import Recording, compare
from headway.errors import HeadwayError


def recorded(start: float = 0.0) -> Recording:
    time = start + np.arange(0.0, 10.0, 0.5)
    speed = np.array([np.full(20, 20.0), np.full(20, 19.0), np.full(20, 18.0)])
    gap = np.array([np.full(20, np.nan), 30 + 0.1 * time, np.full(20, 25.0)])
    return Recording.from_gaps(time, speed, gap, source="mine.csv")


def simulated(time: np.ndarray, *, gap: float = 0.0, speed: float = 0.0, vehicles: int = 3):
    """The recording's motion at other times, with constant errors."""
    gaps = np.array([np.full_like(time, np.nan), 30 + 0.1 * time, np.full_like(time, 25.0)]) + gap
    speeds = np.array([np.full_like(time, 20.0), np.full_like(time, 19.0), np.full_like(time, 18.0)]) + speed
    return xr.Dataset(
        {"gap": (("vehicle", "time"), gaps[:vehicles]), "speed": (("vehicle", "time"), speeds[:vehicles])},
        coords={"time": time},
    )


def test_constant_errors_at_other_times():
    result = compare(simulated(np.linspace(-1, 20, 400), gap=-2.0, speed=0.5), recorded())
    assert result.vehicle.values.tolist() == [1, 2]
    np.testing.assert_allclose(result.rms_gap_error, 2.0)
    np.testing.assert_allclose(result.max_gap_error, 2.0)
    np.testing.assert_allclose(result.rms_speed_error, 0.5)
    np.testing.assert_allclose(result.max_speed_error, 0.5)
    np.testing.assert_allclose(result.nrmse_gap[1], 2 / 25)
    np.testing.assert_allclose(result.nrmse_speed[0], 0.5 / 19)
    assert result.samples.values.tolist() == [20, 20]
    assert result.attrs["leader_rms_speed_error"] == pytest.approx(0.5)
    assert result.rms_gap_error.attrs["units"] == "m"


def test_recording_against_itself_is_exact():
    recording = recorded()
    result = compare(recording.to_dataset(), recording)
    assert float(abs(result.rms_gap_error).max()) == 0.0
    assert float(result.nrmse_speed.max()) == 0.0


def test_common_span_only():
    result = compare(simulated(np.linspace(3.0, 6.0, 7)), recorded())
    assert result.samples[0] == 7
    assert (result.attrs["start"], result.attrs["end"]) == (3.0, 6.0)


def test_missing_recorded_samples_are_left_out_and_counted():
    recording = recorded()
    gap = recording.gap.copy()
    gap[1, :5] = np.nan
    speed = recording.speed.copy()
    speed[2] = np.nan
    result = compare(
        simulated(np.linspace(0, 10, 50), gap=1.0), Recording.from_gaps(recording.time, speed, gap, source="mine.csv")
    )
    assert result.missing_gaps.values.tolist() == [5, 0]
    assert result.missing_speeds.values.tolist() == [0, 20]
    assert result.rms_gap_error[0] == pytest.approx(1.0)
    assert np.isnan(result.rms_speed_error[1])


def test_a_collision_in_the_simulation_is_not_flattered():
    run = simulated(np.linspace(0, 10, 50))
    run["gap"][2, 30:] = np.nan
    result = compare(run, recorded())
    assert np.isfinite(result.rms_gap_error[0])
    assert np.isnan(result.rms_gap_error[1])


@pytest.mark.parametrize(
    ("run", "message"),
    [
        (simulated(np.linspace(0, 10, 9), vehicles=2), "has 2 vehicles and mine.csv has 3"),
        (simulated(np.linspace(100, 110, 9)), "no recorded time in common"),
        (simulated(np.linspace(0, 10, 9)).drop_vars("gap"), "has no 'gap'"),
    ],
)
def test_bad_pairs(run, message):
    with pytest.raises(HeadwayError, match=message):
        compare(run, recorded())


def test_no_follower():
    alone = Recording.from_gaps(np.arange(3.0), np.ones((1, 3)), np.full((1, 3), np.nan), source="alone.csv")
    with pytest.raises(HeadwayError, match="no follower"):
        compare(simulated(np.arange(3.0), vehicles=1), alone)
