"""The pages' commands and code, run as written and in their order; what a page shows as printed is printed."""

from __future__ import annotations

import re
import shlex
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest

import headway as hw

ROOT = Path(__file__).resolve().parents[2]
PAGES = ["README.md", *sorted(str(path.relative_to(ROOT)) for path in (ROOT / "docs").rglob("*.md"))]

#: language, title (the file that a block is to be saved as) and text of a block
BLOCK = re.compile(r'^```(\w*)(?: title="([^"]+)")?\n(.*?)^```$', re.S | re.M)

#: a law and a recording, for the lines that speak of one's own
LAW = """
from typing import Annotated
import headway as hw

@hw.model
def soft(s, v, dv, *, k: Annotated[float, hw.Param("1/s²", 0.01, 1)] = 0.2):
    return k * (s - 2.0 - 1.2 * v) + 0.6 * dv
"""


def blocks(page: str) -> list[tuple[str, str, str]]:
    return BLOCK.findall((ROOT / page).read_text(encoding="utf-8"))


def recorded() -> Iterator[str]:
    """Lines of a recording of 100 s at 10 Hz: two IDM drivers, half a second late, behind a driving cycle."""
    driver = hw.Vehicle(hw.models.IDM(T=1.2), delay=0.5)
    leader = hw.cycle("us06", start=120, end=220)
    run = hw.simulate(hw.Scenario(leader, [driver, driver], dt=0.05, output_step=0.1))
    for i, time in enumerate(run.time.values):
        for n in range(3):
            gap = f"{run.gap.values[n, i]:.4f}" if n else ""
            yield f"{time:.1f},{n},{run.speed.values[n, i]:.4f},{gap}\n"


@pytest.fixture
def desk(tmp_path, monkeypatch):
    """A folder with what the pages take for granted."""
    (tmp_path / "my.py").write_text(LAW)
    (tmp_path / "study.toml").write_text(next(text for kind, _, text in blocks("docs/scaling.md") if kind == "toml"))
    rows = list(recorded())
    (tmp_path / "trip.csv").write_text("time_s,vehicle,speed_mps,gap_m\n" + "".join(rows))
    (tmp_path / "other.csv").write_text("t,id,v,d\n" + "".join(rows))
    monkeypatch.chdir(tmp_path)
    return tmp_path


def shell(text: str, desk: Path, cli) -> str:
    """Run the lines that call headway; all that they print."""
    printed = ""
    for line in text.splitlines():
        words = shlex.split(line, comments=True)
        if not words or words[0] != "headway":
            continue
        target = words[words.index(">") + 1] if ">" in words else None
        arguments = words[1 : words.index(">")] if target else words[1:]
        if arguments[0] in ("benchmark", "explore") or arguments == ["paper"]:
            continue  # they take long or wait; test_benchmark.py, test_explorer.py and test_paper.py run smaller ones
        code, out, error = cli(*arguments)
        assert code == 0, f"{line}: {error}"
        assert out
        if target:
            (desk / target).write_text(out)
        printed += out
    return printed


def described(text: str, desk: Path) -> None:
    """Read a scenario, a study or entries of the benchmark."""
    (desk / "block.toml").write_text(text)
    table = tomllib.loads(text)
    if "axes" in table:
        assert hw.load_study(desk / "block.toml").points.count > 1
    elif "leader" in table:
        assert hw.load(desk / "block.toml").followers
    else:
        from headway.benchmark.spec import load_benchmark

        assert load_benchmark(desk / "block.toml").entries


@pytest.mark.parametrize("page", PAGES)
def test_page(page, desk, cli, capsys):
    names: dict[str, object] = {"__name__": "__main__"}
    exec("import headway as hw", names)
    printed = None
    for language, title, text in blocks(page):
        if title:
            (desk / title).write_text(text)
        if language == "toml":
            described(text, desk)
        elif language == "python" and "load_benchmark()" not in text:  # test_benchmark.py runs that
            exec(compile(text, page, "exec"), names)
            printed = capsys.readouterr().out
        elif language == "sh":
            printed = shell(text, desk, cli)
        elif not language and printed is not None:
            assert " ".join(text.split()) in " ".join(printed.split())


def test_make_targets_exist():
    makefile = (ROOT / "Makefile").read_text()
    for page in PAGES:
        for language, _, text in blocks(page):
            for line in text.splitlines() if language == "sh" else ():
                words = shlex.split(line, comments=True)
                if words and words[0] == "make":
                    assert re.search(rf"^{words[1]}:", makefile, re.M)
