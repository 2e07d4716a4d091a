"""Options and arguments that several verbs share: how they are written, and what becomes of them."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

from headway.checked import as_path
from headway.cli import parse
from headway.errors import HeadwayError, did_you_mean, shorten

if TYPE_CHECKING:
    from headway.models.law import Law
    from headway.scenario.scenario import Scenario
    from headway.scenario.vehicle import Vehicle

__all__ = [
    "FIGURES", "Column", "Delay", "Figure", "FigureForm", "Format", "Gap", "Json", "Lag", "MetricNames", "ModelFile",
    "Out", "ReportForm", "SetAny", "SetField", "SetParameter", "SetStudy", "Unit", "check_target",
    "import_numba_without_blas", "law_named", "laws_of", "read_scenario", "reading", "vehicle_of",
]  # fmt: skip

Json = Annotated[bool, Parameter(help="Print as JSON.")]
SetField = Annotated[
    list[str] | None,
    Parameter(name="--set", help="Override any field, e.g. followers.0.parameters.T=1.1; may be repeated."),
]
SetParameter = Annotated[
    list[str] | None, Parameter(name="--set", help="A parameter of the law, e.g. T=1.2; may be repeated.")
]
SetAny = Annotated[
    list[str] | None,
    Parameter(name="--set", help="A parameter, e.g. T=1.2, or a field of the scenario; may be repeated."),
]
SetStudy = Annotated[
    list[str] | None, Parameter(name="--set", help="Override any field, e.g. design.count=256; may be repeated.")
]
ModelFile = Annotated[
    list[str] | None,
    Parameter(help="Allow a law from a file, e.g. my.py:soft; this runs the file. May be repeated."),
]
Delay = Annotated[str, Parameter(help="Seconds for all on-board signals, or e.g. s=0.5,dv=0.5.")]
Lag = Annotated[float, Parameter(help="Time constant of the actuator [s].")]
Gap = Annotated[float | None, Parameter(help="Gap [m], where every gap is an equilibrium (GMM).")]
MetricNames = Annotated[
    str, Parameter(help="Metrics, with commas between, e.g. ttc,tet(threshold=4); see headway metrics.")
]
ReportForm = Annotated[Literal["html", "md"], Parameter(help="Format of the report.")]
FigureForm = Annotated[Literal["svg", "pdf", "png"], Parameter(help="Format of the figures beside the report.")]
Out = Annotated[Path | None, Parameter(help="Write the trajectories to this .nc or .csv file.")]
Figure = Annotated[Path | None, Parameter(help="Draw it into this .png, .svg or .pdf file.")]
Format = Annotated[str | None, Parameter(help="File format; found by looking if not given.")]
Column = Annotated[list[str] | None, Parameter(help="Name of a column in the file, e.g. speed=v; may be repeated.")]
Unit = Annotated[list[str] | None, Parameter(help="Unit of a column, e.g. speed=km/h; may be repeated.")]

#: what figures are written as
FIGURES = (".png", ".svg", ".pdf")


def reading(form: str | None, columns: list[str] | None, units: list[str] | None) -> dict[str, Any]:
    """How a file is to be read, as `headway.data.read` takes it."""
    return {"format": form, "columns": parse.pairs("--column", columns), "units": parse.pairs("--unit", units)}


# -- laws and scenarios -------------------------------------------------------------------------------------------


def laws_of(references: list[str] | None) -> list[Law]:
    """The laws of files named with --model."""
    from headway.models.own import load_laws

    return [law for reference in references or [] for law in load_laws(reference)]


def law_named(reference: str) -> Law:
    """The law of a name, or the one in a Python file.

    Raises:
        HeadwayError: If there is none, or the file holds several and names none.
    """
    from headway.models.own import load_laws
    from headway.models.registry import find

    if ".py" not in reference:
        return find(reference)
    laws = load_laws(reference)
    if len(laws) > 1:
        names = ", ".join(law.name for law in laws)
        raise HeadwayError(f"--model {reference}: holds {names}; name one, e.g. {reference}:{laws[0].name}")
    return laws[0]


def vehicle_of(law: Law, assignments: list[str] | None, delay: str, lag: float) -> Vehicle:
    """A vehicle of a law as typed with --set, --delay and --lag."""
    from headway.scenario.vehicle import Vehicle

    return Vehicle(
        law(**parse.assignments("--set", assignments or [], parse.PARAMETER)), delay=parse.delay(delay), lag=lag
    )


def read_scenario(name: str, assignments: list[str], references: list[str]) -> Scenario:
    """The scenario of a file or of the library, with overrides and laws of one's own.

    Args:
        name: A TOML file, or the full name of a ready scenario.
        assignments: Texts such as leader.omega=0.5, as --set takes them.
        references: Files of laws, as --model takes them.

    Raises:
        HeadwayError: If there is no such scenario, or what is typed does not fit it.
    """
    from headway.scenario.document import from_table, override, read_table

    laws = laws_of(references)
    from headway.library import is_ready, library_table

    if is_ready(name):
        table, folder = library_table(name), Path(".")
    else:
        path = as_path(name, "scenario")
        if not name.endswith(".toml") and not _exists(path):
            raise _no_scenario(name)
        table, folder = read_table(path), path.parent
    for assignment in assignments:
        override(table, assignment)
    return from_table(table, laws, folder)


def _exists(path: Path) -> bool:
    try:
        return path.exists()
    except OSError:
        return False


def _no_scenario(name: str) -> HeadwayError:
    """The error for what is neither a file nor a ready scenario; people type a law or the tail of a name."""
    from headway.library import library
    from headway.models.registry import BUILT_IN

    shown = shorten(name)
    law = next((n for n in BUILT_IN if n.lower() == name.lower()), None)
    if law is not None:
        return HeadwayError(
            f"{shown} is a law and no scenario; ready scenarios are shown by headway run --list, and headway stability "
            f"{law} --speed 20 asks about the law itself"
        )
    return HeadwayError(
        f"{shown} is neither a scenario file (.toml) nor a ready scenario{did_you_mean(name, library())} "
        "(headway run --list shows them)"
    )


# -- files to be written ------------------------------------------------------------------------------------------


def check_target(path: Path | None, kinds: tuple[str, ...]) -> None:
    """Refuse a target before anything is computed.

    Args:
        path: The file to be written, None for none.
        kinds: Suffixes that are allowed.

    Raises:
        HeadwayError: If the suffix is another, or there is no folder for the file.
    """
    if path is None:
        return
    as_path(path, "file to write")
    if path.suffix not in kinds:
        raise HeadwayError(f"{path}: allowed here are files ending in {', '.join(kinds)}")
    if not path.parent.is_dir():
        raise HeadwayError(f"{path}: the folder {path.parent} does not exist")
    if path.is_dir():
        raise HeadwayError(f"{path}: cannot be written, it is a folder")


def import_numba_without_blas() -> None:
    """Import numba's array functions while scipy.linalg, which they look for, cannot be found.

    The kernel does no linear algebra and need not wait a third of a second for it. Only the command
    line does this: it owns the process, and nobody else compiles in it.
    """
    from headway.environment import check_compiler

    check_compiler()
    if "scipy.linalg" in sys.modules:
        return
    sys.modules["scipy.linalg"] = None  # type: ignore[assignment]  # the documented way to hide one
    try:
        import numba.np.arraymath  # noqa: F401  imported for what it looks for
    finally:
        del sys.modules["scipy.linalg"]
