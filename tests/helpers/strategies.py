"""Drawn leaders and models for property tests."""

from __future__ import annotations

import math

import numpy as np
from hypothesis import strategies as st

import headway as hw
from headway.data.cycles import CYCLES
from headway.models import BUILT_IN

LAWS = tuple(BUILT_IN.values())

#: within the bounds of the law, where its numbers are of ordinary size
RANGES = {
    ("gmm", "alpha"): st.floats(0.01, 100.0),
    ("gmm", "m"): st.one_of(st.integers(-2, 4).map(float), st.floats(-2.0, 4.0)),
    ("gmm", "l"): st.one_of(st.integers(-1, 6).map(float), st.floats(-1.0, 6.0)),
    ("idm", "delta"): st.one_of(st.sampled_from([1.0, 2.0, 3.0, 4.0]), st.floats(0.5, 12.0)),
    ("idm", "s1"): st.one_of(st.just(0.0), st.floats(0.1, 20.0)),
    ("idm", "T"): st.floats(0.2, 5.0),
    ("idm", "v0"): st.floats(10.0, 60.0),
    ("idm-spacing", "T"): st.floats(0.2, 5.0),
    ("cacc", "h"): st.floats(0.1, 5.0),
    ("cacc", "kp"): st.floats(0.01, 5.0),
    ("ovm", "h"): st.floats(0.0, 40.0),
    ("ovm", "w"): st.floats(0.5, 20.0),
    ("ovm", "v0"): st.floats(1.0, 60.0),
}
RANGES |= {("fvdm", p): RANGES["ovm", p] for p in ("h", "w", "v0")}


@st.composite
def models(draw, laws=LAWS):
    law = draw(st.sampled_from(laws))
    values = {
        p.name: draw(RANGES.get((law.name, p.name), st.floats(max(p.info.low, 0.05), min(p.info.high, 10.0))))
        for p in law.parameters.values()
    }
    return law(**values)


mean, small, omega = st.floats(15.0, 30.0), st.floats(-5.0, 5.0), st.floats(0.05, 3.0)
onset, seconds = st.one_of(st.just(0.0), st.floats(0.1, 20.0)), st.floats(0.5, 30.0)
share = st.one_of(st.just(0.0), st.just(1.0), st.floats(0.001, 1.0))
few = st.integers(1, 4)


def waves(kind):
    return st.builds(lambda m, a, w, e: kind(m, a, w, edge=e * math.pi / w), mean, small, omega, share)


@st.composite
def multisines(draw):
    k = draw(few)
    lists = [draw(st.lists(s, min_size=k, max_size=k)) for s in (st.floats(-3, 3), omega, st.floats(-7, 7))]
    return hw.multisine(draw(mean), *lists[: 2 + draw(st.integers(0, 1))])


@st.composite
def recordings(draw):
    steps = draw(st.lists(st.floats(0.05, 3.0), min_size=2, max_size=12))
    speeds = draw(st.lists(st.floats(0.0, 30.0).map(lambda v: round(v, 6)), min_size=len(steps), max_size=len(steps)))
    time = np.cumsum(steps)
    return hw.recorded(time=time, speed=speeds, interpolation=draw(st.sampled_from(["smooth", "linear"])))


@st.composite
def cycles(draw):
    start = draw(st.floats(0, 500))
    interpolation = draw(st.sampled_from(["smooth", "linear"]))
    return hw.cycle(draw(st.sampled_from(CYCLES)), start=start, end=start + draw(seconds), interpolation=interpolation)


LEADERS = {
    "constant": st.builds(hw.constant, mean),
    "sine": st.builds(hw.sine, mean, small, omega),
    "window": st.builds(hw.window, mean, small, omega, seconds, onset),
    "step": st.builds(hw.step, mean, small, onset, st.one_of(st.just(0.0), seconds)),
    "brake": st.builds(hw.brake, mean, st.floats(0.5, 15.0), st.floats(0, 10), seconds, st.floats(0, 10), onset),
    "square": waves(hw.square),
    "sawtooth": waves(hw.sawtooth),
    "triangle": st.builds(hw.triangle, mean, small, omega),
    "multisine": multisines(),
    "chirp": st.builds(hw.chirp, mean, small, omega, omega, st.floats(1.0, 60.0)),
    "noise": st.builds(hw.noise, mean, st.floats(0, 3), st.floats(0.5, 20), st.floats(0.4, 2)),
    "cycle": cycles(),
    "recorded": recordings(),
}
