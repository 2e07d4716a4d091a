"""What laws, models, scenarios and linear results show of themselves in a notebook."""

from __future__ import annotations

from html.parser import HTMLParser
from typing import Annotated

import pytest

import headway as hw

VOID = {"br", "img", "hr"}


class Read(HTMLParser):
    """Tables by caption, each a list of rows of texts, and the plain words; well-formed or an error."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.tables: dict[str, list[list[str]]] = {}
        self.words: list[str] = []
        self.scopes: list[str | None] = []
        self._open: list[str] = []
        self._rows: list[list[str]] = []
        self.feed(html)
        self.close()
        assert not self._open

    def handle_starttag(self, tag, attrs):
        assert tag in {"div", "p", "table", "caption", "thead", "tbody", "tr", "th", "td"}
        self._open.append(tag)
        if tag == "table":
            self._rows = []
        elif tag == "tr":
            self._rows.append([])
        elif tag in ("td", "th"):
            self._rows[-1].append("")
        if tag == "th":
            self.scopes.append(dict(attrs).get("scope"))

    def handle_endtag(self, tag):
        assert self._open.pop() == tag

    def handle_data(self, data):
        if self._open[-1] in ("td", "th"):
            self._rows[-1][-1] += data
        elif self._open[-1] == "caption":
            self.tables[data] = self._rows
        else:
            self.words.append(data)

    def row(self, caption: str, name: str) -> list[str]:
        return next(row for row in self.tables[caption] if row[0] == name)


def shown(thing: object) -> Read:
    page = Read(thing._repr_html_())
    assert page.scopes
    assert set(page.scopes) == {"col", "row"}
    for caption, rows in page.tables.items():
        assert len({len(row) for row in rows}) == 1, caption
        assert len(rows) > 1, caption
    return page


def test_law_and_model():
    law = shown(hw.models.IDM)
    assert law.row("Intelligent Driver Model (idm)", "T") == ["T", "1.5", "s", "0 to 10", "desired time gap"]
    assert law.row("It perceives", "dv")[1] == "m/s"
    assert any("10.1103/PhysRevE.62.1805" in text for text in law.words)
    model = shown(hw.models.IDM(T=1.25))
    assert model.row("Intelligent Driver Model (idm)", "T")[1] == "1.25"
    assert model.tables["Intelligent Driver Model (idm)"][0][1] == "value"


@pytest.mark.parametrize(
    "law", [hw.models.OVM, hw.models.FVDM, hw.models.GMM, hw.models.CACC], ids=lambda law: law.name
)
def test_every_parameter_and_signal_is_shown(law):
    page = shown(law())
    names = {row[0] for rows in page.tables.values() for row in rows}
    assert {*law.parameters, *law.signals} <= names


def test_texts_of_ones_own_are_escaped():
    @hw.model(title="<script>alert(1)</script>", formula="k < 1 & s > 2", source='"Doe"')
    def soft(s, v, dv, *, k: Annotated[float, hw.Param("1/s²", 0.01, 1, "<b>stiffness</b>")] = 0.2):
        return k * (s - 2.0 - v) + 0.6 * dv

    page = shown(soft)  # which refuses tags that we do not write
    assert page.row("<script>alert(1)</script> (soft)", "k")[-1] == "<b>stiffness</b>"
    assert "acceleration = k < 1 & s > 2" in page.words
    named = hw.Scenario(hw.constant(speed=20), [hw.Vehicle(soft)], duration=5, name="<i>x</i>", description="a & b")
    assert "<i>x</i>: a & b" in shown(named).words


def test_a_law_without_parameters():
    @hw.model
    def bare(s, v, dv):
        return 0.2 * (s - 2.0 - v) + 0.6 * dv

    page = Read(bare._repr_html_())
    assert [len(row) for row in page.tables["It perceives"]] == [3] * 4


def test_scenario():
    radio = hw.Vehicle(hw.models.CACC(), delay={"vl": 0.15, "al": 0.2}, lag=0.1)
    truck = hw.Vehicle(hw.models.IDM(), delay=0.5, length=16.5, limits=(-5, 1))
    leader = hw.window(mean=23, amplitude=2, omega=0.63, duration=10)
    page = shown(hw.Scenario(leader, [radio, truck, truck, truck], duration=50, gap_offsets={3: -2}, seed=7))
    assert page.row("Leader: window", "omega") == ["omega", "0.63", "rad/s", "angular frequency"]
    rows = page.tables["Followers: 4, front to back"][1:]
    assert [row[0] for row in rows] == ["1", "2", "3", "4"]  # the third starts nearer than its equals
    assert rows[0][3:7] == ["al 0.2, vl 0.15", "0.1", "5", "none"]
    assert rows[1][3:7] == ["0.5", "0", "16.5", "-5 to 1"]
    assert float(rows[1][7]) - float(rows[2][7]) == pytest.approx(2)
    assert page.row("Run", "duration")[1:3] == ["50", "s"]
    assert page.row("Run", "initial_speed")[1:3] == ["23", "m/s"]
    assert page.row("Run", "gap_offsets")[1:3] == ["3: -2.0", "m"]
    assert page.row("Run", "seed")[1] == "7"
    assert "dt" not in {row[0] for row in page.tables["Run"]}


def test_equal_followers_share_a_row():
    page = shown(hw.Scenario(hw.cycle("hwfet"), [hw.Vehicle(hw.models.CACC())] * 50))
    assert [row[0] for row in page.tables["Followers: 50, front to back"][1:]] == ["1 to 50"]


def test_a_recorded_leader_is_shown_in_short():
    leader = hw.recorded(time=range(1000), speed=[20.0] * 1000)
    html = hw.Scenario(leader, [hw.Vehicle(hw.models.CACC())])._repr_html_()
    assert len(html) < 6000
    assert Read(html).row("Leader: recorded", "time")[1].endswith("…")


def test_linear():
    linear = hw.linearize(hw.Vehicle(hw.models.IDM(), delay=1.5), 23)
    page = shown(linear)
    assert "string unstable: a 0.64 rad/s disturbance grows 1.3 times per vehicle" in page.words[0]
    assert page.row("Linear theory", "peak gain")[1] == f"{linear.peak_gain:.5g}"
    assert page.row("Linear theory", "string critical delay")[1:3] == [f"{linear.critical_delay('string'):.5g}", "s"]
    assert page.row("Derivatives of the law", "∂f/∂s")[2] == "1/s²"


@pytest.mark.parametrize(
    ("vehicle", "speed", "gap", "words"),
    [
        (hw.Vehicle(hw.models.IDM(), delay=4.0), 23, None, "locally unstable"),
        (hw.Vehicle(hw.models.GMM()), 23, 30.0, "string stable"),
        (hw.Vehicle(hw.models.OVM()), 23, None, "string unstable"),
    ],
)
def test_linear_of_every_kind(vehicle, speed, gap, words):
    assert words in shown(hw.linearize(vehicle, speed, gap)).words[0]
