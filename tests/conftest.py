"""Shared by all tests."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from hypothesis import settings

# the same examples on every machine and no deadline: the first example may compile a law
settings.register_profile("default", derandomize=True, deadline=None)
settings.load_profile("default")

SHARED_DATA = Path(os.environ.get("HEADWAY_SHARED", Path(__file__).resolve().parents[2] / "shared")) / "data"


def shared_file(name: str) -> Path:
    """A file of real recordings, of which a test is skipped where they are not: they are not committed."""
    path = SHARED_DATA / name
    if not path.exists():
        pytest.skip(f"{name} is not in {SHARED_DATA} (the environment's HEADWAY_SHARED says where to look)")
    return path


@pytest.fixture
def cli(capsys):
    """Run the command line in this process: (exit code, standard output, standard error)."""
    from headway.cli import execute

    def call(*arguments: object) -> tuple[int, str, str]:
        with pytest.raises(SystemExit) as stop:
            execute([str(a) for a in arguments])
        captured = capsys.readouterr()
        return int(stop.value.code or 0), captured.out, captured.err

    return call
