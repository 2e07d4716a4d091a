"""Margins of the vehicle's own loop, and what is found or said about delays, roots, parameters and corners."""

from __future__ import annotations

import dataclasses
import math
import warnings

import control
import numpy as np
import pytest
from late import late

import headway as hw
from headway.models import CACC, FVDM, GMM, IDM, OVM, IDMSpacing
from headway.theory.quasipolynomial import QuasiPolynomial
from headway.theory.roots import rightmost


def linear(model, speed=23.0, gap=None, **vehicle):
    return hw.linearize(hw.Vehicle(model, **vehicle), speed, gap)


CASES = [
    {"model": IDM}, {"model": IDM, "delay": 1.5}, {"model": IDM, "lag": 0.5}, {"model": CACC, "lag": 0.4},
    {"model": IDM, "delay": {"s": 0.5, "vl": 0.5}}, {"model": IDMSpacing, "delay": 0.3, "lag": 0.2},
]  # fmt: skip


@pytest.mark.parametrize("vehicle", CASES)
def test_at_its_margin_the_loop_swings(vehicle):
    found = linear(**vehicle)
    f, c, p = found.partials, late(found.vehicle), found.margins
    # where no gain breaks the loop there is no such frequency, and the first column is not looked at
    w = np.array([p.gain_frequency if math.isfinite(p.gain) else 1.0, p.phase_frequency])
    s = 1j * w
    feedback = (
        f["s"] * np.exp(-s * c.get("s", 0.0)) + s * f.get("dv", 0) * np.exp(-s * c.get("dv own", 0.0))
        - s * f["v"] * np.exp(-s * c.get("v", 0.0)) - s * s * f.get("a", 0) * np.exp(-s * c.get("a", 0.0))
    )  # fmt: skip
    loop = feedback / (s * s * (1 + found.vehicle.lag * s))
    if math.isfinite(p.gain):
        assert p.gain * loop[0] == pytest.approx(-1.0, abs=1e-9)
        assert p.gain > 1.0
    assert loop[1] * np.exp(-1j * p.phase) == pytest.approx(-1.0, abs=1e-9)
    assert found.delay_margin == pytest.approx(p.phase / w[1])  # these loops cross once


def test_python_control_agrees():
    for lag in (0.2, 0.8):
        found = linear(IDM, lag=lag)
        f = found.partials
        loop = control.tf([f["dv"] - f["v"], f["s"]], [lag, 1.0, 0.0, 0.0])
        gain, phase, _, _, frequency, _ = control.stability_margins(loop)
        assert found.gain_margin == pytest.approx(gain) or math.isinf(gain)
        assert math.degrees(found.phase_margin) == pytest.approx(phase)
        assert found.margins.phase_frequency == pytest.approx(frequency)


def test_delay_margin_is_what_is_left_to_the_critical_delay():
    for delay in (0.0, 0.5, 1.5, 2.8):
        assert linear(IDM, delay=delay).delay_margin == pytest.approx(2.81483511042 - delay, abs=1e-8)


def test_gain_margin_is_where_more_sensitivity_breaks_the_loop():
    found = linear(GMM, gap=15.0, delay=4.0)
    for factor, stable in ((0.999, True), (1.001, False)):
        stronger = GMM(alpha=1.5 * found.gain_margin * factor)
        assert linear(stronger, gap=15.0, delay=4.0).locally_stable is stable


def test_nothing_to_lose_and_nothing_to_fear():
    assert all(math.isnan(x) for x in linear(IDM, delay=3.0).margins)
    # kd h > 1: short waves come round undiminished, so that any delay is too much
    assert linear(CACC(kd=1.0, h=1.5)).delay_margin == 0.0
    assert linear(IDM).gain_margin == math.inf


def test_few_nodes_miss_no_root():
    """Fast oscillations in a long memory: all four unstable roots, by the turns of the function on the axis."""
    roots = rightmost(QuasiPolynomial.of((1.0, 2, 0.0), (100.0, 0, 0.0), (0.5, 1, 20.0)))
    assert np.count_nonzero(roots.roots.real > 0) == 4
    assert roots.residual < 1e-12


@pytest.mark.parametrize("delay", [150.0, {"s": 150.0, "dv": 100.0}])
def test_long_delays_are_resolved(delay):
    found = linear(IDM, delay=delay)
    assert not found.locally_stable
    assert found.roots.residual < 1e-12
    omega = np.linspace(1e-4, 3.0, 200_001)
    assert found.peak.gain >= np.max(found.gain(omega)) * (1 - 1e-12)
    radio = linear(CACC, delay={"vl": 150.0, "al": 150.0})
    assert radio.peak_gain >= np.max(radio.gain(omega)) * (1 - 1e-12)


def test_first_of_several_critical_delays():
    """Late damping of a spring: unstable and stable by turns; the first loss is meant."""
    model = FVDM(alpha=1.0, lam=1.05, v0=40.0, h=10.0, w=10.0)
    speed = model.equilibrium_speed(10.0)
    found = linear(model, speed, delay={"dv": 1.0})
    critical = found.critical_delay("local")
    delays = np.arange(0.1, 12.0, 0.1)
    stable = np.array([found.slowed(t).locally_stable for t in delays])
    assert np.all(stable[delays < critical])
    assert not found.slowed(critical * 1.01).locally_stable
    assert np.count_nonzero(np.diff(stable.astype(int)) == 1) >= 1  # it is regained later


def test_least_parameter_is_at_the_boundary():
    for found, name in ((linear(IDM, 10.0, delay=0.5), "T"), (linear(OVM, delay=0.01), "alpha")):
        value = found.critical(name)
        verdicts = []
        for factor in (0.9999, 1.0001):
            model = found.vehicle.model.replace(**{name: value * factor})
            verdicts.append(hw.linearize(dataclasses.replace(found.vehicle, model=model), found.speed).string_stable)
        assert verdicts == [False, True]


def test_short_waves_of_a_string():
    car = hw.Vehicle(CACC(ka=2.0))
    chain = hw.head_to_tail([car] * 3, 23.0)
    assert chain.peak.frequency == math.inf
    assert chain.peak.gain == pytest.approx((2.0 / 1.375) ** 3, rel=1e-4)
    with pytest.raises(hw.HeadwayError, match="at least one vehicle"):
        hw.head_to_tail([], 23.0)


@hw.model
def one_sided(s, v, dv, *, k=0.2, T=1.2):
    return k * (s - 2.0 - T * v) + 0.6 * max(dv, 0.0)


@hw.model
def switched(s, v, dv, *, k=0.2, T=1.2):
    return (k if v < 23 else 2 * k) * (s - 2.0 - T * v) + 0.6 * dv


@hw.model
def stepped(s, v, dv, *, k=0.2, T=1.2):
    return k * (s - 2.0 - T * v) + 0.6 * dv + (0.1 if v > 23 else 0.0)


@pytest.mark.parametrize(("law", "speed", "words"), [
    (one_sided, 20.0, "derivative by dv is 0 just below and 0.6 just above; linear theory takes 0.6"),
    (switched, 23.0, "derivative by s is, in v, 0.2 just below and 0.4 just above; linear theory takes 0.4"),
    (stepped, 23.0, "m/s² as v grows"),
])  # fmt: skip
def test_corners_are_named(law, speed, words):
    with pytest.warns(hw.HeadwayWarning, match="at .* m/s and .* m") as said:
        found = hw.linearize(hw.Vehicle(law), speed)
    assert len(said) == 1
    assert words in str(said[0].message)
    assert str(said[0].message).startswith(law.name)
    if law is not one_sided:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            hw.linearize(hw.Vehicle(law), 20.0)
            found.critical("T")


@pytest.mark.parametrize("model", [IDM, IDM(delta=1.0), IDM(delta=7.5), IDMSpacing, OVM, FVDM, CACC])
@pytest.mark.parametrize("speed", [0.0, 1e-3, 5.0, 23.0, 33.0])
def test_built_in_laws_have_no_corners(model, speed):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        linear(model, speed)
        linear(GMM(m=2.0), speed, 15.0)
