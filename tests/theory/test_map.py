"""Stability maps: the compiled sweep against the theory of one vehicle, traced boundaries against closed forms."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import headway as hw
from headway.limits import LIMITS
from headway.literature.barhoumi2025.maps import NAMES, reproduced_map
from headway.models import CACC, FVDM, GMM, IDM, OVM, IDMSpacing
from headway.theory import sweep
from headway.theory.map import axis, stability_map

STABLE = "string stable"


@hw.model
def own(s, v, dv, *, k=0.2, c=0.6, T=1.2, s0=2.0):
    """Linear constant-time-gap follower without a closed form."""
    return k * (s - s0 - T * v) + c * dv


@hw.model
def branching(s, v, dv, *, k=0.2, c=0.6, T=1.2, s0=2.0):
    """The same with an `if`, which arrays cannot take."""
    if s < 1.0:
        return -3.0
    return k * (s - s0 - T * v) + c * dv


def swept(function, linear, *kinds):
    outputs = [np.empty(1, kind) for kind in kinds]
    function(sweep.rows_of([linear]), *outputs)
    return [x[0] for x in outputs]


delays = st.floats(0.0, 3.0)
vehicles = st.one_of(
    st.builds(
        lambda a, b, T, d, lag: hw.Vehicle(IDM(a=a, b=b, T=T), delay=d, lag=lag),
        st.floats(0.3, 3), st.floats(0.5, 3), st.floats(0.3, 3),
        st.one_of(delays, st.builds(lambda s, v: {"s": s, "dv": v}, delays, delays),
                  st.builds(lambda s, v: {"s": s, "vl": v}, delays, delays)),
        st.sampled_from([0.0, 0.3]),
    ),
    st.builds(
        lambda kp, kv, ka, d, lag: hw.Vehicle(CACC(kp=kp, kv=kv, ka=ka), delay=d, lag=lag),
        st.floats(0.05, 1), st.floats(0, 2), st.floats(0, 1.2),
        st.one_of(st.floats(0.0, 0.8), st.builds(lambda s, v: {"vl": s, "al": v}, delays, delays)),
        st.sampled_from([0.0, 0.2]),
    ),
    st.builds(lambda a, d: hw.Vehicle(GMM(alpha=a), delay=d), st.floats(0.2, 5), delays),
    st.builds(lambda a, d: hw.Vehicle(OVM(alpha=a, v0=20, h=25, w=12), delay=d), st.floats(0.3, 3), delays),
)  # fmt: skip


@given(vehicles)
@settings(max_examples=60)
def test_sweep_is_the_theory_of_one_vehicle(car):
    linear = hw.linearize(car, 15.0, 12.0 if car.model.name == "gmm" else None)
    margin, growing = swept(sweep.fill_margins, linear, float, int)
    if math.isfinite(margin):
        assert margin == pytest.approx(linear.margin, rel=1e-7, abs=1e-8)
    assert (growing == 0) == linear.locally_stable or abs(linear.decay_rate) < 1e-9
    decay, pair = swept(sweep.fill_decay_rates, linear, float, bool)
    assert decay == pytest.approx(linear.decay_rate, rel=1e-8, abs=1e-8)
    if linear.roots.roots.size < 2 or abs(linear.roots.roots[1].real - linear.roots.roots[0].real) > 1e-6:
        assert pair == (abs(linear.rightmost_root.imag) > 1e-7)
    gain, frequency = swept(sweep.fill_peaks, linear, float, float)
    assert gain == pytest.approx(linear.peak_gain, rel=1e-8)
    if gain > 1 + 1e-6 and math.isfinite(frequency):
        assert float(linear.gain(frequency)) == pytest.approx(gain, rel=1e-9)


@given(st.floats(0.3, 3), st.floats(0.3, 3), st.sampled_from([1.0, {"s": 1.0, "dv": 1.0}, {"s": 1.0, "vl": 1.0}]))
@settings(max_examples=6)
def test_critical_delay_of_the_sweep(a, T, delay):
    linear = hw.linearize(hw.Vehicle(IDM(a=a, T=T), delay=delay), 23.0)
    (found,) = swept(sweep.fill_critical_delays, linear, float)
    assert found == pytest.approx(linear.critical_delay("string"), rel=1e-7, abs=1e-7)


# -- boundaries ------------------------------------------------------------------------------------


@pytest.mark.parametrize(("law", "name", "late"), [
    (IDM, "delay", 1.0), (CACC, "radio_delay", {"vl": 1.0, "al": 1.0}), (IDM, "delay.s", {"s": 1.0}),
    (IDM, "delay.vl", {"vl": 1.0}),
])  # fmt: skip
def test_boundary_over_time_gap_and_delay_is_the_critical_delay(law, name, late):
    gap = "T" if law is IDM else "h"
    found = stability_map(law, {gap: (0.5, 2.5, 31), name: (0.0, 3.0, 31)}, speed=23.0)
    points = np.concatenate(found.boundary[STABLE])
    assert len(points) > 20
    for T, tau in points[::12]:
        exact = hw.linearize(hw.Vehicle(law(**{gap: T}), delay=late), 23.0).critical_delay("string")
        assert tau == pytest.approx(exact, abs=3e-6)


@pytest.mark.parametrize("delay", [0.0, {"s": 1.0, "dv": 0.5}, {"s": 0.3, "vl": 0.6}])
def test_map_of_critical_delays_scales_the_pattern_of_the_vehicle(delay):
    axes = {"T": np.linspace(0.9, 2.5, 5), "a": np.linspace(0.8, 2.0, 3)}
    found = stability_map(hw.Vehicle(IDM, delay=delay), axes, speed=23.0, what="critical_delay")
    for i, T in enumerate(axes["T"]):
        for j, a in enumerate(axes["a"]):
            exact = hw.linearize(hw.Vehicle(IDM(T=T, a=a), delay=delay), 23.0).critical_delay("string")
            assert found.dataset.critical_delay.values[i, j] == pytest.approx(exact, rel=1e-7, abs=1e-7)


@pytest.mark.parametrize(("name", "own", "means"), [
    ("delay", 0.0, lambda x: x),
    ("delay", {"s": 0.7, "vl": 0.4}, lambda x: x),  # the pattern of the vehicle has no say, its radio is current
    ("radio_delay", 0.2, lambda x: {"s": 0.2, "v": 0.2, "dv": 0.2, "a": 0.2, "vl": x, "al": x}),
    ("radio_delay", {"s": 0.3, "al": 0.9}, lambda x: {"s": 0.3, "vl": x, "al": x}),
    ("delay.al", {"vl": 0.3}, lambda x: {"vl": 0.3, "al": x}),
])  # fmt: skip
def test_axes_of_delays_mean_what_a_vehicle_means(name, own, means):
    found = stability_map(hw.Vehicle(CACC, delay=own), {name: (0.0, 1.2, 7), "ka": (0.1, 0.9, 3)}, speed=20.0)
    for i, x in enumerate(found.axes[name]):
        for j, ka in enumerate(found.axes["ka"]):
            linear = hw.linearize(hw.Vehicle(CACC(ka=ka), delay=means(float(x))), 20.0)
            assert found.dataset.margin.values[i, j] == pytest.approx(linear.margin, rel=1e-6, abs=1e-8)


def test_delays_of_both_kinds_are_axes_of_one_map():
    found = stability_map(CACC, {"delay": (0.0, 0.4, 3), "radio_delay": (0.0, 0.6, 3)}, speed=20.0)
    for i, x in enumerate(found.axes["delay"]):
        for j, y in enumerate(found.axes["radio_delay"]):
            late = {**dict.fromkeys(("s", "v", "dv", "a"), float(x)), **dict.fromkeys(("vl", "al"), float(y))}
            linear = hw.linearize(hw.Vehicle(CACC, delay=late), 20.0)
            assert found.dataset.margin.values[i, j] == pytest.approx(linear.margin, rel=1e-6, abs=1e-8)


@pytest.mark.parametrize(("axes", "words"), [
    (None, "axes needs a mapping"), ([("T", (1, 2))], "axes needs a mapping"),
    ({"T": (1.0, 2.0, 10**7), "a": (1.0, 2.0, 10**7)}, r"a map of 1e\+07 × 1e\+07 asks for 1e\+14 points"),
    ({"T": (1.0, 2.0, 1e300)}, "HEADWAY_LIMIT"), ({"T": (1.0, None)}, "is no range"),
    ({"T": (1.0, 2.0, math.inf)}, "HEADWAY_LIMIT"), ({"T": (1, 10**400)}, "is no range"),
    ({"delay": (0.0, 1e308)}, "up to 1e\\+06 s"), ({"lag": (0.0, 1e30)}, "up to 1e\\+06 s"),
])  # fmt: skip
def test_axes_that_are_none_or_too_many(axes, words):
    with pytest.raises(hw.HeadwayError, match=words) as told:
        stability_map(IDM, axes, speed=20.0)
    assert len(str(told.value)) <= 300


def test_a_larger_map_is_made_on_purpose(monkeypatch):
    monkeypatch.setitem(LIMITS, "points of a map", 20)
    with pytest.raises(hw.HeadwayError, match="HEADWAY_LIMIT=10 "):
        stability_map(IDM, {"T": (1.0, 2.0, 30)}, speed=20.0)
    monkeypatch.setenv("HEADWAY_LIMIT", "10")
    assert stability_map(IDM, {"T": (1.0, 2.0, 30)}, speed=20.0).dataset.verdict.size == 30


@pytest.mark.parametrize(("law", "axis", "words"), [
    (IDM, "radio_delay", "hears nothing by radio; its delays are those of delay"),
    (hw.model(lambda vl, al, *, k=0.5: k * (vl - 20.0) + k * al), "delay", "measures nothing on board"),
])  # fmt: skip
def test_a_delay_without_effect_is_no_axis(law, axis, words):
    with pytest.raises(hw.HeadwayError, match=words):
        stability_map(law, {axis: (0.0, 1.0, 4)}, speed=20.0, gap=10.0)


def test_boundary_without_delay_is_the_criterion():
    found = stability_map(IDM, {"speed": (1.0, 33.0, 41), "T": (0.3, 3.0, 41)})
    for v, T in np.concatenate(found.boundary[STABLE])[::5]:
        f = hw.linearize(IDM(T=T), v).partials
        slope = 1e-5  # what 1e-6 of the axes can change in the criterion
        assert f["v"] ** 2 - 2 * f["v"] * f["dv"] - 2 * f["s"] == pytest.approx(0.0, abs=slope)


def test_ovm_boundary_is_twice_the_slope():
    found = stability_map(OVM, {"gap": (0.5, 12.0, 60), "alpha": (0.01, 44.5, 60)})
    for gap, alpha in np.concatenate(found.boundary[STABLE]):
        assert alpha == pytest.approx(44.0 / math.cosh(gap - 4.0) ** 2, abs=1e-4)


def test_cacc_boundary_without_delay_is_its_two_conditions():
    found = stability_map(CACC, {"kv": (0.0, 2.0, 41), "ka": (0.0, 2.0, 41)}, speed=20.0)
    for kv, ka in np.concatenate(found.boundary[STABLE]):
        assert min(abs(ka - 1.375), abs(ka + 1.5 * kv + 0.45 * 1.125 - 1.0)) < 4e-6


def test_gmm_boundaries_are_hermans():
    car = hw.Vehicle(GMM, delay=1.0)
    axes = {"alpha": (0.01, 3.0, 20), "l": (0.0, 3.0, 20)}
    string = stability_map(car, axes, speed=23.0, gap=10.0)
    for name, limit in ((STABLE, 0.5), ("string unstable", math.pi / 2)):
        for alpha, exponent in np.concatenate(string.boundary[name]):
            assert alpha * 23.0 / 10.0**exponent == pytest.approx(limit, rel=2e-5)
    local = stability_map(car, axes, speed=23.0, gap=10.0, what="local")
    for name, limit in (("not oscillating", math.exp(-1)), ("oscillating", math.pi / 2)):
        for alpha, exponent in np.concatenate(local.boundary[name]):
            assert alpha * 23.0 / 10.0**exponent == pytest.approx(limit, rel=2e-5)


def test_local_classes_without_delay_are_those_of_the_damping_ratio():
    found = stability_map(own, {"k": (0.05, 1.0, 30), "c": (0.05, 2.0, 30)}, speed=20.0, what="local")
    for k, c in np.concatenate(found.boundary["not oscillating"]):
        assert hw.linearize(own(k=k, c=c), 20.0).damping_ratio == pytest.approx(1.0, abs=1e-5)


def test_one_axis_has_points_for_boundary():
    found = stability_map(IDM, {"delay": (0.0, 4.0, 50)}, speed=23.0)
    ((point,),) = found.boundary[STABLE]
    assert point[0] == pytest.approx(1.19052559126, abs=4e-6)
    ((point,),) = found.boundary["string unstable"]
    assert point[0] == pytest.approx(2.81483511042, abs=4e-6)


# -- what a map shows ------------------------------------------------------------------------------


def test_every_kind_of_map_shows_what_the_linear_vehicle_says():
    T, lag = np.array([0.6, 2.4]), np.array([0.0, 0.4])
    car = hw.Vehicle(IDM, delay={"s": 0.4, "dv": 0.9})
    maps = {what: stability_map(car, {"T": T, "lag": lag}, speed=18.0, what=what).dataset
            for what in ("string", "local", "gain", "critical_delay")}  # fmt: skip
    for i, t in enumerate(T):
        for j, a in enumerate(lag):
            linear = hw.linearize(hw.Vehicle(IDM(T=t), delay={"s": 0.4, "dv": 0.9}, lag=a), 18.0)
            assert maps["string"].margin[i, j] == pytest.approx(linear.margin, abs=1e-9)
            assert (maps["string"].verdict[i, j] == 3) == linear.string_stable
            assert maps["local"].decay_rate[i, j] == pytest.approx(linear.decay_rate, abs=1e-8)
            assert maps["gain"].gain[i, j] == pytest.approx(linear.peak_gain, rel=1e-9)
            expected = linear.critical_delay("string")
            assert maps["critical_delay"].critical_delay[i, j] == pytest.approx(expected, abs=1e-7)


def test_delays_of_single_signals_and_frequency_as_axes():
    found = stability_map(
        hw.Vehicle(CACC, delay={"al": 0.3}), {"delay.vl": (0.0, 1.0, 5), "ka": (0.0, 1.2, 4), "omega": (0.2, 2.0, 6)},
        speed=20.0, what="gain",
    )  # fmt: skip
    assert found.classes[2:] == ("grows", "does not grow")
    for i, tau in enumerate(found.axes["delay.vl"]):
        for j, ka in enumerate(found.axes["ka"]):
            linear = hw.linearize(hw.Vehicle(CACC(ka=ka), delay={"al": 0.3, "vl": tau}), 20.0)
            assert found.dataset.gain.values[i, j] == pytest.approx(linear.gain(found.axes["omega"]), rel=1e-12)
    assert {line.shape[1] for lines in found.boundary.values() for line in lines} == {3}


@pytest.mark.parametrize("law", [own, branching])
def test_laws_of_ones_own(law):
    """Without a closed form, and with an `if` that arrays cannot take: the same map, least time gap included."""
    found = stability_map(law, {"T": (0.5, 3.0, 12), "speed": (5.0, 30.0, 9)})
    for T, v in np.concatenate(found.boundary[STABLE])[::4]:
        assert abs(T - hw.linearize(own(T=1.2), v).critical("T")) < 3e-6


def test_points_without_equilibrium_are_a_class_of_their_own():
    found = stability_map(IDM, {"speed": (10.0, 40.0, 31), "v0": (20.0, 45.0, 26)})
    none = found.dataset.verdict.values == 0
    speed, desired = np.meshgrid(found.axes["speed"], found.axes["v0"], indexing="ij")
    assert np.array_equal(none, speed >= desired)
    assert np.array_equal(none, np.isnan(found.dataset.margin.values))
    assert found.shares["no equilibrium"] == pytest.approx(none.mean())
    # a boundary whose points all lie where there is no equilibrium on one side is traced, too
    for v, v0 in np.concatenate(stability_map(IDM, {"speed": (1.0, 40.0, 20), "T": (0.4, 3.0, 9)}).boundary[STABLE]):
        assert v <= 33.33 + 1e-3
        assert v0 >= 0.4


def test_verdict_of_a_map_of_critical_delays_is_that_of_the_vehicle():
    axes = {"T": (0.5, 2.5, 12), "a": (0.3, 2.0, 12)}
    for delay in (0.0, 0.6):
        found = stability_map(hw.Vehicle(IDM, delay=delay), axes, speed=18.0, what="critical_delay")
        critical, verdict = found.dataset.critical_delay.values, found.dataset.verdict.values
        assert np.array_equal(verdict == 3, critical > delay)
        assert np.array_equal(verdict, stability_map(hw.Vehicle(IDM, delay=delay), axes, speed=18.0).dataset.verdict)


def test_speed_and_gap_that_are_not_in_equilibrium():
    found = stability_map(IDM, {"gap": (10.0, 40.0, 16), "a": (0.5, 2.0, 4)}, speed=None)
    for s in found.axes["gap"]:
        assert IDM().equilibrium_speed(s) > 0
    with pytest.raises(hw.HeadwayError, match="rests at no speed and gap"):
        stability_map(IDM, {"T": (1.0, 2.0, 4)}, speed=23.0, gap=10.0)


def test_a_part_of_a_map_has_the_same_bits():
    whole = stability_map(hw.Vehicle(IDM, delay=0.9), {"T": np.linspace(0.5, 2.5, 80), "a": np.linspace(0.5, 2, 60)},
                          speed=20.0)  # fmt: skip
    part = stability_map(hw.Vehicle(IDM, delay=0.9), {"T": whole.axes["T"][40:43], "a": whole.axes["a"][7:9]},
                         speed=20.0)  # fmt: skip
    assert np.array_equal(part.dataset.margin.values, whole.dataset.margin.values[40:43, 7:9])


def test_delays_of_minutes_are_swept_finely_instead_of_failing():
    found = stability_map(IDMSpacing, {"delay.s": (0.0, 150.0, 7)}, speed=20.0)
    assert found.dataset.verdict.values.tolist() == [2, 1, 1, 1, 1, 1, 1]


def test_saved_and_read_again(tmp_path):
    found = stability_map(FVDM(v0=20, h=25, w=12), {"alpha": (0.1, 2.0, 20), "lam": (0.0, 1.5, 20)}, speed=15.0)
    found.save(tmp_path / "map.nc")
    again = hw.open_results(tmp_path / "map.nc")
    assert again.verdict.equals(found.dataset.verdict)
    line = again["boundary_string_stable"].values
    assert np.array_equal(line[~np.isnan(line[:, 0])], np.concatenate(found.boundary[STABLE]))


# -- the paper's maps ------------------------------------------------------------------------------


def panel(name, number):
    return reproduced_map(name).panels[number][1]


def test_printed_idm_condition_calls_every_time_gap_unstable():
    printed, corrected, true = (p for _, p in reproduced_map("idm").panels)
    at_rest = np.abs(printed.axes["approach"]) < 0.03
    assert np.all(printed.dataset.verdict.values[at_rest] == 1)
    assert np.all(corrected.dataset.verdict.values[at_rest] == 2)
    assert 0.2 < true.shares[STABLE] < 0.8


def test_printed_ovm_condition_is_right_without_delay():
    printed, true, late = (p for _, p in reproduced_map("ovm").panels)
    assert np.array_equal(printed.dataset.verdict.values == 2, true.dataset.verdict.values == 3)
    assert late.shares[STABLE] < true.shares[STABLE]


def test_printed_gmm_condition_has_nothing_to_do_with_the_truth():
    printed, true, late = (p for _, p in reproduced_map("gmm").panels)
    assert true.shares[STABLE] == 1.0
    assert printed.shares["condition holds"] < 0.1
    assert late.shares["locally unstable"] > 0.4


def test_printed_cacc_condition_is_neither_necessary_nor_sufficient():
    printed, true, *_ = (p for _, p in reproduced_map("cacc").panels)
    holds, stable = printed.dataset.verdict.values == 2, true.dataset.verdict.values == 3
    assert (holds & ~stable).any()
    assert (~holds & stable).any()


def test_printed_longest_delay_has_no_value_over_most_of_the_space():
    printed, true = (p for _, p in reproduced_map("cacc-3d").panels)
    assert printed.shares["no value"] > 0.5
    kv, ka = 12, 9
    car = hw.Vehicle(CACC(kv=true.axes["kv"][kv], ka=true.axes["ka"][ka]), delay={"vl": 0.15, "al": 0.15})
    gain = hw.linearize(car, 23.0).gain(true.axes["omega"])
    assert np.array_equal(true.dataset.verdict.values[kv, ka] == 3, gain <= 1 + 1e-9)


# -- the command line ------------------------------------------------------------------------------


def test_command_line_writes_map_and_figure(cli, tmp_path):
    out, figure = tmp_path / "map.nc", tmp_path / "map.png"
    code, text, _ = cli("map", "idm", "--x", "T=0.5:2.5:40", "--y", "delay=0:1.5:40", "--point", "T=1.5,delay=0.4",
                        "--out", out, "--figure", figure)  # fmt: skip
    assert code == 0
    assert text.startswith("idm over T 0.5 to 2.5 s and delay 0 to 1.5 s, speed 23 m/s: ")
    assert "boundary of 'string stable'" in text
    assert hw.open_results(out).attrs["speed"] == 23
    assert figure.stat().st_size > 10_000
    _, text, _ = cli("map", "--x", "T=0.5:2.5:9", "--y", "delay=0:1.5:9", "--what", "gain", "--json")
    report = json.loads(text)
    assert report["axes"] == {"T": [0.5, 2.5, 9], "delay": [0.0, 1.5, 9]}
    assert sum(report["shares"].values()) == pytest.approx(1.0)
    assert len(report["boundary"][STABLE][0][0]) == 2


@pytest.mark.parametrize("name", NAMES)
def test_command_line_draws_the_papers_maps(cli, tmp_path, name):
    figure = tmp_path / "map.png"
    code, text, _ = cli("map", name, "--figure", figure)
    assert code == 0
    assert "printed" in text
    assert "true" in text
    assert figure.stat().st_size > 20_000


@pytest.mark.parametrize(("arguments", "words"), [
    (["idm", "--x", "TT=0:1"], "axis of a map of idm: 'TT'"),
    (["idm", "--x", "T=2:1"], "axis T: 2 to 1 is reversed"),
    (["idm", "--x", "T=1:1"], "axis T: 1 to 1 is an empty range"),
    (["idm", "--x", "T=0:20"], "idm.T = 20 s is out of bounds"),
    (["idm", "--x", "T=0:1:1"], "1 points make no axis"),
    (["idm", "--x", "T=0:1:2.5"], "name=low:high:count"),
    (["idm", "--x", "T"], "name=low:high"),
    (["idm", "--x", "T=0:inf"], "not a finite range"),
    (["idm", "--x", "delay=-1:1"], "axis delay: -1 is not allowed"),
    (["idm", "--x", "gap=0:1"], "axis gap: 0 is not allowed"),
    (["idm", "--x", "T=1:2", "--y", "T=1:2"], "given twice"),
    (["idm", "--y", "T=1:2"], "--y is given without --x"),
    (["idm", "--x", "T=1:2", "--what", "strong"], "did you mean 'string'"),
    (["idm", "--x", "omega=0.1:2"], "omega belongs to a map of the gain"),
    (["idm", "--x", "delay=0:1", "--what", "critical_delay"], "delays are no axes"),
    (["idm", "--x", "delay=0:1", "--y", "delay.s=0:1"], "all these signals late alike or one by one"),
    (["idm", "--x", "delay.dv=0:1", "--y", "delay.vl=0:1"], "not both"),
    (["idm", "--x", "speed=40:50"], "no equilibrium at 45"),
    (["idm", "--x", "speed=10:20", "--speed", "15"], "speed is an axis of the map and given as 15"),
    (["gmm", "--x", "alpha=1:2"], "with --gap, e.g. --gap 10"),
    (["fvdm"], "needs an axis"),
    (["idmm"], "did you mean 'idm'"),
    (["idm", "--speed", "20"], "--speed belongs to a map of one's own"),
    (["idm", "--x", "T=1:2:5", "--point", "a=1", "--figure", "f.png"], "'a' is not known"),
    (["idm", "--x", "T=1:2:5", "--y", "a=1:2:5", "--point", "T=1", "--figure", "f.png"], "no value for the axis a"),
    (["idm", "--x", "T=1:2:5", "--point", "T=5", "--figure", "f.png"], "not on the map"),
    (["idm", "--x", "T=1:2:5", "--point", "T=1.5"], "name one with --figure"),
    (["idm", "--x", "T=1:2:5", "--point", "here", "--figure", "f.png"], "write T=1.5,delay=0.4"),
    (["idm", "--x", "T=1:2", "--out", "map.txt"], "ending in .nc"),
    (["idm", "--out", "map.nc"], "figures of several panels"),
])  # fmt: skip
def test_bad_input(cli, arguments, words, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    code, out, error = cli("map", *arguments)
    assert (code, out) == (2, "")
    assert not list(tmp_path.iterdir())
    assert words in error
    assert error.count("\n") == 1


@pytest.mark.parametrize(("values", "words"), [
    ("wide", "neither a range"), ([1.0, 3.0, 2.0], "that rise"), ([1.0], "at least two"), ((1.0, math.nan), "finite"),
])  # fmt: skip
def test_bad_axes(values, words):
    with pytest.raises(hw.HeadwayError, match=words):
        axis("T", values)


def test_a_map_has_at_most_three_axes():
    with pytest.raises(hw.HeadwayError, match="one to three axes, not 4"):
        stability_map(IDM, dict.fromkeys(("T", "a", "b", "s0"), (1.0, 2.0)), speed=20.0)


def test_a_law_that_is_nowhere_differentiable_says_so():
    @hw.model
    def rooted(s, v, *, k=1.0):
        return k * np.sign(s - v) * np.sqrt(abs(s - v))

    with pytest.raises(hw.HeadwayError, match="no differentiable equilibrium"):
        stability_map(rooted, {"k": (1.0, 2.0, 4)}, speed=10.0)
