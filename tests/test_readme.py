"""The README's commands and code, run as written."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PAGES = ("README.md", "docs/stability.md", "docs/data.md", "docs/scaling.md", "docs/metrics.md")

#: a law and a recording, for the lines that speak of one's own
LAW = """
from typing import Annotated
import headway as hw

@hw.model
def soft(s, v, dv, *, k: Annotated[float, hw.Param("1/s²", 0.01, 1)] = 0.2):
    return k * (s - 2.0 - 1.2 * v) + 0.6 * dv
"""


def blocks(page: str, language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", (ROOT / page).read_text(encoding="utf-8"), re.S)


@pytest.fixture
def desk(tmp_path, monkeypatch):
    """A folder with what the pages take for granted."""
    (tmp_path / "my.py").write_text(LAW)
    (tmp_path / "study.toml").write_text(blocks("docs/scaling.md", "toml")[0])
    rows = [
        f"{0.1 * i:.1f},0,{20 + 0.01 * i:.3f},\n{0.1 * i:.1f},1,20.0,{30 + 0.0005 * i * i:.4f}\n" for i in range(100)
    ]
    (tmp_path / "trip.csv").write_text("time_s,vehicle,speed_mps,gap_m\n" + "".join(rows))
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize("page", PAGES)
def test_python(page, desk):
    for code in blocks(page, "python"):
        exec(compile("import headway as hw\n" + code, page, "exec"), {"__name__": "__main__"})


@pytest.mark.parametrize("page", PAGES)
def test_shell(page, desk, cli):
    for line in "\n".join(blocks(page, "sh")).splitlines():
        words = shlex.split(line, comments=True)
        if not words or words[0] != "headway":
            continue
        target = words[words.index(">") + 1] if ">" in words else None
        arguments = words[1 : words.index(">")] if target else words[1:]
        if arguments[0] == "benchmark":
            continue  # tests/test_benchmark.py runs it, on a smaller board
        if "--column" in arguments:
            continue  # it speaks of a file with other columns, which tests/test_data_readers.py has
        code, out, error = cli(*arguments)
        assert code == 0, f"{line}: {error}"
        assert out
        if target:
            (desk / target).write_text(out)


def test_make_targets_exist():
    makefile = (ROOT / "Makefile").read_text()
    for line in "\n".join(blocks("README.md", "sh")).splitlines():
        words = shlex.split(line, comments=True)
        if words and words[0] == "make":
            assert re.search(rf"^{words[1]}:", makefile, re.M)
