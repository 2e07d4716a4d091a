"""Answers in time: against closed forms, against a power series of the delay equation, and the norms built on them."""

from __future__ import annotations

import math

import numpy as np
import pytest

import headway as hw
from headway.models import CACC, GMM, IDM, OVM


def linear(model, speed=23.0, gap=None, **vehicle):
    return hw.linearize(hw.Vehicle(model, **vehicle), speed, gap)


@hw.model
def oscillator(s, v, *, f_s=1.44, f_v=-0.72):
    return f_s * (s - 20.0) + f_v * (v - 15.0)


def unit_gmm(delay):
    """h' = 1(t - τ) - h(t - τ)."""
    return linear(GMM(alpha=1.0, m=0, l=0), gap=15.0, delay=delay)


def series(found, t):
    """Step answer as Σ (-1)^k N (D - c p^n)^k / (c p^n)^(k+1) / p, every term t^m/m! from its delay on."""
    top, bottom = ({(n, tau): c for c, n, tau in q.terms} for q in (found.numerator, found.characteristic))
    degree = max(n for n, _ in bottom)
    pivot = bottom.pop((degree, 0.0))
    value, term, sign = 0.0, {key: c / pivot for key, c in top.items()}, 1.0
    for k in range(1, 90):
        for (n, tau), c in term.items():
            m = k * degree - n
            if t >= tau and m <= 170:  # beyond, the factorial is larger than any number and the term than none
                value += sign * c * (t - tau) ** m / math.factorial(m)
        product: dict[tuple[int, float], float] = {}
        for (n, tau), c in term.items():
            for (m, late), d in bottom.items():
                key = (n + m, round(tau + late, 12))
                if key[1] <= t:
                    product[key] = product.get(key, 0.0) + c * d / pivot
        term, sign = product, -sign
    return value


def test_oscillator_without_delay():
    found = linear(oscillator, 15.0)
    t = np.linspace(0.0, 40.0, 301)
    xi, w0 = 0.3, 1.2
    wd = w0 * math.sqrt(1 - xi**2)
    g = w0**2 / wd * np.exp(-xi * w0 * t) * np.sin(wd * t)
    h = 1 - np.exp(-xi * w0 * t) * (np.cos(wd * t) + xi * w0 / wd * np.sin(wd * t))
    assert np.max(np.abs(found.impulse_response(t) - g)) < 1e-11
    assert np.max(np.abs(found.step_response(t) - h)) < 1e-11
    assert found.direct == ()


def test_critical_damping_has_a_double_root():
    found = linear(oscillator(f_s=0.25, f_v=-1.0), 15.0)
    t = np.linspace(0.0, 100.0, 201)
    assert np.max(np.abs(found.impulse_response(t) - 0.25 * t * np.exp(-0.5 * t))) < 1e-11
    assert found.impulse_norm == pytest.approx(1.0, abs=2e-9)


@pytest.mark.parametrize(
    ("vehicle", "until"),
    [
        ({"model": IDM, "delay": 1.1}, 14.0), ({"model": IDM, "delay": {"s": 0.5, "dv": 0.9}}, 6.0),
        ({"model": IDM, "delay": {"s": 0.6, "vl": 0.6, "v": 0.13}}, 4.0),
        ({"model": IDM, "delay": 0.3, "lag": 0.5}, 3.0), ({"model": CACC, "delay": {"vl": 0.4, "al": 0.7}}, 3.0),
        ({"model": CACC, "delay": {"a": 0.3}}, 1.3), ({"model": CACC, "delay": 0.2, "lag": 0.6}, 3.0),
        ({"model": OVM(alpha=3.0, v0=20.0, h=25.0, w=12.0), "delay": {"s": 0.2, "v": 0.07}}, 3.0),
    ],
)  # fmt: skip
def test_delays_agree_with_the_series(vehicle, until):
    found = linear(**vehicle)
    t = np.linspace(0.011, until, 37)
    expected = np.array([series(found, x) for x in t])
    assert np.max(np.abs(found.step_response(t) - expected)) < 1e-10


def test_scalar_delay_equation_piece_by_piece():
    found = unit_gmm(1.0)
    t = np.linspace(0.0, 12.0, 97)
    exact = [1 - sum((-1) ** k * max(x - k, 0.0) ** k / math.factorial(k) for k in range(13) if x >= k) for x in t]
    slope = [sum((-1) ** k * (x - k - 1) ** k / math.factorial(k) for k in range(12) if x > k + 1) for x in t + 1e-9]
    assert np.max(np.abs(found.step_response(t) - exact)) < 1e-10
    assert np.max(np.abs(found.impulse_response(t + 1e-9) - slope)) < 1e-9


@pytest.mark.parametrize("delay", [1.2, 3.5, 150.0])
def test_modes_and_growth_go_on_where_pieces_end(delay):
    """Laplace transform of g at a point right of all roots is G, also far beyond where the modes take over."""
    found = linear(IDM, delay=delay)
    p = max(found.rightmost_root.real, 0.0) + 8.0 / delay
    t = np.linspace(0.0, 40.0 / (p - max(found.rightmost_root.real, 0.0)), 400_001)
    g = found.impulse_response(t) * np.exp(-p * t)
    total = np.sum((g[::2][:-1] + 4 * g[1::2] + g[::2][1:]) * (t[1] - t[0]) / 3)
    assert total == pytest.approx(complex(found.transfer(p)).real, abs=1e-7)


def test_nothing_happens_before_and_any_shape_will_do():
    found = linear(CACC, delay={"vl": 0.2, "al": 0.2})
    assert found.step_response(-1.0) == 0.0
    assert found.impulse_response(np.full((2, 3), -0.5)).shape == (2, 3)
    # ka / (1 + kd h) of the leader's acceleration passes straight through
    assert found.direct == ((0.2, pytest.approx(0.5 / 1.375)),)
    assert found.step_response(0.2 + 1e-9) - found.step_response(0.2 - 1e-9) == pytest.approx(0.5 / 1.375, abs=1e-7)


def test_echoes_of_a_late_own_acceleration():
    found = linear(CACC, delay={"a": 0.3})
    expected = [(0.3 * k, 0.5 * (-0.375) ** k) for k in range(5)]
    assert np.array(found.direct[:5]) == pytest.approx(np.array(expected))


@pytest.mark.parametrize("xi", [0.05, 0.3, 0.9, 1.5])
def test_norm_is_the_overshoots(xi):
    found = linear(oscillator(f_s=1.44, f_v=-2.4 * xi), 15.0)
    m = math.exp(-math.pi * xi / math.sqrt(1 - xi**2)) if xi < 1 else 0.0
    assert found.impulse_norm == pytest.approx((1 + m) / (1 - m), rel=1e-9)
    assert found.peak_stable == (xi > 1)


@pytest.mark.parametrize("vehicle", [
    {"model": IDM, "delay": 1.15}, {"model": IDM, "delay": 2.7}, {"model": CACC, "delay": 0.2},
    {"model": CACC, "delay": {"vl": 0.4, "al": 0.4}, "lag": 0.3},
])  # fmt: skip
def test_norm_is_the_variation_of_the_step_answer(vehicle):
    found = linear(**vehicle)
    jumps = np.array([d for d, _ in found.direct])
    t = np.concatenate([np.linspace(0.0, 20.0 / found.decay_rate, 300_001), jumps - 1e-12, jumps + 1e-12])
    h = found.step_response(np.unique(np.maximum(t, 0.0)))
    assert found.impulse_norm == pytest.approx(abs(h[0]) + np.sum(np.abs(np.diff(h))), rel=1e-6)


@pytest.mark.parametrize(("c_tau", "calm"), [(0.2, True), (0.36, True), (0.38, False), (0.45, False)])
def test_peaks_grow_as_soon_as_gmm_swings(c_tau, calm):
    """Herman: from Cτ = 1/e on it oscillates, up to 1/2 no frequency grows; in between peaks grow all the same."""
    found = unit_gmm(c_tau)
    assert found.string_stable
    assert found.peak_stable is calm
    assert found.impulse_norm >= 1.0 - 1e-9


def test_peaks_ask_for_more_than_frequencies():
    cacc = linear(CACC)
    assert cacc.string_stable
    assert not cacc.peak_stable
    assert cacc.impulse_norm == pytest.approx(1.0018993929, abs=1e-9)
    assert linear(IDM, delay=3.0).impulse_norm == math.inf


def test_eigenvalues_are_the_papers():
    found = linear(IDM)
    w0, xi = found.natural_frequency, found.damping_ratio
    root = math.sqrt(xi**2 - 1)
    assert found.eigenvalues == pytest.approx((w0 * (-xi + root), w0 * (-xi - root)))
    swings = linear(oscillator, 15.0).eigenvalues
    assert swings == pytest.approx((-0.36 + 1.2j * math.sqrt(0.91), -0.36 - 1.2j * math.sqrt(0.91)))
