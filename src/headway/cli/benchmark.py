"""`headway benchmark`."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Parameter

from headway.cli import show

if TYPE_CHECKING:
    from headway.study.benchmark.outcome import Outcome

__all__ = ["benchmark"]


def benchmark(
    file: Annotated[Path | None, Parameter(help="A TOML file whose models, disturbances and delays join.")] = None,
    *,
    out: Annotated[Path, Parameter(help="The folder that the report is written into.")] = Path("out/benchmark"),
    format: Annotated[Literal["html", "md"], Parameter(help="Form of the report.")] = "html",
    figures: Annotated[Literal["svg", "pdf", "png"], Parameter(help="Form of the figures beside the report.")] = "svg",
    leader: Annotated[
        list[Path] | None, Parameter(help="A recording whose leader joins the disturbances; may be repeated.")
    ] = None,
    model: Annotated[
        list[str] | None,
        Parameter(help="Allow a law from a file, e.g. my.py:soft; this runs the file. May be repeated."),
    ] = None,
    quick: Annotated[bool, Parameter(help="Three disturbances and four delays only.")] = False,
    json: Annotated[bool, Parameter(help="Print what was found as JSON.")] = False,
) -> None:
    """Compare models under the same disturbances and delays, and write a report."""
    from headway.models.own import load_laws
    from headway.study.benchmark.spec import load_benchmark

    laws = [law for reference in model or [] for law in load_laws(reference)]
    described = load_benchmark(file, laws, leader or [])
    if quick:
        described = described.quick()
    from headway.study.benchmark.outcome import compare

    with _progress("simulating") as told:
        outcome = compare(described, told)
    from headway.view.benchmark_report import benchmark_report
    from headway.view.report import write

    files: dict[str, bytes | str] = {file.name: file.read_bytes()} if file is not None else {}
    with show.working("writing the report"):
        page = write(benchmark_report(outcome, files), out, format=format, figures=figures)
    if json:
        show.print_json({**outcome.as_json(), "report": str(page)})
    else:
        _print(outcome, page)


def _print(outcome: Outcome, page: Path) -> None:
    names = list(outcome.scores[0].ranks)
    rows = [(s.who, *(show.number(s.ranks[n], 3) for n in names), show.number(s.overall, 3)) for s in outcome.scores]
    show.table("mean ranks, 1 is best", ("model", *names, "mean"), rows)
    for text in outcome.findings:
        print(text.replace("**", ""))
    if failed := outcome.board.failed:
        print(f"{len(failed)} of {len(outcome.board.cells)} cells could not be run; the report says why")
    print(f"wrote {page}")


@contextmanager
def _progress(what: str) -> Iterator[Callable[[int, int], None] | None]:
    """A bar that tells how much is done, on a terminal only."""
    from rich.console import Console
    from rich.progress import Progress

    console = Console(stderr=True)
    if not console.is_terminal:
        yield None
        return
    with Progress(console=console, transient=True) as bar:
        task = bar.add_task(what, total=None)
        yield lambda done, total: bar.update(task, completed=done, total=total)
