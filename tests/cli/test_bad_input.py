"""What a person types wrongly: one sentence, exit code 2, no traceback, nothing half-written."""

from __future__ import annotations

import copy
from pathlib import Path

import pytest
import tomli_w

BASE = {
    "duration": 5.0,
    "leader": {"kind": "sine", "mean": 23.0, "amplitude": 2.0, "omega": 0.63},
    "followers": [{"model": "idm", "count": 2, "delay": 0.15, "parameters": {"T": 1.5}}],
}

LAWS = '''
from typing import Annotated
import numpy as np
import headway as hw

@hw.model
def soft(s, v, dv, *, k: Annotated[float, hw.Param("1/s²", 0.01, 1.0)] = 0.2):
    """Linear follower."""
    return k * (s - 2.0 - 1.2 * v) + 0.6 * dv

@hw.model
def nan(s, v, dv, *, k: Annotated[float, hw.Param("1/s²", 0.01, 1.0)] = 0.2):
    """Not a number as soon as the gap opens."""
    return k * (s - 2.0 - 1.2 * v) + 0.6 * dv + 0.0 * np.sqrt(0.01 - dv)
'''

WRONG_SIGN = """
import headway as hw

@hw.model
def wrong(s, v, dv, *, k=0.2):
    return k * (s - 2.0 - 1.2 * v) - 0.6 * dv
"""


def put(path, value):
    """A change of the base scenario: set `path` (dotted) to `value`; ... as value deletes it."""

    def change(table):
        *parents, last = path.split(".")
        place = table
        for key in parents:
            place = place[int(key)] if isinstance(place, list) else place.setdefault(key, {})
        if value is ...:
            del place[last]
        else:
            place[int(last) if isinstance(place, list) else last] = value

    return change


def leader(**fields):
    return put("leader", fields)


SINE = {"mean": 23.0, "amplitude": 2.0, "omega": 0.63}

#: change of a good scenario → words that the sentence must have
SCENARIOS = {
    "unknown top key": (put("duraton", 3), ["'duraton'", "did you mean 'duration'"]),
    "unknown leader key": (put("leader.amplitud", 3), ["key in leader", "'amplitude'"]),
    "unknown follower key": (put("followers.0.dealy", 3), ["followers.0", "did you mean 'delay'"]),
    "unknown model": (put("followers.0.model", "idmm"), ["followers.0.model", "did you mean 'idm'", "--model"]),
    "law from a file that was not named": (put("followers.0.model", "soft"), ["'soft'", "--model my.py:soft"]),
    "unknown parameter": (put("followers.0.parameters.TT", 1.0), ["followers.0.parameters", "'TT'"]),
    "unknown leader": (put("leader.kind", "sin"), ["leader.kind", "did you mean 'sine'"]),
    "leader without kind": (put("leader.kind", ...), ["leader.kind is missing"]),
    "leader is no table": (put("leader", 3), ["leader = 3", "not a table"]),
    "no leader": (put("leader", ...), ["scenario.leader is missing"]),
    "no followers": (put("followers", ...), ["scenario.followers is missing"]),
    "empty followers": (put("followers", []), ["followers must be"]),
    "no model": (put("followers.0.model", ...), ["followers.0.model is missing"]),
    "parameters are no table": (put("followers.0.parameters", 3), ["followers.0.parameters", "not a table"]),
    "parameter out of bounds": (put("followers.0.parameters.T", -1.0), ["idm.T = -1 s", "0 to 10 s"]),
    "parameter not finite": (put("followers.0.parameters.T", float("nan")), ["idm.T", "not finite"]),
    "parameter infinite": (put("followers.0.parameters.T", float("inf")), ["idm.T", "not finite"]),
    "parameter is text": (put("followers.0.parameters.T", "1.5"), ["idm.T = '1.5'", "not a number"]),
    "parameter is a truth value": (put("followers.0.parameters.T", True), ["idm.T", "not a number"]),
    "count zero": (put("followers.0.count", 0), ["followers.0.count = 0"]),
    "count is no whole number": (put("followers.0.count", 2.5), ["followers.0.count = 2.5"]),
    "negative delay": (put("followers.0.delay", -0.1), ["delay = -0.1 s", "0 or more"]),
    "delay not finite": (put("followers.0.delay", float("inf")), ["delay"]),
    "delay is text": (put("followers.0.delay", "soon"), ["delay = 'soon'"]),
    "delay of an unknown signal": (put("followers.0.delay", {"sp": 0.1}), ["'sp'", "did you mean 's'"]),
    "delay of a signal not perceived": (put("followers.0.delay", {"al": 0.1}), ["idm does not perceive 'al'"]),
    "dv and vl late at once": (put("followers.0.delay", {"dv": 0.1, "vl": 0.1}), ["either dv", "or vl"]),
    "negative delay of a signal": (put("followers.0.delay", {"s": -0.1}), ["delay.s = -0.1 s"]),
    "lag that the step cannot follow": (put("followers.0.lag", 0.004), ["lag = 0.004 s", "dt = 0.008 or less"]),
    "negative lag": (put("followers.0.lag", -1.0), ["followers.0.lag = -1"]),
    "negative length": (put("followers.0.length", -5.0), ["followers.0.length = -5"]),
    "limits turned round": (put("followers.0.limits", [2.0, -3.0]), ["followers.0.limits"]),
    "one limit": (put("followers.0.limits", [-3.0]), ["followers.0.limits"]),
    "negative duration": (put("duration", -5.0), ["scenario.duration = -5"]),
    "zero duration": (put("duration", 0.0), ["scenario.duration = 0"]),
    "duration is text": (put("duration", "long"), ["scenario.duration = 'long'"]),
    "no duration": (put("duration", ...), ["scenario.duration is missing"]),
    "negative step": (put("dt", -0.01), ["scenario.dt"]),
    "step longer than the run": (put("dt", 50.0), ["scenario.dt = 50 s"]),
    "output step longer than the run": (put("output_step", 50.0), ["scenario.output_step = 50 s"]),
    "unknown scheme": (put("scheme", "euler"), ["scenario.scheme", "ballistic"]),
    "negative seed": (put("seed", -1), ["scenario.seed = -1"]),
    "seed is no whole number": (put("seed", 1.5), ["scenario.seed = 1.5"]),
    "negative gap": (put("gaps", -3.0), ["gaps"]),
    "zero gap": (put("gaps", 0.0), ["gaps"]),
    "too few gaps": (put("gaps", [3.0]), ["scenario.gaps has 1 values for 2 followers"]),
    "one negative gap": (put("gaps", [3.0, -3.0]), ["gaps"]),
    "offset of nobody": (put("gap_offsets", {"7": 1.0}), ["no follower 7", "1 to 2"]),
    "offset of the leader": (put("speed_offsets", {"0": 1.0}), ["no follower 0", "initial_speed"]),
    "offset eats the gap": (put("gap_offsets", {"1": -100.0}), ["follower 1", "must be positive"]),
    "offset makes a speed negative": (put("speed_offsets", {"2": -40.0}), ["follower 2", "drive forwards"]),
    "offset key is no number": (put("gap_offsets", {"one": 1.0}), ["vehicle numbers"]),
    "leader drives backwards": (put("leader.amplitude", -30.0), ["drive backwards", "reduce its amplitude"]),
    "negative mean": (put("leader.mean", -3.0), ["leader.mean = -3"]),
    "zero frequency": (put("leader.omega", 0.0), ["leader.omega = 0"]),
    "amplitude missing": (put("leader.amplitude", ...), ["leader.amplitude is missing", "mean, amplitude, omega"]),
    "amplitude is text": (put("leader.amplitude", "2"), ["leader.amplitude = '2'"]),
    "amplitude not finite": (put("leader.amplitude", float("nan")), ["leader.amplitude"]),
    "speed above the desired speed": (put("leader.mean", 35.0), ["no equilibrium at 35 m/s", "33.33"]),
    "OVM above its top speed": (
        lambda t: t.update(leader={"kind": "sine", "mean": 44.5, "amplitude": 0.1, "omega": 1.0}, followers=[{"model": "ovm"}]),
        ["ovm has no equilibrium at 44.5 m/s"],
    ),
    "GMM without a gap": (put("followers", [{"model": "gmm"}]), ["every gap is an equilibrium", "gaps"]),
    "edge longer than half a period": (leader(kind="square", edge=9.0, **SINE), ["square.edge = 9 s", "half a period"]),
    "multisine of unequal lists": (leader(kind="multisine", mean=23.0, amplitudes=[1.0], omegas=[0.3, 0.5]), ["omegas"]),
    "empty multisine": (leader(kind="multisine", mean=23.0, amplitudes=[], omegas=[]), ["multisine.amplitudes is empty"]),
    "unknown cycle": (leader(kind="cycle", name="wltp"), ["'wltp'", "wltc3b"]),
    "section outside the cycle": (leader(kind="cycle", name="wltc3b", start=1799.0, end=1900.0), ["1900"]),
    "longer than the cycle": (
        lambda t: t.update(duration=700.0, leader={"kind": "cycle", "name": "us06"}),
        ["longer than the leader", "600 s"],
    ),
    "unknown interpolation": (leader(kind="cycle", name="us06", interpolation="spline"), ["interpolation", "linear"]),
    "recording that is not there": (leader(kind="recorded", file="nowhere.csv"), ["nowhere.csv"]),
    "recording of nothing": (leader(kind="recorded"), ["either a file"]),
    "recorded times that fall": (leader(kind="recorded", time=[0.0, 2.0, 1.0], speed=[1.0] * 3), ["time[2] = 1 s"]),
    "recorded lists of unequal length": (leader(kind="recorded", time=[0.0, 2.0], speed=[1.0]), ["2 times and 1 speeds"]),
    "negative vehicle of a recording": (
        leader(kind="recorded", time=[0.0, 2.0], speed=[1.0, 1.0], vehicle=-1), ["recorded.vehicle = -1"],
    ),
    "brake without hold": (leader(kind="brake", mean=23.0, drop=5.0), ["leader.hold is missing"]),
    "noise with negative deviation": (leader(kind="noise", mean=23.0, sd=-1.0), ["leader.sd = -1"]),
    "chirp without sweep": (
        leader(kind="chirp", mean=23.0, amplitude=1.0, omega_start=0.1, omega_end=1.0), ["leader.sweep is missing"],
    ),
}  # fmt: skip


def is_one_sentence(error: str) -> bool:
    return error.startswith("headway: ") and error.count("\n") == 1 and "Traceback" not in error


@pytest.mark.parametrize("name", SCENARIOS)
def test_scenario(name, cli, tmp_path):
    change, words = SCENARIOS[name]
    table = copy.deepcopy(BASE)
    change(table)
    file = tmp_path / "scenario.toml"
    file.write_text(tomli_w.dumps(table))
    code, out, error = cli("run", file, "--out", tmp_path / "run.nc", "--csv", tmp_path / "run.csv")
    assert code == 2
    assert is_one_sentence(error), error
    assert out == ""
    for word in words:
        assert word in error
    assert [p.name for p in tmp_path.iterdir()] == ["scenario.toml"]


def test_the_base_is_good(cli, tmp_path):
    file = tmp_path / "scenario.toml"
    file.write_text(tomli_w.dumps(BASE))
    code, out, error = cli("run", file)
    assert (code, error) == (0, "")
    assert "idm" in out


#: arguments with {} for a folder that holds good.toml, my.py, wrong.py, broken.py, empty.py, empty.csv, text.csv
ARGUMENTS = {
    "no scenario": (["run"], ["run needs a scenario"]),
    "unknown command": (["runn"], ["runn", "run"]),
    "unknown option": (["run", "{}/good.toml", "--sett", "x=1"], ["--sett", "--set"]),
    "file that is not there": (["run", "{}/none.toml"], ["none.toml", "cannot be read"]),
    "a folder": (["run", "{}"], ["cannot be read"]),
    "not TOML": (["run", "{}/my.py"], ["not a TOML file"]),
    "not text": (["run", "{}/binary.toml"], ["binary.toml", "UTF-8"]),
    "unknown ready scenario": (["run", "paper:idm-22"], ["paper:idm-22", "did you mean"]),
    "set without value": (["run", "{}/good.toml", "--set", "duration"], ["write path=value"]),
    "set of an unknown field": (["run", "{}/good.toml", "--set", "duratoin=3"], ["duratoin", "did you mean 'duration'"]),
    "set of a follower that is not there": (["run", "{}/good.toml", "--set", "followers.9.lag=1"], ["followers.9"]),
    "set below a number": (["run", "{}/good.toml", "--set", "duration.x=1"], ["not a table"]),
    "set of a wrong value": (["run", "{}/good.toml", "--set", "followers.0.parameters.T=long"], ["idm.T = 'long'"]),
    "output with a wrong suffix": (["run", "{}/good.toml", "--out", "{}/run.txt"], ["run.txt", ".nc"]),
    "output in a folder that is not there": (["run", "{}/good.toml", "--out", "{}/no/run.nc"], ["does not exist"]),
    "figure with a wrong suffix": (["run", "{}/good.toml", "--figure", "{}/run.gif"], ["run.gif", ".png"]),
    "output is a folder": (["run", "{}/good.toml", "--csv", "{}/folder.csv"], ["folder.csv", "cannot be written"]),
    "law file that is not there": (["run", "{}/good.toml", "--model", "{}/none.py:soft"], ["none.py"]),
    "law that the file lacks": (["run", "{}/good.toml", "--model", "{}/my.py:sofd"], ["'sofd'", "did you mean 'soft'"]),
    "law file that cannot run": (["run", "{}/good.toml", "--model", "{}/broken.py"], ["broken.py, line 2"]),
    "law file without laws": (["run", "{}/good.toml", "--model", "{}/empty.py"], ["holds no law"]),
    "law with dv turned round": (["run", "{}/good.toml", "--model", "{}/wrong.py:wrong"], ["wrong", "turn its sign"]),
    "law that is not a number": (
        ["run", "{}/good.toml", "--model", "{}/my.py:nan", "--set", "followers.0.model=nan", "--set",
         "followers.0.parameters={}"], ["follower 1", "nan returned", "not finite at t ="],
    ),
    "unknown model": (["models", "idmm"], ["did you mean 'idm'"]),
    "check of no file": (["check", "{}/none.py"], ["none.py"]),
    "check of a TOML file": (["check", "{}/good.toml"], ["Python file"]),
    "info of nothing": (["data", "info", "wltc3c"], ["wltc3c", "did you mean"]),
    "fetch of nothing": (["data", "fetch", "wltc3c"], ["wltc3c"]),
    "empty data": (["data", "info", "{}/empty.csv"], ["empty.csv"]),
    "data without columns": (["data", "info", "{}/text.csv"], ["text.csv"]),
    "data in km/h": (["data", "info", "{}/kmh.csv"], ["km/h"]),
    "data that is not sorted": (["data", "info", "{}/unsorted.csv"], ["unsorted.csv"]),
    "unknown unit": (["data", "info", "{}/kmh.csv", "--unit", "speed=furlong"], ["furlong"]),
    "column without value": (["data", "info", "{}/kmh.csv", "--column", "speed"], ["ours=theirs"]),
    "replay of a leader only": (["replay", "{}/lone.csv", "--model", "idm"], ["no followers"]),
    "replay with a wrong parameter": (
        ["replay", "{}/two.csv", "--model", "idm", "--set", "T=x"], ["write parameter=number"],
    ),
}  # fmt: skip


@pytest.fixture
def folder(tmp_path):
    place = tmp_path / "place"
    place.mkdir()
    (place / "good.toml").write_text(tomli_w.dumps(BASE))
    (place / "my.py").write_text(LAWS)
    (place / "wrong.py").write_text(WRONG_SIGN)
    (place / "broken.py").write_text("import headway\nraise RuntimeError('oh')\n")
    (place / "empty.py").write_text("x = 1\n")
    (place / "empty.csv").write_text("")
    (place / "text.csv").write_text("a,b\n1,2\n")
    (place / "binary.toml").write_bytes(b"\xff\xfe\x00")
    (place / "folder.csv").mkdir()
    rows = "".join(f"{t},0,{90 + t},\n" for t in range(5))
    (place / "kmh.csv").write_text("time_s,vehicle,speed_mps,gap_m\n" + rows)
    (place / "lone.csv").write_text("time_s,vehicle,speed_mps,gap_m\n" + rows.replace("9", "1"))
    two = "".join(f"{t},0,10,\n{t},1,10,30\n" for t in range(5))
    (place / "two.csv").write_text("time_s,vehicle,speed_mps,gap_m\n" + two)
    (place / "unsorted.csv").write_text("time_s,vehicle,speed_mps,gap_m\n0,0,10,\n2,0,10,\n1,0,10,\n")
    return place


@pytest.mark.parametrize("name", ARGUMENTS)
def test_arguments(name, cli, folder):
    arguments, words = ARGUMENTS[name]
    before = sorted(p.name for p in folder.iterdir())
    code, _, error = cli(*(a.replace("{}", str(folder)) if a != "followers.0.parameters={}" else a for a in arguments))
    assert code == 2
    assert is_one_sentence(error), error
    for word in words:
        assert word in error
    assert sorted(p.name for p in folder.iterdir() if p.name != "__pycache__") == before


def test_there_are_enough_of_them():
    assert len(SCENARIOS) + len(ARGUMENTS) >= 100


def test_writing_fails_half_way(tmp_path, monkeypatch):
    import headway as hw
    from headway import results

    scenario = hw.Scenario(hw.sine(23, 2, 0.63), [hw.Vehicle(hw.models.IDM)], duration=1)
    target = tmp_path / "run.csv"
    target.write_text("what was there before")

    def fail(dataset, path):
        Path(path).write_text("half")
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(results, "_csv", fail)
    with pytest.raises(hw.HeadwayError, match="No space left on device"):
        hw.save(hw.simulate(scenario), target)
    assert target.read_text() == "what was there before"
    assert [p.name for p in tmp_path.iterdir()] == ["run.csv"]
