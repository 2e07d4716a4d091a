"""SUMO's IDM with the ballistic rule behind a prescribed leader. `python run_sumo.py setup.json result.npz`.

The leader's speed is set before each step to its value at the step's end; nothing is checked for
safety. All vehicles are updated from the state at the start of the step.
"""

import json
import math
import os
import subprocess
import sys
import tempfile
import time

import libsumo
import numpy as np
import sumo


def main(setup_file: str, result_file: str) -> None:
    """Run once with a record of every step and three times without, for the time."""
    with open(setup_file) as f:
        setup = json.load(f)
    dt, steps, followers, gap, length = (setup[k] for k in ("dt", "steps", "followers", "gap", "length"))
    mean, amplitude, omega = setup["leader"]
    home = os.path.dirname(sumo.__file__)
    os.environ.setdefault("SUMO_HOME", home)
    with tempfile.TemporaryDirectory() as folder:
        road = 1000.0 + (followers + 1) * (gap + length) + steps * dt * (mean + 10.0)
        write(folder, "nodes", f'<nodes><node id="A" x="0" y="0"/><node id="B" x="{road}" y="0"/></nodes>')
        write(folder, "edges", '<edges><edge id="e" from="A" to="B" numLanes="1" speed="100"/></edges>')
        names = {n: os.path.join(folder, f"{n}.xml") for n in ("nodes", "edges", "net", "routes")}
        convert = [os.path.join(home, "bin", "netconvert"), "-n", names["nodes"], "-e", names["edges"]]
        subprocess.run([*convert, "-o", names["net"]], check=True, capture_output=True)
        idm = " ".join(f'{k}="{v!r}"' for k, v in setup["idm"].items())
        idm += f' length="{length!r}" speedFactor="1" speedDev="0" sigma="0" emergencyDecel="9"'
        top = {"follower": setup["v0"], "leader": 100.0}
        types = [f'<vType id="{n}" carFollowModel="IDM" {idm} maxSpeed="{v!r}"/>' for n, v in top.items()]
        start = 100.0 + followers * (gap + length)
        vehicles = [
            f'<vehicle id="{i}" type="{"follower" if i else "leader"}" route="r" depart="0" departLane="0" '
            f'departPos="{start - i * (gap + length)!r}" departSpeed="{mean!r}" insertionChecks="none"/>'
            for i in range(followers + 1)
        ]
        write(folder, "routes", f'<routes>{"".join(types)}<route id="r" edges="e"/>{"".join(vehicles)}</routes>')
        command = [
            os.path.join(home, "bin", "sumo"), "-n", names["net"], "-r", names["routes"], "--step-length", repr(dt),
            "--step-method.ballistic", "--no-step-log", "--no-warnings", "--collision.action", "none",
            "--time-to-teleport", "-1", "--precision", "12",
        ]  # fmt: skip
        ids = [str(i) for i in range(followers + 1)]
        speeds = [mean + amplitude * math.sin(omega * dt * k) for k in range(steps + 1)]
        record = np.empty((steps + 1, 2, followers + 1))
        times = []
        vehicle = libsumo.vehicle
        for attempt in range(4):
            libsumo.start(command) if attempt == 0 else libsumo.load(command[1:])
            libsumo.simulationStep()  # inserts everybody; the state belongs to t = 0
            vehicle.setSpeedMode("0", 0)
            vehicle.setLaneChangeMode("0", 0)
            begin = time.perf_counter()
            for k in range(steps + 1):
                if attempt == 0:
                    record[k] = [[vehicle.getLanePosition(i) for i in ids], [vehicle.getSpeed(i) for i in ids]]
                if k < steps:
                    vehicle.setSpeed("0", speeds[k + 1])
                    libsumo.simulationStep()
            times.append(time.perf_counter() - begin)
        version = libsumo.getVersion()[1]
        libsumo.close()
    np.savez(result_file, record=record, version=version, seconds=sorted(times[1:])[1])


def write(folder: str, name: str, text: str) -> None:
    """An input file."""
    with open(os.path.join(folder, f"{name}.xml"), "w") as f:
        f.write(text)


if __name__ == "__main__":
    main(*sys.argv[1:])
