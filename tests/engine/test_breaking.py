"""Breaking points: what jumps, when, and how long that takes to be known."""

from __future__ import annotations

import itertools
import time

import numpy as np
import pytest

import headway as hw
from headway.engine.breaking import TICK, Jumps, hops, propagate
from headway.models.signal import OWN
from headway.scenario.motion import HIGHEST_ORDER

NOTHING = Jumps.of([], [])


@pytest.mark.parametrize("lag", [0.0, 0.2])
@pytest.mark.parametrize("own", [(0.1, 0.0), (0.1, 0.15), (0.3, 0.37), (0.0, 0.1)])
def test_echoes_are_sums_of_delays(own, lag):
    car = hw.Vehicle(hw.models.CACC, delay={"v": own[0], "a": own[1]}, lag=lag)
    seen = propagate([car], NOTHING, {1: Jumps.of([0.0, 0.4], [2, 2])}, 3.0)[1]
    lowest: dict[int, int] = {}
    steps = [(round(d / TICK), q + (lag > 0)) for d, q in hops(car, OWN) if d > 0]
    for counts in itertools.product(range(31), repeat=len(steps)):
        shift = sum(n * d for n, (d, _) in zip(counts, steps, strict=True))
        order = 2 + sum(n * q for n, (_, q) in zip(counts, steps, strict=True))
        if order <= HIGHEST_ORDER:
            for start in (0, round(0.4 / TICK)):
                if start + shift <= round(3.0 / TICK):
                    lowest[start + shift] = min(order, lowest.get(start + shift, order))
    assert dict(zip(seen.tick.tolist(), seen.order.tolist(), strict=True)) == lowest


def test_many_echoes_take_no_time():
    begin = time.perf_counter()
    jumps = propagate([hw.Vehicle(hw.models.CACC, delay=0.1)] * 5, NOTHING, {1: Jumps.of([0.0], [2])}, 1000.0)
    assert time.perf_counter() - begin < 5
    np.testing.assert_allclose(jumps[5].time, 0.1 * np.arange(10_001), atol=1e-9)
