"""Cooperative adaptive cruise control with a constant time gap."""

from __future__ import annotations

from typing import Annotated

import numpy as np

from headway.models.law import Param, model

__all__ = ["CACC"]


@model(
    name="cacc",
    title="Cooperative Adaptive Cruise Control, constant time gap",
    formula="kp e + kd ė + kv (vl - v) + ka al,  e = s - r - h v,  ė = dv - h a",
    source="Naus et al., IEEE Trans. Veh. Technol. 59, 4268 (2010); Milanés et al., IEEE Trans. Intell. Transp. "
    "Syst. 15, 296 (2014); signs as in docs/decisions.md",
    doi="10.1109/TVT.2010.2076320",
)
def CACC(
    s,
    v,
    dv,
    a,
    vl,
    al,
    *,
    kp: Annotated[float, Param("1/s²", 0.0, 20.0, "gain on the policy error")] = 0.45,
    kd: Annotated[float, Param("1/s", 0.0, 20.0, "gain on its rate")] = 0.25,
    kv: Annotated[float, Param("1/s", 0.0, 20.0, "gain on the received speed")] = 0.5,
    ka: Annotated[float, Param("1", 0.0, 5.0, "gain on the received acceleration")] = 0.5,
    h: Annotated[float, Param("s", 0.0, 10.0, "desired time gap")] = 1.5,
    r: Annotated[float, Param("m", 0.0, 50.0, "gap at standstill")] = 2.0,
):
    return kp * (s - r - h * v) + kd * (dv - h * a) + kv * (vl - v) + ka * al


@CACC.closed_form("equilibrium_gap")
def _gap(v, *, h, r, kp, **_):
    return np.where(kp > 0, r + h * v, np.nan)


@CACC.closed_form("equilibrium_speed")
def _speed(s, *, h, r, kp, **_):
    with np.errstate(all="ignore"):
        return np.where((h > 0) & (kp > 0), (s - r) / h, np.nan)
