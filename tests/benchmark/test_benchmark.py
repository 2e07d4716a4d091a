"""The benchmark: what joins it, how it is scored, what it says; and that one failing cell empties nothing."""

from __future__ import annotations

import csv
import dataclasses
import io
import json
import math
import re
from pathlib import Path

import pytest

import headway as hw
from headway.benchmark import guidance, scores
from headway.benchmark.cells import MIXED, PUBLISHED, SWEEP, TUNED, Board, Cell, run_board
from headway.benchmark.outcome import run_benchmark
from headway.benchmark.report import benchmark_report
from headway.benchmark.spec import Benchmark, Course, Entry, Late, load_benchmark
from headway.benchmark.theory import steady_course
from headway.benchmark.tuned import tuned
from headway.errors import HeadwayError
from headway.scenario.leaders import Brake, Sine

SMALL = """
without = ["OVM", "GMM", "windowed", "step", "square", "sawtooth", "multisine", "chirp", "WLTC", "US06", "HWFET",
           "150 ms for all", "one IDM among CACC", "one CACC among IDM"]
sweep = [0.0, 0.5, 1.5]

[[models]]
name = "too slow"
model = "idm"
parameters = { v0 = 20.0 }
"""


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    path = tmp_path_factory.mktemp("benchmark") / "small.toml"
    path.write_text(SMALL, encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def outcome(small):
    return run_benchmark(load_benchmark(small))


# -- what is run ---------------------------------------------------------------------------------


def test_the_standard_benchmark_is_the_one_that_is_asked_for():
    b = load_benchmark()
    assert [e.name for e in b.entries] == ["OVM", "IDM", "GMM", "CACC"]
    kinds = [c.leader.kind for c in b.courses]
    assert kinds == [
        "sine", "window", "step", "brake", "square", "sawtooth", "multisine", "chirp", "cycle", "cycle", "cycle",
    ]  # fmt: skip
    assert [(c.onboard, c.radio) for c in b.cases] == [(0, 0), (0.15, 0.15), (1.5, 0.15)]
    assert (b.sweep[0], b.sweep[-1]) == (0.0, 1.5)
    assert b.entry("CACC").late == ("vl", "al")
    assert b.entry("IDM").late == ("s", "v", "dv")


def test_a_recorded_leader_joins(tmp_path):
    path = tmp_path / "trip.csv"
    path.write_text("time_s,vehicle,speed_mps\n" + "".join(f"{t},0,{20 + t % 3}\n" for t in range(60)))
    course = load_benchmark(leaders=[path]).courses[-1]
    assert (course.name, course.leader.kind, course.duration, course.sweep) == ("trip", "recorded", 59.0, False)


def test_an_entry_of_the_same_name_takes_the_place_of_the_standard_one(tmp_path):
    path = tmp_path / "b.toml"
    path.write_text(
        '[[models]]\nname = "IDM"\nmodel = "idm"\nparameters = { T = 1.1 }\nlate = ["s", "dv"]\nlag = 0.2\n'
    )
    b = load_benchmark(path)
    assert [e.name for e in b.entries] == ["OVM", "IDM", "GMM", "CACC"]
    car = b.entry("IDM").behind(onboard=0.7, radio=0.1)
    assert (car.model.T, car.lag, dict(car.delay)) == (1.1, 0.2, {"s": 0.7, "dv": 0.7})
    assert dict(b.entry("CACC").behind(onboard=0.7, radio=0.1).delay) == {"vl": 0.1, "al": 0.1}


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('[[models]]\nmodel = "idmm"', "models.0.model: 'idmm' is not known"),
        ('[[models]]\nmodel = "idm"\nparameters = { TT = 1 }', "'TT' is not known"),
        ('[[models]]\nmodel = "idm"\nadjust = ["Q"]', "models.0.adjust: 'Q' is not known"),
        ('[[models]]\nmodel = "cacc"\nlate = ["s", "al"]', "mixes radio with on-board"),
        ('[[models]]\nmodel = "idm"\nstart_gap = -1', "start_gap = -1 is not a positive"),
        ('[[models]]\nmodle = "idm"', "did you mean 'model'"),
        ('[[disturbances]]\nname = "x"', "disturbances.0.leader is missing"),
        ('[[disturbances]]\nname = "x"\nleader = { kind = "sinus" }', "disturbances.0: leader.kind: 'sinus'"),
        ('[[delays]]\nname = "x"\nonboard = -1', "delays.0.onboard = -1"),
        ('[[platoons]]\nname = "x"\norder = ["IDM", "CAC"]', "'CAC' is not known"),
        ('without = ["IDMM"]', "did you mean 'IDM'"),
        ('without = ["OVM", "IDM", "GMM", "CACC"]', "no models are left"),
        ("sweep = [1, 0]", "not a rising list"),
        ("follower = 3", "did you mean 'followers'"),
    ],
)
def test_what_is_typed_wrongly_is_one_sentence(tmp_path, cli, text, said):
    path = tmp_path / "b.toml"
    path.write_text(text, encoding="utf-8")
    code, out, err = cli("benchmark", path, "--out", tmp_path / "out")
    assert (code, out) == (2, "")
    assert said in err
    assert err.count("\n") == 1
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("name", ["OVM", "IDM", "CACC"])
def test_tuned_entries_share_the_gap_and_keep_all_else(name):
    entry = load_benchmark().entry(name)
    found = tuned(entry, 23.0, 50.0)
    assert found.model.equilibrium_gap(23.0) == pytest.approx(50.0, abs=1e-9)
    ratios = {n: found.model.parameters[n] / v for n, v in entry.model.parameters.items() if v}
    scaled = {ratios.pop(n) for n in entry.tune}
    assert max(scaled) == pytest.approx(min(scaled))
    assert set(ratios.values()) == {1.0}


def test_what_cannot_be_tuned_says_why():
    b = load_benchmark()
    assert tuned(b.entry("GMM"), 23.0, 50.0).start_gap == 50.0
    with pytest.raises(HeadwayError, match="no factor on T"):
        tuned(b.entry("IDM"), 23.0, 0.5)


# -- how it is scored ----------------------------------------------------------------------------


def cell(who, delays="none", course="a", onboard=0.0, view=PUBLISHED, reason="", **values):
    full = {"collisions": 0.0, "ttc": 5.0, "growth": 0.9, "roughness": 0.9, "energy": 0.9, "tracking": 0.5, **values}
    return Cell(view, who, course, delays, onboard, onboard, {} if reason else full, "", reason)


def board(*cells, sweep=(0.0, 0.5, 1.0)):
    entries = tuple(
        Entry(n, hw.Vehicle(hw.models.IDM()), ("s", "v", "dv"), None, (), (), "")
        for n in dict.fromkeys(c.who for c in cells)
    )
    courses = (Course("a", Sine(20, 1, 1), 10.0, True, False), Course("b", Brake(20, 5, 5), 10.0, True, False))
    benchmark = Benchmark(entries, courses, (Late("none"),), (), 5, 20.0, 30.0, 0.01, 0.1, sweep)
    return Board(benchmark, cells, {}, {}, {})


def ranks(found):
    return {s.who: s.ranks for s in found}


def test_ranks_share_their_places_and_go_the_right_way():
    found = ranks(scores.scoreboard(board(cell("x", ttc=2.0), cell("y", ttc=9.0), cell("z", ttc=2.0)), PUBLISHED))
    assert [found[w]["safety"] for w in "xyz"] == [2.5, 1.0, 2.5]
    assert [found[w]["comfort"] for w in "xyz"] == [2.0, 2.0, 2.0]
    found = ranks(scores.scoreboard(board(cell("x", growth=0.5), cell("y", growth=1.5)), PUBLISHED))
    assert [found[w]["string stability"] for w in "xy"] == [1.0, 2.0]


def test_who_collides_or_cannot_be_run_is_last_everywhere():
    cells = (cell("x", collisions=1.0, growth=1e-9, energy=0.0), cell("y", growth=3.0), cell("z", reason="no"))
    found = ranks(scores.scoreboard(board(*cells), PUBLISHED))
    for criterion in scores.CRITERIA:
        assert found["y"][criterion.name] == 1.0
        assert found["x"][criterion.name] == found["z"][criterion.name] == 2.5


def test_ranks_are_averaged_over_disturbances_of_any_size():
    cells = (
        cell("x", course="a", growth=100.0), cell("y", course="a", growth=200.0),
        cell("x", course="b", growth=0.2), cell("y", course="b", growth=0.1),
    )  # fmt: skip
    found = ranks(scores.scoreboard(board(*cells), PUBLISHED))
    assert found["x"]["string stability"] == found["y"]["string stability"] == 1.5


def test_a_criterion_is_held_until_the_first_delay_at_which_any_disturbance_breaks_it():
    string = next(c for c in scores.CRITERIA if c.name == "string stability")
    growth = {(0.0, "a"): 0.9, (0.0, "b"): 1.0, (0.5, "a"): 0.9, (0.5, "b"): 1.2, (1.0, "a"): 0.5, (1.0, "b"): 0.5}
    b = board(*(cell("x", SWEEP, course, t, growth=g) for (t, course), g in growth.items()))
    assert scores.held(b, "x", string) == 0.0
    assert scores.lost(b, "x", string) == ["b"]
    safety = scores.CRITERIA[0]
    assert scores.held(b, "x", safety) == 1.0
    assert scores.lost(b, "x", safety) == []
    hit = board(*(cell("x", SWEEP, "a", t, collisions=1.0) for t in (0.0, 0.5, 1.0)))
    assert math.isnan(scores.held(hit, "x", safety))


def test_bounds_hold_as_they_are_stated():
    safety, string = scores.CRITERIA[:2]
    assert scores.holds([cell("x", ttc=1.5)], safety)
    assert not scores.holds([cell("x", ttc=5.0), cell("x", ttc=1.49)], safety)
    assert scores.holds([cell("x", growth=1.0005)], string)
    assert not scores.holds([cell("x", growth=1.002)], string)
    assert not scores.holds([cell("x", reason="no")], string)


def test_trade_offs_are_named_where_orders_run_against_each_other():
    one, other = scores.CRITERIA[2], scores.CRITERIA[4]
    cells = [cell(w, roughness=r, tracking=1.0 - r) for w, r in (("x", 0.1), ("y", 0.5), ("z", 0.9))]
    assert guidance._agreement(cells, one, other) == (-1.0, 3)
    assert guidance._agreement([*cells, cell("w", collisions=1.0)], one, other) == (-1.0, 3)
    many = [cell(c.who, course=f"c{i}", **c.values) for i in range(4) for c in cells]
    found = guidance.trade_offs(board(*many), scores.scoreboard(board(*many), PUBLISHED), ())
    assert any(t.startswith("- **comfort against responsiveness**") and "100%" in t for t in found)


def test_the_tolerance_of_energy_is_its_own_and_stated():
    energy = next(c for c in scores.CRITERIA if c.name == "energy")
    assert scores.holds([cell("x", energy=1.0023)], energy)
    assert not scores.holds([cell("x", energy=1.006)], energy)


def test_who_mostly_collides_is_not_said_to_be_good_at_anything():
    cells = [cell("x", course=f"c{i}", collisions=float(i > 0)) for i in range(4)]
    cells += [cell("y", course=f"c{i}") for i in range(4)]
    found = guidance.trade_offs(board(*cells), scores.scoreboard(board(*cells), PUBLISHED), ())
    assert any(t.startswith("- **x** collides in 3 of 4 runs: it fails all criteria there") for t in found)
    assert not any(t.startswith("- **x** ranks best") for t in found)
    assert any(t.startswith("- **y** ranks best") for t in found)


def test_the_order_stands_beside_that_at_the_same_gap():
    one = [cell("x", ttc=9.0, growth=0.5), cell("y", ttc=2.0, growth=0.9)]
    other = [dataclasses.replace(c, view=TUNED, values={**c.values, "collisions": float(c.who == "x")}) for c in one]
    found = guidance.findings(board(*one, *other), (), ())
    assert "It depends on the distance that each keeps: all tuned to 30 m at 20 m/s it is y (1.0), x" in found[0]
    assert "x (2.0, collides in 1 of 1 runs)" in found[0]


def test_braking_beyond_any_car_is_named():
    cells = (cell("x", braking=-65.0), cell("x", course="b", braking=-9.0), cell("y", braking=-3.0))
    found = guidance.findings(board(*cells), (), ())
    assert any("harder than 10 m/s²: x in 1 of 2 runs, at 65 m/s² at most" in text for text in found)
    assert not any("Braking beyond" in text for text in guidance.findings(board(cell("y", braking=-3.0)), (), ()))


# -- what it says --------------------------------------------------------------------------------


def test_every_cell_is_there_and_failures_say_why(outcome):
    b = outcome.board
    assert len(b.select(PUBLISHED, "none")) == 3 * 2
    assert len(b.select(TUNED)) == 2 * 2 * 2  # one cannot be tuned
    assert len(b.select(MIXED)) == 2 * 2
    assert len(b.select(PUBLISHED, SWEEP)) == 3 * 2 * 3
    assert {c.who for c in b.failed} == {"too slow"}
    assert all("no equilibrium at 23 m/s" in c.reason for c in b.failed)
    assert "says in no `tune`" in b.untuned["too slow"]
    rows = list(csv.DictReader(io.StringIO(outcome.table())))
    assert len(rows) == len(b.cells)
    first = next(r for r, c in zip(rows, b.cells, strict=True) if not c.reason)
    assert float(first["ttc [s]"]) == next(c for c in b.cells if not c.reason).values["ttc"]


def test_the_board_says_what_single_runs_say(outcome):
    found = next(c for c in outcome.board.select(PUBLISHED, "realistic", "IDM") if c.course == "brake")
    b = outcome.board.benchmark
    leader = next(c.leader for c in b.courses if c.name == "brake")
    car = hw.Vehicle(hw.models.IDM(v0=33.33), delay=1.5)
    tr = hw.simulate(hw.Scenario(leader, [car] * 5, duration=80, dt=b.dt, output_step=b.output_step))
    assert found.values["collisions"] == tr.collision_time.notnull().sum() > 0
    cooperative = next(c for c in outcome.board.select(PUBLISHED, "none", "CACC") if c.course == "brake")
    tr = hw.simulate(
        hw.Scenario(leader, [hw.Vehicle(hw.models.CACC())] * 5, duration=80, dt=b.dt, output_step=b.output_step)
    )
    assert cooperative.values["peak_error"] == float(hw.metrics.peak(tr.spacing_error).max())


def test_theory_stands_beside_the_growth_that_was_simulated(outcome):
    assert steady_course(outcome.board.benchmark).name == "harmonic"
    by = {(t.who, t.delays): t for t in outcome.theory}
    for delays in ("none", "realistic"):
        cacc = by["CACC", delays]
        assert cacc.measured == pytest.approx(cacc.gain, rel=1e-6)  # a linear law
    idm = by["IDM", "none"]
    assert idm.measured == pytest.approx(idm.gain, rel=0.01)
    assert idm.string_stable
    assert not by["IDM", "realistic"].string_stable
    assert "no equilibrium" in by["too slow", "none"].reason


def test_advice_is_the_critical_value_of_theory_confirmed_by_simulation(outcome):
    found = next(a for a in outcome.advice if a.who == "IDM" and a.delay == 1.5)
    exact = hw.linearize(hw.Vehicle(hw.models.IDM(v0=33.33), delay=1.5), 23).critical("T")
    assert found.critical == pytest.approx(exact, rel=1e-9)
    assert found.least
    assert found.confirmed
    below, above = found.sides
    assert not below.stable
    assert above.stable
    assert below.measured > 1.0 > above.measured
    assert found.sentence.startswith("At 1.5 s reaction delay IDM needs T ≥ 1.96 s to be string stable")
    stated = float(re.search(r"≥ ([\d.]+)", found.sentence)[1])
    assert 0 <= stated - exact < 0.01  # rounded to the safe side
    assert any("T ≥ 1.96 s" in text for text in outcome.findings)


@pytest.mark.parametrize(
    ("number", "up", "said"),
    [(1.9553, True, "1.96"), (1.9553, False, "1.95"), (44.01, True, "44.1"), (2.0, True, "2.00")],
)
def test_advice_is_rounded_to_the_safe_side(number, up, said):
    assert guidance._rounded(number, up) == said


def test_advice_that_simulation_contradicts_says_so():
    sides = (guidance.Side(0.9, False, 0.5, 1.1, 0.99), guidance.Side(1.1, True, 0.5, 0.9, 0.98))
    told = guidance.Advice("IDM", 0.5, False, "T", "s", 0.8, False, 1.0, True, sides, 23.0)
    assert not told.confirmed
    assert "**not** confirmed" in told.sentence


LEADER_LAW = """
import headway as hw

@hw.model
def far(s, v, dv, v0l, *, k=0.2, c=0.6, far=0.4, s0=10.0):
    return k * (s - s0) + c * dv + far * (v0l - v)
"""

LEADER_FILE = """
without = ["OVM", "GMM", "CACC", "windowed", "step", "square", "sawtooth", "multisine", "chirp", "WLTC", "US06",
           "HWFET", "brake", "150 ms for all", "one IDM among CACC", "one CACC among IDM"]
sweep = [0.0]

[[models]]
name = "far"
model = "far"
adjust = ["k"]

[[platoons]]
name = "both"
order = ["IDM", "far"]
"""


def test_a_law_that_hears_the_platoon_leader_has_no_verdict_per_vehicle_and_the_reason(tmp_path):
    (tmp_path / "law.py").write_text(LEADER_LAW)
    (tmp_path / "own.toml").write_text(LEADER_FILE)
    found = run_benchmark(load_benchmark(tmp_path / "own.toml", laws=hw.load_laws(f"{tmp_path / 'law.py'}:far")))
    far = [t for t in found.theory if t.who == "far"]
    assert far
    for t in far:
        assert t.string_stable is None
        assert t.locally_stable is True  # a single vehicle has a verdict of its own
        assert "hears the platoon leader" in t.reason
        assert t.gap == pytest.approx(10.0)
        assert t.flow == pytest.approx(3600 * 23 / (10.0 + 5.0))
        assert math.isinf(t.critical_local)
        assert all(map(math.isnan, (t.peak_gain, t.peak_frequency, t.gain, t.critical_string)))
    assert not [a for a in found.advice if a.who == "far"]
    (sentence,) = [text for text in found.findings if "No string verdict on far" in text]
    assert "hears the platoon leader" in sentence
    assert all(m.strict is None and "hears the platoon leader" in m.reason for m in found.mixed)
    table = next(t for n, t in benchmark_report(found).tables().items() if n.startswith("theory-exact"))
    words = {row[2] for row in table.rows if row[0] == "far"}
    assert all("hears the platoon leader" in text for text in words)
    assert "stable" not in {row[2] for row in table.rows if row[0] == "far"}
    entry = json.loads(json.dumps(found.as_json()))["theory"][-1]
    assert (entry["who"], entry["locally_stable"], entry["string_stable"]) == ("far", True, None)


def test_without_an_equilibrium_theory_has_no_verdict_at_all(outcome):
    slow = [t for t in outcome.theory if t.who == "too slow"]
    assert slow
    assert all(t.locally_stable is None and t.string_stable is None and "no equilibrium" in t.reason for t in slow)


def test_the_report_holds_all_of_it(outcome):
    page = benchmark_report(outcome, {"small.toml": SMALL})
    anchors = [s.anchor for s in page.sections]
    for name in (
        "scoreboard",
        "guidance",
        "theory",
        "robustness",
        "mixed",
        "fairness",
        "failed",
        "methods",
        "parameters",
    ):
        assert name in anchors
    assert {f"behind-{c.name}" for c in outcome.board.benchmark.courses} <= set(anchors)
    table = next(t for n, t in page.tables().items() if n.startswith("parameters-every"))
    for entry in outcome.board.benchmark.entries:
        assert {row[1] for row in table.rows if row[0] == entry.name} >= set(entry.model.parameters)
    assert any("Treiber" in source for source in page.citations)
    assert page.data["small.toml"] == SMALL
    assert all(len(picture.alt) > 20 for picture in page.pictures())


def test_the_same_benchmark_has_the_same_cells(outcome, small):
    again = run_board(load_benchmark(small))
    assert repr(again.cells) == repr(outcome.board.cells)  # as text: NaN differs from itself


TINY = """
without = ["OVM", "GMM", "CACC", "windowed", "step", "brake", "square", "sawtooth", "multisine", "chirp", "WLTC",
           "US06", "HWFET", "150 ms for all", "realistic"]
sweep = [0.0]

[[models]]
name = "too slow"
model = "idm"
parameters = { v0 = 20.0 }
"""


def test_the_command_writes_the_report_and_names_it(tmp_path, cli):
    path = tmp_path / "tiny.toml"
    path.write_text(TINY, encoding="utf-8")
    code, out, err = cli("benchmark", path, "--out", tmp_path / "out", "--format", "md", "--json")
    assert (code, err) == (0, "")
    found = json.loads(out)
    assert found["report"] == str(tmp_path / "out" / "report.md")
    assert [s["model"] for s in found["scores"]] == ["IDM", "too slow"]
    assert "no equilibrium" in found["failed"][0]["reason"]
    assert found["theory"][1]["critical_local"] is None
    assert "IDM" in (tmp_path / "out" / "report.md").read_text(encoding="utf-8")
    assert (tmp_path / "out" / "data" / "tiny.toml").read_text(encoding="utf-8") == TINY


def test_the_guide_says_how_to_enter_a_model(tmp_path):
    guide = (Path(__file__).resolve().parents[2] / "docs" / "benchmark.md").read_text(encoding="utf-8")
    (tmp_path / "own.toml").write_text(re.search(r"```toml\n(.*?)```", guide, re.S)[1], encoding="utf-8")
    b = load_benchmark(tmp_path / "own.toml")
    assert [e.name for e in b.entries] == ["IDM", "GMM", "CACC", "IDM, short gap"]
    assert b.entry("IDM, short gap").adjust == ("T",)
    assert (b.courses[-1].name, b.cases[-1].onboard, b.platoons[-1].name) == ("slow wave", 0.7, "two and two")
    for criterion in scores.CRITERIA:
        assert f"| {criterion.name} |" in guide


def test_the_example_is_a_benchmark():
    b = load_benchmark(Path(__file__).resolve().parents[2] / "examples" / "benchmark.toml")
    assert {"FVDM", "IDM, short gap"} < {e.name for e in b.entries}


def test_quick_is_a_part_of_the_whole():
    whole = load_benchmark()
    part = whole.quick()
    assert [c.name for c in part.courses] == ["harmonic", "brake", "WLTC"]
    assert part.sweep == (0.0, 0.5, 1.0, 1.5)
    assert part.entries == whole.entries


def test_a_file_says_what_is_quick(tmp_path):
    (tmp_path / "own.toml").write_text(
        'without = ["harmonic", "brake", "WLTC"]\n[[disturbances]]\nname = "wave"\nquick = true\nduration = 20\n'
        'leader = { kind = "triangle", mean = 23, amplitude = 1, omega = 1 }\n'
    )
    assert [c.name for c in load_benchmark(tmp_path / "own.toml").quick().courses] == ["wave"]
    (tmp_path / "own.toml").write_text('without = ["harmonic", "brake", "WLTC"]')
    assert [c.name for c in load_benchmark(tmp_path / "own.toml").quick().courses] == ["windowed"]
    (tmp_path / "own.toml").write_text(
        '[[disturbances]]\nname = "x"\nquick = 3\nleader = { kind = "constant", speed = 3 }'
    )
    with pytest.raises(hw.HeadwayError, match=r"disturbances\.0"):
        load_benchmark(tmp_path / "own.toml")
