"""Figures: what is drawn, named and refused, and files that appear whole or not at all."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.text import Text

from headway import plot
from headway.engine.simulate import simulate
from headway.errors import HeadwayError
from headway.library import library_scenario, library_table
from headway.plot import style, trajectories
from headway.scenario.document import from_table, override

VIEWS = {
    "speed": plot.speeds,
    "acceleration": plot.accelerations,
    "gap": plot.gaps,
    "spacing_error": plot.spacing_errors,
}


@pytest.fixture(scope="module")
def five():
    return simulate(library_scenario("paper:compare-0-idm"))


@pytest.fixture(scope="module")
def collided():
    return simulate(library_scenario("paper:ovm-nonharmonic"))


@pytest.fixture(scope="module")
def thousand():
    table = library_table("paper:compare-0-idm")
    for change in ("followers.0.count=1000", "dt=0.1", "output_step=0.5"):
        override(table, change)
    return simulate(from_table(table))


def texts(figure):
    """All texts of a figure that are drawn."""
    figure.draw_without_rendering()
    return [t.get_text() for t in figure.findobj(Text) if t.get_visible() and t.get_text()]


def lines(ax):
    return next(c for c in ax.collections if isinstance(c, LineCollection))


@pytest.mark.parametrize("name", VIEWS)
def test_axes_carry_name_unit_and_title(five, name):
    figure = VIEWS[name](five)
    assert isinstance(figure, Figure)
    ax = figure.axes[0]
    words = {"speed": "Speed [m/s]", "acceleration": "Acceleration [m/s²]", "gap": "Gap [m]",
             "spacing_error": "Spacing error [m]"}  # fmt: skip
    assert ax.get_ylabel() == words[name]
    assert ax.get_xlabel() == "Time [s]"
    assert "paper:compare-0-idm" in texts(figure)


def test_units_come_from_the_dataset(five):
    changed = five.copy()
    changed["speed"] = (five.speed * 3.6).assign_attrs(units="km/h", long_name="speed over ground")
    assert plot.speeds(changed).axes[0].get_ylabel() == "Speed over ground [km/h]"


def test_cars_and_pairs_are_named(five):
    assert {"Car", "0", "1", "5"} <= set(texts(plot.speeds(five)))
    named = texts(plot.spacing_errors(five))
    assert {"Cars", "0-1", "1-2", "4-5"} <= set(named)
    assert len(lines(plot.speeds(five).axes[0]).get_segments()) == 6
    assert len(lines(plot.gaps(five).axes[0]).get_segments()) == 5


def test_drawn_points_are_the_data(five):
    drawn = lines(plot.gaps(five).axes[0]).get_segments()[1]
    np.testing.assert_allclose(np.interp(drawn[:, 0], five.time, five.gap.sel(vehicle=2)), drawn[:, 1], rtol=1e-12)
    assert drawn[:, 1].max() == float(five.gap.sel(vehicle=2).max())
    assert drawn[[0, -1], 0].tolist() == [0.0, 50.0]


def test_leader_is_black_and_followers_grow_lighter(five):
    colours = lines(plot.speeds(five).axes[0]).get_colors()
    light = colours[:, :3] @ [0.2126, 0.7152, 0.0722]
    # the leader is drawn last, on top
    assert light[-1] == 0
    assert np.all(np.diff(light[:-1]) > 0.05)
    assert light[:-1].max() < 0.85


def test_many_cars_get_a_colour_bar(thousand):
    figure = plot.overview(thousand)
    assert "Car" in texts(figure)
    assert "999-1000" not in texts(figure)
    assert "leader" in texts(figure)
    drawn = sum(len(s) for s in lines(figure.axes[0]).get_segments())
    assert drawn <= 2_000_000
    assert lines(figure.axes[0]).get_rasterized()


def test_thinning_keeps_extremes_and_gaps():
    time = np.linspace(0.0, 100.0, 100_001)
    values = np.sin(time)[None, :] * np.ones((3, 1))
    values[0, 54_321], values[1, 12_345], values[2, 60_000:] = 9.0, -9.0, np.nan
    t, v = trajectories._thin(time, values)
    assert t.shape == v.shape
    assert t.shape[1] <= 4002
    assert v[0].max() == 9.0
    assert v[1].min() == -9.0
    assert np.all(np.diff(t, axis=1) >= 0)
    assert np.nanmax(t[2][np.isfinite(v[2])]) < 60.0


def test_collisions_are_marked(collided):
    hit = [int(n) for n in collided.vehicle[collided.collision_time.notnull()]]
    assert hit
    for draw in (plot.speeds, plot.gaps, plot.time_space):
        figure = draw(collided)
        crosses = [line for line in figure.axes[0].lines if line.get_marker() == "x"]
        assert sorted(float(c.get_xdata()[0]) for c in crosses) == pytest.approx(
            sorted(collided.collision_time.dropna("vehicle").values)
        )
        assert {f"{n - 1}-{n}" for n in hit} <= set(texts(figure))
    assert "collision" in texts(plot.gaps(collided))
    heights = [float(line.get_ydata()[0]) for line in plot.gaps(collided).axes[0].lines if line.get_marker() == "x"]
    assert np.allclose(heights, 0.0, atol=0.2)


def test_time_space_chooses_its_frame(five):
    assert "23" in plot.time_space(five).axes[0].get_ylabel()
    assert plot.time_space(five, moving=False).axes[0].get_ylabel() == "Front bumper position [m]"
    cycle = simulate(library_scenario("example:wltc-idm"))
    assert plot.time_space(cycle).axes[0].get_ylabel() == "Front bumper position [m]"
    moving = lines(plot.time_space(five, moving=True).axes[0])
    assert np.ptp(np.concatenate(moving.get_segments())[:, 1]) < 250
    assert moving.get_array().max() == pytest.approx(25.0, abs=0.01)


def test_given_axes_are_drawn_on(five):
    figure = Figure()
    left, right = figure.subplots(1, 2)
    assert plot.speeds(five, left) is figure
    assert plot.time_space(five, right) is figure
    assert figure.get_suptitle() == ""
    assert lines(left)


def test_overview_and_comparison_are_arranged(five, collided):
    assert [ax.get_ylabel() for ax in plot.overview(five).axes[:3]] == ["Speed [m/s]", "Spacing error [m]", "Gap [m]"]
    figure = plot.comparison({"IDM": five, "OVM": collided})
    assert [ax.get_ylabel() for ax in figure.axes] == ["Spacing error [m]", "Speed [m/s]"] * 2
    assert [ax.get_xlabel() for ax in figure.axes] == ["", "", "Time [s]", "Time [s]"]
    assert {"IDM", "OVM", "collision"} <= set(texts(figure))
    assert figure.axes[0].get_shared_x_axes().joined(figure.axes[0], figure.axes[3])
    three = plot.comparison({"IDM": five}, what=("gap", "speed", "acceleration"))
    assert len(three.axes) == 3


def test_letters_are_large_enough_at_print_size(five, collided):
    for figure in (plot.overview(collided), plot.comparison({"IDM": five}), plot.time_space(five)):
        figure.draw_without_rendering()
        assert figure.get_figwidth() <= 7.2
        sizes = [t.get_fontsize() for t in figure.findobj(Text) if t.get_visible() and t.get_text()]
        assert min(sizes) >= style.SMALL == 8.0


def test_parts_of_a_dataset_are_drawn(five):
    assert len(lines(plot.speeds(five.sel(vehicle=[2, 3], time=slice(10, 20))).axes[0]).get_segments()) == 2
    assert plot.overview(five.transpose("time", "vehicle"))
    plot.gaps(five.sel(vehicle=[0, 1]))
    plot.overview(five.isel(time=slice(0, 1)))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda d: d.drop_vars("gap"), "no 'gap' to draw; it holds position, speed"),
        (lambda d: d.isel(vehicle=1), "'gap' has the dimensions time; a figure needs vehicle and time"),
        (lambda d: d.isel(time=slice(0, 0)), "no times to draw"),
        (lambda d: d.drop_vars("time"), "no 'time' to draw"),
    ],
)
def test_what_cannot_be_drawn_is_refused(five, change, message):
    with pytest.raises(HeadwayError, match=message):
        plot.gaps(change(five))


def test_comparison_names_the_dataset_that_lacks_something(five):
    with pytest.raises(HeadwayError, match=r"^OVM: the dataset has no 'speed'"):
        plot.comparison({"IDM": five, "OVM": five.drop_vars("speed")})
    with pytest.raises(HeadwayError, match="at least one dataset"):
        plot.comparison({})


@pytest.mark.parametrize(
    ("suffix", "start"), [(".png", b"\x89PNG"), (".svg", b"<?xml"), (".pdf", b"%PDF"), (".PNG", b"\x89PNG")]
)
def test_save_writes_each_format_whole(five, tmp_path, suffix, start):
    target = tmp_path / f"figure{suffix}"
    assert plot.save(plot.speeds(five), target) == target
    assert target.read_bytes().startswith(start)
    assert [p.name for p in tmp_path.iterdir()] == [target.name]


def test_png_has_200_dots_an_inch(five, tmp_path):
    from matplotlib.image import imread

    figure = plot.speeds(five)
    assert imread(plot.save(figure, tmp_path / "f.png")).shape[1] == round(figure.get_figwidth() * 200)


@pytest.mark.parametrize("name", ["figure.bmp", "figure", "figure.jpeg"])
def test_save_refuses_other_suffixes(five, tmp_path, name):
    with pytest.raises(HeadwayError, match=r"allowed are \.png, \.svg, \.pdf"):
        plot.save(plot.speeds(five), tmp_path / name)
    assert not list(tmp_path.iterdir())


def test_save_says_where_it_cannot_write(five, tmp_path):
    figure = plot.speeds(five)
    (tmp_path / "folder.png").mkdir()
    for target in (tmp_path / "nowhere" / "f.png", tmp_path / "folder.png"):
        with pytest.raises(HeadwayError, match="cannot be written"):
            plot.save(figure, target)
    assert [p.name for p in tmp_path.iterdir()] == ["folder.png"]


def test_importing_is_cheap_and_changes_no_settings():
    code = (
        "import sys, headway.plot; assert not any(m.startswith('matplotlib') for m in sys.modules), 'early'\n"
        "import matplotlib; before = dict(matplotlib.rcParams)\n"
        "from headway.library import library_scenario; from headway.engine.simulate import simulate\n"
        "headway.plot.overview(simulate(library_scenario('paper:idm-window')))\n"
        "assert dict(matplotlib.rcParams) == before\n"
        "from matplotlib import pyplot; assert not pyplot.get_fignums()"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
