"""Draw the figures and print the tables of docs/real-platoons.md: `python examples/real_platoons.py DATA [FOLDER]`.

DATA is a folder with the recordings (see the page for their names and where they come from).
"""

from __future__ import annotations

import statistics
import sys
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import numpy as np

import headway as hw
from headway.calibration import Fit, cross_validate, measured_growth, one_in, replay, verdict
from headway.models import CACC, FVDM, GMM, IDM, OVM


@hw.model(title="Linear ACC, constant time gap", formula="ks (s - s0 - T v) + kv dv")
def linear_acc(
    s,
    v,
    dv,
    *,
    ks: Annotated[float, hw.Param("1/s²", 0.001, 5.0, "gain on the gap error")] = 0.1,
    kv: Annotated[float, hw.Param("1/s", 0.0, 5.0, "gain on the relative speed")] = 0.5,
    T: Annotated[float, hw.Param("s", 0.0, 5.0, "time gap")] = 1.2,
    s0: Annotated[float, hw.Param("m", 0.0, 50.0, "gap at standstill")] = 5.0,
):
    return ks * (s - s0 - T * v) + kv * dv


#: recording → (file, training window [s]); what is left is the test
RUNS = {
    "ACC short p1": ("openacc_asta_acc_short_p1.csv", (0.0, 200.0)),
    "ACC short p7": ("openacc_asta_acc_short_p7.csv", (0.0, 200.0)),
    "ACC long p4": ("openacc_asta_acc_long_p4.csv", (0.0, 200.0)),
    "human p10": ("openacc_asta_human_p10.csv", (0.0, 300.0)),
    "eleven ACC cars": ("openacc_zala_acc_short_11veh_p4.csv", (0.0, 130.0)),
}

#: law → what is fitted; None: all parameters and the delay
LAWS = {IDM: None, FVDM: None, OVM: None, GMM: ("alpha", "m", "l", "delay"), linear_acc: None}

Fits = dict[str, list[Fit]]


def fitted(recording: hw.data.Recording, train: tuple[float, float]) -> Fits:
    """Every law fitted to every follower."""
    return {
        law.name: [hw.calibrate(law, recording, n, fit=names, train=train) for n in range(1, recording.vehicles)]
        for law, names in LAWS.items()
    }


def row(*cells: object) -> None:
    """Print a row of a Markdown table."""
    print("| " + " | ".join(str(c) for c in cells) + " |", flush=True)


def number(x: float, digits: int = 3) -> str:
    """A number of a table; a dash where the model collided."""
    return f"{x:.{digits}g}" if np.isfinite(x) else "collides"


def errors(name: str, fits: Fits) -> None:
    """Errors of every law on every follower, train / test, and of the two drivers without a model."""
    print(f"\n### {name}: r.m.s. gap error [m] (NRMSE), train / test\n")
    row("vehicle", *fits, "constant speed", "copy the leader")
    row(*["---"] * (len(fits) + 3))
    for i, first in enumerate(next(iter(fits.values()))):
        cells = [
            f"{number(f.train[0].gap)} ({number(f.train[0].gap_relative, 2)}) / "
            f"{number(f.test[0].gap)} ({number(f.test[0].gap_relative, 2)})"
            for f in (x[i] for x in fits.values())
        ]
        a, b = first.train[0], first.test[0]
        row(
            first.follower, *cells, f"{number(a.constant_gap)} / {number(b.constant_gap)}",
            f"{number(a.copy_gap)} / {number(b.copy_gap)}",
        )  # fmt: skip
    seconds = {law: statistics.median(f.seconds for f in x) for law, x in fits.items()}
    row("time [s]", *(f"{s:.2g}" for s in seconds.values()), "", "")


def summary(name: str, fits: Fits) -> None:
    """Median errors over followers."""
    cells = []
    for x in fits.values():
        train, test = ([getattr(f, part)[0].gap_relative for f in x] for part in ("train", "test"))
        cells.append(f"{100 * np.nanmedian(train):.2g} / {100 * np.median(np.nan_to_num(test, nan=np.inf)):.2g}")
    row(name, *cells)


def amplification(name: str, recording: hw.data.Recording, fits: Fits, runs: Mapping[str, Any]) -> list[object]:
    """Measured growth and what each law predicts: last over first follower's leader, and directions per vehicle."""
    measured = measured_growth(recording.speed)
    sure = (measured.grows >= 0.95) | (measured.grows <= 0.05)
    cells: list[object] = [
        name,
        f"{measured.deviation[-1] / measured.deviation[0]:.3g} ({measured.range[-1] / measured.range[0]:.3g})",
    ]
    for law in fits:
        speed = runs[law].speed.values
        if not np.isfinite(speed).all():
            cells.append("collides")
            continue
        found = measured_growth(speed)
        right = int(np.sum(((found.ratio > 1) == (measured.ratio > 1))[1:] & sure[1:]))
        grown = f"{found.deviation[-1] / found.deviation[0]:.3g} ({found.range[-1] / found.range[0]:.3g})"
        cells.append(f"{grown}; {right} of {int(sure[1:].sum())}")
    return cells


def verdicts(name: str, recording: hw.data.Recording, fits: Sequence[Fit]) -> None:
    """Of every vehicle: measured ratio of deviations with its interval, and the verdict of its fitted law."""
    measured = measured_growth(recording.speed)
    for fit in fits:
        n = fit.follower
        row(
            name, n, f"{measured.ratio[n]:.3g} [{measured.ratio_low[n]:.3g}, {measured.ratio_high[n]:.3g}]",
            verdict(fit).words,
        )  # fmt: skip


def main(data: Path, folder: Path) -> None:
    """Write every figure into `folder` and print every table."""
    folder.mkdir(parents=True, exist_ok=True)
    recordings = {name: hw.data.read(data / file) for name, (file, _) in RUNS.items()}
    fits, runs = {}, {}
    for name, (_, train) in RUNS.items():
        begin = time.perf_counter()
        fits[name] = fitted(recordings[name], train)
        runs[name] = {law: replay(recordings[name], [f.vehicle for f in x]) for law, x in fits[name].items()}
        count = sum(len(x) for x in fits[name].values())
        print(f"<!-- {name}: {count} calibrations in {time.perf_counter() - begin:.0f} s -->")
        errors(name, fits[name])
    print("\n### Median NRMSE of the gap [%], train / test\n")
    row("recording", *fits[name])
    row(*["---"] * (len(LAWS) + 1))
    for name in RUNS:
        summary(name, fits[name])
    print("\n### Growth of speed, last over first: standard deviation (range); directions right\n")
    row("recording", "measured", *fits[name])
    row(*["---"] * (len(LAWS) + 2))
    for name in RUNS:
        row(*amplification(name, recordings[name], fits[name], runs[name]))
    print("\n### Verdicts by IDM\n")
    row("recording", "vehicle", "measured ratio [95 %]", "fitted IDM at the mean speed")
    row(*["---"] * 4)
    for name in RUNS:
        verdicts(name, recordings[name], fits[name]["idm"])
    short = [recordings["ACC short p1"], recordings["ACC short p7"]]
    crossed = cross_validate(IDM, short)
    print("\n### IDM fitted to one run and vehicle (rows), r.m.s. gap error [m] on the others (columns)\n")
    labels = [f"p{1 if 'p1' in t else 7} {t[-1]}" for t in crossed.trained.values]
    row("", *labels)
    row(*["---"] * (len(labels) + 1))
    for label, line in zip(labels, crossed.gap.values, strict=True):
        row(label, *(number(x, 2) for x in line))
    figures = {
        "real-fit-acc": hw.plot.calibrated(fits["ACC short p7"]["idm"][1]),
        "real-fit-human": hw.plot.calibrated(fits["human p10"]["idm"][1]),
        "real-replay-eleven": hw.plot.replayed(recordings["eleven ACC cars"], runs["eleven ACC cars"]["idm"]),
    }
    for name in RUNS:
        end = name.replace(" ", "-").lower()
        figures[f"real-growth-{end}"] = hw.plot.growth(recordings[name], runs[name], f"{name}: growth down the string")
    for name in ("ACC short p1", "human p10", "eleven ACC cars"):
        end = name.replace(" ", "-").lower()
        shown = [f for law in ("idm", "linear_acc") for f in fits[name][law]]
        figures[f"real-gains-{end}"] = hw.plot.gains(recordings[name], shown, f"{name}: gain between neighbours")
    radio = hw.Vehicle(CACC(h=1.0), delay={"vl": 0.15, "al": 0.15})
    mixed = one_in(
        recordings["ACC short p1"], [f.vehicle for f in fits["ACC short p1"]["idm"]], radio, (0, 12, 6, 4, 3, 2, 1), 12
    )
    print("\n### One CACC car in n among fitted ACC cars (short p1)\n")
    row("every", "growth", "least gap [m]", "head-to-tail gain")
    row(*["---"] * 4)
    for n in mixed.every.values:
        at = mixed.sel(every=n)
        row(
            "none" if n == 0 else f"1 in {n}",
            *(number(float(at[x])) for x in ("growth", "least_gap", "head_to_tail_gain")),
        )
    figures["real-mixed"] = hw.plot.penetration(mixed, "One car in n is a CACC car, among fitted ACC cars (short p1)")
    for file, figure in figures.items():
        hw.plot.save(figure, folder / f"{file}.png")


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2] if len(sys.argv) > 2 else "docs/figures"))
