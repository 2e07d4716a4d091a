"""`headway stability`."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from headway.cli import show
from headway.cli.equilibrium import SPEED, check_gap
from headway.cli.options import Delay, Gap, Json, Lag, ModelFile, SetAny, laws_of, read_scenario, vehicle_of
from headway.theory.sentences import chain_verdict, gain_text, vehicle_verdict

if TYPE_CHECKING:
    from headway.theory.linear import Linear
    from headway.theory.platoon import Chain

__all__ = ["stability"]

#: vehicles of the platoon that is judged where one vehicle has no verdict of its own
_PLATOON = 10


def stability(
    subject: Annotated[
        str, Parameter(help="A model, or a scenario file or ready scenario (then every vehicle and the whole string).")
    ],
    *,
    speed: Annotated[
        float | None, Parameter(help="Speed of the platoon [m/s]; 23 if not given, a scenario brings its own.")
    ] = None,
    gap: Gap = None,
    set_: SetAny = None,
    delay: Delay = "0",
    lag: Lag = 0.0,
    model: ModelFile = None,
    json: Json = False,
) -> None:
    """Exact local and string stability, with delays: verdicts, peak gain, critical delays."""
    from headway.library import is_ready

    laws = laws_of(model)
    if subject.endswith(".toml") or is_ready(subject):
        _scenario(subject, set_ or [], model or [], speed, gap, json)
        return
    from headway.models.registry import find
    from headway.theory.linear import linearize
    from headway.theory.platoon import Chain

    car = vehicle_of(find(subject, laws), set_, delay, lag)
    check_gap(car.model, gap)
    linear = linearize(car, SPEED if speed is None else speed, gap)
    report = report_of(linear)
    # a law that hears the platoon leader has no verdict but that of a whole platoon
    chain = Chain((linear,) * _PLATOON) if linear.hears_leader else None
    if json:
        show.print_json(report if chain is None else {**report, "head_to_tail": _chain(chain)})
        return
    show.say(vehicle_verdict(linear, report["critical_delay"]), good=report.get("string_stable"))
    for words in chain_verdict(chain) if chain is not None else ():
        show.say(words)
    _print(report)


def _scenario(
    name: str, assignments: list[str], references: list[str], speed: float | None, gap: float | None, json: bool
) -> None:
    from headway.theory.platoon import head_to_tail

    scenario = read_scenario(name, assignments, references)
    v = scenario.cruise if speed is None else speed
    gaps = scenario.initial_gaps() if gap is None and scenario.gaps is not None else gap
    chain = head_to_tail(scenario.followers, v, gaps)
    different = list(dict.fromkeys(chain.vehicles))
    reports = [report_of(linear) for linear in different]
    numbers = [chain.vehicles.index(linear) + 1 for linear in different]
    if json:
        show.print_json(
            {"speed": v, "vehicles": dict(zip(numbers, reports, strict=True)), "head_to_tail": _chain(chain)}
        )
        return
    for n, linear, report in zip(numbers, different, reports, strict=True):
        same = sum(other == linear for other in chain.vehicles)
        who = f"vehicle {n} and {same - 1} like it" if same > 1 else f"vehicle {n}"
        print(f"{who}, {report['model']}: {vehicle_verdict(linear, report['critical_delay'])}")
    for i, words in enumerate(chain_verdict(chain)):
        print(f"  {words}" if i else words)


def _chain(chain: Chain) -> dict[str, Any]:
    peak, worst = chain.peak, chain.worst
    return {
        "vehicles": len(chain.vehicles),
        "locally_stable": chain.locally_stable,
        "strictly_string_stable": None if chain.hears_leader else chain.strictly_string_stable,
        "stable": chain.head_to_tail_stable,
        "peak_gain": peak.gain,
        "peak_frequency": peak.frequency,
        "worst_gain": worst.gain,
        "worst_frequency": worst.frequency,
    }


def report_of(linear: Linear) -> dict[str, Any]:
    """Everything about one vehicle, by name."""
    root = linear.rightmost_root
    delay = linear.vehicle.delay
    return {
        "model": linear.vehicle.model.name,
        "parameters": linear.vehicle.model.parameters,
        "delay": delay if isinstance(delay, float) else dict(delay),
        "lag": linear.vehicle.lag,
        "speed": linear.speed,
        "gap": linear.gap,
        "partials": linear.partials,
        "natural_frequency": linear.natural_frequency,
        "damping_ratio": linear.damping_ratio,
        "damping_class": linear.damping_class,
        "eigenvalues": [{"real": z.real, "imag": z.imag} for z in linear.eigenvalues],
        "locally_stable": linear.locally_stable,
        "rightmost_root": {"real": root.real, "imag": abs(root.imag)},
        **dict.fromkeys(_PER_VEHICLE),
        **({} if linear.hears_leader else _per_vehicle(linear)),
        "margins": linear.margins._asdict(),
        "critical_delay": linear.critical_delays(),
    }


#: what a law that hears the platoon leader has no answer to
_PER_VEHICLE = (
    "string_stable", "peak_gain", "peak_frequency", "long_wave", "impulse_norm", "peak_stable", "propagation",
)  # fmt: skip


def _per_vehicle(linear: Linear) -> dict[str, Any]:
    return {
        **{name: getattr(linear, name) for name in _PER_VEHICLE[:-1]},
        "propagation": linear.propagation()._asdict(),
    }


def _print(report: dict[str, Any]) -> None:
    root, critical = report["rightmost_root"], report["critical_delay"]
    alone = {} if report["string_stable"] is None else {
        "peak gain": f"{report['peak_gain']:.6g} at {report['peak_frequency']:.4g} rad/s",
        "long waves": f"C = {report['long_wave']:.6g} 1/s²",
        "largest peak": _largest_peak(report),
        "along the road": _along_the_road(report["propagation"]),
    }  # fmt: skip
    string = "" if math.isnan(critical["string"]) else f", string {_seconds(critical['string'])}"
    lines = {
        "equilibrium gap": f"{report['gap']:.6g} m at {report['speed']:g} m/s",
        "partials": ", ".join(f"f_{n} = {x:.6g}" for n, x in report["partials"].items()),
        "natural frequency": f"{report['natural_frequency']:.6g} rad/s",
        "damping ratio": f"{show.rounded(report['damping_ratio'], 6)} ({report['damping_class']}, without delay)",
        "rightmost root": _root(root["real"], root["imag"]),
        **alone,
        "margins": _margins(report["margins"]),
        "critical delay": f"local {_seconds(critical['local'])}{string}",
    }
    for name, text in lines.items():
        show.say(text, f"  {name:<18} ", 21)


def _root(real: float, imaginary: float) -> str:
    """A root, or the pair that it belongs to."""
    alone = imaginary <= 1e-9 * abs(real)
    return f"{real:.6g} 1/s" if alone else f"{real:.6g} ± {imaginary:.6g} i 1/s"


def _largest_peak(report: dict[str, Any]) -> str:
    norm = report["impulse_norm"]
    if math.isinf(norm):
        return "without bound"
    if report["peak_stable"]:
        return "no peak of speed grows from vehicle to vehicle"
    return f"a peak of speed can grow {gain_text(norm)} times per vehicle"


def _along_the_road(wave: dict[str, Any]) -> str:
    if wave["kind"] in ("stable", "locally unstable"):
        return wave["kind"]
    return (
        f"{wave['kind']}: fastest {wave['growth']:.3g} 1/s at {wave['velocity']:.3g} m/s, "
        f"growing from {wave['upstream_edge']:.3g} to {wave['downstream_edge']:.3g} m/s"
    )


def _margins(margins: dict[str, float]) -> str:
    if math.isnan(margins["gain"]):
        return "none, locally unstable"
    gain, phase = margins["gain"], margins["phase"]
    return (
        f"gain {'any' if math.isinf(gain) else f'{gain:.4g}'}, "
        f"phase {'any' if math.isinf(phase) else f'{math.degrees(phase):.4g}°'}, delay {_seconds(margins['delay'])}"
    )


def _seconds(value: float) -> str:
    return "none" if math.isinf(value) else f"{value:.6g} s"
