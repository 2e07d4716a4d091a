"""`headway benchmark`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from headway.cli import show
from headway.cli.options import FigureForm, Json, ModelFile, ReportForm, laws_of

if TYPE_CHECKING:
    from headway.benchmark.outcome import Outcome

__all__ = ["benchmark"]


def benchmark(
    file: Annotated[Path | None, Parameter(help="A TOML file whose models, disturbances and delays join.")] = None,
    *,
    out: Annotated[Path, Parameter(help="The folder that the report is written into.")] = Path("out/benchmark"),
    format: ReportForm = "html",
    figures: FigureForm = "svg",
    leader: Annotated[
        list[Path] | None, Parameter(help="A recording whose leader joins the disturbances; may be repeated.")
    ] = None,
    model: ModelFile = None,
    quick: Annotated[bool, Parameter(help="Three disturbances and four delays only.")] = False,
    json: Json = False,
) -> None:
    """Compare models under the same disturbances and delays, and write a report."""
    from headway.benchmark.spec import load_benchmark

    described = load_benchmark(file, laws_of(model), leader or [])
    if quick:
        described = described.quick()
    from headway.benchmark.outcome import run_benchmark

    with show.progress("simulating") as progress:
        outcome = run_benchmark(described, progress)
    from headway.benchmark.report import benchmark_report
    from headway.report import write

    files: dict[str, bytes | str] = {file.name: file.read_bytes()} if file is not None else {}
    with show.working("writing the report"):
        page = write(benchmark_report(outcome, files), out, format=format, figures=figures)
    if json:
        show.print_json({**outcome.as_json(), "report": str(page)})
    else:
        _print(outcome, page)


def _print(outcome: Outcome, page: Path) -> None:
    names = list(outcome.scores[0].ranks)
    rows = [(s.who, *(show.rounded(s.ranks[n], 3) for n in names), show.rounded(s.overall, 3)) for s in outcome.scores]
    show.print_table("mean ranks, 1 is best", ("model", *names, "mean"), rows)
    for text in outcome.findings:
        print(text.replace("**", ""))
    if failed := outcome.board.failed:
        print(f"{len(failed)} of {len(outcome.board.cells)} cells could not be run; the report says why")
    print(f"wrote {page}")
