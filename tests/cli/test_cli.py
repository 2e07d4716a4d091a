"""The command line as a new user meets it, and results on disk."""

from __future__ import annotations

import csv
import functools
import hashlib
import http.server
import json
import subprocess
import sys
import threading

import jsonschema
import numpy as np
import pytest
import tomli_w
from conftest import shared_file

import headway as hw
from headway.data.catalogue import catalogue
from headway.library import library, library_scenario

SCENARIO = {
    "name": "two cars",
    "duration": 10.0,
    "output_step": 0.5,
    "leader": {"kind": "sine", "mean": 23.0, "amplitude": 2.0, "omega": 0.63},
    "followers": [{"model": "idm", "count": 2, "delay": 0.15, "parameters": {"T": 1.5}}],
}

LAWS = '''
from typing import Annotated
import headway as hw

@hw.model
def soft(s, v, dv, *, k: Annotated[float, hw.Param("1/s²", 0.01, 1.0, "stiffness")] = 0.2):
    """Soft follower."""
    return k * (s - 2.0 - 1.2 * v) + 0.6 * dv
'''

WRONG = """
import headway as hw

@hw.model
def wrong(s, v, dv, *, k=0.2):
    return k * (s - 2.0 - 1.2 * v) - 0.6 * dv
"""


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "scenario.toml").write_text(tomli_w.dumps(SCENARIO))
    (tmp_path / "my.py").write_text(LAWS)
    (tmp_path / "wrong.py").write_text(WRONG)
    return tmp_path


@pytest.fixture
def ok(cli):
    """Run a command that must succeed silently; the answer is its standard output."""

    def call(*arguments):
        code, out, error = cli(*arguments)
        assert (code, error) == (0, ""), error
        assert "\x1b" not in out
        return out

    return call


def rows_of(table):
    return [line.split() for line in table.splitlines() if line.split() and line.split()[0].isdigit()]


def test_run_prints_a_readable_table(ok, folder):
    out = ok("run", folder / "scenario.toml")
    lines = out.splitlines()
    assert lines[0].strip() == "two cars: 2 followers, 10 s"
    for column in ("vehicle", "model", "peak error [m]", "r.m.s. error [m]", "speed amplitude [m/s]", "least gap [m]"):
        assert column in lines[2], "each column has its unit, on one line"
    assert "collision" not in out
    rows = rows_of(out)
    assert [r[:2] for r in rows] == [["0", "leader"], ["1", "idm"], ["2", "idm"]]
    expected = hw.metrics.summary(hw.simulate(hw.load(folder / "scenario.toml")))
    for row in rows[1:]:
        n = int(row[0])
        assert float(row[2]) == pytest.approx(float(expected.peak_spacing_error[n]), rel=1e-3)
        assert float(row[5]) == pytest.approx(float(expected.speed_amplitude_ratio[n]), rel=1e-3)
        assert float(row[6]) == pytest.approx(float(expected.least_gap[n]), rel=1e-3)


def test_run_says_when_someone_collides(ok, folder):
    changes = ("gaps=5", "followers.0.limits=[-2, 1]", "leader={kind='brake',mean=23,drop=23,hold=3}")
    out = ok("run", folder / "scenario.toml", *(x for change in changes for x in ("--set", change)))
    assert "collision [s]" in out
    time = json.loads(ok("run", folder / "scenario.toml", "--json", *(x for c in changes for x in ("--set", c))))
    when = time["vehicles"][1]["collision_time"]
    assert f"vehicle 1 collides at {when:.4g} s; it and all behind it are not simulated any further" in out
    assert "known until [s]" in out
    assert time["known_until"] == [10.0, when, when]
    # what is left of a run that breaks off is no growth
    assert time["vehicles"][1]["speed_amplitude_ratio"] is None
    assert time["vehicles"][2]["speed_amplitude_ratio"] is None


def test_run_names_the_first_collision_in_time(tmp_path, ok):
    """Vehicle 3 starts close to the one ahead and hits it before vehicle 1 hits the leader."""
    weak = hw.Vehicle(hw.models.IDM(), limits=(-1.0, 1.0))
    leader = hw.brake(mean=20, drop=20, hold=9, ramp=4)
    scenario = hw.Scenario(leader, [weak] * 4, duration=20, gaps=[20, 30, 2, 40], speed_offsets={3: 3.0})
    (tmp_path / "s.toml").write_text(scenario.to_toml(), encoding="utf-8")
    answer = json.loads(ok("run", tmp_path / "s.toml", "--json"))
    first, later = (answer["vehicles"][n]["collision_time"] for n in (3, 1))
    assert first < later
    assert answer["notes"][0].startswith(
        f"vehicle 3 collides at {first:.4g} s, then vehicle 1 at {later:.4g} s; it and"
    )
    assert answer["known_until"] == [20.0, later, later, first, first]


def test_run_says_when_braking_is_beyond_any_car(tmp_path, ok):
    scenario = hw.Scenario(hw.brake(mean=25, drop=25, hold=5, ramp=1), [hw.Vehicle(hw.models.IDM(T=0.5))], duration=15)
    (tmp_path / "s.toml").write_text(scenario.to_toml(), encoding="utf-8")
    out = " ".join(ok("run", tmp_path / "s.toml").split())
    assert "least accel. [m/s²]" in out
    assert "unphysical: 2 vehicles brake harder than 10 m/s²" in out
    calm = ok("run", tmp_path / "s.toml", "--set", "leader.ramp=10.0")
    assert "unphysical" not in calm


def test_run_measures_what_is_asked_for(folder, ok):
    answer = json.loads(ok("run", folder / "scenario.toml", "--json", "--metrics", "ttc,tet(threshold=9),collisions"))
    run = hw.simulate(hw.load(folder / "scenario.toml"))
    for row in answer["vehicles"][1:]:
        assert row["ttc"] == pytest.approx(float(hw.metrics.ttc(run)[row["vehicle"]]))
        assert row["tet(threshold=9)"] == float(hw.metrics.tet(run, threshold=9)[row["vehicle"]])
    assert answer["run"] == {"collisions": 0.0}
    listed = {row["name"] for row in json.loads(ok("metrics", "--json"))}
    assert {"ttc", "collisions", "peak_spacing_error", "fuel"} <= listed
    assert "least time to collision" in ok("metrics")


def test_run_json_is_clean_and_the_same_as_the_metrics(ok, folder):
    answer = json.loads(ok("run", folder / "scenario.toml", "--json"))
    scenario = hw.load(folder / "scenario.toml")
    assert answer["name"] == "two cars"
    assert answer["scenario_hash"] == scenario.hash
    assert answer["headway_version"] == hw.__version__
    assert answer["written"] == []
    assert [v["vehicle"] for v in answer["vehicles"]] == [0, 1, 2]
    summary = hw.metrics.summary(hw.simulate(scenario))
    for vehicle in answer["vehicles"]:
        assert set(vehicle) == {"vehicle", "model", *summary}
        for name in set(summary) - {"collision_time"}:
            expected = float(summary[name].sel(vehicle=vehicle["vehicle"]))
            got = np.nan if vehicle[name] is None else vehicle[name]
            assert got == pytest.approx(expected, rel=1e-12, nan_ok=True), name
        assert vehicle["collision_time"] is None


def test_run_writes_what_it_says(ok, folder):
    targets = [folder / n for n in ("run.nc", "run.csv", "run.png")]
    out = ok("run", folder / "scenario.toml", "--out", targets[0], "--csv", targets[1], "--figure", targets[2])
    assert [line for line in out.splitlines() if line.startswith("wrote")] == [f"wrote {t}" for t in targets]
    stored = hw.open_results(targets[0])
    assert stored.identical(hw.simulate(hw.load(folder / "scenario.toml")))
    assert stored.attrs["title"] == "two cars"
    with targets[1].open(newline="") as stream:
        header, *rows = list(csv.reader(stream))
    assert header[:4] == ["time [s]", "vehicle", "position [m]", "speed [m/s]"]
    assert {"acceleration [m/s²]", "gap [m]", "relative_speed [m/s]", "spacing_error [m]"} < set(header)
    assert len(rows) == 3 * stored.sizes["time"]
    speed = [float(r[3]) for r in rows if r[1] == "1"]
    assert np.array_equal(speed, stored.speed.sel(vehicle=1)), "all digits are written"
    assert targets[2].read_bytes().startswith(b"\x89PNG")
    assert sorted(p.name for p in folder.iterdir() if p.is_file()) == sorted(
        ["my.py", "run.csv", "run.nc", "run.png", "scenario.toml", "wrong.py"]
    )


def test_set_overrides_and_toml_reproduces(ok, folder):
    changes = ["--set", "followers.0.parameters.T=1.1", "--set", "leader.omega=0.3", "--set", "name=other"]
    text = ok("run", folder / "scenario.toml", *changes, "--toml")
    (folder / "again.toml").write_text(text)
    again = hw.load(folder / "again.toml")
    assert again.followers[0].model.T == 1.1
    assert again.leader.omega == 0.3
    one, other = ok("run", folder / "scenario.toml", *changes, "--json"), ok("run", folder / "again.toml", "--json")
    assert one == other
    assert json.loads(one)["scenario_hash"] == again.hash != hw.load(folder / "scenario.toml").hash


def test_run_a_law_of_ones_own(ok, cli, folder):
    mine = ["--set", "followers.0.model=soft", "--set", "followers.0.parameters={k=0.3}"]
    rows = rows_of(ok("run", folder / "scenario.toml", "--model", f"{folder}/my.py:soft", *mine))
    assert [r[1] for r in rows] == ["leader", "soft", "soft"]
    code, out, error = cli("run", folder / "scenario.toml", *mine)
    assert (code, out) == (2, "")
    assert "--model my.py:soft" in error


def test_run_lists_and_runs_ready_scenarios(ok):
    out = ok("run", "--list")
    assert json.loads(ok("run", "--list", "--json")) == library()
    for name, what in library().items():
        (line,) = [row for row in out.splitlines() if row.split()[:1] == [name]]
        assert what in line, "each on one line"
    assert hw.from_toml(ok("run", "paper:idm-1", "--toml")) == library_scenario("paper:idm-1")
    answer = json.loads(ok("run", "paper:idm-1", "--set", "duration=5", "--json"))
    assert answer["name"] == "paper:idm-1"
    assert len(answer["vehicles"]) == 5


def test_models_lists_all_with_units_and_sources(ok):
    out = ok("models")
    for law in hw.models.BUILT_IN.values():
        assert f"{law.name}: {law.title}" in out
        assert f"a = {law.formula}" in out
        assert f"doi:{law.doi}" in out
    for words in ("a = 1 m/s²", "[0.01 to 10]", "maximum acceleration", "signals: s, v, dv"):
        assert words in out


def test_models_of_one_and_of_ones_own(ok, folder):
    out = ok("models", "cacc")
    assert out.startswith("cacc: ")
    assert "idm" not in out
    out = ok("models", "soft", "--model", folder / "my.py")
    assert "soft: Soft follower" in out
    assert "k = 0.2 1/s²" in out
    (law,) = json.loads(ok("models", "soft", "--model", folder / "my.py", "--json"))
    assert law["signals"] == ["s", "v", "dv"]
    assert law["parameters"]["k"] == {
        "default": 0.2, "unit": "1/s²", "low": 0.01, "high": 1.0, "text": "stiffness", "structural": False,
    }  # fmt: skip
    assert [x["name"] for x in json.loads(ok("models", "--json"))] == list(hw.models.BUILT_IN)


def test_check_passes_a_good_law_and_explains_a_bad_one(ok, cli, folder):
    out = ok("check", f"{folder}/my.py:soft")
    assert out.startswith("soft:\n")
    assert all(line.startswith("  ok ") for line in out.splitlines()[1:])
    code, out, error = cli("check", folder / "wrong.py")
    assert (code, error) == (1, "")
    assert "FAIL  dv has the right sign: law wrong slows down the more the gap opens" in out
    assert "note  parameters have units and bounds: k should have a unit and bounds" in out
    code, out, _ = cli("check", folder / "wrong.py", "--json")
    assert code == 1
    failed = [c["name"] for c in json.loads(out)["wrong"] if not c["passed"] and c["required"]]
    assert "dv has the right sign" in failed


def test_schema_is_a_json_schema(ok):
    schema = json.loads(ok("schema"))
    jsonschema.Draft202012Validator.check_schema(schema)
    jsonschema.validate(SCENARIO, schema)


def test_data_list_and_info(ok, folder):
    out = ok("data", "list")
    for name, entry in catalogue().items():
        (line,) = [row for row in out.splitlines() if row.split()[:1] == [name]]
        assert entry.licence in line
    assert set(json.loads(ok("data", "list", "--json"))) == set(catalogue())
    assert "Apache-2.0" in ok("data", "info", "wltc3b")
    assert json.loads(ok("data", "info", "wltc3b", "--json"))["seconds"] == 1800.0
    file = recording(folder / "trip.csv")
    assert "2 vehicles, 10 s, 21 samples" in ok("data", "info", file)
    info = json.loads(ok("data", "info", file, "--json"))
    assert (info["vehicles"], info["seconds"], info["samples"]) == (2, 10.0, 21)


def recording(file):
    """Two cars at a steady 20 m/s, 32 m apart."""
    rows = "".join(f"{t},0,20,\n{t},1,20,32\n" for t in np.arange(0, 10.5, 0.5))
    file.write_text("time_s,vehicle,speed_mps,gap_m\n" + rows)
    return file


def test_replay_of_a_recording(ok, folder):
    file = recording(folder / "trip.csv")
    # idm-spacing rests at 2 m + 1.5 s · 20 m/s = 32 m, where the recorded follower is
    command = ["replay", file, "--model", "idm-spacing"]
    (vehicle,) = json.loads(ok(*command, "--json"))["vehicles"]
    assert vehicle["rms_gap_error"] < 1e-9
    answer = json.loads(ok(*command, "--set", "T=1.0", "--out", folder / "sim.nc", "--json"))
    assert answer["vehicles"][0]["rms_gap_error"] > 1
    assert hw.open_results(folder / "sim.nc").sizes["vehicle"] == 2
    out = ok(*command, "--set", "T=1.0")
    assert "r.m.s. gap error [m]" in out
    assert len(rows_of(out)) == 1
    assert "soft" in ok("replay", file, "--model", f"{folder}/my.py:soft")


class Quiet(http.server.SimpleHTTPRequestHandler):
    def log_message(self, *_):
        pass


@pytest.fixture
def mirror(tmp_path, monkeypatch):
    """A local server of a folder that holds a file under the name and hash of a catalogue entry."""
    module = sys.modules["headway.data.catalogue"]  # the package's name of it is the function
    content = b"time_s,vehicle,speed_mps,gap_m\n0,0,20,\n1,0,20,\n"
    place = tmp_path / "mirror"
    place.mkdir()
    name = "openacc-astazero-example"
    entry = module.catalogue()[name]
    changed = type(entry)(**{**vars(entry), "sha256": hashlib.sha256(content).hexdigest(), "bytes": len(content)})
    (place / entry.file).write_bytes(content)
    monkeypatch.setattr(module, "_ENTRIES", (changed,))
    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), functools.partial(Quiet, directory=str(place)))
    threading.Thread(target=server.serve_forever, daemon=True).start()
    yield name, f"http://127.0.0.1:{server.server_address[1]}", place / entry.file
    server.shutdown()
    server.server_close()


def test_data_fetch_from_a_mirror(ok, cli, mirror, tmp_path):
    name, url, served = mirror
    goal = tmp_path / "goal"
    path = ok("data", "fetch", name, "--base-url", url, "--directory", goal).strip()
    assert path == str(goal / served.name)
    assert (goal / served.name).read_bytes() == served.read_bytes()
    served.write_bytes(b"something else")
    code, out, error = cli("data", "fetch", name, "--base-url", url, "--directory", tmp_path / "other")
    assert (code, out) == (2, "")
    assert "SHA-256" in error
    assert not list((tmp_path / "other").glob("*"))


def test_data_fetch_of_what_is_shipped(ok, tmp_path):
    assert ok("data", "fetch", "us06", "--directory", tmp_path).strip() == str(tmp_path / "us06.csv")
    assert (tmp_path / "us06.csv").stat().st_size == catalogue()["us06"].bytes


def test_replay_of_a_real_platoon(ok):
    file = shared_file("raw/zalazone_short_dynamic_part4.csv")
    command = ["replay", file, "--model", "idm", "--set", "T=1.2", "--window", "20:50"]
    answer = json.loads(ok(*command, "--json"))
    assert len(answer["vehicles"]) == 10
    assert all(0 < v["rms_gap_error"] < 50 for v in answer["vehicles"])


#: command → options or commands that its help must explain
COMMANDS = {
    "": ["run", "models", "check", "schema", "data", "--version"],
    "run": ["--set", "--model", "--out", "--csv", "--figure", "--json", "--toml", "--list"],
    "models": ["--model", "--json"],
    "check": ["FILE", "--json"],
    "schema": ["JSON schema"],
    "data": ["list", "info", "fetch"],
    "data list": ["--json"],
    "data info": ["--column", "--unit", "--format"],
    "data fetch": ["--base-url", "--directory"],
    "replay": ["--set", "--delay", "--lag", "--window", "--parameters", "--out", "--figure"],
}


@pytest.mark.parametrize("command", COMMANDS)
def test_help_of(command, ok):
    out = ok(*command.split(), "--help")
    assert out.startswith(f"Usage: headway {command}")
    for word in COMMANDS[command]:
        assert word in out


def python(code, *arguments):
    done = subprocess.run([sys.executable, *code, *map(str, arguments)], capture_output=True, text=True, check=True)
    assert done.stderr == ""
    return done.stdout


def test_help_loads_nothing_heavy():
    code = "import sys, runpy, contextlib\nsys.argv = ['headway', '--help']\n"
    code += "with contextlib.suppress(SystemExit):\n    runpy.run_module('headway', run_name='__main__')\n"
    code += "print('LOADED', *sorted({m.partition('.')[0] for m in sys.modules}))"
    out = python(["-c", code])
    assert out.startswith("Usage: headway")
    loaded = set(out.rpartition("LOADED")[2].split())
    assert "headway" in loaded
    assert not loaded & {"numba", "xarray", "pandas", "matplotlib", "scipy", "h5py", "pydantic", "numpy"}


def test_a_whole_process_prints_clean_output_in_a_pipe(folder):
    assert python(["-m", "headway", "--version"]).strip() == f"headway {hw.__version__}"
    answer = json.loads(python(["-m", "headway", "run"], folder / "scenario.toml", "--json"))
    assert len(answer["vehicles"]) == 3
    table = python(["-m", "headway", "run"], folder / "scenario.toml")
    assert "\x1b" not in table
    assert len(rows_of(table)) == 3


@pytest.mark.parametrize("arguments", [["runn"], ["run", "none.toml"], ["models", "imd"]])
def test_a_mistake_is_one_line_and_exit_code_2(arguments):
    done = subprocess.run([sys.executable, "-m", "headway", *arguments], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith("headway: ")
    assert done.stderr.count("\n") == 1


HARD = {
    "a plain run": {},
    "a collision": {
        "gaps": 5.0, "leader": hw.brake(23, 23, 3), "followers": [hw.Vehicle(hw.models.IDM, limits=(-2, 1))] * 2,
    },
    "names": {"name": "größe ≠ [m] \"x\"", "description": "two\nlines", "seed": 2**63 - 1},
    "gmm without a policy": {"followers": [hw.Vehicle(hw.models.GMM)], "gaps": 20.0},
}  # fmt: skip


@pytest.mark.parametrize("name", HARD)
def test_netcdf_loses_nothing(name, tmp_path):
    fields = {"leader": hw.noise(23, 1), "followers": [hw.Vehicle(hw.models.IDM, delay={"s": 0.2})] * 2, "duration": 8}
    scenario = hw.Scenario(**{**fields, **HARD[name]})
    dataset = hw.simulate(scenario)
    assert np.isfinite(dataset.collision_time).any() == (name == "a collision")
    again = hw.open_results(hw.save(dataset, tmp_path / "run.nc"))
    assert again.identical(dataset)
    assert again.attrs == dataset.attrs
    for key in (*dataset.data_vars, *dataset.coords):
        assert again[key].attrs == dataset[key].attrs, key
        assert again[key].dims == dataset[key].dims
        if dataset[key].dtype.kind in "fi":
            assert again[key].dtype == dataset[key].dtype, key
            assert again[key].values.tobytes() == dataset[key].values.tobytes(), key
    assert hw.from_toml(again.attrs["scenario"]) == scenario
    assert again.attrs["scenario_hash"] == scenario.hash
    assert hw.save(again, tmp_path / "again.nc")
    assert hw.open_results(tmp_path / "again.nc").identical(dataset)


def test_what_is_no_result_is_named(tmp_path):
    (tmp_path / "text.nc").write_text("not this")
    for name in ("text.nc", "none.nc"):
        with pytest.raises(hw.HeadwayError, match=f"{name}: is not a NetCDF file of results"):
            hw.open_results(tmp_path / name)
