"""Studies: points, bits, metrics, theory, and what is typed wrongly."""

from __future__ import annotations

import dataclasses
import functools
import warnings
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from study_cases import mixed

import headway as hw
from headway.engine.simulate import simulate
from headway.errors import HeadwayError, HeadwayWarning
from headway.limits import LIMITS
from headway.metrics import summary
from headway.models import CACC, FVDM, IDM, OVM
from headway.scenario.leaders import Brake, Sine
from headway.scenario.scenario import Scenario
from headway.scenario.vehicle import Vehicle
from headway.study.axes import between
from headway.study.study import Study

SCENARIO = Scenario(Sine(20.0, 1.0, 0.5), [Vehicle(IDM(a=1.5), delay=0.2)] * 3, duration=10.0, dt=0.05)


def assert_as_simulated(study: Study, found, numbers) -> None:
    """Metrics of these points have the bits that `simulate` and `summary` give."""
    for i in numbers:
        alone = summary(simulate(study.scenario_at(i)))
        for name in alone:
            ours = found[name].values.reshape(-1, found.sizes["vehicle"])[i]
            np.testing.assert_array_equal(ours[: alone.sizes["vehicle"]], alone[name].values, err_msg=f"{name} at {i}")


# -- bits ------------------------------------------------------------------------------------------


def test_metrics_have_the_bits_of_simulate():
    study = mixed()
    found = study.run()
    valid = np.flatnonzero(found.status.values.ravel() == "ok")
    assert valid.size == 24
    assert_as_simulated(study, found, valid)


@pytest.mark.parametrize(
    ("law", "axes"),
    [
        (OVM(alpha=2.0, v0=16.0, h=25.0, w=30.0), {"alpha": [1.0, 2.5], "v0": [15.0, 18.0], "w": [20.0, 31.0]}),
        (FVDM(v0=15.0, h=14.0, w=8.0), {"lam": [0.1, 0.9], "h": [12.0, 15.0]}),
        (IDM(), {"v0": between(25.0, 40.0, 7), "T": [1.0, 1.7]}),
        (IDM(), {"delta": [3.0, 4.0, 4.5], "length": [4.0, 6.0]}),
    ],
)
def test_equilibria_have_the_bits_of_simulate(law, axes):
    study = Study(dataclasses.replace(SCENARIO, followers=[Vehicle(law, delay=0.1)] * 2), axes)
    assert_as_simulated(study, study.run(), range(study.points.count))


@pytest.mark.parametrize(
    "axes",
    [
        {"leader.amplitude": [0.5, 1.0], "leader.mean": [18.0, 21.0]},
        {"delay": [0.0, 0.13, 0.4], "lag": [0.0, 0.2]},
        {"delay.vl": [0.0, 0.3]},
        {"followers.count": [1, 3, 2]},
        {"gap_offsets.2": [-1.0, 2.0], "initial_speed": [19.0, 20.0]},
        {"output_step": [0.05, 0.3, 1.0], "dt": [0.02, 0.05], "scheme": ["rk4", "ballistic"]},
        {"order": [[2, 1, 3], 4], "followers.0.parameters.T": [1.2]},
        {"duration": [3.0, 10.0]},
    ],
)
def test_every_kind_of_field_can_be_an_axis(axes):
    study = Study(SCENARIO, axes)
    found = study.run()
    assert (found.status == "ok").all(), found.message.values
    assert_as_simulated(study, found, range(study.points.count))


@pytest.mark.parametrize("scheme", ["rk4", "ballistic"])
def test_points_with_stops_and_collisions_have_the_bits_of_simulate(scheme):
    cars = [Vehicle(IDM(T=0.8), delay=0.3), Vehicle(FVDM(v0=15.0, h=14.0, w=8.0))]
    scenario = Scenario(Brake(12.0, 5.0, hold=4.0, ramp=1.5), cars, duration=12.0, dt=0.05, scheme=scheme)
    axes = {"leader.drop": [2.0, 11.5], "followers.1.parameters.alpha": [0.05, 0.8], "lam": [0.02, 0.6]}
    study = Study(scenario, axes)
    found = study.run()
    assert set(found.status.values.ravel()) == {"ok", "collision"}
    assert np.isfinite(found.collision_time.values).any()
    assert_as_simulated(study, found, range(study.points.count))


def test_same_bits_from_every_executor_and_piece():
    study = mixed()
    expected = study.run()
    assert set(expected.status.values.ravel()) == {"ok", "invalid"}
    assert study.run(executor="threads").identical(expected)
    assert study.run(chunk=1).identical(expected)
    assert study.run(executor="threads", chunk=5).identical(expected)
    with ThreadPoolExecutor(2) as pool:
        assert study.run(executor=pool, chunk=7).identical(expected)
    assert study.run(executor="processes", chunk=4).identical(expected)


# -- points ----------------------------------------------------------------------------------------


def test_a_grid_has_a_dimension_for_each_axis():
    found = Study(SCENARIO, {"T": [1.0, 1.5, 2.0], "delay": [0.0, 0.2]}).run(["peak_spacing_error"])
    assert found.peak_spacing_error.dims == ("T", "delay", "vehicle")
    assert found.sizes == {"T": 3, "delay": 2, "vehicle": 4}
    assert found.peak_spacing_error.attrs["units"] == "m"
    one = summary(simulate(dataclasses.replace(SCENARIO, followers=[Vehicle(IDM(a=1.5, T=1.5), delay=0.2)] * 3)))
    np.testing.assert_array_equal(found.peak_spacing_error.sel(T=1.5, delay=0.2), one.peak_spacing_error)


def test_zipped_axes_share_a_dimension():
    found = Study(SCENARIO, {("T", "a"): ([1.0, 1.5], [0.8, 1.6]), "delay": [0.0, 0.1, 0.2]})
    assert found.points.dims == {"T+a": 2, "delay": 3}
    assert found.scenario_at(5).followers[0].model.parameters["a"] == 1.6
    zipped = Study(SCENARIO, {"T": [1.0, 1.5], "delay": [0.0, 0.1]}, design="zip")
    assert zipped.points.dims == {"point": 2}
    assert zipped.scenario_at(1).followers[0].delay == 0.1


@pytest.mark.parametrize("design", ["sobol", "latin", "random"])
def test_designs_fill_the_range_and_are_seeded(design):
    axes = {"T": between(1.0, 2.0), "leader.omega": between(0.01, 1.0, log=True), "a": [1.0, 1.5]}
    points = Study(SCENARIO, axes, design, 64, seed=3).points
    again, other = (Study(SCENARIO, axes, design, 64, seed=s).points for s in (3, 4))
    for path in points.values:
        np.testing.assert_array_equal(points.values[path], again.values[path])
    assert (points.values["T"] != other.values["T"]).all()
    assert points.values["T"].min() < 1.1 < 1.9 < points.values["T"].max()
    assert np.median(points.values["leader.omega"]) == pytest.approx(0.1, rel=0.5)
    assert set(points.values["a"]) == {1.0, 1.5}


def test_shares_are_placed_by_the_seed_and_grow_in_place():
    truck = Vehicle(IDM(T=2.0), length=16.0)
    scenario = dataclasses.replace(SCENARIO, followers=SCENARIO.followers[:1] * 10)
    study = Study(scenario, {"seed": [0, 1], "share.truck": [0.0, 0.3, 0.6]}, types={"truck": truck})
    places = [{n for n, v in enumerate(study.scenario_at(i).followers) if v == truck} for i in range(6)]
    assert [len(p) for p in places] == [0, 3, 6, 0, 3, 6]
    assert places[1] < places[2]
    assert places[1] != places[4]


def test_trajectories_are_kept_for_chosen_points():
    study = Study(SCENARIO, {"T": [1.0, 1.5], "duration": [5.0, 10.0]})
    found = study.run(keep=[0, 3])
    assert found.speed.dims == ("kept", "vehicle", "time")
    alone = simulate(study.scenario_at(0))
    np.testing.assert_array_equal(found.speed.sel(kept=0).dropna("time"), alone.speed)
    assert np.isfinite(found.speed.sel(kept=3)).all()


def test_a_metric_of_ones_own_gets_trajectories():
    def spread(run):
        return run.speed.max() - run.speed.min()

    def last(run):
        return run.gap.isel(time=-1)

    study = Study(SCENARIO, {"T": [1.0, 1.5]})
    found = study.run([spread, last, "least_gap"])
    assert found.spread.dims == ("T",)
    assert found["last"].dims == ("T", "vehicle")
    for i in range(2):
        run = simulate(study.scenario_at(i))
        assert found.spread.values[i] == float(spread(run))
        np.testing.assert_array_equal(found["last"].values[i], last(run))
        np.testing.assert_array_equal(found.least_gap.values[i], summary(run).least_gap)


# -- theory ----------------------------------------------------------------------------------------


@functools.cache
def waves(count: int, end: float) -> np.ndarray:
    return np.exp(-1j * np.outer(np.linspace(0.1, 3.0, 60), np.linspace(0.0, end, count)))


def growth(run):
    """Largest gain of the last vehicle over the one ahead, over frequencies of a pulse that has passed."""
    time, speed = run.time.values, run.speed.values - run.speed.values[0, 0]
    if not np.isfinite(speed).all():
        return run.speed.isel(vehicle=0, time=0) * 0.0 + np.inf
    spectrum = waves(time.size, float(time[-1])) @ speed.T
    return run.speed.isel(vehicle=0, time=0) * 0.0 + np.abs(spectrum[:, -1] / spectrum[:, -2]).max()


def disagreements(count: int, executor: str = "serial") -> tuple[int, int, int]:
    """Points of a (T, delay) grid, those where simulation contradicts theory, and those of them beyond a cell."""
    scenario = Scenario(Brake(20.0, 1e-3, hold=0.5, ramp=0.5), [Vehicle(IDM(a=1.2))], duration=150.0, dt=0.1)
    study = Study(scenario, {"T": between(0.4, 2.4, count), "delay": between(0.0, 1.2, count)})
    measured = study.run([growth], executor).growth.values > 1.0
    exact = study.stability(executor).string_stable.values == 0.0
    assert 0.2 < exact.mean() < 0.8
    near = np.zeros_like(exact)
    for axis in (0, 1):
        edge = np.diff(exact.astype(int), axis=axis) != 0
        low, high = [slice(None)] * 2, [slice(None)] * 2
        low[axis], high[axis] = slice(None, -1), slice(1, None)
        near[tuple(low)] |= edge
        near[tuple(high)] |= edge
    wrong = measured != exact
    return exact.size, int(wrong.sum()), int((wrong & ~near).sum())


def test_simulated_growth_agrees_with_theory_but_at_the_boundary():
    points, _, beyond = disagreements(14)
    assert points == 196
    assert beyond == 0


def test_theory_has_the_same_axes_and_marks_what_is_not_allowed():
    study = Study(SCENARIO, {"T": [1.0, -1.0, 2.0], "delay": [0.0, 0.2]})
    found = study.stability()
    assert found.string_stable.dims == ("T", "delay")
    assert (found.status.sel(T=-1.0) == "invalid").all()
    linear = hw.linearize(study.scenario_at(4).followers[0], 20.0)
    assert found.string_stable.sel(T=2.0, delay=0.0) == linear.string_stable
    assert float(found.margin.sel(T=2.0, delay=0.0)) == pytest.approx(linear.margin, abs=1e-10)
    assert study.stability("threads").identical(found)


# -- typed wrongly ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("axes", "options", "words"),
    [
        ({"Tt": [1.0]}, {}, "Tt names no field of the scenario"),
        ({"leader.amplitud": [1.0]}, {}, "did you mean 'amplitude'"),
        ({"followers.3.delay": [0.1]}, {}, "they are followers.0 to 0"),
        ({"followers.0.parameters.TT": [1.0]}, {}, "did you mean 'T'"),
        ({"followers.0.dely": [1.0]}, {}, "did you mean 'delay'"),
        ({"delay.q": [1.0]}, {}, "axes.delay.q: signal"),
        ({"share.bus": [0.5]}, {}, "type of vehicle"),
        ({"T": []}, {}, "axes.T: there are no values"),
        ({"T": 1.5}, {}, "axes.T: 1.5 is not a list of values"),
        ({"T": {"from": 1.0, "too": 2.0}}, {}, "did you mean 'to'"),
        ({"T": {"from": 2.0, "to": 1.0}}, {}, "is greater than"),
        ({"T": {"from": 1.0, "to": 2.0}}, {}, "axes.T: count is missing"),
        ({"T": [1.0], "parameters.T": [1.0]}, {}, "parameters.T names no field"),
        ({"T": [1.0, 2.0], "delay": [0.1]}, {"design": "zip"}, "T has 2, delay has 1"),
        ({("T", "a"): ([1.0, 2.0], [1.0])}, {}, "T has 2, a has 1"),
        ({"T": [1.0]}, {"design": "sobl"}, "did you mean 'sobol'"),
        ({"T": [1.0]}, {"design": "sobol"}, "sobol needs count"),
        ({"T": [1.0]}, {"count": 3}, "as many points as its axes say"),
    ],
)
def test_axes_typed_wrongly(axes, options, words):
    with pytest.raises(HeadwayError, match=words.replace(".", r"\.")):
        Study(SCENARIO, axes, **options)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"metrics": ["peak_spacing_eror"]}, "did you mean 'peak_spacing_error'"),
        ({"metrics": ["rms_gap", "rms_gap"]}, "rms_gap is given twice"),
        ({"executor": "treads"}, "did you mean 'threads'"),
        ({"executor": 3}, "executor = 3 is neither"),
        ({"chunk": 0}, "chunk = 0 is not a whole number"),
        ({"shard": (1, 2)}, "needs a store"),
        ({"shard": (3, 2), "store": "x"}, "shard 3/2 does not exist"),
    ],
)
def test_runs_typed_wrongly(options, words):
    with pytest.raises(HeadwayError, match=words):
        Study(SCENARIO, {"T": [1.0]}).run(**options)


def test_points_that_are_not_allowed_are_marked_and_the_rest_runs():
    study = Study(SCENARIO, {"T": [1.0, 11.0], "leader.amplitude": [1.0, 30.0], "v0": [18.0, 33.0]})
    found = study.run()
    assert found.status.values.tolist() == [
        [["invalid", "ok"], ["invalid", "invalid"]], [["invalid", "invalid"], ["invalid", "invalid"]],
    ]  # fmt: skip
    assert "no equilibrium at 20 m/s" in str(found.message.values[0, 0, 0])
    assert "would drive backwards" in str(found.message.values[0, 1, 1])
    assert "T = 11 s is out of bounds; allowed is 0 to 10 s" in str(found.message.values[1, 0, 1])
    assert np.isnan(found.least_gap.values[1]).all()


def test_a_metric_that_fails_is_recorded():
    def picky(run):
        if run.speed.values[1].max() > 20.9:
            raise KeyError("no")
        return run.speed.max()

    found = Study(SCENARIO, {"leader.amplitude": [0.1, 5.0]}).run([picky])
    assert found.status.values.tolist() == ["ok", "failed"]
    assert "metric picky failed (KeyError: 'no')" in str(found.message.values[1])


def test_a_wrong_type_is_called_by_its_own_place(tmp_path):
    (tmp_path / "s.toml").write_text(
        'duration = 5\n[leader]\nkind = "constant"\nspeed = 20\n[[followers]]\nmodel = "idm"\n'
        '[axes]\nseed = [0]\n[types.truck]\nmodel = "idm"\nlag = -1\n'
    )
    with pytest.raises(hw.HeadwayError, match=r"^types\.truck\.lag = -1"):
        hw.load_study(tmp_path / "s.toml")


# -- delays ----------------------------------------------------------------------------------------

LATE = [
    ({"delay": [0.3]}, {"s": 0.3, "v": 0.3, "dv": 0.3, "a": 0.3}),
    ({"radio_delay": [0.3]}, {"s": 0.1, "v": 0.1, "dv": 0.1, "a": 0.1, "vl": 0.3, "al": 0.3}),
    ({"delay.al": [0.3]}, {"s": 0.1, "v": 0.1, "dv": 0.1, "a": 0.1, "al": 0.3}),
    ({"radio_delay": [0.2], "delay": [0.3]}, {"s": 0.3, "v": 0.3, "dv": 0.3, "a": 0.3, "vl": 0.2, "al": 0.2}),
    ({"delay.vl": [0.5], "radio_delay": [0.2], "delay": [0.0]}, {"vl": 0.5, "al": 0.2}),
    ({"followers.0.radio_delay": [0.2], "delay": [{"al": 0.7, "s": 0.4}]}, {"s": 0.4, "vl": 0.2, "al": 0.2}),
]


@pytest.mark.parametrize(("axes", "late"), LATE)
def test_delay_is_what_a_vehicle_calls_so_and_radio_delay_is_of_what_is_heard(axes, late):
    """In any order of the axes, to the bits of a vehicle with these delays."""
    law = CACC()
    late = {name: seconds for name, seconds in late.items() if name in law.law.signals}
    alone = summary(simulate(dataclasses.replace(SCENARIO, followers=[Vehicle(law, delay=late)] * 2)))
    for order in (axes, dict(reversed(axes.items()))):
        study = Study(dataclasses.replace(SCENARIO, followers=[Vehicle(law, delay=0.1)] * 2), order)
        for _ in range(2):  # an axis' own values are not changed
            found = study.run(executor="serial")
            np.testing.assert_array_equal(found.peak_spacing_error.values.ravel(), alone.peak_spacing_error)
    if list(axes) == ["delay"]:
        same = dataclasses.replace(SCENARIO, followers=[Vehicle(law, delay=0.3)] * 2)
        np.testing.assert_array_equal(summary(simulate(same)).peak_spacing_error, alone.peak_spacing_error)


def test_radio_delay_of_a_mixed_platoon_is_of_those_who_hear_radio():
    cars = [Vehicle(IDM(), delay=0.2), Vehicle(CACC(), delay={"s": 0.1})]
    first, second = (
        Study(dataclasses.replace(SCENARIO, followers=cars), {"radio_delay": [0.4]}).scenario_at(0).followers
    )
    assert first == cars[0]
    assert dict(second.delay) == {"s": 0.1, "vl": 0.4, "al": 0.4}


@pytest.mark.parametrize(
    ("axes", "words"),
    [
        ({"radio_delay": [0.1]}, "axes.radio_delay: no vehicle hears radio"),
        ({"followers.0.radio_delay": [0.1]}, "idm hears no radio"),
        ({"radio_dely": [0.1]}, "did you mean 'radio_delay'"),
        ({"T": [1.0], "followers.0.parameters.T": [1.2]}, "axes.T would vary nothing"),
        ({"delay": [1.0], "followers.delay": [1.2]}, "would vary nothing"),
    ],
)
def test_delays_and_doubled_axes_typed_wrongly(axes, words):
    with pytest.raises(HeadwayError, match=words):
        Study(SCENARIO, axes)


def test_an_axis_of_one_vehicle_has_the_last_word():
    cars = [Vehicle(IDM()), Vehicle(IDM(a=1.5)), Vehicle(IDM(a=2.0))]
    for order in (1, -1):
        axes = dict(list({"T": [1.1, 1.6], "followers.1.parameters.T": [2.0]}.items())[::order])
        study = Study(dataclasses.replace(SCENARIO, followers=cars), axes)
        assert [v.model.parameters["T"] for v in study.scenario_at(1).followers] == [1.6, 2.0, 1.6]
        assert_as_simulated(study, study.run(), range(2))


# -- who stands where, and what a map shows ---------------------------------------------------------


def test_a_dataset_says_who_stands_where(tmp_path):
    cars = [Vehicle(IDM(T=1.0 + 0.1 * n)) for n in range(4)]
    base = dataclasses.replace(SCENARIO, followers=cars)
    study = Study(base, {"order": [[2, 1, 4, 3], 7, [1, 1, 2, 3]], "a": [1.0, 1.5]})
    found = study.run(["least_gap"], store=tmp_path / "study.zarr")
    who = found.original_vehicle
    assert who.dims == ("order", "vehicle")
    assert who.values[0].tolist() == [0, 2, 1, 4, 3]
    assert who.values[2].tolist() == [0, -1, -1, -1, -1]
    for i in (0, 2):
        headways = [v.model.parameters["T"] for v in study.scenario_at(i).followers]
        assert [cars[n - 1].model.parameters["T"] for n in who.values[i // 2, 1:]] == headways
    assert hw.open_study(tmp_path / "study.zarr").identical(found)
    counted = Study(base, {"order": [3], "followers.1.count": [1, 3]}).run(["least_gap"])
    assert counted.original_vehicle.dims == ("order", "followers.1.count", "vehicle")
    assert (counted.original_vehicle.values[0, 0, -2:] == -1).all()
    assert sorted(counted.original_vehicle.values[0, 1]) == [0, 1, 2, 3, 4, 5, 6]


def test_a_map_says_which_part_it_shows_and_how_to_choose():
    axes = {"T": [1.0, 1.2], "a": [1.0, 1.2], "lag": np.linspace(0.1, 0.34, 25).tolist(), "delay": [0.0, 0.1]}
    study = Study(dataclasses.replace(SCENARIO, duration=1.0), axes)
    found, exact = study.run(["least_gap"]), study.stability()
    with pytest.warns(HeadwayWarning, match=r"shows delay = 0, 9 of 25 values of lag only; choose others with .*at="):
        figure = hw.plot.study_map(found, stability=exact)
    shown = [ax.get_title() for ax in figure.axes if ax.get_title()]
    assert (shown[0], shown[-1]) == ("lag = 0.1", "lag = 0.34")
    assert "9 of 25 values of lag" in figure.get_suptitle()
    with warnings.catch_warnings():
        warnings.simplefilter("error", HeadwayWarning)
        figure = hw.plot.study_map(found, at={"lag": axes["lag"][3], "delay": 0.1}, stability=exact)
        assert "lag = 0.13, delay = 0.1" in figure.get_suptitle()
        hw.plot.study_map(found, at={"lag": axes["lag"][:4], "delay": 0.1}, stability=exact)
    with pytest.raises(HeadwayError, match=r"at: delay = 0\.3 is none of its values; they are 0, 0\.1"):
        hw.plot.study_map(found, at={"delay": 0.3})
    with pytest.raises(HeadwayError, match="at: axis: 'lagg' is not known"):
        hw.plot.study_map(found, at={"lagg": 0.3})


@pytest.mark.parametrize("types", [None, 3, [1], "truck", {"truck": None}, {1: Vehicle(IDM())}])
def test_types_of_a_wrong_kind(types):
    with pytest.raises(HeadwayError, match="study: types"):
        Study(SCENARIO, {"T": [1.0]}, types=types)


# -- sizes and kinds ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "make",
    [
        lambda: Study(SCENARIO, {"T": {"from": 1.0, "to": 2.0, "count": 10**12}}),
        lambda: Study(SCENARIO, {"T": {"from": 1.0, "to": 2.0, "count": 10**400}}),
        lambda: Study(SCENARIO, {"T": between(1.0, 2.0)}, "sobol", 10**10),
        lambda: Study(SCENARIO, {"T": between(1.0, 2.0)}, "latin", 10**400),
        lambda: Study(SCENARIO, {"T": between(1.0, 2.0, 10**6), "a": between(1.0, 2.0, 10**6)}).run(),
        lambda: Study(SCENARIO, {"T": between(1.0, 2.0, 10**6), "a": between(1.0, 2.0, 10**6)}).stability(),
    ],
)
def test_sizes_are_said_before_anything_is_allocated(make):
    with pytest.raises(HeadwayError, match=r"asks for .* values of .*HEADWAY_LIMIT=\d+ in the environment"):
        make()


def test_a_limit_can_be_raised_on_purpose(monkeypatch):
    monkeypatch.setitem(LIMITS, "values of all points", 10.0)
    study = Study(SCENARIO, {"T": [1.0, 1.5]})
    with pytest.raises(HeadwayError, match=r"the study \(2 points\) asks for \d+ values of all points"):
        study.run()
    monkeypatch.setenv("HEADWAY_LIMIT", "10")
    assert (study.run().status == "ok").all()


@pytest.mark.parametrize(
    "options",
    [
        {"metrics": 3}, {"executor": None}, {"executor": []}, {"shard": 3}, {"shard": "ab"}, {"store": 3},
        {"chunk": "a"}, {"chunk": True}, {"keep": 3}, {"keep": ["a"]}, {"keep": [99]}, {"progress": 3},
    ],
)  # fmt: skip
def test_runs_of_a_wrong_kind_are_one_sentence_before_anything_runs(options, monkeypatch):
    study = Study(SCENARIO, {"T": [1.0]})
    monkeypatch.setattr("headway.study.work.Worker.__call__", None)
    with pytest.raises(HeadwayError):
        study.run(**options)


@pytest.mark.parametrize("seed", [None, "a", -1, 1.5, True])
def test_seeds_of_a_wrong_kind(seed):
    with pytest.raises(HeadwayError, match="study: seed"):
        Study(SCENARIO, {"T": between(1.0, 2.0)}, "sobol", 4, seed)


def test_braking_beyond_any_car_is_said():
    scenario = Scenario(Brake(25.0, 25.0, hold=5.0, ramp=4.0), [Vehicle(IDM(T=0.5))], duration=15.0)
    found = Study(scenario, {"leader.ramp": [1.0, 12.0]}).run()
    assert found.least_acceleration.attrs["note"].startswith("unphysical: in 1 of 2 points a vehicle brakes harder")
    assert "note" not in Study(scenario, {"leader.ramp": [12.0]}).run().least_acceleration.attrs
