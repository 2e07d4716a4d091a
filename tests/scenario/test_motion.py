"""Leaders: exact in position, speed and acceleration, whatever their kind."""

from __future__ import annotations

import dataclasses
import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad
from strategies import LEADERS

import headway as hw
from headway.data.cycles import CYCLES, load_cycle
from headway.scenario.document import to_table
from headway.scenario.leaders import KINDS
from headway.scenario.motion import at_lanes

END = 40.0


def test_every_kind_is_here():
    assert set(LEADERS) == set(KINDS)
    for name, kind in KINDS.items():
        assert kind.kind == name
        assert getattr(hw, name) is kind


@pytest.mark.parametrize("kind", LEADERS)
@given(data=st.data())
@settings(max_examples=25)
def test_speed_and_acceleration_are_derivatives_and_position_is_continuous(kind, data):
    leader = data.draw(LEADERS[kind])
    end = END if leader.span is None else leader.span
    motion = leader.motion(3, end)
    knots = np.unique(np.append(motion.start[motion.start < end], [end]))
    assert knots[0] == 0.0
    for left, right in pairwise(knots):
        if right - left < 1e-6:
            continue
        h = min(1e-3, 0.02 * (right - left))
        t = np.linspace(left + 3 * h, right - 3 * h, 7)
        x, v, a = motion.at(t)
        around = [motion.at(t + k * h) for k in (-2, -1, 1, 2)]
        for q, expected, noise in ((0, v, 1e-13 * (1 + abs(x))), (1, a, 1e-13 * (1 + abs(v)))):
            slope = (around[0][q] - 8 * around[1][q] + 8 * around[2][q] - around[3][q]) / (12 * h)
            allowed = 1e-8 + (30 * noise + 1e-15 * right * abs(expected)) / h
            assert np.all(abs(slope - expected) < allowed), f"derivative {q + 1} from {left} to {right}"
    assert np.allclose(motion.at(knots, "left")[0], motion.at(knots, "right")[0], rtol=0, atol=1e-9)
    assert motion.at(0.0)[0] == pytest.approx(0.0, abs=1e-14)
    past = motion.at(np.array([-5.0, -1.0]))
    assert np.allclose(past[0], motion.before * np.array([-5.0, -1.0]))
    assert np.array_equal(past[1], [motion.before] * 2)
    assert np.array_equal(past[2], [0.0, 0.0])


@pytest.mark.parametrize("kind", LEADERS)
@given(data=st.data())
@settings(max_examples=25)
def test_jumps_are_exactly_those_of_the_one_sided_derivatives(kind, data):
    leader = data.draw(LEADERS[kind])
    motion = leader.motion(3, END)
    times, orders = motion.jumps(END)
    order = dict(zip(times.tolist(), orders.tolist(), strict=True))
    assert all(1 <= o <= 4 for o in order.values())
    knots = motion.start[motion.start <= END]
    left, right = motion.at(knots, "left"), motion.at(knots, "right")
    for i, t in enumerate(knots.tolist()):
        speed, acceleration = abs(left[1][i] - right[1][i]), abs(left[2][i] - right[2][i])
        if speed > 1e-6:
            assert order[t] == 1
        elif speed < 1e-12 and acceleration > 1e-6:
            assert order[t] == 2
        elif speed < 1e-12 and acceleration < 1e-12:
            assert order.get(t, 5) > 2


def orders(leader, until=20.0):
    times, found = leader.motion(0, until).jumps(until)
    return {round(t, 9): int(o) for t, o in zip(times, found, strict=True)}


def test_orders_of_jumps():
    assert orders(hw.constant(20)) == {}
    assert orders(hw.sine(20, 1, 0.5)) == {0: 2}
    assert orders(hw.sine(20, 0, 0.5)) == {}
    assert orders(hw.step(20, -2, onset=3)) == {3: 1}
    assert orders(hw.step(20, -2, onset=3, edge=1)) == {3: 2, 4: 2}
    assert orders(hw.step(20, -2)) == {0: 1}
    assert orders(hw.brake(20, 5, hold=2, ramp=1, recovery=4, onset=1)) == {1: 2, 2: 2, 4: 2, 8: 2}
    assert orders(hw.window(20, 1, math.pi, duration=4, onset=2)) == {2: 2, 6: 2}  # two whole periods
    assert orders(hw.window(20, 1, math.pi, duration=3.5, onset=2)) == {2: 2, 5.5: 1}  # cut off at the crest
    assert orders(hw.square(20, 1, math.pi / 5)) == {0: 1, 5: 1, 10: 1, 15: 1, 20: 1}
    assert orders(hw.sawtooth(20, 1, math.pi / 5)) == {0: 2, 5: 1, 15: 1}
    assert orders(hw.triangle(20, 1, math.pi / 5)) == {0: 2, 2.5: 2, 7.5: 2, 12.5: 2, 17.5: 2}
    assert orders(hw.multisine(20, [1, 1], [1, 2])) == {0: 2}
    assert orders(hw.multisine(20, [1, 1], [1, 2], [0.5, 0])) == {0: 1}
    assert orders(hw.multisine(20, [2, 1], [1, 2], [0, math.pi])) == {0: 4}  # 2 - 2 = 0, no bend, 2 - 8 ≠ 0
    assert orders(hw.chirp(20, 1, 0.5, 2, sweep=10)) == {0: 2, 10: 3}
    smooth = orders(hw.recorded(time=[0, 1, 2, 3], speed=[10, 12, 11, 15]))
    assert smooth[1.0] == smooth[2.0] == 3
    assert orders(hw.recorded(time=[0, 1, 2], speed=[10, 12, 11], interpolation="linear")) == {0: 2, 1: 2, 2: 2}


def speeds(leader, times, side="right"):
    return leader.motion(0, 60.0).at(np.array(times, dtype=float), side)[1].tolist()


def test_a_step_has_its_shape():
    assert speeds(hw.step(23, -3, onset=5), [0, 5, 6]) == [23, 20, 20]
    assert speeds(hw.step(23, -3, onset=5), [5], "left") == [23]
    assert speeds(hw.step(23, -3, onset=5, edge=2), [5, 6, 7, 50]) == pytest.approx([23, 21.5, 20, 20])
    x = hw.step(23, -3, onset=5, edge=2).motion(0, 60).at(9.0)[0]
    assert x == pytest.approx(23 * 5 + 21.5 * 2 + 20 * 2)


def test_a_brake_has_its_shape():
    leader = hw.brake(23, drop=10, hold=4, ramp=2, recovery=5, onset=3)
    assert speeds(leader, [0, 3, 4, 5, 9, 11.5, 14, 60]) == pytest.approx([23, 23, 18, 13, 13, 18, 23, 23])
    assert leader.motion(0, 60).at(np.array([4.0, 10.0]))[2] == pytest.approx([-5, 2])
    assert speeds(hw.brake(23, drop=10, hold=0, ramp=2), [1, 2, 3, 4]) == pytest.approx([18, 13, 18, 23])
    assert leader.motion(0, 60).at(14.0)[0] == pytest.approx(23 * 3 + 18 * 2 + 13 * 4 + 18 * 5)


def test_a_window_starts_its_sine_at_the_onset_and_ends_in_the_mean():
    leader = hw.window(23, 2, math.pi / 2, duration=3, onset=5)
    assert speeds(leader, [0, 5, 6, 7, 7.9999999, 8, 9]) == pytest.approx([23, 23, 25, 23, 21, 23, 23], abs=1e-6)
    assert speeds(leader, [8], "left") == pytest.approx([21])


@pytest.mark.parametrize("edge", [0.0, 0.5, 2.0, 5.0])
def test_a_square_has_edges_around_the_ideal_jump(edge):
    leader = hw.square(23, 2, math.pi / 5, edge=edge)
    middle = [2.5, 7.5, 12.5]
    assert speeds(leader, middle) == pytest.approx([25, 21, 25])
    if edge:
        assert speeds(leader, [0, 5, 10]) == pytest.approx([23, 23, 23])
        assert speeds(leader, [5 - edge / 2, 5 - edge / 4, 5 + edge / 2]) == pytest.approx([25, 24, 21])
    else:
        assert speeds(leader, [0, 5, 10]) == [25, 21, 25]
        assert speeds(leader, [0, 5, 10], "left") == [23, 25, 21]
    assert leader.motion(0, 60).at(20.0)[0] == pytest.approx(23 * 20)


@pytest.mark.parametrize("edge", [0.0, 0.5, 4.0])
def test_a_sawtooth_rises_evenly_and_falls_within_its_edge(edge):
    leader = hw.sawtooth(23, 2, math.pi / 5, edge=edge)  # period 10 s
    peak = 2 * (1 - edge / 10)
    assert speeds(leader, [0, 10, 20]) == pytest.approx([23, 23, 23])
    assert speeds(leader, [5 - edge / 2, 15 - edge / 2], "left") == pytest.approx([23 + peak] * 2)
    assert speeds(leader, [5 + edge / 2, 15 + edge / 2]) == pytest.approx([23 - peak] * 2)
    assert speeds(leader, [1, 9]) == pytest.approx([23.4, 22.6])
    assert leader.motion(0, 60).at(20.0)[0] == pytest.approx(23 * 20)


def test_a_triangle_reaches_its_corners():
    assert speeds(hw.triangle(23, 2, math.pi / 2), [0, 0.5, 1, 2, 3, 4]) == pytest.approx([23, 24, 25, 23, 21, 23])


def test_before_the_start_everyone_drives_at_the_initial_speed():
    assert hw.multisine(23, [1], [1], [1.5]).motion(0, 9).at(-1e-6)[1] == 23
    assert hw.cycle("us06", start=100).motion(0, 9).before == load_cycle("us06").speed[100]


@given(chirp=LEADERS["chirp"], t=st.floats(0.1, 80))
@settings(max_examples=60)
def test_a_chirp_agrees_with_quadrature(chirp, t):
    def speed(u):
        beta = (chirp.omega_end - chirp.omega_start) / chirp.sweep
        if u <= chirp.sweep:
            return math.sin((chirp.omega_start + beta * u / 2) * u)
        return math.sin((chirp.omega_start + chirp.omega_end) * chirp.sweep / 2 + chirp.omega_end * (u - chirp.sweep))

    x, v, _ = chirp.motion(0, 80).at(t)
    pieces = [0.0, *np.arange(1.0, t), t]
    if chirp.sweep < t:
        pieces = sorted({*pieces, chirp.sweep})
    parts = [quad(speed, a, b, epsabs=1e-12)[0] for a, b in pairwise(pieces)]
    assert x == pytest.approx(chirp.mean * t + chirp.amplitude * math.fsum(parts), abs=2e-10)
    assert v == pytest.approx(chirp.mean + chirp.amplitude * speed(t), abs=1e-9)


@pytest.mark.parametrize("end", [0.5 + d for d in (1e-2, 1e-4, 1e-6, 1e-9, 1e-12, 0.0, -1e-12, -1e-5, -1e-2)])
def test_a_chirp_that_hardly_sweeps_is_exact_too(end):
    x = hw.chirp(23, 2, 0.5, end, sweep=100).motion(0, 100).at(70.0)[0]
    beta = (end - 0.5) / 100
    exact = sum(quad(lambda u: math.sin((0.5 + beta * u / 2) * u), k, k + 1, epsabs=1e-14)[0] for k in range(70))
    assert x == pytest.approx(23 * 70 + 2 * exact, abs=2e-12 * 1610)


def test_noise_is_seeded_and_the_same_for_longer():
    noise, t = hw.noise(23, 1.5), np.linspace(0, 100, 1001)
    one = noise.motion(1, 100).at(t)
    for q in range(3):
        assert np.array_equal(one[q], noise.motion(1, 500).at(t)[q])
    assert not np.allclose(one[1], noise.motion(2, 100).at(t)[1])
    assert one[1][0] == 23


def test_noise_has_the_statistics_of_the_exact_process():
    noise = hw.noise(23, sd=1.5, correlation_time=4, sample=0.5)
    t = np.array([0.5, 60.0, 60.5, 64.0])
    w = (np.array([noise.motion(seed, 64).at(t)[1] for seed in range(2500)]) - 23) / 1.5
    # standard errors: mean 0.02, variance 0.03, correlation 0.02 at most
    assert np.allclose(w[:, 1:].mean(axis=0), 0, atol=0.07)
    assert np.allclose(w[:, 1:].var(axis=0), 1, atol=0.1)
    assert w[:, 0].var() == pytest.approx(1 - math.exp(-2 * 0.5 / 4), rel=0.1)
    correlation = np.corrcoef(w[:, 1:].T)
    assert correlation[0, 1] == pytest.approx(math.exp(-0.5 / 4), abs=0.02)
    assert correlation[0, 2] == pytest.approx(math.exp(-4 / 4), abs=0.06)


def test_noise_does_not_depend_on_the_step():
    base = hw.Scenario(hw.noise(23, 1.0), [hw.Vehicle(hw.models.IDM)], duration=10, output_step=0.5, seed=7)
    runs = [hw.simulate(dataclasses.replace(base, dt=dt)) for dt in (0.01, 0.05)]
    assert np.array_equal(runs[0].time, runs[1].time)
    assert np.allclose(runs[0].speed[0], runs[1].speed[0], rtol=0, atol=1e-12)
    assert np.ptp(runs[0].speed[0].values) > 0.5


@pytest.mark.parametrize("name", CYCLES)
def test_a_cycle_covers_the_distance_of_its_table(name):
    table = load_cycle(name)
    leader = hw.cycle(name)
    assert leader.span == table.time[-1]
    motion = leader.motion(0, leader.span)
    x, v, _ = motion.at(table.time)
    assert x[-1] == pytest.approx(np.trapezoid(table.speed, table.time), rel=1e-12)
    assert np.allclose(v, table.speed, atol=1e-12)
    smooth = hw.cycle(name, interpolation="smooth").motion(0, leader.span).at(table.time)
    assert np.allclose(smooth[1], table.speed, atol=1e-12)
    assert smooth[0][-1] == pytest.approx(x[-1], rel=1e-3)


def test_a_section_of_a_cycle_is_the_cycle_moved():
    whole, part = hw.cycle("wltc3b").motion(0, 1800), hw.cycle("wltc3b", start=100.25, end=250.5).motion(0, 150.25)
    t = np.linspace(0, 150.25, 700)
    assert np.allclose(part.at(t)[1], whole.at(t + 100.25)[1], atol=1e-12)
    assert np.allclose(part.at(t)[0], whole.at(t + 100.25)[0] - whole.at(100.25)[0], atol=1e-9)


@pytest.mark.parametrize("interpolation", ["smooth", "linear"])
def test_a_recording_is_the_same_inline_and_from_a_file(interpolation, tmp_path):
    time, speed = np.arange(0, 20, 0.5), 20 + np.sin(np.arange(40))
    file = tmp_path / "trip.csv"
    rows = "".join(f"{t},0,{v!r},\n" for t, v in zip(time.tolist(), speed.tolist(), strict=True))
    file.write_text("time_s,vehicle,speed_mps,gap_m\n" + rows)
    options = {"interpolation": interpolation, "start": 2.0, "end": 15.0}
    inline, filed = hw.recorded(time=time, speed=speed, **options), hw.recorded(file=str(file), **options)
    assert inline.span == filed.span == 13.0
    assert inline.digest == filed.digest
    t = np.linspace(0, 13, 300)
    for one, other in zip(inline.motion(0, 13).at(t), filed.motion(0, 13).at(t), strict=True):
        assert np.array_equal(one, other)
    assert np.allclose(filed.motion(0, 13).at(time[4:31] - 2)[1], speed[4:31], atol=1e-12)
    file.write_text(file.read_text().replace("5.0,0,19.", "5.0,0,18."))
    assert "5.0,0,18." in file.read_text()
    assert hw.recorded(file=str(file), **options).digest != inline.digest


@pytest.mark.parametrize("kind", LEADERS)
@given(data=st.data())
@settings(max_examples=15)
def test_lanes_are_what_each_is_alone(kind, data):
    leaders = data.draw(st.lists(LEADERS[kind], min_size=1, max_size=3))
    leader = leaders[0]
    if hasattr(leader, "mean"):  # the same starts of pieces, so that the lanes are looked up together
        leaders += [dataclasses.replace(leader, mean=leader.mean + k) for k in (1.0, 2.0)]
    t = np.concatenate((np.linspace(-1, END, 97), leader.motion(0, END).start[:50]))
    for group in (leaders, [leader, *leaders[-2:]]):
        motions = [x.motion(5, END) for x in group]
        for side in ("left", "right"):
            together = at_lanes(motions, t, side)
            for lane, motion in enumerate(motions):
                for one, all_ in zip(motion.at(t, side), together, strict=True):
                    assert np.array_equal(one, all_[:, lane])


def test_a_chirp_beside_a_sine_in_one_batch():
    motions = [hw.sine(23, 2, 0.5).motion(0, 9), hw.multisine(20, [1, 2], [0.3, 0.5]).motion(0, 9)]
    t = np.linspace(0, 9, 50)
    together = at_lanes(motions, t)
    for lane, motion in enumerate(motions):
        assert all(np.array_equal(a, b[:, lane]) for a, b in zip(motion.at(t), together, strict=True))


@pytest.mark.parametrize("kind", LEADERS)
@given(data=st.data())
@settings(max_examples=15)
def test_a_table_holds_every_leader(kind, data):
    leader = data.draw(LEADERS[kind])
    duration = None if leader.span else 10.0
    scenario = hw.Scenario(leader, [hw.Vehicle(hw.models.GMM)], duration=duration, gaps=20)
    assert to_table(scenario)["leader"]["kind"] == kind
    assert hw.from_toml(scenario.to_toml()).leader == leader
