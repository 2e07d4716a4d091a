"""One spectrum, one answer: verdict, peak, critical values and the compiled sweep never contradict each other."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from linear_systems import linear

import headway as hw
from headway.models import CACC, IDM, OVM
from headway.theory import roots, sweep
from headway.theory.map import stability_map
from headway.theory.quasipolynomial import QuasiPolynomial


@hw.model
def any_law(s, v, dv, a, vl, al, *, fs=0.1, fv=-0.5, fdv=0.3, fa=0.0, fvl=0.0, fal=0.0):
    """Every linear law of one predecessor."""
    return fs * (s - 20.0) + fv * (v - 15.0) + fdv * dv + fa * a + fvl * (vl - 15.0) + fal * al


@hw.model
def path(s, v, dv, al, v0l, a0l, *, C1=0.5, wn=0.2, xi=1.0, s0=5.0):
    """The platoon law of PATH (Rajamani, Vehicle Dynamics and Control, 7.7), which hears the platoon leader."""
    far = (xi + math.sqrt(xi * xi - 1.0)) * wn
    return (1 - C1) * al + C1 * a0l + (2 * xi * wn - C1 * far) * dv - far * C1 * (v - v0l) + wn * wn * (s - s0)


@hw.model
def echo(al, *, k=1.0):
    """Hears nothing but the acceleration ahead."""
    return k * al


delay = st.one_of(st.just(0.0), st.floats(-4.0, math.log10(20.0)).map(lambda x: 10.0**x))


def patterns(*signals):
    each = st.dictionaries(st.sampled_from(signals), delay, min_size=1)
    return st.one_of(delay, each, delay.map(lambda t: dict.fromkeys(signals, t)))


lags = st.sampled_from([0.0, 0.1, 0.3, 2.0, 1e-3])
vehicles = st.one_of(
    st.builds(
        lambda a, b, T, d, lag: hw.Vehicle(IDM(a=a, b=b, T=T), delay=d, lag=lag),
        st.floats(0.3, 3), st.floats(0.5, 3), st.floats(0.3, 3), patterns("s", "v", "dv"), lags,
    ),
    st.builds(
        lambda kp, kd, kv, ka, h, d, lag: hw.Vehicle(CACC(kp=kp, kd=kd, kv=kv, ka=ka, h=h), delay=d, lag=lag),
        st.floats(0.02, 1), st.floats(0, 1.2), st.floats(0, 2), st.floats(0, 1.3), st.floats(0.3, 3),
        patterns("s", "v", "dv", "a", "vl", "al"), lags,
    ),
    st.builds(
        lambda a, d, lag: hw.Vehicle(OVM(alpha=a, v0=20, h=25, w=12), delay=d, lag=lag),
        st.floats(0.3, 3), patterns("s", "v"), lags,
    ),
    st.builds(
        lambda fs, fv, fdv, fa, fvl, fal, d, lag: hw.Vehicle(
            any_law(fs=fs, fv=fv, fdv=fdv, fa=fa, fvl=fvl, fal=fal), delay=d, lag=lag
        ),
        st.floats(0.01, 1), st.floats(-2, -0.01), st.floats(0, 1), st.floats(-1.3, 0.9), st.floats(0, 1),
        st.floats(0, 1.3), patterns("s", "v", "dv", "a", "vl", "al"), lags,
    ),
)  # fmt: skip


@given(vehicles)
@settings(max_examples=60, deadline=None)
def test_verdict_and_peak_are_one_answer(car):
    found = hw.linearize(car, 15.0)
    assert found.string_stable == (found.peak_gain <= 1.0)
    # growth of less than a part in a hundred million is told apart by the verdict alone
    assert found.string_stable == (found.peak_gain <= 1.0 + 1e-8) or 1.0 < found.peak_gain <= 1.0 + 1e-8
    assert found.string_stable == (found.locally_stable and found.margin >= -1e-10)
    assert found.locally_stable == (found.decay_rate > 0.0)
    assert hw.head_to_tail([car] * 3, 15.0).head_to_tail_stable == found.string_stable
    omega = np.geomspace(1e-3, 3e3, 3001)
    if found.locally_stable:
        assert float(np.max(found.gain(omega))) <= found.peak_gain * (1.0 + 1e-7)
    # the compiled sweep, by other means
    rows = sweep.rows_of([found])
    verdicts, peaks = sweep.judge(rows), sweep.peaks_of(rows)
    assert verdicts.string_stable[0] == (peaks.gain[0] <= 1.0)
    assume(abs(found.margin) > 1e-8 and abs(found.decay_rate) > 1e-8)
    assert verdicts.locally_stable[0] == found.locally_stable
    assert verdicts.string_stable[0] == found.string_stable
    assert peaks.gain[0] == pytest.approx(found.peak_gain, rel=1e-4)


@given(vehicles)
@settings(max_examples=12, deadline=None)
def test_verdicts_change_at_critical_delays(car):
    """0.99 times the longest delay of the pattern is stable, 1.01 times it unstable, whichever signal has it."""
    found = hw.linearize(car, 15.0)
    longest = found.slowed(1.0).vehicle.perception.longest
    for kind, stable in (("local", "locally_stable"), ("string", "string_stable")):
        critical = found.critical_delay(kind)
        if not getattr(found.slowed(0.0), stable):
            assert critical == 0.0
            continue
        if critical > 0.0 and math.isfinite(critical):
            assert getattr(found.slowed(0.99 * critical / longest), stable)
        if math.isfinite(critical):
            assert not getattr(found.slowed(max(1.01 * critical, 1e-4) / longest), stable)


@pytest.mark.parametrize(("car", "local"), [
    (hw.Vehicle(IDM(), delay={"s": 0.3, "vl": 0.6}), 38.7193),
    (hw.Vehicle(IDM(), delay={"s": 0.3, "vl": 0.9}), 58.0790),
    (hw.Vehicle(CACC(), delay={"s": 0.1, "vl": 0.4, "al": 0.4}), 16.975270),
])  # fmt: skip
def test_critical_delay_of_a_pattern_is_its_longest_delay(car, local):
    found = hw.linearize(car, 23.0)
    assert found.critical_delay("local") == pytest.approx(local, rel=1e-5)
    longest = max(t for _, t in car.delay)
    assert found.slowed(0.99 * local / longest).locally_stable
    assert not found.slowed(1.01 * local / longest).locally_stable


def test_the_words_say_which_delay_a_critical_one_is(cli):
    _, out, _ = cli("stability", "idm", "--delay", "s=0.3,vl=0.6")
    assert "stable for delays of s and vl in the ratio 0.3 : 0.6, the longest up to 0.539 s" in out


@pytest.mark.parametrize("gain", [1.0, 1.2, 1.5])
@pytest.mark.parametrize("late", [1e-3, 0.01, 0.3])
def test_own_acceleration_that_comes_back_undiminished_is_unstable_at_every_delay(gain, late):
    model = CACC(kd=gain / 1.5, h=1.5)
    found = linear(model, delay=late)
    assert not found.locally_stable
    assert not found.string_stable
    assert math.isinf(found.peak_gain)
    assert found.decay_rate == pytest.approx(-math.log(gain) / late, abs=1e-9) or found.decay_rate < 0.0
    assert (found.critical_delay("local"), found.critical_delay("string")) == (0.0, 0.0)
    assert sweep.judge(sweep.rows_of([found])).words == ["locally unstable"]
    assert sweep.critical_of(sweep.rows_of([found])).tolist() == [0.0]
    # without delay, and with an actuator, the loop is one that can be solved
    assert linear(model).string_stable
    assert linear(model, lag=0.2, delay=1e-3).locally_stable


def test_the_reason_of_a_critical_delay_of_nothing_is_told(cli):
    _, out, _ = cli("stability", "cacc", "--set", "kd=1")
    assert "its own acceleration comes back late with a gain of 1.5, 1 or more" in out
    _, out, _ = cli("stability", "cacc", "--set", "kp=.2", "--set", "kd=.6", "--set", "kv=.2", "--set", "ka=.9")
    assert "short waves then grow up to 9 times per vehicle" in out


@pytest.mark.parametrize("late", [0.002, 0.005, 0.0101, 0.3])
def test_short_waves_beyond_the_sweep_are_part_of_the_verdict(late):
    found = linear(CACC(kp=0.2, kd=0.6, kv=0.2, ka=0.9, h=1.5), delay=late)
    sampled = float(np.max(found.gain(np.linspace(0.01, 40.0 * math.pi / late, 400_001))))
    assert found.peak_gain >= 9.0 * (1.0 - 1e-12)
    assert found.peak_gain == pytest.approx(max(sampled, 9.0), rel=1e-4)
    assert not found.string_stable
    assert found.margin == -math.inf
    assert found.critical_delay("string") == 0.0
    rows = sweep.rows_of([found])
    assert sweep.judge(rows).words == ["string unstable"] or not found.locally_stable
    assert float(np.max(found.gain(np.linspace(1.0, 4.0 * math.pi / late, 20_001) + 10.0 / late))) > 8.0


def test_a_small_lag_moves_growth_to_high_frequencies_and_is_not_missed():
    found = linear(CACC(kp=0.2, kd=0.6, kv=0.2, ka=0.9, h=1.5), delay=0.002, lag=1e-3)
    assert found.peak_frequency > 200.0
    assert found.peak_gain == pytest.approx(1.50202, rel=1e-5)
    assert not found.string_stable
    assert sweep.peaks_of(sweep.rows_of([found])).gain[0] == pytest.approx(found.peak_gain, rel=1e-6)


def test_chain_of_a_neutral_equation():
    equation = QuasiPolynomial.of((1.0, 1, 0.0), (0.5, 1, 2.0), (1.0, 0, 0.0))
    assert roots.chain_abscissa(equation) == pytest.approx(math.log(0.5) / 2.0)
    assert roots.chain_abscissa(QuasiPolynomial.of((1.0, 1, 0.0), (1.0, 0, 1.0))) == -math.inf
    assert roots.growing_roots(QuasiPolynomial.of((1.0, 1, 0.0), (2.0, 0, 1.0))) == 2  # π/2 < 2
    two = QuasiPolynomial.of((1.0, 1, 0.0), (0.3, 1, 1.0), (0.4, 1, 2.0), (1.0, 0, 0.0))
    x = math.exp(-roots.chain_abscissa(two))
    assert 0.3 * x + 0.4 * x * x == pytest.approx(1.0)


# -- laws that hear the platoon leader, and laws that hear hardly anything ---------------------------


def test_a_law_that_hears_the_leader_has_no_verdict_on_one_vehicle():
    car = hw.Vehicle(path, delay={"al": 0.2, "a0l": 0.2, "v0l": 0.2})
    found = hw.linearize(car, 20.0)
    for name in ("string_stable", "peak", "peak_gain", "peak_frequency", "margin", "long_wave", "impulse_norm",
                 "peak_stable"):  # fmt: skip
        with pytest.raises(hw.LeaderHeardError, match="hears the platoon leader"):
            getattr(found, name)
    for asked in (lambda: found.critical_delay("string"), lambda: found.critical("C1"), found.propagation,
                  lambda: found.growth(1.0), lambda: sweep.rows_of([found]),
                  lambda: hw.head_to_tail([car], 20.0).strictly_string_stable,
                  lambda: stability_map(car, {"C1": (0.1, 0.9, 4)}, speed=20.0)):  # fmt: skip
        with pytest.raises(hw.LeaderHeardError):
            asked()
    # what one vehicle has
    assert found.locally_stable
    assert found.critical_delay("local") > 1.0
    assert stability_map(car, {"C1": (0.1, 0.9, 4)}, speed=20.0, what="local").shares["oscillating"] >= 0.0


def test_the_platoon_of_a_law_that_hears_the_leader_is_the_sum_over_its_vehicles():
    """V_n = Gⁿ V_0 + R (1 - Gⁿ)/(1 - G) V_0 for equal vehicles."""
    car = hw.Vehicle(path, delay={"al": 0.2, "a0l": 0.2, "v0l": 0.2}, lag=0.3)
    chain = hw.head_to_tail([car] * 6, 20.0)
    one = chain.vehicles[0]
    w = np.geomspace(0.02, 20.0, 200)
    g = one.transfer(1j * w)
    r = one.leader_numerator(1j * w) / one.characteristic(1j * w)
    for n, got in enumerate(chain.responses(w), start=1):
        assert got == pytest.approx(g**n + r * (1 - g**n) / (1 - g), rel=1e-9)
    sampled = max(float(np.max(np.abs(x))) for x in chain.responses(np.geomspace(1e-3, 1e3, 20_001)))
    assert chain.worst.gain == pytest.approx(sampled, rel=1e-6)
    # a small sine grows at the first car as theory says
    omega = chain.worst.frequency
    period = 2 * math.pi / omega
    scenario = hw.Scenario(hw.sine(20.0, 1e-3, omega), [car] * 2, duration=20 * period, output_step=period / 64)
    run = hw.simulate(scenario).sel(time=slice(18 * period - 1e-6, 20 * period))
    swing = (run.speed.max("time") - run.speed.min("time")).values
    assert swing[1:] / swing[0] == pytest.approx(np.abs(chain.responses(omega))[:2], rel=1e-3)


def test_study_and_command_line_give_the_platoon_its_verdict(cli, tmp_path):
    law = tmp_path / "law.py"
    law.write_text(
        "import headway as hw\n"
        "@hw.model\ndef far(s, v, dv, v0l, *, k=0.2, c=0.6, far=0.4, s0=10.0):\n"
        "    return k * (s - s0) + c * dv + far * (v0l - v)\n"
    )
    code, out, _ = cli("stability", "far", "--model", f"{law}:far", "--speed", "20")
    assert code == 0
    assert "no growth per vehicle is defined" in out
    assert "head to tail over 10 vehicles: " in out
    code, out, _ = cli("stability", "far", "--model", f"{law}:far", "--speed", "20", "--json")
    report = json.loads(out)
    assert report["string_stable"] is None
    assert report["head_to_tail"]["vehicles"] == 10
    sc = hw.Scenario(hw.sine(20, 1, 0.5), [hw.Vehicle(path)] * 3, duration=10)
    theory = hw.Study(sc, {"lag": [0.0, 0.4]}).stability()
    assert np.isnan(theory.string_stable.values).all()
    assert np.isnan(theory.margin.values).all()
    assert theory.locally_stable.values.all()
    chain = hw.head_to_tail([hw.Vehicle(path, lag=0.4)] * 3, 20.0)
    assert theory.head_to_tail_gain.values[1] == pytest.approx(chain.peak.gain)


def test_a_law_that_hears_nothing_but_the_acceleration_ahead():
    """Nothing corrects its speed: a deviation stays, which is not stable, and no error."""
    for lag in (0.0, 0.3):
        found = hw.linearize(hw.Vehicle(echo, lag=lag), 20.0, 10.0)
        assert found.rightmost_root == 0.0
        assert found.decay_rate == 0.0
        assert not found.locally_stable
        assert not found.string_stable
        assert (found.critical_delay("local"), found.critical_delay("string")) == (0.0, 0.0)
        assert sweep.judge(sweep.rows_of([found])).words == ["locally unstable"]


def test_own_acceleration_heard_at_once_with_a_gain_of_1_is_refused():
    with pytest.raises(hw.HeadwayError, match="what it commands is not defined"):
        hw.linearize(any_law(fa=1.0), 15.0)


# -- the one place that judges -----------------------------------------------------------------------


def test_verdicts_have_names():
    cars = [hw.Vehicle(IDM(), delay=t) for t in (0.5, 1.5, 3.0)]
    found = sweep.judge(sweep.rows_of([hw.linearize(car, 23.0) for car in cars]))
    assert found.words == ["string stable", "string unstable", "locally unstable"]
    assert found.locally_stable.tolist() == [True, True, False]
    assert found.string_stable.tolist() == [True, False, False]
    assert found.codes.tolist() == [3, 2, 1]
    assert found.growing.tolist() == [0, 0, 2]


def test_equal_vehicles_grow_by_the_power_of_their_gain():
    car = hw.Vehicle(IDM(), delay=1.5)
    one, chain = hw.linearize(car, 23.0), hw.head_to_tail([car] * 7, 23.0)
    assert chain.peak.gain == pytest.approx(one.peak_gain**7, rel=1e-12)
    assert chain.worst == chain.peak
    assert chain.peak.frequency == one.peak_frequency
    with pytest.raises(hw.HeadwayError, match="2 gaps are given for 3 vehicles"):
        hw.head_to_tail([car] * 3, 23.0, [10.0, 10.0])
