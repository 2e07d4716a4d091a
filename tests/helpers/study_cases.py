"""A mixed platoon with noise and delays, for the tests of studies; also run by processes that are killed."""

from __future__ import annotations

import sys

from headway.models import CACC, IDM
from headway.scenario.leaders import Noise
from headway.scenario.scenario import Scenario
from headway.scenario.vehicle import Vehicle
from headway.study.study import Study


def mixed(seeds: int = 3) -> Study:
    """Three kinds of vehicle, noise, delays of signals, a lag; one value of T is not allowed."""
    car = Vehicle(IDM(a=1.5), delay=0.3)
    radio = Vehicle(CACC(), delay={"vl": 0.1, "al": 0.15}, lag=0.2)
    truck = Vehicle(IDM(a=0.8, T=2.0), delay={"s": 0.2, "vl": 0.4}, length=16.0)
    scenario = Scenario(Noise(20.0, 0.8), [car, car, radio, car], duration=8.0, dt=0.05)
    axes = {
        "T": [1.2, -3.0, 1.8],
        "followers.0.delay": [0.2, 0.5],
        "seed": list(range(seeds)),
        "share.truck": [0.0, 0.5],
    }
    return Study(scenario, axes, types={"truck": truck})


if __name__ == "__main__":
    mixed(12).run(store=sys.argv[1], chunk=3)
