"""Claims that compare the four models."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from headway import metrics
from headway.literature.barhoumi2025 import printed
from headway.literature.barhoumi2025.settings import GAINS, peak_by_follower, scenario, trajectories
from headway.literature.barhoumi2025.verdicts import Choices, Claim, Condition, grows, in_range, unbounded
from headway.metrics import safety
from headway.theory.linear import linearize

__all__ = ["CLAIMS", "MODELS"]

#: the four models in the order of the paper's panels
MODELS = ("cacc", "idm", "ovm", "gmm")

_GAP = (10.0, 20.0)
_START = ("equilibrium", "typed in")
#: the paper's comparisons by name → the ready scenarios
COMPARISONS = {"none": "compare-0", "150 ms": "compare-150", "0.15 and 1.5 s": "compare-real"}


def _calmest(c: Choices) -> Sequence[Condition]:
    trailing = {}
    for model in MODELS:
        speed = trajectories(f"compare-0-{model}", c).speed.sel(time=slice(25.0, None))
        trailing[model] = float(np.mean(metrics.amplitude(speed).values[3:]))
    # a model of which nobody is left has no amplitude; it is not the calmest
    others = min(v for m, v in trailing.items() if m != "gmm" and np.isfinite(v))
    return (
        in_range("GMM's amplitude over the least of the others, vehicles 3 to 5", trailing["gmm"] / others, 0.0, 1.0),
        *(unbounded(f"mean speed amplitude of vehicles 3 to 5, {m.upper()}", v, "m/s") for m, v in trailing.items()),
    )  # fmt: skip


def _printed(c: Choices) -> Sequence[Condition]:
    """The paper's own printed conditions for its experiments: each is to be positive."""
    cases = {model: scenario(f"compare-0-{model}", **c) for model in MODELS}
    gain, idm, ovm, gmm = (case.followers[0].model.parameters for case in cases.values())
    speed, gap = cases["ovm"].cruise, cases["ovm"].initial_gaps()[0]
    fits = printed.cacc_sufficient(gain["kv"], gain["ka"], kp=gain["kp"], kd=gain["kd"])
    damping = printed.idm_damping(0.0, idm["T"], speed=speed, a=idm["a"], b=idm["b"], v0=idm["v0"], delta=idm["delta"])
    slack = printed.gmm_critical_sensitivity(gmm["l"], gap=c["gap"]) - gmm["alpha"]
    return (
        Condition("IDM: printed damping", float(damping), "1/s", low=0.0),
        Condition("OVM: printed S", float(printed.ovm_metric(gap, ovm["alpha"])), "1/s", low=0.0),
        Condition("GMM: printed l/s* - α", float(slack), "", low=0.0),
        Condition("CACC: printed conditions without delay (1: hold)", float(fits), "", low=1.0),
    )


def _theory(c: Choices) -> Sequence[Condition]:
    """Exact theory of the experiments: the margin of strict string stability is not to be negative."""
    name = COMPARISONS[c["delays"]]
    conditions = []
    for model in MODELS:
        case = scenario(f"{name}-{model}", **c)
        linear = linearize(case.followers[0], case.cruise, c["gap"] if model == "gmm" else None)
        conditions.append(
            Condition(f"{model.upper()}: exact string stability (1: stable)", linear.string_stable, low=1.0)
        )
    return conditions


def _stable(c: Choices) -> Sequence[Condition]:
    return _printed(c) if c["judge"] == "printed conditions" else _theory(c)


def _danger(c: Choices, model: str) -> float:
    """How dangerous a run is by the chosen measure, >= 0; a collision infinitely so."""
    dataset = trajectories(f"{COMPARISONS[c['delays']]}-{model}", c)
    if dataset.collision_time.notnull().any():
        return math.inf
    if c["measure"] == "first gap over least gap":
        return float((dataset.gap[1:, 0] / safety.least_gap(dataset)[1:]).max())
    if c["measure"] == "largest spacing error over first gap":
        return float((peak_by_follower(dataset.spacing_error) / dataset.gap.values[1:, 0]).max())
    if c["measure"] == "largest DRAC":
        return float(safety.drac(dataset).max())
    return 1.0 / float(safety.ttc(dataset).min())


def _safest(c: Choices) -> Sequence[Condition]:
    danger = {model: _danger(c, model) for model in MODELS}
    worse, better = max(danger["cacc"], danger["idm"]), min(danger["ovm"], danger["gmm"])
    ratio = math.nan if math.isinf(worse) and math.isinf(better) else worse / better
    ranks = {model: 1 + sum(danger[other] < danger[model] for other in MODELS) for model in MODELS}
    return (
        in_range("danger of the worse of CACC and IDM over that of the better of OVM and GMM", ratio, 0.0, 1.0),
        *(unbounded(f"rank of {model.upper()}", rank) for model, rank in ranks.items()),
    )


def _gain(c: Choices, model: str) -> float:
    case = scenario(f"{COMPARISONS[c['delays']]}-{model}", **c)
    return linearize(case.followers[0], case.cruise, c["gap"] if model == "gmm" else None).peak_gain


def _less_stable(c: Choices) -> Sequence[Condition]:
    """CACC and IDM less stable than OVM and GMM, by exact theory."""
    gains = {model: _gain(c, model) for model in MODELS}
    ratio = min(gains["cacc"], gains["idm"]) / max(gains["ovm"], gains["gmm"])
    return (
        grows("lesser of the largest gains of CACC and IDM over the larger of OVM's and GMM's", ratio),
        *(unbounded(f"largest gain per vehicle, {model.upper()}", gain) for model, gain in gains.items()),
    )


CLAIMS = (
    Claim(
        "C26",
        "Of the four models GMM has the smallest oscillations of trailing vehicles.",
        "fig:mod_vel",
        "compare-0",
        "A = 2 m/s, no delay",
        {"gap": (10.0, 5.0, 20.0), "gains": tuple(GAINS), "start": _START, "omega": (0.63, 1.0)},
        _calmest,
        sweep=("gap", (4.0, 5.0, 6.0, 8.0, 10.0, 12.0, 15.0, 20.0)),
    ),
    Claim(
        "C28",
        "All experiments lie within the stable regions of the stability analysis.",
        "Section 'String stability continuous perturbations'",
        "map-idm",
        "the settings of the comparisons",
        {
            "judge": ("printed conditions", "exact theory"),
            "delays": tuple(COMPARISONS),
            "gains": tuple(GAINS),
            "gap": _GAP,
        },
        _stable,
    ),
    Claim(
        "C29",
        "For safety CACC and IDM rank best, OVM and GMM worst.",
        "Section 'Comparison'; conclusion",
        "compare-0",
        "the comparisons without delay, with 150 ms, and with 0.15 and 1.5 s",
        {
            "delays": tuple(COMPARISONS),
            "gains": tuple(GAINS),
            "gap": _GAP,
            "start": _START,
            "measure": (
                "first gap over least gap",
                "largest spacing error over first gap",
                "largest DRAC",
                "least TTC",
            ),
        },
        _safest,
        "The same section calls CACC and IDM 'more reactive but less stable' than OVM and GMM.",
        _less_stable,
    ),
)
