"""Calibration: what made the data is found again, what cannot be told is said, and nothing else is accepted."""

from __future__ import annotations

import dataclasses
from html import escape

import numpy as np
import pytest
from conftest import shared_file

import headway as hw
from headway.calibration import as_recorded, measured_growth, measured_transfer, one_in, replay, verdict
from headway.calibration.uncertainty import block_length, effective_samples
from headway.errors import HeadwayError, LeaderHeardError
from headway.models import CACC, FVDM, GMM, IDM, OVM
from headway.scenario.document import from_toml

LEADER = hw.multisine(mean=18.0, amplitudes=(3.0, 1.5, 0.8), omegas=(0.1, 0.31, 0.9))


def made(cars: list[hw.Vehicle], duration: float = 120.0, seed: int = 0, noise: float = 1.0, **fields):
    """A noisy recording of a simulated string, 5 samples a second."""
    run = hw.simulate(hw.Scenario(LEADER, cars, duration=duration, dt=0.02, output_step=0.2, **fields))
    return as_recorded(run, 0.1 * noise, 0.05 * noise, seed=seed)


TRUE = hw.Vehicle(IDM(T=1.2, a=1.1), delay=0.6)
RECORD = made([TRUE, TRUE])
FIT = hw.calibrate(IDM, RECORD, 1, fit=("T", "a", "delay"), seeds=3, train=(0, 80), refits=40)

RECOVERED = {
    "idm": (hw.Vehicle(IDM(T=1.1, a=1.3, s0=4.0), delay=0.6), ("T", "a", "s0", "delay")),
    "fvdm": (hw.Vehicle(FVDM(alpha=0.3, lam=0.5, v0=16.0, h=22.0, w=14.0), delay=0.4), ("alpha", "lam", "h", "delay")),
    "ovm": (hw.Vehicle(OVM(alpha=0.9, v0=16.0, h=22.0, w=14.0), delay=0.3), ("alpha", "h", "delay")),
    "gmm": (hw.Vehicle(GMM(alpha=12.0, m=0.0, l=1.0), delay=0.6), ("alpha", "delay")),
    "cacc": (hw.Vehicle(CACC(h=1.0), delay={"vl": 0.3, "al": 0.3}), ("kp", "h", "delay")),
    "lag": (hw.Vehicle(IDM(T=1.1, a=1.3), delay=0.2, lag=0.5), ("T", "lag")),
}


def test_what_made_the_data_is_found_again():
    """Intervals of 95 % hold the truth as often as `benchmarks.calibration` finds, seven times of eight."""
    inside, off = [], []
    for name, (car, names) in RECOVERED.items():
        for seed in range(2):
            record = made([car], seed=seed, **({"gaps": 25.0} if name == "gmm" else {}))
            fit = hw.calibrate(car, record, fit=names, seeds=1, refits=40)
            for n in names:
                truth = {**car.model.parameters, "delay": car.perception.longest, "lag": car.lag}[n]
                low, high = fit.intervals[n]
                inside.append(low <= truth <= high)
                off.append(abs(fit.values[n] - truth) / (high - low))
    assert len(inside) == 36
    assert np.mean(inside) >= 0.85
    assert max(off) < 1.0


def test_all_seeds_find_the_same():
    assert FIT.agreeing == 3
    assert FIT.spread["T"] < 1e-3
    assert FIT.unidentified == {}


def test_the_same_call_gives_the_same_bits():
    again = hw.calibrate(IDM, RECORD, 1, fit=("T", "a", "delay"), seeds=3, train=(0, 80), refits=40)
    assert again.values == FIT.values
    assert again.intervals == FIT.intervals


def test_errors_are_as_small_as_the_noise_and_below_the_baselines():
    for errors in (*FIT.train, *FIT.test):
        assert errors.gap < 0.2
        assert errors.gap < 0.2 * errors.copy_gap < errors.constant_gap
    assert FIT.train[0].seconds == pytest.approx(80.0)
    assert FIT.test[0].seconds == pytest.approx(40.0)


def test_residuals_are_fitted_less_recorded():
    (time, gap, _), *_ = FIT.residuals
    assert (time[0], time[-1]) == (0.0, 80.0)
    assert float(np.sqrt(np.mean(gap**2))) == pytest.approx(FIT.train[0].gap)


def test_a_parameter_that_the_record_says_nothing_of_is_named():
    slow = hw.sine(mean=6.0, amplitude=1.5, omega=0.3)
    run = hw.simulate(hw.Scenario(slow, [hw.Vehicle(IDM(v0=33.0))], duration=120, dt=0.02, output_step=0.2))
    fit = hw.calibrate(IDM, as_recorded(run), fit=("T", "v0"), seeds=1, refits=10)
    assert "upwards" in fit.unidentified["v0"]
    assert "T" not in fit.unidentified
    assert "fits as well" in fit.report()


def test_report_says_all():
    text = FIT.report()
    for part in ("[[Variables]]", "delay:", "fixed: b = 1.5", "3 of 3 within 1 %", "train", "test", "identified"):
        assert part in text
    assert max(map(len, text.splitlines())) < 180


def test_a_notebook_shows_values_intervals_and_errors():
    shown = FIT._repr_html_()
    low, high = FIT.intervals["T"]
    assert shown.count("<table>") == 2
    assert f"{FIT.values['T']:.5g}</td><td" in shown
    assert f"{low:.4g} to {high:.4g}" in shown
    for note in FIT.notes:
        assert escape(note) in shown


def test_toml_goes_into_a_scenario(tmp_path):
    path = FIT.save(tmp_path / "fit.toml")
    text = path.read_text()
    followers = text.partition("[[fits]]")[0]
    scenario = from_toml('duration = 20\n[leader]\nkind = "constant"\nspeed = 18.0\n' + followers)
    assert scenario.followers == (FIT.vehicle,)
    assert hw.calibration.load_followers(path) == [FIT.vehicle]
    with pytest.raises(HeadwayError, match=r"written as \.toml"):
        FIT.save(tmp_path / "fit.json")


def test_gap_and_speed_together():
    fit = hw.calibrate(IDM, RECORD, fit=("T", "a", "delay"), objective="gap+speed", seeds=1, refits=10)
    assert fit.values["T"] == pytest.approx(1.2, abs=0.03)
    assert fit.value > FIT.value


def test_several_runs_are_fitted_together_and_others_tested():
    other = made([TRUE], seed=5)
    fit = hw.calibrate(IDM, [RECORD, other], fit=("T", "a", "delay"), seeds=1, refits=10, test=made([TRUE], seed=6))
    assert len(fit.segments) == 2
    assert fit.values["T"] == pytest.approx(1.2, abs=0.03)
    assert fit.test[0].gap < 0.2


def test_a_pattern_of_delays_is_scaled():
    car = hw.Vehicle(IDM(T=1.2), delay={"s": 0.8, "vl": 0.4})
    fit = hw.calibrate(
        dataclasses.replace(car, delay={"s": 2.0, "vl": 1.0}), made([car]), fit=("T", "delay"), seeds=1, refits=10
    )
    assert dict(fit.vehicle.delay)["s"] == pytest.approx(0.8, abs=0.1)
    assert dict(fit.vehicle.delay)["vl"] == pytest.approx(0.4, abs=0.05)


# -- whole strings ---------------------------------------------------------------------------------


def test_replay_of_what_made_the_data():
    run = replay(RECORD, [TRUE, TRUE])
    errors = hw.data.compare(run, RECORD)
    assert float(errors.rms_gap_error.max()) < 0.4
    real, simulated = measured_growth(RECORD.speed), measured_growth(run.speed.values)
    np.testing.assert_allclose(real.deviation, simulated.deviation, rtol=0.01)
    assert np.isnan(real.ratio[0])
    assert (real.ratio_low[1:] < real.ratio[1:]).all()
    assert (real.ratio[1:] < real.ratio_high[1:]).all()


def test_measured_transfer_holds_the_exact_gain():
    car = hw.Vehicle(IDM(T=1.2, a=1.1), delay=0.6)
    leader = hw.noise(mean=18.0, sd=0.6)
    run = hw.simulate(hw.Scenario(leader, [car], duration=600, dt=0.05, output_step=0.2, seed=4))
    found = measured_transfer(as_recorded(run, 0.0, 0.02), 1, highest=1.2)
    exact = hw.linearize(car, 18.0).gain(found.frequency)
    inside = (found.low <= exact) & (exact <= found.high)
    assert inside[found.coherent].mean() >= 0.8
    assert found.coherent.mean() > 0.8


def test_verdicts_of_known_drivers():
    calm = made([hw.Vehicle(IDM(T=2.0, a=2.5))])
    nervous = made([hw.Vehicle(IDM(T=0.9, a=0.8), delay=0.8)])
    names = ("T", "a", "delay")
    stable, unstable = (verdict(hw.calibrate(IDM, r, fit=names, seeds=1, refits=40)) for r in (calm, nervous))
    assert stable.stable
    assert stable.words.startswith("surely string stable")
    assert not unstable.stable
    assert unstable.words.startswith("surely string unstable")
    exact = hw.linearize(hw.Vehicle(IDM(T=0.9, a=0.8), delay=0.8), unstable.speed).peak_gain
    assert unstable.low <= exact <= unstable.high


@hw.model
def follows_the_leader(s, v, dv, v0l, *, T=1.2, a=1.1, far=0.4, s0=10.0):
    return 0.2 * a * (s - s0 - T * v) + 0.6 * dv + far * (v0l - v)


def test_a_law_that_hears_the_platoon_leader_has_no_verdict_but_the_reason():
    fit = dataclasses.replace(FIT, vehicle=hw.Vehicle(follows_the_leader()))
    with pytest.raises(LeaderHeardError, match="follows_the_leader hears the platoon leader, so no growth per vehicle"):
        verdict(fit)


def test_one_cacc_car_in_n_damps():
    car = hw.Vehicle(IDM(T=0.9, a=0.8), delay=0.4)
    radio = hw.Vehicle(CACC(h=1.5), delay={"vl": 0.1, "al": 0.1})
    found = one_in(made([car], 100), car, radio, every=(0, 2, 1), followers=4)
    assert found.growth.values[0] > found.growth.values[1] > found.growth.values[2]
    assert found.head_to_tail_gain.values[0] > found.head_to_tail_gain.values[2]


def test_cross_validation_tells_drivers_apart():
    other = hw.Vehicle(IDM(T=1.8, a=1.1), delay=0.6)
    found = hw.calibration.cross_validate(IDM, [made([TRUE, other])], fit=("T", "a", "delay"), seeds=1)
    assert found.gap.dims == ("trained", "tested")
    assert (np.diag(found.gap.values) < 0.2).all()
    assert (found.gap.values[[0, 1], [1, 0]] > 3.0).all()


# -- what cannot be done ---------------------------------------------------------------------------


def changed(**fields) -> hw.data.Recording:
    """The record with other gaps or speeds."""
    return hw.data.Recording.from_gaps(
        fields.get("time", RECORD.time),
        fields.get("speed", RECORD.speed),
        fields.get("gap", RECORD.gap),
        source="mine.csv",
    )


def still() -> hw.data.Recording:
    return changed(speed=np.full_like(RECORD.speed, 18.0), gap=np.where(np.isnan(RECORD.gap), np.nan, 25.0))


@pytest.mark.parametrize(
    ("record", "options", "message"),
    [
        (RECORD, {"vehicle": 3}, "no follower 3; allowed are 1 to 2"),
        (RECORD, {"vehicle": 0}, "no follower 0"),
        (RECORD, {"fit": ("T", "dealy")}, "'dealy' is not known.*did you mean 'delay'"),
        (RECORD, {"fit": ()}, "name one or more"),
        (RECORD, {"objective": "speed"}, "'speed' is not known"),
        (RECORD, {"bounds": {"T": (3.0, 1.0)}}, "bounds of T = 3 to 1"),
        (RECORD, {"bounds": {"T": (0.0, 11.0)}}, "bounds of T = 0 to 11 are not allowed; a range within 0 to 10"),
        (RECORD, {"bounds": {"a": (0.5, 1.0)}, "fit": ("T",)}, "'a' is not known"),
        (RECORD, {"seeds": 0}, "seeds = 0"),
        (RECORD, {"train": (0.0, 5.0)}, r"5 s of unbroken record|0 s of unbroken record"),
        (RECORD, {"train": (500.0, 600.0)}, "holds 0 samples; the record runs from 0 to 120 s"),
        (RECORD, {"train": (50.0, 20.0)}, "window 50:20 is empty"),
        (still(), {}, "excites nothing; all that this record tells is the equilibrium gap, 25 m at 18 m/s"),
        (changed(gap=-RECORD.gap), {}, "gap that is not positive.*choose a window without them"),
        (changed(gap=3.28 * RECORD.gap), {}, "as if a unit were confused"),
        (changed(time=RECORD.time[::-1]), {}, "Time does not rise.*sort it first"),
    ],
)  # fmt: skip
def test_what_cannot_serve_is_said(record, options, message):
    with pytest.raises(HeadwayError, match=message) as error:
        hw.calibrate(IDM, record, **{"fit": ("T", "a"), **options})
    assert "\n" not in str(error.value)


def test_holes_are_left_out_and_a_missing_leader_cuts():
    gap, speed = RECORD.gap.copy(), RECORD.speed.copy()
    gap[1, 100:130] = np.nan
    speed[0, 300:305] = np.nan
    fit = hw.calibrate(IDM, changed(gap=gap, speed=speed), fit=("T", "a", "delay"), seeds=1, refits=10)
    assert len(fit.segments) == 2
    assert fit.values["T"] == pytest.approx(1.2, abs=0.05)
    assert any("30 of 601 gaps are missing" in n for n in fit.notes)
    assert any("cut there" in n for n in fit.notes)


def test_another_vehicle_ahead_cuts():
    gap = RECORD.gap.copy()
    gap[1, 300:] -= 8.0
    fit = hw.calibrate(IDM, changed(gap=gap), fit=("T", "a", "delay"), seeds=1, refits=10)
    assert [s.begin for s in fit.segments] == [0.0, 60.0]
    assert any("another vehicle came between" in n for n in fit.notes)


def test_gap_and_speed_that_disagree_are_said():
    gap = RECORD.gap.copy()
    gap[1] += 6.0 * np.sin(0.05 * RECORD.time)
    fit = hw.calibrate(IDM, changed(gap=gap), fit=("T", "a", "delay"), seeds=1, refits=10)
    assert any("Gap and speeds disagree" in n for n in fit.notes)


def test_a_law_that_does_not_rest_at_all_speeds_of_the_record_says_so():
    fit = hw.calibrate(IDM(v0=20.0), RECORD, fit=("T",), seeds=1, refits=10)
    assert any("does not rest at all of them: idm has no equilibrium" in n for n in fit.notes)
    gmm = hw.calibrate(
        GMM, made([hw.Vehicle(GMM(alpha=12.0, m=0.0, l=1.0))], gaps=25.0), fit=("alpha",), seeds=1, refits=10
    )
    assert any("rests at every gap" in n for n in gmm.notes)


def test_every_candidate_collides():
    with pytest.raises(HeadwayError, match="every candidate of fvdm collides"):
        hw.calibrate(FVDM(alpha=100.0, v0=100.0, h=0.0), RECORD, fit=("lam",), bounds={"lam": (0.0, 0.1)}, seeds=1)


def test_replay_needs_one_vehicle_each():
    with pytest.raises(HeadwayError, match="has 2 followers and 1 are given"):
        replay(RECORD, [TRUE])


def test_block_lengths_follow_the_correlation():
    random = np.random.default_rng(0)
    white = random.standard_normal(3000)
    slow = np.convolve(random.standard_normal(3100), np.ones(100) / 10.0, "valid")[:3000]
    assert block_length(white) < 10 < 50 < block_length(slow)
    assert effective_samples(white) > 2000
    assert 20 < effective_samples(slow) < 60


# -- the command line, figures, real data ------------------------------------------------------------


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    path = tmp_path_factory.mktemp("data") / "trip.csv"
    rows = [
        f"{t:.1f},{n},{RECORD.speed[n, i]:.5f},{'' if n == 0 else f'{RECORD.gap[n, i]:.5f}'}"
        for n in range(3)
        for i, t in enumerate(RECORD.time)
    ]
    path.write_text("time_s,vehicle,speed_mps,gap_m\n" + "\n".join(rows) + "\n")
    return path


def test_calibrate_and_replay_on_the_command_line(cli, file, tmp_path):
    out, figure = tmp_path / "fit.toml", tmp_path / "fit.png"
    code, text, _ = cli(
        "calibrate", "idm", file, "--fit", "T,delay", "--set", "a=1.1", "--train", "0:80", "--seeds", 1, "--out", out,
        "--figure", figure, "--bound", "T=0.5:3",
    )  # fmt: skip
    assert code == 0
    assert text.count("[[Variables]]") == 2
    assert "in 0.5 to 3" in text
    assert (tmp_path / "fit-2.png").stat().st_size > 10_000
    code, text, _ = cli("replay", file, "--parameters", out, "--json")
    assert code == 0
    assert '"simulated_deviation"' in text


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("calibrate", "imd", "FILE"), "did you mean 'idm'"),
        (("calibrate", "idm", "FILE", "--train", "0-80"), "write two numbers with a colon"),
        (("calibrate", "idm", "FILE", "--bound", "T"), "write name=low:high"),
        (("calibrate", "idm", "FILE", "--vehicle", "7"), "no follower 7"),
        (("calibrate", "idm", "FILE", "--out", "fit.json"), "allowed here are files ending in .toml"),
        (("replay", "FILE"), "replay needs --model"),
        (("replay", "FILE", "--parameters", "nowhere.toml"), "cannot be read"),
    ],
)
def test_what_is_typed_wrongly(cli, file, words, message):
    code, _, error = cli(*(str(file) if w == "FILE" else w for w in words))
    assert code == 2
    assert message in error
    assert error.count("\n") == 1


def test_figures_can_be_drawn(tmp_path):
    run = replay(RECORD, [TRUE, TRUE])
    radio = hw.Vehicle(CACC(h=1.5), delay={"vl": 0.1, "al": 0.1})
    figures = {
        "fit": hw.plot.calibrated(FIT),
        "replay": hw.plot.replayed(RECORD, run),
        "growth": hw.plot.growth(RECORD, {"idm": run}),
        "gains": hw.plot.gains(RECORD, [FIT]),
        "mixed": hw.plot.penetration(one_in(RECORD, TRUE, radio, every=(0, 1), followers=2)),
    }
    for name, figure in figures.items():
        assert hw.plot.save(figure, tmp_path / f"{name}.svg").stat().st_size > 10_000
    with pytest.raises(HeadwayError, match="at least one fit"):
        hw.plot.gains(RECORD, [])


def test_a_real_acc_car_amplifies_and_idm_says_so():
    record = hw.data.read(shared_file("openacc_asta_acc_short_p1.csv"))
    fit = hw.calibrate(IDM, record, 1, train=(0, 200), seeds=2, refits=40)
    assert fit.train[0].gap < 1.2
    assert fit.test[0].gap < 1.0 < fit.test[0].copy_gap
    assert verdict(fit).words.startswith("surely string unstable")
    measured = measured_growth(record.speed)
    assert measured.grows[1] > 0.975
