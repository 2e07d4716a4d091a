"""Where the least error lies: differential evolution from several seeds, then a bounded polish of what it leaves.

Long curved valleys (a law's scale against its width) stop an evolution long before their end, and it then
has no members left in others. So it is stopped early and its best members that differ are all polished; and
seeds take turns between two strategies, as each finds minima that the other misses.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np

from headway.arrays import Array
from headway.calibration.loop import Loop
from headway.calibration.polish import Problems, polish
from headway.study.executors import cores

__all__ = ["search"]

#: candidates per quantity, and generations
_CANDIDATES, _GENERATIONS = 16, 40

#: members of each evolution that are polished, and how far apart they are in the unit cube
_MEMBERS, _APART = 16, 0.03

#: an evolution about its best member, or about any
_STRATEGIES = ("best1bin", "rand1bin")

#: rounds of the polish of all members, and of each seed's best
_FIRST, _LAST = 15, 80


def search(loop: Loop, seeds: int, first: int = 0) -> tuple[Array, Array]:
    """Search the unit cube for the least objective from several seeds.

    Args:
        loop: the closed loop of candidates behind the recording.
        seeds: how many searches, each from a seed of its own.
        first: the first seed; the others count on from it.

    Returns:
        Points (p, seeds) of the unit cube and their objectives (seeds,), best first.
    """
    with ThreadPoolExecutor(min(cores(), seeds)) as pool:
        populations = list(pool.map(lambda seed: _evolved(loop, seed), range(first, first + seeds)))
    at, value = polish(loop, Problems.to_record(loop, np.concatenate(populations, axis=1)), _FIRST)
    ends = np.cumsum([members.shape[1] for members in populations])
    best = [a + int(np.argmin(value[a:b])) for a, b in zip([0, *ends[:-1]], ends, strict=True)]
    at, value = polish(loop, Problems.to_record(loop, at[:, best]), _LAST)
    order = np.argsort(value, kind="stable")
    return at[:, order], value[order]


def _evolved(loop: Loop, seed: int) -> Array:
    """The best members (p, ≤ `_MEMBERS`) of one evolution that differ, its whole population as lanes."""
    from scipy.optimize import differential_evolution

    count = len(loop.space.names)
    result = differential_evolution(
        lambda at: loop.errors(np.ascontiguousarray(at.reshape(count, -1))), [(0.0, 1.0)] * count, rng=seed,
        popsize=_CANDIDATES, maxiter=_GENERATIONS, tol=1e-3, polish=False, vectorized=True, updating="deferred",
        init="latinhypercube", strategy=_STRATEGIES[seed % len(_STRATEGIES)],
    )  # fmt: skip
    chosen: list[Array] = []
    for i in np.argsort(result.population_energies, kind="stable"):
        member = result.population[i]
        if all(np.abs(member - other).max() > _APART for other in chosen):
            chosen.append(member)
        if len(chosen) == _MEMBERS:
            break
    return np.array(chosen).T
