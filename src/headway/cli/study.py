"""`headway study` and `headway study status`."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import App, Parameter

from headway.cli import show
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
    set_: Annotated[
        list[str] | None, Parameter(name="--set", help="Override any field, e.g. design.count=256; may be repeated.")
    ] = None,
    model: Annotated[
        list[str] | None, Parameter(help="Allow a law from a file, e.g. my.py:soft; this runs the file.")
    ] = None,
    metrics: Annotated[
        str, Parameter(help="With commas between, e.g. ttc,tet(threshold=4); see headway metrics.")
    ] = "",
    executor: Annotated[str, Parameter(help="serial, threads, processes or dask://host:port.")] = "threads",
    shard: Annotated[str, Parameter(help="Do one part only, e.g. 3/16, into a store that all parts share.")] = "",
    store: Annotated[Path | None, Parameter(help="Write to this Zarr store, piece by piece.")] = None,
    resume: Annotated[bool, Parameter(help="Go on with a store that has begun.")] = False,
    out: Annotated[Path | None, Parameter(help="Write all values to this NetCDF file.")] = None,
    figure: Annotated[Path | None, Parameter(help="Draw the first metric of the last vehicle over the axes.")] = None,
    theory: Annotated[bool, Parameter(help="Ask exact theory instead of simulating.")] = False,
    json: Annotated[bool, Parameter(help="Print as JSON.")] = False,
) -> int:
    """Run a scenario at all points of its axes and print what came of it."""
    try:
        return _study(file, set_ or [], model or [], metrics, executor, shard, store, resume, out, figure, theory, json)
    except KeyboardInterrupt:
        kept = store is not None and store.exists()
        way = f"what is done is in {store}; go on with: the same command and --resume" if kept else _LOST
        print(f"headway: interrupted; {way}", file=sys.stderr)
        return _INTERRUPTED


def _study(
    file: Path, assignments: list[str], models: list[str], metrics: str, executor: str, shard: str,
    store: Path | None, resume: bool, out: Path | None, figure: Path | None, theory: bool, json: bool,
) -> int:  # fmt: skip
    from headway.cli.run import check_target
    from headway.metrics.registry import split
    from headway.models.own import load_laws
    from headway.scenario.document import override, read_table
    from headway.study.document import study_from_table

    check_target(out, (".nc",))
    check_target(figure, (".png", ".svg", ".pdf"))
    if theory and (store or shard or metrics):
        raise HeadwayError("study: --theory is quick and needs no --store, --shard or --metrics")
    part = _part(shard)
    table = read_table(file)
    for assignment in assignments:
        override(table, assignment, more=("axes", "design", "types"))
    chosen = study_from_table(table, [law for m in models for law in load_laws(m)], file.parent)
    begin = time.perf_counter()
    with show.progress("points") as progress:
        if theory:
            found = chosen.stability(executor, progress=progress)
        else:
            found = chosen.run(
                split(metrics) or None,
                executor, shard=part, store=store, resume=resume or bool(part), progress=progress,
            )  # fmt: skip
    seconds = time.perf_counter() - begin
    written = []
    if out is not None:
        from headway.results import save

        written.append(save(found, out))
    if figure is not None:
        from headway import plot
        from headway.plot.study import picture

        bounds = None if theory else chosen.stability(executor) if len(chosen.points.dims) > 1 else None
        plot.save(picture(found, stability=bounds), figure)
        written.append(figure)
    _report(found, seconds, written, json)
    return 0


@study_app.command
def status(
    store: Annotated[Path, Parameter(help="A store that a study writes or has written.")],
    *,
    check: Annotated[bool, Parameter(help="Read all values too and say which pieces are damaged.")] = False,
    json: Annotated[bool, Parameter(help="Print as JSON.")] = False,
) -> None:
    """Say how far a study is."""
    from headway.study.store import Store

    opened = Store.open(store)
    found = opened.status()
    if check:
        found["damaged"] = sorted(opened.damaged(opened.complete()))
    if json:
        show.print_json(found)
        return
    share = 100.0 * (found["points"] - found["pending"]) / found["points"]
    done = f"{found['complete']} of {found['pieces']} pieces, {share:.1f} % of {found['points']} points"
    print(f"{found['title']}: {done}")
    rows = [(name, str(found[name])) for name in ("ok", "collision", "invalid", "failed", "pending")]
    show.table("", ("status", "points"), rows)
    if check:
        pieces = ", ".join(map(str, found["damaged"]))
        print(f"damaged, to be computed anew by --resume: pieces {pieces}" if pieces else "no piece is damaged")


def _part(text: str) -> tuple[int, int] | None:
    if not text:
        return None
    i, slash, n = text.partition("/")
    if not slash or not i.isdigit() or not n.isdigit():
        raise HeadwayError(f"--shard {text}: write the part and how many there are, e.g. 3/16")
    return int(i), int(n)


def _report(found: xr.Dataset, seconds: float, written: list[Path], json: bool) -> None:
    import numpy as np

    names, counts = np.unique(found.status.values, return_counts=True)
    tally = dict(zip(names.tolist(), counts.tolist(), strict=True))
    messages = found.message.values[found.message.values != ""]
    rows: dict[str, dict[str, Any]] = {}
    for name, array in found.data_vars.items():
        if array.dtype.kind != "f" or not set(array.dims) <= {*found.status.dims, "vehicle"}:
            continue
        last = array.isel(vehicle=-1) if "vehicle" in array.dims else array
        known = last.values[np.isfinite(last.values)]
        spread: dict[str, Callable[[Any], Any]] = {"least": np.min, "median": np.median, "largest": np.max}
        rows[str(name)] = {"unit": array.attrs.get("units", "")} | {
            word: float(f(known)) if known.size else float("nan") for word, f in spread.items()
        }
    if json:
        report = {
            "points": int(found.status.size), "status": tally, "seconds": seconds, "last_vehicle": rows,
            "first_message": str(messages[0]) if messages.size else None, "written": [str(p) for p in written],
        }  # fmt: skip
        show.print_json(report)
        return
    told = ", ".join(f"{count} {name}" for name, count in tally.items())
    lines = [(n, r["unit"], *(show.number(r[c]) for c in ("least", "median", "largest"))) for n, r in rows.items()]
    size = " × ".join(f"{d} {n}" for d, n in found.status.sizes.items())
    title = f"{size} ({told}) in {seconds:.3g} s; of the last vehicle:"
    show.table(title, ("metric", "unit", "least", "median", "largest"), lines, left=2)
    for array in found.data_vars.values():
        if array.attrs.get("note"):
            print(array.attrs["note"])
    if messages.size:
        print(f"{messages.size} points have a message, the first: {messages[0]}")
    for path in written:
        print(f"wrote {path}")
