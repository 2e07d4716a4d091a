"""Growth, phase, shape and decay of disturbances against cases with a known answer, and against linear theory."""

from __future__ import annotations

import math

import numpy as np
import pytest
import xarray as xr
from hypothesis import given, settings
from hypothesis import strategies as st
from made import made

import headway as hw
from headway.errors import HeadwayError
from headway.metrics import decay, growth, spacing

OMEGA = 0.63
TIME = np.linspace(0.0, 60.0, 3001)


def waves(amplitudes, lags, time=TIME, omega=OMEGA, mean=23.0, trend=0.0):
    """Speeds of sinusoids with these amplitudes [m/s] and lags [rad] to the leader."""
    a, phi = np.asarray(amplitudes)[:, None], np.asarray(lags)[:, None]
    return made(time, speed=mean + trend * time + a * np.sin(omega * time - phi))


# -- steady oscillations ---------------------------------------------------------------------------


def test_growth_and_lag_of_sinusoids():
    tr = waves([2.0, 1.5, 3.0], [0.0, 0.7, 1.9], trend=-0.05)
    np.testing.assert_allclose(growth.amplitude_growth(tr, omega=OMEGA)[1:], [0.75, 2.0], rtol=1e-10)
    np.testing.assert_allclose(growth.amplitude_growth(tr, omega=OMEGA, to="leader"), [1, 0.75, 1.5], rtol=1e-10)
    np.testing.assert_allclose(growth.phase_lag(tr, omega=OMEGA)[1:], [0.7, 1.2], rtol=1e-10)
    np.testing.assert_allclose(growth.phase_lag(tr, omega=OMEGA, to="leader"), [0, 0.7, 1.9], atol=1e-10)
    np.testing.assert_allclose(growth.time_lag(tr, omega=OMEGA)[1:], np.array([0.7, 1.2]) / OMEGA, rtol=1e-10)
    assert np.isnan(growth.amplitude_growth(tr, omega=OMEGA)[0])
    c = growth.fundamental(tr, omega=OMEGA)
    np.testing.assert_allclose(np.abs(c), [2.0, 1.5, 3.0], rtol=1e-10)
    np.testing.assert_allclose(np.angle(c[0]), -math.pi / 2, rtol=1e-10)  # a sine lags a cosine by a quarter
    assert c.attrs["units"] == "m/s"


def test_lag_unwraps_down_the_string():
    tr = waves([1.0] * 8, 2.5 * np.arange(8))
    np.testing.assert_allclose(growth.phase_lag(tr, omega=OMEGA, to="leader"), 2.5 * np.arange(8), atol=1e-9)
    np.testing.assert_allclose(growth.phase_lag(waves([1, 1, 1], [0, 4.0, 3.0]), omega=OMEGA)[1:], [4.0, -1.0])


@settings(max_examples=40)
@given(
    growth_=st.floats(0.05, 5.0),
    lag=st.floats(-1.4, 4.6),
    omega=st.floats(0.3, 3.0),
    trend=st.floats(-1.0, 1.0),
    seed=st.integers(0, 99),
)
def test_growth_needs_no_even_samples(growth_, lag, omega, trend, seed):
    time = np.sort(np.random.default_rng(seed).uniform(0.0, 50.0, 1200))
    tr = waves([1.0, growth_], [0.0, lag], time, omega, trend=trend)
    assert float(growth.amplitude_growth(tr, omega=omega)[1]) == pytest.approx(growth_, rel=1e-8)
    assert float(growth.phase_lag(tr, omega=omega)[1]) == pytest.approx(lag, abs=1e-7)


def test_signals_that_the_leader_lacks_start_at_the_first_follower():
    time, none = TIME, np.full(TIME.size, np.nan)
    tr = made(time, spacing_error=[none, np.sin(OMEGA * time), 0.5 * np.sin(OMEGA * time - 3.0)])
    np.testing.assert_allclose(growth.amplitude_growth(tr, "spacing_error", OMEGA, to="leader"), [np.nan, 1.0, 0.5])
    np.testing.assert_allclose(growth.phase_lag(tr, "spacing_error", OMEGA, to="leader"), [np.nan, 0, 3], atol=1e-9)


def test_distortion_of_two_harmonics_and_of_a_square_wave():
    v = 20 + 2.0 * np.sin(OMEGA * TIME) + 0.6 * np.sin(2 * OMEGA * TIME + 1) + 0.2 * np.cos(5 * OMEGA * TIME)
    square = 20 + np.sign(np.sin(OMEGA * TIME))
    thd = growth.harmonic_distortion(made(TIME, speed=[v, square]), omega=OMEGA)
    assert float(thd[0]) == pytest.approx(math.hypot(0.3, 0.1), rel=1e-9)
    odd = math.sqrt(sum(1 / k**2 for k in (3, 5, 7, 9)))  # the harmonics up to the tenth
    assert float(thd[1]) == pytest.approx(odd, rel=2e-3)
    assert float(growth.harmonic_distortion(waves([1.0], [0.0]), omega=OMEGA)[0]) < 1e-10


def test_describing_function_of_a_cubic():
    """y = x - k x³ answers A sin with the fundamental A (1 - 3/4 k A²)."""
    amplitudes = np.array([0.1, 1.0, 2.0])
    runs = []
    for a in amplitudes:
        x = a * np.sin(OMEGA * TIME)
        runs.append(made(TIME, speed=[20 + x, 20 + x - 0.05 * x**3]))
    expected = 1 - 0.75 * 0.05 * amplitudes**2
    found = growth.describing_function(runs, omega=OMEGA)
    assert found.dims == ("run", "vehicle")
    np.testing.assert_allclose(found[:, 1], expected, rtol=1e-9)
    np.testing.assert_allclose(found.input_amplitude[:, 1], amplitudes, rtol=1e-9)
    together = growth.describing_function(xr.concat(runs, dim="amplitude"), omega=OMEGA)
    np.testing.assert_array_equal(together.values, found.values)
    assert together.input_amplitude.attrs["units"] == "m/s"


@pytest.mark.parametrize(
    ("car", "speed", "omega"),
    [
        (hw.Vehicle(hw.models.IDM(), delay=0.15), 23.0, 0.63),
        (hw.Vehicle(hw.models.IDM(T=1.0), delay=1.0, lag=0.2), 20.0, 1.0),
        (hw.Vehicle(hw.models.CACC(), delay={"vl": 0.15, "al": 0.15}), 23.0, 0.63),
        (hw.Vehicle(hw.models.OVM(alpha=2.5)), 16.0, 0.5),
    ],
    ids=["idm", "idm-late", "cacc", "ovm"],
)
def test_simulated_platoon_agrees_with_linear_theory(car, speed, omega):
    scenario = hw.Scenario(hw.sine(mean=speed, amplitude=1e-3, omega=omega), [car] * 3, duration=150, output_step=0.05)
    tr, lin = hw.simulate(scenario), hw.linearize(car, speed)
    np.testing.assert_allclose(growth.amplitude_growth(tr)[1:], lin.gain(omega), rtol=1e-4)
    np.testing.assert_allclose(growth.phase_lag(tr)[1:], lin.phase_lag(omega), rtol=1e-4)


def test_nonlinearity_shows_in_distortion_and_gain():
    car = hw.Vehicle(hw.models.IDM())
    runs = hw.simulate_many(
        [
            hw.Scenario(hw.sine(mean=23, amplitude=a, omega=0.3), [car] * 2, duration=120, output_step=0.1)
            for a in (0.01, 4.0)
        ]
    )
    gain = growth.describing_function(runs)
    assert abs(gain[0, 1] / hw.linearize(car, 23).gain(0.3) - 1) < 1e-4 < 10 * abs(gain[1, 1] / gain[0, 1] - 1)
    weak, strong = (growth.harmonic_distortion(run)[1] for run in runs)
    assert weak < 0.01 < strong


# -- decay -----------------------------------------------------------------------------------------


def resting(time, *, until=5.0):
    """Speed of a leader that moves until then."""
    return np.where(time < until, 20 + np.sin(2 * np.pi * time / until), 20.0)


@given(xi=st.floats(0.02, 0.6), omega=st.floats(0.8, 3.0), offset=st.floats(-20, 20), phase=st.floats(0, 6.2))
def test_decrement_of_a_damped_cosine(xi, omega, offset, phase):
    time = np.linspace(0, 60, 6001)
    y = offset + 3 * np.exp(-xi * omega * time) * np.cos(omega * math.sqrt(1 - xi**2) * time + phase)
    tr = made(time, speed=[resting(time)] * 2, spacing_error=[np.full_like(time, np.nan), y])
    delta = float(decay.logarithmic_decrement(tr, after=0.0)[1])
    assert delta == pytest.approx(2 * math.pi * xi / math.sqrt(1 - xi**2), rel=1e-4)


def test_decrement_of_a_simulated_platoon_and_without_oscillation():
    car = hw.Vehicle(hw.models.OVM(alpha=1.0))
    lin = hw.linearize(car, 23.0)
    tr = hw.simulate(hw.Scenario(hw.step(mean=23, change=-1e-3), [car], duration=60))
    xi = lin.damping_ratio
    expected = 2 * math.pi * xi / math.sqrt(1 - xi**2)
    assert float(decay.logarithmic_decrement(tr)[1]) == pytest.approx(expected, rel=1e-3)
    assert np.isnan(decay.logarithmic_decrement(tr)[0])
    time = np.linspace(0, 30, 301)
    creeping = made(time, speed=[resting(time)] * 2, spacing_error=[np.full_like(time, np.nan), np.exp(-time)])
    assert np.isnan(decay.logarithmic_decrement(creeping)[1])


def test_settling_of_an_exponential():
    time = np.linspace(0, 60, 6001)
    y = np.where(time < 5, time / 5, np.exp(-0.3 * (time - 5)))
    unsettled = np.sin(time)
    speed = resting(time)
    tr = made(time, speed=[speed] * 4, spacing_error=[np.full_like(time, np.nan), y, unsettled, 0 * time])
    found = decay.settling_time(tr)
    assert float(found[1]) == pytest.approx(math.log(20) / 0.3, abs=1e-4)
    assert np.isnan(found[[0, 2]]).all()
    assert float(found[3]) == 0.0
    assert float(decay.settling_time(tr, after=1.0)[1]) == pytest.approx(4 + math.log(20) / 0.3, abs=1e-4)
    assert float(decay.settling_time(tr, band=0.01)[1]) == pytest.approx(math.log(100) / 0.3, abs=1e-4)


@pytest.mark.parametrize("change", [5.0, -5.0])
def test_overshoot_of_a_second_order_step(change):
    time, xi, omega = np.linspace(0, 60, 3001), 0.3, 1.0
    w = omega * math.sqrt(1 - xi**2)
    answer = 1 - np.exp(-xi * omega * time) * (np.cos(w * time) + xi * omega / w * np.sin(w * time))
    step = np.where(time > 0, 1.0, 0.0)
    found = decay.overshoot(made(time, speed=[20 + change * step, 20 + change * answer, 20 + 0 * time]))
    np.testing.assert_allclose(found, [0, math.exp(-math.pi * xi / math.sqrt(1 - xi**2)), 0], rtol=1e-6)


def test_norms_are_ratios_of_deviations():
    time = np.linspace(0, 4 * np.pi, 4001)
    tr = made(time, speed=20 + np.array([[2.0], [1.0], [3.0]]) * np.sin(time))
    for ratio in (decay.l2_ratio, decay.linf_ratio):
        np.testing.assert_allclose(ratio(tr), [np.nan, 0.5, 3.0], rtol=1e-9)
        np.testing.assert_allclose(ratio(tr, to="leader"), [1.0, 0.5, 1.5], rtol=1e-9)
    # a pulse and a pulse of half the height and twice the length: L2 says 1/√2, L∞ says 1/2
    pulse = np.clip(1 - np.abs(time - 3), 0, None)
    wide = 0.5 * np.clip(1 - np.abs(time - 3) / 2, 0, None)
    pulses = made(time, speed=[20 + pulse, 20 + wide])
    assert float(decay.l2_ratio(pulses)[1]) == pytest.approx(math.sqrt(0.5), rel=1e-4)
    assert float(decay.linf_ratio(pulses)[1]) == pytest.approx(0.5, rel=2e-3)
    about = decay.linf_ratio(pulses, about=19.0)
    assert float(about[1]) == pytest.approx(1.5 / 2.0, rel=2e-3)


def test_norms_compare_until_the_collision():
    time = np.linspace(0, 20, 2001)
    ahead = 20 + np.sin(time)
    own = np.where(time < 5, 20 + 0.5 * np.sin(time), np.nan)
    assert float(decay.l2_ratio(made(time, speed=[ahead, own]))[1]) == pytest.approx(0.5, rel=1e-12)


# -- spacing ---------------------------------------------------------------------------------------


def test_steady_error_is_a_mean_over_the_window():
    time, none = np.linspace(0, 8 * np.pi, 8001), np.full(8001, np.nan)
    tr = made(time, spacing_error=[none, 1.5 + np.sin(time), np.where(time < 22, 0, 2.0)])
    assert float(spacing.steady_error(tr, window=(4 * np.pi, 8 * np.pi))[1]) == pytest.approx(1.5, rel=1e-12)
    assert float(spacing.steady_error(tr)[2]) == pytest.approx(2.0)
    assert np.isnan(spacing.steady_error(tr)[0])


def test_time_gap_and_its_least():
    time, none = np.linspace(0, 10, 1001), np.full(1001, np.nan)
    tr = made(time, gap=[none, 20 + np.cos(time), 10 + 0 * time], speed=[20 + 0 * time, 10 + 0 * time, 0 * time])
    np.testing.assert_allclose(spacing.time_gap(tr)[1], 2 + 0.1 * np.cos(time))
    np.testing.assert_allclose(spacing.least_time_gap(tr), [np.nan, 1.9, np.inf], rtol=1e-9)


def test_throughput_at_equilibrium():
    car = hw.Vehicle(hw.models.IDM(), length=4.0)
    gap = (2 + 1.5 * 20) / math.sqrt(1 - (20 / 33.33) ** 4)
    assert spacing.throughput(car, 20.0) == pytest.approx(3600 * 20 / (gap + 4), rel=1e-12)
    assert spacing.throughput(car.model, 20.0, length=6.0) == pytest.approx(3600 * 20 / (gap + 6), rel=1e-12)
    np.testing.assert_allclose(spacing.throughput(car, [20.0, 40.0]), [3600 * 20 / (gap + 4), np.nan])
    assert spacing.throughput(hw.models.GMM(), 10.0, gap=15.0) == pytest.approx(3600 * 10 / 20)
    with pytest.raises(HeadwayError, match="no equilibrium"):
        spacing.throughput(car, 40.0)


# -- what cannot be measured -----------------------------------------------------------------------

NONE = np.full(TIME.size, np.nan)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: growth.amplitude_growth(made(TIME, gap=[NONE, TIME])), "needs the variable 'speed'; this dataset has"),
        (lambda: growth.amplitude_growth(waves([0.0, 1.0], [0, 0]), omega=OMEGA), "amplitude of zero at 0.63 rad/s"),
        (lambda: growth.phase_lag(waves([0.0, 0.0], [0, 0]), omega=OMEGA), "vehicle 0 has an amplitude of zero"),
        (lambda: growth.harmonic_distortion(waves([0.0], [0]), omega=OMEGA), "amplitude of zero"),
        (lambda: growth.phase_lag(waves([1.0, 1.0], [0, 0]), omega=0.1), "record from 0 to 60 s is shorter than one"),
        (lambda: growth.fundamental(waves([1.0], [0]), omega=1, window=(3, 9)), "window from 3 to 9 s is shorter than"),
        (lambda: growth.fundamental(waves([1.0], [0]), omega=1, window=(3, 99)), "not a part of the record, 0 to 60 s"),
        (lambda: growth.fundamental(waves([1.0], [0]), omega=1, window=5), "window = 5 is not a pair"),
        (lambda: growth.fundamental(waves([1.0], [0])), "needs omega, the forcing frequency in rad/s; the data"),
        (lambda: growth.fundamental(waves([1.0], [0]), omega=0), "omega = 0 is not positive"),
        (lambda: growth.fundamental(waves([1.0], [0], TIME[::200]), omega=2.0), "0.8 samples a period of 2 rad/s"),
        (lambda: growth.amplitude_growth(waves([1.0, 1.0], [0, 0]), omega=1, to="lead"), "did you mean 'leader'"),
        (lambda: growth.fundamental(made(TIME, speed=[TIME, NONE]), omega=1), "'speed' of no follower is known"),
        (
            lambda: growth.fundamental(made(TIME, speed=[TIME, np.where(TIME < 40, TIME, np.nan)]), omega=1),
            r"from 34.8673 to 60 s; they have all collided",
        ),
        (lambda: growth.describing_function([]), "at least one run"),
        (lambda: growth.fundamental(waves([1.0], [0]).isel(vehicle=0), omega=1), "needs the dimension vehicle"),
        (lambda: growth.fundamental(waves([1.0], [0]).isel(time=slice(0, 0)), omega=1), "no times"),
        (lambda: growth.fundamental(waves([1.0], [0], TIME[::-1]), omega=1), "do not rise"),
        (lambda: decay.l2_ratio(waves([0.0, 1.0], [0, 0])), "vehicle 0 has an amplitude of zero"),
        (lambda: decay.overshoot(waves([0.0, 1.0], [0, 0])), "does not change"),
        (lambda: decay.settling_time(waves([1.0, 1.0], [0, 0]), "speed"), "changes until the record ends; give after"),
        (lambda: decay.settling_time(waves([1.0, 1.0], [0, 0]), "speed", after=60), "after = 60 s is not within"),
        (lambda: decay.overshoot(waves([1.0, 1.0, 1.0], [0, 0, 0]).isel(vehicle=[1, 2])), "vehicle 0, is not in this"),
        (lambda: decay.linf_ratio(waves([1.0, 1.0, 1.0], [0, 0, 0]).isel(vehicle=[0, 2])), "follow one another"),
        (lambda: spacing.steady_error(made(TIME, policy_error=[NONE, NONE]), "policy_error"), "no equilibrium gap"),
        (lambda: spacing.throughput(hw.models.IDM(), 10.0, length=-1), "length = -1 m is negative"),
    ],
)  # fmt: skip
def test_what_cannot_be_measured_is_said(call, message):
    with pytest.raises(HeadwayError, match=message):
        call()


def test_omega_is_that_of_the_scenario():
    car = hw.Vehicle(hw.models.IDM())
    tr = hw.simulate(hw.Scenario(hw.sine(mean=23, amplitude=1, omega=0.63), [car], duration=30))
    np.testing.assert_array_equal(growth.amplitude_growth(tr), growth.amplitude_growth(tr, omega=0.63))
    with pytest.raises(HeadwayError, match="a step leader has no single frequency"):
        growth.amplitude_growth(hw.simulate(hw.Scenario(hw.step(mean=23, change=1), [car], duration=30)))


# -- what is no steady oscillation -------------------------------------------------------------------


def test_a_car_that_stops_has_no_growth_and_says_so():
    """Behind a large swing an unstable platoon comes to rest; a fit through standstill is no amplitude."""
    car = hw.Vehicle(hw.models.IDM(a=0.5), delay=1.0)
    run = hw.simulate(hw.Scenario(hw.sine(mean=6, amplitude=4, omega=0.3), [car] * 6, duration=120))
    stopped = (run.speed.sel(time=slice(60, None)) == 0).any("time").values
    broken = np.isfinite(run.collision_time.values)
    assert (stopped | broken)[1:].any()
    bad = np.logical_or.accumulate(broken) | (stopped & (run.vehicle.values > 0))
    for measure in (growth.amplitude_growth, growth.phase_lag, growth.time_lag):
        values = measure(run, to="leader")
        assert np.isnan(values.values[bad]).all()
        assert "no steady oscillation from" in values.attrs["note"]
        if (stopped & ~np.logical_or.accumulate(broken)).any():
            assert "standing still for a time" in values.attrs["note"]
    assert np.isnan(growth.harmonic_distortion(run).values[bad]).all()
    # how far it went is known all the same
    assert np.isfinite(decay.linf_ratio(run, to="leader").values[1:][stopped[1:]]).all()


def test_a_signal_that_does_not_swing_has_no_growth():
    time = np.linspace(0.0, 60.0, 1201)
    leader = 20.0 + np.cos(time)
    drift = 20.0 + 0.01 * np.cos(time) + np.where(time < 45.0, 0.0, 3.0)
    run = made(time, speed=[leader, drift, 20.0 + 0.5 * np.cos(time - 0.4)])
    values = growth.amplitude_growth(run, omega=1.0, to="leader")
    assert np.isnan(values[1])
    assert float(values[2]) == pytest.approx(0.5, rel=1e-6)
    assert "vehicle 1 not swinging steadily" in values.attrs["note"]
    behind = growth.amplitude_growth(run, omega=1.0)
    assert np.isnan(behind[2])  # compared with one that has no amplitude
    assert "note" not in growth.amplitude_growth(run.isel(vehicle=[0]).assign_coords(vehicle=[0]), omega=1.0).attrs
