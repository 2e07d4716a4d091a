"""`headway paper`."""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from headway.cli import parse, show
from headway.cli.options import FigureForm, Json, ReportForm
from headway.errors import HeadwayError

if TYPE_CHECKING:
    from concurrent.futures import Executor

__all__ = ["paper"]

#: so many claims are measured here rather than by other processes, which take seconds to start
_FEW = 4


def paper(
    *,
    out: Annotated[
        Path | None, Parameter(help="Folder of the report; out/paper if not given, none with --json.")
    ] = None,
    only: Annotated[
        list[str] | None, Parameter(help="Claims and experiments, with commas between, e.g. C05,idm-1.")
    ] = None,
    format: ReportForm = "html",
    figures: FigureForm = "svg",
    json: Json = False,
) -> None:
    """Reproduce the comparative study: its experiments as figures, its claims with verdicts."""
    from headway.literature.barhoumi2025.reproduction import choose, reproduce, tables

    names = parse.names(*(only or []))
    if only and not names:
        raise HeadwayError("--only: name claims or experiments, e.g. C05,idm-1")
    experiments, claims = choose(names)
    folder = out if out is not None else None if json else Path("out/paper")
    _check(folder)
    with _others(len(claims)) as others, show.progress("claims") as progress:
        findings = reproduce(claims, others, progress)
    page = None
    if folder is not None:
        from headway.literature.barhoumi2025.report import paper_report
        from headway.report import write

        with show.progress("experiments") as progress:
            report = paper_report(experiments, findings, progress)
        with show.working("writing the report"):
            page = write(report, folder, format=format, figures=figures)
    if json:
        show.print_json(tables(findings) | {"written": [str(page)] if page else []})
        return
    _print(findings)
    print(f"wrote {page}")


def _check(folder: Path | None) -> None:
    """Refuse a target before anything is computed."""
    if folder is None:
        return
    for place in (folder, *folder.parents):
        if place.exists():
            if not place.is_dir():
                raise HeadwayError(f"--out {folder}: {place} is a file; name a folder")
            if not os.access(place, os.W_OK):
                raise HeadwayError(f"--out {folder}: nothing can be written into {place}")
            return


@contextmanager
def _others(count: int) -> Iterator[Executor | None]:
    """Processes that measure, one for each core; none for little work."""
    from headway.study.executors import cores

    if count <= _FEW or cores() == 1:
        yield None
        return
    import multiprocessing
    from concurrent.futures import ProcessPoolExecutor

    with ProcessPoolExecutor(
        min(cores(), count),
        multiprocessing.get_context("spawn"),
        # Ctrl-C is for the process that was typed at
        initializer=signal.signal,
        initargs=(signal.SIGINT, signal.SIG_IGN),
    ) as pool:
        try:
            yield pool
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise


def _print(findings: dict[str, Any]) -> None:
    from headway.literature.barhoumi2025.reproduction import bounds_text, count, key_condition, number_text

    if not findings:
        return
    rows = []
    for name, finding in findings.items():
        key = key_condition(finding)
        held = f"{finding.holding} of {len(finding.outcomes)}"
        rows.append((name, finding.verdict, held, number_text(key.value, key.unit), bounds_text(key), key.name))
    columns = ("claim", "verdict", "holds in", "measured", "asked for", "what")
    show.print_table(", ".join(f"{n} {verdict}" for verdict, n in count(findings).items()), columns, rows, left=2)
