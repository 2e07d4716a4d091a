"""Scenarios: in and out of files without loss, told apart by their hash, and what a follower knows."""

from __future__ import annotations

import dataclasses
import json
import subprocess
import sys
from typing import Annotated

import jsonschema
import numpy as np
import pytest
import tomli_w
from hypothesis import given, settings
from hypothesis import strategies as st
from late import late
from strategies import LEADERS, models

import headway as hw
from headway.library import library, library_scenario, library_table
from headway.models import CACC, FVDM, GMM, IDM, OVM, IDMSpacing
from headway.scenario.document import from_table, override, schema, to_table

SINE = hw.sine(23, 2, 0.63)


@st.composite
def vehicles(draw):
    model = draw(models((IDM, IDMSpacing, CACC, GMM, OVM, FVDM)))
    delays = st.floats(0, 2)
    delay = draw(st.one_of(delays, st.dictionaries(st.sampled_from(model.law.signals), delays)))
    return hw.Vehicle(
        model, delay=delay, lag=draw(st.sampled_from([0.0, 0.3, 1.0])), length=draw(st.floats(0, 20)),
        limits=draw(st.none() | st.tuples(st.floats(-9, -0.1), st.floats(0.1, 5))),
    )  # fmt: skip


@st.composite
def scenarios(draw):
    followers = [v for v in draw(st.lists(vehicles(), min_size=1, max_size=3)) for _ in range(draw(st.integers(1, 3)))]
    count = len(followers)
    leader = draw(st.one_of(*LEADERS.values()))
    duration = draw(st.floats(1, 30)) if leader.span is None else None
    gap, who = st.floats(5, 50), st.integers(1, count)
    return hw.Scenario(
        leader, followers, duration, dt=draw(st.none() | st.floats(0.001, 0.1)),
        output_step=draw(st.none() | st.floats(0.01, 0.1)), scheme=draw(st.sampled_from(["rk4", "ballistic"])),
        seed=draw(st.integers(0, 2**63 - 1)), initial_speed=draw(st.none() | st.floats(3, 30)),
        gaps=draw(gap | st.lists(gap, min_size=count, max_size=count)),
        gap_offsets=draw(st.dictionaries(who, st.floats(-4, 4))), leader_length=draw(st.floats(0, 20)),
        speed_offsets=draw(st.dictionaries(who, st.floats(0, 3))), name=draw(st.text(max_size=8)),
        description=draw(st.text(st.characters(exclude_categories=["Cs"]), max_size=20)),
    )  # fmt: skip


SCHEMA = jsonschema.Draft202012Validator(schema())


@given(scenarios())
@settings(max_examples=50)
def test_toml_loses_nothing_and_the_schema_accepts_it(scenario):
    text = scenario.to_toml()
    again = hw.from_toml(text)
    assert again == scenario
    assert hash(again) == hash(scenario)
    assert again.hash == scenario.hash
    assert again.to_toml() == text
    SCHEMA.validate(json.loads(json.dumps(to_table(scenario))))


def test_equal_neighbours_become_one_table_with_a_count():
    a, b = hw.Vehicle(IDM), hw.Vehicle(IDM(T=1.2))
    followers = to_table(hw.Scenario(SINE, [a, a, a, b, a], duration=5))["followers"]
    assert [f.get("count", 1) for f in followers] == [3, 1, 1]
    many = hw.Scenario(SINE, [a] * 1000, duration=5)
    assert many.to_toml().count("idm") == 1
    assert len(hw.from_toml(many.to_toml()).followers) == 1000


BASE = {
    "duration": 50,
    "leader": {"kind": "sine", "mean": 23, "amplitude": 2, "omega": 0.63},
    "followers": [{"model": "idm", "count": 2, "delay": 0.15, "parameters": {"T": 1.5}}],
}


def changed(*assignments):
    table = json.loads(json.dumps(BASE))
    for assignment in assignments:
        override(table, assignment)
    return from_table(table)


@pytest.mark.parametrize(
    "assignment",
    [
        "followers.0.parameters.T=1.4", "followers.0.parameters.delta=3", "followers.0.delay=0.2",
        "followers.0.delay={s=0.15}", "followers.0.lag=0.1", "followers.0.length=4", "followers.0.limits=[-5,2]",
        "followers.0.count=3", "followers.0.model=fvdm", "leader.omega=0.6", "leader.kind=triangle", "duration=51",
        "dt=0.02", "output_step=0.5", "scheme=ballistic", "seed=1", "initial_speed=22", "gaps=40", "gap_offsets.1=-1",
        "speed_offsets.2=1", "leader_length=4",
    ],
)  # fmt: skip
def test_the_hash_changes_with(assignment):
    extra = ["followers.0.parameters={}"] if "fvdm" in assignment else []
    assert changed(assignment, *extra).hash != changed(*extra).hash


def test_the_hash_does_not_change_with_names_or_notation():
    assert changed("name=fig 3", "description=what it shows").hash == changed().hash
    assert changed("duration=50.0", "followers.0.parameters.a=1", "followers.0.length=5").hash == changed().hash
    python = hw.Scenario(SINE, [hw.Vehicle(IDM, delay=0.15)] * 2, duration=50)
    assert python.hash == changed().hash
    assert hw.Scenario(SINE, python.followers, duration=np.float64(50)).hash == changed().hash


def test_the_hash_changes_with_the_samples_of_a_recording_and_not_with_its_place(tmp_path):
    def recorded(name, speed):
        (tmp_path / name).write_text(f"time_s,vehicle,speed_mps,gap_m\n0,0,20,\n1,0,{speed},\n2,0,21,\n")
        return hw.Scenario(hw.recorded(file=str(tmp_path / name)), [hw.Vehicle(IDM)])

    assert recorded("a.csv", 20.5).hash == recorded("b.csv", 20.5).hash
    before = recorded("c.csv", 20.5)
    assert before.hash != recorded("c.csv", 20.6).hash


def test_the_hash_changes_with_the_code_of_an_own_law_and_its_closed_forms():
    def make(gain, form=None):
        def soft(s, v, dv, *, k: Annotated[float, hw.Param("1/s²", 0.1, 1)] = 0.2):
            return k * (s - 2.0 - gain * v) + 0.6 * dv

        law = hw.model(soft)
        if form:
            law.closed_form("equilibrium_gap")(form)
        return hw.Scenario(SINE, [hw.Vehicle(law)], duration=5).hash

    assert make(1.2) == make(1.2)
    assert make(1.2) != make(1.3)
    one, other = (lambda v, **_: 2.0 + 1.2 * v), (lambda v, **_: 3.0 + 1.2 * v)
    assert len({make(1.2), make(1.2, one), make(1.2, other)}) == 3


OWN = '''
from typing import Annotated
import headway as hw

@hw.model
def soft(s, v, dv, *, k: Annotated[float, hw.Param("1/s²", 0.01, 1.0)] = 0.2):
    """Soft."""
    return k * (s - 2.0 - 1.2 * v) * (1.0 if s in {1.0, 5.0, 9.0} else 2.0) + 0.6 * dv
'''

PRINT_HASH = """
import sys, headway as hw
print(hw.load(sys.argv[1], hw.load_laws(sys.argv[2])).hash)
"""


def test_the_hash_is_the_same_in_another_process(tmp_path):
    scenario, law = tmp_path / "scenario.toml", tmp_path / "laws.py"
    law.write_text(OWN)
    scenario.write_text(tomli_w.dumps({**BASE, "followers": [{"model": "soft", "count": 2}, {"model": "cacc"}]}))
    hashes = {hw.load(scenario, hw.load_laws(str(law))).hash}
    moved = tmp_path / "moved.py"
    moved.write_text("# the same law elsewhere\n\n" + OWN)
    for file in (law, moved):
        command = [sys.executable, "-c", PRINT_HASH, scenario, file]
        done = subprocess.run(command, capture_output=True, text=True, check=True)
        hashes.add(done.stdout.strip())
    assert len(hashes) == 1


@pytest.mark.parametrize("name", library())
def test_ready_scenarios_are_valid_and_survive(name):
    SCHEMA.validate(json.loads(json.dumps(library_table(name))))
    scenario = library_scenario(name)
    assert hw.from_toml(scenario.to_toml()) == scenario


@pytest.mark.parametrize("path", ["dutarion=5", "leader.amplitud=1", "followers.0.parameter={}", "leader.kind=sin"])
def test_the_schema_refuses(path):
    table = json.loads(json.dumps(BASE))
    SCHEMA.validate(table)
    override(table, path)
    assert not SCHEMA.is_valid(table)


def test_the_schema_accepts_a_recording_with_columns_and_units():
    leader = {"kind": "recorded", "file": "a.csv", "columns": {"speed": "v"}, "units": {"speed": "km/h"}}
    SCHEMA.validate({**BASE, "leader": leader})
    assert not SCHEMA.is_valid({**BASE, "leader": {**leader, "units": [["speed", "km/h"]]}})


def test_the_schema_tells_the_bounds():
    for path in ("duration=0", "dt=-1", "leader.omega=0", "leader.mean=-1", "gaps=0", "gaps=[1,-1]", "seed=0.5"):
        table = json.loads(json.dumps(BASE))
        override(table, path)
        assert not SCHEMA.is_valid(table), path
        with pytest.raises(hw.HeadwayError):
            from_table(table)


BAD_FOLLOWERS = [
    {"delay": -1}, {"delay": {"s": -1}}, {"delay": "long"}, {"count": 0}, {"limits": [1]}, {"limits": [1, 2]},
    {"lag": -1}, {},
]  # fmt: skip


@pytest.mark.parametrize("bad", BAD_FOLLOWERS)
def test_the_schema_refuses_a_follower_with(bad):
    assert not SCHEMA.is_valid({**BASE, "followers": [{"model": "idm", **bad} if bad else bad]})


def test_columns_and_units_of_a_recording_survive_the_file(tmp_path):
    (tmp_path / "a.csv").write_text("when,v\n0,72\n1,73\n2,74\n")
    leader = hw.recorded(
        file=str(tmp_path / "a.csv"), columns={"time": "when", "speed": "v"}, units={"time": "s", "speed": "km/h"}
    )
    assert leader.motion(0, 2).before == pytest.approx(20)
    scenario = hw.Scenario(leader, [hw.Vehicle(IDM)])
    assert hw.from_toml(scenario.to_toml()) == scenario
    text = scenario.to_toml().replace(str(tmp_path / "a.csv"), "a.csv")
    (tmp_path / "scenario.toml").write_text(text)
    assert hw.load(tmp_path / "scenario.toml").hash == scenario.hash  # a relative path starts at the file's folder


def test_overrides_reach_every_field():
    scenario = changed("followers.0.parameters.T=1.1", "leader.omega=0.3", "gaps=[30, 40]", "name=my run", "dt=0.02")
    assert scenario.followers[1].model.T == 1.1
    assert scenario.leader.omega == 0.3
    assert scenario.gaps == (30.0, 40.0)
    assert scenario.name == "my run"
    assert scenario.dt == 0.02
    assert changed("followers.0.delay={s=0.3, dv=0.2}").followers[0].delay == (("dv", 0.2), ("s", 0.3))
    assert changed("gaps=[30, 40]", "gaps.1=50").gaps == (30.0, 50.0)
    assert changed("leader={kind='step', mean=20, change=-2}").leader == hw.step(20, -2)
    assert BASE["followers"][0]["parameters"] == {"T": 1.5}


def test_a_scenario_alone_never_runs_code(tmp_path):
    sign = tmp_path / "it_ran"
    (tmp_path / "my.py").write_text(f"open({str(sign)!r}, 'w').close()\n" + OWN)
    for model in ("soft", "my.py:soft", "my", f"{tmp_path}/my.py:soft", "__import__('os')"):
        file = tmp_path / "scenario.toml"
        file.write_text(tomli_w.dumps({**BASE, "followers": [{"model": model}]}))
        with pytest.raises(hw.HeadwayError, match=r"allowed only by naming it: --model my\.py:"):
            hw.load(file)
    assert not sign.exists()
    (law,) = hw.load_laws(f"{tmp_path}/my.py:soft")
    assert sign.exists()
    file.write_text(tomli_w.dumps({**BASE, "followers": [{"model": "soft"}]}))
    assert hw.load(file, [law]).followers[0].model == law()


def test_an_own_law_may_not_take_a_built_in_name():
    @hw.model(name="idm")
    def mine(s, v):
        return s - v

    with pytest.raises(hw.HeadwayError, match="'idm': this name belongs to a built-in law"):
        hw.from_toml(tomli_w.dumps(BASE), [mine])


@pytest.mark.parametrize(
    ("model", "delay", "delays"),
    [
        (IDM, 0.0, {}),
        # a number delays all on-board signals of the law and none by radio
        (IDM, 0.3, {"s": 0.3, "v": 0.3, "dv ahead": 0.3, "dv own": 0.3}),
        (OVM, 0.3, {"s": 0.3, "v": 0.3}),
        (CACC, 0.3, {"s": 0.3, "v": 0.3, "a": 0.3, "dv ahead": 0.3, "dv own": 0.3}),
        # a mapping gives each signal its own; dv is measured as a whole
        (IDM, {"s": 0.3}, {"s": 0.3}),
        (IDM, {"s": 0.3, "dv": 0.2}, {"s": 0.3, "dv ahead": 0.2, "dv own": 0.2}),
        # vl on a law that asks for dv: the leader's speed is late, own speed is as the law's v has it
        (IDM, {"s": 0.3, "vl": 0.4}, {"s": 0.3, "dv ahead": 0.4}),
        (IDM, {"v": 0.1, "vl": 0.4}, {"v": 0.1, "dv ahead": 0.4, "dv own": 0.1}),
        # CACC asks for vl itself: that is the radio's
        (CACC, {"vl": 0.2, "al": 0.3}, {"vl": 0.2, "al": 0.3}),
        (CACC, {"vl": 0.2, "dv": 0.1}, {"vl": 0.2, "dv ahead": 0.1, "dv own": 0.1}),
    ],
)  # fmt: skip
def test_what_a_delay_makes_late(model, delay, delays):
    vehicle = hw.Vehicle(model, delay=delay)
    assert late(vehicle) == delays
    assert vehicle.perception.longest == max(delays.values(), default=0.0)


@pytest.mark.parametrize(
    ("model", "delay", "words"),
    [
        (OVM, {"dv": 0.1}, "ovm does not perceive 'dv'; its signals are s, v$"),
        (OVM, {"vl": 0.1}, "ovm does not perceive 'vl'"),
        (IDM, {"al": 0.1}, "idm does not perceive 'al'.*and vl for the leader's speed alone"),
        (IDM, {"dv": 0.1, "vl": 0.1}, "either dv .* or vl"),
    ],
)
def test_what_a_delay_refuses(model, delay, words):
    with pytest.raises(hw.HeadwayError, match=words):
        hw.Vehicle(model, delay=delay)


def test_the_three_delays_of_the_theory_are_different_systems():
    runs = []
    for delay in (0.5, {"s": 0.5, "vl": 0.5}, {"s": 0.5, "dv": 0.5}):
        result = hw.simulate(hw.Scenario(SINE, [hw.Vehicle(IDM, delay=delay)], duration=10, dt=0.05))
        runs.append(result.gap.values[1])
    for i, j in ((0, 1), (0, 2), (1, 2)):
        assert np.max(np.abs(runs[i] - runs[j])) > 1e-3


def test_scenarios_are_values_that_cannot_be_changed():
    scenario = changed()
    assert dataclasses.replace(scenario, seed=0) == scenario
    assert dataclasses.replace(scenario, seed=1) != scenario
    for thing, field in ((scenario, "seed"), (scenario.leader, "omega"), (scenario.followers[0], "delay")):
        with pytest.raises(dataclasses.FrozenInstanceError):
            setattr(thing, field, 1)
