"""Three delay equations of the literature, stated as car-following laws: their values, and order 4.

Leaders only have to be out of the way: all gaps are large and no law looks at them.
"""

from __future__ import annotations

import numpy as np
import pytest
from orders import geometric, order

from headway.engine.simulate import simulate
from headway.models import model
from headway.scenario.leaders import Constant
from headway.scenario.scenario import Scenario
from headway.scenario.vehicle import Vehicle

FAR = 5000.0


@model
def decay(v, *, offset: float = 5.0):
    """x' = -x(t - 1), where x = v - offset."""
    return -(v - offset)


@model
def hutchinson(v, dv, *, rate: float = 1.5, leader: float = 2.0):
    """y' = rate y (1 - y(t - 1)), where y is own speed now and, behind a steady leader, leader - dv late."""
    return rate * v * (1.0 - (leader - dv))


@model
def growth(v):
    """y' = y(t - τ), y = own speed."""
    return v


@model
def driven(v, vl):
    """y' = speed of the vehicle ahead + own speed, each as late as the channel says."""
    return vl + v


def decay_problem(dt: float, end: float) -> Scenario:
    """x = 1 up to t = 0."""
    return Scenario(
        Constant(5.0), [Vehicle(decay(), delay={"v": 1.0})],
        duration=end, dt=dt, output_step=1.0, gaps=FAR, speed_offsets={1: 1.0},
    )  # fmt: skip


def hutchinson_problem(dt: float, end: float) -> Scenario:
    """y = 0.5 up to t = 0."""
    return Scenario(
        Constant(2.0), [Vehicle(hutchinson(), delay={"dv": 1.0})],
        duration=end, dt=dt, output_step=1.0, gaps=FAR, speed_offsets={1: -1.5},
    )  # fmt: skip


def dde23_problem(dt: float, end: float) -> Scenario:
    """Example 1 of dde23: y1' = y1(t-1), y2' = y1(t-1) + y2(t-0.2), y3' = y2; all 1 up to t = 0."""
    return Scenario(
        Constant(1.0),
        [Vehicle(growth(), delay={"v": 1.0}), Vehicle(driven(), delay={"vl": 1.0, "v": 0.2})],
        duration=end, dt=dt, output_step=1.0, gaps=FAR,
    )  # fmt: skip


def solution(problem, dt: float, end: float) -> np.ndarray:
    """The unknowns (n, times) at t = 0, 1, … `end`."""
    result = simulate(problem(dt, end))
    v, x = result.speed.values, result.position.values
    assert np.isnan(result.collision_time.values).all()
    if problem is decay_problem:
        return v[1:] - 5.0
    if problem is hutchinson_problem:
        return v[1:]
    return np.stack([v[1], v[2], 1.0 + x[2] - x[2, 0]])


def by_polynomials(problem, end: int) -> np.ndarray:
    """The linear problems exactly, as polynomials piece by piece (0.2 s long; the delays are 5 and 1 pieces)."""
    n = 5 * end
    integrate = np.polynomial.polynomial.polyint
    value = np.polynomial.polynomial.polyval
    count = 1 if problem is decay_problem else 3
    pieces: list[list[np.ndarray]] = [[np.array([1.0])] * 5 for _ in range(count)]
    for k in range(5, 5 + n):
        first = (-1.0 if problem is decay_problem else 1.0) * pieces[0][k - 5]
        rates = [first]
        if count == 3:
            rates.append(np.polynomial.polynomial.polyadd(pieces[0][k - 5], pieces[1][k - 1]))
        for y, rate in zip(pieces, rates, strict=False):
            y.append(integrate(rate, k=value(0.2, y[k - 1]) if k > 5 else 1.0))
        if count == 3:
            y = pieces[2]
            y.append(integrate(pieces[1][k], k=value(0.2, y[k - 1]) if k > 5 else 1.0))
    return np.array([[1.0] + [value(0.2, y[5 + 5 * t - 1]) for t in range(1, end + 1)] for y in pieces])


def test_decay_has_the_published_values():
    (x,) = solution(decay_problem, 0.005, 10.0)
    assert x[5] == pytest.approx(0.1583333333, abs=1e-10)
    assert x[10] == pytest.approx(0.0202411265, abs=1e-10)


def test_hutchinson_has_the_published_value():
    (y,) = solution(hutchinson_problem, 0.005, 20.0)
    assert y[20] == pytest.approx(0.79498875, abs=1e-8)


def test_dde23_example_has_the_published_values():
    y = solution(dde23_problem, 0.005, 5.0)[:, 5]
    np.testing.assert_allclose(y, [19.175, 176.42257845, 190.34420194], rtol=0, atol=1e-8)


@pytest.mark.parametrize(("problem", "end"), [(decay_problem, 10), (dde23_problem, 5)])
def test_linear_problems_agree_with_exact_polynomials_everywhere(problem, end):
    np.testing.assert_allclose(solution(problem, 0.005, end), by_polynomials(problem, end), rtol=0, atol=2e-9)


@pytest.mark.parametrize(
    ("problem", "end", "steps"),
    [
        (decay_problem, 10, np.array([0.25, 0.125, 0.0625, 0.03125])),
        (decay_problem, 10, geometric(0.23, 0.006)),
        (hutchinson_problem, 20, np.array([0.05, 0.025, 0.0125])),
        (hutchinson_problem, 20, geometric(0.07, 0.005)),
        (dde23_problem, 5, np.array([0.2, 0.1, 0.05, 0.025])),
        (dde23_problem, 5, geometric(0.13, 0.006)),
    ],
)
def test_order_is_four_on_and_off_the_grid_of_the_delays(problem, end, steps):
    exact = solution(problem, 0.001, end)
    found = order(lambda dt: float(np.max(np.abs(solution(problem, dt, end) - exact))), steps)
    assert found == pytest.approx(4.0, abs=0.15)
