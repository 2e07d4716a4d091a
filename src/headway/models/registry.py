"""The laws that come with headway, by name, and how a person's own laws join them."""

from __future__ import annotations

from collections.abc import Iterable

from headway.errors import HeadwayError, unknown_name
from headway.models.cooperative import CACC
from headway.models.general_motors import GMM
from headway.models.intelligent_driver import IDM, IDMSpacing
from headway.models.law import Law
from headway.models.optimal_velocity import FVDM, OVM

__all__ = ["BUILT_IN", "CACC", "FVDM", "GMM", "IDM", "OVM", "IDMSpacing", "find", "with_own"]

BUILT_IN: dict[str, Law] = {law.name: law for law in (OVM, FVDM, IDM, IDMSpacing, GMM, CACC)}


def with_own(own: Iterable[Law] = ()) -> dict[str, Law]:
    """The built-in laws and `own`, by name; a law of one's own may not take a built-in's name."""
    known = dict(BUILT_IN)
    for law in own:
        if law.name in BUILT_IN and BUILT_IN[law.name] is not law:
            raise HeadwayError(f"law {law.name!r}: this name belongs to a built-in law; rename the function")
        known[law.name] = law
    return known


def find(name: str, own: Iterable[Law] = (), place: str = "model") -> Law:
    """The law of this name.

    A file that asks for a law which is neither built in nor in `own` is refused with a sentence
    that says how a law from a file is allowed: a scenario alone never runs code.
    """
    known = with_own(own)
    if name in known:
        return known[name]
    # the laws are called IDM, OVM, … in Python and in print
    same = [law for n, law in known.items() if isinstance(name, str) and n.lower() == name.lower()]
    if len(same) == 1:
        return same[0]
    error = unknown_name(place, name, known)
    example = name if isinstance(name, str) and name.isidentifier() and len(name) < 40 else "soft"
    raise HeadwayError(f"{error} (a law from a file is allowed only by naming it: --model my.py:{example})")
