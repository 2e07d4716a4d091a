"""The compiled loop of calibration against `simulate`, and its objective against its definition."""

from __future__ import annotations

import numpy as np
import pytest

import headway as hw
from headway.calibration.loop import PENALTY, Loop
from headway.calibration.segments import Segment, cut
from headway.calibration.space import Space
from headway.models import CACC, FVDM, GMM, IDM, OVM
from headway.scenario.recorded import Recorded

LEADER = hw.multisine(mean=18.0, amplitudes=(3.0, 1.5, 0.8), omegas=(0.1, 0.31, 0.9), phases=(0.0, 1.0, 2.0))


def recording(car: hw.Vehicle | None = None, duration: float = 60.0, step: float = 0.1) -> hw.data.Recording:
    """One follower behind a lively leader, without noise."""
    car = car or hw.Vehicle(IDM(T=1.2), delay=0.4)
    run = hw.simulate(hw.Scenario(LEADER, [car], duration=duration, dt=0.02, output_step=step, gaps=25.0))
    return hw.calibration.as_recorded(run, 0.0, 0.0)


RECORDING = recording()


def simulated(segment: Segment, start: np.ndarray, car: hw.Vehicle) -> tuple[np.ndarray, np.ndarray]:
    """Gap and speed of the same follower by the engine, at fine steps."""
    leader = Recorded(time=tuple(segment.time), speed=tuple(segment.ahead))
    offset = {1: float(start[1] - segment.ahead[0])}
    run = hw.simulate(
        hw.Scenario(leader, [car], gaps=(float(start[0]),), speed_offsets=offset, dt=0.01, output_step=segment.step)
    )
    return run.gap.values[1], run.speed.values[1]


CARS = {
    "no delay": hw.Vehicle(IDM(T=1.0)),
    "less than a step": hw.Vehicle(IDM(T=1.0), delay=0.04),
    "between steps": hw.Vehicle(IDM(T=1.0), delay=0.737),
    "whole steps": hw.Vehicle(FVDM(alpha=0.4, lam=0.5, v0=15.0, h=20.0, w=12.0), delay=0.3),
    "leader late": hw.Vehicle(IDM(T=1.0), delay={"s": 0.6, "vl": 0.6}),
    "signals apart": hw.Vehicle(IDM(T=1.0), delay={"s": 0.6, "dv": 0.2}),
    "lag": hw.Vehicle(IDM(T=1.0), delay=0.5, lag=0.4),
    "limits": hw.Vehicle(IDM(T=1.2), delay=0.2, limits=(-1.5, 0.6)),
    "exponents": hw.Vehicle(GMM(alpha=6.0, m=0.3, l=0.9), delay=0.8),
    "optimal velocity": hw.Vehicle(OVM(alpha=0.9, v0=15.0, h=20.0, w=12.0)),
    "radio": hw.Vehicle(CACC(h=1.2), delay={"vl": 0.15, "al": 0.15}),
    "radio and a lag": hw.Vehicle(CACC(h=1.2), delay={"vl": 0.25, "al": 0.25}, lag=0.3),
}


@pytest.mark.parametrize("name", CARS)
def test_the_loop_agrees_with_simulate(name):
    car = CARS[name]
    fit = [next(iter(car.model.law.parameters)), "delay", *(["lag"] if car.lag else [])]
    space = Space.of(car, fit)
    (segment,) = cut(RECORDING, 1)[0]
    loop = Loop(space, [segment])
    values = np.array([{**car.model.parameters, "delay": car.perception.longest, "lag": car.lag}[n] for n in fit])
    # the vehicle in question between two others, so that lanes with different delays stand side by side
    others = np.stack((0.9 * values, values, 1.1 * values), axis=1)
    path, crash = loop.paths(space.unit(others))
    gap, speed = simulated(segment, loop.starts[0], space.make(space.values(space.unit(values))))
    assert crash[1] == 0.0
    # the engine steps ten times as finely and at fourth order; a jump of acceleration at the start costs accuracy
    tolerance = 1e-2 if car.lag or "al" in car.model.law.signals else 2e-3
    assert np.abs(path[0, :, 1] - gap).max() < tolerance
    assert np.abs(path[1, :, 1] - speed).max() < tolerance


def test_a_lane_has_the_same_bits_alone():
    space = Space.of(IDM)
    loop = Loop(space, cut(RECORDING, 1)[0])
    at = np.random.default_rng(3).random((6, 9))
    together = loop.errors(at)
    assert [float(loop.errors(np.ascontiguousarray(at[:, i : i + 1]))[0]) for i in range(9)] == together.tolist()


def test_objective_is_the_published_one():
    space = Space.of(IDM(T=1.5), ["T"])
    for objective in ("gap", "gap+speed"):
        loop = Loop(space, cut(RECORDING, 1)[0], objective)
        at = space.unit(np.array([[1.5]]))
        gap, speed = loop.paths(at)[0][:, :, 0]
        expected = np.sqrt(np.mean((gap - RECORDING.gap[1]) ** 2) / np.mean(RECORDING.gap[1] ** 2))
        if objective == "gap+speed":
            expected += np.sqrt(np.mean((speed - RECORDING.speed[1]) ** 2) / np.mean(RECORDING.speed[1] ** 2))
        assert loop.errors(at)[0] == pytest.approx(expected, rel=1e-12)


def test_a_collision_is_a_large_finite_number_and_earlier_is_worse():
    # behind a leader that brakes hard, a driver who reacts after seconds collides, one who never reacts earlier
    time = np.arange(0.0, 60.0, 0.1)
    ahead = np.clip(20.0 - 3.0 * np.maximum(time - 20.0, 0.0), 2.0, 20.0)
    record = hw.data.Recording.from_gaps(time, np.array([ahead, ahead]), np.array([np.nan * time, 20.0 + 0 * time]))
    space = Space.of(FVDM(alpha=0.01, v0=10.0, h=20.0, w=10.0), ["lam", "delay"])
    loop = Loop(space, cut(record, 1)[0])
    weak, late, good = loop.errors(space.unit(np.array([[0.01, 0.4, 2.0], [0.0, 0.1, 0.0]])))
    assert weak > late > PENALTY > good
    assert weak < 2.0 * PENALTY + 1e-9


def test_a_vehicle_that_stops_and_goes_agrees_with_simulate():
    time = np.arange(0.0, 80.0, 0.1)
    ahead = np.interp(time, [0, 10, 18, 40, 55, 80], [12, 12, 0, 0, 12, 12])
    record = hw.data.Recording.from_gaps(time, np.array([ahead, ahead]), np.array([np.nan * time, 18.0 + 0 * time]))
    car = hw.Vehicle(IDM(T=1.0, a=1.2), delay=0.2)
    space = Space.of(car, ["T"])
    (segment,) = cut(record, 1)[0]
    loop = Loop(space, [segment])
    path, _ = loop.paths(space.unit(np.array([[1.0]])))
    gap, speed = simulated(segment, loop.starts[0], car)
    assert speed.min() == 0.0
    assert np.abs(path[0, :, 0] - gap).max() < 0.05
    assert np.abs(path[1, :, 0] - speed).max() < 0.05


def test_a_slow_record_is_stepped_within():
    record = recording(step=0.5)
    (segment,) = cut(record, 1)[0]
    assert segment.every == 5
    space = Space.of(hw.Vehicle(IDM(T=1.2), delay=0.4), ["T"])
    loop = Loop(space, [segment])
    gap, _ = simulated(segment, loop.starts[0], hw.Vehicle(IDM(T=1.2), delay=0.4))
    assert np.abs(loop.paths(space.unit(np.array([[1.2]])))[0][0, :, 0] - gap).max() < 5e-3
