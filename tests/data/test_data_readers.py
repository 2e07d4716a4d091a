"""Readers: formats, units, positions rebuilt from gaps, and one sentence for every bad file."""

from __future__ import annotations

import dataclasses
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from conftest import shared_file

from headway.data import Recording, read
from headway.data.ngsim import COLUMNS
from headway.errors import HeadwayError

TIDY = """time_s,vehicle,speed_mps,gap_m
0.0,0,10.0,
0.1,0,10.0,
0.2,0,11.0,
0.0,1,10.0,20.0
0.1,1,10.0,20.0
0.2,1,10.0,20.05
"""


@pytest.fixture
def put(tmp_path):
    """Write a small file and return its path."""

    def write(text: str | bytes, name: str = "run.csv") -> Path:
        path = tmp_path / name
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return path

    return write


def ngsim_table(frames: range = range(100, 110), *, change_at: int | None = None) -> str:
    """Vehicles 7 (leader) -> 5 -> 9 in NGSIM's layout: 40 ft/s, headways 60 ft, lengths 15, 20 and 16 ft."""
    rows = [",".join(COLUMNS)]
    for frame in frames:
        for k, (vehicle, length, ahead) in enumerate(((7, 15, 0), (5, 20, 7), (9, 16, 5))):
            if change_at is not None and vehicle == 9 and frame >= change_at:
                ahead = 7
            y = 500 + 4 * (frame - 100) - 60 * k
            cells = [vehicle, frame, 10, 1_118_846_980_200 + 100 * frame, 16.4, y, 0, 0, length, 6, 2, 40, 0, 2, ahead]
            rows.append(",".join(map(str, [*cells, 0, 60 if ahead else 0, 1.5 if ahead else 0])))
    return "\n".join(rows) + "\n"


# -- what is read -----------------------------------------------------------------------------------------------------


def test_tidy_positions_are_rebuilt_from_gaps(put):
    recording = read(put(TIDY), length=4.0)
    assert recording.vehicles == 2
    assert recording.lengths == (4.0, 4.0)
    np.testing.assert_allclose(recording.position[0], [0.0, 1.0, 2.05])
    np.testing.assert_allclose(recording.position[1], recording.position[0] - 4.0 - recording.gap[1])
    assert np.isnan(recording.gap[0]).all()
    assert any("4 m for every vehicle" in note for note in recording.notes)


def test_arrays_are_read_only_and_the_caller_keeps_his(put):
    recording = read(put(TIDY))
    with pytest.raises(ValueError, match="read-only"):
        recording.speed[0, 0] = 1.0
    with pytest.raises(dataclasses.FrozenInstanceError):
        recording.source = "x"
    mine = np.arange(3.0)
    Recording.from_gaps(mine, np.ones((1, 3)), np.full((1, 3), np.nan))
    mine[0] = -1.0


def test_column_mapping_and_units(put):
    text = "t;id;v;d\n0;A;36;\n100;A;36;\n0;B;18;100\n100;B;18;101\n"
    recording = read(
        put(text),
        columns={"time": "t", "vehicle": "id", "speed": "v", "gap": "d"},
        units={"time": "ms", "speed": "km/h", "gap": "ft"},
    )
    np.testing.assert_array_equal(recording.time, [0.0, 0.1])
    np.testing.assert_array_equal(recording.speed, [[10.0, 10.0], [5.0, 5.0]])
    np.testing.assert_allclose(recording.gap[1], [30.48, 30.7848])
    assert recording.names == ("A", "B")


def test_rows_may_be_interleaved_and_ids_are_ascending(put):
    text = "time_s,vehicle,speed_mps,gap_m\n0,12,9,8\n0,3,10,\n1,12,9,9\n1,3,10,\n"
    recording = read(put(text))
    assert recording.names == ("3", "12")
    np.testing.assert_array_equal(recording.gap[1], [8, 9])
    assert "Vehicle order, leader first: 3, 12." in recording.notes


def test_missing_stays_nan_and_nothing_behind_it_has_a_position(put):
    text = "time_s,vehicle,speed_mps,gap_m\n0,0,9,\n1,0,9,\n0,1,9,5\n1,1,9,\n0,2,,6\n1,2,9,6\n"
    recording = read(put(text))
    assert np.isnan(recording.gap[1, 1])
    assert np.isnan(recording.speed[2, 0])
    assert np.isnan(recording.position[1:, 1]).all()
    assert np.isfinite(recording.position[:, 0]).all()


def test_absent_rows_are_nan_and_said(put):
    text = "time_s,vehicle,speed_mps,gap_m\n0,0,9,\n1,0,9,\n2,0,9,\n1,1,9,5\n2,1,9,5\n"
    recording = read(put(text))
    assert np.isnan(recording.gap[1, 0])
    assert np.isnan(recording.speed[1, 0])
    assert any("1 rows are absent" in note for note in recording.notes)


def test_gaps_from_positions_where_there_are_no_gaps(put):
    text = "time_s,vehicle,speed_mps,position_m\n0,0,9,30\n1,0,9,39\n0,1,9,5\n1,1,9,15\n"
    recording = read(put(text), length=(4.0, 6.0))
    np.testing.assert_allclose(recording.gap[1], [21.0, 20.0])
    np.testing.assert_allclose(recording.position, [[30, 39], [5, 15]])
    assert any("differences of its positions" in note for note in recording.notes)


def test_given_leader_position_is_kept_and_a_disagreement_is_said(put):
    text = "time_s,vehicle,speed_mps,position_m,gap_m\n0,0,9,30,\n1,0,9,40,\n0,1,9,5,20\n1,1,9,15,22\n"
    recording = read(put(text))
    np.testing.assert_allclose(recording.position, [[30, 40], [5, 13]])
    assert any("differ from those in the file by up to 2 m" in note for note in recording.notes)


def test_drive_cycle_file_of_one_vehicle(put):
    recording = read(put("\ufefftime_s,speed_kmh\n0,0\n1,36\n2,72\n"))
    assert recording.vehicles == 1
    np.testing.assert_array_equal(recording.speed, [[0, 10, 20]])
    np.testing.assert_array_equal(recording.position, [[0, 5, 20]])


def test_parquet(tmp_path, put):
    frame = pd.read_csv(put(TIDY))
    frame.to_parquet(tmp_path / "run.parquet")
    np.testing.assert_array_equal(read(tmp_path / "run.parquet").gap, read(put(TIDY)).gap)
    frame["time_s"] = pd.to_datetime(frame["time_s"], unit="s")
    frame.to_parquet(tmp_path / "dates.parquet")
    with pytest.raises(HeadwayError, match=r"dates.parquet: column 'time_s' holds datetime64"):
        read(tmp_path / "dates.parquet")


def test_openacc_without_and_with_header(put):
    table = "Time,Speed1,Speed2,IVS1\n1,10,9,5\n1.1,10,9.5,5.1\n"
    plain = read(put(table))
    np.testing.assert_array_equal(plain.speed, [[10, 10], [9, 9.5]])
    np.testing.assert_array_equal(plain.gap[1], [5, 5.1])
    header = "Date,8,10,2019\r\nVehicle_order,AUDI,BMW,\r\nNumber_of_vehicles,2\r\nACC,1\r\nDistance_setting,S\r\n"
    named = read(put(header + table))
    assert named.names == ("AUDI", "BMW")
    assert any("Distance_setting S" in note for note in named.notes)
    np.testing.assert_array_equal(named.gap, plain.gap)
    extra = read(put(header.replace("BMW", "BMW,VW") + table))
    assert extra.names == ("vehicle 0", "vehicle 1")
    assert any("3 names for 2 vehicles" in n for n in extra.notes)


def test_units_apply_to_openacc_too(put):
    table = "Time,Speed1,Speed2,IVS1\n1,108,90,5\n1.1,108,90,5.1\n"
    np.testing.assert_array_equal(read(put(table), units={"speed": "km/h"}).speed[:, 0], [30, 25])


def test_ngsim_builds_the_string_in_metres(put):
    recording = read(put(ngsim_table()), vehicle=9)
    assert recording.names == ("7", "5", "9")
    np.testing.assert_allclose(recording.gap[1:, 0], [(60 - 15) * 0.3048, (60 - 20) * 0.3048])
    np.testing.assert_allclose(recording.speed, 40 * 0.3048)
    np.testing.assert_allclose(recording.lengths, np.array([15, 20, 16]) * 0.3048)
    np.testing.assert_allclose(recording.position[:, 0], np.array([500, 440, 380]) * 0.3048)
    np.testing.assert_allclose(recording.time, np.arange(100, 110) / 10)
    assert read(put(ngsim_table()), vehicle=9, followers=1).names == ("5", "9")


def test_ngsim_headerless_and_other_spellings(put):
    lines = ngsim_table().splitlines()
    bare = "\n".join(line.replace(",", "   ") for line in lines[1:]) + "\n"
    wanted = read(put(ngsim_table()), vehicle=9)
    np.testing.assert_array_equal(read(put(bare, "trajectories.txt"), vehicle=9).gap, wanted.gap)
    other = lines[0].lower().replace("space_headway", "Space_Hdwy") + "\n" + "\n".join(lines[1:])
    np.testing.assert_array_equal(read(put(other), vehicle=9).gap, wanted.gap)


def test_ngsim_says_where_the_vehicle_ahead_changes(put):
    recording = read(put(ngsim_table(change_at=107)), vehicle=9)
    assert recording.names == ("7", "5", "9")
    assert recording.time.size == 7
    assert any("the vehicle ahead of 9 is 7 and not 5 in frame 107" in note for note in recording.notes)


# -- what a recording can do ------------------------------------------------------------------------------------------


def test_between_from_zero_and_resampled(put):
    recording = read(put(TIDY))
    cut = recording.between(0.1, 0.2)
    np.testing.assert_allclose(cut.time, [0.1, 0.2])
    np.testing.assert_allclose(cut.from_zero().time, [0.0, 0.1])
    assert recording.from_zero() is recording
    fine = recording.resampled(0.05)
    np.testing.assert_allclose(fine.gap[1], [20, 20, 20, 20.025, 20.05])
    np.testing.assert_allclose(fine.position[1], fine.position[0] - 5 - fine.gap[1])
    assert "linear interpolation" in fine.notes[-1]


def test_resampling_at_the_recorded_times_loses_no_sample_beside_a_hole():
    time = 0.1 * np.arange(8)
    gap = np.full((2, 8), 10.0)
    gap[1, 3] = np.nan
    recording = Recording.from_gaps(time, np.ones((2, 8)), gap)
    assert np.isnan(recording.resampled(0.1).gap[1]).tolist() == [False] * 3 + [True] + [False] * 4


@pytest.mark.parametrize("call", [("between", 5, 6), ("between", 1, 0), ("resampled", 0), ("resampled", -1)])
def test_bad_cuts_and_steps(put, call):
    name, *arguments = call
    with pytest.raises(HeadwayError, match=r"is not allowed|at least two are"):
        getattr(read(put(TIDY)), name)(*arguments)


@pytest.mark.parametrize("step", [float("nan"), float("inf"), 1e-12, 7.0])
def test_steps_that_make_no_sense(put, step):
    with pytest.raises(HeadwayError, match=r"up to the recording's length of 0\.2 s"):
        read(put(TIDY)).resampled(step)


def test_dataset_has_names_units_and_signs(put):
    dataset = read(put(TIDY)).to_dataset()
    assert dataset.speed.dims == ("vehicle", "time")
    assert {"position", "speed", "acceleration", "gap", "relative_speed"} == set(dataset.data_vars)
    np.testing.assert_allclose(dataset.relative_speed[1], [0, 0, 1])
    np.testing.assert_allclose(dataset.acceleration[0], [0, 5, 10])
    assert dataset.acceleration.attrs["units"] == "m/s²"
    assert "central" in dataset.acceleration.attrs["long_name"]
    assert all("units" in dataset[name].attrs and "long_name" in dataset[name].attrs for name in dataset.data_vars)


def test_dataset_survives_netcdf(put, tmp_path):
    dataset = read(put(TIDY)).to_dataset()
    dataset.to_netcdf(tmp_path / "run.nc", engine="h5netcdf")
    with xr.open_dataset(tmp_path / "run.nc", engine="h5netcdf") as back:
        np.testing.assert_array_equal(back.gap, dataset.gap)


def test_importing_the_readers_is_light():
    code = "import sys, headway.data; print([m for m in ('pandas', 'xarray', 'pooch', 'scipy') if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


# -- bad input --------------------------------------------------------------------------------------------------------

HEAD = "time_s,vehicle,speed_mps,gap_m\n"
COLS = {"time": "t", "speed": "v"}

BAD = {
    "empty": ("", {}, r"run.csv: the file is empty"),
    "blank": ("\n \n", {}, r"the file is empty"),
    "binary": (b"\x00\x01\x02\xff" * 50, {}, r"binary or not UTF-8"),
    "latin-1": ("time_s,speed_mps,Straße\n".encode("latin-1"), {}, r"binary or not UTF-8"),
    "header only": (HEAD, {}, r"column names but no rows"),
    "unknown layout": ("a,b\n1,2\n", {}, r"format is not known from its first line, 'a, b'; known are tidy"),
    "unknown format": (TIDY, {"format": "opnacc-astazero"}, r"did you mean 'openacc-astazero'"),
    "word in a cell": (HEAD + "0,0,1,\n1,0,fast,\n", {}, r"line 3, column 'speed_mps': 'fast' is not a finite number"),
    "infinite": (HEAD + "0,0,1,\n1,0,1,\n0,1,1,inf\n", {}, r"line 4, column 'gap_m': inf is not a finite"),
    "no time": (HEAD + "0,0,1,\n,0,1,\n", {}, r"line 3, column 'time_s': an empty cell"),
    "no vehicle": (HEAD + "0,0,1,\n1,,1,\n", {}, r"line 3, column 'vehicle': an empty cell"),
    "unsorted": (HEAD + "0,0,1,\n2,0,1,\n1,0,1,\n", {}, r"line 4: time 1 s of|line 4: time 1 s comes after 2 s"),
    "time twice": (HEAD + "0,0,1,\n1,0,1,\n1,0,2,\n", {}, r"line 4: time 1 s is there twice"),
    "time twice of one": (HEAD + "0,0,1,\n0,1,1,5\n0,1,1,5\n", {}, r"line 4: time 0 s of vehicle 1 is there twice"),
    "one sample": (HEAD + "0,0,1,\n", {}, r"one time only"),
    "km/h": (HEAD + "0,0,90,\n1,0,91,\n", {}, r"91 m/s, which looks like km/h; say units=\{'speed': 'km/h'\}"),
    "ms": (HEAD + "0,0,9,\n100,0,9,\n", {}, r"looks like milliseconds; say units=\{'time': 'ms'\}"),
    "no speeds": (HEAD + "0,0,,\n1,0,,\n", {}, r"no speed in any row"),
    "no gaps": ("time_s,vehicle,speed_mps\n0,0,1\n1,0,1\n0,1,1\n1,1,1\n", {}, r"neither gaps nor positions"),
    "different times": (
        HEAD + "".join(f"{k},0,1,\n{k + 0.5},1,1,5\n" for k in range(9)),
        {},
        r"not sampled at common times",
    ),
    "row too long": (HEAD + "0,0,1,\n1,0,1,,,,8\n", {}, r"rows do not fit the header"),
    "column twice": ("time_s,speed_mps,speed_mps\n0,1,1\n1,1,1\n", {}, r"names the column 'speed_mps' more than once"),
    "mapped column absent": ("t,v\n0,1\n1,1\n", {"columns": {"time": "t", "speed": "vv"}}, r"did you mean 'v'"),
    "mapping of nothing": (
        "t,v\n0,1\n1,1\n",
        {"columns": {**COLS, "sped": "v"}},
        r"columns: 'sped'.*did you mean 'speed'",
    ),
    "mapping lacks speed": ("t,v\n0,1\n1,1\n", {"columns": {"time": "t"}}, r"no column for speed; known names are"),
    "unknown unit": (TIDY, {"units": {"speed": "kmh"}}, r"units\['speed'\]: 'kmh'.*did you mean 'km/h'"),
    "unit of nothing": (TIDY, {"units": {"velocity": "m/s"}}, r"units: 'velocity' is not known; allowed are gap"),
    "length zero": (TIDY, {"length": 0.0}, r"length 0.0 is not allowed"),
    "lengths too many": (TIDY, {"length": (4.0, 5.0, 6.0)}, r"each of the 2 vehicles"),
    "length a word": (TIDY, {"length": "long"}, r"length needs a number or a list, each a number, not 'long'"),
    "vehicle= for tidy": (TIDY, {"vehicle": 3}, r"belong to the format 'ngsim', and this is 'tidy'"),
    "openacc, no spacing": ("Time,Speed1,Speed2\n1,1,1\n2,1,1\n", {}, r"there is no column 'IVS1'"),
    "openacc, as told": (TIDY, {"format": "openacc-astazero"}, r"there is no column 'Time'.*did you mean 'time_s'"),
    "openacc, columns=": ("Time,Speed1\n1,1\n2,1\n", {"format": "openacc-astazero", "columns": COLS}, r"belongs to"),
    "openacc, unsorted": ("Time,Speed1\n2,1\n1,1\n", {}, r"line 3: time 1 s comes after 2 s"),
    "openacc, one sample": ("Time,Speed1\n2,1\n", {}, r"one time only"),
    "openacc, km/h": ("Time,Speed1\n1,88\n2,88\n", {}, r"looks like km/h"),
    "openacc, count": ("Number_of_vehicles,3\nTime,Speed1\n1,8\n2,8\n", {}, r"is '3' and there are 1 columns"),
    "openacc, word": (
        "Date,1\nTime,Speed1\n1,8\n2,?\n",
        {},
        r"line 4, column 'Speed1': '\?' is not a finite number",
    ),
    "ngsim, no vehicle": (ngsim_table(), {}, r"say which with vehicle="),
    "ngsim, other vehicle": (ngsim_table(), {"vehicle": 8}, r"vehicle 8 is not in the file, which has 3 from 5 to 9"),
    "ngsim, leader": (ngsim_table(), {"vehicle": 7}, r"vehicle 7 has no vehicle ahead"),
    "ngsim, followers": (ngsim_table(), {"vehicle": 9, "followers": 0}, r"followers: 0 is not allowed"),
    "ngsim, time unit": (ngsim_table(), {"vehicle": 9, "units": {"time": "s"}}, r"units: 'time' is not known"),
    "ngsim, twice": (ngsim_table() + ngsim_table().splitlines()[1] + "\n", {"vehicle": 9}, r"twice in frame 100"),
    "ngsim, lacks a column": (
        ngsim_table().replace("Preceding", "Before"),
        {"vehicle": 9, "format": "ngsim"},
        r"there is no column 'Preceding'",
    ),
    "ngsim, half an id": (
        ngsim_table().replace("\n9,101", "\n9.5,101"),
        {"vehicle": 9},
        r"line 7, column 'Vehicle_ID': 9.5 is not a whole number",
    ),
    "vast": (HEAD + "0,0,1,\n1,0,1e300,\n", {}, r"line 3, column 'speed_mps': 1e\+300 is beyond"),
    "not Parquet": (b"PAR1 and then nothing", {}, r"Parquet file cannot be read"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_input_ends_in_one_sentence(put, case):
    content, options, message = BAD[case]
    with pytest.raises(HeadwayError, match=message) as caught:
        read(put(content), **options)
    assert "\n" not in str(caught.value)
    assert "Traceback" not in str(caught.value)


def test_missing_file_and_folder(tmp_path, put):
    put(TIDY, "platoon.csv")
    with pytest.raises(HeadwayError, match=r"no such file; did you mean 'platoon.csv'"):
        read(tmp_path / "platon.csv")
    with pytest.raises(HeadwayError, match="cannot be read"):
        read(tmp_path)


def test_a_stated_unit_is_believed(put):
    fast = put(HEAD + "0,0,90,\n1,0,91,\n")
    assert read(fast, units={"speed": "m/s"}).speed.max() == 91
    slow = put(HEAD + "0,0,9,\n60,0,9,\n")
    assert read(slow, units={"time": "s"}).time[-1] == 60


def test_a_recording_whose_shapes_disagree():
    with pytest.raises(HeadwayError, match=r"gap has shape \(1, 3\); \(vehicles, times\) = \(2, 3\)"):
        Recording(np.arange(3.0), np.ones((2, 3)), np.ones((1, 3)), np.ones((2, 3)), ("a", "b"), (5.0, 5.0), "mine")


# -- the recordings themselves ----------------------------------------------------------------------------------------


def test_astazero_as_published():
    recording = read(shared_file("raw/astazero_data_example.csv"))
    assert recording.vehicles == 5
    assert recording.time.size == 19840
    assert recording.speed.max() < 30
    assert np.nanmin(recording.gap) > 2.5
    tidy = read(shared_file("openacc_asta_acc_short_p1.csv"))  # cut out of it at 1151 s and rounded to mm
    part = slice(11500, 11500 + tidy.time.size)
    np.testing.assert_allclose(recording.gap[1:, part], tidy.gap[1:], atol=6e-4)
    np.testing.assert_allclose(recording.speed[:, part], tidy.speed, atol=6e-4)


def test_zalazone_as_published():
    recording = read(shared_file("raw/zalazone_short_dynamic_part4.csv"))
    assert recording.vehicles == 11
    assert recording.names[:2] == ("SMART_TARGET", "MERCEDES_GLE450")
    tidy = read(shared_file("openacc_zala_acc_short_11veh_p4.csv"))
    np.testing.assert_allclose(recording.gap[1:, : tidy.time.size], tidy.gap[1:], atol=6e-4)
    np.testing.assert_allclose(recording.speed[:, : tidy.time.size], tidy.speed, atol=6e-4)
    assert np.isnan(recording.gap[10]).sum() == 6


def test_zalazone_spacing_is_antenna_distance_less_a_constant():
    """That the reader may take IVS as bumper to bumper: E and N are the antennas' coordinates."""
    table = pd.read_csv(shared_file("raw/zalazone_short_dynamic_part4.csv"), skiprows=5)
    for n in range(1, 11):
        antennas = np.hypot(table[f"E{n}"] - table[f"E{n + 1}"], table[f"N{n}"] - table[f"N{n + 1}"])
        offset = (antennas - table[f"IVS{n}"]).dropna()
        assert np.ptp(offset) < 1e-6
        assert 3.0 < offset.mean() < 5.5
