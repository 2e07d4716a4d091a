"""What meets the border: strange environments, full disks, closed pipes, hostile files, arguments of other kinds."""

from __future__ import annotations

import inspect
import json
import os
import re
import resource
import signal
import subprocess
import sys
import time
import warnings

import numpy as np
import pandas as pd
import pytest
import xarray as xr

import headway as hw
from headway import calibration, plot
from headway.errors import LONGEST, unknown_name
from headway.limits import LIMITS, OutOfTime, time_limit
from headway.models import own
from headway.scenario.document import from_table
from headway.scenario.resolution import coarse_step

CAR = hw.Vehicle(hw.models.IDM, delay=0.15)
SCENARIO = hw.Scenario(hw.sine(23, 2, 0.63), [CAR] * 2, duration=5)


def headway(*arguments, **more):
    """The command as a process of its own."""
    environment = {**os.environ, **more.pop("env", {})}
    return subprocess.run(
        [sys.executable, "-m", "headway", *map(str, arguments)], env=environment, check=False, timeout=120,
        **{"capture_output": True, **more},
    )  # fmt: skip


def is_sentence(error: bytes) -> bool:
    text = error.decode("utf-8", "replace")
    return text.startswith("headway: ") and text.count("\n") == 1 and len(text) <= LONGEST + len("headway: \n")


# -- streams and environment ------------------------------------------------------------------------


@pytest.mark.parametrize("encoding", ["ascii", "cp1252"])
@pytest.mark.parametrize(
    "command", [("models",), ("run", "--list"), ("schema",), ("stability", "idm", "--speed", "20")]
)
def test_every_encoding_can_be_written(command, encoding):
    done = headway(*command, env={"PYTHONIOENCODING": encoding})
    assert (done.returncode, done.stderr) == (0, b"")
    assert len(done.stdout.decode(encoding)) > 100


def test_what_an_encoding_lacks_is_written_in_plain_letters():
    text = headway(
        "stability", "idm", "--speed", "20", "--delay", "2", env={"PYTHONIOENCODING": "ascii"}
    ).stdout.decode("ascii")
    assert "+-" in text
    assert "1/s2" in text
    assert "?" not in text


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="this system has no device that is always full")
@pytest.mark.parametrize("command", [("models",), ("schema",), ("data", "fetch", "us06"), ("--help",)])
def test_a_full_disk_behind_the_output(command):
    with open("/dev/full", "w") as full:
        done = headway(*command, stdout=full, stderr=subprocess.PIPE, capture_output=False)
    assert done.returncode == 2
    assert is_sentence(done.stderr), done.stderr


def test_a_reader_that_leaves_is_no_error():
    process = subprocess.Popen(
        [sys.executable, "-m", "headway", "schema"], stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )
    process.stdout.readline()
    process.stdout.close()
    assert process.wait(60) in (0, 141)
    assert process.stderr.read() == b""
    process.stderr.close()


def no_room():
    """From here on no file may become larger than a kilobyte, as on a disk that is full."""
    resource.setrlimit(resource.RLIMIT_FSIZE, (1024, 1024))


@pytest.mark.parametrize("arguments", [
    ("run", "paper:idm-2", "--out", "out.nc"), ("run", "paper:idm-2", "--csv", "out.csv"),
    ("run", "paper:idm-2", "--figure", "out.png"), ("map", "idm", "--x", "T=1:2:40", "--y", "speed=10:20:40", "--out", "out.nc"),
    ("data", "fetch", "us06", "--directory", "."),
])  # fmt: skip
def test_a_full_disk_leaves_nothing(arguments, tmp_path):
    done = headway(*arguments, cwd=tmp_path, preexec_fn=no_room)
    assert done.returncode == 2, (done.stdout, done.stderr)
    notes, error = done.stderr.splitlines(keepends=True)[:-1], done.stderr.splitlines(keepends=True)[-1]
    assert is_sentence(error), done.stderr
    assert all(note.startswith(b"headway: note: compiled code cannot be kept") for note in notes)
    assert list(tmp_path.iterdir()) == []


_OWN_LAW = "import headway as hw\n@hw.model\ndef soft(s, v, dv, *, k=0.2):\n    return k * (s - 2 - v) + 0.51 * dv\n"


@pytest.mark.parametrize("place", ["file", "/dev/full", "/proc/nowhere", "full"])
@pytest.mark.parametrize("name", ["HEADWAY_CACHE_DIR", "NUMBA_CACHE_DIR"])
def test_no_place_for_compiled_code(place, name, tmp_path):
    (tmp_path / "soft.py").write_text(_OWN_LAW)
    (tmp_path / "file").write_text("a file where a folder should be")
    (tmp_path / "full").mkdir()
    hw.simulate(SCENARIO)  # so that with a cache that can be read nothing else is compiled
    command = ("stability", "soft", "--model", "soft.py", "--json") if name[0] == "N" else (
        "run", "paper:idm-2", "--set", "duration=2", "--set", "followers.0.model=soft", "--set", "followers.0.parameters={}",
        "--model", "soft.py", "--json",
    )  # fmt: skip
    where = place if place.startswith("/") else tmp_path / place
    done = headway(*command, cwd=tmp_path, env={name: str(where)}, preexec_fn=no_room if place == "full" else None)
    assert done.returncode == 0, done.stderr
    notes = done.stderr.decode().splitlines()
    assert all(note.startswith("headway: note: compiled code cannot be kept") for note in notes), notes
    assert json.loads(done.stdout)


def test_compiled_code_that_fits_nowhere_still_runs(tmp_path):
    program = """
import numba.core.caching as caching
from headway.environment import compile_without_disk
compile_without_disk()
caching.CacheImpl._locator_classes[:] = caching.CacheImpl._locator_classes[-1:]
import numba
print(numba.njit(cache=True)(__import__("headway.models.maths").models.maths.power_scalar)(2.0, 3))
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, check=False, timeout=120)
    assert done.returncode == 0, done.stderr
    assert done.stdout == b"8.0\n"
    assert b"compiled code cannot be kept" in done.stderr


@pytest.mark.parametrize("rest", [b"", b"\x80", b"cheadway.engine.layout\nGoneWithThatVersion\n.", b"cnowhere\nx\n."])
def test_a_torn_or_older_index_of_compiled_code_is_written_anew(tmp_path, rest):
    import pickle

    from numba import __version__
    from numba.core.caching import IndexDataCacheFile

    from headway.environment import compile_without_disk

    compile_without_disk()
    (tmp_path / "law.nbi").write_bytes(pickle.dumps(__version__) + rest)
    file = IndexDataCacheFile(str(tmp_path), "law", ())
    assert file.load("key") is None
    file.save("key", "compiled")
    assert IndexDataCacheFile(str(tmp_path), "law", ()).load("key") == "compiled"


@pytest.mark.parametrize("after", [0.0, 0.02, 0.08, 0.15, 0.25, 0.4])
def test_an_interruption_while_the_command_is_loaded(after):
    program = "import sys; print(1, flush=True); sys.argv[1:] = ['schema']; from headway.__main__ import main; main()"
    process = subprocess.Popen(
        [sys.executable, "-c", f"try:\n    {program}\nexcept KeyboardInterrupt: sys.exit(3)"],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    process.stdout.readline()
    time.sleep(after)
    process.send_signal(signal.SIGINT)
    _, error = process.communicate(timeout=60)
    # 3: before the first line of `main`; 0: it had ended; -SIGINT: the interpreter was leaving already
    allowed = ((130, "headway: interrupted\n"), (3, ""), (0, ""), (-signal.SIGINT, ""))
    assert (process.returncode, error) in allowed


def test_an_interruption_in_the_middle_of_loading_is_said(monkeypatch, capsys):
    import builtins

    from headway.__main__ import main

    whole = builtins.__import__

    def interrupted(name, *arguments, **more):
        if name == "headway.cli":
            raise KeyboardInterrupt
        return whole(name, *arguments, **more)

    monkeypatch.setattr(builtins, "__import__", interrupted)
    with pytest.raises(SystemExit) as end:
        main()
    assert end.value.code == 130
    assert capsys.readouterr().err == "headway: interrupted\n"


@pytest.mark.parametrize(("environment", "words"), [
    ({"NUMBA_NUM_THREADS": "0"}, "NUMBA_NUM_THREADS"), ({"NUMBA_DISABLE_JIT": "1"}, "NUMBA_DISABLE_JIT"),
    ({"HEADWAY_LIMIT": "-1"}, "HEADWAY_LIMIT"), ({"COLUMNS": "0"}, ""), ({"COLUMNS": "999999999"}, ""), ({"MPLBACKEND": "x"}, ""),
])  # fmt: skip
def test_a_strange_environment(environment, words, tmp_path):
    done = headway("run", "paper:idm-2", "--figure", tmp_path / "out.png", env=environment)
    if words:
        assert done.returncode == 2
        assert is_sentence(done.stderr)
        assert words in done.stderr.decode()
    else:
        assert done.returncode == 0, done.stderr
    assert headway("--help", env={"COLUMNS": "999999999"}).returncode == 0


@pytest.mark.parametrize("columns", [50, 80, 120])
def test_tables_break_between_words(columns, monkeypatch, capsys):
    from headway.cli import show

    monkeypatch.setenv("FORCE_COLOR", "1")  # a terminal, as far as the table can tell
    monkeypatch.setenv("COLUMNS", str(columns))
    names = (
        "vehicle",
        "model",
        "peak error [m]",
        "speed amplitude [m/s]",
        "ratio to the one ahead",
        "least accel. [m/s²]",
    )
    show.print_table(
        "",
        names,
        [("0", "leader", "–", "2", "–", "-1.26"), ("10", "idm-spacing", "6.13", "0.82", "0.41", "-0.0375")],
        2,
    )
    words = {w for line in re.sub(r"\x1b\[[0-9;]*m", "", capsys.readouterr().out).splitlines() for w in line.split()}
    assert {w for name in names for w in name.split()} <= words
    assert {"leader", "idm-spacing", "-1.26", "-0.0375"} <= words


# -- files ------------------------------------------------------------------------------------------


def test_results_come_back(tmp_path):
    run = hw.simulate(SCENARIO)
    for name in ("run.csv", "run.nc"):
        again = hw.open_results(hw.save(run, tmp_path / name))
        for variable in again.data_vars:
            np.testing.assert_array_equal(again[variable], run[variable])
            assert again[variable].attrs == run[variable].attrs
        recording = hw.data.read(tmp_path / name)
        np.testing.assert_array_equal(recording.speed, run.speed)
        np.testing.assert_array_equal(recording.gap, run.gap)
        np.testing.assert_allclose(recording.position, run.position, atol=1e-9)
    assert hw.load(tmp_path / "run.nc") == SCENARIO


def test_hostile_law_files_end(tmp_path, monkeypatch):
    monkeypatch.setattr(own, "_PATIENCE", 0.3)
    for name, text in {
        "endless": "while True: pass",
        "loop": "import headway as hw\n@hw.model\ndef f(s, v, dv, *, k=1.0):\n    while True: pass",
        "sleeps": "import time\ntime.sleep(1000)",
    }.items():
        file = tmp_path / f"{name}.py"
        file.write_text(text)
        begin = time.monotonic()
        with pytest.raises(hw.HeadwayError, match="still runs after"):
            hw.load_laws(str(file))
        assert time.monotonic() - begin < 10


def test_what_a_law_file_prints_does_not_spoil_the_answer(cli, tmp_path):
    file = tmp_path / "prints.py"
    file.write_text(
        "import headway as hw\nprint('noise')\n@hw.model\ndef soft(s, v, dv, *, k=0.2):\n    return k * (s - v) + dv\n"
    )
    code, out, error = cli("models", "soft", "--model", file, "--json")
    assert code == 0
    assert "noise" not in out
    assert error == "noise\n"


def test_one_bad_law_does_not_hide_the_others(cli, tmp_path):
    file = tmp_path / "two.py"
    file.write_text(
        "import headway as hw\n@hw.model\ndef bad(gap, v, *, k=0.2):\n    return k\n"
        "@hw.model\ndef good(s, v, dv, *, k=0.2):\n    return k * (s - 2 - v) + dv\n"
    )
    code, out, _ = cli("check", file)
    assert code == 1
    assert "did you mean 's'" in out
    assert "ok    drives a platoon" in out
    with pytest.raises(hw.HeadwayError, match="did you mean 's'"):
        hw.load_laws(str(file))
    assert [law.name for law in hw.load_laws(f"{file}:good")] == ["good"]


def test_a_law_may_look_up_a_table():
    gaps, speeds = np.array([2.0, 40.0]), np.array([0.0, 30.0])

    def table(s, v, dv, *, k=0.3):
        return k * (np.interp(s, gaps, speeds) - v) + 0.5 * dv

    law = hw.model(table)
    slope = law().partials(10.0)["s"]
    assert slope == pytest.approx(0.3 * 30 / 38)
    assert all(c.passed for c in hw.check_model(law) if c.name in ("compiles to the same numbers", "drives a platoon"))


# -- sizes and steps --------------------------------------------------------------------------------

_BASE = {"duration": 5.0, "leader": {"kind": "sine", "mean": 23.0, "amplitude": 2.0, "omega": 0.63}}


@pytest.mark.parametrize(("change", "words"), [
    ({"duration": 2147483648}, "duration"), ({"duration": 5e-324}, "duration"), ({"dt": 1e-8}, "asks for 5e"),
    ({"output_step": 1e-8}, "asks for"), ({"leader_length": 1e30}, "too large"), ({"followers": [{"model": "idm", "delay": 1e7}]}, "delay = 1e"), ({"seed": 10**400}, "too large"),
    ({"leader": {"kind": "noise", "mean": 23.0, "sd": 1.0, "sample": 1e-8}}, "noise.sample"),
    ({"leader": {"kind": "square", "mean": 23.0, "amplitude": 1.0, "omega": 1e6}, "duration": 1000.0}, "square.omega"),
    ({"gaps": [1, "x"]}, "gaps"), ({"duration": None}, "duration"), ({"gap_offsets": {"1": 10**400}}, "too large"),
])  # fmt: skip
def test_sizes_are_refused_before_anything_is_allocated(change, words):
    table = {**_BASE, "followers": [{"model": "idm", "count": 2}], **change}
    begin = time.monotonic()
    with pytest.raises(hw.HeadwayError, match=words) as error:
        from_table(table)
    assert time.monotonic() - begin < 2
    assert len(str(error.value)) <= LONGEST


def test_limits_can_be_raised_on_purpose(monkeypatch):
    monkeypatch.setitem(LIMITS, "steps", 100)
    with pytest.raises(hw.HeadwayError, match="HEADWAY_LIMIT=10 "):
        hw.Scenario(SCENARIO.leader, [CAR], duration=5)
    monkeypatch.setenv("HEADWAY_LIMIT", "10")
    assert hw.Scenario(SCENARIO.leader, [CAR], duration=5).end == 5
    monkeypatch.setenv("HEADWAY_LIMIT", "x")
    with pytest.raises(hw.HeadwayError, match="HEADWAY_LIMIT = 'x'"):
        hw.Scenario(SCENARIO.leader, [CAR], duration=5)


def test_a_time_limit_lets_an_older_one_go_on():
    with pytest.raises(OutOfTime), time_limit(0.3), time_limit(30):
        time.sleep(10)


def test_coarse_steps_are_warned_of():
    with pytest.warns(hw.HeadwayWarning, match="0.63 rad/s"):
        hw.simulate(hw.Scenario(hw.sine(23, 2, 0.63), [CAR], duration=50, dt=5))
    stiff = hw.models.OVM(alpha=50.0)
    assert "ovm answers within" in coarse_step(hw.Scenario(hw.constant(10), [hw.Vehicle(stiff)], duration=5, dt=0.1))
    for name in hw.library.library():
        assert coarse_step(hw.library.library_scenario(name)) is None, name


# -- calls ------------------------------------------------------------------------------------------

RECORDING = hw.data.Recording.from_gaps(np.arange(3.0), np.ones((2, 3)), np.ones((2, 3)))
THINGS = (
    None, np.zeros(3), {}, pd.DataFrame({"a": [1]}), ["a"], xr.Dataset(), 3, "x", CAR, RECORDING, 10**400, float("nan"), [[]],
)  # fmt: skip
FUNCTIONS = {
    **{n: getattr(hw, n) for n in ("simulate", "simulate_many", "save", "open_results", "load", "from_toml", "behind",
                                   "load_laws", "linearize", "head_to_tail", "stability_map", "calibrate", "between",
                                   "load_study", "open_study", "Scenario", "Vehicle")},
    **{f"plot.{n}": getattr(plot, n) for n in plot.__all__},
    **{f"data.{n}": getattr(hw.data, n) for n in ("read", "check", "compare", "fetch", "load_cycle")},
    **{f"calibration.{n}": getattr(calibration, n) for n in ("as_recorded", "cross_validate", "measured_growth", "save_fits", "verdict",
                                                             "measured_transfer", "one_in", "replay", "load_followers")},
    **{f"library.{n}": getattr(hw.library, n) for n in ("library_table", "library_scenario")},
}  # fmt: skip


@pytest.mark.parametrize("name", FUNCTIONS)
def test_arguments_of_other_kinds_get_a_sentence(name):
    function = FUNCTIONS[name]
    needed = [p for p in inspect.signature(function).parameters.values() if p.default is p.empty and p.kind in (0, 1)]
    sentences = []
    for thing in THINGS:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            try:
                function(*[thing] * max(1, len(needed)))
            except hw.HeadwayError as error:
                sentences.append(str(error))
    assert sentences
    assert all(10 < len(text) <= LONGEST and text.isprintable() for text in sentences)


def test_help_shows_fields_and_nothing_of_their_checks():
    import pydoc

    text = pydoc.render_doc(hw.Vehicle)
    assert "Vehicle(model, delay=0.0, lag=0.0, length=5.0, limits=None)" in text
    assert "pydantic" not in text.lower()


def test_messages_name_the_nearest_first_and_stay_short():
    text = str(unknown_name("ready scenario", "paper:idm2", hw.library.library()))
    assert text.index("did you mean 'paper:idm-2'?") < text.index("llowed are")
    assert len(text) <= LONGEST
    assert len(str(unknown_name("x", "y" * 5000, ["a"]))) <= LONGEST
    assert len(str(hw.HeadwayError("word " * 1000))) <= LONGEST


@pytest.mark.parametrize(("arguments", "words"), [
    (["run", "idm"], "'idm' is a law and no scenario"), (["run", "a", "b"], "'b' is one argument too many"),
    (["run", "wltc-idm"], "did you mean 'example:wltc-idm'"),
    (["run", "paper:cacc-window", "--set", "kp=1"], "did you mean followers.0.parameters.kp=1"),
    (["run", "paper:idm-2", "--set", "omega=1"], "did you mean leader.omega=1"),
])  # fmt: skip
def test_slips_are_pointed_to_what_was_meant(cli, arguments, words):
    code, _, error = cli(*arguments)
    assert code == 2
    assert words in error


def test_a_key_below_a_table_and_a_mark_at_the_beginning(tmp_path, cli):
    good = "duration = 2.0\n[leader]\nkind = 'constant'\nspeed = 20.0\n[[followers]]\nmodel = 'IDM'\n"
    file = tmp_path / "s.toml"
    file.write_text(good, encoding="utf-8-sig")
    assert cli("run", file)[0] == 0
    file.write_text(good.replace("duration = 2.0\n", "") + "duration = 2.0\n")
    assert "write it above the first [[followers]]" in cli("run", file)[2]


@pytest.mark.parametrize(("call", "words"), [
    (lambda: hw.model(lambda gap, v, *, k=1.0: k), "did you mean 's'"),
    (lambda: hw.model(lambda s, v, k=1.0: k), r"put a '\*' before"),
    (lambda: hw.model(3), "not a plain Python function"),
    (lambda: hw.models.IDM(T=10**400), "out of bounds"), (lambda: hw.models.IDM(T=[1]), "not a number"),
    (lambda: hw.models.IDM(T=None), "not a number"),
])  # fmt: skip
def test_laws_are_checked_when_they_are_made(call, words):
    with pytest.raises(hw.HeadwayError, match=words):
        call()


def test_a_column_that_is_gone_does_not_shorten_a_platoon(tmp_path):
    file = tmp_path / "hole.csv"
    file.write_text("Time,Speed1,Speed3,IVS1,IVS2\n0,10,10,20,20\n1,10,10,20,20\n")
    with pytest.raises(hw.HeadwayError, match="no 'Speed2'"):
        hw.data.read(file)
    file.write_text("Time,Speed1,IVS1\n0,10,20\n1,10,20\n")
    with pytest.raises(hw.HeadwayError, match="no 'Speed2'"):
        hw.data.read(file)
