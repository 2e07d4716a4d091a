"""`headway study` and `headway study status`."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import App, Parameter

from headway.cli import parse, show
from headway.cli.options import FIGURES, Json, MetricNames, ModelFile, SetStudy, check_target, laws_of
from headway.errors import HeadwayError

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["study_app"]

study_app = App(name="study", help="Run a scenario at many points, resumably, on one machine or a cluster.")

#: exit code of what Ctrl-C ended
_INTERRUPTED = 130

_LOST = "nothing is kept yet; with --store, pieces that are done are, and --resume goes on"


@study_app.default
def study(
    file: Annotated[Path, Parameter(help="A study file: a scenario with [axes].")],
    *,
    set_: SetStudy = None,
    model: ModelFile = None,
    metrics: MetricNames = "",
    executor: Annotated[str, Parameter(help="serial, threads, processes or dask://host:port.")] = "threads",
    shard: Annotated[str, Parameter(help="Do one part only, e.g. 3/16, into a store that all parts share.")] = "",
    store: Annotated[Path | None, Parameter(help="Write to this Zarr store, piece by piece.")] = None,
    resume: Annotated[bool, Parameter(help="Go on with a store that has begun.")] = False,
    out: Annotated[Path | None, Parameter(help="Write all values to this NetCDF file.")] = None,
    figure: Annotated[Path | None, Parameter(help="Draw the first metric of the last vehicle over the axes.")] = None,
    theory: Annotated[bool, Parameter(help="Ask exact theory instead of simulating.")] = False,
    json: Json = False,
) -> int:
    """Run a scenario at all points of its axes and print what came of it."""
    try:
        return _study(file, set_ or [], model or [], metrics, executor, shard, store, resume, out, figure, theory, json)
    except KeyboardInterrupt:
        resumable = store is not None and store.exists()
        way = f"what is done is in {store}; go on with: the same command and --resume" if resumable else _LOST
        print(f"headway: interrupted; {way}", file=sys.stderr)
        return _INTERRUPTED


def _study(
    file: Path, assignments: list[str], models: list[str], metrics: str, executor: str, shard: str,
    store: Path | None, resume: bool, out: Path | None, figure: Path | None, theory: bool, json: bool,
) -> int:  # fmt: skip
    from headway.metrics.registry import split
    from headway.scenario.document import override, read_table
    from headway.study.document import study_from_table

    check_target(out, (".nc",))
    check_target(figure, FIGURES)
    if theory and (store or shard or metrics):
        raise HeadwayError("study: --theory is quick and needs no --store, --shard or --metrics")
    part = parse.shard(shard)
    table = read_table(file)
    for assignment in assignments:
        override(table, assignment, more=("axes", "design", "types"))
    chosen = study_from_table(table, laws_of(models), file.parent)
    begin = time.perf_counter()
    with show.progress("points") as progress:
        if theory:
            results = chosen.stability(executor, progress=progress)
        else:
            results = chosen.run(
                split(metrics) or None,
                executor, shard=part, store=store, resume=resume or bool(part), progress=progress,
            )  # fmt: skip
    seconds = time.perf_counter() - begin
    written = []
    if out is not None:
        from headway.results import save

        written.append(save(results, out))
    if figure is not None:
        from headway import plot
        from headway.plot.study import picture

        bounds = None if theory else chosen.stability(executor) if len(chosen.points.dims) > 1 else None
        plot.save(picture(results, stability=bounds), figure)
        written.append(figure)
    _report(results, seconds, written, json)
    return 0


@study_app.command
def status(
    store: Annotated[Path, Parameter(help="A store that a study writes or has written.")],
    *,
    check: Annotated[bool, Parameter(help="Read all values too and say which pieces are damaged.")] = False,
    json: Json = False,
) -> None:
    """Say how far a study is."""
    from headway.study.store import Store

    opened = Store.open(store)
    state = opened.status()
    if check:
        state["damaged"] = sorted(opened.damaged(opened.complete()))
    if json:
        show.print_json(state)
        return
    share = 100.0 * (state["points"] - state["pending"]) / state["points"]
    done = f"{state['complete']} of {state['pieces']} pieces, {share:.1f} % of {state['points']} points"
    print(f"{state['title']}: {done}")
    rows = [(name, str(state[name])) for name in ("ok", "collision", "invalid", "failed", "pending")]
    show.print_table("", ("status", "points"), rows)
    if check:
        pieces = ", ".join(map(str, state["damaged"]))
        print(f"damaged, to be computed anew by --resume: pieces {pieces}" if pieces else "no piece is damaged")


def _report(results: xr.Dataset, seconds: float, written: list[Path], json: bool) -> None:
    import numpy as np

    names, counts = np.unique(results.status.values, return_counts=True)
    tally = dict(zip(names.tolist(), counts.tolist(), strict=True))
    messages = results.message.values[results.message.values != ""]
    rows: dict[str, dict[str, Any]] = {}
    for name, array in results.data_vars.items():
        if array.dtype.kind != "f" or not set(array.dims) <= {*results.status.dims, "vehicle"}:
            continue
        last = array.isel(vehicle=-1) if "vehicle" in array.dims else array
        finite = last.values[np.isfinite(last.values)]
        spread: dict[str, Callable[[Any], Any]] = {"least": np.min, "median": np.median, "largest": np.max}
        rows[str(name)] = {"unit": array.attrs.get("units", "")} | {
            word: float(f(finite)) if finite.size else float("nan") for word, f in spread.items()
        }
    if json:
        report = {
            "points": int(results.status.size), "status": tally, "seconds": seconds, "last_vehicle": rows,
            "first_message": str(messages[0]) if messages.size else None, "written": [str(p) for p in written],
        }  # fmt: skip
        show.print_json(report)
        return
    ends = ", ".join(f"{count} {name}" for name, count in tally.items())
    lines = [(n, r["unit"], *(show.rounded(r[c]) for c in ("least", "median", "largest"))) for n, r in rows.items()]
    size = " × ".join(f"{d} {n}" for d, n in results.status.sizes.items())
    title = f"{size} ({ends}) in {seconds:.3g} s; of the last vehicle:"
    show.print_table(title, ("metric", "unit", "least", "median", "largest"), lines, left=2)
    for array in results.data_vars.values():
        if array.attrs.get("note"):
            print(array.attrs["note"])
    if messages.size:
        print(f"{messages.size} points have a message, the first: {messages[0]}")
    for path in written:
        print(f"wrote {path}")
