"""The reproduced paper: completeness, the rules of verdicts, measured numbers against known ones, the page."""

from __future__ import annotations

import dataclasses
import functools
import json
import math
import re
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from headway.errors import HeadwayError
from headway.library import library, library_scenario
from headway.literature.barhoumi2025.claims import CLAIMS, GROUPS
from headway.literature.barhoumi2025.delays import CLASSES, DELAYS, delay_sweep
from headway.literature.barhoumi2025.experiments import EXPERIMENTS, STATED
from headway.literature.barhoumi2025.reproduction import choose, key_condition, reason, reproduce, tables, verdict_table
from headway.literature.barhoumi2025.settings import AXES, GAINS, scenario, trajectories
from headway.literature.barhoumi2025.verdicts import (
    SAME,
    Claim,
    Condition,
    about,
    at_least,
    at_most,
    grows,
    judge_claim,
    unbounded,
)
from headway.models import BUILT_IN

DOC = (Path(__file__).resolve().parents[2] / "docs/paper.md").read_text(encoding="utf-8")

#: claims that take a fraction of a second; of the others the page's row is checked for sense only
QUICK = ("C03", "C08", "C13", "C14", "C15", "C19", "C20", "C21", "C22", "C23", "C24", "C25", "C27", "C28")


def made(check, axes, **more):
    return Claim("C00", "A sentence.", "nowhere", "idm-2", "nothing", axes, check, **more)


@functools.cache
def found(name):
    """A claim, judged without its sweep."""
    return judge_claim(dataclasses.replace(CLAIMS[name], sweep=None))


def test_every_experiment_and_every_claim_is_there():
    assert len(EXPERIMENTS) == 28
    assert list(CLAIMS) == sorted([f"C{i:02d}" for i in range(1, 30)] + ["C01b"])
    assert sum(map(len, GROUPS.values())) == len(CLAIMS)


def test_what_is_said_to_be_stated_are_parameters():
    for model, stated in STATED.items():
        assert set(stated) <= set(BUILT_IN[model].parameters)


def test_every_ready_scenario_of_the_paper_is_part_of_an_experiment():
    used = Counter(f"paper:{name}" for e in EXPERIMENTS.values() for name in e.scenarios.values())
    assert set(used) == {name for name in library() if name.startswith("paper:")}
    assert set(used.values()) == {1}


@pytest.mark.parametrize("experiment", EXPERIMENTS.values(), ids=lambda e: e.id)
def test_experiment_says_what_is_stated_and_what_is_chosen(experiment):
    assert len(experiment.stated) > 3
    assert len(experiment.chosen) > 3
    assert "U:" not in experiment.stated
    assert experiment.figure.startswith(("fig:", "none"))


@pytest.mark.parametrize("claim", CLAIMS.values(), ids=lambda c: c.id)
def test_claim_is_well_formed(claim):
    assert claim.experiment in EXPERIMENTS
    assert set(claim.axes) <= set(AXES)
    assert all(len(set(values)) == len(values) > 1 for values in claim.axes.values())
    assert next(iter(claim.combinations())) == claim.chosen
    assert bool(claim.contrary) is (claim.against is not None)
    if claim.sweep:
        axis, values = claim.sweep
        assert axis in AXES
        assert list(values) == sorted(set(values))


class TestConditions:
    def test_bounds_read_off_a_figure_have_room(self):
        assert at_most("x", 0.8249, 0.75).holds
        assert not at_most("x", 0.8251, 0.75).holds
        assert at_least("x", 9.01, 10.0).holds
        assert not at_least("x", 8.99, 10.0).holds

    def test_about_is_a_quarter(self):
        assert [about("x", v, 4.0).holds for v in (2.99, 3.01, 4.99, 5.01)] == [False, True, True, False]

    def test_growth_must_be_clear(self):
        assert not grows("x", 1 + 0.9 * SAME).holds
        assert grows("x", 1 + 1.1 * SAME).holds

    def test_what_does_not_exist_does_not_hold(self):
        assert not at_most("x", math.nan, 1.0).holds
        assert unbounded("x", math.nan).holds

    def test_margin_is_the_share_of_the_nearer_bound(self):
        assert Condition("x", 3.0, low=2.0, high=4.0).margin == pytest.approx(0.25)
        assert Condition("x", 5.0, low=2.0, high=4.0).margin == pytest.approx(-0.25)
        assert unbounded("x", 1.0).margin == math.inf


class TestVerdicts:
    AXES = {"gains": ("base", "fitted"), "omega": (0.63, 1.0, 0.3)}  # noqa: RUF012

    def verdict(self, check):
        return judge_claim(made(check, self.AXES)).verdict

    def test_in_all_in_some_in_none(self):
        assert self.verdict(lambda c: [at_most("x", 0.0, 1.0)]) == "reproduced"
        assert self.verdict(lambda c: [at_most("x", c["omega"], 0.7)]) == "depends on what is not stated"
        assert self.verdict(lambda c: [at_most("x", 2.0, 1.0)]) == "contradicted"

    def test_conditions_must_hold_together(self):
        apart = [("base", "fitted"), ("fitted", "base")]
        check = lambda c: [Condition(a, float(c["gains"] == b), low=1.0) for a, b in apart]  # noqa: E731
        assert self.verdict(check) == "contradicted"

    def test_without_any_number_it_is_not_testable(self):
        assert self.verdict(lambda c: [at_most("x", math.nan, 1.0)]) == "not testable"
        # one number that exists and is wrong is enough
        mixed = lambda c: [at_most("x", math.nan, 1.0), at_most("y", 5.0, 1.0)]  # noqa: E731
        assert self.verdict(mixed) == "contradicted"

    def test_decisive_is_the_axis_that_decides(self):
        finding = judge_claim(made(lambda c: [at_most("x", c["omega"], 0.5)], self.AXES))
        (only,) = finding.decisive
        assert only.axis == "omega"
        assert only.share == pytest.approx(2 / 3)
        assert only.counts == {0.63: (0, 2), 1.0: (0, 2), 0.3: (2, 2)}
        assert "frequency ω of the disturbance (0.63 rad/s: 0 of 2" in reason(finding)

    def test_reason_counts_each_condition_where_none_holds(self):
        finding = judge_claim(made(lambda c: [at_most("x", c["omega"], 0.5), at_least("y", 0.0, 1.0)], self.AXES))
        assert reason(finding).endswith(
            "0 of 6 combinations of what is not stated; each by itself: 'x' in 2 of 6, 'y' in 0 of 6."
        )
        assert key_condition(finding).name == "y"

    def test_the_opposite_and_the_sweep_are_measured_too(self):
        claim = made(
            lambda c: [grows("x", 1 + c["omega"])], self.AXES, contrary="The opposite.",
            against=lambda c: [grows("x", 1 - c["omega"])], sweep=("omega", (0.0, 0.1)),
        )  # fmt: skip
        finding = judge_claim(claim)
        assert (finding.verdict, finding.contrary_verdict) == ("reproduced", "contradicted")
        assert [o.holds for o in finding.sweep] == [False, True]
        assert finding.sweep[0].choices == {"gains": "base", "omega": 0.0}


class TestSettings:
    def test_choices_fill_in_what_is_open(self):
        case = scenario("compare-real-idm", speed=27.8, start="typed in", omega=1.0, late="gap and leader's speed")
        assert case.initial_gaps()[0] == pytest.approx(2 + 1.5 * 27.8)
        assert (case.leader.mean, case.leader.omega) == (27.8, 1.0)
        assert dict(case.followers[0].delay) == {"s": 1.5, "vl": 1.5}

    def test_gains_without_radio_stay_without(self):
        assert GAINS["advanced"]["kv"] > 0
        parameters = scenario("cacc-1", gains="advanced").followers[0].model.parameters
        assert {k: parameters[k] for k in ("kp", "kd", "kv", "ka")} == {"kp": 0.1, "kd": 0.0, "kv": 0.0, "ka": 0.0}

    def test_first_choices_are_the_ready_scenarios(self):
        for name, claim in (("compare-0-cacc", "C01"), ("idm-2", "C09"), ("gmm-window", "C22"), ("cacc-window", "C07")):
            assert scenario(name, **CLAIMS[claim].chosen).hash == library_scenario(f"paper:{name}").hash

    def test_choices_about_another_model_change_nothing(self):
        plain = library_scenario("paper:compare-0-idm").hash
        assert scenario("compare-0-idm", gains="fitted", gap=5.0, alpha=2.0, h=1.0).hash == plain

    def test_unknown_axis(self):
        with pytest.raises(HeadwayError, match="did you mean 'omega'"):
            scenario("idm-2", omegaa=1.0)


class TestNumbers:
    """Measured figures against closed forms and published ones."""

    def test_gmm_attenuates_as_its_transfer_function(self):
        # C = α v^m / s^l = 0.15 1/s for m = 0, l = 1; two vehicles
        measured = found("C24").chosen.measured["speed amplitude of vehicle 2 over the leader's"]
        assert measured == pytest.approx(0.15**2 / (0.15**2 + 0.63**2), rel=0.03)
        # m = 1, l = 2: C = 0.345 1/s; five vehicles
        (tail,) = found("C25").contrary[0].measured.values()
        assert tail == pytest.approx((0.345 / math.hypot(0.345, 0.63)) ** 5, rel=0.03)

    def test_printed_conditions_fail_at_the_papers_settings(self):
        measured = found("C28").chosen.measured
        assert measured["IDM: printed damping"] == pytest.approx(-0.4179, abs=1e-4)
        assert measured["OVM: printed S"] == pytest.approx(0.5 - 43.9, abs=0.05)
        assert measured["GMM: printed l/s* - α"] == pytest.approx(0.2 - 1.5)

    def test_exact_theory_says_that_only_ovm_is_unstable(self):
        outcome = next(
            o for o in found("C28").outcomes if o.choices["judge"] == "exact theory" and o.choices["delays"] == "none"
        )
        held = {c.name.partition(":")[0]: c.holds for c in outcome.conditions}
        assert held == {"CACC": True, "IDM": True, "OVM": False, "GMM": True}

    def test_peaks_of_the_leader_are_mean_and_amplitude(self):
        assert found("C22").chosen.measured["highest speed of the leader"] == pytest.approx(25.5, abs=1e-4)
        assert found("C13").chosen.measured["highest speed"] == pytest.approx(26.0, abs=1e-4)

    def test_a_collision_leaves_no_later_value(self):
        late = found("C19").condition("largest error later than 35 s over the largest")
        assert all(math.isnan(c.value) and not c.holds for c in late)

    def test_idm_loses_string_stability_at_its_critical_delay(self):
        answer = delay_sweep("idm")
        assert len(DELAYS) == len(answer.peak) == 31
        unstable = DELAYS[answer.verdict == CLASSES.index("string unstable")]
        assert unstable[0] == pytest.approx(1.2)  # exact: 1.19 s
        assert not answer.collisions.any()
        assert answer.growth[0] < 1 < answer.growth[-1]

    def test_runs_are_those_of_the_library(self):
        data = trajectories("idm-window")
        assert data.attrs["scenario_hash"] == library_scenario("paper:idm-window").hash


class TestChoosing:
    def test_all(self):
        experiments, claims = choose()
        assert len(experiments) == len(EXPERIMENTS)
        assert claims == tuple(CLAIMS)

    def test_a_claim_is_one_claim_and_an_experiment_brings_its_claims(self):
        assert choose(["c05"]) == ((), ("C05",))
        experiments, claims = choose(["idm-1", "C22"])
        assert [e.id for e in experiments] == ["idm-1"]
        assert claims == ("C08", "C22")

    def test_unknown(self):
        with pytest.raises(HeadwayError, match="did you mean 'idm-1'"):
            choose(["idm1"])
        with pytest.raises(HeadwayError, match="did you mean 'C05'"):
            reproduce(["C050"])


class TestPage:
    ROW = re.compile(r"^\| (C\d\d\w?) \| (.*?) \| (.*?) \| (\d+) of (\d+) \| (.*?) \|$", re.M)

    @pytest.mark.parametrize("name", QUICK)
    def test_row_is_what_is_computed(self, name):
        assert verdict_table([found(name)]).splitlines()[-1] in DOC.splitlines()

    def test_all_rows_make_sense(self):
        rows = {row[0]: row[1:] for row in self.ROW.findall(DOC)}
        assert list(rows) == list(CLAIMS)
        for name, (sentence, verdict, held, total, turns) in rows.items():
            claim = CLAIMS[name]
            assert sentence == claim.sentence
            assert int(total) == np.prod([len(values) for values in claim.axes.values()])
            some = 0 < int(held) < int(total)
            assert (verdict == "depends on what is not stated") is some
            assert bool(turns) is some
            assert turns in ("", *(AXES[axis].meaning for axis in claim.axes))


class TestCommand:
    def test_json(self, cli, monkeypatch, tmp_path):
        monkeypatch.chdir(tmp_path)
        code, out, _ = cli("paper", "--only", "C13,C19", "--json")
        assert code == 0
        told = json.loads(out)
        assert told["verdicts"]["contradicted"] == 2
        assert told["written"] == []
        first, second = told["claims"]
        assert (first["id"], first["combinations"], len(first["outcomes"])) == ("C13", 4, 4)
        assert first["measured"][2]["name"] == "highest speed"
        assert first["measured"][2]["value"] == pytest.approx(26.0, abs=1e-4)
        assert second["measured"][1]["value"] is None  # nobody lives to see it
        assert list(tmp_path.iterdir()) == []

    def test_report(self, cli, tmp_path):
        code, out, _ = cli("paper", "--only", "idm-window,C08,damping", "--out", tmp_path / "new/place")
        assert code == 0
        assert "contradicted" in out
        page = tmp_path / "new/place/report.html"
        assert out.splitlines()[-1] == f"wrote {page}"
        text = page.read_text(encoding="utf-8")
        for words in ("C13", "C08", "1 depends on what is not stated, 1 contradicted", "headway run paper:NAME"):
            assert words in text
        names = {p.name for p in (page.parent / "figures").iterdir()}
        assert names == {"idm-window.svg", "damping.svg", "claim-c08.svg"}
        data = json.loads((page.parent / "data/claims.json").read_text(encoding="utf-8"))
        assert [c["id"] for c in data["claims"]] == ["C08", "C13"]
        assert (page.parent / "data/idm-window.toml").exists()

    def test_markdown(self, cli, tmp_path):
        code, _, _ = cli("paper", "--only", "C25", "--out", tmp_path, "--format", "md", "--figures", "png")
        assert code == 0
        text = (tmp_path / "report.md").read_text(encoding="utf-8")
        assert "## Where the text contradicts itself" in text
        assert "the opposite: reproduced, holds in 12 of 12" in text

    def test_what_is_typed_wrongly(self, cli, tmp_path):
        (tmp_path / "file").write_text("")
        for arguments, words in (
            (("--only", "C13,idm2"), "did you mean 'idm-2'"),
            (("--only", ","), "name claims or experiments"),
            (("--out", tmp_path / "file"), "is a file; name a folder"),
            (("--out", tmp_path / "file/below"), "is a file; name a folder"),
            (("--format", "pdf"), "format"),
        ):
            code, out, error = cli("paper", *arguments)
            assert (code, out) == (2, "")
            assert words in error
            assert len(error.splitlines()) == 1


class TestDoc:
    def test_every_experiment_is_described_and_shown(self):
        for e in EXPERIMENTS.values():
            assert f"### {e.id}: {e.title}" in DOC
            assert e.stated in DOC
            assert e.chosen in DOC

    def test_figures_exist_and_have_words(self):
        shown = re.findall(r"!\[(.+?)\]\((figures/paper/[\w-]+\.png)\)", DOC)
        assert len(shown) >= len(EXPERIMENTS)
        folder = Path(__file__).resolve().parents[2] / "docs"
        assert {folder / place for _, place in shown} == set((folder / "figures/paper").iterdir())


def test_a_claim_has_as_many_panels_as_it_asks_for():
    from headway.literature.barhoumi2025.figures import dependence

    finding = judge_claim(dataclasses.replace(CLAIMS["C24"], sweep=("gap", (5.0, 10.0))))
    figure = dependence(finding)
    assert len(figure.axes) == 2  # the combinations, and the sweep beneath
    marked = {tuple(line.get_ydata()) for line in figure.axes[1].lines}
    assert any(len(y) == 2 for y in marked)


def test_tables_hold_nothing_but_plain_values():
    text = json.dumps(tables({"C13": found("C13")}))
    assert json.loads(text)["claims"][0]["id"] == "C13"
