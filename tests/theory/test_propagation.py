"""Convective and absolute instability: values of the literature, vertical lines in the complex plane, a simulation."""

from __future__ import annotations

import math

import numpy as np
import pytest

import headway as hw
from headway.models import CACC, GMM, IDM


def linear(model, speed=23.0, gap=None, **vehicle):
    return hw.linearize(hw.Vehicle(model, **vehicle), speed, gap)


@pytest.mark.parametrize(("speed", "kind", "roadside"), [
    (5.0, "convectively unstable upstream", -0.0258), (10.0, "convectively unstable upstream", -0.00033),
    (15.0, "absolutely unstable", 0.00132),
])  # fmt: skip
def test_idm_of_the_literature(speed, kind, roadside):
    found = linear(IDM(v0=33.3), speed)
    wave = found.propagation()
    assert wave.kind == kind
    assert wave.roadside_ray == pytest.approx(speed / (found.gap + 5.0))
    assert wave.roadside_growth == pytest.approx(roadside, abs=1e-4 * max(1.0, 100 * abs(roadside)))
    assert wave.growth == pytest.approx(float(np.max(found.growth(np.linspace(0.5, 0.6, 41)))), abs=1e-6)
    edges = found.growth(np.array([wave.first_ray, wave.last_ray]))
    assert edges == pytest.approx([0.0, 0.0], abs=1e-11)
    assert wave.upstream_edge < wave.velocity < wave.downstream_edge
    assert wave.velocity == pytest.approx(speed - wave.ray * (found.gap + 5.0))


@pytest.mark.parametrize("found", [
    linear(IDM(v0=33.3), 5.0), linear(IDM, delay=1.5), linear(IDM, delay={"s": 1.5, "vl": 1.5}), linear(IDM),
    linear(CACC(kv=0, ka=0)), linear(GMM, gap=15.0, delay=6.0),
])  # fmt: skip
def test_growth_is_the_best_vertical_line(found):
    """e^{pt} G^n on Re p = a is at most e^{(a + ψ ln max|G|) t}: the least of these bounds touches the saddle."""
    wave = found.propagation()
    rays = wave.ray * np.array([0.8, 1.0, 1.15])
    omega = np.linspace(0.0, 2.5, 3001)
    shifts = np.concatenate([np.linspace(-0.95 * found.decay_rate, 0.0, 150), np.geomspace(1e-4, 1.0, 100)])
    largest = np.array([np.log(np.abs(found.transfer(a + 1j * omega)).max()) for a in shifts])
    bound = np.min(shifts[:, None] + rays * largest[:, None], axis=0)
    assert found.growth(rays) == pytest.approx(bound, abs=2e-5)  # what the two grids resolve


def test_a_simulated_packet_grows_as_fast():
    car = hw.Vehicle(IDM, delay=1.5)
    found = hw.linearize(car, 23.0)
    wave = found.propagation()
    run = hw.simulate(hw.Scenario(hw.window(23.0, 1e-7, 0.64, 2 * math.pi / 0.64), [car] * 60, duration=240.0, dt=0.05))
    t, v = run.time.values, run.speed.values - 23.0
    period = 2 * math.pi / found.peak_frequency
    for ray in (wave.ray, 0.8 * wave.ray):
        first, last = 20, int(min(60, 230 * ray))
        size = [np.max(np.abs(v[n][np.abs(t - n / ray) < period / 2])) for n in (first, last)]
        # the saddle point integral falls as 1/sqrt(n) besides
        rate = (math.log(size[1] / size[0]) + 0.5 * math.log(last / first)) / ((last - first) / ray)
        assert rate == pytest.approx(found.growth(ray), abs=0.03 * wave.growth)


def test_stable_strings_carry_kinematic_waves():
    found = linear(IDM)
    wave = found.propagation()
    assert (wave.kind, wave.growth) == ("stable", 0.0)
    # dv_e/ds is the ray of long waves
    step = 1e-4
    model = found.vehicle.model
    slope = 2 * step / (model.equilibrium_gap(23 + step) - model.equilibrium_gap(23 - step))
    assert wave.ray == pytest.approx(slope, rel=1e-6)
    assert np.all(found.growth(np.linspace(0.1, 1.0, 19)) <= 0.0)
    assert math.isnan(wave.first_ray)


def test_where_there_is_no_packet():
    unstable = linear(IDM, delay=3.0)
    assert unstable.propagation().kind == "locally unstable"
    assert np.all(np.isnan(unstable.growth(np.array([0.1, 0.2]))))
    # everything is 6 s late: a ray of more than 1/6 vehicle per second is ahead of all news
    assert linear(GMM, gap=15.0, delay=6.0).growth(0.2) == -math.inf


def test_short_waves_that_pass_straight_through():
    wave = linear(CACC(ka=2.0)).propagation()
    assert wave.growth == math.inf
    assert wave.last_ray == math.inf
    assert wave.upstream_edge == -math.inf
