"""Stores that are damaged: whatever happens to a file, no other numbers come out and nothing leaks."""

from __future__ import annotations

import json
import shutil
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from study_cases import mixed

from headway.errors import HeadwayError, HeadwayWarning
from headway.study.store import Store
from headway.study.study import Study, open_study

METRICS = ("least_gap", "speed_amplitude")

Damage = Callable[[Path, Path], object]


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> tuple[Study, xr.Dataset, Path, Path]:
    """A study, its answer, its store of nine pieces, and the store of another study with the same shapes."""
    folder = tmp_path_factory.mktemp("stores")
    study, path, other = mixed(), folder / "study.zarr", folder / "other.zarr"
    expected = study.run(METRICS, store=path, chunk=4)
    axes = {**study.axes, "seed": [7, 8, 9]}
    Study(study.scenario, axes, types=study.types).run(METRICS, store=other, chunk=4)
    return study, expected, path, other


#: files of a store: a piece of a metric by vehicle, of the status, an axis, a mark, and everything that describes
FILES = {
    "metric": "least_gap/c/2/0",
    "status": "status/c/3",
    "axis": "T/c/0",
    "mark": "complete/2.json",
    "description": "complete/zarr.json",
    "metric's description": "least_gap/zarr.json",
    "status' description": "status/zarr.json",
    "axis' description": "T/zarr.json",
    "root": "zarr.json",
}

#: what a program that is no headway may leave in a file of JSON
GARBAGE = [b"", b"\xff\x00\xfe", b"null", b"1", b"[]", b"{}", b'""', b"[" * 20_000, b'{"attributes": 3}', b"\xc3"]


def flipped(path: Path, share: float, bit: int) -> None:
    data = bytearray(path.read_bytes())
    data[int(share * (len(data) - 1))] ^= 1 << bit
    path.write_bytes(bytes(data))


def swapped(path: Path, one: str, two: str) -> None:
    a, b = (path / one).read_bytes(), (path / two).read_bytes()
    assert a != b
    (path / one).write_bytes(b)
    (path / two).write_bytes(a)


def replaced_by_folder(path: Path) -> None:
    path.unlink()
    path.mkdir()


def changed(path: Path, key: str, value: object) -> None:
    path.write_text(json.dumps({**json.loads(path.read_text()), key: value}))


def damages() -> Iterator[tuple[str, Damage]]:
    for name, file in FILES.items():
        for share in np.linspace(0.0, 1.0, 5):
            for bit in (0, 5):
                yield f"{name}: bit {bit} at {share:.2f}", lambda s, o, f=file, x=share, b=bit: flipped(s / f, x, b)
        for share in (0.0, 0.4, 0.9):
            yield (
                f"{name}: cut at {share}",
                lambda s, o, f=file, x=share: (s / f).write_bytes(
                    (s / f).read_bytes()[: int(x * (s / f).stat().st_size)]
                ),
            )
        for number, garbage in enumerate(GARBAGE if file.endswith("json") else GARBAGE[:3]):
            yield f"{name}: garbage {number}", lambda s, o, f=file, g=garbage: (s / f).write_bytes(g)
        yield f"{name}: longer", lambda s, o, f=file: (s / f).write_bytes((s / f).read_bytes() + b"\0\0")
        yield f"{name}: removed", lambda s, o, f=file: (s / f).unlink()
        yield f"{name}: a folder", lambda s, o, f=file: replaced_by_folder(s / f)
        yield f"{name}: of another study", lambda s, o, f=file: shutil.copy(o / f, s / f)
    for one, two in (
        ("least_gap/c/2/0", "least_gap/c/7/0"), ("status/c/0", "status/c/3"), ("complete/0.json", "complete/1.json"),
        ("least_gap/c/2/0", "speed_amplitude/c/2/0"), ("least_gap/zarr.json", "status/zarr.json"),
    ):  # fmt: skip
        yield f"{one} and {two} swapped", lambda s, o, a=one, b=two: swapped(s, a, b)
    for folder in ("complete", "least_gap", "least_gap/c", "status", "T"):
        yield f"{folder} removed", lambda s, o, f=folder: shutil.rmtree(s / f)
    for key, value in (
        ("shape", [35, 5]), ("shape", [36]), ("shape", [36, 6]), ("shape", "36"), ("data_type", "float32"),
        ("data_type", "int64"), ("data_type", None), ("fill_value", 0.0), ("zarr_format", 2), ("node_type", "group"),
        ("codecs", []), ("chunk_grid", {"name": "regular", "configuration": {"chunk_shape": [9, 5]}}),
        ("chunk_key_encoding", {"name": "default", "configuration": {"separator": "."}}),
    ):  # fmt: skip
        yield f"{key} {value}", lambda s, o, k=key, v=value: changed(s / "least_gap/zarr.json", k, v)
    yield "all marks removed", lambda s, o: [p.unlink() for p in s.glob("complete/[0-9].json")]
    yield (
        "marks of pieces that are none",
        lambda s, o: [
            (s / "complete" / n).write_text("{}") for n in ("99.json", "x.json", "-1.json", "2.json~", "².json")
        ],
    )
    yield "a file of somebody else", lambda s, o: (s / ".DS_Store").write_bytes(b"\0\1")


DAMAGES = dict(damages())


def outcome(work: Callable[[], xr.Dataset]) -> xr.Dataset | None:
    """What it gives; None where it refuses, in one sentence."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", HeadwayWarning)
        try:
            return work()
        except HeadwayError as error:
            sentence = str(error)
    assert 20 < len(sentence) <= 300
    assert "\n" not in sentence
    return None


def test_every_kind_of_damage_is_refused_or_computed_anew_to_the_same_bits(whole, tmp_path):
    study, expected, path, other = whole
    refused = mended = opened = 0
    for name, damage in DAMAGES.items():
        store = tmp_path / "damaged.zarr"
        shutil.copytree(path, store)
        damage(store, other)
        status = outcome(lambda s=store: Store.open(s).status())
        assert status is None or status["complete"] <= 9, name
        before = outcome(lambda s=store: open_study(s))
        if before is not None:
            done = before.status.values != "pending"
            for metric in ("status", "message", *METRICS):
                np.testing.assert_array_equal(before[metric].values[done], expected[metric].values[done], err_msg=name)
            opened += 1
        after = outcome(lambda s=store: study.run(METRICS, store=s))
        if after is None:
            refused += 1
        else:
            assert after.identical(expected), name
            mended += 1
            again = outcome(lambda s=store: open_study(s))
            assert again is None or again.identical(expected), name
        shutil.rmtree(store)
    assert refused + mended == len(DAMAGES) > 220
    assert min(refused, mended, opened) > 30


def test_what_is_damaged_is_said_and_only_that_is_computed_anew(whole, tmp_path):
    study, expected, path, _ = whole
    store = tmp_path / "study.zarr"
    shutil.copytree(path, store)
    swapped(store, "least_gap/c/2/0", "least_gap/c/7/0")
    with pytest.raises(HeadwayError, match=r"2 of 9 pieces damaged \(2, 7\); run the study again"):
        open_study(store)
    done: list[int] = []
    with pytest.warns(HeadwayWarning, match=r"2 of 9 pieces damaged \(2, 7\), now computed anew"):
        assert study.run(METRICS, store=store, progress=lambda ready, _: done.append(ready)).identical(expected)
    assert done == [28, 32, 36]
    assert open_study(store).identical(expected)


def test_a_shard_does_not_mend_or_believe_what_is_damaged_elsewhere(whole, tmp_path):
    study, expected, path, _ = whole
    store = tmp_path / "study.zarr"
    shutil.copytree(path, store)
    flipped(store / "least_gap/c/1/0", 0.5, 2)
    with pytest.warns(HeadwayWarning, match=r"1 of 9 pieces damaged \(1\), not done here and pending"):
        found = study.run(METRICS, store=store, shard=(1, 3))
    assert (found.status == "pending").sum() == 4
    with pytest.warns(HeadwayWarning, match="computed anew"):
        assert study.run(METRICS, store=store, shard=(2, 3)).identical(expected)


def test_every_reader_of_zarr_opens_a_store_and_notices_a_broken_chunk(whole, tmp_path):
    study, expected, path, _ = whole
    store = tmp_path / "study.zarr"
    shutil.copytree(path, store)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for options in ({}, {"consolidated": False}):
            found = xr.open_zarr(store, **options)
            assert found.sizes["point"] == 36
            np.testing.assert_array_equal(found["T"], study.points.values["T"])
            np.testing.assert_array_equal(found.least_gap, expected.least_gap.values.reshape(36, -1))
            assert found.least_gap.attrs["units"] == "m"
        assert list(found.attrs["dimensions"]) == list(expected.status.dims)
        assert found.status.values.reshape(found.attrs["shape"]).shape == expected.status.shape
    flipped(store / "least_gap/c/2/0", 0.5, 1)
    with pytest.raises(ValueError, match="checksum"):
        xr.open_zarr(store).load()


@pytest.mark.parametrize("name", ["a/b", "ä b", "%2F", "__x"])
def test_axes_of_any_name_can_be_stored(tmp_path, name):
    base = mixed()
    study = Study(base.scenario, {f"share.{name}": [0.0, 0.5]}, types={name: base.types["truck"]})
    expected = study.run(METRICS)
    assert study.run(METRICS, store=tmp_path / "study.zarr").identical(expected)
    assert open_study(tmp_path / "study.zarr").identical(expected)
