"""The IDM with all on-board signals late, by jitcdde. `python run_jitcdde.py setup.json result.npz`.

Until t = τ followers perceive nothing but equilibrium and keep their speed, so the integration
begins there with a past in which everybody drives at constant speed; the leader is never asked for
a time before 0, where it does not oscillate.
"""

import json
import sys
import time
from importlib.metadata import version

import numpy as np
import symengine as se
from jitcdde import jitcdde, t, y


def main(setup_file: str, result_file: str) -> None:
    """Integrate to a tight tolerance, and once more to an ordinary one for the time."""
    with open(setup_file) as f:
        setup = json.load(f)
    a, b, T, s0, v0 = (setup["idm"][k] for k in ("a", "b", "T", "s0", "v0"))
    mean, amplitude, omega = setup["leader"]
    followers, gap, length, tau = (setup[k] for k in ("followers", "gap", "length", "delay"))
    late = t - tau
    ahead_x = mean * late + amplitude / omega * (1 - se.cos(omega * late))
    ahead_v = mean + amplitude * se.sin(omega * late)
    right = []
    for n in range(followers):
        x, v = y(2 * n, late), y(2 * n + 1, late)
        s = ahead_x - x - length
        desired = s0 + v * T + v * (v - ahead_v) / (2 * (a * b) ** 0.5)
        right += [y(2 * n + 1), a * (1 - (v / v0) ** 4 - (desired / s) ** 2)]
        ahead_x, ahead_v = x, v
    start = [-(n + 1) * (gap + length) for n in range(followers)]
    begin = time.perf_counter()
    problem = jitcdde(right, max_delay=tau, verbose=False)
    problem.compile_C(simplify=False)
    compiling = time.perf_counter() - begin
    times = np.array(setup["times"])
    times = times[times > tau + 0.1]
    seconds = []
    for tolerance in (1e-11, setup["tolerance"]):
        problem.purge_past()
        for when in (-1.0, tau):
            state = [q for x in start for q in (x + mean * when, mean)]
            problem.add_past_point(when, state, [mean, 0.0] * followers)
        problem.set_integration_parameters(rtol=tolerance, atol=tolerance, first_step=1e-3, max_step=0.1)
        begin = time.perf_counter()
        states = [problem.integrate(when) for when in times]
        seconds.append(time.perf_counter() - begin)
        if len(seconds) == 1:
            positions = np.array(states)[:, 0::2]
    np.savez(
        result_file, times=times, positions=positions, seconds=seconds[1], compiling=compiling,
        version=version("jitcdde"),
    )  # fmt: skip


if __name__ == "__main__":
    main(*sys.argv[1:])
