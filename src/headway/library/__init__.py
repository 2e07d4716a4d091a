"""Ready scenarios that come with headway: the paper's experiments and examples of our own.

Each is a plain TOML file: `paper:idm-2` is `idm-2.toml` among the scenarios of that paper. In a
description, S marks what the paper states and U what it does not and headway chooses.
"""

from __future__ import annotations

import functools
import tomllib
from collections.abc import Iterable
from importlib import resources
from typing import TYPE_CHECKING, Any

from headway.checked import typed
from headway.errors import HeadwayError, unknown_name

if TYPE_CHECKING:
    from importlib.resources.abc import Traversable

    from headway.models import Law
    from headway.scenario.scenario import Scenario

__all__ = ["is_ready", "library", "library_scenario", "library_table"]

#: where the files of each group lie in the package
_GROUPS = {"paper": "literature/barhoumi2025/scenarios", "example": "library/example"}


@functools.cache
def _files() -> dict[str, Traversable]:
    """Where each ready scenario lies, by full name: the paper's first, then the examples."""
    root = resources.files("headway")
    return {
        f"{group}:{file.name.removesuffix('.toml')}": file
        for group, folder in _GROUPS.items()
        for file in sorted((root / folder).iterdir(), key=lambda f: f.name.removesuffix(".toml"))
        if file.name.endswith(".toml")
    }


def is_ready(name: str) -> bool:
    """Whether a text is written as the name of a ready scenario, be there such a one or not."""
    return name.partition(":")[0] in _GROUPS


def library() -> dict[str, str]:
    """Full name of every ready scenario, e.g. `paper:idm-2`, and what it shows, in one line."""
    return {name: library_table(name)["description"].split(". ")[0].rstrip(".") for name in _files()}


@typed
def library_table(name: str) -> dict[str, Any]:
    """The raw table of a ready scenario, to be changed freely by the caller.

    Args:
        name: Its full name, e.g. `paper:idm-2`.

    Raises:
        HeadwayError: If there is none of this name; the nearest one is named.
    """
    files = _files()
    if name not in files:
        raise _unknown(name)
    return tomllib.loads(files[name].read_text(encoding="utf-8"))


@typed
def library_scenario(name: str, models: Iterable[Law] = ()) -> Scenario:
    """A ready scenario.

    Args:
        name: Its full name, e.g. `paper:idm-2`.
        models: Laws of one's own that it may ask for.

    Raises:
        HeadwayError: If there is none of this name; the nearest one is named.
    """
    from headway.scenario.document import from_table

    return from_table(library_table(name), models)


def _unknown(name: object) -> HeadwayError:
    return unknown_name("ready scenario", name, _files())
