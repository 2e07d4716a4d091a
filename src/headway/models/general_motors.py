"""The General Motors model (Gazis, Herman and Rothery 1961)."""

from __future__ import annotations

from typing import Annotated

import numpy as np

from headway.models.law import Param, model
from headway.models.maths import maximum, power

__all__ = ["GMM"]


@model(
    name="gmm",
    title="General Motors Model (Gazis-Herman-Rothery)",
    formula="α v^m / s^l · dv",
    source="Gazis, Herman, Rothery, Oper. Res. 9, 545 (1961)",
    doi="10.1287/opre.9.4.545",
)
def GMM(
    s,
    v,
    dv,
    *,
    alpha: Annotated[
        float, Param("m^(l-m)/s^(1-m)", 0.0001, 100000.0, "sensitivity; its unit depends on m and l")
    ] = 1.5,
    m: Annotated[float, Param("1", -2.0, 4.0, "speed exponent", structural=True)] = 1.0,
    l: Annotated[float, Param("1", -1.0, 6.0, "spacing exponent", structural=True)] = 2.0,  # noqa: E741  the published symbol
):
    return alpha * power(maximum(v, 0.0), m) / power(s, l) * dv


@GMM.closed_form("equilibrium_gap")
def _gap(v, **_):
    return np.full(np.shape(v), np.nan)  # it rests at every gap, so it desires none
