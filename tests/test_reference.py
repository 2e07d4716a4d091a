"""The compiled engine against the independent reference, which shares no stepping code with it."""

from __future__ import annotations

import math
from typing import Annotated

import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from headway.engine.reference import simulate_reference
from headway.engine.simulate import simulate
from headway.models import CACC, FVDM, GMM, IDM, OVM, IDMSpacing, Param, model
from headway.scenario.disturbance import (
    Brake,
    Chirp,
    Constant,
    Cycle,
    Multisine,
    Noise,
    Sawtooth,
    Sine,
    Square,
    Step,
    Triangle,
    Window,
)
from headway.scenario.scenario import Scenario
from headway.scenario.vehicle import Vehicle

MEAN = 12.0


@model
def convoy(
    s,
    v,
    dv,
    v0l,
    a0l,
    *,
    k: Annotated[float, Param("1/s²", 0.0, 5.0)] = 0.4,
    c: Annotated[float, Param("1/s", 0.0, 5.0)] = 0.7,
    T: Annotated[float, Param("s", 0.0, 5.0)] = 0.8,
):
    """Follower that also hears the platoon leader."""
    return k * (s - 3.0 - T * v) + c * dv + 0.3 * (v0l - v) + 0.4 * a0l - 0.002 * v * v + 0.002 * v0l * v0l


LAWS = [
    IDM(v0=30.0, s1=0.0),
    IDM(v0=25.0, s1=2.0, delta=2.5),
    IDMSpacing(a=0.8),
    OVM(alpha=0.9, v0=11.0, h=14.0, w=8.0),
    FVDM(alpha=0.6, lam=0.5, v0=11.0, h=14.0, w=8.0),
    GMM(alpha=14.0, m=0.0, l=1.0),
    GMM(alpha=20.0, m=1.0, l=2.0),
    CACC(),
    CACC(kv=0.0, ka=1.0, h=0.8),
    convoy(),
]

LEADERS = [
    Constant(MEAN),
    Sine(MEAN, 2.0, 1.7),
    Window(MEAN, 1.5, 2.3, duration=1.613, onset=0.4321),
    Step(MEAN, -2.0, onset=0.3137),
    Step(MEAN, 1.5, onset=0.5, edge=0.777),
    Brake(MEAN, 5.0, hold=0.6, ramp=1.1, recovery=1.3, onset=0.2),
    Square(MEAN, 0.7, 1.9),
    Square(MEAN, 1.0, 1.9, edge=0.25),
    Sawtooth(MEAN, 0.8, 2.1),
    Triangle(MEAN, 1.0, 2.7),
    Multisine(MEAN, (1.0, 0.5), (0.9, 2.4), (0.3, 1.1)),
    Chirp(MEAN, 1.0, 0.5, 4.0, sweep=2.2),
    Noise(MEAN, 0.6),
    Cycle("us06", start=60.0, end=70.0),
]

#: own look-ups that reach back less than the reference likes to go in one piece are tested on their own
DELAYS = st.sampled_from([0.0, 0.0, 0.1, 0.25, 0.3717, 0.613])
RADIO_DELAYS = st.sampled_from([0.0, 0.0013, 0.1, 0.1537, 0.25, 0.41])


def assert_agree(scenario: Scenario, tolerance: float = 1e-9) -> None:
    """Positions [m] and speeds [m/s] within `tolerance`, accelerations within ten times that, events alike."""
    fast = simulate(scenario)
    slow = simulate_reference(scenario, fast.time.values)
    np.testing.assert_allclose(fast.collision_time.values, slow.collision_time, rtol=0, atol=1e-8)
    for name, allowed in (("position", tolerance), ("speed", tolerance), ("acceleration", 10 * tolerance)):
        np.testing.assert_allclose(fast[name].values, getattr(slow, name), rtol=0, atol=allowed, err_msg=name)
    assert np.nanmin(fast.speed.values) >= 0.0


@st.composite
def vehicles(draw) -> Vehicle:
    """A follower with any law, any delays that its law can have, perhaps a lag, perhaps limits."""
    law = draw(st.sampled_from(LAWS))
    delay: dict[str, float] = {}
    signals = list(law.law.signals)
    if "dv" in signals and "vl" not in signals and draw(st.booleans()):
        signals[signals.index("dv")] = "vl"
    for signal in signals:
        if seconds := draw(RADIO_DELAYS if signal in ("vl", "al", "v0l", "a0l") else DELAYS):
            delay[signal] = seconds
    return Vehicle(
        law,
        delay=delay,
        lag=draw(st.sampled_from([0.0, 0.0, 0.2, 0.45])),
        length=draw(st.sampled_from([0.0, 4.5, 12.0])),
        limits=draw(st.sampled_from([None, None, (-1.0, 0.8), (-0.3, 0.2)])),
    )


@st.composite
def scenarios(draw) -> Scenario:
    """A platoon of one to four followers behind any leader, in equilibrium or not."""
    leader = draw(st.sampled_from(LEADERS))
    followers = draw(st.lists(vehicles(), min_size=1, max_size=4))
    seed = draw(st.integers(0, 3))
    cruise = leader.motion(seed, 5.0).before
    gaps = tuple(20.0 if f.model.name == "gmm" else f.model.equilibrium_gap(cruise) for f in followers)
    numbers = st.integers(1, len(followers))
    return Scenario(
        leader,
        followers,
        duration=4.0,
        dt=0.002,
        output_step=0.05,
        seed=seed,
        gaps=gaps,
        gap_offsets=draw(st.dictionaries(numbers, st.sampled_from([-1.0, 0.5, 3.0]), max_size=2)),
        speed_offsets=draw(st.dictionaries(numbers, st.sampled_from([-0.5, 0.25, 1.0]), max_size=2)),
    )


@settings(derandomize=True, max_examples=30, deadline=None, database=None, suppress_health_check=list(HealthCheck))
@given(scenarios())
def test_any_platoon_agrees_with_the_reference(scenario):
    assert_agree(scenario)
