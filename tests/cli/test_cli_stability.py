"""`headway stability`: what it prints beyond the verdict, and what it must not load."""

from __future__ import annotations

import json
import re
import subprocess
import sys

import pytest


def test_keys(cli):
    code, out, _ = cli("stability", "idm", "--speed", "15", "--set", "v0=33.3", "--json")
    report = json.loads(out)
    assert code == 0
    assert report["impulse_norm"] == pytest.approx(1.034983136, abs=1e-8)
    assert report["peak_stable"] is False
    assert report["propagation"]["kind"] == "absolutely unstable"
    assert report["propagation"]["roadside_growth"] == pytest.approx(0.00132, abs=1e-5)
    assert set(report["margins"]) == {"gain", "gain_frequency", "phase", "phase_frequency", "delay"}
    assert [z["imag"] for z in report["eigenvalues"]] == [0.0, 0.0]


@pytest.mark.parametrize(("arguments", "lines"), [
    (["--delay", "1.5"], [
        "largest peak       a peak of speed can grow 1.59 times per vehicle",
        "along the road     convectively unstable downstream: fastest 0.0663 1/s at 10.4 m/s",
        "margins            gain 1.986, phase 38.13°, delay 1.31484 s",
    ]),
    ([], ["no peak of speed grows from vehicle to vehicle", "along the road     stable", "gain any, phase"]),
    (["--delay", "3"], ["without bound", "along the road     locally unstable", "none, locally unstable"]),
])  # fmt: skip
def test_text(cli, arguments, lines):
    code, out, _ = cli("stability", "idm", "--speed", "23", *arguments)
    assert code == 0
    for line in lines:
        assert line in out


def test_without_a_speed_it_takes_the_documented_one(cli):
    code, out, _ = cli("stability", "idm", "--json")
    assert code == 0
    assert json.loads(out)["speed"] == 23.0
    assert out == cli("stability", "idm", "--speed", "23", "--json")[1]
    help_ = " ".join(cli("stability", "--help")[1].split())
    assert "23 if not given" in re.sub(r"[│╭╮╰╯─ ]+", " ", help_)


def test_it_loads_nothing_heavy():
    program = (
        "import sys\nfrom headway.cli import execute\n"
        "try: execute(['stability', 'idm', '--speed', '23', '--delay', '0.5'])\nexcept SystemExit: pass\n"
        "print([m for m in ('numba', 'xarray', 'matplotlib') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.endswith("[]\n")
    assert done.stdout.startswith("string stable")
