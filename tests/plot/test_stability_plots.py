"""Figures of linear theory and of stability maps: what they show, name and refuse."""

from __future__ import annotations

import math

import numpy as np
import pytest
import xarray as xr
from matplotlib.collections import QuadMesh
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.patches import PathPatch
from matplotlib.text import Text

import headway as hw
from headway import plot
from headway.errors import HeadwayError
from headway.literature.barhoumi2025.maps import PaperMap
from headway.plot import regions, style
from headway.theory.map import CLASSES, StabilityMap, trace


def idm(speed=23.0, delay=0.0, **parameters):
    return hw.linearize(hw.Vehicle(hw.models.IDM(**parameters), delay=delay), speed)


def texts(figure):
    """All texts of a figure that are drawn."""
    figure.draw_without_rendering()
    return [t.get_text() for t in figure.findobj(Text) if t.get_visible() and t.get_text()]


def inside_figure(figure):
    """Whether nothing leaves the page."""
    figure.draw_without_rendering()
    drawn, (width, height) = figure.get_tightbbox(), figure.get_size_inches()
    return drawn.x0 >= 0 and drawn.y0 >= 0 and drawn.x1 <= width and drawn.y1 <= height


def circle(radius=1.0, kind="string", what="string", n=21, codes=(2, 3), extra=None, third=None):
    """A map by hand: the better class within a circle around (0, 0)."""
    axes = [np.linspace(-2.0, 2.0, n), np.linspace(-2.0, 2.0, n + 2)] + ([] if third is None else [third])
    names = ("a", "b", "c")[: len(axes)]

    def verdict(at):
        r = radius * (1.0 if third is None else at[:, 2])
        return np.where(at[:, 0] ** 2 + at[:, 1] ** 2 <= r**2, codes[1], codes[0])

    mesh = np.stack([m.ravel() for m in np.meshgrid(*axes, indexing="ij")], axis=1)
    shape = tuple(a.size for a in axes)
    found = verdict(mesh).reshape(shape).astype(np.int8)
    meaning = {"flag_meanings": ", ".join(CLASSES[kind])}
    variables = {"verdict": (names, found, meaning)}
    for name, f in (extra or {}).items():
        variables[name] = (names, f(mesh).reshape(shape), {"long_name": f"the {name}", "units": "s"})
    dataset = xr.Dataset(
        variables,
        coords={
            n: (n, v, {"long_name": f"axis {n * 3}; in words", "units": "m"}) for n, v in zip(names, axes, strict=True)
        },
        attrs={"what": what, "model": "round", "parameters": "k = 7", "speed": 12.0, "delay": "s 0.5 s", "lag": 0.3},
    )
    return StabilityMap(dataset, trace(found, axes, verdict, CLASSES[kind]))


# -- gain and phase --------------------------------------------------------------------------------


def test_one_gain_curve_for_each_delay_with_peaks():
    figure = plot.gain_phase(idm(), delays=(0, 0.5, 1.5), omega=0.63)
    above, below = figure.axes
    curves = [line for line in above.lines if len(line.get_xdata()) > 10]
    assert len(curves) == 3
    w = curves[2].get_xdata()
    np.testing.assert_allclose(curves[2].get_ydata(), idm(delay=1.5).gain(w), rtol=1e-12)
    lags = [line for line in below.lines if len(line.get_xdata()) > 10]
    np.testing.assert_allclose(lags[0].get_ydata(), idm().phase_lag(w), rtol=1e-12)
    peaks = [line for line in above.lines if line.get_marker() == "o"]
    assert len(peaks) == 1
    late = idm(delay=1.5).peak
    assert (float(peaks[0].get_xdata()[0]), float(peaks[0].get_ydata()[0])) == (late.frequency, late.gain)
    assert {"Delay", "0 s", "0.5 s", "1.5 s (peak 1.3 at 0.64 rad/s)", "disturbance, 0.63 rad/s"} <= set(texts(figure))
    assert any(set(line.get_ydata()) == {1.0} for line in above.lines)
    assert any(set(line.get_xdata()) == {0.63} for line in above.lines)
    assert below.get_xlabel() == "Frequency ω [rad/s]"


def test_a_pattern_of_delays_is_scaled_and_the_own_delay_drawn():
    car = hw.Vehicle(hw.models.IDM(), delay={"s": 0.35, "dv": 0.7})
    lin = hw.linearize(car, 23.0)
    figure = plot.gain_phase(lin)
    assert {"0 s", "0.5 s", "0.7 s", "1 s"} <= set(texts(figure))
    curve = figure.axes[0].lines[2]
    np.testing.assert_allclose(curve.get_ydata(), lin.gain(curve.get_xdata()), rtol=1e-12)


def test_vehicles_are_told_apart_by_name_and_unstable_ones_said():
    figure = plot.gain_phase({"quick": idm(), "asleep": idm(delay=3.0)})
    words = texts(figure)
    assert {"quick", "asleep (locally unstable)"} <= set(words)
    assert not [line for line in figure.axes[0].lines if line.get_marker() == "o"]


def test_curves_differ_in_look_whatever_their_number():
    for count in (2, len(style.SERIES), 12):
        looks = {str(sorted(look.items(), key=lambda item: item[0])) for look in style.series(count)}
        assert len(looks) == count
    assert len([w for w in texts(plot.gain_phase(idm(), delays=np.arange(8) / 10)) if w.endswith(" s")]) == 8


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: plot.gain_phase(hw.models.IDM()), "needs what headway.linearize returns"),
        (lambda: plot.gain_phase({}), "at least one vehicle"),
        (lambda: plot.gain_phase({"a": idm()}, delays=(1,)), "delays belong to one vehicle"),
        (lambda: plot.gain_phase(idm(), delays=(-1.0,)), "delays must be 0 s or more"),
        (lambda: plot.gain_phase(idm(), delays=()), "delays must be 0 s or more"),
        (lambda: plot.gain_phase(idm(), omega=0.0), "must be above 0"),
        (lambda: plot.root_locus("idm"), "needs what headway.linearize returns"),
        (lambda: plot.root_locus(idm(), (3.0, 0.0)), "reversed"),
        (lambda: plot.root_locus(idm(), (-1.0, 1.0)), "0 or more"),
        (lambda: plot.responses(3), "needs what headway.linearize returns"),
        (lambda: plot.propagation(3), "needs what headway.linearize returns"),
        (lambda: plot.propagation(idm(delay=3.0)), "idm at 23 m/s, delay 3 s is locally unstable"),
        (lambda: plot.damping((0.0,)), "above 0"),
        (lambda: plot.damping(()), "above 0"),
        (lambda: plot.stability_map(3), "needs a StabilityMap, not 3"),
        (lambda: plot.stability_map(circle(), point={"A": 1}), "did you mean 'a'"),
        (lambda: plot.stability_map(circle(), point={"a": 1}), "no value for the axis b"),
        (lambda: plot.stability_map(circle(), point={"a": 1, "b": 2.5}), "reaches from -2 to 2"),
        (lambda: plot.stability_map(circle(third=np.array([0.5, 1.0])), ax=Figure().subplots()), "cannot share"),
        (lambda: plot.panels({}), "at least one map"),
        (lambda: plot.panels({"left": 3}), r"\['left'\] needs a StabilityMap, not 3"),
    ],
)
def test_what_cannot_be_drawn_is_refused_in_one_sentence(call, message):
    with pytest.raises(HeadwayError, match=message) as error:
        call()
    assert "\n" not in str(error.value)


# -- roots, answers, damping -----------------------------------------------------------------------


def test_roots_move_with_the_delay_and_the_crossing_is_marked():
    lin = idm()
    figure = plot.root_locus(lin, (0.0, 3.5, 8))
    ax = figure.axes[0]
    (dots,) = (c for c in ax.collections if c.get_array() is not None)
    roots, tau = dots.get_offsets().data @ [1.0, 1.0j], dots.get_array()
    assert set(tau) == set(np.linspace(0.0, 3.5, 8))
    for delay in (1.0, 3.0):
        leading = max(roots[tau == delay], key=lambda z: z.real)
        assert leading == pytest.approx(lin.slowed(delay).rightmost_root, abs=1e-9)
    assert np.all(roots.imag >= -1e-12)
    star = next(line for line in ax.lines if line.get_marker() == "*")
    critical = lin.critical_delay("local")
    assert star.get_xydata()[0] == pytest.approx([0.0, abs(lin.slowed(critical).rightmost_root.imag)], abs=1e-7)
    assert "crossing at 2.815 s, 0.506 rad/s" in texts(figure)
    assert not [line for line in plot.root_locus(lin, (0, 1, 4)).axes[0].lines if line.get_marker() == "*"]


def test_answers_and_what_they_say_about_peaks():
    late = idm(delay=1.5)
    figure = plot.responses(late)
    left, right = figure.axes
    t = left.lines[0].get_xdata()
    np.testing.assert_allclose(left.lines[0].get_ydata(), late.impulse_response(t))
    np.testing.assert_allclose(right.lines[0].get_ydata(), late.step_response(t))
    words = " ".join(texts(figure))
    assert f"‖g‖₁ = {late.impulse_norm:.3f}" in words
    assert "not L∞ string stable" in words
    assert "below 0: swings through" in words
    assert f"overshoot to {late.step_response(t).max():.3g}" in words
    assert abs(right.lines[0].get_ydata()[-1] - 1.0) < 0.02
    calm = " ".join(texts(plot.responses(idm())))
    assert "(L∞ string stable)" in calm
    assert "swings" not in calm
    assert "grows without end" in " ".join(texts(plot.responses(idm(delay=3.0))))
    straight = hw.linearize(hw.models.CACC(), 23.0)
    assert f"passed straight on: {straight.direct[0][1]:.3g}" in texts(plot.responses(straight))


def test_damping_is_the_oscillator():
    figure = plot.damping()
    curves = [line for line in figure.axes[0].lines if len(line.get_xdata()) > 10]
    under, critical, over = (line.get_ydata() for line in curves)
    t = curves[0].get_xdata()
    for y, xi in ((under, 0.1), (critical, 1.0), (over, 2.0)):
        d = t[1] - t[0]
        bend = (y[2:] - 2 * y[1:-1] + y[:-2]) / d**2 + xi * (y[2:] - y[:-2]) / d + y[1:-1]
        assert np.abs(bend).max() < 2e-3
        assert y[0] == 1.0
        assert abs(y[1] - 1.0) < d**2
    assert under.min() < -0.7
    assert over.min() > 0
    assert np.all(critical[10:] < over[10:])
    assert {"underdamped, ξ = 0.1", "critically damped, ξ = 1", "overdamped, ξ = 2", "equilibrium"} <= set(
        texts(figure)
    )


# -- where growth goes -----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("speed", "kind"), [(5.0, "convectively unstable upstream"), (15.0, "absolutely unstable"), (23.0, "stable")]
)
def test_propagation_shows_the_wedge_and_the_roadside(speed, kind):
    lin = idm(speed)
    found = lin.propagation()
    figure = plot.propagation(lin)
    left, right = figure.axes[:2]
    assert f"idm at {speed:g} m/s: {kind}" in texts(figure)
    velocity, rate = left.lines[0].get_data()
    spacing = lin.gap + lin.vehicle.length
    np.testing.assert_allclose(rate, lin.growth((speed - velocity) / spacing), atol=1e-9)
    slopes = [line.get_ydata()[1] / line.get_xdata()[1] for line in right.lines if line.get_ydata()[0] == 0.0]
    marked = [v for v in (0.0, found.velocity, found.upstream_edge, found.downstream_edge) if math.isfinite(v)]
    for v in marked:
        assert np.min(np.abs(np.array(slopes) - v)) < 1e-9
    fields = [c for c in right.collections if isinstance(c, QuadMesh)]
    assert len(fields) == (kind != "stable")
    if fields:
        assert fields[0].get_array().max() == pytest.approx(10.0, rel=0.05)
        assert {"roadside", "fastest", "edges", "cars", "Grown by a factor of"} <= set(texts(figure))
    assert left.child_axes[0].get_xlabel() == "Cars passed per second"


# -- maps ------------------------------------------------------------------------------------------


def test_areas_end_on_the_traced_boundary():
    found = circle()
    codes, axes = found.dataset.verdict.values, list(found.axes.values())
    path = regions.area(codes, 3, axes, found.boundary["string stable"])
    np.testing.assert_allclose(np.hypot(*path.vertices.T), 1.0, atol=1e-6)
    whole = regions.area(codes, 2, axes, ())
    assert whole.get_extents().extents.tolist() == [-2.0, -2.0, 2.0, 2.0]
    # the complement has a hole
    outside = regions.area(5 - codes, 3, axes, found.boundary["string stable"])
    assert len(outside.to_polygons()) == 2


def test_intervals_end_on_the_traced_boundary():
    values, codes = np.array([0.0, 1.0, 2.0, 3.0]), np.array([3, 2, 2, 3])
    lines = (np.array([[0.25]]), np.array([[2.75]]))
    assert regions.intervals(codes, 3, values, lines) == [(0.0, 0.25), (2.75, 3.0)]
    assert regions.intervals(codes, 2, values, ()) == [(0.0, 3.0)]


def test_a_map_shows_classes_boundary_point_and_what_is_fixed():
    figure = plot.stability_map(circle(), point={"a": 0.5, "b": -0.25})
    ax = figure.axes[0]
    boundary = ax.lines[0].get_xydata()
    np.testing.assert_allclose(np.hypot(*boundary.T), 1.0, atol=1e-6)
    star = next(line for line in ax.lines if line.get_marker() == "*")
    assert star.get_xydata().tolist() == [[0.5, -0.25]]
    words = texts(figure)
    assert {"string unstable", "string stable", "a = 0.5, b = -0.25", "round: string stability"} <= set(words)
    assert "locally unstable" not in words
    assert any(w.strip() == "k = 7; speed 12 m/s; delay s 0.5 s; lag 0.3 s" for w in words)
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("Axis aaa a [m]", "Axis bbb b [m]")
    fills = [p.get_facecolor()[:3] for p in ax.patches if isinstance(p, PathPatch)]
    assert fills == [to_rgb(style.class_look(code, 4)["facecolor"]) for code in (2, 3)]


def test_classes_differ_in_lightness():
    light = [np.dot(to_rgb(style.class_look(code, 4)["facecolor"]), [0.2126, 0.7152, 0.0722]) for code in (1, 2, 3)]
    assert np.all(np.diff(light) > 0.2)
    assert style.class_look(0, 4)["hatch"]


@pytest.mark.parametrize("what", ["gain", "critical_delay"])
def test_a_field_lies_under_the_boundary(what):
    found = circle(what=what, codes=(1, 3), extra={what: lambda at: np.where(at[:, 0] > 1.9, np.inf, 2 + at[:, 0])})
    figure = plot.stability_map(found)
    ax = figure.axes[0]
    (field,) = (c for c in ax.collections if isinstance(c, QuadMesh))
    shown = field.get_array().reshape(23, 21).T
    known = ~np.ma.getmaskarray(shown)
    codes = found.dataset.verdict.values
    assert np.array_equal(known, np.isfinite(found.dataset[what].values) & (codes >= (2 if what == "gain" else 1)))
    np.testing.assert_allclose(shown[known], found.dataset[what].values[known])
    words = texts(figure)
    assert f"The {what} [s]" in words
    assert "edge of 'string stable'" in words
    assert ("locally unstable" in words) == (what == "gain")


def test_one_axis_is_a_curve_over_bands():
    found = hw.stability_map(hw.models.IDM(), {"delay": (0.0, 3.5, 36)}, speed=23.0)
    figure = plot.stability_map(found, point={"delay": 1.5})
    ax = figure.axes[0]
    ends = {round(float(x), 4) for p in ax.patches for x in (p.get_x(), p.get_x() + p.get_width())}
    lin = idm()
    assert {round(lin.critical_delay("string"), 4), round(lin.critical_delay("local"), 4)} <= ends
    curve = next(line for line in ax.lines if len(line.get_xdata()) == 36)
    np.testing.assert_allclose(curve.get_ydata(), found.dataset.margin.values)
    assert {"string stable", "string unstable", "locally unstable", "delay = 1.5"} <= set(texts(figure))
    assert any("all on-board signals late alike" in w for w in texts(figure))
    assert ax.get_xlabel() == "Delay [s]"


def test_three_axes_are_planes_on_one_scale():
    third = np.linspace(0.5, 1.5, 21)
    found = circle(third=third, what="gain", codes=(2, 3), extra={"gain": lambda at: 1.0 + at[:, 2] + 0.1 * at[:, 0]})
    figure = plot.stability_map(found, point={"a": 0.0, "b": 0.0, "c": 0.8})
    planes = [ax for ax in figure.axes if ax.get_title()]
    assert len(planes) == 9
    values = [float(ax.get_title().split()[2]) for ax in planes]
    assert values[0] == 0.5
    assert values[-1] == 1.5
    for ax, value in zip(planes, values, strict=True):
        np.testing.assert_allclose(np.hypot(*ax.lines[0].get_xydata().T), value, atol=1e-6)
    stars = [v for ax, v in zip(planes, values, strict=True) for line in ax.lines if line.get_marker() == "*"]
    assert stars == [0.8]
    assert len({ax.collections[0].norm.vmax for ax in planes}) == 1
    labels = {t.get_text() for t in figure.legends[0].get_texts()}
    assert labels == {"edge of 'string stable'", "a = 0, b = 0, c = 0.8"}


def test_panels_stand_side_by_side_over_a_caption_that_stays_on_the_page():
    caption = "What the paper prints differs from what is true in this and that respect, for good reasons. " * 4
    figure = plot.panels([("printed", circle(0.8)), ("true", circle(1.2))], caption, "a title")
    assert len(figure.axes) == 2
    words = texts(figure)
    assert {"a title", "printed", "true", "string stable"} <= set(words)
    shown = figure.get_supxlabel()
    assert shown.replace("\n", " ") == caption.strip()
    assert "\n" in shown
    assert inside_figure(figure)
    for ax, radius in zip(figure.axes, (0.8, 1.2), strict=True):
        np.testing.assert_allclose(np.hypot(*ax.lines[0].get_xydata().T), radius, atol=1e-6)
    assert len(plot.panels({str(i): circle(n=7) for i in range(4)}).axes) == 4


def test_a_paper_map_in_space():
    third = np.linspace(0.5, 1.5, 5)
    found = PaperMap("x", "Title", "Caption.", (("printed", circle(third=third)), ("true", circle(2.0, third=third))))
    figure = plot.paper_map(found)
    assert {"Title", "Caption.", "printed", "edge of 'string stable' in planes of c"} <= set(texts(figure))
    left = figure.axes[0]
    assert left.name == "3d"
    outlines = [np.array(s) for c in left.collections for s in getattr(c, "_segments3d", [])]
    assert len(outlines) == 5
    for line in outlines:
        np.testing.assert_allclose(np.hypot(line[:, 0], line[:, 1]), line[:, 2], atol=1e-6)
    assert left.get_zlabel() == "c [m]"
    assert inside_figure(figure)


def test_given_axes_are_drawn_on():
    figure = Figure(layout="constrained")
    a, b, c = figure.subplots(1, 3)
    assert plot.root_locus(idm(), (0.0, 3.0, 4), a) is figure
    assert plot.damping(ax=b) is figure
    assert plot.stability_map(circle(), ax=c) is figure
    assert figure.get_suptitle() == ""
    assert a.collections
    assert b.lines
    assert c.patches


def test_letters_are_large_enough_and_stay_on_the_page():
    lin = idm(delay=1.5)
    figures = [
        plot.gain_phase(lin, omega=0.63), plot.root_locus(lin, (0.0, 3.0, 10)), plot.responses(lin), plot.damping(),
        plot.propagation(idm(15.0)), plot.stability_map(circle()),
        plot.stability_map(circle(third=np.linspace(0.5, 1.0, 4)), point={"a": 0.0, "b": 0.0, "c": 0.6}),
    ]  # fmt: skip
    for figure in figures:
        assert inside_figure(figure)
        assert figure.get_figwidth() <= 7.2
        sizes = [t.get_fontsize() for t in figure.findobj(Text) if t.get_visible() and t.get_text()]
        assert min(sizes) >= style.SMALL == 8.0
