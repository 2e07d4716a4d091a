"""Laws of one's own: how they are read, compiled, checked and told apart."""

from __future__ import annotations

import math
import types
import warnings
from typing import Annotated

import numpy as np
import pytest

import headway as hw
from headway import maths
from headway.engine.compile import evaluate
from headway.models import BUILT_IN, CACC, IDM
from headway.models.fingerprint import fingerprint

Gain = Annotated[float, hw.Param("1/s²", 0.01, 5.0, "gain on the gap")]


@hw.model
def cautious(s, v, dv, *, k: Gain = 0.2, T: Annotated[float, hw.Param("s", 0.1, 5)] = 1.2):
    """Follows with two gains: it brakes harder than it accelerates.

    More words.
    """
    wish = k * (s - 2.0 - T * v) + 0.6 * dv
    if dv < 0.0:
        wish = wish + 0.3 * dv
    return maths.where(wish > 0.0, wish, 1.5 * wish) + 0.1 * maths.tanh(0.5 * dv)


@hw.model
def my_idm(s, v, dv, *, a=1.0, b=1.5, T=1.5, s0=2.0, v0=33.33):
    desired = s0 + T * v - v * dv / (2.0 * np.sqrt(a * b))
    ratio = maths.maximum(v, 0.0) / v0
    closeness = desired / s
    squared = ratio * ratio
    return a * (1.0 - squared * squared - closeness * closeness)


@hw.model
def my_cacc(s, v, dv, a, vl, al, *, kp=0.45, kd=0.25, kv=0.5, ka=0.5, h=1.5, r=2.0):
    return kp * (s - r - h * v) + kd * (dv - h * a) + kv * (vl - v) + ka * al


def test_a_signature_is_the_description():
    assert cautious.signals == ("s", "v", "dv")
    assert cautious.title == "Follows with two gains: it brakes harder than it accelerates"
    k = cautious.parameters["k"]
    assert (k.default, k.info.unit, k.info.low, k.info.high, k.info.text) == (0.2, "1/s²", 0.01, 5.0, "gain on the gap")
    assert cautious(k=0.3).acceleration(s=20, v=10, dv=0) == pytest.approx(0.3 * 6)


FILE = '''
{future}
from typing import Annotated
import headway as hw

@hw.model
def soft(s, v, dv, *, k: Annotated[float, hw.Param("1/s²", 0.01, 1.0, "stiffness")] = 0.2, c: float = 0.6):
    """Soft."""
    return k * (s - 2.0 - 1.2 * v) + c * dv
'''


@pytest.mark.parametrize("future", ["", "from __future__ import annotations"])
def test_annotations_are_read_with_and_without_the_future_import(future, tmp_path):
    file = tmp_path / "laws.py"
    file.write_text(FILE.format(future=future))
    (law,) = hw.load_laws(f"{file}:soft")
    assert law.parameters["k"].info == hw.Param("1/s²", 0.01, 1.0, "stiffness")
    assert law.parameters["c"].info == hw.Param()
    with pytest.raises(hw.HeadwayError, match=r"soft.k = 2 1/s² is out of bounds; allowed is 0.01 to 1 1/s²"):
        law(k=2)


def bad(source):
    def make():
        space = {"hw": hw, "Annotated": Annotated}
        exec(source, space)
        return hw.model(space["f"])

    return make


SIGNATURES = {
    "unreadable annotation": ("def f(s, *, k: 'Nowhere' = 1): ...", "annotation cannot be read.*Nowhere"),
    "no default": ("def f(s, *, k): ...", "parameter k needs a default value"),
    "default is text": ("def f(s, *, k='1'): ...", "f.k = '1' is not a number"),
    "default out of bounds": ("def f(s, *, k: Annotated[float, hw.Param('m', 2, 3)] = 1): ...", "f.k = 1 m is out of"),
    "empty bounds": ("def f(s, *, k: Annotated[float, hw.Param('m', 3, 2)] = 1): ...", "3 to 2, an empty range"),
    "signal with a default": ("def f(s, v=1): ...", "signal v has a default value"),
    "star": ("def f(*s): ...", "name each signal"),
    "keywords": ("def f(s, **k): ...", "name each signal"),
    "no signal": ("def f(*, k=1): ...", "perceives no signal"),
}


@pytest.mark.parametrize("name", SIGNATURES)
def test_signatures_that_are_no_law(name):
    source, words = SIGNATURES[name]
    with pytest.raises(hw.HeadwayError, match=words):
        bad(source)()


def test_the_books_sign_of_the_relative_speed_is_warned_of():
    def approach(s, v, dv, *, k=0.2):
        return k * (s - 2.0 - 1.2 * v) - 0.6 * dv

    with pytest.warns(hw.HeadwayWarning, match=r"approach slows down the more the gap opens .*-0.6 1/s.*turn its sign"):
        hw.model(approach)


def states(law, count=500):
    draw = np.random.default_rng(1)
    columns = {"s": draw.uniform(1, 100, count), "v": draw.uniform(0, 40, count)}
    return np.array([columns.get(n, draw.uniform(-5, 5, count)) for n in law.signals])


def test_a_law_with_if_where_and_tanh_compiles_to_what_it_says():
    columns = states(cautious)
    plain = [cautious()(*x) for x in columns.T]
    assert np.allclose(evaluate(cautious(), columns), plain, rtol=1e-14, atol=1e-14)


@pytest.mark.parametrize(("own", "built_in"), [(my_idm, IDM), (my_cacc, CACC)], ids=["idm", "cacc"])
def test_the_same_formula_gives_the_same_bits(own, built_in):
    leader = hw.sine(23, 2, 0.63)
    runs = [
        hw.simulate(hw.Scenario(leader, [hw.Vehicle(m, delay=d) for d in (0.0, 0.33)], duration=20, gaps=35))
        for m in (own, built_in)
    ]
    for name in ("position", "speed", "acceleration"):
        assert np.array_equal(runs[0][name], runs[1][name]), name


@pytest.mark.parametrize("law", BUILT_IN.values(), ids=BUILT_IN)
def test_built_in_laws_conform(law):
    for check in hw.check_model(law):
        assert check.passed, f"{check.name}: {check.message}"


def test_a_law_with_branches_conforms():
    assert all(c.passed for c in hw.check_model(cautious) if c.name != "has exact derivatives")


K = Annotated[float, hw.Param("1/s²", 0.01, 5)]
dice = np.random.default_rng(0)


def bare(s, v, dv, *, k=0.2):
    return k * (s - 2.0 - 1.2 * v) + 0.6 * dv


def gappy(s, v, dv, *, k: K = 0.2):
    return k * (s - 2.0 - 1.2 * v) + 0.6 * dv + 0.0 * np.sqrt(2.5 - dv)


def listing(s, v, dv, *, k: K = 0.2):
    return np.array([k * (s - 2.0 - 1.2 * v) + 0.6 * dv])


def random(s, v, dv, *, k: K = 0.2):
    return k * (s - 2.0 - 1.2 * v) + 0.6 * dv + 0.01 * dice.random()


def restless(s, v, dv, *, k: K = 0.2):
    return 1.0 + 0.0 * k * s


def turned(s, v, dv, *, k: K = 0.2):
    return k * (s - 2.0 - 1.2 * v) - 0.6 * dv


def insane(s, v, dv, *, k: K = 0.2):
    return k * (2.0 + 1.2 * v - s) + 0.6 * dv


def cornered(s, v, dv, *, k: K = 0.2):
    e = k * (s - 2.0 - 1.2 * v)
    return max(e, 0.5 * e) + 0.6 * dv


def uncompilable(s, v, dv, *, k: K = 0.2):
    return float(f"{k}") * (s - 2.0 - 1.2 * v) + 0.6 * dv


def curved(s, v, dv, a, *, k: K = 0.2):
    return k * (s - 2.0 - 1.2 * v) + 0.6 * dv - 0.1 * a * a


def unsolvable(s, v, dv, a, *, k: K = 0.2):
    return k * (s - 2.0 - 1.2 * v) + 0.6 * dv + a


def undamped(s, v, dv, *, k: K = 0.25):
    return k * (s - 2.0)


def idle(s, v, dv, *, k: K = 0.2, unused: K = 0.2):
    return k * (s - 2.0 - 1.2 * v) + 0.6 * dv


#: check → a law that fails it, and words of the explanation
BROKEN = {
    "parameters have units and bounds": (bare, "k should have a unit and bounds"),
    "uses all that it asks for": (idle, "unused is never used"),
    "is finite wherever traffic can be": (gappy, "it returns nan at s = 3, v = 0.5, dv = 3"),
    "is a number": (listing, "it returns ndarray, not a number"),
    "gives the same answer twice": (random, "two different numbers"),
    "has an equilibrium": (restless, "no equilibrium gap at any speed"),
    "dv has the right sign": (turned, "turn its sign round"),
    "reacts in the sane direction": (insane, "slows down when the gap grows (f_s = -0.2"),
    "has exact derivatives": (cornered, "keep corners away from equilibria"),
    "compiles to the same numbers": (uncompilable, "cannot be compiled"),
    "is affine in its own acceleration": (curved, "not affine in its own acceleration"),
    "has a solution": (unsolvable, "its coefficient of a is 1"),
    "drives a platoon": (undamped, "a follower collides after"),
}
NAMES = {"is a number": "is finite wherever traffic can be", "has a solution": "is affine in its own acceleration"}


def made(function):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", hw.HeadwayWarning)
        return hw.model(function)


@pytest.mark.parametrize("name", BROKEN)
@pytest.mark.filterwarnings("ignore:invalid value:RuntimeWarning")
def test_each_check_can_fail_and_explains(name):
    function, words = BROKEN[name]
    checks = {c.name: c for c in hw.check_model(made(function))}
    found = checks[NAMES.get(name, name)]
    assert not found.passed
    assert words in found.message


def test_each_check_has_a_law_that_fails_it():
    assert {c.name for c in hw.check_model(IDM)} <= set(BROKEN)


BASE = """
K = 2.0
TABLE = np.array([1.0, 2.0, 3.000000001])
PAIR = (1.0, 2.0)
def helper(x): return x + 1.0
def law(s, v, *, k=0.2):
    '''Says something.'''
    wish = k * helper(s) + tools.half(s) + K * TABLE[2] * PAIR[1]
    return wish + np.sqrt(v) if s in {1.0, 2.0} else maths.tanh(wish)
"""

CHANGES = {
    "the body": ("np.sqrt(v)", "np.exp(v)"),
    "an operator": ("wish + np", "wish - np"),
    "a constant in the body": ("{1.0, 2.0}", "{1.0, 3.0}"),
    "a default": ("k=0.2", "k=0.3"),
    "a number it refers to": ("K = 2.0", "K = 2.5"),
    "a table it refers to": ("3.000000001", "3.000000002"),
    "a tuple it refers to": ("PAIR = (1.0, 2.0)", "PAIR = (1.0, 2.5)"),
    "a helper function": ("x + 1.0", "x + 2.0"),
    "a parameter's name": ("k=0.2):", "q=0.2):\n    k = q"),
}

SAME = {
    "comments": ("    wish =", "    # a comment\n\n    wish ="),
    "its place": ("K = 2.0", "\n\n\nOTHER = 5\nK = 2.0"),
    "its name": ("def law(", "def renamed("),
    "its docstring": ("Says something.", "Says something else."),
    "what it does not refer to": ("K = 2.0", "K = 2.0\ndef unrelated(x): return x"),
}


def identity(source, half=0.5):
    tools = types.ModuleType("tools")
    exec(f"def half(x): return {half} * x\ndef unused(x): return {half}", vars(tools))
    space = {"np": np, "maths": maths, "tools": tools}
    exec(source, space)
    return fingerprint(space.get("law") or space["renamed"])


@pytest.mark.parametrize("what", CHANGES)
def test_the_fingerprint_changes_with(what):
    old, new = CHANGES[what]
    assert BASE.count(old) == 1
    assert identity(BASE.replace(old, new)) != identity(BASE)


@pytest.mark.parametrize("what", SAME)
def test_the_fingerprint_does_not_change_with(what):
    old, new = SAME[what]
    assert BASE.count(old) == 1
    assert identity(BASE.replace(old, new)) == identity(BASE)


def test_the_fingerprint_changes_with_a_helper_of_another_module():
    assert identity(BASE, half=0.6) != identity(BASE)
    assert identity(BASE, half=0.5) == identity(BASE)


def test_the_fingerprint_tells_closures_apart():
    def make(c):
        return lambda s, v: c * s - v

    assert fingerprint(make(1.0)) != fingerprint(make(2.0))
    assert fingerprint(make(1.0)) == fingerprint(make(1.0))
    assert fingerprint(make(math.sqrt)) != fingerprint(make(math.exp))


def test_a_changed_helper_is_compiled_anew(tmp_path):
    file = tmp_path / "mine.py"
    source = "import headway as hw, numba\nGAIN = 0.2\n\n@numba.njit\ndef pull(x):\n    return GAIN * x\n\n"
    source += "@hw.model\ndef mine(s, v):\n    return pull(s - 2.0 - 1.2 * v)\n"
    states = np.array([[20.0], [10.0]])
    for gain in (0.2, 0.4):
        file.write_text(source.replace("GAIN = 0.2", f"GAIN = {gain}"))
        (law,) = hw.load_laws(str(file))
        assert evaluate(law(), states) == pytest.approx([gain * 6.0])


def test_helpers_may_stand_below_the_law(tmp_path):
    file = tmp_path / "below.py"
    source = "import headway as hw\n\n@hw.model\ndef mine(s, v, dv):\n    return pull(s, v) SIGN 0.6 * dv\n\n"
    source += "def pull(s, v):\n    return 0.2 * (s - 2.0 - 1.2 * v)\n"
    file.write_text(source.replace("SIGN", "+"))
    (law,) = hw.load_laws(str(file))
    assert law().acceleration(s=20.0, v=10.0, dv=1.0) == pytest.approx(1.8)
    file.write_text(source.replace("SIGN", "-"))
    with pytest.raises(hw.HeadwayError, match="turn its sign round"):  # looked at again when the file has been read
        hw.load_laws(str(file))


def half_gap(gap):
    return 0.5 * doubled(gap) - 2.0


def doubled(x):
    return 2.0 * x


def test_helpers_in_plain_python_are_compiled_too():
    @hw.model
    def helped(s, v, dv, *, k: K = 0.2):
        return k * (half_gap(s) - 1.2 * v) + 0.6 * dv

    assert all(c.passed for c in hw.check_model(helped) if c.required)
