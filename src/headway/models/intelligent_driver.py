"""The Intelligent Driver Model (Treiber, Hennecke and Helbing 2000) and its spacing-only configuration."""

from __future__ import annotations

from typing import Annotated

import numpy as np

from headway.models.law import Param, model
from headway.models.maths import maximum, power

__all__ = ["IDM", "IDMSpacing"]

_SOURCE = "Treiber, Hennecke, Helbing, Phys. Rev. E 62, 1805 (2000)"
_DOI = "10.1103/PhysRevE.62.1805"


@model(
    name="idm",
    title="Intelligent Driver Model",
    formula="a [1 - (v/v0)^δ - (s*/s)²],  s* = s0 + s1 √(v/v0) + T v - v dv / (2 √(a b))",
    source=_SOURCE,
    doi=_DOI,
)
def IDM(
    s,
    v,
    dv,
    *,
    a: Annotated[float, Param("m/s²", 0.01, 10.0, "maximum acceleration")] = 1.0,
    b: Annotated[float, Param("m/s²", 0.01, 20.0, "comfortable deceleration")] = 1.5,
    T: Annotated[float, Param("s", 0.0, 10.0, "desired time gap")] = 1.5,
    s0: Annotated[float, Param("m", 0.0, 50.0, "least gap at standstill")] = 2.0,
    v0: Annotated[float, Param("m/s", 0.1, 100.0, "desired speed")] = 33.33,
    delta: Annotated[float, Param("1", 0.1, 20.0, "acceleration exponent", structural=True)] = 4.0,
    s1: Annotated[float, Param("m", 0.0, 50.0, "speed-dependent jam distance", structural=True)] = 0.0,
):
    desired = s0 + T * v - v * dv / (2.0 * np.sqrt(a * b))
    ratio = maximum(v, 0.0) / v0
    if s1 != 0.0:
        desired = desired + s1 * np.sqrt(ratio)
    closeness = desired / s
    return a * (1.0 - power(ratio, delta) - closeness * closeness)


@IDM.closed_form("equilibrium_gap")
def _idm_gap(v, *, T, s0, v0, delta, s1, **_):
    return (s0 + T * v + s1 * np.sqrt(v / v0)) / np.sqrt(1.0 - (v / v0) ** delta)


@IDM.closed_form("speed_range")
def _idm_range(*, v0, **_):
    return 0.0, np.nextafter(v0, 0.0)


@model(
    name="idm-spacing",
    title="IDM, configuration I of the paper: spacing only",
    formula="a [1 - (s*/s)²],  s* = s0 + T v",
    source=f"configuration I of the comparative study, after {_SOURCE}",
    doi=_DOI,
)
def IDMSpacing(
    s,
    v,
    *,
    a: Annotated[float, Param("m/s²", 0.01, 10.0, "maximum acceleration")] = 1.0,
    T: Annotated[float, Param("s", 0.0, 10.0, "desired time gap")] = 1.5,
    s0: Annotated[float, Param("m", 0.0, 50.0, "least gap at standstill")] = 2.0,
):
    closeness = (s0 + T * v) / s
    return a * (1.0 - closeness * closeness)


@IDMSpacing.closed_form("equilibrium_gap")
def _spacing_gap(v, *, T, s0, **_):
    return s0 + T * v


@IDMSpacing.closed_form("equilibrium_speed")
def _spacing_speed(s, *, T, s0, **_):
    with np.errstate(all="ignore"):
        return np.where(T > 0, (s - s0) / T, np.nan)
