"""What a page can take away: the scenario as TOML, its trajectories as CSV, the Python lines."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path

from headway.engine.simulate import simulate
from headway.explorer.lines import python_lines
from headway.explorer.state import PageState
from headway.results import save

__all__ = ["FORMS", "export"]


def _csv(state: PageState, references: Mapping[str, str]) -> str:
    with tempfile.TemporaryDirectory() as folder:
        return save(simulate(state.scenario), Path(folder) / "run.csv").read_text(encoding="utf-8")


#: suffix of a file → its text
FORMS: dict[str, Callable[[PageState, Mapping[str, str]], str]] = {
    "toml": lambda state, _: state.scenario.to_toml(),
    "py": lambda state, references: python_lines(state.scenario, references),
    "csv": _csv,
}


def export(state: PageState, form: str, references: Mapping[str, str]) -> str:
    """The text of a file of this form (one of `FORMS`)."""
    return FORMS[form](state, references)
