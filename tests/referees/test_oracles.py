"""Simulated numbers computed independently of this project (RK4 at three steps with Richardson's check, invariants)."""

from __future__ import annotations

import numpy as np
import pytest

import headway as hw
from headway.models import CACC, GMM, IDM, OVM, IDMSpacing

SINE = hw.sine(mean=23, amplitude=2, omega=0.63)
RADIO = {"vl": 0.15, "al": 0.15}


def platoon(model, count=5, **vehicle):
    return [hw.Vehicle(model, **vehicle)] * count


SCENARIOS = {
    "S_IDM0": hw.Scenario(SINE, platoon(IDM), duration=50),
    "S_IDM15v1": hw.Scenario(SINE, platoon(IDM, delay={"s": 0.15, "vl": 0.15}), duration=50),
    "S_IDMI": hw.Scenario(hw.sine(27.8, 2, 0.3), platoon(IDMSpacing, 4), duration=60),
    "S_OVM": hw.Scenario(SINE, platoon(OVM(alpha=2)), duration=50),
    "S_GMM": hw.Scenario(SINE, platoon(GMM), duration=50, gaps=15),
    "S_GMM150": hw.Scenario(SINE, platoon(GMM, delay=1.5), duration=50, gaps=15),
    "S_CACC15": hw.Scenario(SINE, platoon(CACC, delay=RADIO), duration=50),
    "S_CACCd": hw.Scenario(hw.window(23, 2, 0.63, duration=25, onset=5), platoon(CACC), duration=50),
}

#: peak of each pair [m] (CACC: of the policy error), last speed [m/s], last gap [m], tolerance
RUNS = {
    "S_IDM0": (
        [4.77485699682, 2.03750961668, 1.35261937853, 0.954555125877, 0.706775892856],
        23.0649426357,
        41.6782206374,
        2e-05,
    ),
    "S_IDM15v1": (
        [4.95904462159, 2.1534666729, 1.43924337783, 1.02232922062, 0.761865513437],
        23.0476835625,
        41.6579008106,
        2e-05,
    ),
    "S_IDMI": ([21.509417321, 36.8611718727, 67.6224016435, 112.713098915], 33.4031016827, 156.413098915, 5e-05),
    "S_OVM": (
        [0.0982991562899, 0.127059159485, 0.196120563611, 0.35039390277, 0.867179576527],
        22.8727279426,
        4.07024247171,
        2e-05,
    ),
    "S_GMM": (
        [4.8410427934, 1.72809003556, 0.8699447054, 0.681274722239, 0.554818484746],
        23.0327824796,
        15.2167335164,
        2e-05,
    ),
    "S_GMM150": (
        [5.58951937951, 2.24388682607, 1.19441265301, 0.75744038787, 0.674543842104],
        23.0077726452,
        15.0250029977,
        2e-05,
    ),
    "S_CACC15": (
        [0.582093309922, 0.367408721437, 0.245220804842, 0.166472906594, 0.114499201157],
        22.9843594518,
        36.56545827,
        2e-05,
    ),
    "S_CACCd": (
        [0.748653168745, 0.454723651063, 0.291011309125, 0.189895719455, 0.125722889167],
        23.0051272438,
        36.507150199,
        0.0001,
    ),
}


@pytest.mark.parametrize("name", RUNS)
def test_simulation(name):
    peaks, speed, gap, tolerance = RUNS[name]
    result = hw.simulate(SCENARIOS[name])
    error = result.policy_error if "CACC" in name else result.spacing_error
    assert np.allclose(hw.metrics.peak(error).values[1:], peaks, rtol=0, atol=tolerance)
    # the ends carry no interpolation: they agree to the digits that are given
    assert float(result.speed[-1, -1]) == pytest.approx(speed, abs=2e-9)
    assert float(result.gap[-1, -1]) == pytest.approx(gap, abs=2e-9)


@pytest.mark.parametrize("dt", [0.05, 0.02])
def test_coarser_steps_stay_within_the_oracles_tolerance(dt):
    import dataclasses

    for name in ("S_IDM0", "S_GMM150", "S_CACC15"):
        peaks, _, _, tolerance = RUNS[name]
        result = hw.simulate(dataclasses.replace(SCENARIOS[name], dt=dt))
        error = result.policy_error if "CACC" in name else result.spacing_error
        assert np.allclose(hw.metrics.peak(error).values[1:], peaks, rtol=0, atol=tolerance)


def test_slope_of_the_policy_of_idm():
    idm = IDM(a=1, b=1.5, T=1.5, s0=2, v0=33.33, delta=4)
    h = 1e-4
    slope = (idm.equilibrium_gap(23 + h) - idm.equilibrium_gap(23 - h)) / (2 * h)
    assert slope == pytest.approx(2.7643363225, abs=1e-6)  # IDM09, from the other side


#: speed, gap, f_s, F_v = f_v - f_dv, f_dv for IDM (v0 = 33.3)
IDM_TABLE = [
    (5, 9.5024, 0.210366, -0.745552, 0.429517),
    (10, 17.0696, 0.116215, -0.654675, 0.476386),
    (15, 25.0205, 0.076644, -0.607701, 0.479315),
    (20, 34.3100, 0.050707, -0.551484, 0.443909),
    (25, 47.8191, 0.028538, -0.455255, 0.352605),
]


@pytest.mark.parametrize(("v", "gap", "f_s", "total_v", "f_dv"), IDM_TABLE)
def test_idm_table(v, gap, f_s, total_v, f_dv):
    idm = IDM(v0=33.3)
    f = idm.partials(v)
    assert idm.equilibrium_gap(v) == pytest.approx(gap, abs=6e-5)
    assert (f["s"], f["v"] - f["dv"], f["dv"]) == pytest.approx((f_s, total_v, f_dv), abs=6e-7)


@pytest.mark.parametrize(
    ("m", "l", "final"),
    [(1, 2, 7.85456371666), (0, 1, 3.95395707174), (1, 1, 14.1173191052)],  # GMM12, GMM13, GMM14
)
def test_gmm_invariants_fix_the_final_gap(m, l, final):  # noqa: E741  the published symbol
    scenario = hw.Scenario(
        hw.step(mean=23, change=-2, onset=1, edge=2), platoon(GMM(alpha=1.5, m=m, l=l), 1), duration=400, gaps=15
    )
    assert float(hw.simulate(scenario).gap[1, -1]) == pytest.approx(final, abs=1e-6)


@pytest.mark.parametrize(("delay", "steady"), [(0.0, 0.746031979923), (1.5, 0.93100628183)])  # CACC04
def test_cacc_steady_policy_error(delay, steady):
    follower = hw.Vehicle(CACC, delay={"vl": delay, "al": delay})
    result = hw.simulate(hw.Scenario(SINE, [follower], duration=120))
    assert float(hw.metrics.peak(result.policy_error.sel(time=slice(90, None)))[1]) == pytest.approx(steady, abs=1e-7)


def test_ovm_steady_amplitude_of_the_fifth_follower():
    # OVM14: the linear gain to the fifth power; a small leader keeps the platoon linear
    result = hw.simulate(hw.Scenario(hw.sine(23, 1e-4, 0.63), platoon(OVM(alpha=0.5)), duration=150))
    late = result.speed.sel(time=slice(110, None))
    assert float(hw.metrics.amplitude(late)[-1]) / 1e-4 == pytest.approx(2.3990559385 / 2, rel=5e-3)
