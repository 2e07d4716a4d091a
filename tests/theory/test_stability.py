"""Linear theory: numbers computed independently, closed forms, and the paper's mistakes beside the right figures."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from linear_systems import ALL_LATE, LEADER_LATE, MEASURED_LATE, RADIO_LATE, linear
from scipy.optimize import brentq

import headway as hw
from headway.models import CACC, FVDM, GMM, IDM, OVM
from headway.theory import gain
from headway.theory.quasipolynomial import QuasiPolynomial
from headway.theory.roots import rightmost


def gmm_of_unit_sensitivity(delay):
    """dv' = -C dv(t - τ) with C = 1: α v^0 / s^0 = 1."""
    return linear(GMM(alpha=1.0, m=0, l=0), gap=15.0, delay=delay)


#: speed, C without delay, sup |G|, its frequency (IDM, v0 = 33.3)
TABLE = [
    (5, -0.049368, 1.006315, 0.1534),
    (10, -0.030775, 1.007115, 0.1174),
    (15, -0.013729, 1.003214, 0.0783),
    (20, 0.005665, 1.0, 0.0),
    (25, 0.025851, 1.0, 0.0),
]


@pytest.mark.parametrize(("speed", "long_wave", "gain", "omega"), TABLE)
def test_idm_table(speed, long_wave, gain, omega):
    found = linear(IDM(v0=33.3), speed)
    assert found.long_wave == pytest.approx(long_wave, abs=6e-7)
    assert found.peak_gain == pytest.approx(gain, abs=6e-7)
    assert found.peak_frequency == pytest.approx(omega, abs=6e-5)
    assert found.string_stable == (long_wave > 0)
    assert found.peak.certified


@pytest.mark.parametrize(("speed", "kind", "roadside"), [
    (5.0, "convectively unstable upstream", -0.0258), (15.0, "absolutely unstable", 0.00132),
])  # fmt: skip
def test_where_a_wave_of_idm_grows(speed, kind, roadside):
    found = linear(IDM(v0=33.3), speed)
    spread = found.propagation()
    assert spread.kind == kind
    assert spread.roadside_growth == pytest.approx(roadside, rel=3e-3)
    assert found.growth(speed / (found.gap + 5.0)) == pytest.approx(roadside, rel=3e-3)
    assert spread.growth == pytest.approx(found.growth(np.linspace(0.3, 0.8, 501)).max(), abs=1e-7)
    if speed == 5.0:
        assert found.growth(0.56) == pytest.approx(0.00352, abs=5e-6)  # close to the largest, 0.00357 on 0.570


def test_scalar_delay_equation():
    roots = rightmost(QuasiPolynomial.of((1.0, 1, 0.0), (1.0, 0, 1.0)))
    assert roots.roots[0] == pytest.approx(-0.3181315052 + 1.3372357014j, abs=1e-9)
    assert roots.residual < 1e-13


def test_crossing_of_the_second_order_equation():
    """p² + (A p + B) e^{-pτ}: ω_c² = (A² + sqrt(A⁴ + 4 B²))/2, τ_c = atan2(A ω_c, B)/ω_c."""
    a, b = 2.0, 1.8
    omega = math.sqrt((a * a + math.sqrt(a**4 + 4 * b * b)) / 2)
    tau = math.atan2(a * omega, b) / omega
    assert tau == pytest.approx(0.5434266, abs=5e-8)
    characteristic = QuasiPolynomial.of((1.0, 2, 0.0), (a, 1, tau), (b, 0, tau))
    assert rightmost(characteristic).roots[0] == pytest.approx(1j * omega, abs=1e-8)

    @hw.model
    def both(s, v):
        return 1.8 * (s - 20.0) - 2.0 * (v - 15.0)

    assert linear(both, 15.0).critical_delay("local") == pytest.approx(tau, abs=1e-10)


@given(st.floats(0.2, 3.0), st.floats(0.1, 4.0), st.floats(0.01, 3.0))
def test_neutral_roots_solve_their_equation(a, b, tau):
    roots = rightmost(QuasiPolynomial.of((1.0, 2, 0.0), (a, 1, tau), (b, 0, 0.5 * tau), (0.3, 2, tau)))
    assert roots.residual < 1e-9
    assert roots.roots.size > 0


@pytest.mark.parametrize(("c_tau", "oscillates", "string", "local"), [
    (0.36, False, True, True), (0.40, True, True, True), (0.49, True, True, True), (0.51, True, False, True),
    (1.55, True, False, True), (1.60, True, False, False),
])  # fmt: skip
def test_gmm_with_everything_late_is_hermans(c_tau, oscillates, string, local):
    found = gmm_of_unit_sensitivity(c_tau)
    assert (abs(found.rightmost_root.imag) > 1e-6) == oscillates
    assert (found.string_stable, found.locally_stable) == (string, local)


@given(st.floats(0.1, 20.0))
def test_gmm_with_own_speed_current_never_amplifies(tau):
    assert linear(GMM, gap=15.0, delay={"vl": tau}).peak_gain == pytest.approx(1.0, abs=1e-9)


@given(st.floats(0.3, 3.0), st.floats(0.5, 3.0), st.floats(0.3, 3.0), st.floats(2.0, 30.0))
def test_verdict_without_delay_is_the_closed_form(a, b, headway, speed):
    found = linear(IDM(a=a, b=b, T=headway), speed)
    f = found.partials
    criterion = f["v"] ** 2 - 2 * f["v"] * f["dv"] - 2 * f["s"]
    assume(abs(criterion) > 1e-6)
    assert found.string_stable == (criterion > 0)
    assert found.long_wave == pytest.approx(criterion, rel=1e-9, abs=1e-12)


@given(st.floats(0.0, 1.0), st.floats(0.0, 1.0), st.floats(0.0, 2.0), st.floats(0.0, 1.8), st.floats(0.3, 3.0))
def test_cacc_without_delay_is_the_closed_form(kp, kd, kv, ka, h):
    kp = max(kp, 0.02)
    found = linear(CACC(kp=kp, kd=kd, kv=kv, ka=ka, h=h))
    first, second = 1 + kd * h - ka, ka + kv * h + kp * h * h / 2 - 1
    assume(abs(first) > 1e-4)
    assume(abs(second) > 1e-4)
    assert found.string_stable == (first > 0 and second > 0)


REALISTIC = {"v0": 20.0, "h": 25.0, "w": 12.0}


@given(st.floats(0.05, 8.0), st.floats(0.05, 0.95))
def test_ovm_without_delay_is_stable_iff_alpha_reaches_twice_the_slope(alpha, share):
    model = OVM(alpha=alpha, **REALISTIC)
    found = linear(model, share * 39.0)
    slope = 20.0 / 12.0 * (1 - math.tanh((found.gap - 25.0) / 12.0) ** 2)
    assume(abs(alpha - 2 * slope) > 1e-4)
    assert found.string_stable == (alpha >= 2 * slope)
    assert found.locally_stable


@given(st.floats(0.05, 5.0), st.floats(0.0, 3.0), st.floats(0.05, 0.95))
def test_fvdm_without_delay_is_stable_iff_half_alpha_plus_lambda_reaches_the_slope(alpha, lam, share):
    found = linear(FVDM(alpha=alpha, lam=lam, **REALISTIC), share * 39.0)
    slope = 20.0 / 12.0 * (1 - math.tanh((found.gap - 25.0) / 12.0) ** 2)
    assume(abs(slope - alpha / 2 - lam) > 1e-4)
    assert found.string_stable == (slope <= alpha / 2 + lam)


@given(st.floats(0.01, 50.0), st.floats(-1.0, 2.0), st.floats(0.0, 3.0), st.floats(1.0, 40.0), st.floats(2.0, 80.0))
def test_gmm_without_delay_never_amplifies(alpha, m, l, speed, gap):  # noqa: E741  the published symbol
    found = linear(GMM(alpha=alpha, m=m, l=l), speed, gap)
    assert found.string_stable
    assert found.locally_stable
    assert found.peak_gain == pytest.approx(1.0, abs=1e-12)


@given(st.floats(0.02, 1.0), st.floats(0.0, 1.0), st.floats(0.1, 2.0), st.floats(0.0, 0.9), st.floats(0.3, 3.0))
def test_cacc_needs_its_delay_to_be_shorter_than_the_long_waves_allow(kp, kd, kv, ka, h):
    limit = h + kp * h * h / (2 * kv) - (1 - ka) / kv
    assume(limit > 0.02)
    model = CACC(kp=kp, kd=kd, kv=kv, ka=ka, h=h)
    for factor in (0.99, 1.01):
        found = linear(model, delay=dict.fromkeys(RADIO_LATE, factor * limit))
        assert (found.long_wave > 0) == (factor < 1)
        assert found.locally_stable, "the radio is no part of the loop"
        assert factor < 1 or not found.string_stable


def test_cacc_with_full_feed_forward_and_no_derivative_is_only_marginal():
    """ka = 1, kd = 0 (van Arem's gains): |G| → 1 for short waves, which any sizeable delay lifts above 1."""
    for delay in (0.02, 0.05, 0.15):
        found = linear(CACC(kp=0.1, kd=0, kv=0.58, ka=1), delay={"vl": delay, "al": delay})
        assert found.long_wave > 0
        assert not found.string_stable
        assert 1.0 < found.peak_gain < 1.0 + 1e-3
        # |D|² - |N|² tends to ω² (kp h (2 kv + kp h) - 2 kp (1 - cos ωτ))
        assert found.margin == pytest.approx(0.1 * 1.5 * (1.16 + 0.15) - 0.4, abs=2e-3)


@pytest.mark.parametrize(
    ("theta", "least"), [(0.02, 0.252), (0.1, 0.568), (0.15, 0.699), (0.2, 0.811), (None, math.sqrt(2 / 0.2))]
)
def test_least_time_gap_of_ploegs_controller(theta, least):
    """h u' = -u + kp e + kd e' + u[n-1](t - θ), drivetrain lag 0.1 s, actuator delay 0.2 s; None: no radio.

    Its filter is a state that no law has, so its transfer function is written down:
    G = (e^{-θp} + K P) / ((1 + h p)(1 + K P)), K = kp + kd p, P = e^{-0.2 p} / (p² (1 + 0.1 p)).
    Without radio long waves decide: h² kp >= 2.
    """

    def parts(h):
        loop = ((1.0, 2, 0.0), (0.1, 3, 0.0))
        feedback = ((0.2, 0, 0.2), (0.7, 1, 0.2))
        radio = [(c, n, theta) for c, n, _ in loop] if theta is not None else []
        bottom = [(c * k, n + i, t) for c, n, t in (*loop, *feedback) for k, i in ((1.0, 0), (h, 1))]
        return QuasiPolynomial.of(*radio, *feedback), QuasiPolynomial.of(*bottom)

    assert rightmost(parts(1.0)[1]).roots[0].real < 0
    found = brentq(lambda h: gain.margin(*parts(h)), 0.05, 6.0, xtol=1e-9)
    assert found == pytest.approx(least, abs=5e-4)


DELAY = st.floats(0.0, 2.0)


@given(st.floats(2.0, 31.0), DELAY, DELAY, DELAY)
def test_long_waves_with_a_delay_for_each_signal(speed, tau_s, tau_v, tau_l):
    """C = F_v² - F_l² - 2 f_s - 2 f_s F_v (τ_v - τ_s) - 2 f_s F_l (τ_l - τ_s)."""
    found = linear(IDM, speed, delay={"s": tau_s, "v": tau_v, "vl": tau_l})
    f = found.partials
    own, ahead = f["v"] - f["dv"], f["dv"]
    late = own * (tau_v - tau_s) + ahead * (tau_l - tau_s)
    expected = own**2 - ahead**2 - 2 * f["s"] - 2 * f["s"] * late
    assert found.long_wave == pytest.approx(expected, rel=1e-9, abs=1e-12)


@given(DELAY, DELAY, DELAY, DELAY, DELAY, st.floats(0.0, 1.0))
def test_long_waves_are_the_limit_of_the_sweep(tau_s, tau_v, tau_dv, tau_vl, tau_al, lag):
    late = {"s": tau_s, "v": tau_v, "dv": tau_dv, "vl": tau_vl, "al": tau_al}
    found = linear(CACC, 15.0, delay=late, lag=lag)
    w = np.array([2e-3, 4e-3])
    measured = found.partials["s"] ** 2 * (found.gain(w) ** -2 - 1) / w**2
    assert (4 * measured[0] - measured[1]) / 3 == pytest.approx(found.long_wave, abs=2e-7)


def test_least_time_gap_of_milanes_acc():
    """Milanés and Shladover's ACC k1 (s - T v) + k2 dv is string unstable below T = 2.660 s."""

    @hw.model
    def acc(s, v, dv, *, k1=0.23, k2=0.07, T=1.1):
        return k1 * (s - 2.0 - T * v) + k2 * dv

    found = hw.linearize(hw.Vehicle(acc), 20.0)
    assert not found.string_stable
    assert found.critical("T") == pytest.approx(2.660, abs=5e-4)


@pytest.mark.parametrize("delay", [ALL_LATE, LEADER_LATE, MEASURED_LATE])
def test_string_verdict_changes_at_the_critical_delay(delay):
    critical = linear(IDM, delay=delay).critical_delay("string")
    for factor, stable in ((0.999, True), (1.001, False)):
        late = critical * factor if isinstance(delay, float) else dict.fromkeys(delay, critical * factor)
        assert linear(IDM, delay=late).string_stable is stable


def test_lag_is_part_of_the_theory():
    slow = linear(CACC, lag=0.5)
    w = 1j * 0.8
    f = slow.partials
    expected = (f["s"] + w * (f["dv"] + f["vl"]) + w * w * f["al"]) / (
        w * w * (1 + 0.5 * w) + f["s"] + w * (f["dv"] - f["v"]) - w * w * f["a"]
    )
    assert complex(slow.transfer(w)) == pytest.approx(expected, abs=1e-14)


@pytest.mark.parametrize(
    "vehicle",
    [
        {"model": IDM, "delay": 0.7}, {"model": IDM, "delay": {"s": 0.5, "dv": 0.9}},
        {"model": IDM, "delay": {"s": 0.6, "vl": 0.6}, "lag": 0.3}, {"model": CACC, "delay": {"vl": 0.4, "al": 0.7}},
        {"model": CACC, "delay": 0.2}, {"model": CACC, "lag": 0.4, "delay": {"a": 0.1}}, {"model": GMM, "delay": 0.9},
        {"model": OVM(alpha=3, v0=20, h=25, w=12), "delay": {"s": 0.2, "v": 0.1}},
    ],
)  # fmt: skip
@pytest.mark.parametrize("omega", [0.2, 0.63, 1.7])
def test_small_amplitudes_grow_as_the_theory_says(vehicle, omega):
    """The measured gain of the simulated platoon is |G| within 1e-4, whatever is late."""
    car = hw.Vehicle(**vehicle)
    gap = 12.0 if car.model.name == "gmm" else None
    theory = hw.linearize(car, 15.0, gap)
    period = 2 * math.pi / omega
    settle = math.ceil(max(20.0 / theory.decay_rate, 3 * period) / period) * period
    scenario = hw.Scenario(
        hw.sine(15.0, 1e-5, omega), [car], duration=settle + 4 * period, gaps=gap, dt=0.02, output_step=period / 64
    )
    run = hw.simulate(scenario).sel(time=slice(settle - 1e-6, settle + 4 * period - 1e-6))
    t = run.time.values
    basis = np.column_stack([np.cos(omega * t), np.sin(omega * t), np.ones_like(t)])
    fit = np.linalg.lstsq(basis, (run.speed.values[1] - 15.0) / 1e-5, rcond=None)[0]
    measured = complex(fit[1], fit[0])  # the leader is sin ωt
    assert abs(measured) == pytest.approx(float(theory.gain(omega)), abs=1e-4)
    assert measured == pytest.approx(complex(theory.transfer(1j * omega)), abs=2e-4)


def test_forced_oscillator_has_the_right_coefficients():
    """A = (ω0² - ω²)/D, B = 2 ξ ω0 ω / D, positive."""

    @hw.model
    def oscillator(s, v, *, f_s=1.44, f_v=-0.72):
        return f_s * (s - 20.0) + f_v * (v - 15.0)

    found = hw.linearize(hw.Vehicle(oscillator), 15.0)
    assert (found.natural_frequency, found.damping_ratio) == pytest.approx((1.2, 0.3))
    # ÿ + 2 ξ ω0 ẏ + ω0² y = u̇ - f_v u: behind u the forcing (p - f_v) u is cos ωt for u = 1/(p - f_v)
    w = 0.8
    y = complex(found.gap_response(w)) / (1j * w + 0.72)
    assert (y.real, -y.imag) == pytest.approx((0.823234984194, 0.59272918862), abs=1e-9)
    a, b = found.steady_response(1.0, w)
    response = complex(found.gap_response(w))
    assert (a, b) == pytest.approx((response.real, -response.imag))


def test_string_of_different_vehicles():
    nervous, calm = hw.Vehicle(IDM, delay=1.5), hw.Vehicle(IDM(T=2.5))
    chain = hw.head_to_tail([nervous, calm, calm], 23.0)
    w = np.geomspace(0.05, 3, 50)
    product = hw.linearize(nervous, 23.0).gain(w) * hw.linearize(calm, 23.0).gain(w) ** 2
    assert np.allclose(chain.gain(w), product, rtol=1e-12)
    assert not chain.strictly_string_stable
    assert chain.head_to_tail_stable
    assert chain.worst.gain == pytest.approx(hw.linearize(nervous, 23.0).peak_gain, abs=1e-9)


def test_phase_and_group_delay():
    found = linear(IDM, delay=0.3)
    w = np.array([0.1, 0.5, 1.0])
    h = 1e-5
    slope = (found.phase_lag(w + h) - found.phase_lag(w - h)) / (2 * h)
    assert np.allclose(slope, found.group_delay(w), rtol=1e-3)
    assert np.all(found.phase_lag(w) > 0)


def test_command_line(cli):
    code, out, _ = cli("stability", "idm", "--speed", "23", "--set", "T=1.5", "--delay", "s=0.5,dv=0.5", "--json")
    report = json.loads(out)
    assert code == 0
    keys = {"model", "speed", "gap", "partials", "natural_frequency", "damping_ratio", "locally_stable",
            "rightmost_root", "string_stable", "peak_gain", "peak_frequency", "long_wave",
            "critical_delay"}  # fmt: skip
    assert keys <= set(report)
    assert report["critical_delay"]["local"] == pytest.approx(4.02644593221, abs=1e-9)
    _, out, _ = cli("stability", "idm", "--speed", "23", "--delay", "1.5")
    assert out.startswith("string unstable: a 0.64 rad/s disturbance grows 1.3 times per vehicle; stable for delays")
    _, out, _ = cli("stability", "paper:compare-150-cacc")
    assert "head to tail over 5 vehicles: stable" in out


@pytest.mark.parametrize(("arguments", "words"), [
    (["idm", "--speed", "40"], "no equilibrium at 40 m/s"),
    (["idmm", "--speed", "20"], "did you mean 'idm'"),
    (["gmm", "--speed", "20"], "so name the one that is meant with --gap"),
    (["idm", "--speed", "20", "--delay", "soon"], "signal=seconds"),
    (["idm", "--speed", "20", "--delay", "al=1"], "does not perceive 'al'"),
    (["idm", "--speed", "20", "--set", "TT=1"], "'TT'"),
    (["idm", "--speed", "20", "--lag=-1"], "lag = -1"),
    (["idm", "--speed", "20", "--gap=-1"], "gap = -1"),
])  # fmt: skip
def test_bad_input(cli, arguments, words):
    code, out, error = cli("stability", *arguments)
    assert (code, out) == (2, "")
    assert words in error
    assert error.count("\n") == 1


@pytest.mark.parametrize("tau", [0.001, 0.005, 0.05])
def test_short_waves_that_leading_terms_do_not_decide(tau):
    """With ka = 1 + kd h, |G| → 1: the next terms decide, and any radio delay makes short waves grow."""
    car = linear(CACC(kp=0.1, kd=0.0, kv=0.58, ka=1.0, h=1.5), delay={"vl": tau, "al": tau})
    kp, kv, h = 0.1, 0.58, 1.5
    worst = kp * h * (2 * kv + kp * h) - 4 * kp  # of (|D|² - |N|²)/ω² at ω → ∞, over all phases
    assert not car.string_stable
    assert car.margin == pytest.approx(worst, abs=1e-3)
    assert car.critical_delay("string") == pytest.approx(0.0, abs=1e-5)
    assert linear(CACC(kp=0.1, kd=0.0, kv=0.58, ka=1.0, h=1.5)).string_stable
