"""The conformance suite for laws: the properties that every result of headway relies on."""

from __future__ import annotations

import dis
import itertools
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from headway.checked import typed
from headway.errors import HeadwayError, RestsEverywhereError
from headway.models.law import Law, Model
from headway.models.signal import AHEAD, LEADER, OWN, SIGNALS, steady
from headway.models.signs import wrong_sign

__all__ = ["Check", "check_model"]


@dataclass(frozen=True)
class Check:
    """One check of a law.

    Attributes:
        name: the property in words.
        passed: whether the law has it.
        message: why not; "yes" where it passed.
        required: whether a failure is an error, not a warning.
    """

    name: str
    passed: bool
    message: str
    required: bool = True


@typed
def check_model(law: Law) -> tuple[Check, ...]:
    """Run the conformance suite on a law, built in or one's own.

    Args:
        law: the law.

    Returns:
        One result for each check, in a fixed order. Exceptions of the law become failures.
    """
    return tuple(_guarded(name, check, law, required) for name, check, required in _CHECKS)


def _guarded(name: str, check: Callable[[Law], str | None], law: Law, required: bool) -> Check:
    try:
        fault = check(law)
    except HeadwayError as error:
        fault = str(error)
    except Exception as error:  # a person's law may raise anything
        fault = f"it raised {type(error).__name__}: {error}"
    return Check(name, fault is None, fault or "yes", required)


def _states(law: Law) -> Iterator[dict[str, float]]:
    """Yield plausible states of traffic, by signal."""
    for s, v, dv, a in itertools.product(
        (3.0, 12.0, 40.0, 120.0), (0.5, 8.0, 23.0, 33.0), (-4.0, 0.0, 3.0), (-1.0, 0.5)
    ):
        motions = {OWN: (0.0, v, a), AHEAD: (s, v + dv, -a), LEADER: (2.0 * s, v + 0.5 * dv, 0.2)}
        state = {n: SIGNALS[n].value(motions) for n in law.signals}
        yield {n: state[n] for n in law.signals}


def _annotated(law: Law) -> str | None:
    bare = [p.name for p in law.parameters.values() if not p.info.unit or not np.isfinite(p.info.low + p.info.high)]
    if bare:
        return f"{', '.join(bare)} should have a unit and bounds: Annotated[float, Param('s', 0.1, 5.0)]"
    return None


def _used(law: Law) -> str | None:
    """Name signals and parameters that the function's code never reads."""
    code = getattr(law.function, "__wrapped__", law.function).__code__
    read = {i.argval for i in dis.get_instructions(code) if i.opname.startswith("LOAD")} | {*code.co_cellvars}
    # some versions read two at once
    read |= {name for i in dis.get_instructions(code) if isinstance(i.argval, tuple) for name in i.argval}
    idle = [n for n in (*law.signals, *law.parameters) if n not in read]
    return f"{', '.join(idle)} is never used; take it out of the signature" if idle else None


def _finite(law: Law) -> str | None:
    model = law()
    with np.errstate(all="ignore"):
        for state in _states(law):
            value = model(*state.values())
            if not np.isscalar(value) and np.ndim(value) != 0:
                return f"it returns {type(value).__name__}, not a number"
            if not np.isfinite(value):
                where = ", ".join(f"{n} = {x:g}" for n, x in state.items())
                return f"it returns {value} at {where}; a law must be finite wherever traffic can be"
    return None


def _same_twice(law: Law) -> str | None:
    model = law()
    for state in _states(law):
        if model(*state.values()) != model(*state.values()):
            return "it returns two different numbers for the same state; randomness belongs into the scenario"
    return None


def _equilibria(law: Law) -> list[tuple[float, float]]:
    """Return pairs (speed, gap) at which the law rests; a gap of 20 m where it rests at every gap."""
    model, equilibria = law(), []
    for speed in (5.0, 10.0, 15.0, 20.0, 23.0, 25.0, 30.0):
        try:
            equilibria.append((speed, model.equilibrium_gap(speed)))
        except RestsEverywhereError:
            equilibria.append((speed, 20.0))
        except HeadwayError:
            continue
    return equilibria


def _rests(law: Law) -> str | None:
    equilibria = _equilibria(law)
    if not equilibria:
        return "it has no equilibrium gap at any speed from 5 to 30 m/s, so a platoon has no steady state to start from"
    model = law()
    for speed, gap in equilibria:
        rest = abs(float(model.at_rest(gap, speed)))
        if rest > 1e-9:
            return f"at its equilibrium gap {gap:g} m for {speed:g} m/s it accelerates by {rest:.2g} m/s²"
    return None


def _sane_signs(law: Law) -> str | None:
    for speed, gap in _equilibria(law):
        slope = law().partials(speed, gap)
        if slope.get("s", 0.0) < -1e-9:
            return f"at {speed:g} m/s it slows down when the gap grows (f_s = {slope['s']:.3g} 1/s²)"
        if slope.get("v", 0.0) > 1e-9:
            return f"at {speed:g} m/s it speeds up the faster it is (f_v = {slope['v']:.3g} 1/s)"
        if slope.get("dv", 0.0) < -1e-9:
            return (
                f"at {speed:g} m/s it slows down when the gap opens (f_dv = {slope['dv']:.3g} 1/s): is dv turned round?"
            )
    return None


def _sign_of_dv(law: Law) -> str | None:
    return wrong_sign(law)


def _derivatives(law: Law) -> str | None:
    model: Model = law()
    for speed, gap in _equilibria(law):
        state = steady(law.signals, gap, speed)
        exact = model.partials(speed, gap)
        for n in law.signals:
            h = 1e-5 * max(1.0, abs(state[n]))
            up, down = model(*{**state, n: state[n] + h}.values()), model(*{**state, n: state[n] - h}.values())
            numeric = (up - down) / (2 * h)
            if abs(numeric - exact[n]) > 1e-5 * max(1.0, abs(exact[n])):
                return (
                    f"its derivative by {n} at {speed:g} m/s is {exact[n]:.6g} exactly, {numeric:.6g} by differences; "
                    "use arithmetic, headway.maths and NumPy's functions, and keep corners away from equilibria"
                )
    return None


def _compiles(law: Law) -> str | None:
    from headway.engine.compile import evaluate

    model = law()
    states = list(_states(law))
    columns = np.array([[s[n] for s in states] for n in law.signals])
    compiled = evaluate(model, columns)
    plain = np.array([float(model(*s.values())) for s in states])
    worst = int(np.argmax(np.abs(compiled - plain) / (1.0 + np.abs(plain))))
    if abs(compiled[worst] - plain[worst]) > 1e-12 * (1.0 + abs(plain[worst])):
        where = ", ".join(f"{n} = {x:g}" for n, x in states[worst].items())
        return f"compiled it gives {compiled[worst]!r} instead of {plain[worst]!r} at {where}"
    return None


def _affine(law: Law) -> str | None:
    if "a" not in law.signals:
        return None
    model = law()
    for state in _states(law):
        values = [float(model(*{**state, "a": a}.values())) for a in (0.0, 1.0, 3.0)]
        if abs(values[2] - values[0] - 3.0 * (values[1] - values[0])) > 1e-9 * (1.0 + abs(values[0])):
            return "it is not affine in its own acceleration a, so the loop a = f(…, a) has no exact solution"
        if abs(1.0 - (values[1] - values[0])) < 1e-9:
            return "its coefficient of a is 1, so the loop a = f(…, a) has no solution"
    return None


def _drives(law: Law) -> str | None:
    from headway.engine.simulate import simulate
    from headway.scenario.leaders import Sine
    from headway.scenario.scenario import Scenario
    from headway.scenario.vehicle import Vehicle

    equilibria = _equilibria(law)
    if not equilibria:
        return "it has no equilibrium to start from"
    speed, gap = equilibria[len(equilibria) // 2]
    result = simulate(Scenario(Sine(speed, 0.02 * speed, 0.5), [Vehicle(law)] * 3, duration=20, dt=0.05, gaps=gap))
    hit = result.collision_time.values[1:]
    if np.isfinite(hit).any():
        return f"behind a leader that varies by 2 % a follower collides after {np.nanmin(hit):.1f} s"
    return None


_CHECKS: tuple[tuple[str, Callable[[Law], str | None], bool], ...] = (
    ("parameters have units and bounds", _annotated, False),
    ("uses all that it asks for", _used, False),
    ("is finite wherever traffic can be", _finite, True),
    ("gives the same answer twice", _same_twice, True),
    ("has an equilibrium", _rests, True),
    ("dv has the right sign", _sign_of_dv, True),
    ("reacts in the sane direction", _sane_signs, False),
    ("has exact derivatives", _derivatives, True),
    ("compiles to the same numbers", _compiles, True),
    ("is affine in its own acceleration", _affine, True),
    ("drives a platoon", _drives, True),
)
