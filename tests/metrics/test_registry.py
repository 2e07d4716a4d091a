"""The registry: every metric by name, in every place, with the same values; and nothing else is measured."""

from __future__ import annotations

import importlib.util
import pickle
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import headway as hw
from headway.data.recording import Recording
from headway.errors import HeadwayError
from headway.metrics.registry import METRICS, chosen, named, split
from headway.metrics.sizes import DEFAULT
from headway.models import FVDM, IDM
from headway.study.study import Study

TABLE = [m for m in METRICS.values() if m.per in ("vehicle", "run")]
RECORDED = [m for m in TABLE if m.name not in ("amplitude_growth", "phase_lag", "time_lag", "harmonic_distortion")]


@pytest.fixture(scope="module")
def run():
    """Behind a leader that swings and then drives evenly, so that every metric has something to measure."""
    leader = hw.window(mean=20, amplitude=3, omega=0.8, duration=20)
    return hw.simulate(hw.Scenario(leader, [hw.Vehicle(IDM(a=1.5))] * 3, duration=120, output_step=0.1))


@pytest.fixture(scope="module")
def swings():
    leader = hw.sine(mean=20, amplitude=3, omega=0.8)
    return hw.simulate(hw.Scenario(leader, [hw.Vehicle(IDM(a=1.5))] * 3, duration=60, output_step=0.1))


@pytest.mark.parametrize("metric", METRICS.values(), ids=lambda m: m.name)
def test_unit_and_meaning_are_those_of_the_values(metric, run, swings):
    values = metric.of(swings if metric.family == "Growth" else run)
    assert values.attrs["units"] == metric.unit
    assert values.attrs["long_name"] == metric.long_name
    assert values.name == metric.name
    dims = {"vehicle": ("vehicle",), "phasor": ("vehicle",), "run": (), "time": ("vehicle", "time")}
    assert values.dims == dims[metric.per]
    assert metric.over_vehicles(values).dims in ((), ("time",))
    assert pickle.loads(pickle.dumps(metric)).name == metric.name


def test_functions_are_their_metrics():
    for name in hw.metrics.__all__:
        if name in METRICS:
            assert METRICS[name].function is getattr(hw.metrics, name)
    assert chosen([hw.metrics.ttc], ()) == (METRICS["ttc"],)


@pytest.mark.parametrize("scheme", ["rk4", "ballistic"])
def test_a_study_gives_every_metric_the_bits_of_a_run(scheme):
    """Among quiet points, points that collide, and leaders of different frequency."""
    cars = [hw.Vehicle(IDM(T=0.8), delay=0.3), hw.Vehicle(FVDM(v0=15.0, h=14.0, w=8.0, lam=0.02), limits=(-6.0, 4.0))]
    scenario = hw.Scenario(hw.sine(mean=12, amplitude=1, omega=0.5), cars, duration=30.0, dt=0.05, scheme=scheme)
    axes = {"leader.omega": [0.4, 0.9], "leader.amplitude": [0.5, 11.0], "followers.1.parameters.alpha": [0.02, 0.8]}
    study = Study(scenario, axes)
    found = study.run([m.name for m in TABLE])
    assert set(found.status.values.ravel()) == {"ok", "collision"}
    apart = study.run([m.name for m in TABLE], chunk=3, executor="threads")
    assert apart.identical(found)
    for i in range(study.points.count):
        alone = hw.simulate(study.scenario_at(i))
        for metric in TABLE:
            ours = found[metric.name].values.reshape(study.points.count, -1)[i]
            try:
                expected = metric.of(alone).values.astype(float)
            except HeadwayError:
                assert np.isnan(ours).all()
                assert found.message.values.ravel()[i]
                continue
            np.testing.assert_array_equal(ours.ravel(), expected.ravel(), err_msg=f"{metric.name} at {i}")


def test_a_study_names_what_it_measures():
    scenario = hw.Scenario(hw.sine(mean=20, amplitude=1, omega=0.5), [hw.Vehicle(IDM())] * 2, duration=20.0)
    found = Study(scenario, {"T": [1.0, 1.5]}).run(["ttc", "tet(threshold=40)", "collisions", hw.metrics.drac])
    assert found.collisions.dims == ("T",)
    assert found.ttc.attrs == {"units": "s", "long_name": "least time to collision"}
    assert found["tet(threshold=40)"].attrs["long_name"] == "time with TTC below 40 s"
    assert found.drac.dims == ("T", "vehicle")
    assert (found["tet(threshold=40)"] > 0).any()


def test_a_point_says_why_a_metric_has_no_value():
    scenario = hw.Scenario(hw.brake(mean=20, drop=5, hold=3, ramp=2), [hw.Vehicle(IDM())] * 2, duration=20.0)
    found = Study(scenario, {"T": [1.0, 1.5]}).run(["amplitude_growth", "ttc"])
    assert np.isnan(found.amplitude_growth).all()
    assert np.isfinite(found.ttc[:, 1:]).all()
    assert (found.status == "ok").all()
    assert "a brake leader has no single frequency" in str(found.message.values[0])


def test_metrics_with_parameters():
    assert named("tet(threshold=4)").parameters == {"threshold": 4.0}
    assert named("fuel(per=distance)").unit == "mL/km"
    assert split("ttc, cpi(mean=2,deviation=0.7),fuel") == ["ttc", "cpi(mean=2,deviation=0.7)", "fuel"]
    assert split("") == []


@pytest.mark.parametrize(
    ("names", "words"),
    [
        (["tett"], "metric: 'tett' is not known; did you mean 'tet'?"),
        (["tet(treshold=3)"], "metric tet, parameter: 'treshold' is not known"),
        (["tet(3)"], "'3' is not of the form parameter=value"),
        (["tet(threshold=3"], "the parenthesis is not closed"),
        (["steady_error(signal=sped)"], "did you mean 'speed'"),
        (["jerk"], "metric jerk has a value at every time"),
        (["fundamental"], "metric fundamental has amplitude and phase"),
        ([3], "metric 3 is neither a name nor a function"),
        (5, "metrics: 5 is not a list of names or functions"),
    ],
)
def test_names_typed_wrongly(names, words):
    with pytest.raises(HeadwayError) as error:
        chosen(names, DEFAULT)
    assert words in str(error.value)
    assert len(str(error.value)) <= 300


# -- one check of what is measured, in one place -----------------------------------------------------

NO_RUNS = [None, 3.0, np.zeros((2, 5)), {"speed": 1}, ["a", "b"], "run.nc", xr.DataArray([1.0, 2.0])]


@pytest.mark.parametrize("thing", NO_RUNS, ids=lambda t: type(t).__name__)
@pytest.mark.parametrize("name", [*sorted(n for n in METRICS if METRICS[n].family != "Size"), "summary"])
def test_what_is_no_run_is_refused_in_a_sentence(name, thing):
    with pytest.raises(HeadwayError, match="needs the dataset of a run") as error:
        getattr(hw.metrics, name)(thing)
    assert len(str(error.value)) <= 300


@pytest.mark.parametrize("name", ["peak", "rms", "amplitude", "least", "amplitude_ratio"])
def test_what_is_no_variable_is_refused_in_a_sentence(name):
    for thing in (None, 3.0, np.zeros((2, 5)), {"speed": 1}, ["a"], "speed", xr.Dataset()):
        with pytest.raises(HeadwayError, match="needs one variable of a run"):
            getattr(hw.metrics, name)(thing)


@pytest.mark.parametrize("metric", RECORDED, ids=lambda m: m.name)
def test_a_recording_can_be_measured(metric, run):
    recording = Recording.from_gaps(run.time.values, run.speed.values, run.gap.values)
    values, expected = metric.of(recording), metric.of(run)
    assert values.dims == expected.dims
    if metric.name in ("ttc", "drac", "least_gap", "peak_spacing_error", "collisions", "linf_ratio"):
        np.testing.assert_allclose(values, expected, rtol=1e-6)


def test_a_summary_of_a_recording(run):
    recording = Recording.from_gaps(run.time.values, run.speed.values, run.gap.values)
    assert list(hw.metrics.summary(recording)) == list(DEFAULT)


def test_the_tables_of_the_page_are_those_of_the_registry():
    """`python tools/metric_tables.py` writes them."""
    place = Path(__file__).parents[2] / "tools" / "metric_tables.py"
    spec = importlib.util.spec_from_file_location("metric_tables", place)
    tool = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(tool)
    page = tool.PAGE.read_text(encoding="utf-8")
    assert page == tool.written(page)
    families = {m.family for m in METRICS.values()} - {"Size", "Sizes"}
    assert all(f"<!-- metrics: {family} -->" in page for family in families)
