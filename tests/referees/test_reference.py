"""The compiled engine against the independent reference, which shares no stepping code with it."""

from __future__ import annotations

from typing import Annotated

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from headway.engine.reference import simulate_reference
from headway.engine.simulate import simulate
from headway.models import CACC, FVDM, GMM, IDM, OVM, IDMSpacing, Param, model
from headway.scenario.leaders import (
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
    Brake(4.0, 4.0, hold=0.7, ramp=1.0, onset=0.2),
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
        duration=3.5,
        dt=0.002,
        output_step=0.05,
        seed=seed,
        gaps=gaps,
        gap_offsets=draw(st.dictionaries(numbers, st.sampled_from([-1.0, 0.5, 3.0]), max_size=2)),
        speed_offsets=draw(st.dictionaries(numbers, st.sampled_from([-0.5, 0.25, 1.0]), max_size=2)),
    )


@settings(derandomize=True, max_examples=10, deadline=None, database=None, suppress_health_check=list(HealthCheck))
@given(scenarios())
def test_any_platoon_agrees_with_the_reference(scenario):
    assert_agree(scenario)


def platoon(leader, followers, duration: float = 4.0, dt: float = 0.002, **more) -> Scenario:
    return Scenario(leader, followers, duration=duration, dt=dt, output_step=0.05, **more)


@pytest.mark.parametrize("leader", LEADERS, ids=lambda leader: leader.kind)
def test_every_leader(leader):
    """Behind each leader a driver, a radio that hears accelerations late and a law that hears the platoon leader."""
    followers = [
        Vehicle(IDM(), delay=0.3717),
        Vehicle(CACC(), delay={"vl": 0.1537, "al": 0.25}),
        Vehicle(convoy(), delay={"a0l": 0.1, "v0l": 0.0013}, lag=0.2),
    ]
    assert_agree(platoon(leader, followers, duration=3.0, seed=1))


@pytest.mark.parametrize("law", LAWS, ids=lambda law: law.name)
@pytest.mark.parametrize("how", ["all late", "as late as each can be", "composed"])
def test_every_law_with_late_signals(law, how):
    signals = law.law.signals
    if how == "all late":
        delay = 0.3141
    elif how == "as late as each can be":
        delay = {signal: 0.1 + 0.0771 * i for i, signal in enumerate(signals)}
    else:
        delay = {"s": 0.3141, "vl": 0.2} if "dv" in signals else {"s": 0.3141}
    assert_agree(platoon(Sine(MEAN, 2.0, 1.7), [Vehicle(law, delay=delay)] * 2, duration=2.5, gaps=22.0))


@pytest.mark.parametrize("delay", [0.0003, 0.0017, 0.0019999, 0.0020001])
def test_delays_around_and_below_the_step(delay):
    assert_agree(platoon(Sine(MEAN, 2.0, 1.7), [Vehicle(IDM(), delay=delay)] * 2, duration=0.15))


@pytest.mark.parametrize("delay", [0.0, 0.0013, 0.25])
@pytest.mark.parametrize("limits", [None, (-0.5, 0.4)])
def test_lagged_actuators_behind_jumps_of_the_command(delay, limits):
    """Behind a lag a jump of what is heard shows one derivative later, there and in all that it is passed on to."""
    followers = [
        Vehicle(CACC(h=0.8), lag=0.2, delay={"al": delay, "vl": delay}, limits=limits),
        Vehicle(CACC(h=0.8), lag=0.45, delay={"al": delay}),
        Vehicle(convoy(), delay={"a0l": delay}, limits=limits),
    ]
    assert_agree(platoon(Square(MEAN, 0.7, 1.9), followers))


def test_initial_offsets_start_jumps_of_their_own():
    followers = [Vehicle(IDM(), delay=0.3717), Vehicle(CACC(), delay={"vl": 0.25, "al": 0.25}), Vehicle(IDM(), lag=0.3)]
    offsets = {"gap_offsets": {1: 2.0, 3: -1.0}, "speed_offsets": {1: -1.0, 2: 1.0, 3: 0.5}}
    assert_agree(platoon(Constant(MEAN), followers, **offsets))


def test_a_leader_that_starts_at_another_speed_than_the_platoon():
    followers = [Vehicle(IDM(), delay=0.3717), Vehicle(CACC(), delay={"vl": 0.25, "al": 0.25}), Vehicle(IDM())]
    scenario = platoon(Constant(MEAN), followers, initial_speed=MEAN + 2.0)
    assert_agree(scenario)
    first = simulate(scenario).sel(time=slice(0, 0.36))
    # until its own delay has passed, a follower sees the gap and the speeds of the start
    assert np.ptp(first.acceleration.values[1]) < 1e-12


@pytest.mark.parametrize(
    "vehicle",
    [
        Vehicle(IDM(T=0.8), delay=0.3),
        Vehicle(IDM(T=0.5), delay=0.2, lag=0.8),
        Vehicle(CACC(h=0.9), delay={"al": 0.1537}),
        Vehicle(CACC(h=0.9), lag=0.2, limits=(-4.0, 1.5)),
    ],
    ids=["late", "asked to go before it stops", "radio", "lag and limits"],
)
def test_standstill(vehicle):
    scenario = platoon(Brake(10.0, 10.0, hold=6.0, ramp=2.3, onset=0.5), [vehicle] * 2, duration=14.0)
    assert_agree(scenario)
    assert (simulate(scenario).speed.values[1] == 0.0).any()


def test_starting_from_rest():
    followers = [Vehicle(IDM(), delay=0.3), Vehicle(CACC(h=0.9), lag=0.2), Vehicle(convoy())]
    assert_agree(platoon(Step(0.0, 5.0, onset=1.0, edge=1.0), followers, duration=6.0))


def test_collisions():
    weak = FVDM(alpha=0.1, lam=0.05, v0=11.0, h=14.0, w=8.0)
    driver = Vehicle(IDM())
    followers = [Vehicle(IDM(), delay=0.2), Vehicle(weak, lag=0.3), driver, Vehicle(weak, delay=0.1), driver]
    scenario = platoon(Brake(MEAN, 11.0, hold=9.0, ramp=1.5, onset=0.2), followers, duration=8.0)
    assert_agree(scenario)
    assert np.isfinite(simulate(scenario).collision_time.values[2])


def test_the_reference_has_the_value_of_a_textbook():
    """x' = -x(t - 1), x = 1 before 0."""

    @model
    def decay(v, *, offset: float = 5.0):
        return -(v - offset)

    scenario = Scenario(
        Constant(5.0), [Vehicle(decay(), delay={"v": 1.0})], duration=10.0, gaps=1000.0, speed_offsets={1: 1.0}
    )
    x = simulate_reference(scenario, [0.0, 0.5, 1.0, 5.0, 10.0]).speed[1] - 5.0
    np.testing.assert_allclose(x, [1.0, 0.5, 0.0, 0.1583333333, 0.0202411265], rtol=0, atol=1e-10)
