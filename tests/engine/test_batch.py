"""`simulate_many` gives each scenario the bits that `simulate` gives it alone."""

from __future__ import annotations

import numpy as np
import pytest

from headway.engine.plan import structure
from headway.engine.simulate import simulate, simulate_many
from headway.metrics.registry import named
from headway.models import CACC, FVDM, GMM, IDM
from headway.scenario.leaders import Brake, Noise, Sine, Window
from headway.scenario.scenario import Scenario
from headway.scenario.vehicle import Vehicle
from headway.study.study import Study

COMMON = {"duration": 6.0, "dt": 0.02, "output_step": 0.1}


def assert_same_bits(scenarios) -> None:
    for scenario, batched in zip(scenarios, simulate_many(scenarios), strict=True):
        alone = simulate(scenario)
        for name in alone.variables:
            np.testing.assert_array_equal(batched[name].values, alone[name].values, err_msg=name)
        assert batched.attrs == alone.attrs


def drivers(i: int) -> Scenario:
    """One structure; every number a lane may have for itself differs."""
    law = IDM(a=1.0 + 0.1 * (i % 7), T=1.0 + 0.05 * (i % 5), v0=30.0 + i % 3)
    return Scenario(
        Sine(15.0 + 0.1 * i, 1.0 + 0.01 * i, 0.9),
        [Vehicle(law, delay=0.3717, length=4.0 + 0.1 * (i % 4))] * 3,
        gap_offsets={1: 0.1 * (i % 6)},
        **COMMON,
    )


def cooperative(i: int) -> Scenario:
    """Accelerations heard at once, which are evaluated in one way with few lanes and in another with many."""
    return Scenario(
        Window(15.0, 1.0 + 0.1 * i, 1.3, duration=3.0, onset=0.77),
        [Vehicle(CACC(h=0.8 + 0.01 * i)), Vehicle(CACC(ka=0.9)), Vehicle(CACC(ka=0.9), lag=0.2), Vehicle(CACC())],
        **COMMON,
    )


def late_cooperative(i: int) -> Scenario:
    """Late and early signals, a lag and limits that are never reached."""
    return Scenario(
        Sine(15.0, 0.5 + 0.02 * i, 1.1),
        [Vehicle(CACC(h=0.8), delay={"vl": 0.1537, "al": 0.0071}, lag=0.1 + 0.01 * i, limits=(-8.0 - i, 8.0 + i))] * 3,
        **COMMON,
    )


def mixed(i: int) -> Scenario:
    """Another platoon for each number."""
    followers = [Vehicle(IDM(), delay=0.1 * (i % 3)), Vehicle(FVDM(v0=15.0, h=14.0, w=8.0)), Vehicle(GMM())]
    followers = followers[i % 3 :] + followers[: i % 3]
    return Scenario(Sine(12.0, 1.0, 0.5 + 0.1 * (i % 4)), followers[: 1 + i % 3], gaps=20.0, seed=i, **COMMON)


def noisy(i: int) -> Scenario:
    """One leader, another seed for each."""
    return Scenario(Noise(15.0, 0.5), [Vehicle(IDM(), delay=0.25)] * 2, seed=i, **COMMON)


def stopping(i: int) -> Scenario:
    """One structure; some brake to standstill, some hit the one ahead, some do neither."""
    drop = (2.0, 12.0, 5.0, 11.5)[i % 4]
    law = FVDM(alpha=0.05 if i % 4 == 2 and i % 8 > 4 else 0.8, lam=0.02 if i % 8 > 4 else 0.6, v0=15.0, h=14.0, w=8.0)
    return Scenario(
        Brake(12.0, drop, hold=4.0, ramp=1.5),
        [Vehicle(IDM(T=0.8), delay=0.3), Vehicle(law)],
        **COMMON | {"duration": 12.0},
    )


def limited(i: int) -> Scenario:
    """Limits that are reached, standstill, delays and a lag; some collide."""
    law = IDM(T=0.7 + 0.05 * (i % 5), a=1.0 + 0.1 * (i % 3))
    return Scenario(
        Brake(12.0, (12.0, 6.0, 11.0)[i % 3], hold=3.0, ramp=1.2),
        [Vehicle(law, delay=0.3, limits=(-3.0 - 0.5 * (i % 4), 1.0)), Vehicle(law, delay=0.2, lag=0.3)] * 2,
        **COMMON | {"duration": 12.0},
    )


def late_and_stopping(i: int) -> Scenario:
    """Late accelerations, off the grid of steps, of vehicles that stop: some lanes need another plan than others."""
    return Scenario(
        Brake(12.0, (3.0, 12.0)[i % 2], hold=3.0, ramp=1.5),
        [Vehicle(CACC(h=0.9 + 0.01 * i, ka=0.5), delay={"vl": 0.1, "al": 0.1})] * 3,
        **COMMON | {"duration": 12.0},
    )


def ballistic(i: int) -> Scenario:
    """The field's scheme, with stops and collisions."""
    return Scenario(
        Brake(12.0, (12.0, 6.0, 11.0)[i % 3], hold=3.0, ramp=1.2),
        [Vehicle(IDM(T=0.7 + 0.05 * i), delay=0.3 if i < 20 else 0.0), Vehicle(FVDM(alpha=0.05, v0=15.0, h=14.0))] * 2,
        scheme="ballistic",
        **COMMON | {"duration": 12.0},
    )


EVENTFUL = [stopping, limited, late_and_stopping, ballistic]


@pytest.mark.parametrize("make", [drivers, cooperative, late_cooperative, mixed, noisy, *EVENTFUL])
@pytest.mark.parametrize("count", [1, 2, 7, 20])
def test_same_bits_alone_and_in_a_batch(make, count):
    assert_same_bits([make(i) for i in range(count)])


def test_same_bits_in_more_lanes_than_one_block_holds():
    scenarios = [drivers(i) for i in range(150)]
    assert len({structure(s) for s in scenarios}) == 1
    assert_same_bits(scenarios)


def test_order_is_kept_when_structures_alternate():
    scenarios = [make(i) for i in range(3) for make in (drivers, stopping, cooperative, noisy, mixed)]
    assert_same_bits(scenarios)


def test_the_families_are_what_they_are_meant_to_be():
    for make in (drivers, cooperative, late_cooperative, noisy, stopping):
        assert len({structure(make(i)) for i in range(8)}) == 1, make.__name__
    assert len({structure(mixed(i)) for i in range(3)}) == 3
    results = simulate_many([stopping(i) for i in range(8)])
    stands = [bool((r.speed.values[1:] == 0.0).any()) for r in results]
    hits = [bool(np.isfinite(r.collision_time.values).any()) for r in results]
    assert True in stands
    assert False in stands
    assert True in hits
    assert False in hits
    assert not all(s or h for s, h in zip(stands, hits, strict=True))
    seeds = simulate_many([noisy(i) for i in range(2)])
    assert (seeds[0].speed.values != seeds[1].speed.values).any()


def test_nothing_gives_nothing():
    assert simulate_many([]) == []


REDUCED = ["least_gap", "rms_speed", "largest_acceleration", "least_acceleration", "speed_amplitude_ratio"]


@pytest.mark.parametrize("names", [[*REDUCED, "collision_time"], [*REDUCED, "collision_time", "tet"]])
@pytest.mark.parametrize("make", EVENTFUL)
def test_a_study_has_the_values_of_its_runs_where_vehicles_stop_and_collide(make, names):
    """Reduced on the way, or from trajectories (`tet`): the same bits as alone, also of lanes that collide."""
    for scenario in [make(i) for i in range(4)]:
        model = scenario.followers[0].model
        parameter = next(iter(model.parameters))
        values = [getattr(model, parameter) * f for f in (1.0, 1.01, 1.02)]
        study = Study(scenario, {f"followers.0.parameters.{parameter}": values})
        batched = study.run(metrics=names)
        for i in range(3):
            alone = simulate(study.scenario_at(i))
            hit = alone.collision_time.values
            np.testing.assert_array_equal(batched.collision_time.values[i], hit)
            assert batched.status.values[i] == ("collision" if np.isfinite(hit).any() else "ok")
            for name in names[:-1]:
                expected = named(name).of(alone).values
                np.testing.assert_array_equal(batched[name].values[i], expected, err_msg=name)
