"""Ctrl-C, workers and parents that are killed, clusters that are not there: nothing is lost and nothing stays."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest
from study_cases import mixed

from headway.errors import HeadwayError
from headway.study.document import load_study
from headway.study.store import Store
from headway.study.study import open_study

#: half of the platoons stop, which makes points slow
FILE = """duration = 60
dt = 0.05
[leader]
kind = "brake"
mean = 20
drop = 20
hold = 20
ramp = 4
[[followers]]
model = "idm"
count = 4
[axes]
T = { from = 1.0, to = 2.0, count = 100 }
leader.drop = { from = 10, to = 20, count = 40 }
"""

#: seconds that a machine with other work may take where an idle one takes one
PATIENCE = 6.0


def started(folder: Path, *options: str) -> subprocess.Popen[str]:
    """The command in a session of its own, which hears Ctrl-C as one in a terminal does."""
    (folder / "study.toml").write_text(FILE)
    return subprocess.Popen(
        [sys.executable, "-m", "headway", "study", "study.toml", *options], cwd=folder, text=True,
        stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, start_new_session=True,
    )  # fmt: skip


def left_over(session: int) -> list[int]:
    """Processes of a session that still run."""
    found = []
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = stat.read_text().rpartition(")")[2].split()
        except OSError:
            continue
        if int(fields[3]) == session and fields[0] != "Z":
            found.append(int(stat.parent.name))
    return found


def assert_nothing_stays(session: int) -> None:
    deadline = time.monotonic() + PATIENCE
    while left_over(session) and time.monotonic() < deadline:
        time.sleep(0.05)
    assert left_over(session) == []


def wait_for_pieces(store: Path, count: int, process: subprocess.Popen[str]) -> None:
    while len(list(store.glob("complete/[0-9]*.json"))) < count and process.poll() is None:
        time.sleep(0.01)
    assert process.poll() is None


@pytest.mark.parametrize("executor", ["serial", "threads", "processes"])
@pytest.mark.parametrize("pieces", [0, 2])
def test_ctrl_c_is_obeyed_at_once_and_what_is_done_stays(tmp_path, executor, pieces):
    store = tmp_path / "study.zarr"
    process = started(tmp_path, "--executor", executor, "--store", "study.zarr")
    wait_for_pieces(store, pieces, process)
    if not pieces:
        time.sleep(1.5)
    begin = time.monotonic()
    os.killpg(process.pid, signal.SIGINT)  # a terminal tells all processes of the group
    _, said = process.communicate(timeout=60)
    assert time.monotonic() - begin < PATIENCE
    assert process.returncode == 130
    assert said.count("\n") == 1
    assert said.startswith("headway: interrupted")
    if pieces:
        assert "--resume" in said
        assert pieces <= len(Store.open(store).complete()) < 16
    assert_nothing_stays(process.pid)


def test_an_interrupted_study_ends_with_the_same_bits(tmp_path):
    process = started(tmp_path, "--store", "study.zarr", "--set", "axes.T.count=4", "--set", "duration=30")
    wait_for_pieces(tmp_path / "study.zarr", 1, process)
    process.send_signal(signal.SIGINT)
    assert process.wait(60) == 130
    process.stderr.close()
    (tmp_path / "study.toml").write_text(
        FILE.replace("count = 100", "count = 4").replace("duration = 60", "duration = 30")
    )
    study = load_study(tmp_path / "study.toml")
    expected = study.run()
    assert (open_study(tmp_path / "study.zarr").status == "pending").any()
    assert study.run(store=tmp_path / "study.zarr").identical(expected)


def test_workers_of_a_process_that_is_killed_end_too(tmp_path):
    process = started(tmp_path, "--executor", "processes", "--store", "study.zarr")
    wait_for_pieces(tmp_path / "study.zarr", 1, process)
    assert len(left_over(process.pid)) > 1
    process.kill()
    process.communicate()
    assert_nothing_stays(process.pid)


def test_threads_stop_when_nobody_waits_for_them_any_more(tmp_path):
    (tmp_path / "study.toml").write_text(FILE)

    def interrupt(done: int, total: int) -> None:
        raise KeyboardInterrupt

    before = threading.active_count()
    with pytest.raises(KeyboardInterrupt):
        load_study(tmp_path / "study.toml").run(executor="threads", chunk=40, progress=interrupt)
    deadline = time.monotonic() + PATIENCE
    while threading.active_count() > before and time.monotonic() < deadline:
        time.sleep(0.02)
    assert threading.active_count() == before


@pytest.mark.parametrize(
    ("executor", "words"),
    [("dask://127.0.0.1:9", "no scheduler answers"), ("treads", "did you mean"), ("processes", "cannot be sent")],
)
def test_an_executor_that_cannot_be_had_leaves_no_store(tmp_path, monkeypatch, executor, words):
    monkeypatch.setattr("headway.study.executors._PATIENCE", 1)
    study = mixed()
    metrics = [lambda run: run.speed.max()] if executor == "processes" else None
    with pytest.raises(HeadwayError, match=words):
        study.run(metrics, executor, store=tmp_path / "study.zarr")
    assert list(tmp_path.iterdir()) == []


def test_dask_that_is_not_installed_leaves_no_store(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(HeadwayError, match=r"needs Dask: pip install 'headway\[cluster\]'"):
        mixed().run(executor="dask://127.0.0.1:9", store=tmp_path / "study.zarr")
    assert list(tmp_path.iterdir()) == []
