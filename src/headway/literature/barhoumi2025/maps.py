"""The five stability maps of the comparative study: its printed conditions beside the true verdicts."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from headway.errors import unknown_name
from headway.literature.barhoumi2025 import printed
from headway.models import CACC, GMM, IDM, OVM
from headway.scenario.vehicle import Vehicle
from headway.theory.map import StabilityMap, stability_map, trace

__all__ = ["NAMES", "PaperMap", "reproduced_map"]

#: what a printed condition says of a point
_PRINTED = ("no value", "condition fails", "condition holds")


@dataclass(frozen=True, eq=False)
class PaperMap:
    """A map of the paper.

    Attributes:
        name: short name of the map.
        title: what it shows, with the label of the paper's figure.
        caption: what differs between the printed condition and the truth, and why.
        panels: title and map of each panel, the printed ones first.
    """

    name: str
    title: str
    caption: str
    panels: tuple[tuple[str, StabilityMap], ...]


def reproduced_map(name: str) -> PaperMap:
    """Compute one of the paper's maps.

    Args:
        name: one of `NAMES`.

    Raises:
        HeadwayError: for any other name.
    """
    if name not in _MAPS:
        raise unknown_name("map of the paper", name, NAMES)
    return _MAPS[name]()


#: name → (values, label, unit) of an axis
_Axes = dict[str, tuple[Any, str, str]]


def _printed(axes: _Axes, holds: Callable[..., Any], note: str) -> StabilityMap:
    """Return the map of a printed condition; `holds` takes arrays by axis and may return NaN where it has no value."""
    import xarray as xr

    values = [np.asarray(v, dtype=float) for v, _, _ in axes.values()]

    def codes(at: list[Any]) -> Any:
        value = np.asarray(holds(*at), dtype=float)
        return np.where(np.isnan(value), 0, np.where(value > 0, 2, 1)).astype(np.int8)

    whole = codes(list(np.meshgrid(*values, indexing="ij")))
    boundary = trace(whole, values, lambda at: codes(list(at.T)), _PRINTED)
    attributes = {"long_name": "printed condition", "flag_values": [0, 1, 2], "flag_meanings": ", ".join(_PRINTED)}
    dataset = xr.Dataset(
        {"verdict": (tuple(axes), whole, attributes)},
        coords={
            n: (n, v, {"units": u, "long_name": words})
            for v, (n, (_, words, u)) in zip(values, axes.items(), strict=True)
        },
        attrs={"what": "printed", "parameters": note},
    )
    return StabilityMap(dataset, boundary)


def _idm() -> PaperMap:
    T = np.linspace(0.5, 3.0, 200)
    approach = np.linspace(-5.0, 5.0, 200)
    axes: _Axes = {"approach": (approach, "approach Δv", "m/s"), "T": (T, "desired time gap", "s")}
    note = "v = 23 m/s, a = 1, b = 1.5, v0 = 33.33, s0 = 0, s = v T"
    return PaperMap(
        "idm",
        "IDM over (Δv, T), fig:heat_map",
        "Printed: f_Δv - f_v > 0, with the sign of the approach rate in both terms of f_Δv, s0 = 0 and s = v T: it "
        "calls every T of the map unstable at Δv = 0 (-0.418 1/s at T = 1.5 s). With the signs right it is positive "
        "(+0.671; +0.501 at the true equilibrium). A state with Δv ≠ 0 is no equilibrium, and this damping decides "
        "about one vehicle, not about a string. The string verdict is a map over the speed of the platoon and T.",
        (
            ("printed condition", _printed(axes, lambda dv, t: printed.idm_damping(dv, t) > 0, note)),
            (
                "the same, signs corrected",
                _printed(axes, lambda dv, t: printed.idm_damping_sign_corrected(dv, t) > 0, note),
            ),
            ("true: string stability", stability_map(IDM, {"speed": (0.5, 32.5, 200), "T": T})),
        ),
    )


def _ovm() -> PaperMap:
    gap, alpha = np.linspace(0.25, 50.0, 400), np.linspace(0.01, 3.0, 200)
    axes: _Axes = {"gap": (gap, "gap Δx*", "m"), "alpha": (alpha, "sensitivity α", "1/s")}
    true = {"gap": gap, "alpha": alpha}
    return PaperMap(
        "ovm",
        "OVM over (Δx*, α), fig:ovm_heat_map",
        "Printed: α >= 44 sech²(Δx* - 4). It is right without delay: the first two panels agree. Each gap belongs to a "
        "speed of its own, V(Δx*): from 6 m on that is above 43 m/s, so of this map only the strip below 4.2 m is ever "
        "driven at speeds up to 25 m/s, and there α would have to be above 40 1/s around 4 m. A delay of all signals "
        "(third panel, 0.5 s) widens the unstable region.",
        (
            (
                "printed condition",
                _printed(axes, lambda s, a: printed.ovm_metric(s, a) >= 0, "v0 = 22, h = 4"),
            ),
            ("true: string stability", stability_map(OVM, true)),
            ("true, all signals 0.5 s late", stability_map(Vehicle(OVM, delay=0.5), true)),
        ),
    )


def _gmm() -> PaperMap:
    alpha, exponent = np.linspace(0.01, 3.0, 200), np.linspace(-1.0, 4.0, 200)
    axes: _Axes = {"alpha": (alpha, "sensitivity α", "m^(l-1)"), "l": (exponent, "spacing exponent", "1")}
    true = {"alpha": alpha, "l": exponent}
    return PaperMap(
        "gmm",
        "GMM over (α, l), fig:gmm_heat_map",
        "Printed: α <= l/s*. It follows from no equation of the section and compares quantities of different units; it "
        "rests on a derivative by the spacing that is zero, because the law is proportional to the relative speed. "
        "Without delay |G| = C/|iω + C| <= 1 for every α and l, C = α v^m/s^l: the result that the paper rejects. With "
        "all signals late by τ the condition is C τ <= 1/2 for strings and C τ < π/2 for one vehicle (third panel, "
        "τ = 1 s).",
        (
            (
                "printed condition",
                _printed(axes, lambda a, exponent: a <= printed.gmm_critical_sensitivity(exponent), "s* = 10 m"),
            ),
            ("true: string stability", stability_map(GMM, true, speed=23.0, gap=10.0)),
            ("true, all signals 1 s late", stability_map(Vehicle(GMM, delay=1.0), true, speed=23.0, gap=10.0)),
        ),
    )


def _cacc() -> PaperMap:
    kv, ka = np.linspace(0.0, 2.0, 200), np.linspace(0.0, 2.0, 200)
    axes: _Axes = {
        "kv": (kv, "gain on the received speed", "1/s"),
        "ka": (ka, "gain on the received acceleration", "1"),
    }
    late = [Vehicle(CACC, delay={"vl": tau, "al": tau}) for tau in (0.0, 0.15, 1.5)]
    return PaperMap(
        "cacc",
        "CACC over (kv, ka), fig:cacc_heat_map",
        "Printed, without delay: ka <= kv/2 and kv >= 2 kd - kp/ω0². The printed G drops the time gap h and delays the "
        "vehicle's own speed; without delay it amplifies a band for every ka other than 1, so its own condition does "
        "not follow from it. True, without delay: ka <= 1 + kd h and ka + kv h + kp h²/2 >= 1. With radio delay there "
        "is no closed form: the sweep over all frequencies decides. kp = 0.45, kd = 0.25, h = 1.5 s.",
        (
            (
                "printed condition, no delay",
                _printed(axes, lambda v, a: printed.cacc_sufficient(v, a), "kp = 0.45, kd = 0.25"),
            ),
            *(
                (f"true, radio {tau:g} s late" if tau else "true, no delay",
                 stability_map(car, {"kv": kv, "ka": ka}, speed=23.0))
                for tau, car in zip((0.0, 0.15, 1.5), late, strict=True)
            ),
        ),
    )  # fmt: skip


def _cacc_3d() -> PaperMap:
    kv, ka, omega = np.linspace(0.0, 2.0, 41), np.linspace(0.0, 2.0, 41), np.linspace(0.1, 3.0, 30)
    axes: _Axes = {
        "kv": (kv, "gain on the received speed", "1/s"),
        "ka": (ka, "gain on the received acceleration", "1"),
        "omega": (omega, "frequency ω_c", "rad/s"),
    }
    car = Vehicle(CACC, delay={"vl": 0.15, "al": 0.15})

    def holds(v: Any, a: Any, w: Any) -> Any:
        longest = printed.cacc_longest_delay(w, v, a)
        return np.where(np.isnan(longest), np.nan, longest >= 0.15)

    return PaperMap(
        "cacc-3d",
        "CACC over (kv, ka, ω_c), fig:cacc_heat_map3d",
        "Printed: τ <= τ_max(ω_c), an arccos of a sum of terms of different units, without kd and h; over most of the "
        "space its argument lies outside [-1, 1] and it has no value. ω_c is not defined there. True: whether a "
        "disturbance of frequency ω grows from vehicle to vehicle, |G(iω)| > 1, with the radio 0.15 s late. A pair of "
        "gains is string stable if no frequency grows.",
        (
            ("printed: 0.15 s <= τ_max(ω_c)", _printed(axes, holds, "kp = 0.45, τ = 0.15 s")),
            (
                "true: |G(iω)| <= 1",
                stability_map(car, {"kv": kv, "ka": ka, "omega": omega}, speed=23.0, what="gain"),
            ),
        ),
    )


_MAPS: dict[str, Callable[[], PaperMap]] = {"idm": _idm, "ovm": _ovm, "gmm": _gmm, "cacc": _cacc, "cacc-3d": _cacc_3d}

#: the names of the paper's maps
NAMES = tuple(_MAPS)
