"""The documentation site: its pages are all found, the generated ones complete, and its checks find what is wrong."""

from __future__ import annotations

import sys
import tomllib
from pathlib import Path

import pytest

import headway as hw
from headway.cli import app
from headway.models.registry import BUILT_IN
from headway.scenario.leaders import KINDS

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def tools():
    """The scripts of tools/, as they find one another."""
    sys.path.insert(0, str(ROOT / "tools"))
    import build_docs
    import reference

    yield build_docs, reference
    sys.path.remove(str(ROOT / "tools"))


def named(entries: list[dict[str, object]]) -> list[str]:
    """Pages of a navigation, in order."""
    found: list[str] = []
    for entry in entries:
        for target in entry.values():
            found += named(target) if isinstance(target, list) else [target]
    return found


def test_every_page_is_in_the_navigation_once(tools):
    pages = named(tomllib.loads((ROOT / "zensical.toml").read_text(encoding="utf-8"))["project"]["nav"])
    written = {str(path.relative_to(ROOT / "docs")) for path in (ROOT / "docs").rglob("*.md")}
    assert sorted(pages) == sorted(written | set(tools[1].PAGES))


def test_reference_of_laws(tools):
    page = tools[1].laws()
    for law in BUILT_IN.values():
        part = page.split(f"## {law.title}\n")[1].split("\n## ")[0]
        for name, parameter in law.parameters.items():
            assert f"| `{name}` | {parameter.default:g} | {parameter.info.unit} | {parameter.range} |" in part


def test_reference_of_scenario_files(tools):
    page = tools[1].scenario_files()
    for kind in KINDS:
        assert f"\n### {kind}\n" in page
    assert "| `omega` | rad/s | required | number above 0 | angular frequency |" in page
    assert "| `gap_offsets` | m |  | table | added to the initial gap, by vehicle number |" in page
    assert "| `scheme` |  | `rk4` | `rk4`, `ballistic` |  |" in page


def test_reference_of_python_and_commands(tools):
    python = tools[1].python()
    for name in hw.__all__:
        assert f"heading: headway.{name}\n" in python + "\n" or name == "__version__", name
    commands = tools[1].command_line()
    for name in app:
        if not name.startswith("-"):
            assert f"## headway {name}\n" in commands


def site(folder: Path, **pages: str) -> Path:
    for name, text in pages.items():
        (folder / name.replace("_", ".")).write_text(text)
    return folder


def test_a_sound_site_has_nothing_broken(tools, tmp_path):
    site(
        tmp_path,
        a_html='<a href="b.html#x">b</a> <a href="https://elsewhere.org">e</a> <img src="data:image/png;base64,x">',
        b_html='<h1 id="x">x</h1> <a href="#x">x</a> <script src="s.js"></script>',
        s_js="",
        s_css="a { background: url(data:image/svg+xml;x) }",
    )
    assert tools[0].broken(tmp_path) == []


@pytest.mark.parametrize(
    ("page", "sentence"),
    [
        ('<a href="gone.html">x</a>', "a.html: gone.html does not exist"),
        ('<a href="#gone">x</a>', "a.html: #gone has no such place"),
        ('<img src="gone.png">', "a.html: gone.png does not exist"),
        ('<script src="https://cdn.org/x.js"></script>', "a.html: loads https://cdn.org/x.js from another host"),
        ('<link rel="stylesheet" href="//cdn.org/x.css">', "a.html: loads //cdn.org/x.css from another host"),
    ],
)
def test_what_is_wrong_on_a_page_is_found(tools, tmp_path, page, sentence):
    assert tools[0].broken(site(tmp_path, a_html=page)) == [sentence]


@pytest.mark.parametrize("rule", ["@import 'https://cdn.org/x.css';", "a { src: url(https://cdn.org/x.css) }"])
def test_fonts_and_styles_from_elsewhere_are_found(tools, tmp_path, rule):
    assert tools[0].broken(site(tmp_path, s_css=rule)) == ["s.css: loads https://cdn.org/x.css from another host"]
