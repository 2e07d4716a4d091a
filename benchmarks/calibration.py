"""Calibration: seconds of one, objective evaluations beside a numpy loop, and coverage of intervals over 50 draws."""

from __future__ import annotations

import json
import math
import statistics
import sys
import time
from typing import Any

import numpy as np

import headway as hw
from headway.calibration import as_recorded
from headway.calibration.loop import Loop
from headway.calibration.search import search
from headway.calibration.segments import Segment, cut
from headway.calibration.space import Space
from headway.calibration.uncertainty import bootstrap
from headway.models import CACC, FVDM, GMM, IDM, OVM
from headway.study.executors import cores

from .environment import OUT

#: what one calibration of five parameters and a delay may take [s]
LIMIT = 5.0

#: draws whose intervals are counted, and searches and refits of each
DRAWS, SEEDS, REFITS = 50, 2, 100

#: a driver who varies as the leaders of test tracks do
_LEADER = hw.multisine(mean=19.0, amplitudes=(3.0, 1.5, 1.5, 1.0, 0.6), omegas=(0.05, 0.11, 0.23, 0.47, 0.9))

_LATE = {"delay": 0.6}

#: name → vehicle, what is fitted
_CASES: dict[str, tuple[hw.Vehicle, tuple[str, ...]]] = {
    "idm": (hw.Vehicle(IDM(a=1.2, b=2.0, T=1.2, s0=4.0, v0=32.0), **_LATE), ("a", "b", "T", "s0", "v0", "delay")),
    "fvdm": (
        hw.Vehicle(FVDM(alpha=0.3, lam=0.5, v0=16.0, h=22.0, w=14.0), **_LATE),
        ("alpha", "lam", "v0", "h", "w", "delay"),
    ),
    "ovm": (hw.Vehicle(OVM(alpha=0.9, v0=16.0, h=22.0, w=14.0), delay=0.3), ("alpha", "v0", "h", "w", "delay")),
    "gmm": (hw.Vehicle(GMM(alpha=12.0, m=0.0, l=1.0), **_LATE), ("alpha", "m", "l", "delay")),
    "cacc": (hw.Vehicle(CACC(h=1.0), delay={"vl": 0.3, "al": 0.3}), ("kp", "kv", "h", "r", "delay")),
}  # fmt: skip

#: laws that hear an acceleration by radio: it is the leader's own, not the slope of a noisy measurement
_RADIO = ("cacc",)


def record(car: hw.Vehicle, seed: int = 0, noise: float = 1.0) -> hw.data.Recording:
    """300 s at 10 Hz of one follower, measured with errors of 0.1 m and 0.05 m/s that last half a second."""
    gaps = {"gaps": 20.0} if car.model.name == "gmm" else {}
    run = hw.simulate(hw.Scenario(_LEADER, [car], duration=300.0, dt=0.02, output_step=0.1, **gaps))
    return as_recorded(run, 0.1 * noise, 0.05 * noise, seed=seed, leader=car.model.name not in _RADIO)


def truth(car: hw.Vehicle, name: str) -> float:
    """The value that a fit should find."""
    return car.perception.longest if name == "delay" else car.model.parameters[name]


def one() -> dict[str, float]:
    """Seconds of one calibration of IDM with delay, whole and per part, median of three."""
    car, names = _CASES["idm"]
    recording = record(car)
    hw.calibrate(IDM, recording, fit=names, seeds=1, refits=2)
    fits = [hw.calibrate(IDM, recording, fit=names, seeds=5) for _ in range(3)]
    return {
        "one calibration [s]": statistics.median(f.seconds for f in fits),
        "its objective evaluations": fits[0].evaluations,
    }  # fmt: skip


def evaluations() -> dict[str, float]:
    """Objective evaluations per second, beside the same objective as a Python loop over numpy arrays."""
    from concurrent.futures import ThreadPoolExecutor

    car, names = _CASES["idm"]
    space, (segment,) = Space.of(IDM, names), cut(record(car), 1)[0]
    loop = Loop(space, [segment])
    random = np.random.default_rng(1)
    middle = space.unit(np.array([truth(car, n) for n in names]))[:, None]
    at = np.clip(middle + 0.02 * random.standard_normal((len(names), 72)), 0.0, 1.0)
    loop.errors(at)
    begin = time.perf_counter()
    for _ in range(20):
        loop.errors(at)
    alone = 20 * 72 / (time.perf_counter() - begin)
    with ThreadPoolExecutor(cores()) as pool:
        begin = time.perf_counter()
        list(pool.map(lambda _: loop.errors(at), range(40)))
        together = 40 * 72 / (time.perf_counter() - begin)
    begin = time.perf_counter()
    plain = plain_objective(segment, loop, space.values(at))
    beside = 72 / (time.perf_counter() - begin)
    one_at_a_time = time.perf_counter()
    plain_objective(segment, loop, space.values(at[:, :1]))
    single = 1.0 / (time.perf_counter() - one_at_a_time)
    return {
        "evaluations a second, one core": alone, "evaluations a second, all cores": together,
        "numpy loop, 72 candidates at once": beside, "numpy loop, one candidate": single,
        "largest difference of objectives": float(np.abs(plain - loop.errors(at)).max()),
    }  # fmt: skip


def plain_objective(segment: Segment, loop: Loop, values: np.ndarray) -> np.ndarray:
    """The same objective for IDM, a Python loop over steps with numpy over candidates: ballistic, linear look-ups."""
    a, b, T, s0, v0, delay = values
    h, lead = segment.step, segment.lead
    count, lanes = segment.gap.size, values.shape[1]
    start = loop.starts[0]
    s, v = np.empty((count, lanes)), np.empty((count, lanes))
    s[0], v[0] = start[0], start[1]
    steps = delay / h
    back = np.floor(steps).astype(int)
    rest, lane = steps - back, np.arange(lanes)
    for j in range(count - 1):
        x, y = np.maximum(j - back - 1, 0), np.maximum(j - back, 0)
        gap = rest * s[x, lane] + (1 - rest) * s[y, lane]
        speed = rest * v[x, lane] + (1 - rest) * v[y, lane]
        ahead = rest * lead[1, x] + (1 - rest) * lead[1, y]
        wanted = s0 + T * speed - speed * (ahead - speed) / (2 * np.sqrt(a * b))
        v[j + 1] = np.maximum(v[j] + h * a * (1 - (speed / v0) ** 4 - (wanted / gap) ** 2), 0.0)
        s[j + 1] = s[j] + lead[0, j + 1] - lead[0, j] - 0.5 * h * (v[j] + v[j + 1])
    error = s - segment.gap[:, None]
    return np.sqrt((error**2).mean(axis=0)) / loop.scale[0]


def coverage(draws: int = DRAWS) -> dict[str, dict[str, Any]]:
    """Of every law: how often 95 % intervals hold the value that made the data, by quantity and together."""
    found: dict[str, dict[str, Any]] = {}
    for name, (car, names) in _CASES.items():
        inside, widths = np.zeros((draws, len(names)), bool), np.empty((draws, len(names)))
        for i in range(draws):
            # what `calibrate` does, without the profiles, which no interval needs
            space = Space.of(car, names)
            loop = Loop(space, cut(record(car, i), 1)[0])
            best = search(loop, SEEDS, i)[0][:, 0]
            low, high = np.quantile(space.values(bootstrap(loop, best, REFITS, i)[0]), (0.025, 0.975), axis=1)
            true = np.array([truth(car, n) for n in names])
            inside[i], widths[i] = (low <= true) & (true <= high), (high - low) / np.maximum(np.abs(true), 1e-9)
        share = dict(zip(names, inside.mean(axis=0).tolist(), strict=True))
        found[name] = {"together": float(inside.mean()), **share, "widths": np.median(widths, axis=0).tolist()}
        text = ", ".join(f"{n} {100 * x:.0f} %" for n, x in share.items())
        print(f"{name:6}{100 * inside.mean():6.1f} %  of {inside.size} intervals; {text}", flush=True)
    return found


def main() -> int:
    """Print the figures and write `out/bench/calibration.json`."""
    found = {**one(), **evaluations()}
    for name, x in found.items():
        limit = f"  (at most {LIMIT:g})" if name.endswith("[s]") else ""
        print(f"{name:42}{x:12.4g}{limit}")
    print(f"\ncoverage of 95 % intervals over {DRAWS} draws")
    shares = coverage()
    OUT.mkdir(parents=True, exist_ok=True)
    (OUT / "calibration.json").write_text(json.dumps({**found, "coverage": shares}, indent=1))
    return (
        0 if found["one calibration [s]"] <= LIMIT and math.isfinite(found["largest difference of objectives"]) else 1
    )


if __name__ == "__main__":
    sys.exit(main())
