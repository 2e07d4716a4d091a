"""Linear theory: numbers computed independently, closed forms, and the paper's mistakes beside the right figures."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

import headway as hw
from headway.analysis.quasipolynomial import QuasiPolynomial
from headway.analysis.roots import rightmost
from headway.models import CACC, GMM, IDM, OVM, IDMSpacing

LEADER_LATE = {"s": 1.0, "vl": 1.0}  # own speed current everywhere
MEASURED_LATE = {"s": 1.0, "dv": 1.0}  # relative speed late as a whole
RADIO_LATE = {"vl": 1.0, "al": 1.0}


def linear(model, speed=23.0, gap=None, **vehicle):
    return hw.linearize(hw.Vehicle(model, **vehicle), speed, gap)


ORACLES = {
    "IDM05": (lambda: linear(IDM).natural_frequency, 0.193020527819, 1e-9),
    "IDM06": (lambda: linear(IDM).damping_ratio, 1.2973368855, 1e-9),
    "IDM10": (lambda: linear(IDM).gain(0.63), 0.529626924326, 1e-9),
    "IDM12_0": (lambda: linear(IDM).critical_delay("local"), 2.81483511042, 1e-9),
    "IDM13_0": (lambda: linear(IDM).critical_delay("string"), 1.19052559126, 2e-9),
    "IDM12_1": (lambda: linear(IDM, delay=LEADER_LATE).critical_delay("local"), 19.359672542, 1e-8),
    "IDM12_2": (lambda: linear(IDM, delay=MEASURED_LATE).critical_delay("local"), 4.02644593221, 1e-9),
    "IDM14_1": (lambda: linear(IDM, delay={"s": 1.5, "vl": 1.5}).peak_gain, 1.04868206321, 1e-9),
    "IDM15_1": (lambda: linear(IDM, delay={"s": 1.5, "vl": 1.5}).peak_frequency, 0.103325500751, 1e-7),
    "IDMI2_27.8": (lambda: linear(IDMSpacing, 27.8).peak_gain, 3.15716915932, 1e-9),
    "IDMI3_27.8": (lambda: linear(IDMSpacing, 27.8).peak_frequency, 0.208351114707, 1e-8),
    "IDMI4": (lambda: linear(IDMSpacing).critical_delay("local"), 1.43915848495, 1e-9),
    "OVM11_0.5": (lambda: linear(OVM(alpha=0.5)).peak_frequency, 3.29417623654, 1e-7),
    "OVM12_0.5": (lambda: linear(OVM(alpha=0.5)).critical_delay("local"), 0.0452064312978, 1e-11),
    "OVM13_0.5": (lambda: linear(OVM(alpha=0.5), delay={"s": 1.0}).critical_delay("local"), 0.0457241671793, 1e-11),
    "OVM13_0.1": (lambda: linear(OVM(alpha=0.1), delay={"s": 1.0}).critical_delay("local"), 0.0455860322635, 1e-11),
    "OVM14": (lambda: 2 * linear(OVM(alpha=0.5)).gain(0.63) ** 5, 2.3990559385, 1e-9),
    "OVM15": (
        lambda: linear(OVM(alpha=1), OVM(alpha=1).equilibrium_speed(8.0)).critical_delay("string"), 1.48989083462, 2e-9,
    ),
    "OVM09": (lambda: linear(OVM(alpha=3), 0.748484012664).long_wave, 0.0, 1e-6),  # the lower boundary speed
    "CACC02": (lambda: linear(CACC, delay=RADIO_LATE).critical_delay("string"), 1.5125, 1e-9),
    "CACC03_0.15": (lambda: linear(CACC, delay={"vl": 0.15, "al": 0.15}).gain(0.63), 0.626108800295, 1e-11),
    "CACC04_0": (lambda: abs(policy_error_response(0.0)) * 2, 0.746031979923, 1e-9),
    "CACC04_1.5": (lambda: abs(policy_error_response(1.5)) * 2, 0.93100628183, 1e-9),
    "CACC05": (lambda: linear(CACC(kv=0, ka=0)).peak_gain, 1.06872196395, 1e-9),
    "CACC06": (lambda: linear(CACC(kv=0, ka=0)).peak_frequency, 0.339798905166, 1e-7),
    "CACC15": (lambda: linear(CACC).damping_ratio, 0.905789459783, 1e-9),
    "GMM05": (lambda: linear(GMM, gap=15.0).critical_delay("local"), 10.2443238704, 1e-8),
    "GMM08_0.3679": (lambda: gmm_of_unit_sensitivity(math.exp(-1)).rightmost_root.real, -2.71828182846, 1e-5),
    "GMM08_1.5": (lambda: gmm_of_unit_sensitivity(1.5).rightmost_root.real, -0.0218558239437, 1e-10),
}  # fmt: skip


def policy_error_response(delay):
    """e = s - r - h v per leader speed at 0.63 rad/s."""
    car = linear(CACC, delay={"vl": delay, "al": delay})
    return complex(car.gap_response(0.63)) - 1.5 * complex(car.transfer(0.63j))


def gmm_of_unit_sensitivity(delay):
    """dv' = -C dv(t - τ) with C = 1: α v / s² = 1."""
    return linear(GMM(alpha=1.0, m=0, l=0), gap=15.0, delay=delay)


@pytest.mark.parametrize("name", ORACLES)
def test_oracle(name):
    compute, value, tolerance = ORACLES[name]
    if name == "GMM05":
        # C = α v / s² = 1.5 · 23 / 225
        assert value == pytest.approx(math.pi / 2 / (1.5 * 23 / 225), abs=1e-9)
    assert float(compute()) == pytest.approx(value, abs=tolerance)


#: theory.md 3: speed, C without delay, sup |G|, its frequency (IDM, v0 = 33.3)
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


def test_scalar_delay_equation():
    roots = rightmost(QuasiPolynomial.of((1.0, 1, 0.0), (1.0, 0, 1.0)))
    assert roots.roots[0] == pytest.approx(-0.3181315052 + 1.3372357014j, abs=1e-9)
    assert roots.residual < 1e-13


def test_crossing_of_the_second_order_equation():
    characteristic = QuasiPolynomial.of((1.0, 2, 0.0), (2.0, 1, 0.5434266), (1.8, 0, 0.5434266))
    assert rightmost(characteristic).roots[0].real == pytest.approx(0.0, abs=1e-6)


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


def test_ploeg_style_acc_needs_its_time_gap():
    """Milanés and Shladover's ACC k1 (s - T v) + k2 dv is string unstable below T = 2.660 s."""

    @hw.model
    def acc(s, v, dv, *, k1=0.23, k2=0.07, T=1.1):
        return k1 * (s - 2.0 - T * v) + k2 * dv

    found = hw.linearize(hw.Vehicle(acc), 20.0)
    assert not found.string_stable
    assert found.critical("T") == pytest.approx(2.660, abs=5e-4)


@pytest.mark.parametrize("delay", [1.0, LEADER_LATE, MEASURED_LATE])
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
    """M10 and OSC1, OSC2: A = (ω0² - ω²)/D, B = 2 ξ ω0 ω / D, positive."""

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
    (["idm"], "needs --speed"),
    (["idm", "--speed", "40"], "no equilibrium at 40 m/s"),
    (["idmm", "--speed", "20"], "did you mean 'idm'"),
    (["gmm", "--speed", "20"], "every gap is an equilibrium"),
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
