"""Theory against simulation: every model, every pattern of delays, with and without actuator lag."""

from __future__ import annotations

import cmath
import dataclasses
import functools
import math
from typing import NamedTuple

import numpy as np
import pytest

import headway as hw
from headway.models import CACC, FVDM, GMM, IDM, OVM, IDMSpacing


class Case(NamedTuple):
    """A model at a speed [m/s] and, where every gap is an equilibrium, a gap [m]; step and lag [s] that suit it."""

    model: hw.Model
    speed: float
    gap: float | None = None
    dt: float = 0.05
    lag: float = 0.3


#: all but one are string stable without delay, also with the lag, so that there is a critical delay to find
CASES = {
    "ovm": Case(OVM(alpha=5, v0=20, h=25, w=12), 15.0, dt=0.02, lag=0.1),
    "ovm of the paper": Case(OVM(alpha=0.5), 23.0, dt=0.01, lag=0.01),
    "ovm of the paper, tamed": Case(OVM(alpha=60), 23.0, dt=0.0025, lag=0.005),
    "fvdm": Case(FVDM(alpha=3, lam=1.5, v0=20, h=25, w=12), 15.0, dt=0.02),
    "idm": Case(IDM(), 23.0),
    "idm-spacing": Case(IDMSpacing(a=3, T=2), 3.0, dt=0.02),
    "gmm": Case(GMM(), 15.0, 12.0),
    "cacc": Case(CACC(), 15.0, dt=0.02),
}
PATTERNS = {
    "all late": lambda _: 1.0,
    "own speed current": lambda signals: {"s": 1.0, "vl": 1.0} if "dv" in signals else {"s": 1.0},
    "measured late": lambda _: {"s": 1.0, "dv": 1.0},
    "radio late": lambda _: {"vl": 1.0, "al": 1.0},
}


def applicable(name):
    """A law without dv has no second way to be late; the one with radio hears vl by itself."""
    signals = CASES[name].model.law.signals
    if "vl" in signals:
        return "all late", "measured late", "radio late"
    return ("all late", "own speed current", "measured late") if "dv" in signals else ("all late", "own speed current")


GRID = [(n, p, lag) for n in CASES for p in applicable(n) for lag in (False, True)]


@functools.cache
def vehicle(name, pattern, lag):
    """The vehicle with a delay of 1 s in this pattern."""
    case = CASES[name]
    return hw.Vehicle(case.model, delay=PATTERNS[pattern](case.model.law.signals), lag=case.lag if lag else 0.0)


@functools.cache
def critical(name, pattern, lag, kind):
    case = CASES[name]
    return hw.linearize(vehicle(name, pattern, lag), case.speed, case.gap).critical_delay(kind)


def late(name, pattern, lag, delay):
    """(vehicle, its linear theory) with this delay [s]."""
    car, case = vehicle(name, pattern, lag), CASES[name]
    times = delay if isinstance(car.delay, float) else {n: delay for n, _ in car.delay}
    car = dataclasses.replace(car, delay=times)
    return car, hw.linearize(car, case.speed, case.gap)


def transfer(name, car, theory, base, harmonics, amplitude, digits):
    """Measured G at multiples of `base` [rad/s]: least squares over one period once the transient has died."""
    case, period = CASES[name], 2 * math.pi / base
    start = math.ceil(digits * math.log(10) / theory.decay_rate / period) * period
    omega = base * np.asarray(harmonics, dtype=float)
    leader = hw.multisine(case.speed, [amplitude] * omega.size, [float(w) for w in omega])
    step = period / (8 * max(harmonics))
    run = hw.simulate(
        hw.Scenario(
            leader, [car], duration=start + 1.001 * period, gaps=case.gap, dt=min(case.dt, step), output_step=step
        )
    )
    t = run.time.values
    window = (t > start - 0.5 * step) & (t < start + period - 0.5 * step)
    waves = np.exp(-1j * omega[:, None] * t[window])
    own, ahead = ((run.speed.values[i, window] - case.speed) @ waves.T for i in (1, 0))
    return omega, own / ahead


@pytest.mark.parametrize(("name", "pattern", "lag"), GRID)
def test_small_disturbances_are_passed_on_as_the_theory_says(name, pattern, lag):
    """Gain within 1e-4, phase too, at 12 frequencies from 0.08 to 3.2 rad/s."""
    delay = min(0.5 * critical(name, pattern, lag, "local"), 1.0)
    car, theory = late(name, pattern, lag, delay)
    omega, measured = transfer(name, car, theory, 0.08, [1, 2, 3, 4, 6, 8, 11, 15, 20, 26, 33, 40], 1e-6, digits=6)
    assert np.abs(measured) == pytest.approx(theory.gain(omega), abs=1e-4)
    assert measured == pytest.approx(theory.transfer(1j * omega), abs=1e-4)


#: patterns that no delay makes string unstable, and a model that is so without any
ALWAYS_STABLE = {("gmm", "own speed current")}
NEVER_STABLE = {"ovm of the paper"}


@pytest.mark.parametrize(
    ("name", "pattern", "lag"), [g for g in GRID if g[:2] not in ALWAYS_STABLE and g[0] not in NEVER_STABLE]
)
def test_disturbances_grow_beyond_the_critical_delay_and_not_before(name, pattern, lag):
    limit = critical(name, pattern, lag, "string")
    assert 0 < limit < math.inf
    _, beyond = late(name, pattern, lag, 1.02 * limit)
    assert beyond.locally_stable
    for factor, grows in ((0.98, False), (1.02, True)):
        car, theory = late(name, pattern, lag, factor * limit)
        _, measured = transfer(name, car, theory, beyond.peak_frequency, [1], 1e-4, digits=8)
        assert (abs(measured[0]) > 1) == grows
        assert theory.string_stable != grows
        assert abs(measured[0]) - 1 == pytest.approx(float(theory.gain(beyond.peak_frequency)) - 1, rel=0.02, abs=2e-8)


@pytest.mark.parametrize(
    ("name", "pattern", "lag"), [g for g in GRID if g[0] in NEVER_STABLE or g[:2] in ALWAYS_STABLE]
)
def test_verdicts_that_no_delay_changes(name, pattern, lag):
    assert critical(name, pattern, lag, "string") == (0.0 if name in NEVER_STABLE else math.inf)


#: the radio is no part of the loop, nor is the leader's speed for GMM
NO_LOOP = {("cacc", "radio late"), ("gmm", "own speed current")}


@pytest.mark.parametrize(("name", "pattern", "lag"), [g for g in GRID if g[:2] not in NO_LOOP])
def test_one_vehicle_alone_recovers_up_to_the_critical_delay(name, pattern, lag):
    case, limit = CASES[name], critical(name, pattern, lag, "local")
    for factor, recovers in ((0.98, True), (1.02, False)):
        car, theory = late(name, pattern, lag, factor * limit)
        root, second = (r for r in theory.roots.roots[[0, 2]])
        period = 2 * math.pi / root.imag
        # the faster modes are five digits smaller by then
        start = math.log(1e5) / (root.real - second.real)
        # so small a disturbance that the gap of GMM, which keeps what it was changed by, is still the same
        scenario = hw.Scenario(
            hw.constant(case.speed), [car], duration=start + 4.01 * period, gaps=case.gap,
            dt=min(case.dt, period / 100), output_step=period / 100, speed_offsets={1: 1e-6},
        )  # fmt: skip
        run = hw.simulate(scenario)
        deviation = run.speed.values[1] - case.speed
        at = int(np.searchsorted(run.time.values, start))
        first, last = deviation[at : at + 100], deviation[at + 300 : at + 400]
        rate = 0.5 * math.log(np.sum(last**2) / np.sum(first**2)) / (3 * period)
        assert (rate < 0) == recovers == theory.locally_stable
        assert rate == pytest.approx(-theory.decay_rate, rel=0.01)


@pytest.mark.parametrize(("name", "pattern"), sorted(NO_LOOP))
def test_what_is_not_in_the_loop_cannot_upset_it(name, pattern):
    assert critical(name, pattern, False, "local") == math.inf
    assert cmath.isclose(
        late(name, pattern, False, 0.3)[1].rightmost_root, late(name, pattern, False, 30.0)[1].rightmost_root
    )
