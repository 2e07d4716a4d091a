"""Stores and clusters: killed at any moment a study ends with the same bits; a worker that dies is replaced."""

from __future__ import annotations

import dataclasses
import json
import multiprocessing
import os
import resource
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from study_cases import mixed

from headway.errors import HeadwayError
from headway.study.store import Store
from headway.study.study import Study, open_study

SCRIPT = Path(__file__).parents[1] / "helpers" / "study_cases.py"


def killed_after(pieces: int, path: Path) -> int:
    """Start the study in a process of its own and kill it when so many pieces are done; how many were."""
    process = subprocess.Popen([sys.executable, SCRIPT, path], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
    marks = path / "complete"
    while process.poll() is None:
        if marks.is_dir() and len(list(marks.glob("[0-9]*.json"))) >= pieces:
            process.send_signal(signal.SIGKILL)
            break
        time.sleep(0.001)
    process.wait()
    assert process.returncode == -signal.SIGKILL, process.stderr and process.stderr.read().decode()
    return len(Store.open(path).complete())


def test_killed_at_random_moments_it_resumes_with_the_same_bits(tmp_path):
    study, path = mixed(12), tmp_path / "study.zarr"
    expected = study.run()
    wanted = np.sort(np.random.default_rng(5).choice(np.arange(2, 44), 3, replace=False))
    done = [killed_after(int(n), path) for n in wanted]
    assert done == sorted(done)
    assert 0 < done[-1] < 48
    partly = open_study(path)
    assert "pending" in partly.status.values
    assert study.run(store=path).identical(expected)
    assert open_study(path).identical(expected)


def test_an_interrupted_region_is_done_again(tmp_path):
    study, path = mixed(), tmp_path / "study.zarr"
    expected = study.run(store=path, chunk=4)
    (path / "complete" / "2.json").unlink()
    broken = next((path / "least_gap" / "c").rglob("2/0"))
    broken.write_bytes(broken.read_bytes()[:7])
    touched: list[int] = []
    assert study.run(store=path, progress=lambda done, _: touched.append(done)).identical(expected)
    assert touched == [32, 36]


def test_shards_meet_in_a_store(tmp_path):
    study, path = mixed(), tmp_path / "study.zarr"
    first = study.run(store=path, shard=(2, 3), chunk=5)
    assert (first.status == "pending").any()
    for i in (1, 3):
        last = study.run(store=path, shard=(i, 3), chunk=9)  # those who share a store cut as it is cut
    assert last.identical(study.run())
    status = Store.open(path).status()
    assert status["points"] == 36
    assert (status["ok"], status["invalid"], status["pending"]) == (24, 12, 0)


def test_another_studys_store_is_refused(tmp_path):
    study, path = mixed(), tmp_path / "study.zarr"
    study.run(store=path)
    other = Study(dataclasses.replace(study.scenario, duration=7.0), study.axes, types=study.types)
    with pytest.raises(HeadwayError, match="is the store of another study"):
        other.run(store=path)
    with pytest.raises(HeadwayError, match="is the store of another study"):
        study.run(["least_gap"], store=path)
    with pytest.raises(HeadwayError, match="pieces already; resume it"):
        study.run(store=path, resume=False)
    (tmp_path / "folder").mkdir()
    for place in ("folder", "nowhere"):
        with pytest.raises(HeadwayError, match="is not a store of a study"):
            open_study(tmp_path / place)
    with pytest.raises(HeadwayError, match="is not a store of a study"):
        study.run(store=tmp_path / "folder")
    with pytest.raises(HeadwayError, match="no/folder does not exist"):
        study.run(store=tmp_path / "no" / "folder" / "x.zarr")


def test_a_disk_that_takes_no_more_is_one_sentence_and_the_rest_can_be_done(tmp_path):
    study, path = mixed(), tmp_path / "study.zarr"
    expected = study.run()
    study.run(store=path, shard=(1, 2), chunk=18)
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    before = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (64, limits[1]))
    try:
        with pytest.raises(HeadwayError, match=r"cannot be written .*it can be resumed"):
            study.run(store=path)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
        signal.signal(signal.SIGXFSZ, before)
    assert Store.open(path).complete() == {0}
    assert study.run(store=path).identical(expected)


def test_a_store_that_cannot_be_made_is_one_sentence_and_leaves_nothing(tmp_path):
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    before = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    try:
        for size in (0, 100, 700):
            resource.setrlimit(resource.RLIMIT_FSIZE, (size, limits[1]))
            with pytest.raises(HeadwayError, match="cannot be written"):
                mixed().run(store=tmp_path / "study.zarr")
            resource.setrlimit(resource.RLIMIT_FSIZE, limits)
            assert list(tmp_path.iterdir()) == []
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
        signal.signal(signal.SIGXFSZ, before)


def test_a_mark_that_cannot_be_written_leaves_nothing_half_written(tmp_path, monkeypatch):
    study, path = mixed(), tmp_path / "study.zarr"
    study.run(store=path, shard=(1, 2), chunk=18)

    def full(*_):
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr("headway.study.store.os.replace", full)
        with pytest.raises(HeadwayError, match=r"No space left on device.*can be resumed"):
            study.run(store=path)
    assert sorted(p.name for p in (path / "complete").iterdir()) == ["0.json", "zarr.json"]
    assert study.run(store=path).identical(study.run())


def test_pieces_of_a_process_that_dies_are_done_again():
    study = mixed()
    expected = study.run()
    dead: list[int] = []

    def kill(done: int, total: int) -> None:
        children = [p for p in multiprocessing.active_children() if p.pid and p.name.startswith("SpawnProcess")]
        if not dead and children and done < total:
            dead.append(children[0].pid or 0)
            os.kill(dead[0], signal.SIGKILL)

    assert study.run(executor="processes", chunk=2, progress=kill).identical(expected)
    assert dead


def test_a_cluster_gives_the_same_bits_also_when_a_worker_is_killed(tmp_path):
    from distributed import Client, LocalCluster

    study = mixed()
    expected = study.run()
    with (
        LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None, silence_logs=50) as cluster,
        Client(cluster) as client,
    ):
        address = cluster.scheduler_address.replace("tcp://", "dask://")
        assert study.run(executor=address, chunk=4).identical(expected)
        workers = list(client.run(os.getpid).values())
        dead: list[int] = []

        def kill(done: int, total: int) -> None:
            if not dead and done < total:
                dead.append(workers[0])
                os.kill(workers[0], signal.SIGKILL)

        found = study.run(executor=client, chunk=2, store=tmp_path / "study.zarr", progress=kill)
        assert dead
        assert found.identical(expected)


def test_a_scheduler_that_does_not_answer_is_one_sentence(monkeypatch):
    monkeypatch.setattr("headway.study.executors._PATIENCE", 1)
    with pytest.raises(HeadwayError, match="no scheduler answers there within 1 s"):
        mixed().run(executor="dask://127.0.0.1:9")


def test_a_law_that_cannot_be_sent_is_one_sentence():
    import headway as hw

    @hw.model
    def local(s, v, dv, *, k: float = 0.2):
        return k * (s - 2.0 - 1.2 * v) + 0.6 * dv

    study = Study(dataclasses.replace(mixed().scenario, followers=[hw.Vehicle(local)]), {"k": [0.1, 0.2]})
    with pytest.raises(HeadwayError, match=r"cannot be sent to other processes .*; use threads"):
        study.run(executor="processes")
    assert (study.run(executor="threads").status == "ok").all()


FILE = """duration = 5
dt = 0.05
[leader]
kind = "sine"
mean = 20
amplitude = 1
omega = 0.5
[[followers]]
model = "idm"
count = 2
[types.truck]
model = "idm"
length = 16
[axes]
T = { from = 1.0, to = 2.0, count = 3 }
share.truck = [0, 0.5]
leader.omega = [0.4, 0.5]
"""


def test_command_line(tmp_path, cli):
    file, store = tmp_path / "study.toml", tmp_path / "study.zarr"
    file.write_text(FILE)
    options = ("--store", store, "--executor", "serial")
    code, out, err = cli("study", file, *options, "--out", tmp_path / "a.nc", "--figure", tmp_path / "a.png", "--json")
    assert (code, err) == (0, "")
    report = json.loads(out)
    assert report["points"] == 12
    assert report["status"] == {"ok": 12}
    assert report["last_vehicle"]["peak_spacing_error"]["unit"] == "m"
    assert (tmp_path / "a.png").stat().st_size > 10_000
    code, out, _ = cli("study", "status", store, "--json")
    assert json.loads(out)["complete"] == json.loads(out)["pieces"]
    assert "no piece is damaged" in cli("study", "status", store, "--check")[1]
    broken = store / "least_gap" / "c" / "3" / "0"
    whole = broken.read_bytes()
    broken.write_bytes(whole[::-1])
    code, out, _ = cli("study", "status", store, "--check", "--json")
    assert json.loads(out)["damaged"] == [3]
    broken.write_bytes(whole)
    assert cli("study", file, *options)[0] == 2
    assert cli("study", file, *options, "--resume")[0] == 0
    code, out, _ = cli("study", file, "--set", "axes.T=[1.0, 99.0]", "--metrics", "rms_gap, least_gap")
    assert "rms_gap" in out
    assert "T = 99 s is out of bounds" in out
    code, out, _ = cli("study", file, "--theory", "--json")
    assert json.loads(out)["last_vehicle"]["margin"]["unit"] == "1/s²"


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--set", "axes.Q=[1]"), "axes.Q names no field"),
        (("--set", "design.kind='sobol'"), "sobol needs count"),
        (("--set", "design.sed=1"), "did you mean 'seed'"),
        (("--set", "design.duration=5"), "design.duration: a field of the scenario with one value stands above"),
        (("--set", "axes.duration=5"), "axes.duration: a field of the scenario with one value stands above"),
        (("--set", "axes.T=5"), "axes.T: 5 is not a list of values"),
        (("--shard", "3of4"), "write the part and how many there are"),
        (("--shard", "1/2"), "needs a store"),
        (("--metrics", "gap"), "metric: 'gap' is not known"),
        (("--theory", "--shard", "1/2"), "needs no --store"),
        (("--out", "x.csv"), "allowed here are files ending in .nc"),
    ],
)
def test_command_line_typed_wrongly(tmp_path, cli, arguments, words):
    file = tmp_path / "study.toml"
    file.write_text(FILE)
    code, out, err = cli("study", file, *arguments)
    assert (code, out) == (2, "")
    assert words in err
    assert err.count("\n") == 1


def test_ctrl_c_says_how_to_go_on(tmp_path, cli, monkeypatch):
    file = tmp_path / "study.toml"
    file.write_text(FILE)

    def interrupt(self, number, piece):
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(Store, "write", interrupt)
        code, _, err = cli("study", file, "--store", tmp_path / "s.zarr")
    assert code == 130
    assert "--resume" in err
    assert cli("study", file, "--store", tmp_path / "s.zarr", "--resume")[0] == 0
