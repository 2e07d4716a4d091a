"""The browser is found or installed before the page is tested; where it cannot be, one sentence says why."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

TOOL = Path(__file__).resolve().parents[2] / "tools" / "chromium.py"

#: what stands in for playwright: its own browser is where it is not
PLAYWRIGHT = """
import contextlib, types
@contextlib.contextmanager
def sync_playwright():
    yield types.SimpleNamespace(chromium=types.SimpleNamespace(executable_path="/nowhere/chrome"))
"""


@pytest.fixture
def machine(tmp_path):
    """A machine with the programs that are put into its folder `bin`, and a way to run the tool on it."""
    programs = tmp_path / "bin"
    programs.mkdir()
    (tmp_path / "lib" / "playwright").mkdir(parents=True)
    (tmp_path / "lib" / "playwright" / "__init__.py").write_text("")
    (tmp_path / "lib" / "playwright" / "sync_api.py").write_text(PLAYWRIGHT)

    def put(name: str, text: str) -> None:
        (programs / name).write_text(f"#!/bin/sh\nPATH=/usr/bin:/bin\n{text}\n")
        (programs / name).chmod(0o755)

    def run(user: int = 0) -> tuple[int, str, str]:
        start = f"import os, runpy; os.geteuid = lambda: {user}; runpy.run_path({str(TOOL)!r}, run_name='__main__')"
        env = {**os.environ, "PATH": str(programs), "PYTHONPATH": str(tmp_path / "lib")}
        done = subprocess.run([sys.executable, "-c", start], env=env, capture_output=True, text=True)
        return done.returncode, done.stdout, done.stderr

    return programs, put, run


def test_one_that_is_there_is_taken(machine):
    programs, put, run = machine
    put("chromium-browser", "")
    put("apt-get", "exit 9")
    assert run() == (0, f"{programs}/chromium-browser\n", "")


@pytest.mark.parametrize("user", [0, 1000])
def test_one_that_is_missing_is_installed(machine, user):
    programs, put, run = machine
    put("apt-get", f'echo "$@" >> {programs}/log; [ "$1" = update ] || cp {programs}/apt-get {programs}/chromium')
    if user:
        put("sudo", f'[ "$1" = -n ] || exit 1; shift; [ "$1" = true ] || {programs}/"$@"')
    assert run(user) == (0, f"{programs}/chromium\n", "")
    update, install = (programs / "log").read_text().splitlines()
    assert update.startswith("update")
    assert install.startswith("install")
    assert install.endswith("chromium")


@pytest.mark.parametrize(
    ("program", "user", "reason"),
    [
        (None, 0, "this machine has no apt-get"),
        ("apt-get", 1000, "apt-get needs root, or sudo without a password"),
        ("sudo", 1000, "apt-get needs root, or sudo without a password"),
        ("broken", 0, "apt-get update failed: no such host"),
        ("idle", 0, "it is not found although it was installed"),
    ],
)
def test_where_it_cannot_be_one_sentence_says_why(machine, program, user, reason):
    _, put, run = machine
    if program is not None:
        put("apt-get", "echo reading; echo no such host >&2; exit 100" if program == "broken" else "")
    if program == "sudo":
        put("sudo", "exit 1")
    code, out, err = run(user)
    assert (code, out) == (1, "")
    assert err == (
        f"no Chromium ({reason}); install one of chromium, chromium-browser, google-chrome to test the page\n"
    )
