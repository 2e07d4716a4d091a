"""The Optimal Velocity Model (Bando et al. 1995) and its full-velocity-difference form (Jiang et al. 2001)."""

from __future__ import annotations

from typing import Annotated

import numpy as np

from headway.models.law import Param, model
from headway.models.maths import tanh

__all__ = ["FVDM", "OVM"]

_SENSITIVITY = Param("1/s", 0.001, 200.0, "sensitivity to the optimal velocity")
_SCALE = Param("m/s", 0.1, 200.0, "speed scale of the optimal velocity; the top speed is v0 (1 + tanh(h/w))")
_INFLECTION = Param("m", 0.0, 200.0, "gap at which the optimal velocity rises fastest")
_WIDTH = Param("m", 0.01, 200.0, "width of the rise; the paper's formula has 1 m")


@model(
    name="ovm",
    title="Optimal Velocity Model",
    formula="α [V(s) - v],  V(s) = v0 [tanh((s - h)/w) + tanh(h/w)]",
    source="Bando, Hasebe, Nakayama, Shibata, Sugiyama, Phys. Rev. E 51, 1035 (1995)",
    doi="10.1103/PhysRevE.51.1035",
)
def OVM(
    s,
    v,
    *,
    alpha: Annotated[float, _SENSITIVITY] = 0.5,
    v0: Annotated[float, _SCALE] = 22.0,
    h: Annotated[float, _INFLECTION] = 4.0,
    w: Annotated[float, _WIDTH] = 1.0,
):
    return alpha * (v0 * (tanh((s - h) / w) + tanh(h / w)) - v)


@model(
    name="fvdm",
    title="Full Velocity Difference Model",
    formula="α [V(s) - v] + λ dv,  V as in OVM",
    source="Jiang, Wu, Zhu, Phys. Rev. E 64, 017101 (2001)",
    doi="10.1103/PhysRevE.64.017101",
)
def FVDM(
    s,
    v,
    dv,
    *,
    alpha: Annotated[float, _SENSITIVITY] = 0.5,
    lam: Annotated[float, Param("1/s", 0.0, 200.0, "sensitivity to the relative speed")] = 0.5,
    v0: Annotated[float, _SCALE] = 22.0,
    h: Annotated[float, _INFLECTION] = 4.0,
    w: Annotated[float, _WIDTH] = 1.0,
):
    return alpha * (v0 * (tanh((s - h) / w) + tanh(h / w)) - v) + lam * dv


for _law in (OVM, FVDM):

    @_law.closed_form("equilibrium_gap")
    def _gap(v, *, v0, h, w, **_):
        return h + w * np.arctanh(v / v0 - np.tanh(h / w))

    @_law.closed_form("equilibrium_speed")
    def _speed(s, *, v0, h, w, **_):
        return v0 * (np.tanh((s - h) / w) + np.tanh(h / w))

    @_law.closed_form("speed_range")
    def _range(*, v0, h, w, **_):
        return 0.0, np.nextafter(v0 * (1.0 + np.tanh(h / w)), 0.0)
