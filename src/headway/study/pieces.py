"""How a study is cut into pieces, and which of them a process does."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

from headway.errors import HeadwayError, shorten
from headway.metrics.registry import Metric
from headway.scenario.scenario import Scenario
from headway.study.work import batch_size

__all__ = ["PARTS", "check_chunk", "check_shard", "piece_size"]

#: seconds of one core that a piece is to take, and those of one follower and step, about
_PIECE_TIME, _STEP_TIME = 0.4, 7e-9

#: most points of a piece, of one whose trajectories are measured, and of one that is run point by point
_MOST, _MOST_WHOLE, _MOST_OWN = 16_384, 2048, 64

#: a piece is at most this part of a study, so that there is something to share out
PARTS = 16


def piece_size(scenario: Scenario, metrics: Iterable[Metric], count: int) -> int:
    """Points of a piece, by time; it depends on the study alone.

    Args:
        scenario: the scenario of the study.
        metrics: what is measured.
        count: how many points the study has.
    """
    metrics = tuple(metrics)
    work = len(scenario.followers) * scenario.end / scenario.step * _STEP_TIME
    alone = any(m.own for m in metrics)
    most = _MOST if all(m.reduced is not None for m in metrics) else _MOST_OWN if alone else _MOST_WHOLE
    most = min(most, max(1, int(_PIECE_TIME / work)))
    size = max(1, min(most, math.ceil(count / PARTS)))
    batch = batch_size(scenario)
    return size if size < batch else -(-size // batch) * batch


def check_chunk(chunk: Any) -> int:
    """The number of points of a piece, checked.

    Args:
        chunk: the number as typed by the user.

    Raises:
        HeadwayError: if it is not a whole number of 1 or more.
    """
    if isinstance(chunk, bool) or not isinstance(chunk, int) or chunk < 1:
        raise HeadwayError(f"chunk = {shorten(chunk)} is not a whole number of points, 1 or more")
    return chunk


def check_shard(shard: Any, store: Any) -> None:
    """Refuse a part of the pieces that does not exist, or that has no store to go to.

    Args:
        shard: (i, n), the i-th of n parts, from 1.
        store: path of the store, or None.

    Raises:
        HeadwayError: for what is no such pair, and without a store.
    """
    try:
        i, n = (int(x) for x in shard)
    except (TypeError, ValueError):
        raise HeadwayError(f"shard = {shorten(shard)} is not a pair (i, n)") from None
    if not 1 <= i <= n:
        raise HeadwayError(f"shard {i}/{n} does not exist; shards are 1/{n} to {n}/{n}")
    if store is None:
        raise HeadwayError(f"shard {i}/{n} needs a store, where the shards meet")
