"""Extremes between samples: refined on smooth pieces, never past a corner, a jump or a limit."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import headway as hw
from headway.metrics.extremes import FROM_ZERO, amplitude_of, extreme_of, peak_of
from headway.models import IDM
from headway.study.study import Study


def highest(curve, start, step, bounds=(-np.inf, np.inf)):
    """Its refined highest value, and the highest sample, over about sixty samples around 0."""
    time = start + step * np.arange(-30, 31)
    values = curve(time)
    return float(extreme_of(time, values, 1.0, bounds)), float(values.max())


@given(start=st.floats(0.0, 1.0), omega=st.floats(0.1, 6.0))
def test_a_smooth_top_is_found_between_samples(start, omega):
    found, sample = highest(lambda t: np.where(np.abs(omega * t) < np.pi, np.cos(omega * t), -1.0), 0.1 * start, 0.1)
    assert sample <= found <= 1.0 + 1e-12
    assert found == pytest.approx(1.0, abs=3e-4)


#: curves with a corner, a jump or a plateau at or beside their highest value, which is 0
CORNERED = {
    "corner": lambda t: np.minimum(t, -0.3 * t),
    "ramp onto a plateau": lambda t: np.minimum(t, 0.0),
    "arc onto a plateau": lambda t: np.where(t < 0, -(t**2) + 0.3 * t, 0.0),
    "arc and corner": lambda t: np.where(t < 0, t - 2 * t * t, -0.5 * t - 2 * t * t),
    "jump onto a plateau": lambda t: np.where(t < 0, -4.8, 0.0),
    "jump and decline": lambda t: np.where(t < 0, -1.0, -0.3 * t),
    "ramp off a jump": lambda t: np.where(t < 0, t, -1.0),
}


@pytest.mark.parametrize("name", CORNERED)
@given(start=st.floats(0.0, 1.0))
def test_no_corner_jump_or_plateau_is_overshot(name, start):
    found, sample = highest(CORNERED[name], 0.1 * start, 0.1)
    assert sample <= found <= 0.0


@given(start=st.floats(0.0, 1.0), cut=st.floats(0.0, 0.2))
def test_bounds_are_never_passed(start, cut):
    top = float(np.cos(cut))
    found, sample = highest(lambda t: np.minimum(np.cos(t), top), 0.1 * start, 0.1, (-np.inf, top))
    assert sample <= found <= top


def test_magnitude_and_amplitude_have_the_same_bounds():
    time = np.arange(0.0, 10.0, 0.3)
    speed = np.abs(np.sin(time + 0.1))  # touches standstill
    assert float(extreme_of(time, -speed, 1.0, (-np.inf, 0.0))) <= 0.0
    assert float(amplitude_of(time, speed, FROM_ZERO)) <= 0.5 * float(peak_of(time, speed, FROM_ZERO))


def test_a_leader_that_brakes_at_4_8_brakes_at_4_8():
    leader = hw.brake(mean=20.0, drop=12.0, hold=3.0, ramp=2.5, onset=1.0)
    run = hw.simulate(hw.Scenario(leader, [hw.Vehicle(IDM())], duration=20.0))
    hardest = float(hw.metrics.least(run.acceleration)[0])
    assert hardest == pytest.approx(float(run.acceleration[0].min()), rel=1e-9)


@pytest.mark.parametrize("step", [None, 0.03, 0.1])
@pytest.mark.parametrize("delay", [0.0, 0.3])
def test_an_acceleration_stays_within_the_limits_of_the_vehicle(step, delay):
    cars = [hw.Vehicle(IDM(T=0.8), delay=delay, limits=(-low, 1.0)) for low in (5.0, 3.0, 2.0)]
    scenario = hw.Scenario(hw.sine(mean=20, amplitude=6, omega=0.5), cars, duration=40.0, dt=0.05, output_step=step)
    study = Study(scenario, {"leader.amplitude": [2.0, 6.0, 7.0]})
    found = study.run(["least_acceleration", "largest_acceleration", "peak_acceleration", "acceleration_amplitude"])
    for i in range(study.points.count):
        run = hw.simulate(study.scenario_at(i))
        own = run.acceleration[1:]
        for name, ours in (
            ("least_acceleration", hw.metrics.least(run.acceleration)),
            ("peak_acceleration", hw.metrics.peak(run.acceleration)),
            ("acceleration_amplitude", hw.metrics.amplitude(run.acceleration)),
        ):
            np.testing.assert_array_equal(found[name].values[i], ours.values, err_msg=name)
        least, most = (found[f"{which}_acceleration"].values[i][1:] for which in ("least", "largest"))
        assert (least >= [-5.0, -3.0, -2.0]).all()
        assert (most <= 1.0).all()
        assert (least <= own.min("time").values).all()


def test_limits_are_told_only_where_there_are_any():
    free = hw.Scenario(hw.sine(mean=20, amplitude=2, omega=0.5), [hw.Vehicle(IDM())] * 2, duration=5.0)
    assert "limit_low" not in hw.simulate(free).coords
    bound = dataclasses.replace(free, followers=[hw.Vehicle(IDM(), limits=(-5.0, 2.0)), hw.Vehicle(IDM())])
    run = hw.simulate(bound)
    np.testing.assert_array_equal(run.limit_low, [-np.inf, -5.0, -np.inf])
    np.testing.assert_array_equal(run.limit_high, [np.inf, 2.0, np.inf])
    assert run.limit_low.attrs["units"] == "m/s²"
