"""The shipped drive cycles have the figures of their regulations."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest
from conftest import shared_file

from headway.data import read
from headway.data.cycles import CYCLES, cycle_file, load_cycle
from headway.errors import HeadwayError

MILE = 1609.344


@pytest.mark.parametrize(("name", "total", "top"), [("wltc3b", 83758.6, 131.3), ("wltc3a", 83496.9, 131.3)])
def test_wltc_sums(name, total, top):
    cycle = load_cycle(name)
    assert cycle.time[-1] == 1800
    assert cycle.speed.size == 1801
    assert (cycle.speed * 3.6).sum() == pytest.approx(total, abs=1e-8)
    assert (cycle.speed * 3.6).max() == pytest.approx(top)


@pytest.mark.parametrize(
    ("name", "miles", "seconds", "top"),
    [("udds", 7.45, 1369, 56.7), ("us06", 8.01, 600, 80.3), ("hwfet", 10.26, 765, 59.9)],
)
def test_epa_distances(name, miles, seconds, top):
    cycle = load_cycle(name)
    assert cycle.time[-1] == seconds
    assert np.trapezoid(cycle.speed, cycle.time) / MILE == pytest.approx(miles, abs=0.005)
    assert cycle.speed.max() / 0.44704 == pytest.approx(top)


def test_us06_ends_within_596_seconds_and_is_padded():
    cycle = load_cycle("us06")
    assert not cycle.speed[596:].any()


@pytest.mark.parametrize("name", CYCLES)
def test_tables_are_regular_and_read_only(name):
    cycle = load_cycle(name)
    assert cycle.name == name
    assert cycle.title
    assert "fastsim" in cycle.source
    assert cycle.time.dtype == cycle.speed.dtype == np.float64
    np.testing.assert_array_equal(cycle.time, np.arange(cycle.time.size))
    assert (cycle.speed >= 0).all()
    assert cycle.speed[0] == cycle.speed[-1] == 0
    assert np.abs(np.diff(cycle.speed)).max() < 4.0
    with pytest.raises(ValueError, match="read-only"):
        cycle.speed[0] = 1.0


@pytest.mark.parametrize("name", CYCLES)
def test_the_general_reader_reads_them_alike(name):
    np.testing.assert_allclose(read(cycle_file(name)).speed[0], load_cycle(name).speed, rtol=1e-15)


@pytest.mark.parametrize(
    ("name", "other"),
    [("wltc3b", "wltc_class3b"), ("wltc3a", "wltc_class3a"), ("udds", "udds"), ("us06", "us06"), ("hwfet", "hwfet")],
)
def test_an_independent_table_agrees(name, other):
    path = shared_file(f"{other}.csv")
    # UDDS and HWFET were converted from mph there with 0.447047 instead of 0.44704, and rounded to 1e-4 m/s.
    np.testing.assert_allclose(load_cycle(name).speed, read(path).speed[0], atol=6e-4)


def test_unknown_cycle():
    with pytest.raises(HeadwayError, match=r"cycle: 'wltc3' is not known; allowed are .*did you mean 'wltc3"):
        load_cycle("wltc3")


def test_the_notice_is_beside_the_tables():
    folder = cycle_file("udds").parent
    assert "Alliance for Sustainable Energy" in (folder / "NOTICE").read_text(encoding="utf-8")
    assert "Apache License" in (folder / "LICENSE-APACHE-2.0.txt").read_text(encoding="utf-8")


def test_importing_cycles_needs_numpy_only():
    code = (
        "import sys, headway.data.cycles as c; c.load_cycle('udds');"
        "print([m for m in ('pandas', 'xarray', 'pooch', 'scipy', 'numba') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
