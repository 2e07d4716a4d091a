"""Standstill, limits, collisions and laws that fail."""

from __future__ import annotations

from concurrent.futures import CancelledError

import numpy as np
import pytest

from headway.engine.simulate import simulate, solve
from headway.errors import HeadwayError
from headway.models import CACC, IDM, OVM, model
from headway.scenario.leaders import Brake, Constant, Sine, Step
from headway.scenario.scenario import Scenario
from headway.scenario.vehicle import Vehicle

STOP_AND_GO = Brake(10.0, 10.0, hold=6.0, ramp=2.3, onset=0.5)


@model
def braking(v, *, b: float = 2.0):
    """Brake steadily, whatever happens."""
    return 0.0 * v - b


@model
def pulled(v, vl, *, k: float = 1.0):
    """Follow the speed of the vehicle ahead, less half a metre a second."""
    return k * (vl - 0.5 - v)


@model
def broken(s, v):
    """Not a number once the speed falls below 9.5 m/s."""
    return 0.0 * s - 1.0 + 0.0 * np.sqrt(v - 9.5)


def run(leader, followers, duration: float, dt: float = 0.01, **more):
    return simulate(Scenario(leader, followers, duration=duration, dt=dt, **more))


@pytest.mark.parametrize("dt", [0.3, 0.07, 0.01])
@pytest.mark.parametrize("limits", [None, (-9.0, 3.0), (-1.5, 3.0)])
def test_constant_braking_stops_where_it_must(dt, limits):
    b = 2.0 if limits is None else min(2.0, -limits[0])
    result = run(Constant(10.0), [Vehicle(braking(), limits=limits)], 9.0, dt, gaps=50.0)
    t, x, v, a = result.time.values, *(result[q].values[1] for q in ("position", "speed", "acceleration"))
    moving = t < 10.0 / b - 1e-9
    np.testing.assert_allclose(v, np.where(moving, 10.0 - b * t, 0.0), rtol=0, atol=1e-12)
    np.testing.assert_allclose(x - x[0], np.where(moving, 10.0 * t - b * t**2 / 2, 50.0 / b), rtol=0, atol=1e-11)
    np.testing.assert_array_equal(a[~moving], 0.0)
    assert np.ptp(x[~moving]) == 0.0


def test_behind_a_lag_the_stop_is_exact_too():
    """a = -b (1 - e^(-t/l)): the speed v0 - b (t - l (1 - e^(-t/l))) reaches 0 at a time found by itself."""
    from scipy.optimize import brentq

    b, lag, v0 = 2.0, 0.5, 10.0
    relaxed = lambda t: lag * (1.0 - np.exp(-t / lag))  # noqa: E731
    stop = brentq(lambda t: v0 - b * (t - relaxed(t)), 1.0, 20.0, xtol=1e-14)
    distance = v0 * stop - b * (stop**2 / 2 - lag * stop + lag * relaxed(stop))
    result = run(Constant(v0), [Vehicle(braking(b=b), lag=lag)], 8.0, gaps=50.0)
    x = result.position.values[1]
    assert x[-1] - x[0] == pytest.approx(distance, abs=1e-8)
    assert result.speed.values[1, -1] == 0.0
    assert result.acceleration.values[1, -1] == 0.0


@pytest.mark.parametrize("dt", [0.11, 0.02])
@pytest.mark.parametrize(
    ("vehicle", "standing"),
    [
        (Vehicle(IDM()), 1),
        (Vehicle(IDM(T=0.8), delay=0.3), 4),
        (Vehicle(IDM(), lag=0.4), 0),
        (Vehicle(IDM(T=0.5), delay=0.2, lag=0.8), 4),
        (Vehicle(CACC(h=0.9), delay={"al": 0.1537}), 2),
        (Vehicle(CACC(h=0.9), lag=0.2, limits=(-4.0, 1.5)), 2),
    ],
)
def test_nobody_reverses_and_all_go_on(vehicle, standing, dt):
    """`standing` of the four come to a full stop; the others, being smoother, roll on."""
    result = run(STOP_AND_GO, [vehicle] * 4, 25.0, dt)
    speed = result.speed.values
    assert np.isnan(result.collision_time.values).all()
    assert speed.min() >= 0.0
    assert (speed[1:] == 0.0).any(axis=1).sum() == standing
    assert (speed[1:, -1] > 3.0).all()
    assert (np.diff(result.position.values) >= 0.0).all()


def test_standing_vehicles_start_the_moment_they_are_asked_to():
    """The one ahead accelerates at 1 m/s² from rest at t = 2; the law asks to go from 0.5 m/s on, at t = 2.5."""
    leader = Step(0.0, 5.0, onset=2.0, edge=5.0)
    result = run(leader, [Vehicle(pulled())], 6.0, 0.037, gaps=10.0, output_step=0.05)
    t, v = result.time.values, result.speed.values[1]
    u = np.maximum(t - 2.5, 0.0)
    np.testing.assert_allclose(v, u - (1.0 - np.exp(-u)), rtol=0, atol=1e-8)
    assert np.all(v[t <= 2.5] == 0.0)


def test_limits_bound_the_acceleration_and_are_reached():
    followers = [Vehicle(IDM(), limits=(-0.7, 0.4)), Vehicle(IDM(), lag=0.3, limits=(-0.5, 0.3))]
    result = run(Sine(15.0, 4.0, 0.9), followers, 20.0)
    a = result.acceleration.values
    assert (a[1].min(), a[1].max()) == (-0.7, 0.4)
    assert -0.5 <= a[2].min() < -0.4
    assert 0.2 < a[2].max() <= 0.3


def test_a_collision_is_data():
    """Follower 2 brakes too little; those ahead drive as if alone, those behind end with it."""
    ahead = Vehicle(IDM())
    drifting = Vehicle(braking(b=0.25))
    leader = Brake(10.0, 9.0, hold=30.0, ramp=3.0)
    result = run(leader, [ahead, drifting, ahead, ahead], 12.0, gaps=25.0)
    alone = run(leader, [ahead], 12.0, gaps=25.0)
    hit = result.collision_time.values
    assert np.isfinite(hit[2])
    assert np.isnan(hit[[0, 1, 3, 4]]).all()
    after = result.time.values >= hit[2]
    assert after.any()
    for name in ("position", "speed", "acceleration"):
        q = result[name].values
        assert np.isnan(q[2:, after]).all()
        assert np.isfinite(q[2:, ~after]).all()
        np.testing.assert_allclose(q[:2], alone[name].values, rtol=0, atol=1e-9)
    assert result.gap.values[2, ~after][-1] > 0.0


def test_the_time_of_a_collision_is_exact():
    """8 m to a leader that stands from t = 0 on, at 10 m/s and braking with 1 m/s²: 8 = 10 t - t²/2."""
    leader = Step(10.0, -10.0)
    for dt in (0.5, 0.1, 0.013):
        result = run(leader, [Vehicle(braking(b=1.0))], 3.0, dt, gaps=8.0)
        assert result.collision_time.values[1] == pytest.approx(10.0 - np.sqrt(100.0 - 16.0), abs=1e-10)


def test_a_later_collision_further_ahead_is_recorded_too():
    leader = Step(10.0, -10.0)
    result = run(leader, [Vehicle(braking(b=1.0)), Vehicle(braking(b=0.2))], 6.0, gaps=(30.0, 1.0))
    hit = result.collision_time.values
    assert hit[2] == pytest.approx(np.sqrt(2.0 * 1.0 / 0.8), abs=1e-10)
    assert hit[1] == pytest.approx(10.0 - np.sqrt(100.0 - 60.0), abs=1e-10)


def test_a_ballistic_run_collides_and_stops_too():
    result = run(Step(10.0, -10.0), [Vehicle(braking(b=1.0))], 3.0, 0.01, gaps=8.0, scheme="ballistic")
    assert result.collision_time.values[1] == pytest.approx(10.0 - np.sqrt(84.0), abs=1e-3)
    result = run(STOP_AND_GO, [Vehicle(IDM())] * 3, 20.0, 0.05, scheme="ballistic")
    assert result.speed.values.min() == 0.0
    assert (result.speed.values[:, -1] > 1.0).all()


def test_an_event_at_a_recorded_time_is_recorded_once():
    """A limit is reached in the step that starts at a recorded time; the row must not be written twice."""
    vehicle = Vehicle(OVM(alpha=0.9, v0=11.0, h=14.0, w=8.0), delay=0.2, limits=(-0.1, 0.05))
    fine = run(Sine(12.0, 2.0, 0.9), [vehicle], 5.0, 0.002, output_step=0.002)
    coarse = run(Sine(12.0, 2.0, 0.9), [vehicle], 5.0, 0.002, output_step=0.1)
    np.testing.assert_allclose(fine.speed.values[:, ::50], coarse.speed.values, rtol=0, atol=1e-9)
    assert (np.abs(np.diff(coarse.speed.values[0])) > 0.0).all()


def test_a_law_that_returns_nan_is_named_with_time_and_state():
    words = r"^follower 2: broken returned .* not finite at t = 0\.5\d* s .*v = 9\.5"
    with pytest.raises(HeadwayError, match=words) as error:
        run(Constant(10.0), [Vehicle(IDM()), Vehicle(broken())], 3.0, gaps=30.0)
    assert "\n" not in str(error.value)


@model
def switching(v, *, b: float = 1.0):
    """Go when standing, brake when moving: it cannot be followed once it stands."""
    return b if v <= 0.0 else -10.0 * b


@pytest.mark.parametrize("delay", [0.0, 0.3, 1.0])
@pytest.mark.parametrize("lag", [0.0, 0.4])
def test_limits_standstill_and_delay_come_to_an_end(delay, lag):
    """A standing vehicle whose late command crosses a limit stands on: that is no event, let alone one without end."""
    followers = [Vehicle(IDM(a=1.5, b=2.0, T=1.2), delay=delay, lag=lag, limits=(-3.0, 1.0))] * 3
    result = run(STOP_AND_GO, followers, 30.0, gaps=12.0)
    assert np.isfinite(result.speed.values[0]).all()
    assert result.speed.values[1:].min() >= 0.0 or np.isnan(result.speed.values[1:]).any()


def test_events_without_end_are_an_error_in_words():
    with pytest.raises(HeadwayError, match=r"shortly before t = 1\.\d* s vehicles stop, start or reach their limits"):
        run(Constant(10.0), [Vehicle(switching())], 5.0, gaps=500.0)


def test_a_run_ends_when_it_is_cancelled():
    scenario = Scenario(Sine(15.0, 4.0, 0.9), [Vehicle(IDM(), delay=0.2)] * 50, duration=600.0)
    asked = []

    def cancelled() -> bool:
        asked.append(True)
        return len(asked) > 2

    with pytest.raises(CancelledError):
        solve(scenario, cancelled)
    assert len(asked) == 3


def test_a_stop_is_felt_late_by_all_that_hear_its_acceleration():
    """Late accelerations of a vehicle that stops jump; those behind have their breaking points where they hear it."""
    leader = Brake(12.0, 12.0, hold=3.0, ramp=1.0)
    followers = [Vehicle(CACC(h=0.9, ka=0.5), delay={"al": 0.1537, "vl": 0.0837})] * 4
    coarse, fine = (run(leader, followers, 12.0, dt, output_step=0.1) for dt in (0.02, 0.01))
    finest = run(leader, followers, 12.0, 0.0025, output_step=0.1)
    errors = [np.abs(r.position.values - finest.position.values).max() for r in (coarse, fine)]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(4.0, abs=0.4)
