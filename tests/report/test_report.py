"""Reports: one page that needs nothing beside it, readable by everybody, the same bytes each time."""

from __future__ import annotations

import base64
import csv
import hashlib
import re
from html.parser import HTMLParser
from importlib import resources

import numpy as np
import pytest
from matplotlib.figure import Figure

from headway import report
from headway.errors import HeadwayError
from headway.report import Illustration, Report, Section, Table, Text

VOID = {"meta", "link", "br", "img", "input"}


class Page(HTMLParser):
    """A page as (tag, attributes) in order, with text by element; elements must nest."""

    def __init__(self, text: str):
        super().__init__()
        self.elements: list[tuple[str, dict[str, str | None]]] = []
        self.open: list[str] = []
        self.words: dict[str, list[str]] = {}
        self.feed(text)
        assert not self.open

    def handle_starttag(self, tag, attrs):
        self.elements.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attrs):
        self.elements.append((tag, dict(attrs)))

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if self.open:
            self.words.setdefault(self.open[-1], []).append(data)

    def all(self, tag):
        return [attributes for name, attributes in self.elements if name == tag]


def drawing(seed=0):
    figure = Figure(figsize=(7.2, 2.0), layout="constrained")
    for ax in figure.subplots(1, 2):
        ax.plot(np.random.default_rng(seed).standard_normal(200).cumsum(), label="wander", clip_on=True)
        ax.fill_between([0, 100], -1, 1, hatch="//")
        ax.set_xlabel("Time [s]")
    return figure


def example():
    table = Table(
        ("model", "peak", "fate"),
        (("idm", 1.23456789012345, "well"), ("ovm", float("inf"), "collides | twice"), ("gmm", float("nan"), 3.0)),
        "Scores", ("", "m", ""), note="A note with `code`.",
    )  # fmt: skip
    first = Section(
        "First & <last>",
        (
            Text(("Words with **weight** & <b>brackets</b>.", "- one", "- two")),
            table,
            Illustration("one", drawing(), "a line"),
        ),
    )
    second = Section(
        "Second", (Illustration("two", drawing(1), 'a "second" line', "Caption."), table), "more", collapsed=True
    )
    return Report(
        "Title <script>alert(1)</script>", ("Lead |G| <= 1.",), (first, second), {"version": "1"},
        ("Author (2000)",), {"cells 1.csv": "a,b\n", "raw.bin": b"\x00\x01"},
    )  # fmt: skip


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    folder = tmp_path_factory.mktemp("report")
    return report.write(example(), folder)


@pytest.fixture(scope="module")
def page(written):
    return Page(written.read_text(encoding="utf-8"))


def test_ids_are_unique_and_every_link_within_the_page_arrives(page):
    ids = [a["id"] for _, a in page.elements if "id" in a]
    assert len(ids) == len(set(ids)) > 20
    referred = [a["href"][1:] for _, a in page.elements if (a.get("href") or "").startswith("#")]
    referred += [a["aria-labelledby"] for _, a in page.elements if "aria-labelledby" in a]
    referred += [i for _, a in page.elements for v in a.values() for i in re.findall(r"url\(#([^)]+)\)", v or "")]
    assert set(referred) <= set(ids)


def test_the_page_names_nothing_outside_itself(written):
    text = written.read_text(encoding="utf-8")
    assert not re.search(r"(?:https?:)?//[a-z]", text)
    assert "<metadata" not in text
    assert "@import" not in text


def test_files_that_the_page_offers_lie_beside_it(written, page):
    offered = [a["href"] for a in page.all("a") if "download" in a]
    assert len(offered) == 2 + 2 + 2
    for name in offered:
        assert (written.parent / name.replace("%20", " ")).is_file()
    assert (written.parent / "data" / "raw.bin").read_bytes() == b"\x00\x01"


def test_the_script_is_the_one_that_the_policy_allows(page):
    policy = next(a["content"] for a in page.all("meta") if a.get("http-equiv") == "Content-Security-Policy")
    digest = base64.b64encode(hashlib.sha256("".join(page.words["script"]).encode()).digest()).decode()
    assert f"script-src 'sha256-{digest}'" in policy
    assert "default-src 'none'" in policy
    assert len(page.all("script")) == 1  # the one in the title is words


def test_pictures_say_what_they_show_and_tables_what_heads_what(page):
    drawn = page.all("svg")
    assert [a["aria-label"] for a in drawn] == ["a line", 'a "second" line']
    assert all(a["role"] == "img" and "viewbox" in a for a in drawn)
    assert all(a.get("scope") in ("col", "row") for a in page.all("th"))
    assert len(page.all("caption")) == len(page.all("table")) == 2
    assert page.all("html")[0]["lang"] == "en"
    # what scrolls sideways can be reached by keyboard
    assert all(a.get("tabindex") == "0" for a in page.all("div") if "wide" in (a.get("class") or ""))


def test_words_are_escaped_and_marked(page):
    assert "".join(page.words["title"]) == "Title <script>alert(1)</script>"
    assert "weight" in page.words["strong"]
    assert any("<b>brackets</b>" in words for words in page.words["p"])
    assert page.words["code"] == ["code", "code"]


def test_numbers_keep_their_digits_for_sorting_and_in_the_csv(written, page):
    values = [a["data-value"] for a in page.all("td") if "data-value" in a]
    assert values[:4] == ["1.23456789012345", "inf", "", "3.0"]
    rows = list(csv.reader((written.parent / "tables" / "first-last-scores.csv").open(encoding="utf-8")))
    assert rows[0] == ["model", "peak [m]", "fate"]
    assert rows[1] == ["idm", "1.23456789012345", "well"]
    assert rows[3][1] == ""


def test_collapsed_sections_fold_and_keep_their_heading(page):
    assert sum((a.get("class") or "") == "fold" for a in page.all("details")) == 1
    assert [a["id"] for a in page.all("h2")][:2] == ["first-last-title", "more-title"]


def test_the_same_report_gives_the_same_bytes(written, tmp_path):
    again = report.write(example(), tmp_path)
    files = sorted(p.relative_to(tmp_path) for p in tmp_path.rglob("*") if p.is_file())
    assert files == sorted(p.relative_to(written.parent) for p in written.parent.rglob("*") if p.is_file())
    assert again.read_bytes() == written.read_bytes()
    for name in files:
        assert (tmp_path / name).read_bytes() == (written.parent / name).read_bytes()


@pytest.mark.parametrize(("figures", "start"), [("pdf", b"%PDF"), ("png", b"\x89PNG")])
def test_markdown_shows_the_figures_beside_it(tmp_path, figures, start):
    text = report.write(example(), tmp_path, format="md", figures=figures).read_text(encoding="utf-8")
    shown = re.findall(r"!\[[^]]*\]\((figures/[^)]+)\)", text)
    assert len(shown) == 2
    assert all((tmp_path / name).is_file() for name in shown)
    assert (tmp_path / "figures" / f"one.{figures}").read_bytes().startswith(start)
    assert "| ovm | ∞ | collides \\| twice |" in text
    assert "- one\n- two" in text


def test_figures_have_print_size(written):
    svg = (written.parent / "figures" / "one.svg").read_text(encoding="utf-8")
    width, height = re.search(r'viewBox="0 0 ([\d.]+) ([\d.]+)"', svg).groups()
    assert (float(width), float(height)) == (7.2 * 72, 2.0 * 72)


def luminance(colour):
    channels = [int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5)]
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in channels]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


def test_colours_have_the_contrast_that_wcag_aa_asks_for():
    css = (resources.files("headway.report") / "templates" / "page.css").read_text(encoding="utf-8")
    palettes = [dict(re.findall(r"--(\w+): (#[0-9a-f]{6})", block)) for block in re.findall(r":root \{([^}]*)\}", css)]
    assert len(palettes) == 3  # light, dark, paper
    for palette in palettes:
        for ground in ("ground", "shade"):
            for ink in ("ink", "quiet", "link", "mark"):
                light, dark = sorted((luminance(palette[ground]), luminance(palette[ink])), reverse=True)
                assert (light + 0.05) / (dark + 0.05) >= 4.5, (ground, ink, palette)


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: Illustration("one", drawing(), " "), "no alt text"),
        (lambda: Illustration("One!", drawing(), "x"), "small letters"),
        (lambda: Table(("a", "b"), (("x",),), "t"), "1 entries for 2 columns"),
        (lambda: Table(("a",), (), "t", ("m", "s")), "units has 2 entries"),
        (lambda: Report("t", (), (Section("A", ()), Section("A", ()))), "two sections called 'a'"),
        (lambda: Report("t", (), (), data={"../x": ""}), "plain name"),
    ],
)
def test_parts_that_cannot_be_shown_are_refused(make, said):
    with pytest.raises(HeadwayError, match=re.escape(said)):
        make()


def test_unknown_formats_and_places_are_refused(tmp_path):
    with pytest.raises(HeadwayError, match="allowed are html, md"):
        report.write(example(), tmp_path, format="htm")
    with pytest.raises(HeadwayError, match="allowed are pdf, png, svg"):
        report.write(example(), tmp_path, figures="jpg")
    (tmp_path / "file").write_text("")
    with pytest.raises(HeadwayError, match="cannot be made"):
        report.write(example(), tmp_path / "file" / "folder")
    assert not (tmp_path / "report.html").exists()
