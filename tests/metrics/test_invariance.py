"""No measure depends on how densely results were kept, on lanes beside it, or on the order of dimensions."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import headway as hw
from headway.metrics import comfort, decay, energy, growth, safety, spacing

#: by how much [share of the largest value] a measure may differ between samples of 0.02 s and of 0.1 s
FITTED, EXTREME, INTEGRAL, JERK = 1e-4, 1e-5, 2e-3, 2e-2


def cpi(dataset):
    """With brakes so poor that this ride needs them all."""
    return safety.cpi(dataset, mean=2.0, deviation=0.7, limits=(0.5, 4.0))


#: every measure that gives one value a vehicle
MEASURES = {
    growth.amplitude_growth: FITTED,
    growth.phase_lag: FITTED,
    growth.time_lag: FITTED,
    growth.harmonic_distortion: FITTED,
    growth.describing_function: FITTED,
    decay.l2_ratio: INTEGRAL,
    decay.linf_ratio: EXTREME,
    decay.overshoot: EXTREME,
    spacing.steady_error: INTEGRAL,
    spacing.least_time_gap: EXTREME,
    safety.ttc: EXTREME,
    safety.tet: INTEGRAL,
    safety.tit: INTEGRAL,
    safety.drac: EXTREME,
    safety.mdrac: EXTREME,
    safety.picud: EXTREME,
    cpi: INTEGRAL,
    safety.rss_margin: EXTREME,
    safety.least_gap: EXTREME,
    safety.collided: 0.0,
    comfort.rms_jerk: INTEGRAL,
    comfort.peak_jerk: JERK,
    comfort.jerk_share: INTEGRAL,
    comfort.rms_acceleration: INTEGRAL,
    energy.combustion_energy: INTEGRAL,
    energy.electric_energy: INTEGRAL,
    energy.fuel: INTEGRAL,
}


def ride(step, amplitude=8.0, T=0.5):
    """A rough ride of close followers, without a collision."""
    car = hw.Vehicle(hw.models.IDM(T=T, s0=1.0, a=3.0, b=6.0))
    leader = hw.sine(mean=14, amplitude=amplitude, omega=0.8)
    return hw.simulate(hw.Scenario(leader, [car] * 3, duration=40, dt=0.02, output_step=step))


@pytest.fixture(scope="module")
def rides():
    return ride(0.02), ride(0.1)


@pytest.mark.parametrize("measure", MEASURES, ids=lambda m: m.__name__)
def test_resampling(rides, measure):
    fine, coarse = (measure(r).values.astype(float) for r in rides)
    known = np.isfinite(fine)
    np.testing.assert_array_equal(known, np.isfinite(coarse))
    slack = MEASURES[measure] * np.abs(fine[known]).max() + 1e-12
    assert np.abs(fine - coarse)[known].max() <= slack


def test_the_ride_is_rough_enough_to_tell(rides):
    tet, share = safety.tet(rides[0]), comfort.jerk_share(rides[0])
    assert (tet[1:] > 1).any()
    assert (share[1:] > 0.05).any()
    assert (cpi(rides[0])[1:] > 0.01).any()
    assert not safety.collided(rides[0]).any()


@pytest.mark.parametrize("measure", MEASURES, ids=lambda m: m.__name__)
def test_lanes_and_order_of_dimensions(rides, measure):
    one, other = rides[0], ride(0.02, amplitude=2.0, T=1.5)
    both = xr.concat([one, other], dim=xr.DataArray(["a", "b"], dims="lane", name="lane"))
    found = measure(both)
    assert found.dims[-1] == "vehicle"
    for name, alone in (("a", one), ("b", other)):
        np.testing.assert_array_equal(found.sel(lane=name).values, measure(alone).values)
    turned = measure(both.transpose("time", "vehicle", "lane"))
    assert turned.dims == ("vehicle", "lane")
    np.testing.assert_array_equal(turned.transpose("lane", "vehicle").values, found.values)
    assert {"lane", "vehicle", "model", "length"} <= set(found.coords)


def test_every_measure_is_public_and_documented():
    documented = set(re.findall(r"`(\w+)`", (Path(__file__).parents[2] / "docs" / "metrics.md").read_text()))
    assert set(hw.metrics.__all__) <= documented
    for module in (growth, decay, spacing, safety, comfort, energy):
        for name in module.__all__:
            assert getattr(hw.metrics, name) is getattr(module, name)


def test_decay_with_lanes():
    car = hw.Vehicle(hw.models.OVM(alpha=1.0))
    runs = [hw.simulate(hw.Scenario(hw.step(mean=23, change=c, onset=o), [car] * 2, duration=80, output_step=0.04))
            for c, o in ((-1.0, 1.0), (0.5, 6.0))]  # fmt: skip
    both = xr.concat(runs, dim="lane")
    for measure in (decay.logarithmic_decrement, decay.settling_time):
        for i, run in enumerate(runs):
            np.testing.assert_array_equal(measure(both).isel(lane=i).values, measure(run).values)
    coarse = [run.isel(time=slice(None, None, 5)) for run in runs]
    for fine, thin in zip(runs, coarse, strict=True):
        np.testing.assert_allclose(decay.logarithmic_decrement(thin), decay.logarithmic_decrement(fine), rtol=1e-3)
        # the end of the disturbance is known to a sample
        np.testing.assert_allclose(decay.settling_time(thin), decay.settling_time(fine), atol=0.2)
