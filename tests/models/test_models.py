"""Laws: exact derivatives, equilibria, spacing policies, and models as values."""

from __future__ import annotations

import copy
import dataclasses
import math
import pickle
from typing import Annotated

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from strategies import models

import headway as hw
from headway import maths
from headway.errors import NoEquilibriumError, RestsEverywhereError
from headway.models import BUILT_IN, CACC, FVDM, GMM, IDM, OVM, IDMSpacing
from headway.models.dual import Dual, partials
from headway.models.registry import find

STATES = {
    "s": st.floats(0.5, 150.0),
    "v": st.floats(0.05, 50.0),
    "dv": st.floats(-15.0, 15.0),
    "a": st.floats(-5.0, 5.0),
    "vl": st.floats(0.0, 50.0),
    "al": st.floats(-5.0, 5.0),
}


@st.composite
def resting(draw, laws=(OVM, FVDM, IDM, IDMSpacing, CACC)):
    """A model and a speed at which it has an equilibrium, well inside their range."""
    model = draw(models(laws))
    top = {"ovm": lambda: model.v0 * (1 + math.tanh(model.h / model.w)), "idm": lambda: model.v0}
    top["fvdm"] = top["ovm"]
    return model, draw(st.floats(0.05, 0.95)) * top.get(model.name, lambda: 50.0)()


def without_forms(model):
    return dataclasses.replace(model.law, forms={})(**model.parameters)


def by_complex_step(model, state):
    return {n: np.imag(model(*(complex(x, 1e-40 * (k == n)) for k, x in state.items()))) / 1e-40 for n in state}


@pytest.mark.parametrize("law", BUILT_IN.values(), ids=BUILT_IN)
@given(data=st.data())
def test_duals_agree_with_complex_steps(law, data):
    model = data.draw(models((law,)))
    state = {n: data.draw(STATES[n]) for n in law.signals}
    exact, stepped = partials(model, state), by_complex_step(model, state)
    scale = 1.0 + abs(model(*state.values())) + max(abs(x) for x in stepped.values())
    for n in law.signals:
        assert exact[n] == pytest.approx(stepped[n], rel=1e-11, abs=1e-12 * scale), n


DUAL_FUNCTIONS = {
    "sqrt": np.sqrt, "exp": np.exp, "log": np.log, "log1p": np.log1p, "expm1": np.expm1, "tanh": np.tanh,
    "sinh": np.sinh, "cosh": np.cosh, "sin": np.sin, "cos": np.cos, "tan": np.tan, "arctan": np.arctan,
    "square": np.square, "negative": np.negative, "power": lambda x: np.power(x, 2.5), "to a dual": lambda x: x**x,
    "of a number": lambda x: 1.7**x, "divided": lambda x: 3.0 / (1.0 + x) - x / 2.0, "np.add": lambda x: np.add(1.0, x),
    "np.subtract": lambda x: np.subtract(1.0, x), "np.multiply": lambda x: np.multiply(2.0, x),
    "np.divide": lambda x: np.divide(2.0, x), "numpy scalar": lambda x: np.float64(2.0) * x - np.float64(1.0),
    "maths.tanh": maths.tanh, "maths.power": lambda x: maths.power(x, -2.0),
    "where": lambda x: maths.where(x.real > 1.0, x * x, 2.0 * x - 1.0) if not isinstance(x, Dual)
    else maths.where(x > 1.0, x * x, 2.0 * x - 1.0),
}  # fmt: skip


@pytest.mark.parametrize("name", DUAL_FUNCTIONS)
@given(x=st.floats(0.1, 1.4))
@settings(max_examples=25)
def test_dual_functions_agree_with_complex_steps(name, x):
    function = DUAL_FUNCTIONS[name]
    stepped = function(complex(x, 1e-40)).imag / 1e-40
    result = function(Dual(x, [1.0]))
    assert result.slope[0] == pytest.approx(stepped, rel=1e-12, abs=1e-14)
    assert result.value == pytest.approx(function(complex(x)).real, rel=1e-14)


def test_a_dual_takes_the_branch_of_its_value():
    x = Dual(2.0, [1.0])
    assert np.maximum(x, 1.0) is x
    assert np.minimum(1.0, x) == 1.0
    assert max(0.0, x) is x
    assert abs(-x).slope[0] == 1.0
    assert np.where(x > 1.0, x, 0.0) is x
    assert np.clip(x, 0.0, 1.5) == 1.5
    assert not Dual(0.0, [1.0])
    with pytest.raises(hw.HeadwayError, match="loses its derivative"):
        math.exp(x)


@given(resting((OVM, FVDM, IDM, IDMSpacing, CACC)))
def test_partials_are_those_of_the_theory(case):
    model, v = case
    model = model.replace(s1=0) if model.law is IDM else model
    f, s = model.partials(v), model.equilibrium_gap(v)
    if model.law in (OVM, FVDM):
        slope = model.v0 / model.w * (1 - math.tanh((s - model.h) / model.w) ** 2)
        expected = {"s": model.alpha * slope, "v": -model.alpha}
        expected |= {"dv": model.lam} if model.law is FVDM else {}
    elif model.law is CACC:
        kp, kd, kv, h = model.kp, model.kd, model.kv, model.h
        expected = {"s": kp, "v": -kp * h - kv, "dv": kd, "a": -kd * h, "vl": kv, "al": model.ka}
    elif model.law is IDMSpacing:
        expected = {"s": 2 * model.a / s, "v": -2 * model.a * model.T / s}
    else:
        a, desired, delta = model.a, model.s0 + model.T * v, model.delta
        free = a * delta * v ** (delta - 1) / model.v0**delta
        expected = {
            "s": 2 * a * desired**2 / s**3,
            "v": -free - 2 * a * desired * model.T / s**2,
            "dv": desired * v * math.sqrt(a / model.b) / s**2,
        }
    assert f == pytest.approx(expected, rel=1e-9, abs=1e-12)


@given(v=st.floats(0.1, 40), s=st.floats(1, 100), model=models((GMM,)))
def test_gmm_partials_are_those_of_the_theory(v, s, model):
    f = model.partials(v, s)
    assert f == pytest.approx({"s": 0.0, "v": 0.0, "dv": model.alpha * v**model.m / s**model.l}, rel=1e-12)


@given(resting((OVM, FVDM, IDM, CACC)))
def test_the_slope_of_the_policy_is_that_of_the_partials(case):
    model, v = case
    h = 1e-4 * v
    slope = (model.equilibrium_gap(v + h) - model.equilibrium_gap(v - h)) / (2 * h)
    f = model.partials(v)
    assert slope == pytest.approx(-(f["v"] + f.get("vl", 0.0)) / f["s"], rel=2e-5)


def string_margin(f):
    return f["v"] ** 2 - 2 * f["v"] * f.get("dv", 0.0) - 2 * f["s"]


@given(v=st.floats(1, 40), a=st.floats(0.1, 5), T=st.floats(0.2, 3), s0=st.floats(0.5, 5))
def test_spacing_only_idm_is_string_stable_iff_a_T2_exceeds_its_gap(v, a, T, s0):
    margin = a * T * T - (s0 + v * T)
    assume(abs(margin) > 1e-6)
    assert (string_margin(IDMSpacing(a=a, T=T, s0=s0).partials(v)) > 0) == (margin > 0)


@given(v=st.floats(1, 40), lam=st.floats(0, 3))
def test_fvdm_is_string_stable_iff_half_alpha_plus_lambda_reaches_the_slope(v, lam):
    slope = OVM(alpha=1).partials(v)["s"]
    for factor, stable in ((0.999, False), (1.001, True)):
        alpha = 2 * (slope - lam) * factor
        assume(0.001 < alpha < 200)
        assert (string_margin(FVDM(alpha=alpha, lam=lam).partials(v)) > 0) == stable


@given(resting())
def test_equilibrium_gap_and_speed_are_inverse_and_at_rest(case):
    model, v = case
    s = model.equilibrium_gap(v)
    f = model.partials(v)
    assert model.equilibrium_speed(s) == pytest.approx(v, rel=1e-8)
    scale = 1 + abs(f["s"]) * s + abs(f["v"]) * v + model.parameters.get("alpha", 0) * v
    assert abs(model.at_rest(s, v)) < 1e-12 * scale
    assert model.desired_gap(v) == pytest.approx(s, rel=1e-15)


@given(resting())
def test_closed_forms_agree_with_the_root_finder(case):
    model, v = case
    plain, s = without_forms(model), model.equilibrium_gap(v)
    assert plain.equilibrium_gap(v) == pytest.approx(s, rel=1e-7)
    assert plain.equilibrium_speed(s) == pytest.approx(v, rel=1e-7)


def test_a_policy_without_closed_form_follows_the_exact_one():
    speeds = np.linspace(3, 30, 200).reshape(4, 50)
    exact = IDM.forms["equilibrium_gap"](speeds, **IDM().parameters)
    assert np.allclose(without_forms(IDM()).desired_gap(speeds), exact, rtol=2e-4)
    narrow = np.linspace(22, 24, 50)
    assert np.allclose(without_forms(IDM()).desired_gap(narrow), IDM().desired_gap(narrow), rtol=1e-8)


@pytest.mark.parametrize("model", [IDM(), without_forms(IDM()), OVM(), CACC()], ids=["idm", "no forms", "ovm", "cacc"])
def test_desired_gap_keeps_the_shape_and_is_nan_outside(model):
    speeds = np.array([[-1.0, 5.0, 20.0], [30.0, 200.0, np.nan]])
    gaps = model.desired_gap(speeds)
    assert gaps.shape == (2, 3)
    inside = np.array([[False, True, True], [True, model.law is CACC, False]])
    assert np.array_equal(np.isfinite(gaps), inside)
    assert isinstance(model.desired_gap(20), float)
    assert model.desired_gap(20) == pytest.approx(gaps[0, 2], rel=1e-3)
    assert model.desired_gap([20.0, 20.0]).shape == (2,)


def test_gmm_has_no_policy_and_says_that_a_gap_must_be_given():
    assert np.isnan(GMM().desired_gap(np.array([5.0, 20.0]))).all()
    with pytest.raises(hw.HeadwayError, match="every gap is an equilibrium at 20 m/s, so the gap must be given"):
        GMM().equilibrium_gap(20)
    with pytest.raises(hw.HeadwayError, match="every speed is an equilibrium"):
        GMM().equilibrium_speed(20)
    with pytest.raises(hw.HeadwayError, match="every gap is an equilibrium"):
        CACC(kp=0).equilibrium_gap(20)


def test_a_pole_is_no_equilibrium():
    @hw.model
    def polar(s, v):
        return 1 / (s - 5.0) - 0.01 * v

    assert polar().equilibrium_gap(20) == pytest.approx(10.0)

    @hw.model
    def jumping(s, v):
        return -1.0 - v if s < 5 else 1.0 + v

    with pytest.raises(hw.HeadwayError, match="jumps over 0"):
        jumping().equilibrium_gap(20)


EXPONENTS = [(0, 0), (1, 0), (0, 1), (1, 2), (2, 2), (-1, 1), (-2, -1), (1.5, 0.7), (4, 6), (0.5, 3)]


@pytest.mark.parametrize(("m", "l"), EXPONENTS)
def test_gmm_is_its_formula_for_any_exponents(m, l):  # noqa: E741  the published symbol
    model = GMM(alpha=1.7, m=m, l=l)
    s, v, dv = np.array([3.0, 12.0, 50.0]), np.array([0.5, 8.0, 30.0]), np.array([-2.0, 0.5, 1.0])
    expected = [1.7 * y**m / x**l * d for x, y, d in zip(s, v, dv, strict=True)]
    assert np.allclose(model(s, v, dv), expected, rtol=1e-14)
    assert [model(*x) for x in zip(s, v, dv, strict=True)] == pytest.approx(expected, rel=1e-14)


@given(model=models((IDM,)), s=STATES["s"], v=STATES["v"], dv=STATES["dv"])
def test_idm_is_its_formula_with_s1_and_any_delta(model, s, v, dv):
    desired = model.s0 + model.s1 * math.sqrt(v / model.v0) + model.T * v - v * dv / (2 * math.sqrt(model.a * model.b))
    expected = model.a * (1 - (v / model.v0) ** model.delta - (desired / s) ** 2)
    scale = model.a * (1 + (v / model.v0) ** model.delta + (abs(desired / s) + 1) ** 2)
    assert model(s, v, dv) == pytest.approx(expected, abs=1e-13 * scale)


@given(model=models((CACC,)), s=STATES["s"], v=STATES["v"], dv=STATES["dv"], vl=STATES["vl"], al=STATES["al"])
def test_cacc_without_radio_gains_is_the_spacing_controller(model, s, v, dv, vl, al):
    plain = model.replace(kv=0, ka=0)
    kp, kd, h, r = plain.kp, plain.kd, plain.h, plain.r
    a = (kp * (s - r - h * v) + kd * dv) / (1 + kd * h)  # theory 2: the loop, solved
    assert plain(s, v, dv, a, vl, al) == pytest.approx(a, abs=1e-10 * (1 + abs(a) * (1 + kd * h)))
    assert plain(s, v, dv, a, vl, al) == plain(s, v, dv, a, 0.0, 0.0)


def test_tanh_is_accurate_to_4e_16():
    x = np.concatenate((np.linspace(-25, 25, 200_001), np.geomspace(1e-300, 1, 10_000), [0.0, np.inf, -np.inf]))
    exact = np.tanh(x.astype(np.longdouble))
    assert float(np.max(np.abs(maths.tanh(x) - exact))) < 4e-16
    assert np.isnan(maths.tanh(np.nan))


NAMES = {
    "parameter": (lambda: IDM(t=1.5), "parameter of idm: 't' is not known.*did you mean 'T'"),
    "another parameter": (lambda: CACC().replace(kpp=1), "did you mean 'kp'"),
    "law": (lambda: find("imd"), "did you mean 'idm'"),
    "signal": (lambda: IDM().acceleration(s=1, v=1, dvv=0), "signal of idm: 'dvv'.*did you mean 'dv'"),
    "missing signal": (lambda: IDM().acceleration(s=1, v=1), "idm needs the signal dv"),
    "signal of a law": (lambda: hw.model(lambda s, vel: s), "signal of law.*'vel'.*did you mean 'v"),
    "speed": (lambda: IDM().equilibrium_gap(-1), "-1 m/s is negative"),
    "no speed": (lambda: IDM().equilibrium_gap("fast"), "'fast' is not a number"),
    "too fast": (lambda: IDM(v0=20).equilibrium_gap(21), "idm has no equilibrium at 21 m/s.*between 0 and 20 m/s"),
    "no gap": (lambda: IDM().equilibrium_speed(0), "0 m is not positive"),
    "too near": (lambda: IDM(s0=2).equilibrium_speed(1), "idm has no equilibrium speed at a gap of 1 m"),
}  # fmt: skip


@pytest.mark.parametrize("name", NAMES)
def test_mistakes_are_named(name):
    act, words = NAMES[name]
    with pytest.raises(hw.HeadwayError, match=words):
        act()


def test_a_name_that_headway_lacks_is_named():
    with pytest.raises(AttributeError, match="did you mean 'simulate'"):
        hw.simulat  # noqa: B018
    with pytest.raises(AttributeError, match="idm has no parameter or attribute 'x'"):
        IDM().x  # noqa: B018


@given(models())
def test_models_are_values(model):
    same = model.law(**model.parameters)
    assert model == same
    assert hash(model) == hash(same)
    assert copy.deepcopy(model) == copy.copy(model) == pickle.loads(pickle.dumps(model)) == model
    assert model.replace() == model
    first = next(iter(model.parameters))
    info = model.law.parameters[first].info
    other = model.replace(**{first: info.low if model.parameters[first] != info.low else info.high})
    assert other != model
    assert model == same, "replace leaves the original as it was"
    assert getattr(other, first) == other.parameters[first]
    assert len({model, same, other}) == 2


def test_models_cannot_be_changed():
    idm = IDM(T=1.2)
    for name in ("T", "items", "law", "anything"):
        with pytest.raises(dataclasses.FrozenInstanceError):
            setattr(idm, name, 3.0)
    idm.parameters["T"] = 9.0
    assert idm.T == 1.2
    assert IDM(T=np.float32(1.5)).T == IDM(T=1.5).T
    assert "T=1.2" in repr(idm)


def test_laws_of_the_same_name_and_parameters_are_different_models():
    @hw.model
    def soft(s, v, *, k: Annotated[float, hw.Param("1/s²", 0.1, 1)] = 0.2):
        return k * (s - v)

    first = soft()

    @hw.model
    def soft(s, v, *, k: Annotated[float, hw.Param("1/s²", 0.1, 1)] = 0.2):
        return k * (s - 2 * v)

    assert first != soft()


@pytest.mark.parametrize("law", BUILT_IN.values(), ids=lambda law: law.name)
def test_who_rests_everywhere(law):
    assert law().rests_everywhere == (law.name == "gmm")


def test_rests_everywhere_is_of_the_values_and_not_of_the_law():
    held = hw.models.CACC(kp=0.0)
    assert held.rests_everywhere
    with pytest.raises(RestsEverywhereError, match="every gap is an equilibrium at 20 m/s"):
        held.equilibrium_gap(20.0)


def test_no_equilibrium_has_a_type():
    with pytest.raises(NoEquilibriumError, match="no equilibrium at 40 m/s"):
        hw.models.IDM(v0=33.0).equilibrium_gap(40.0)
    with pytest.raises(RestsEverywhereError):
        hw.models.GMM().equilibrium_speed(20.0)
