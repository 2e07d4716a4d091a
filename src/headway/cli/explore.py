"""`headway explore`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from headway.cli import show
from headway.cli.options import ModelFile, SetField, import_numba_without_blas, read_scenario
from headway.errors import HeadwayError

if TYPE_CHECKING:
    from headway.scenario.scenario import Scenario

__all__ = ["explore"]

#: where nothing is named: twenty cars behind a leader that swings
_START: dict[str, Any] = {
    "duration": 60.0,
    "leader": {"kind": "sine", "mean": 23.0, "amplitude": 2.0, "omega": 0.63},
    "followers": [{"model": "idm", "count": 20, "delay": 0.3, "parameters": {"T": 1.2}}],
}


def explore(
    scenario: Annotated[
        str | None, Parameter(help="A scenario file, a ready scenario, or a link copied from the page.")
    ] = None,
    *,
    model: ModelFile = None,
    set_: SetField = None,
    port: Annotated[int, Parameter(help="Port of 127.0.0.1; 0 takes a free one.")] = 0,
    no_browser: Annotated[bool, Parameter(name="--no-browser", help="Print the address only.")] = False,
) -> None:
    """A page with sliders: the platoon, its stability and its safety answer at once."""
    import copy

    from headway.explorer import explore as start
    from headway.models.own import load_laws
    from headway.scenario.document import from_table, override

    if not 0 <= port <= 65535:
        raise HeadwayError(f"--port {port}: allowed are 0 to 65535")
    named = [(law, text) for text in model or [] for law in load_laws(text)]
    laws, references = [law for law, _ in named], {law.name: text for law, text in named}
    with show.working("starting the explorer"):
        if scenario is not None and "#" in scenario:
            from headway.explorer.state import decode

            subject: Scenario | dict[str, Any] = decode(scenario)
        elif scenario is not None:
            subject = read_scenario(scenario, set_ or [], model or [])
        else:
            table = copy.deepcopy(_START)
            if laws:
                table["followers"] = [{"model": laws[0].name, "count": 20}]
            for assignment in set_ or []:
                override(table, assignment)
            subject = from_table(table, laws)
        import_numba_without_blas()
        running = start(subject, models=laws, references=references, port=port, browser=not no_browser)
    print(f"the explorer is at {running.url}\nCtrl+C ends it", flush=True)
    running.wait()
