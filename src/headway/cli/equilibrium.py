"""The equilibrium that `stability` and `map` speak of where the command line leaves it open."""

from __future__ import annotations

from typing import TYPE_CHECKING

from headway.errors import RestsEverywhereError

if TYPE_CHECKING:
    from headway.models import Model

__all__ = ["SPEED", "check_gap"]

#: speed of the platoon [m/s] where none is given, that of the comparative study
SPEED = 23.0


def check_gap(model: Model, gap: float | None) -> None:
    """Ask for `--gap` where every gap is an equilibrium and none is given."""
    if gap is None and model.rests_everywhere:
        raise RestsEverywhereError(
            f"{model.name}: every gap is an equilibrium, so name the one that is meant with --gap, e.g. --gap 10"
        )
