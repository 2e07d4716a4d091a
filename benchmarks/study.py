"""Studies: beside a C loop on all cores, a million platoons, one point, cost by size, and theory over simulation."""

from __future__ import annotations

import json
import os
import signal
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np

from headway.engine.plan import Plan
from headway.engine.simulate import lanes_per_block, simulate
from headway.models import IDM
from headway.scenario.leaders import Brake, Sine
from headway.scenario.scenario import Scenario
from headway.scenario.vehicle import Vehicle
from headway.study.axes import between
from headway.study.executors import cores
from headway.study.store import Store
from headway.study.study import Study, open_study

from .environment import OUT, AbsentError
from .plain import Loop, compiler

#: the platoon that all figures are of, unless they say otherwise
FOLLOWERS, DURATION, DT, DELAY = 5, 50.0, 0.05, 0.5
METRIC = ["peak_spacing_error"]

#: what each figure should stay below, or reach
ALLOWED = {"ratio to C": 1.5, "memory of a million [MB]": 1000.0, "one point over simulate [ms]": 1.0}
WANTED = {"from 1 to 2 threads": 1.8}


def study(
    points: int, followers: int = FOLLOWERS, duration: float = DURATION, delay: float = DELAY, dt: float = DT
) -> Study:
    """IDM platoons behind 23 + 2 sin 0.63 t whose drivers differ from point to point; nobody stops."""
    car = Vehicle(IDM(b=1.5, s0=2.0, v0=33.3), delay=delay)
    scenario = Scenario(Sine(23.0, 2.0, 0.63), [car] * followers, duration=duration, dt=dt)
    return Study(scenario, {"T": between(1.6, 2.4), "a": between(1.0, 2.0)}, "sobol", points)


def seconds(task: Callable[[], Any]) -> float:
    """Wall time."""
    begin = time.perf_counter()
    task()
    return time.perf_counter() - begin


def beside_c(count: int = 10_000, pairs: int = 7) -> dict[str, float]:
    """Whole studies and bare C loops by turns, on one core and on all; C integrates only, all is made beforehand."""
    ours = study(count)
    scenarios = [ours.scenario_at(i) for i in range(count)]
    size = lanes_per_block(scenarios[0])
    blocks = [Plan.of(scenarios[i : i + size]) for i in range(0, count, size)]
    loops = [Loop(plan, round(DELAY / DT), 20, False, "strict", peak=True) for plan in blocks]
    pools = [ThreadPoolExecutor(1), ThreadPoolExecutor(cores())]
    found = ours.run(METRIC, pools[1]).peak_spacing_error.values[:, 1:]
    for loop in loops:
        loop()
    plain = np.concatenate([loop.peak.T for loop in loops if loop.peak is not None])
    times = []
    for _ in range(pairs):
        times.append(
            [seconds(lambda p=p: list(p.map(lambda loop: loop(), loops))) for p in pools]
            + [seconds(lambda p=p: ours.run(METRIC, p)) for p in pools]
        )
    c1, c, h1, h = (statistics.median(t) for t in zip(*times, strict=True))
    return {
        "points": count, "C on one core [s]": c1, "C on all cores [s]": c, "study on one core [s]": h1,
        "study on all cores [s]": h, "ratio to C": statistics.median(t[3] / t[1] for t in times),
        "from 1 to 2 threads": statistics.median(t[2] / t[3] for t in times),
        "C from 1 to 2 threads": statistics.median(t[0] / t[1] for t in times),
        "largest difference of peaks [m]": float(np.abs(found - plain).max()),
    }  # fmt: skip


_FILE = """duration = 50
dt = 0.05
[leader]
kind = "sine"
mean = 23
amplitude = 2
omega = 0.63
[[followers]]
model = "idm"
count = 5
delay = 0.5
parameters = { b = 1.5, s0 = 2.0, v0 = 33.3 }
[design]
kind = "sobol"
count = 1_000_000
[axes]
T = { from = 1.6, to = 2.4 }
a = { from = 1.0, to = 2.0 }
"""


def command(folder: Path, *more: str) -> list[str]:
    """The study of a million as typed, with a store."""
    (folder / "study.toml").write_text(_FILE)
    words = ["study", folder / "study.toml", "--metrics", "peak_spacing_error", "--store", folder / "study.zarr", *more]
    return [sys.executable, "-m", "headway", *map(str, words)]


def million() -> dict[str, float]:
    """Seconds and most memory of a whole process, store and report included."""
    child = (
        "import resource, subprocess, sys\n"
        "subprocess.run(sys.argv[1:], check=True, capture_output=True)\n"
        "print(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss)\n"
    )
    with tempfile.TemporaryDirectory() as name:
        line = [sys.executable, "-c", child, *command(Path(name))]
        begin = time.perf_counter()
        done = subprocess.run(line, check=True, capture_output=True, text=True)
        taken = time.perf_counter() - begin
        size = sum(f.stat().st_size for f in Path(name).rglob("*") if f.is_file())
    unit = 1 if sys.platform == "darwin" else 1024
    return {
        "a million [s]": taken, "memory of a million [MB]": int(done.stdout) * unit / 1e6,
        "store of a million [MB]": size / 1e6,
    }  # fmt: skip


def killed(times: int = 10, points: int = 100_000) -> dict[str, float]:
    """A study killed by SIGKILL at random moments and resumed each time: points that differ from one left alone."""
    random = np.random.default_rng(7)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        line = command(folder, "--resume", "--set", f"design.count={points}", "--executor", "threads")
        store, kills = folder / "study.zarr", 0
        pieces = study(points)
        expected = pieces.run(METRIC, "threads", store=folder / "other.zarr").peak_spacing_error.values
        total = Store.open(folder / "other.zarr").status()["pieces"]
        for wanted in np.sort(random.integers(0, total - 1, times)):
            process = subprocess.Popen(line, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
            while process.poll() is None:
                if (store / "complete").is_dir() and len(os.listdir(store / "complete")) >= wanted:
                    time.sleep(float(random.uniform(0.0, 0.05)))
                    process.send_signal(signal.SIGKILL)
                    kills += 1
                    break
                time.sleep(0.002)
            process.wait()
        subprocess.run(line, check=True, capture_output=True)
        found = open_study(store).peak_spacing_error.values
    same = (found == expected) | (np.isnan(found) & np.isnan(expected))
    return {"kills": kills, "points that differ after them": float((~same.all(axis=1)).sum())}


def one_point(pairs: int = 40) -> dict[str, float]:
    """What a study of one point takes more than `simulate`: medians [ms] by turns."""
    one = study(1)
    scenario = one.scenario_at(0)
    fresh = lambda: Study(scenario, {"T": [1.8]}).run(METRIC)  # noqa: E731  made anew each time
    fresh(), simulate(scenario)
    times = [(seconds(fresh), seconds(lambda: simulate(scenario))) for _ in range(pairs)]
    whole, alone = (1e3 * statistics.median(t) for t in zip(*times, strict=True))
    more = 1e3 * statistics.median(a - b for a, b in times)
    return {"one point [ms]": whole, "simulate [ms]": alone, "one point over simulate [ms]": more}


#: what is changed, one at a time
SIZES: tuple[dict[str, float], ...] = (
    {}, {"followers": 1}, {"followers": 2}, {"followers": 10}, {"followers": 20}, {"followers": 50},
    {"duration": 25.0}, {"duration": 100.0}, {"duration": 200.0}, {"delay": 0.0}, {"delay": 0.15}, {"delay": 1.0},
    {"dt": 0.02}, {"dt": 0.1},
)  # fmt: skip


def costs() -> dict[str, float]:
    """Core-seconds per million platoons, by what is changed from the usual platoon."""
    found = {}
    for change in SIZES:
        work = change.get("followers", FOLLOWERS) * change.get("duration", DURATION) / change.get("dt", DT)
        task = study(int(max(2000, 3e7 / work)), **change)  # type: ignore[arg-type]  # by name
        task.run(METRIC)
        taken = []
        for _ in range(3):
            begin = time.process_time()
            task.run(METRIC)
            taken.append(time.process_time() - begin)
        found[", ".join(f"{k} {v:g}" for k, v in change.items()) or "as above"] = min(taken) / task.points.count * 1e6
    return found


def jitcdde() -> dict[str, float]:
    """jitcdde's time for one platoon of this kind, times a million."""
    from . import jitcdde_check

    found = jitcdde_check.compare()
    platoon = 1e-9 * found["ns"] * FOLLOWERS * jitcdde_check.END / jitcdde_check.DT
    return {"jitcdde, a million on one core [s], extrapolated": 1e6 * platoon}


def growth(run: Any) -> Any:
    """Largest gain of the last vehicle over the one ahead, over frequencies of a pulse that has passed."""
    time_, speed = run.time.values, run.speed.values - run.speed.values[0, 0]
    nothing = 0.0 * run.position.isel(vehicle=0, time=0)
    if not np.isfinite(speed).all():
        return nothing + np.inf
    spectrum = np.exp(-1j * np.outer(np.linspace(0.05, 3.0, 120), time_)) @ speed.T
    return nothing + np.abs(spectrum[:, -1] / spectrum[:, -2]).max()


def theory_over_simulation(count: int = 60) -> dict[str, float]:
    """Signs of measured growth that contradict exact verdicts on a (T, delay) grid, and those beyond one cell."""
    scenario = Scenario(Brake(20.0, 1e-3, hold=0.5, ramp=0.5), [Vehicle(IDM(a=1.2))], duration=200.0, dt=0.1)
    grid = Study(scenario, {"T": between(0.4, 2.4, count), "delay": between(0.0, 1.2, count)})
    measured = grid.run([growth], "processes").growth.values > 1.0
    exact = grid.stability("processes").string_stable.values == 0.0
    near = np.zeros_like(exact)
    for axis in (0, 1):
        edge = np.diff(exact.astype(int), axis=axis) != 0
        for part in (slice(None, -1), slice(1, None)):
            near[(slice(None),) * axis + (part,)] |= edge
    wrong = measured != exact
    return {
        "cells": float(exact.size), "string unstable": float(exact.sum()), "signs that differ": float(wrong.sum()),
        "of them beyond one cell": float((wrong & ~near).sum()),
    }  # fmt: skip


def main() -> int:
    """Print the figures and write `out/bench/study.json`."""
    found: dict[str, float] = {}
    parts: list[Callable[[], dict[str, float]]] = [one_point, million, killed, theory_over_simulation]
    if compiler() is not None:
        parts.insert(0, beside_c)
    for part in [*parts, jitcdde]:
        try:
            more = part()
        except AbsentError as reason:
            print(f"{part.__name__}: not measured, {reason}")
            continue
        for name, number in more.items():
            limit = f"  (at most {ALLOWED[name]:g})" if name in ALLOWED else ""
            limit += f"  (at least {WANTED[name]:g})" if name in WANTED else ""
            print(f"{name:52}{number:12.4g}{limit}", flush=True)
        found |= more
    usual = f"{FOLLOWERS} followers, {DURATION:g} s, delay {DELAY:g} s, dt {DT:g} s"
    print(f"\ncore-seconds per million platoons of {usual}")
    prices = costs()
    for name, number in prices.items():
        print(f"{name:20}{number:10.1f}")
    OUT.mkdir(parents=True, exist_ok=True)
    (OUT / "study.json").write_text(json.dumps({**found, "core-seconds per million": prices}, indent=1))
    good = all(found.get(n, 0.0) <= limit for n, limit in ALLOWED.items())
    good &= all(found.get(n, limit) >= limit for n, limit in WANTED.items())
    good &= found.get("points that differ after them", 0.0) == 0.0 and found.get("of them beyond one cell", 0.0) == 0.0
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
