"""Equilibria of a law: closed form where the law brings one, safe root finding otherwise."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from contextlib import suppress
from typing import TYPE_CHECKING, Any

import numpy as np

from headway.checked import number
from headway.errors import HeadwayError, NoEquilibriumError, RestsEverywhereError

if TYPE_CHECKING:
    from headway.models.law import Law, Model

__all__ = ["gap_at", "gaps_at", "policy", "rests_everywhere", "speed_at"]

#: gaps [m] and speeds [m/s] between which roots are searched where no closed form exists
_GAPS = np.geomspace(1e-3, 1e5, 161)
_SPEEDS = np.concatenate(([0.0], np.geomspace(1e-3, 150.0, 160)))


def gap_at(model: Model, speed: float) -> float:
    """See `Model.equilibrium_gap`."""
    v = number(speed, f"equilibrium speed of {model.name}", "m/s")
    if v < 0:
        raise HeadwayError(f"equilibrium speed of {model.name} = {v:g} m/s is negative; vehicles drive forwards")
    low, high = _speed_range(model)
    if not (low <= v <= high):
        raise _no_equilibrium(model, v, low, high)
    form = model.law.forms.get("equilibrium_gap")
    if form is None:
        return _root(model, lambda s: model.at_rest(s, v), _GAPS, f"at {v:g} m/s", "gap")
    with np.errstate(all="ignore"):
        s = float(form(v, **model.parameters))
    if math.isnan(s):  # not answered: CACC without a gain on the gap rests at every gap
        return _root(model, lambda s: model.at_rest(s, v), _GAPS, f"at {v:g} m/s", "gap")
    if not math.isfinite(s):
        raise _no_equilibrium(model, v, low, high)
    return s


def speed_at(model: Model, gap: float) -> float:
    """See `Model.equilibrium_speed`."""
    s = number(gap, f"equilibrium gap of {model.name}", "m")
    if s <= 0:
        raise HeadwayError(f"equilibrium gap of {model.name} = {s:g} m is not positive")
    form = model.law.forms.get("equilibrium_speed")
    if form is None:
        low, high = _speed_range(model)
        grid = _SPEEDS[(low <= _SPEEDS) & (high >= _SPEEDS)]
        if math.isfinite(high):
            grid = np.append(grid, high)
        return _root(model, lambda v: model.at_rest(s, v), grid, f"at a gap of {s:g} m", "speed")
    v = float(form(s, **model.parameters))
    if not math.isfinite(v) or v < 0:
        raise NoEquilibriumError(f"{model.name} has no equilibrium speed at a gap of {s:g} m")
    return v


def rests_everywhere(model: Model) -> bool:
    """See `Model.rests_everywhere`."""
    with np.errstate(all="ignore"):
        values = [float(model.at_rest(float(s), v)) for v in (2.0, 15.0, 30.0) for s in _GAPS[::8]]
    return _vanishes(np.array(values))


def gaps_at(law: Law, parameters: Mapping[str, Any], speed: Any) -> np.ndarray:
    """Equilibrium gaps [m] of many models of one law: NaN where there is none, or where every gap is one.

    Parameters and `speed` [m/s] are numbers or arrays that broadcast.
    """
    names = tuple(parameters)
    v, *arrays = (np.asarray(x, dtype=float) for x in np.broadcast_arrays(speed, *parameters.values()))
    given = {n: parameters[n] if np.ndim(parameters[n]) == 0 else x for n, x in zip(names, arrays, strict=True)}
    form, bounds = law.forms.get("equilibrium_gap"), law.forms.get("speed_range")
    try:
        with np.errstate(all="ignore"):
            low, high = (0.0, math.inf) if bounds is None else bounds(**given)
            inside = (v >= np.maximum(low, 0.0)) & (v <= high)
            s = np.full(v.shape, np.nan) if form is None else np.asarray(form(v, **given))
            if np.any(np.isnan(s) & inside):  # no closed form, or one that does not answer here
                s = np.where(np.isnan(s), _bisected(law, given, v), s)
            return np.where(inside & np.isfinite(s), s, np.nan)
    except (TypeError, ValueError):  # a law or a closed form that branches with `if`: one point after the other
        s = np.full(v.shape, np.nan)
        for i in np.ndindex(v.shape):
            with suppress(HeadwayError):
                s[i] = gap_at(law(**{n: float(x[i]) for n, x in zip(names, arrays, strict=True)}), float(v[i]))
        return s


def _bisected(law: Law, parameters: Mapping[str, Any], v: np.ndarray) -> np.ndarray:
    """Roots of the acceleration in the gap: the first sign change on the grid, bisected; NaN where that is none."""
    from headway.models.law import Model

    model = Model(law, tuple(parameters.items()))
    low, high = np.full(v.shape, np.nan), np.full(v.shape, np.nan)
    before = np.asarray(model.at_rest(np.full(v.shape, _GAPS[0]), v))
    scale = np.zeros(v.shape)
    for left, right in itertools.pairwise(_GAPS):
        after = np.asarray(model.at_rest(np.full(v.shape, right), v))
        first = np.isnan(low) & (np.sign(before) != np.sign(after)) & np.isfinite(before) & np.isfinite(after)
        low[first], high[first], scale[first] = left, right, (np.abs(before) + np.abs(after))[first]
        before = after
    rising = np.asarray(model.at_rest(high, v)) > 0
    for _ in range(60):
        middle = 0.5 * (low + high)
        above = (np.asarray(model.at_rest(middle, v)) > 0) == rising
        low, high = np.where(above, low, middle), np.where(above, middle, high)
    root = 0.5 * (low + high)
    return np.where(np.abs(model.at_rest(root, v)) <= 1e-6 * scale, root, np.nan)


def policy(model: Model, speed: Any) -> Any:
    """See `Model.desired_gap`."""
    v = np.asarray(speed, dtype=float)
    low, high = _speed_range(model)
    inside = (v >= low) & (v <= high)
    form = model.law.forms.get("equilibrium_gap")
    if form is not None:
        with np.errstate(all="ignore"):
            s = np.asarray(form(v, **model.parameters), dtype=float)
        result = np.where(inside & np.isfinite(s), s, np.nan)
    else:
        result = _interpolated_policy(model, v, inside)
    return float(result) if np.ndim(speed) == 0 else result


def _interpolated_policy(model: Model, v: np.ndarray, inside: np.ndarray) -> np.ndarray:
    """The policy of a law without a closed form, from exact roots on 65 Chebyshev speeds between its extremes."""
    result = np.full(v.shape, np.nan)
    known = inside & np.isfinite(v) & (v >= 0)
    if not known.any():
        return result
    low, high = float(v[known].min()), float(v[known].max())
    nodes = np.unique(0.5 * (low + high) + 0.5 * (high - low) * np.cos(np.pi * np.arange(65) / 64))
    gaps = np.full(nodes.size, np.nan)
    for i, node in enumerate(nodes):
        try:
            gaps[i] = gap_at(model, float(node))
        except HeadwayError:
            continue
    good = np.isfinite(gaps)
    if good.sum() < 2:
        return np.where(known & good.any() & (nodes.size == 1), gaps[0], np.nan)
    from scipy.interpolate import PchipInterpolator

    result[known] = PchipInterpolator(nodes[good], gaps[good], extrapolate=False)(v[known])
    return result


def _speed_range(model: Model) -> tuple[float, float]:
    form = model.law.forms.get("speed_range")
    return (0.0, math.inf) if form is None else form(**model.parameters)


def _vanishes(accelerations: np.ndarray) -> bool:
    """Whether all that is finite of these accelerations [m/s²] is zero, and something is."""
    finite = accelerations[np.isfinite(accelerations)]
    return bool(finite.size and np.all(np.abs(finite) < 1e-14))


def _no_equilibrium(model: Model, v: float, low: float, high: float) -> NoEquilibriumError:
    bound = f"between {low:g} and {high:g} m/s" if math.isfinite(high) else f"above {low:g} m/s"
    return NoEquilibriumError(
        f"{model.name} has no equilibrium at {v:g} m/s; with these parameters it has them {bound}"
    )


def _root(model: Model, f: Any, grid: np.ndarray, where: str, what: str) -> float:
    """The root of `f` on `grid`: the first sign change that is no jump or pole, polished by Brent's method."""
    from scipy.optimize import brentq

    with np.errstate(all="ignore"):
        values = np.array([float(f(float(x))) for x in grid])
    finite = np.isfinite(values)
    if not finite.any():
        raise NoEquilibriumError(f"{model.name} returns no finite acceleration {where}")
    if _vanishes(values):
        raise RestsEverywhereError(
            f"{model.name}: every {what} is an equilibrium {where}, so the {what} must be given"
            + (" (e.g. gaps = 10)" if what == "gap" else "")
        )
    exact = np.flatnonzero(values == 0.0)
    if exact.size:
        return float(grid[exact[0]])
    change = np.flatnonzero(finite[:-1] & finite[1:] & (np.sign(values[:-1]) != np.sign(values[1:])))
    if not change.size:
        raise NoEquilibriumError(
            f"{model.name} has no equilibrium {what} {where}: its acceleration stays "
            f"{'positive' if values[finite][0] > 0 else 'negative'} from {grid[0]:g} to {grid[-1]:g}"
        )
    for i in change:
        root = float(brentq(f, grid[i], grid[i + 1], xtol=1e-13, rtol=1e-15))
        if abs(float(f(root))) <= 1e-6 * (abs(values[i]) + abs(values[i + 1])):
            return root
    raise NoEquilibriumError(f"{model.name} has no equilibrium {what} {where}: its acceleration jumps over 0")
