"""Safety measures of encounters that are solved on paper."""

from __future__ import annotations

import contextlib
import math
import warnings

import numpy as np
import pytest
import xarray as xr
from hypothesis import given, settings
from hypothesis import strategies as st
from made import encounter, made
from scipy.integrate import quad
from scipy.stats import truncnorm

import headway as hw
from headway.errors import HeadwayError
from headway.library import library_scenario
from headway.metrics import METRICS, safety

MEASURES = (safety.ttc, safety.tet, safety.tit, safety.drac, safety.mdrac, safety.picud, safety.cpi, safety.rss_margin,
            safety.least_gap)  # fmt: skip


def one(array):
    """The value of the only follower; the leader has none."""
    assert np.isnan(array[0])
    return float(array[1])


def closing(end=8.0, step=0.01, gap=50.0, ahead=20.0, speed=25.0):
    """A gap that closes at a constant 5 m/s: s = 50 - 5 t."""
    time = np.arange(0.0, end + 0.5 * step, step)
    return encounter(time, gap - (speed - ahead) * time, speed, ahead)


# -- an encounter at constant closing speed --------------------------------------------------------


def test_constant_closing_speed():
    """TTC = 10 - t, so that it is below 3 s from t = 7 on; at t = 8 the gap is 10 m and TTC 2 s."""
    tr = closing()
    np.testing.assert_allclose(safety.time_to_collision(tr)[1], 10 - tr.time, rtol=1e-9)
    assert one(safety.ttc(tr)) == pytest.approx(2.0)
    assert one(safety.tet(tr)) == pytest.approx(1.0, rel=1e-9)
    assert one(safety.tit(tr)) == pytest.approx(0.5, rel=1e-9)
    assert one(safety.tet(tr, threshold=5.0)) == pytest.approx(3.0, rel=1e-9)
    assert one(safety.tit(tr, threshold=5.0)) == pytest.approx(4.5, rel=1e-9)
    assert one(safety.drac(tr)) == pytest.approx(5**2 / (2 * 10))
    assert one(safety.mdrac(tr)) == pytest.approx(5 / (2 * (2 - 1)))
    assert one(safety.picud(tr)) == pytest.approx((20**2 - 25**2) / 6.6 + 10 - 25)
    assert one(safety.least_gap(tr)) == pytest.approx(10.0)
    safe = 25 + 3.5 / 2 + 28.5**2 / 8 - 20**2 / 16
    assert one(safety.rss_margin(tr)) == pytest.approx(10 - safe)
    assert int(safety.collisions(tr)) == 0


@given(step=st.floats(0.05, 1.9), threshold=st.floats(2.1, 9.0), dv=st.floats(0.5, 20.0))
def test_exposure_finds_the_crossing_between_samples(step, threshold, dv):
    time = np.append(np.arange(0.0, 8.0, step), 8.0)
    time = np.unique(time)
    tr = encounter(time, dv * (10.0 - time), 20 + dv, 20.0)
    assert one(safety.tet(tr, threshold)) == pytest.approx(threshold - 2.0, rel=1e-9)
    assert one(safety.tit(tr, threshold)) == pytest.approx((threshold**2 - 4.0) / 2 - 2.0 * (threshold - 2.0), rel=1e-9)


def test_braking_encounter_against_quadrature():
    """The follower brakes at a constant rate: s = 40 - 12 t + t², closing at 12 - 2 t until t = 6."""
    step = 0.02
    time = np.arange(0.0, 9.0 + step / 2, step)
    tr = encounter(time, 40 - 12 * time + time**2, 32 - 2 * time, 20.0)

    def ttc(t):
        return (40 - 12 * t + t**2) / (12 - 2 * t)

    # TTC = 3 where t² - 6 t + 4 = 0; least TTC where its derivative vanishes
    first, last = 3 - math.sqrt(5), 3 + math.sqrt(5)
    least = 6 - 2.0  # (12 - 2t)² = 2 (40 - 12 t + t²): t = 4
    assert one(safety.ttc(tr)) == pytest.approx(ttc(least), rel=1e-6)
    assert one(safety.tet(tr)) == pytest.approx(last - first, abs=step**2)
    area = quad(lambda t: 3 - ttc(t), first, last)[0]
    assert one(safety.tit(tr)) == pytest.approx(area, abs=step**2)
    # dv²/(2 s) = 2 (6 - t)²/(40 - 12 t + t²) is highest at the start, where s(0) = 40
    assert one(safety.drac(tr)) == pytest.approx(12**2 / 80, rel=1e-9)
    assert one(safety.least_gap(tr)) == pytest.approx(4.0, rel=1e-9)
    # after one second of reaction: closing / (2 (TTC - 1))
    rate = [(12 - 2 * t) / (2 * (ttc(t) - 1)) if ttc(t) > 1 else math.inf for t in np.linspace(0, 5.999, 60_000)]
    assert one(safety.mdrac(tr)) == pytest.approx(max(rate), rel=1e-6)
    share = quad(lambda t: 0 if t > 6 else chance(2 * (6 - t) ** 2 / (40 - 12 * t + t * t)), 0, 9, limit=200)[0] / 9
    assert one(safety.cpi(tr)) == pytest.approx(share, abs=1e-4)


def chance(rate, mean=8.45, deviation=1.4, low=4.23, high=12.68):
    """P(MADR <= rate)."""
    return truncnorm.cdf(rate, (low - mean) / deviation, (high - mean) / deviation, mean, deviation)


def test_crash_potential_of_constant_need():
    """s shrinks such that dv²/(2 s) stays 8 m/s²: it stops just in time, and CPI is one probability."""
    time = np.linspace(0, 2.4, 241)
    speed = 8 * (2.5 - time)
    tr = encounter(time, speed**2 / 16, 20 + speed, 20.0)
    assert one(safety.cpi(tr)) == pytest.approx(chance(8.0), rel=1e-9)
    assert one(safety.drac(tr)) == pytest.approx(8.0, rel=1e-9)
    assert one(safety.cpi(tr, mean=8.0, limits=(4.0, 12.0))) == pytest.approx(0.5, rel=1e-9)


def test_a_gap_that_opens_is_safe():
    time = np.linspace(0, 10, 1001)
    tr = encounter(time, 10 + time, 20.0, 21.0)
    assert one(safety.ttc(tr)) == math.inf
    assert np.isinf(safety.time_to_collision(tr)[1]).all()
    for measure in (safety.tet, safety.tit, safety.drac, safety.mdrac, safety.cpi):
        assert one(measure(tr)) == 0.0


def test_no_reaction_time_is_left():
    tr = closing(end=9.5)
    assert one(safety.ttc(tr)) == pytest.approx(0.5)
    assert one(safety.mdrac(tr)) == math.inf
    assert one(safety.mdrac(tr, reaction=0.25)) == pytest.approx(5 / (2 * 0.25), rel=1e-6)


@pytest.mark.parametrize(
    ("v", "ahead", "expected"),
    [
        (20.0, 20.0, 20 + 1.75 + 23.5**2 / 8 - 20**2 / 16),
        (0.0, 0.0, 1.75 + 3.5**2 / 8),
        (5.0, 40.0, 0.0),
    ],
)
def test_rss_distance(v, ahead, expected):
    tr = encounter([0.0, 1.0, 2.0], 30.0, v, ahead)
    assert one(safety.rss_margin(tr)) == pytest.approx(30 - expected, rel=1e-12)
    own = safety.rss_margin(tr, response=0.5, acceleration=2.0, brake=6.0, leader_brake=6.0)
    assert one(own) == pytest.approx(30 - max(0.0, v / 2 + 0.25 + (v + 1) ** 2 / 12 - ahead**2 / 12), rel=1e-12)


# -- collisions ------------------------------------------------------------------------------------


def test_a_collision_is_reported_on_its_own():
    tr = closing(end=12.0)  # the gap is 0 at t = 10 and negative after
    assert safety.collided(tr).values.tolist() == [False, True]
    assert int(safety.collisions(tr)) == 1
    assert one(safety.ttc(tr)) == 0.0
    assert one(safety.least_gap(tr)) == 0.0
    assert one(safety.drac(tr)) == one(safety.mdrac(tr)) == math.inf
    assert float(safety.time_to_collision(tr).min()) > 0
    assert np.isnan(safety.time_to_collision(tr).sel(time=slice(10.0001, None))).all()
    assert one(safety.tet(tr)) == pytest.approx(3.0, abs=0.0101)
    assert one(safety.tit(tr)) == pytest.approx(4.5, abs=0.031)
    assert one(safety.picud(tr)) == pytest.approx((20**2 - 25**2) / 6.6 - 25, abs=0.051)
    before = tr.sel(time=slice(0, 5))
    assert int(safety.collisions(before)) == 0
    assert one(safety.ttc(before)) == pytest.approx(5.0)


def test_what_comes_after_a_contact_does_not_count():
    time = np.linspace(0, 20, 2001)
    tr = encounter(time, 5 + 5.5 * np.cos(time), 20 + 5.5 * np.sin(time), 20.0)
    assert float(safety.collided(tr)[1]) == 1
    assert np.isnan(safety.time_to_collision(tr)[1, 400:]).all()


def test_simulated_collisions():
    tr = hw.simulate(library_scenario("paper:ovm-nonharmonic"))
    hit = np.isfinite(tr.collision_time.values)
    assert hit.any()
    np.testing.assert_array_equal(safety.collided(tr), hit)
    assert int(safety.collisions(tr)) == hit.sum()
    assert (safety.ttc(tr).values[hit] == 0).all()
    assert np.isfinite(safety.picud(tr)[1:]).all()
    # cut before they happen, they have not happened
    early = tr.sel(time=slice(None, float(tr.collision_time.min()) - 0.1))
    assert int(safety.collisions(early)) == 0
    assert (safety.ttc(early)[1:] > 0).all()
    with pytest.raises(HeadwayError, match=r"'gap' of no follower is known from .* they have all collided"):
        safety.ttc(tr.where(tr.vehicle == 0))


@settings(max_examples=40)
@given(
    gap=st.floats(-5.0, 50.0),
    swing=st.floats(0.0, 60.0),
    omega=st.floats(0.2, 3.0),
    phase=st.floats(0.0, 6.3),
    step=st.floats(0.02, 0.3),
)
def test_no_measure_has_an_impossible_sign(gap, swing, omega, phase, step):
    time = np.arange(0.0, 20.0, step)
    s = gap + swing * np.sin(omega * time + phase)
    tr = encounter(time, s, 20 - swing * omega * np.cos(omega * time + phase), 20.0)
    hit = bool((s <= 0).any())
    assert bool(safety.collided(tr)[1]) is hit
    for measure in (safety.ttc, safety.tet, safety.tit, safety.drac, safety.mdrac, safety.cpi, safety.least_gap):
        value = one(measure(tr))
        assert value >= 0 or (np.isnan(value) and s[0] <= 0)
    ttc = safety.time_to_collision(tr)[1]
    assert not (ttc <= 0).any()
    if not hit and np.isfinite(one(safety.ttc(tr))):
        assert one(safety.ttc(tr)) <= float(ttc.min()) * (1 + 1e-12)
        assert one(safety.mdrac(tr)) >= one(safety.drac(tr)) * (1 - 1e-2)


# -- shapes, units, errors -------------------------------------------------------------------------


@pytest.mark.parametrize("measure", MEASURES)
def test_units_names_and_dimensions(measure):
    pairs = [closing(end=8.0), closing(end=8.0, speed=22.0)]
    found = measure(xr.concat(pairs, dim="lane"))
    assert set(found.dims) == {"lane", "vehicle"}
    assert found.attrs["units"]
    assert found.attrs["long_name"]
    for i, pair in enumerate(pairs):
        np.testing.assert_array_equal(found.isel(lane=i).values, measure(pair).values)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (
            lambda d: safety.ttc(d.drop_vars("relative_speed")),
            "ttc needs the variable 'relative_speed'; this dataset",
        ),
        (lambda d: safety.picud(d.drop_vars("speed")), "picud needs the variable 'speed'"),
        (lambda d: safety.least_gap(d.drop_vars("gap")), "least_gap needs the variable 'gap'"),
        (lambda d: safety.tet(d, threshold=0), "tet: threshold = 0 is not positive"),
        (lambda d: safety.picud(d, deceleration=-1), "deceleration = -1 is not positive"),
        (lambda d: safety.mdrac(d, reaction="x"), "reaction = 'x' is not a finite number"),
        (lambda d: safety.cpi(d, limits=(5, 4)), r"limits = \(5, 4\) do not rise"),
        (lambda d: safety.ttc(d.isel(time=0)), "needs the dimension time; 'gap' has vehicle"),
        (lambda d: safety.ttc(made(d.time, speed=d.speed.values)), "this dataset has speed"),
    ],
)
def test_what_cannot_be_measured_is_said(call, message):
    with pytest.raises(HeadwayError, match=message):
        call(closing())


def test_a_gap_that_closes_by_rounding_only_does_not_close():
    time = np.linspace(0, 10, 101)
    tr = encounter(time, 30.0, 20.0 + 1e-12, 20.0)
    assert one(safety.ttc(tr)) == math.inf
    assert np.isinf(safety.time_to_collision(tr)[1]).all()
    slow = encounter(time, 30.0, 20.1, 20.0)
    assert one(safety.ttc(slow)) == pytest.approx(300.0)


def test_no_metric_warns_of_a_run_with_a_collision():
    """Neither scheme leaves NumPy to complain, whatever is measured of what is left."""
    for scheme in ("rk4", "ballistic"):
        leader = hw.brake(mean=23, drop=23, hold=3)
        car = hw.Vehicle(hw.models.IDM(), limits=(-2.0, 1.0))
        run = hw.simulate(hw.Scenario(leader, [car] * 2, duration=10, gaps=5, dt=0.05, scheme=scheme))
        assert np.isfinite(run.collision_time).any()
        with warnings.catch_warnings():
            warnings.simplefilter("error", RuntimeWarning)
            for metric in METRICS.values():
                with contextlib.suppress(HeadwayError):
                    metric.of(run)
