"""Global order 4 with any delays, lags, kinks and events; zero delay is no delay, bit for bit."""

from __future__ import annotations

import numpy as np
import pytest
from orders import geometric, order

from headway.engine.simulate import simulate
from headway.models import CACC, FVDM, IDM
from headway.scenario.leaders import Brake, Constant, Sine, Window
from headway.scenario.scenario import Scenario
from headway.scenario.vehicle import Vehicle

SINE = Sine(15.0, 3.0, 1.1)
DRIVER = IDM(a=1.4, T=1.1, v0=30.0)
COOPERATIVE = CACC(h=0.8)
WINDOW = Window(15.0, 2.0, 1.9, duration=2.71828, onset=0.31416)
STOP_AND_GO = Brake(10.0, 10.0, hold=4.0, ramp=2.3, onset=0.4)

#: name → (leader, followers, duration [s], steps [s])
CASES = {
    "no delay": (SINE, [Vehicle(DRIVER)] * 3, 8.0, geometric(0.25, 0.02)),
    "aligned delay": (SINE, [Vehicle(DRIVER, delay=0.4)] * 3, 8.0, np.array([0.1, 0.05, 0.025, 0.0125])),
    "unaligned delay": (SINE, [Vehicle(DRIVER, delay=0.3717)] * 3, 8.0, geometric(0.2, 0.01)),
    "a delay for each signal and vehicle": (
        SINE,
        [
            Vehicle(DRIVER, delay={"s": 0.31, "v": 0.1234, "dv": 0.217}),
            Vehicle(FVDM(alpha=0.8, v0=15.0, h=14.0, w=8.0), delay={"s": 0.4711, "vl": 0.2}),
            Vehicle(DRIVER, delay=0.55),
        ],
        8.0,
        geometric(0.15, 0.008),
    ),
    "radio delay, accelerations heard late": (
        SINE, [Vehicle(COOPERATIVE, delay={"vl": 0.1537, "al": 0.1537})] * 4, 8.0, geometric(0.15, 0.01),
    ),
    "own acceleration late as well": (
        Window(15.0, 4.0, 3.1, duration=2.71828, onset=0.31416),
        [Vehicle(COOPERATIVE, delay={"al": 0.3537, "a": 0.5})],
        8.0,
        geometric(0.1, 0.008),
    ),
    "lag": (SINE, [Vehicle(DRIVER, lag=0.4)] * 3, 8.0, geometric(0.15, 0.01)),
    "lag, accelerations heard late": (
        WINDOW, [Vehicle(COOPERATIVE, lag=0.3, delay={"vl": 0.1537, "al": 0.1})] * 3, 8.0, geometric(0.1, 0.006),
    ),
    "delay shorter than every step": (SINE, [Vehicle(DRIVER, delay=0.0071)] * 3, 8.0, geometric(0.2, 0.012)),
    "radio delay shorter than every step": (
        SINE, [Vehicle(COOPERATIVE, delay={"vl": 0.0071, "al": 0.0071})] * 3, 8.0, geometric(0.2, 0.012),
    ),
    "window with kinks off the grid": (WINDOW, [Vehicle(DRIVER, delay=0.25)] * 3, 8.0, geometric(0.1, 0.006)),
    "standstill": (
        STOP_AND_GO, [Vehicle(COOPERATIVE), Vehicle(IDM(T=0.7, s0=3.0), delay=0.3)], 14.0, geometric(0.1, 0.008),
    ),
    "standstill with delay and lag": (
        STOP_AND_GO,
        [Vehicle(IDM(T=0.8), delay=0.317), Vehicle(IDM(T=0.8), delay=0.2, lag=0.3)],
        14.0,
        geometric(0.1, 0.008),
    ),
    "limits": (SINE, [Vehicle(DRIVER, limits=(-0.9, 0.6)), Vehicle(DRIVER, delay=0.3)], 8.0, geometric(0.1, 0.005)),
}  # fmt: skip


def run(leader, followers, duration: float, dt: float, **more):
    return simulate(Scenario(leader, followers, duration=duration, dt=dt, output_step=0.5, **more))


@pytest.mark.parametrize("name", CASES)
def test_order_is_four(name):
    leader, followers, duration, steps = CASES[name]
    exact = run(leader, followers, duration, float(steps[-1]) / 8)
    assert np.isnan(exact.collision_time.values).all()

    def error(dt: float) -> float:
        """Root mean square over vehicles and times of the error of gaps [m] and speeds [m/s]."""
        found = run(leader, followers, duration, dt)
        return float(np.sqrt(sum(((found[q] - exact[q]) ** 2).mean() for q in ("gap", "speed"))))

    assert order(error, steps) == pytest.approx(4.0, abs=0.15)


def test_the_cases_pass_through_what_they_are_named_after():
    stopped = run(*CASES["standstill"][:3], 0.01)
    assert (stopped.speed.values[1:] == 0.0).any(axis=1).all()
    assert (stopped.speed.values[1:, -1] > 1.0).all()
    stopped = run(*CASES["standstill with delay and lag"][:3], 0.01)
    assert (stopped.speed.values[1:] == 0.0).any(axis=1).all()
    assert (stopped.speed.values[1:, -1] > 0.5).all()
    limited = run(*CASES["limits"][:3], 0.01)
    assert limited.acceleration.values[1].min() == -0.9
    assert limited.acceleration.values[1].max() == 0.6


def assert_same_bits(one, other) -> None:
    for name in one.data_vars:
        np.testing.assert_array_equal(one[name].values, other[name].values, err_msg=name)


@pytest.mark.parametrize(
    ("law", "zero"),
    [
        (DRIVER, 0.0),
        (DRIVER, {"s": 0.0, "vl": 0.0}),
        (COOPERATIVE, 0.0),
        (COOPERATIVE, {"vl": 0.0, "al": 0.0, "a": 0.0}),
    ],
)
def test_zero_delay_is_no_delay_bit_for_bit(law, zero):
    plain = run(WINDOW, [Vehicle(law)] * 3, 6.0, 0.013)
    assert_same_bits(run(WINDOW, [Vehicle(law, delay=zero)] * 3, 6.0, 0.013), plain)


def test_a_tiny_delay_is_almost_no_delay():
    """A delay of 1 µs moves the solution by about 1 µs times its rate of change, not by a step."""
    plain, late = (run(SINE, [Vehicle(DRIVER, delay=d)] * 2, 6.0, 0.02) for d in (0.0, 1e-6))
    difference = float(np.abs(late.speed - plain.speed).max())
    assert 1e-8 < difference < 1e-5


def test_steps_are_never_longer_than_dt_and_end_where_results_are_wanted():
    coarse = simulate(Scenario(Constant(10.0), [Vehicle(DRIVER)], duration=1.0, dt=0.3))
    np.testing.assert_allclose(coarse.time.values, [0.0, 0.3, 0.6, 0.9, 1.0])
