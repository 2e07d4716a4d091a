"""Where the paper's mathematics is wrong: its figure and the right one, each from the same numbers."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from linear_systems import RADIO_LATE, linear

import headway as hw
from headway.literature.barhoumi2025 import printed
from headway.models import CACC, GMM, IDM, OVM, IDMSpacing

# -- CACC ------------------------------------------------------------------------------------------


def with_printed_sign(s, v, dv, a, vl, al, *, kp=0.45, kd=0.25, kv=0.5, ka=0.5, h=1.5, r=2.0):
    """The control law with the printed error e = d_des - d."""
    return kp * (r + h * v - s) + kd * (h * a - dv) + kv * (vl - v) + ka * al


with pytest.warns(hw.HeadwayWarning, match="slows down the more the gap opens"):
    as_printed = hw.model(with_printed_sign)


def test_m1_the_printed_sign_of_the_policy_error_has_a_real_positive_root():
    root = linear(as_printed).rightmost_root
    assert root == pytest.approx(1.2541, abs=5e-5)
    assert root.imag == 0.0
    assert not linear(as_printed).locally_stable
    assert linear(CACC).rightmost_root.real == pytest.approx(-0.518182, abs=1e-6)
    # one metre too far behind: the printed error brakes
    assert printed.cacc_policy_error(37.5, 23.0) == -1.0
    assert CACC()(37.5, 23.0, 0.0, 0.0, 23.0, 0.0) > 0


def test_m2_the_rate_of_the_policy_error_contains_the_own_acceleration():
    gains = {"kp": 0.45, "kd": 1.0, "kv": 0.5, "ka": 0.0, "h": 1.5}
    # read literally, with the acceleration of the last step in ė, a step of any length multiplies it by -kd h
    a, demand = 0.0, 0.1
    for _ in range(60):
        a = demand - gains["kd"] * gains["h"] * a
    assert abs(a) > 1e8
    # the loop solved: a = demand / (1 + kd h)
    sc = hw.Scenario(hw.constant(23.0), [hw.Vehicle(CACC(**gains))], duration=30, gap_offsets={1: 0.1 / 0.45})
    result = hw.simulate(sc)
    assert float(result.acceleration[1, 0]) == pytest.approx(0.1 / 2.5, abs=1e-14)
    assert float(np.abs(result.acceleration[1]).max()) == pytest.approx(0.1 / 2.5, abs=1e-14)
    # and linear theory divides by the same loop
    assert linear(CACC(**gains)).natural_frequency == pytest.approx(math.sqrt(0.45 / 2.5))


@given(st.floats(0.0, 1.0), st.floats(0.0, 2.0), st.floats(0.0, 2.5), st.floats(0.02, 1.0))
def test_m8_the_printed_transfer_function_amplifies_a_band_unless_ka_is_1(kd, kv, ka, kp):
    assume(abs(ka - 1) > 0.02)
    edge = math.sqrt(2 * kp / (1 + ka))

    def excess(w):  # |N|² - |D|²
        p = 1j * w
        top = np.abs(kp + kd * p + kv * p + ka * p * p) ** 2
        return top - top / np.abs(printed.cacc_transfer(p, kp=kp, kd=kd, kv=kv, ka=ka)) ** 2

    for w in edge * np.array([0.2, 0.5, 0.9, 1.1, 2.0, 5.0]):
        expected = w * w * (1 - ka) * (2 * kp - (1 + ka) * w * w)
        assert excess(w) == pytest.approx(expected, rel=1e-6, abs=1e-10)
    # below the edge for ka < 1, above it for ka > 1
    gain = np.abs(printed.cacc_transfer(1j * edge * np.array([0.9, 1.1]), kp=kp, kd=kd, kv=kv, ka=ka))
    assert gain[0 if ka < 1 else 1] > 1 > gain[1 if ka < 1 else 0]


def test_m8_for_the_default_gains_the_printed_one_is_unstable_and_the_right_one_stable():
    omega = np.linspace(0.01, 3, 30_000)
    assert np.abs(printed.cacc_transfer(1j * omega)).max() == pytest.approx(1.16774841624, abs=1e-8)
    assert linear(CACC).peak_gain == 1.0
    assert linear(CACC).string_stable


@pytest.mark.parametrize(("kv", "ka", "h", "claim", "truth"), [
    (0.5, 0.5, 1.5, False, True),  # not necessary
    (0.5, 0.2, 0.5, True, False),  # not sufficient
    (1.0, 0.5, 1.5, True, True),
    (0.2, 0.4, 0.5, False, False),
])  # fmt: skip
def test_m8_the_printed_conditions_are_neither_sufficient_nor_necessary(kv, ka, h, claim, truth):
    assert bool(printed.cacc_sufficient(kv, ka)) == claim
    found = linear(CACC(kv=kv, ka=ka, h=h))
    assert found.string_stable == truth
    assert (ka <= 1 + 0.25 * h and ka + kv * h + 0.45 * h * h / 2 >= 1) == truth


def test_m8_nor_are_they_for_the_printed_transfer_function():
    omega = np.linspace(0.01, 3, 3000)
    assert printed.cacc_sufficient(1.0, 0.5)
    assert np.abs(printed.cacc_transfer(1j * omega, kv=1.0, ka=0.5)).max() > 1.05
    # with ka = 1 the printed G is all-pass without delay, and the conditions ask for ka <= kv/2
    assert not printed.cacc_sufficient(1.5, 1.0)
    assert np.abs(printed.cacc_transfer(1j * omega, kv=1.5, ka=1.0)) == pytest.approx(np.ones(3000), abs=1e-12)


def test_m9_the_printed_longest_delay_exists_only_for_some_frequencies_and_is_too_long():
    outside = np.array([0.2, 0.4, 0.63, 0.9, 1.4, 2.0])
    argument = (0.5 * outside**2 - 0.5 * outside**4 - 0.45) / (0.5 * outside**3)
    assert np.all(np.abs(argument) > 1)
    assert np.isnan(printed.cacc_longest_delay(outside, 0.5, 0.5)).all()
    inside = printed.cacc_longest_delay(np.array([1.05, 1.15, 1.25]), 0.5, 0.5)
    assert inside == pytest.approx([2.5108, 2.2874, 2.1728], abs=5e-5)
    true = linear(CACC, delay=RADIO_LATE).critical_delay("string")
    assert true == pytest.approx(1.5125, abs=1e-9)
    assert np.all(inside > true)
    # at the delays that the paper allows a disturbance grows
    assert not linear(CACC, delay={"vl": 2.2, "al": 2.2}).string_stable


@pytest.mark.parametrize(("h", "kd", "limit"), [(1.5, 0.25, 1.5125), (1.0, 0.25, 0.45), (0.8, 0.5, 0.088)])
def test_m9_the_printed_longest_delay_knows_neither_kd_nor_the_time_gap(h, kd, limit):
    # low frequencies decide here: h + kp h²/(2 kv) - (1 - ka)/kv
    assert h + 0.45 * h * h - 1.0 == pytest.approx(limit, abs=1e-12)
    assert linear(CACC(h=h, kd=kd), delay=RADIO_LATE).critical_delay("string") == pytest.approx(limit, abs=1e-8)
    assert printed.cacc_longest_delay(1.15, 0.5, 0.5) == pytest.approx(2.2874, abs=5e-5)  # for all three


# -- IDM -------------------------------------------------------------------------------------------


def test_m3_the_printed_damping_has_two_wrong_signs():
    f = linear(IDM).partials
    assert f["dv"] - f["v"] == pytest.approx(0.5008, abs=5e-5)
    assert linear(IDM).locally_stable
    assert printed.idm_damping(0.0, 1.5) == pytest.approx(-0.4179, abs=5e-5)
    assert printed.idm_damping_sign_corrected(0.0, 1.5) == pytest.approx(0.6707, abs=5e-5)


@given(st.floats(0.5, 3.0), st.floats(5.0, 30.0), st.floats(0.3, 3.0), st.floats(0.3, 3.0), st.floats(-5.0, 5.0))
def test_m3_the_corrected_one_is_the_damping_of_a_law_held_at_s_equal_v_t(T, speed, a, b, approach):
    f = IDM(T=T, a=a, b=b, s0=0.0)
    at = {"s": speed * T, "v": speed, "dv": -approach}
    h = 1e-5

    def slope(name):
        up, down = ({**at, name: at[name] + sign * h} for sign in (1, -1))
        return (f.acceleration(**up) - f.acceleration(**down)) / (2 * h)

    found = printed.idm_damping_sign_corrected(approach, T, speed=speed, a=a, b=b)
    assert found == pytest.approx(slope("dv") - slope("v"), rel=1e-6, abs=1e-8)
    wrong = printed.idm_damping(approach, T, speed=speed, a=a, b=b)
    assert wrong == pytest.approx(-slope("dv") - slope("v"), rel=1e-6, abs=1e-8)


def test_m3_points_of_the_printed_map_with_a_relative_speed_are_no_equilibria():
    rate = IDM(s0=0.0).acceleration(s=23 * 1.5, v=23.0, dv=-3.0)
    assert rate < -0.5  # m/s²: the state is left at once, so no damping decides about it
    assert IDM().at_rest(linear(IDM).gap, 23.0) == pytest.approx(0.0, abs=1e-14)


def test_m3_positive_damping_is_local_and_not_string_stability():
    found = linear(IDM(v0=33.3), 10.0)
    assert found.damping_ratio > 0
    assert found.locally_stable
    assert not found.string_stable


def test_m4_the_printed_spacing_error_is_not_zero_in_equilibrium():
    gap = linear(IDM).gap
    assert printed.idm_spacing_error(gap, 23.0) == pytest.approx(-5.008, abs=5e-4)
    resting = hw.simulate(hw.Scenario(hw.constant(23.0), [hw.Vehicle(IDM)], duration=5))
    assert float(np.abs(resting.policy_error[1]).max()) < 1e-9
    assert float(np.abs(resting.spacing_error[1]).max()) < 1e-9


@given(st.floats(1.0, 40.0), st.floats(0.1, 9.0), st.floats(0.3, 4.0), st.floats(0.5, 5.0))
def test_m5_spacing_only_idm_is_string_stable_iff_a_t2_reaches_its_gap(speed, a, T, s0):
    assume(abs(a * T * T - (s0 + speed * T)) > 1e-4)
    assert linear(IDMSpacing(a=a, T=T, s0=s0), speed).string_stable == (a * T * T > s0 + speed * T)


def test_m5_the_paper_drives_it_as_stable_at_a_speed_where_it_grows_threefold():
    found = linear(IDMSpacing, 27.8)
    assert 1.0 * 1.5**2 < 2 + 27.8 * 1.5
    assert found.peak_gain == pytest.approx(3.157, abs=5e-4)
    assert not found.string_stable
    # it would take T = 27.9 s, or a = 19.4 m/s²: beyond what the law allows
    assert math.isnan(found.critical("T"))
    assert math.isnan(found.critical("a"))


# -- OVM -------------------------------------------------------------------------------------------


@given(st.floats(2.0, 7.0))
def test_m6_the_printed_condition_of_ovm_is_right(gap):
    least = float(printed.ovm_critical_sensitivity(gap))
    for factor in (0.999, 1.001):
        model = OVM(alpha=factor * least)
        found = linear(model, model.equilibrium_speed(gap))
        assert found.string_stable == (factor > 1)
        assert (printed.ovm_metric(gap, model.alpha) >= 0) == (factor > 1)
        assert printed.ovm_metric(gap, model.alpha) == pytest.approx(found.long_wave / model.alpha, rel=1e-5)


def test_m6_six_metres_are_no_equilibrium_at_23_metres_per_second():
    assert OVM().equilibrium_speed(6.0) == pytest.approx(43.19, abs=5e-3)
    assert linear(OVM).gap == pytest.approx(4.046, abs=5e-4)
    assert printed.ovm_critical_sensitivity(6.0) == pytest.approx(3.109, abs=5e-4)
    assert linear(OVM(alpha=40)).critical("alpha") == pytest.approx(43.9, abs=0.05)
    # v0 is not the desired speed: far ahead it drives v0 (1 + tanh h)
    assert OVM().equilibrium_speed(50.0) == pytest.approx(22 * (1 + math.tanh(4)), rel=1e-12)


def test_m6_the_printed_damping_of_ovm_adds_two_units():
    gap = linear(OVM).gap
    assert printed.ovm_damping(gap, 0.5) == pytest.approx(0.5 * 22.953, abs=1e-3)
    found = linear(OVM(alpha=0.5))
    assert 2 * found.damping_ratio * found.natural_frequency == pytest.approx(0.5, rel=1e-12)


# -- GMM -------------------------------------------------------------------------------------------


def test_m7_the_derivative_by_the_spacing_is_zero_and_the_rejected_result_right():
    found = linear(GMM, gap=15.0)
    assert found.partials["s"] == 0.0
    c = 1.5 * 23 / 225
    omega = np.geomspace(0.01, 3, 50)
    assert found.transfer(1j * omega) == pytest.approx(c / (1j * omega + c), rel=1e-12)
    assert found.peak_gain == 1.0
    assert np.abs(printed.gmm_transfer(1j * omega, gap=15.0)).max() > 1.4


@pytest.mark.parametrize(("alpha", "l"), [(0.15, 2.0), (1.5, 2.0), (30.0, 2.0), (0.05, 1.0), (5.0, 1.0)])
def test_m7_alpha_below_l_over_s_decides_nothing(alpha, l):  # noqa: E741  the published symbol
    model = GMM(alpha=alpha, m=1, l=l)
    claim = alpha <= printed.gmm_critical_sensitivity(l, gap=15.0)
    assert claim == (alpha in (0.05,))
    now = linear(model, gap=15.0)
    assert now.string_stable
    # with a delay it is C τ <= 1/2 (Herman 1959)
    assert now.critical_delay("string") == pytest.approx(0.5 * 15.0**l / (alpha * 23), rel=1e-8)


# -- the oscillator, the time gap, the derivations ----------------------------------------------------


def test_m10_the_printed_velocity_of_the_forced_oscillator_is_not_the_derivative():
    omega0, xi, w = 1.2, 0.3, 0.8
    a, b = printed.oscillator_coefficients(w, omega0=omega0, xi=xi)
    assert (a, b) == pytest.approx((0.823234984194, 0.59272918862), abs=1e-11)
    t = np.linspace(0, 20, 500)
    h = 1e-6
    y = lambda t: a * np.cos(w * t) + b * np.sin(w * t)  # noqa: E731
    slope = (y(t + h) - y(t - h)) / (2 * h)
    assert slope == pytest.approx(-a * w * np.sin(w * t) + b * w * np.cos(w * t), abs=1e-8)
    assert np.abs(printed.oscillator_speed(t, a, b, w) - slope).max() > 0.5
    # what simulation gives: the gap of a follower with ω0² = f_s, 2 ξ ω0 = -f_v, forced by u̇ - f_v u of its leader

    @hw.model
    def oscillator(s, v, *, f_s=1.44, f_v=-0.72):
        return f_s * (s - 20.0) + f_v * (v - 15.0)

    found = linear(oscillator, 15.0)
    response = complex(found.gap_response(w)) / (1j * w + 0.72)
    assert (response.real, -response.imag) == pytest.approx((a, b), abs=1e-11)


def test_m11_the_gap_shrinks_when_the_follower_is_faster():
    run = hw.simulate(hw.Scenario(hw.constant(23.0), [hw.Vehicle(IDM)], duration=10, speed_offsets={1: 1.0}))
    gap, speed = run.gap.values[1], run.speed.values[1]
    rate = np.gradient(gap, run.time.values)
    true = gap / speed
    assert gap / (23.0 - rate) == pytest.approx(true, rel=2e-4)
    wrong = printed.oscillator_time_gap(gap, rate, 23.0)
    assert true[0] == pytest.approx(gap[0] / 24.0)
    assert wrong[0] == pytest.approx(gap[0] / 22.0, rel=1e-3)


def test_m12_the_taylor_expansion_is_of_the_acceleration():
    f, gap = linear(IDM).partials, linear(IDM).gap
    state = {"s": gap + 1e-3, "v": 23.0 + 1e-3, "dv": -2e-3}
    expansion = f["s"] * 1e-3 + f["v"] * 1e-3 + f["dv"] * -2e-3
    assert IDM().acceleration(**state) == pytest.approx(expansion, abs=1e-6)
    assert expansion == pytest.approx(-8.61e-4, abs=1e-6)  # as printed it would be the speed, 23.001 m/s


def test_m12_a_vehicle_stands_behind_its_predecessor():
    run = hw.simulate(hw.Scenario(hw.constant(23.0), [hw.Vehicle(IDM)] * 2, duration=1))
    x = run.position.values
    assert np.all(x[1:] - x[:-1] < 0)  # x[n] - x[n-1] = -s0, where the paper has +s0
    assert x[0] - x[1] - 5.0 == pytest.approx(run.gap.values[1])


def test_m12_the_speed_exponent_may_be_negative_down_to_minus_2_and_the_spacing_exponent_to_minus_1():
    assert {n: GMM.parameters[n].info.low for n in ("m", "l")} == {"m": -2.0, "l": -1.0}
    GMM(m=-2.0, l=4.0)
    with pytest.raises(hw.HeadwayError):
        GMM(l=-2.0)  # the paper gives the speed exponent's range to l


def test_m12_alpha_of_the_derivation_is_the_inverse_of_alpha_of_the_model():
    # Δx = Δx_safe + α v gives a = Δv / α
    derived, model = linear(GMM(alpha=1 / 1.5, m=0, l=0), gap=15.0), linear(GMM(alpha=1.5, m=0, l=0), gap=15.0)
    assert derived.partials["dv"] == pytest.approx(1 / 1.5)
    assert model.partials["dv"] == 1.5
    # a time α = 1.5 s: the gap follows Δx_safe + 1.5 v
    step = hw.step(mean=23, change=-2, onset=1, edge=2)
    run = hw.simulate(hw.Scenario(step, [hw.Vehicle(derived.vehicle.model)], duration=60, gaps=40))
    assert float(run.gap[1, -1]) == pytest.approx(40 - 1.5 * 2, abs=1e-6)


# -- shapes ------------------------------------------------------------------------------------------


def test_printed_formulas_broadcast():
    x, y = np.linspace(0.1, 3, 4)[:, None], np.linspace(0.2, 2, 5)
    for found in (
        printed.idm_damping(x, y), printed.idm_damping_sign_corrected(x, y), printed.idm_spacing_error(x, y),
        printed.ovm_metric(x, y), printed.ovm_damping(x, y), printed.gmm_critical_sensitivity(x, gap=y),
        printed.gmm_transfer(1j * x, alpha=y), printed.cacc_transfer(1j * x, kv=y), printed.cacc_sufficient(x, y),
        printed.cacc_longest_delay(x, y, 0.5), printed.cacc_policy_error(x, y), printed.oscillator_time_gap(x, 0.1, y),
        printed.oscillator_coefficients(x, omega0=y, xi=0.2)[1], printed.oscillator_speed(x, y, 1.0, 0.5),
    ):  # fmt: skip
        assert found.shape == (4, 5)


def test_printed_formulas_are_not_offered_as_theory():
    assert not set(printed.__all__) & set(dir(hw))
