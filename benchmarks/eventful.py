"""What a point of a study costs where platoons stop and collide, beside a quiet one of the same size.

Both studies vary two parameters of five IDM cars over 60 s; one leader brakes so hard that about half of the
platoons stop or collide, the other swings gently. The two are run by turns.
"""

from __future__ import annotations

import statistics
import time

import headway as hw

METRICS = ["least_gap", "least_speed", "rms_spacing_error", "collision_time"]


def study(leader: object, points: int) -> hw.Study:
    """Points over the time gap and the comfortable braking of five cars that are 0.6 s late."""
    side = round(points**0.5)
    car = hw.Vehicle(hw.models.IDM(), delay=0.6)
    scenario = hw.Scenario(leader, [car] * 5, duration=60.0, dt=0.02, output_step=0.2)
    return hw.Study(
        scenario,
        {
            "followers.0.parameters.T": hw.between(0.5, 2.5, side),
            "followers.0.parameters.b": hw.between(0.8, 4.0, side),
        },
    )


def main(points: int = 40_000, pairs: int = 3) -> int:
    """Print microseconds a point of both studies and their ratio, as medians of pairs."""
    leaders = {"quiet": hw.sine(20.0, 1.0, 0.6), "eventful": hw.brake(20.0, 17.0, hold=10.0, ramp=4.0, onset=2.0)}
    studies = {name: study(leader, points) for name, leader in leaders.items()}
    for small in (study(leader, 64) for leader in leaders.values()):
        small.run(metrics=METRICS, executor="serial")  # compiles
    seconds: dict[str, list[float]] = {name: [] for name in studies}
    share = 0.0
    for _ in range(pairs):
        for name, each in studies.items():
            begin = time.perf_counter()
            results = each.run(metrics=METRICS, executor="threads")
            seconds[name].append((time.perf_counter() - begin) / results.status.size)
            if name == "eventful":
                stops = (results.least_speed.isel(vehicle=slice(1, None)) <= 0.0).any("vehicle")
                share = float((stops | (results.status == "collision")).mean())
    for name, values in seconds.items():
        middle, low, high = (1e6 * f(values) for f in (statistics.median, min, max))
        print(f"{name:9s} {middle:8.1f} µs a point ({low:.1f} … {high:.1f})")
    ratios = [b / a for a, b in zip(*seconds.values(), strict=True)]
    middle, low, high = (f(ratios) for f in (statistics.median, min, max))
    print(f"ratio     {middle:8.2f} ({low:.2f} … {high:.2f}); {share:.0%} stop or collide")
    return 0
