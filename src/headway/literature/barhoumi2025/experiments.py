"""The paper's experiments: what each shows, its place in the paper, and its ready scenarios."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal

from headway.library import library_table

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["EXPERIMENTS", "STATED", "Experiment"]

Kind = Literal["schematic", "map", "platoon", "comparison", "sweep"]

_SETS = ("base gains", "fitted gains")
_MODELS = ("cacc", "idm", "ovm", "gmm")


@dataclass(frozen=True)
class Experiment:
    """One row of the paper's programme.

    Attributes:
        id: of the experiment.
        title: of the experiment.
        figure: label of the paper's figure, or why there is none.
        kind: of figure.
        about: the model, or "all".
        scenarios: the ready scenarios (without `paper:`) by label, the paper's own reading first.
        map: name of the map in `headway.literature.barhoumi2025.maps`; else empty.
        text: what is stated and what is chosen, where no scenario says it.
    """

    id: str
    title: str
    figure: str
    kind: Kind
    about: str
    scenarios: Mapping[str, str] = field(default_factory=dict)
    map: str = ""
    text: tuple[str, str] = ("", "")

    @property
    def stated(self) -> str:
        """What the paper states of the setting."""
        return self.text[0] or self._described()[0]

    @property
    def chosen(self) -> str:
        """What the paper does not state, with headway's choices."""
        return self.text[1] or self._described()[1]

    def datasets(self) -> dict[str, xr.Dataset]:
        """Simulate the ready scenarios and return trajectories by label."""
        from headway.literature.barhoumi2025.settings import trajectories

        return {label: trajectories(name) for label, name in self.scenarios.items()}

    def _described(self) -> tuple[str, str]:
        words = library_table(f"paper:{next(iter(self.scenarios.values()))}")["description"]
        stated, _, chosen = words.partition("S: ")[2].partition("U: ")
        return stated.strip(" ;"), chosen.strip(" .")


def _platoon(name: str, title: str, figure: str, about: str, labels: tuple[str, ...] = (), *more: str) -> Experiment:
    rows = dict(zip(labels or (about.upper(),), (name, *more), strict=True))
    return Experiment(name, title, figure, "platoon", about, rows)


def _jagged(model: str, title: str, figure: str, **more: str) -> Experiment:
    name = f"{model}-nonharmonic"
    rows = {"square": name, "sawtooth": f"{name}-sawtooth", "sum of sines": f"{name}-multisine", **more}
    return Experiment(name, title, figure, "platoon", model, rows)


def _map(name: str, title: str, figure: str, about: str, stated: str, chosen: str) -> Experiment:
    return Experiment(f"map-{name}", title, figure, "map", about, map=name, text=(stated, chosen))


def _comparison(name: str, title: str, figure: str) -> Experiment:
    rows = {model.upper(): f"{name}-{model}" for model in _MODELS}
    fitted = {} if name == "compare-real" else {"CACC, fitted gains": f"{name}-cacc-fitted"}
    return Experiment(name, title, figure, "comparison", "all", {**rows, **fitted})


EXPERIMENTS: dict[str, Experiment] = {
    e.id: e
    for e in (
        Experiment(
            "damping", "The three classes of damping", "fig:damping", "schematic", "all",
            text=("three classes of ξ", "ξ = 0.1, 1 and 2, the oscillator's exact answer"),
        ),
        _map("idm", "IDM over (Δv, T)", "fig:heat_map", "idm", "the formula and its axes",
             "23 m/s, a, b, v0, δ; the corrected formula and true string stability beside it"),
        _map("ovm", "OVM over (Δx*, α)", "fig:ovm_heat_map", "ovm", "v0, h, both ranges", "true maps beside it"),
        _map("gmm", "GMM over (α, l)", "fig:gmm_heat_map", "gmm", "α <= l/s*; text and caption disagree on the axes",
             "s* = 10 m; true maps without and with delay beside it"),
        _map("cacc", "CACC over (kv, ka)", "fig:cacc_heat_map", "cacc", "the axes",
             "kp = 0.45, kd = 0.25, h = 1.5 s; true maps for 0, 0.15 and 1.5 s of radio delay beside it"),
        _map("cacc-3d", "CACC over (kv, ka, ω_c)", "fig:cacc_heat_map3d", "cacc", "the axes",
             "the gain at ω_c decides in the true map"),
        _platoon("idm-1", "IDM configuration I: spacing only", "fig:spac_idm", "idm",
                 ("ω = 0.3", "ω = 0.63"), "idm-1-w063"),
        _platoon("idm-2", "IDM configuration II: standard form", "fig:idm", "idm"),
        _platoon("ovm", "OVM behind a sinusoidal leader", "fig:ovm_0.5", "ovm",
                 ("from 6 m", "equilibrium"), "ovm-equilibrium"),
        _platoon("gmm-1", "GMM configuration I: own speed ignored", "fig:gmm_config1", "gmm"),
        _platoon("gmm-2", "GMM configuration II, l = 2", "fig:gmm_config2, fig:gmm_l2", "gmm"),
        _platoon("gmm-3", "GMM configuration II, l = 1", "fig:gmm_l1", "gmm"),
        _platoon("cacc-1", "CACC without radio", "fig:cacc1", "cacc", _SETS, "cacc-1-fitted"),
        _platoon("cacc-2", "CACC with radio, no delay", "fig:cacc2", "cacc", _SETS, "cacc-2-fitted"),
        _platoon("cacc-3", "CACC with radio, 1.5 s late", "fig:cacc3", "cacc", _SETS, "cacc-3-fitted"),
        _comparison("compare-0", "The four models without delay", "fig:mod_spac, fig:mod_vel"),
        _comparison("compare-150", "The four models, 150 ms late", "fig:cacc_d"),
        _comparison("compare-real", "The four models with realistic delays", "fig:cacc_d1"),
        _platoon("idm-window", "IDM behind a windowed sine", "fig:idm_disc", "idm"),
        _platoon("ovm-window", "OVM behind a windowed sine", "fig:ovm_disc", "ovm"),
        _platoon("gmm-window", "GMM behind a windowed sine", "fig:gm_disc", "gmm"),
        _platoon("cacc-window", "CACC behind a windowed sine", "fig:cacc_disc", "cacc", _SETS, "cacc-window-fitted"),
        _jagged("idm", "IDM behind leaders that are not harmonic", "fig:idm_nh"),
        _jagged("ovm", "OVM behind leaders that are not harmonic", "fig:ovm_nh"),
        _jagged("gmm", "GMM behind leaders that are not harmonic", "fig:gm_nh"),
        _jagged("cacc", "CACC behind leaders that are not harmonic", "fig:cacc_harm",
                **{"square, h = 0.6 s": "cacc-nonharmonic-h06"}),
        Experiment("step", "A single step: abrupt braking", "none (promised in the text)", "comparison", "all",
                   {model.upper(): f"step-{model}" for model in _MODELS}),
        Experiment("delay-sweep", "Delays from 0 to 1.5 s", "none (promised in the introduction)", "sweep", "all",
                   {model.upper(): f"delay-sweep-{model}" for model in _MODELS}),
    )
}  # fmt: skip

_PAPER = "the paper"

#: parameters that the paper states, by model, and how far; all others are headway's choice
STATED: dict[str, dict[str, str]] = {
    "idm": {"T": _PAPER, "delta": _PAPER, "s1": _PAPER},
    "idm-spacing": {"T": _PAPER},
    "ovm": {"v0": _PAPER, "h": _PAPER, "w": "the paper, by its formula", "alpha": "the paper, by figure"},
    "gmm": {"alpha": _PAPER, "m": "the paper, by figure", "l": "the paper, by figure"},
    "cacc": {"h": "the paper for fig:cacc_harm (1.5 s), else headway's choice"},
}
