"""The order of the package: what its own files may take from where, and that its public names are really there."""

from __future__ import annotations

import ast
import importlib
import re
from pathlib import Path

import pytest

import headway

PACKAGE = Path(__file__).resolve().parents[2] / "src" / "headway"
FILES = sorted(PACKAGE.rglob("*.py"))


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_no_room_imports_the_front_door(path):
    """The package itself loads every room, so a room that imports it closes a circle; a folder in it is no circle."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            assert all(alias.name != "headway" for alias in node.names), f"line {node.lineno}: import headway"
        if isinstance(node, ast.ImportFrom) and node.module == "headway":
            for alias in node.names:
                here = (PACKAGE / alias.name).is_dir() or (PACKAGE / f"{alias.name}.py").is_file()
                assert here, f"line {node.lineno}: from headway import {alias.name}"


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_no_code_reads_the_words_of_an_error(path):
    """What code must tell apart has a type in headway.errors; a sentence may be improved at any time."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Compare) and any(isinstance(op, ast.In | ast.NotIn | ast.Eq) for op in node.ops):
            for side in (node.left, *node.comparators):
                words = isinstance(side, ast.Call) and ast.unparse(side) in ("str(error)", "repr(error)")
                assert not words, f"line {node.lineno}: {ast.unparse(node)}"


@pytest.mark.parametrize("name", ["metrics", "plot", "maths", "models", "data", "calibration", "library"])
def test_the_rooms_with_public_names_are_modules(name):
    """`from headway.metrics import ttc` finds what `hw.metrics.ttc` is."""
    room = importlib.import_module(f"headway.{name}")
    assert room is getattr(headway, name)
    for public in getattr(room, "__all__", ()):
        assert hasattr(room, public)


def test_every_public_name_is_there():
    """The stub names them once, for type checkers and for the package."""
    assert "linearize" in headway.__all__
    assert "Sine" not in headway.__all__
    assert sorted(headway.__all__) == dir(headway)
    for name in headway.__all__:
        assert getattr(headway, name) is not None
    assert headway.sine is importlib.import_module("headway.scenario.leaders").Sine
    with pytest.raises(AttributeError, match="did you mean 'simulate'"):
        _ = headway.simulat


def test_the_map_of_the_house_is_true():
    """Each file that CONTRIBUTING.md names for a concept exists, and each room has a line."""
    text = (PACKAGE.parents[1] / "CONTRIBUTING.md").read_text(encoding="utf-8")
    rooms, concepts = (part.split("\n\n")[0] for part in text.split("| --- | --- |\n")[1:3])
    named = re.findall(r"`([^`]+\.pyi?)` \|$", concepts, re.MULTILINE)
    assert len(named) == len(concepts.splitlines())
    assert [name for name in named if not (PACKAGE / name).is_file()] == []
    folders = {path.parent.name for path in PACKAGE.glob("*/__init__.py")}
    assert set(re.findall(r"`(\w+)`", "".join(line.split("|")[1] for line in rooms.splitlines()))) == folders
