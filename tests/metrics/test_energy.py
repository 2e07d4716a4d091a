"""Energy, fuel and comfort of motions that are solved on paper."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from made import made

import headway as hw
from headway.errors import HeadwayError
from headway.metrics import comfort, energy
from headway.metrics.energy import RoadLoad

CAR = RoadLoad()


def drive(time, *speeds):
    """A platoon with these speeds over time."""
    speeds = np.array([np.broadcast_to(np.asarray(v, dtype=float), time.shape) for v in speeds])
    return made(time, speed=speeds, acceleration=np.gradient(speeds, time, axis=1))


# -- road load -------------------------------------------------------------------------------------


def test_force_on_a_level_road():
    drag = 0.5 * 1.2 * 0.66 * 30**2
    assert CAR.force(30.0, 0.0) == pytest.approx(drag + 1500 * 9.81 * 0.01)
    assert CAR.force(30.0, -2.0) == pytest.approx(drag + 1500 * 9.81 * 0.01 - 1500 * 1.04 * 2)
    heavy = RoadLoad(mass=20_000, rotating=0, drag_area=5, rolling=0.006, air_density=1.0, gravity=10)
    assert heavy.force(20.0, 0.5) == pytest.approx(20_000 * 0.5 + 0.5 * 5 * 400 + 1200)


def test_constant_speed():
    """1 MJ/100 km is a mean force of 10 N."""
    tr = drive(np.linspace(0, 600, 601), 30.0, 20.0)
    force = CAR.force(np.array([30.0, 20.0]), 0.0)
    for cost in (energy.combustion_energy, energy.electric_energy):
        np.testing.assert_allclose(cost(tr), 1e-6 * force * [18_000, 12_000], rtol=1e-12)
        np.testing.assert_allclose(cost(tr, per="distance"), force / 10, rtol=1e-12)
        np.testing.assert_allclose(cost(tr, per="leader"), [1, force[1] * 20 / (force[0] * 30)], rtol=1e-12)
    rate = 0.1569 + 2.450e-2 * 20 - 7.415e-4 * 400 + 5.975e-5 * 8000
    assert float(energy.fuel(tr)[1]) == pytest.approx(rate * 600, rel=1e-12)
    assert float(energy.fuel(tr, per="distance")[1]) == pytest.approx(rate / 20 * 1000, rel=1e-12)
    assert energy.fuel(tr, per="distance").attrs["units"] == "mL/km"
    assert energy.combustion_energy(tr, per="distance").attrs["units"] == "MJ/100 km"


def test_kamal_polynomial():
    assert float(energy.kamal(0.0, 0.0)) == 0.1569
    assert float(energy.kamal(0.0, -3.0)) == 0.1569
    steady = 0.1569 + 0.245 - 0.07415 + 0.05975
    np.testing.assert_allclose(
        energy.kamal([10.0, 10.0], [0.0, 2.0]), [steady, steady + 2 * (0.07224 + 0.9681 + 0.1075)]
    )


@settings(max_examples=40)
@given(v=st.floats(5.0, 40.0), a=st.floats(0.1, 3.0), steps=st.integers(1, 400))
def test_kinetic_energy_is_exact_whatever_the_samples(v, a, steps):
    """Without drag and rolling a start from rest costs m (1 + k_r) v²/2, and braking gives back a share of it."""
    free = RoadLoad(drag_area=0, rolling=0)
    up = np.linspace(0, v / a, steps + 1)
    kinetic = 1e-6 * 1500 * 1.04 * v * v / 2
    start, stop = drive(up, a * up), drive(up, v - a * up)
    if steps > 1:
        assert float(energy.combustion_energy(start, free)[0]) == pytest.approx(kinetic, rel=1e-12)
        assert float(energy.combustion_energy(stop, free)[0]) == pytest.approx(0, abs=1e-12)
        assert float(energy.electric_energy(stop, free)[0]) == pytest.approx(-0.6 * kinetic, rel=1e-12)
        assert float(energy.electric_energy(stop, free, regeneration=0)[0]) == pytest.approx(0, abs=1e-12)


def test_a_cycle_of_starts_and_stops_against_the_integral():
    """v = 15 + 10 sin t: the force changes its sign twice a period; a fine sum of the formula is the referee."""
    time = np.linspace(0, 4 * np.pi, 2001)
    tr = drive(time, 15 + 10 * np.sin(time))
    fine = np.linspace(0, 4 * np.pi, 400_001)
    middle = 0.5 * (fine[1:] + fine[:-1])
    v, a = 15 + 10 * np.sin(middle), 10 * np.cos(middle)
    power = CAR.force(v, a) * v
    dt = fine[1]
    assert float(energy.combustion_energy(tr)[0]) == pytest.approx(1e-6 * np.maximum(power, 0).sum() * dt, rel=1e-4)
    back = np.where(power < 0, 0.6 * power, power).sum()
    assert float(energy.electric_energy(tr)[0]) == pytest.approx(1e-6 * back * dt, rel=1e-4)
    assert float(energy.fuel(tr)[0]) == pytest.approx(energy.kamal(v, a).sum() * dt, rel=1e-4)


def test_corners_of_a_cycle_cost_nothing_extra():
    """A ramp sampled at its corners and one sampled densely agree although the acceleration jumps."""
    corners = np.array([0.0, 10.0, 20.0, 30.0])
    dense = np.linspace(0, 30, 3001)
    free = RoadLoad(drag_area=0)
    speed = np.array([0.0, 20.0, 20.0, 0.0])
    coarse, fine = drive(corners, speed), drive(dense, np.interp(dense, corners, speed))
    for measure in (energy.combustion_energy, energy.electric_energy):
        assert float(measure(coarse, free)[0]) == pytest.approx(float(measure(fine, free)[0]), rel=1e-9)


def test_collided_vehicles_are_measured_until_then():
    time = np.linspace(0, 100, 1001)
    tr = drive(time, 20.0, np.where(time <= 50, 20.0, np.nan))
    spent = energy.combustion_energy(tr)
    assert float(spent[1]) == pytest.approx(float(spent[0]) / 2, rel=1e-9)
    np.testing.assert_allclose(energy.fuel(tr, per="leader"), 1.0)
    np.testing.assert_allclose(energy.fuel(tr, per="distance"), float(energy.fuel(tr, per="distance")[0]))


def test_a_leader_that_needs_nothing_is_no_measure():
    time = np.linspace(0, 5, 501)
    tr = drive(time, 20 - 4 * time, 20.0)
    assert np.isnan(energy.combustion_energy(tr, per="leader")).all()
    standing = drive(time, 0.0, 0.0)
    assert np.isnan(energy.fuel(standing, per="distance")).all()
    np.testing.assert_allclose(energy.fuel(standing), 5 * 0.1569)


# -- comfort ---------------------------------------------------------------------------------------


def test_jerk_of_a_sine():
    omega = 1.3
    time = np.linspace(0, 10 * 2 * np.pi / omega, 20_001)
    a = np.array([[1.5], [3.0]]) * np.sin(omega * time)
    tr = made(time, acceleration=a)
    np.testing.assert_allclose(comfort.jerk(tr), a[:, :1] + omega * np.array([[1.5], [3.0]]) * np.cos(omega * time),
                               atol=1e-4)  # fmt: skip
    np.testing.assert_allclose(comfort.peak_jerk(tr), omega * np.array([1.5, 3.0]), rtol=1e-4)
    np.testing.assert_allclose(comfort.rms_jerk(tr), omega * np.array([1.5, 3.0]) / math.sqrt(2), rtol=1e-4)
    np.testing.assert_allclose(comfort.rms_acceleration(tr), np.array([1.5, 3.0]) / math.sqrt(2), rtol=1e-6)
    share = 2 / math.pi * math.acos(2 / (omega * 3.0))
    np.testing.assert_allclose(comfort.jerk_share(tr), [0.0, share], atol=1e-4)
    assert "unweighted" in comfort.rms_acceleration(tr).attrs["long_name"]


def test_jerk_of_a_ramp_on_uneven_samples():
    time = np.array([0.0, 0.3, 0.5, 1.0, 1.4])
    tr = made(time, acceleration=np.array([[2.5, -4.0]]).T * time + 1.0)
    np.testing.assert_allclose(comfort.jerk(tr), [[2.5] * 5, [-4.0] * 5])
    np.testing.assert_allclose(comfort.jerk_share(tr), [1.0, 1.0])
    np.testing.assert_allclose(comfort.jerk_share(tr, limit=3.0), [0.0, 1.0])
    np.testing.assert_allclose(comfort.peak_jerk(tr), [2.5, 4.0])


def test_comfort_until_a_collision():
    time = np.linspace(0, 10, 1001)
    a = np.array([3.0 * time, np.where(time < 5, 3.0 * time, np.nan)])
    tr = made(time, acceleration=a)
    np.testing.assert_allclose(comfort.rms_jerk(tr), [3, 3])
    np.testing.assert_allclose(comfort.jerk_share(tr), [1, 1])
    # the last known sample stands for half a step beyond itself
    assert float(comfort.rms_acceleration(tr)[1]) == pytest.approx(3 * 4.995 / math.sqrt(3), rel=1e-5)


# -- what cannot be measured -----------------------------------------------------------------------


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda d: energy.fuel(d.drop_vars("speed")), "fuel needs the variable 'speed'; this dataset has acceleration"),
        (lambda d: comfort.rms_jerk(d.drop_vars("acceleration")), "rms_jerk needs the variable 'acceleration'"),
        (lambda d: comfort.jerk(d.isel(time=[0, 1])), "at least 3 samples in time; this dataset has 2"),
        (lambda d: comfort.jerk_share(d, limit=0), "limit = 0 is not positive"),
        (lambda d: energy.fuel(d, per="mile"), "'mile' is not known; allowed are distance, leader, run"),
        (lambda d: energy.electric_energy(d, regeneration=1.5), "regeneration = 1.5 is not a share"),
        (lambda d: energy.fuel(d.isel(vehicle=[1]), per="leader"), "the leader, vehicle 0, is not in this dataset"),
        (lambda d: energy.fuel(d.where(d.vehicle == 0)), "'speed' of no follower is known from 0 to 10 s"),
        (lambda d: RoadLoad(mass=0), "RoadLoad: mass = 0 is not allowed; it is above zero"),
        (lambda d: RoadLoad(rolling=-0.1), "rolling = -0.1 is not allowed; it is zero or more"),
        (lambda d: RoadLoad(drag_area=math.nan), "drag_area = nan is not a finite number"),
    ],
)
def test_what_cannot_be_measured_is_said(call, message):
    time = np.linspace(0, 10, 11)
    with pytest.raises(HeadwayError, match=message):
        call(drive(time, 20.0, 20.0))


def test_a_calmer_follower_needs_less():
    car = hw.Vehicle(hw.models.IDM())
    tr = hw.simulate(hw.Scenario(hw.sine(mean=23, amplitude=2, omega=0.63), [car] * 2, duration=100, output_step=0.1))
    for measure in (energy.combustion_energy, energy.electric_energy, energy.fuel):
        spent = measure(tr, per="leader").values
        assert 1 == spent[0] > spent[1] > spent[2]
