"""The ready scenarios: complete, well described, and right where theory or the oracles say what must come out."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest
from late import late

from headway.engine.simulate import simulate
from headway.errors import HeadwayError
from headway.library import library, library_scenario, library_table
from headway.scenario.document import from_table, from_toml, override

MODELS = ("idm", "ovm", "gmm", "cacc")

#: rows of the paper's table of experiments that are simulations, and the scenarios of each
EXPERIMENTS = {
    "idm-1": ["idm-1", "idm-1-w063"],
    "idm-2": ["idm-2"],
    "ovm": ["ovm", "ovm-equilibrium"],
    "gmm-1": ["gmm-1"],
    "gmm-2": ["gmm-2"],
    "gmm-3": ["gmm-3"],
    "cacc-1": ["cacc-1", "cacc-1-fitted"],
    "cacc-2": ["cacc-2", "cacc-2-fitted"],
    "cacc-3": ["cacc-3", "cacc-3-fitted"],
    "compare-0": [*(f"compare-0-{m}" for m in MODELS), "compare-0-cacc-fitted"],
    "compare-150": [*(f"compare-150-{m}" for m in MODELS), "compare-150-cacc-fitted"],
    "compare-real": [f"compare-real-{m}" for m in MODELS],
    "idm-window": ["idm-window"],
    "ovm-window": ["ovm-window"],
    "gmm-window": ["gmm-window"],
    "cacc-window": ["cacc-window", "cacc-window-fitted"],
    **{
        f"{m}-nonharmonic": [f"{m}-nonharmonic{shape}" for shape in ("", "-sawtooth", "-multisine")]
        for m in ("idm", "ovm", "gmm")
    },
    "cacc-nonharmonic": [f"cacc-nonharmonic{shape}" for shape in ("", "-sawtooth", "-multisine", "-h06")],
    "step": [f"step-{m}" for m in MODELS],
    "delay-sweep": [f"delay-sweep-{m}" for m in MODELS],
}
EXAMPLES = [f"wltc{stops}-{m}" for stops in ("", "-stops") for m in MODELS]
NAMES = sorted(library())


def run(name, *changes):
    table = library_table(name)
    for change in changes:
        override(table, change)
    return simulate(from_table(table))


def peaks(dataset, variable="spacing_error"):
    """Greatest absolute value of each follower, refined by a parabola through the greatest sample."""
    found = []
    for values in np.abs(dataset[variable].values[1:]):
        i = int(values.argmax())
        if 0 < i < values.size - 1:
            a, b, c = values[i - 1 : i + 2]
            found.append(b - (a - c) ** 2 / (8 * (a - 2 * b + c)))
        else:
            found.append(values[i])
    return np.array(found)


def test_every_experiment_has_its_scenarios_and_there_are_no_others():
    expected = {f"paper:{n}" for names in EXPERIMENTS.values() for n in names} | {f"example:{n}" for n in EXAMPLES}
    assert set(library()) == expected


@pytest.mark.parametrize("name", NAMES)
def test_scenario_is_described_and_survives_a_round_trip(name):
    scenario = library_scenario(name)
    assert scenario.name == name
    assert from_toml(scenario.to_toml()) == scenario
    one_line = library()[name]
    assert "\n" not in one_line
    assert 20 < len(one_line) < 140
    if name.startswith("paper:"):
        assert "S: " in scenario.description
        assert "U: " in scenario.description
        assert scenario.leader_length == 0
        assert all(f.length == 0 for f in scenario.followers)


@pytest.mark.parametrize("name", NAMES)
def test_scenario_simulates(name):
    scenario = library_scenario(name)
    result = simulate(scenario)
    assert result.sizes["vehicle"] == len(scenario.followers) + 1
    assert float(result.time[-1]) == pytest.approx(scenario.end)
    ended = result.collision_time.values
    whole = np.flatnonzero(np.isfinite(ended))
    rows = result.sizes["vehicle"] if whole.size == 0 else int(whole[0])
    assert np.isfinite(result.speed.values[:rows]).all()
    assert float(result.speed.min()) >= 0.0
    # what is recorded at a time is what happened at that time, also after collisions
    position, _, _ = scenario.motion.at(result.time.values)
    np.testing.assert_allclose(result.position.values[0], position - position[0], atol=1e-9)


@pytest.mark.parametrize("name", [n for n in NAMES if "compare" in n or "delay-sweep" in n])
def test_delays_are_applied_as_the_paper_reads(name):
    case, model = name.removeprefix("paper:").rsplit("-", 1)[0], name.split("-")[-1]
    cacc = "cacc" in name
    delay = 0.75 if "sweep" in case else {"0": 0.0, "150": 0.15, "real": 0.15 if cacc else 1.5}[name.split("-")[1]]
    dv = set() if model == "ovm" else {"dv ahead", "dv own"}
    signals = {"vl", "al"} if cacc else {"s", "v"} | dv
    assert late(library_scenario(name).followers[0]) == (dict.fromkeys(signals, delay) if delay else {})


def test_wltc_is_driven_without_collision():
    for name in EXAMPLES:
        result = simulate(library_scenario(f"example:{name}"))
        assert not result.collision_time.notnull().any()
        assert float(result.gap.min()) > 0


class TestPhysics:
    """Numbers from the oracles (closed forms and an independent integration)."""

    def test_cacc_without_delay_keeps_its_policy_within_three_quarters_of_a_metre(self):
        windowed = peaks(run("paper:cacc-window", "followers.0.delay=0"), "policy_error")
        np.testing.assert_allclose(
            windowed, [0.748653168745, 0.454723651063, 0.291011309125, 0.189895719455, 0.125722889167], atol=1e-4
        )
        steady = run("paper:compare-0-cacc", "duration=100").policy_error.sel(vehicle=1, time=slice(60, 100))
        assert float(np.abs(steady).max()) == pytest.approx(0.746031979923, abs=1e-4)

    def test_idm_compared_without_delay(self):
        np.testing.assert_allclose(
            peaks(run("paper:compare-0-idm")),
            [4.77485699682, 2.03750961668, 1.35261937853, 0.954555125877, 0.706775892856],
            atol=2e-5,
        )

    def test_idm_configuration_1_amplifies(self):
        np.testing.assert_allclose(
            peaks(run("paper:idm-1")), [21.509417321, 36.8611718727, 67.6224016435, 112.713098915], atol=5e-5
        )

    def test_equilibrium_gaps_of_ovm(self):
        assert library_scenario("paper:ovm-window").initial_gaps()[0] == pytest.approx(4.13790189492, abs=1e-9)
        assert library_scenario("paper:ovm-equilibrium").initial_gaps()[0] == pytest.approx(4.046, abs=1e-3)
        assert library_scenario("paper:ovm").initial_gaps() == (6.0,) * 4

    def test_invariant_of_gmm(self):
        for name, invariant in (
            ("paper:gmm-1", lambda s, v: v - 1.5 * np.log(s)),
            ("paper:gmm-2", lambda s, v: np.log(v) + 1.5 / s),
            ("paper:gmm-3", lambda s, v: v / s**1.5),
        ):
            result = run(name).isel(vehicle=slice(1, None))
            kept = invariant(result.gap, result.speed)
            assert float(np.abs(kept - kept.isel(time=0)).max()) < 1e-7

    def test_step_is_braking_and_return(self):
        leader = run("paper:step-idm").speed.sel(vehicle=0)
        assert [float(leader.sel(time=t)) for t in (0, 5, 5.5, 6, 15, 16, 50)] == pytest.approx(
            [23, 23, 20.5, 18, 18, 23, 23]
        )


def test_names_are_read_without_numpy():
    code = "import sys; from headway.library import library; assert library(); assert 'numpy' not in sys.modules"
    subprocess.run([sys.executable, "-c", code], check=True)


def test_table_belongs_to_the_caller():
    library_table("paper:idm-2")["duration"] = 1
    assert library_table("paper:idm-2")["duration"] == 60


def test_unknown_name_gets_the_nearest():
    with pytest.raises(HeadwayError, match=r"ready scenario: 'paper:idm2' is not known.*did you mean 'paper:idm-2'\?"):
        library_scenario("paper:idm2")
