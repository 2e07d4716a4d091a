"""Nanoseconds per follower and step: headway's kernel beside a plain C loop of the same scheme."""

from __future__ import annotations

import json
import statistics
import sys
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from headway.engine.plan import Plan
from headway.engine.run import Result, Run
from headway.engine.simulate import lanes_per_block, simulate_many
from headway.models import Law, Model
from headway.models.registry import BUILT_IN
from headway.scenario.leaders import Sine
from headway.scenario.scenario import Scenario
from headway.scenario.vehicle import Vehicle

from .plain import FLAGS, Loop, compiler

OUT = Path("out/bench")
DT, END, DELAY, KEEP = 0.05, 50.0, 0.5, 1.0
PAIRS, LEAST_TIME = 5, 0.01
SIZES = ((5, 1), (5, 64), (5, 4096), (1000, 1))  # followers, lanes

#: parameters with which nobody stops or collides, and the signals that are late
LAWS: dict[str, tuple[dict[str, float], float | dict[str, float]]] = {
    "idm": ({"a": 1.5, "b": 1.5, "T": 1.8, "s0": 2.0, "v0": 33.3}, DELAY),
    "ovm": ({"alpha": 1.2, "v0": 16.0, "h": 25.0, "w": 30.0}, DELAY),
    "cacc": ({}, {"vl": DELAY, "al": DELAY}),
    "gmm": ({"alpha": 15.0, "m": 1.0, "l": 2.0}, DELAY),
}


@dataclass(frozen=True)
class Case:
    """One line of the table."""

    law: str
    scheme: str
    delay: float
    followers: int
    lanes: int
    equal: bool = False

    @property
    def updates(self) -> int:
        """Follower-steps."""
        return self.followers * self.lanes * round(END / DT)

    def scenarios(self, law: Law | None = None) -> list[Scenario]:
        """One per lane. All vehicles of all lanes have parameters of their own, unless they are `equal`."""
        values, late = LAWS[self.law]
        model = (law or BUILT_IN[self.law])(**values)
        random = np.random.default_rng(1)
        leader = Sine(mean=23.0, amplitude=2.0, omega=0.63)
        return [
            Scenario(
                leader=leader,
                followers=[Vehicle(m, delay=late if self.delay else 0.0) for m in self._models(model, random)],
                duration=END,
                dt=DT,
                output_step=KEEP,
                scheme=self.scheme,
                gaps=20.0 if self.law == "gmm" else None,
            )
            for _ in range(self.lanes)
        ]

    def _models(self, model: Model, random: np.random.Generator) -> list[Model]:
        if self.equal:
            return [model] * self.followers
        free = [n for n, p in model.law.parameters.items() if not p.info.structural]
        factors = random.uniform(0.97, 1.03, (self.followers, len(free)))
        return [model.replace(**{n: getattr(model, n) * f for n, f in zip(free, row, strict=True)}) for row in factors]


@dataclass
class Measured:
    """Medians over pairs [ns per follower-step] of one case; ratios are medians of the pairs' ratios."""

    case: Case
    headway: float  # the compiled loop
    whole: float  # with the leader and the look-ups that are prepared for it
    c: float
    c_prepared: float  # C with what depends on parameters alone computed before
    ratio: float
    ratio_prepared: float
    difference: float  # largest difference of positions [m]
    simulate: float | None = None


class _Watch:
    """Mixed into a run: how long it prepares."""

    preparing = 0.0

    def _steps(self, *arguments: Any) -> Any:
        begin = time.perf_counter()
        steps = super()._steps(*arguments)  # type: ignore[misc]  # of the Run that it is mixed into
        self.preparing += time.perf_counter() - begin
        return steps


class _Task(_Watch, Run):
    pass


def plans(scenarios: list[Scenario]) -> list[Plan]:
    """Plans of the blocks that `simulate_many` would cut."""
    size = lanes_per_block(scenarios[0])
    return [Plan.of(scenarios[i : i + size]) for i in range(0, len(scenarios), size)]


def run(blocks: list[Plan]) -> tuple[float, float, list[Result]]:
    """Seconds in the loop and as a whole, and the results."""
    loop = whole = 0.0
    results = []
    for plan in blocks:
        task = _Task(plan)
        begin = time.perf_counter()
        results.append(task.go())
        taken = time.perf_counter() - begin
        whole += taken
        loop += taken - task.preparing
    return loop, whole, results


def repeated(task: Callable[[], float], least: float) -> float:
    """Mean seconds of as many runs as fill `least` seconds."""
    total, count = 0.0, 0
    while total < least:
        total, count = total + task(), count + 1
    return total / count


def measure(case: Case, flags: str = "strict", pairs: int = PAIRS, simulate: bool = False) -> Measured:
    """Headway and C by turns."""
    scenarios = case.scenarios()
    blocks = plans(scenarios)
    late, every = round(case.delay / DT), round(KEEP / DT)
    loops = {p: [Loop(plan, late, every, p, flags) for plan in blocks] for p in (False, True)}
    results = run(blocks)[2]
    for loop in loops[False] + loops[True]:
        loop()
    difference = max(
        float(np.abs(r.motion[0].reshape(c.out[:, 0].shape) - c.out[:, 0]).max())
        for p in loops
        for r, c in zip(results, loops[p], strict=True)
    )
    if any(np.isfinite(r.collision).any() or r.unsettled.any() for r in results):
        raise RuntimeError(f"{case}: somebody stopped or collided")
    times = []
    for _ in range(pairs):
        whole: list[float] = []

        def headway(whole: list[float] = whole) -> float:
            loop, all_of_it, _ = run(blocks)
            whole.append(all_of_it)
            return loop

        ours = repeated(headway, LEAST_TIME)
        plain, prepared = (repeated(lambda p=p: sum(loop() for loop in loops[p]), LEAST_TIME) for p in loops)
        times.append((ours, statistics.mean(whole), plain, prepared))
    medians = [1e9 * statistics.median(t) / case.updates for t in zip(*times, strict=True)]
    ratios = [statistics.median(t[0] / t[i] for t in times) for i in (2, 3)]
    result = Measured(case, *medians, *ratios, difference)
    if simulate:
        simulate_many(scenarios)
        taken = []
        for _ in range(3):
            begin = time.perf_counter()
            simulate_many(scenarios)
            taken.append(time.perf_counter() - begin)
        result.simulate = 1e9 * statistics.median(taken) / case.updates
    return result


_OWN = '''
from typing import Annotated
import math
from headway.models import Param, model

@model
def mine(s, v, dv, *, a: Annotated[float, Param("m/s²", .01, 10)] = 1.5,
         b: Annotated[float, Param("m/s²", .01, 20)] = 1.5,
         T: Annotated[float, Param("s", 0, 10)] = 1.8, s0: Annotated[float, Param("m", 0, 50)] = 2.0,
         v0: Annotated[float, Param("m/s", .1, 100)] = 33.3):
    """My own IDM."""
    ratio = max(v, 0.0) / v0
    desired = s0 + T * v - v * dv / (2.0 * math.sqrt(a * b))
    return a * (1.0 - ratio**4 - (desired / s) ** 2)
'''


def own_law() -> Law:
    """A copy of the IDM as a user would write it, in a module of his own."""
    import importlib.util
    import tempfile

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "mine.py"
        path.write_text(_OWN)
        spec = importlib.util.spec_from_file_location("mine", path)
        assert spec is not None
        assert spec.loader is not None
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
        return module.mine


def measure_own(pairs: int = PAIRS) -> dict[str, float]:
    """A user's law against the built-in of the same arithmetic: median ratio of times, by delay."""
    law, found = own_law(), {}
    for delay in (0.0, DELAY):
        case = Case("idm", "rk4", delay, 5, 64)
        theirs, ours = (partial(run, plans(case.scenarios(choice))) for choice in (law, None))
        theirs(), ours()
        ratios = [
            repeated(lambda t=theirs: t()[0], LEAST_TIME) / repeated(lambda t=ours: t()[0], LEAST_TIME)
            for _ in range(pairs)
        ]
        found[f"{delay:g} s"] = statistics.median(ratios)
    return found


def cases() -> list[Case]:
    """All lines of the table."""
    kinds = [(law, scheme, delay) for law in LAWS for scheme in ("rk4", "ballistic") for delay in (0.0, DELAY)]
    return [Case(*k, *size) for size in SIZES for k in kinds] + [Case(*k, 5, 64, equal=True) for k in kinds]


HEAD = (
    f"{'law':5}{'scheme':10}{'delay':>6}{'vehicles':>9}{'lanes':>6} {'parameters':11}"
    f"{'headway':>8}{'whole':>8}{'C':>8}{'C prep.':>8}{'ratio':>7}{'(prep.)':>8}{'simulate':>9}{'|Δx| m':>9}"
)


def line(m: Measured) -> str:
    """A line of the table."""
    c, level = m.case, "" if m.simulate is None else f"{m.simulate:.0f}"
    kind = "equal" if c.equal else "all differ"
    return (
        f"{c.law:5}{c.scheme:10}{c.delay:>5g}s{c.followers + 1:>9}{c.lanes:>6} {kind:11}"
        f"{m.headway:>8.2f}{m.whole:>8.2f}{m.c:>8.2f}{m.c_prepared:>8.2f}{m.ratio:>7.2f}{m.ratio_prepared:>8.2f}"
        f"{level:>9}{m.difference:>9.0e}"
    )


def main() -> int:
    """Print the table and write `out/bench/kernel.json`."""
    if compiler() is None:
        print("kernel: there is no C compiler (cc, or $CC), so nothing to compare with")
        return 0
    print(f"ns per follower and step, {END:g} s at dt {DT:g} s; C with {FLAGS['strict']}")
    print(HEAD)
    found = []
    for case in cases():
        level = case.lanes <= 64 and not case.equal and case.scheme == "rk4"
        found.append(measure(case, pairs=PAIRS if case.lanes <= 64 else 3, simulate=level))
        print(line(found[-1]), flush=True)
    print("\nother flags, 64 lanes, rk4 (ratio headway/C, plain and prepared)")
    flags = {}
    for name in ("wide", "fused", "fast"):
        for law in LAWS:
            for delay in (0.0, DELAY):
                m = measure(Case(law, "rk4", delay, 5, 64), name)
                flags[f"{name} {law} {delay:g} s"] = m.c, m.c_prepared, m.ratio, m.ratio_prepared
                ratios = f"{m.ratio:.2f} {m.ratio_prepared:.2f}"
                print(f"{name:7}{law:5}{delay:>4g} s  C {m.c:.2f} {m.c_prepared:.2f}  ratio {ratios}")
    own = measure_own()
    print("a user's own IDM against the built-in: " + ", ".join(f"{k}: {v:.2f}" for k, v in own.items()))
    OUT.mkdir(parents=True, exist_ok=True)
    report = {"flags": FLAGS, "cases": [asdict(m) for m in found], "other flags": flags, "own law": own}
    (OUT / "kernel.json").write_text(json.dumps(report, indent=1))
    return 0


if __name__ == "__main__":
    sys.exit(main())
