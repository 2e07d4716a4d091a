"""Figures of linear theory: gain and phase, characteristic roots, responses in time, damping."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from headway.arrays import Array
from headway.errors import HeadwayError, shorten
from headway.plot import style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from headway.theory.linear import Linear

__all__ = ["damping", "gain_phase", "responses", "root_locus", "vehicle_title"]

#: delays [s] that are drawn beside the vehicle's own
_DELAYS = (0.0, 0.5, 1.0, 1.5)
#: a gain below this is of no interest; one above is drawn on a logarithmic scale
_FAINT, _LOUD = 0.1, 4.0
_ROOTS = 10


def gain_phase(
    linear: Linear | Mapping[str, Linear], delays: Sequence[float] | None = None, *, omega: float | None = None
) -> Figure:
    """Draw |G(iω)| and the phase lag [rad] over the frequency [rad/s], a curve for each delay or each vehicle.

    Peaks are marked where |G| exceeds 1. A vehicle that is locally unstable has no steady response, of which |G|
    would be the size: its curves are faint and the key says so.

    Args:
        linear: of `headway.linearize`, or several by name.
        delays: [s] of one vehicle, at least 0; its pattern of delays is scaled to these longest ones, all on-board
            signals alike if none is late. By default 0, 0.5, 1 and 1.5 s and the vehicle's own.
        omega: a frequency [rad/s] above 0 to be marked, that of a disturbance.

    Raises:
        HeadwayError: for delays or frequencies out of range, or delays beside several vehicles.
    """
    curves = _curves(linear, delays)
    if omega is not None and not (math.isfinite(omega) and omega > 0):
        raise HeadwayError(f"omega = {omega:g} rad/s is no frequency to mark; it must be above 0")
    title = "Gain and phase lag per vehicle"
    entries: dict[str, Any] = {}
    if not isinstance(linear, Mapping):
        title = f"{vehicle_title(linear, late=False)}: gain and phase lag per vehicle"
        entries["Delay"] = None
    figure = style.new_figure(4.8, title)
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=(3, 2))
    w = _frequencies([lin for _, lin in curves], omega)
    loudest = 1.0
    for (name, lin), look in zip(curves, style.series(len(curves)), strict=True):
        stable, gain = lin.locally_stable, lin.gain(w)
        faint = 1.0 if stable else 0.35
        above.plot(w, gain, alpha=faint, zorder=3, **look)
        below.plot(w, lin.phase_lag(w), alpha=faint, zorder=3, **look)
        loudest = max(loudest, float(gain.max()))
        label = name
        if not stable:
            label += " (locally unstable)"
        elif lin.peak.gain > 1.0 + 1e-6 and w[0] <= lin.peak.frequency <= w[-1]:
            above.plot([lin.peak.frequency], [lin.peak.gain], marker="o", markersize=4.5, color=look["color"], zorder=4)
            label += f" (peak {lin.peak.gain:.3g} at {lin.peak.frequency:.2g} rad/s)"
        entries[label] = {**look, "alpha": faint}
    above.axhline(1.0, color="0.35", linewidth=0.8, zorder=2)
    for ax in (above, below):
        style.axes_style(ax)
        if omega is not None:
            ax.axvline(omega, color="0.35", linewidth=0.9, linestyle=(0, (1, 1.5)), zorder=2)
    if omega is not None:
        entries[f"disturbance, {omega:.4g} rad/s"] = {"color": "0.35", "linewidth": 1.0, "linestyle": (0, (1, 1.5))}
    above.set_xscale("log")
    if loudest > _LOUD:
        above.set_yscale("log")
        above.set_ylim(_FAINT, min(1.3 * loudest, 1e3))
    else:
        above.set_ylim(0.0, 1.08 * loudest)
    above.set_xlim(w[0], w[-1])
    above.set_ylabel("Gain |G(iω)|")
    below.set(xlabel="Frequency ω [rad/s]", ylabel="Phase lag [rad]")
    figure.align_ylabels([above, below])
    style.key_above(above, entries)
    return figure


def root_locus(linear: Linear, delays: Any = (0.0, 3.0), ax: Axes | None = None) -> Figure:
    """Draw the rightmost characteristic roots [1/s] as the delay grows, coloured by it.

    Rings are the roots at the first delay; conjugate roots lie beneath the real axis and are left out. Where the
    vehicle becomes locally unstable within the range, the crossing is marked.

    Args:
        linear: of `headway.linearize`.
        delays: a range (low, high) or (low, high, count) [s], or rising values, from 0 on; the vehicle's pattern of
            delays is scaled to these longest ones.
        ax: axes to draw on, without a title; a figure of its own if None.

    Raises:
        HeadwayError: for delays out of range.
    """
    from headway.theory.map import axis

    _is_linear(linear)
    values = axis("delay", delays, 2)
    if values[0] < 0:
        raise HeadwayError(f"delay: {values[0]:g} s is not allowed; it must be 0 or more")
    unit = linear.slowed(1.0).vehicle.perception.longest
    roots_by_delay = [_upper(linear.slowed(float(t) / unit)) for t in values]
    tau = np.concatenate([np.full(r.size, t) for t, r in zip(values, roots_by_delay, strict=True)])
    roots = np.concatenate(roots_by_delay)
    title = f"{vehicle_title(linear, late=False)}: characteristic roots as the delay grows"
    figure, ax = style.canvas(ax, 3.6, title)
    dots = ax.scatter(roots.real, roots.imag, c=tau, cmap=style.cars_map(), s=7.0, linewidths=0, zorder=3)
    first = roots_by_delay[0]
    ring: dict[str, Any] = {
        "linestyle": "none", "marker": "o", "markerfacecolor": "none", "markeredgecolor": "black", "markersize": 5.5,
    }  # fmt: skip
    ax.axvline(0.0, color="black", linewidth=0.9, zorder=2)
    entries: dict[str, Any] = {f"at {values[0]:.3g} s": ring}
    critical = linear.critical_delay("local")
    if values[0] < critical <= values[-1]:
        at = linear.slowed(critical / unit).rightmost_root
        entries[f"crossing at {critical:.4g} s, {abs(at.imag):.3g} rad/s"] = {**style.POINT, "markersize": 9.0}
        ax.plot([0.0], [abs(at.imag)], **style.POINT, zorder=5)
    # what matters are the roots that lead; delays bring endless others from the far left
    leaders = np.array([r[np.argmax(r.real)] for r in roots_by_delay])
    leading = leaders.real
    width = max(float(np.ptp(leading)), float(np.abs(leading).max()), 0.05)
    still = linear.slowed(0.0).roots.roots
    low, high = min(2.2 * float(still.real.min()), -2.0 * width), max(float(leading.max()), 0.0) + 0.35 * width
    seen = roots[(roots.real >= low) & (roots.real <= high)]
    shown = first[(first.real >= low) & (first.real <= high)]
    ax.plot(shown.real, shown.imag, zorder=4, clip_on=False, **ring)
    highest = 1.08 * float(seen.imag.max(initial=0.0))
    top = max(min(highest, 4.0 * float(max(leaders.imag.max(), still.imag.max()))), 0.1)
    ax.axhline(0.0, color="0.35", linewidth=0.6, zorder=1)
    ax.set(xlim=(low, high), ylim=(-0.03 * top, top))
    ax.set(xlabel="Real part [1/s]", ylabel="Imaginary part [rad/s]")
    style.axes_style(ax)
    style.bar_style(figure.colorbar(dots, ax=ax, pad=0.02, aspect=25), "Delay [s]")
    style.key_above(ax, entries)
    return figure


def responses(linear: Linear) -> Figure:
    """Draw the speed after a unit impulse and a unit step of the speed ahead, with the L∞ norm in words.

    Where the impulse response is below 0 it is filled; impulses that pass straight through are arrows
    with their weights.

    Args:
        linear: of `headway.linearize`.
    """
    _is_linear(linear)
    end = _settled(linear)
    t = np.linspace(0.0, end, 1500)
    impulse, step = linear.impulse_response(t), linear.step_response(t)
    figure = style.new_figure(
        3.2, f"{vehicle_title(linear)}: answer to an impulse and a step of the speed ahead", _peaks(linear)
    )
    left, right = figure.subplots(1, 2)
    left.plot(t, impulse, color="black", linewidth=1.2, zorder=3)
    entries: dict[str, Any] = {}
    if np.any(impulse < -1e-9):
        fill = {"facecolor": style.class_look(2, 4)["facecolor"], "edgecolor": "none"}
        left.fill_between(t, impulse, 0.0, where=impulse < 0.0, zorder=2, linewidth=0, **fill)
        entries["below 0: swings through"] = fill
    heights = [weight for delay, weight in linear.direct if delay <= end]
    if heights:
        tallest = max(float(np.abs(impulse).max()), 1e-3) / max(map(abs, heights))
        for delay, weight in linear.direct:
            if delay <= end:
                left.annotate(
                    "", (delay, weight * tallest), (delay, 0.0),
                    arrowprops={"arrowstyle": "-|>", "color": "#0072b2", "linewidth": 1.4, "shrinkA": 0, "shrinkB": 0},
                    annotation_clip=False, zorder=4,
                )  # fmt: skip
        weights = ", ".join(f"{weight:.3g}" for weight in heights[:4]) + (", …" if len(heights) > 4 else "")
        entries[f"passed straight on: {weights}"] = {"color": "#0072b2", "linewidth": 1.4}
        left.set_xlim(-0.02 * end, end)
    else:
        left.set_xlim(0.0, end)
    right.plot(t, step, color="black", linewidth=1.2, zorder=3)
    right.axhline(1.0, color="0.35", linewidth=0.7, zorder=1)
    k = int(np.argmax(step))
    if linear.locally_stable and step[k] > 1.0 + 1e-3:
        mark = {"linestyle": "none", "marker": "o", "color": style.COLLISION, "markersize": 4.5}
        right.plot([t[k]], [step[k]], zorder=4, **mark)
        style.key_above(right, {f"overshoot to {step[k]:.3g}": mark})
    right.set_xlim(0.0, end)
    left.axhline(0.0, color="0.35", linewidth=0.7, zorder=1)
    for ax, words in ((left, "Impulse response g [1/s]"), (right, "Step response [1]")):
        style.axes_style(ax)
        ax.set(xlabel="Time [s]", ylabel=words)
    if entries:
        style.key_above(left, entries)
    return figure


def damping(ratios: Sequence[float] = (0.1, 1.0, 2.0), ax: Axes | None = None) -> Figure:
    """Draw how a follower's gap returns to equilibrium by damping ratio ξ: y'' + 2 ξ ω0 y' + ω0² y = 0 from y = 1.

    Time is in units of 1/ω0. Overdamped gaps neither cross the equilibrium nor swing; the slower of their two
    decays leads, and critically damped ones are back first (the paper's fig:damping, by computation).

    Args:
        ratios: damping ratios above 0.
        ax: axes to draw on, without a title; a figure of its own if None.

    Raises:
        HeadwayError: for ratios that are not above 0.
    """
    if not len(ratios) or not all(0 < float(xi) < math.inf for xi in ratios):
        raise HeadwayError(f"damping ratios must be above 0, not {shorten(tuple(ratios))}")
    figure, ax = style.canvas(ax, 3.0, "Return of the gap to equilibrium, by damping ratio")
    t = np.linspace(0.0, 25.0, 1200)
    entries: dict[str, Any] = {}
    for xi, look in zip(ratios, style.series(len(ratios)), strict=True):
        ax.plot(t, _oscillator(t, xi), zorder=3, **look)
        kind = "critically damped" if xi == 1.0 else "underdamped" if xi < 1.0 else "overdamped"
        entries[f"{kind}, ξ = {xi:g}"] = look
    ax.axhline(0.0, color="0.35", linewidth=0.8, linestyle=(0, (4, 2)), zorder=2)
    entries["equilibrium"] = {"color": "0.35", "linewidth": 0.8, "linestyle": (0, (4, 2))}
    style.axes_style(ax)
    ax.set(xlim=(t[0], t[-1]), xlabel="Time ω0 t [rad]", ylabel="Gap from equilibrium y/y(0)")
    style.key_above(ax, entries)
    return figure


def vehicle_title(linear: Linear, late: bool = True) -> str:
    """Name a vehicle with its speed and its delays.

    Args:
        linear: the vehicle.
        late: whether to name the delays.
    """
    delay = linear.vehicle.delay
    pattern = f"{delay:g} s" if isinstance(delay, float) else ", ".join(f"{n} {t:g} s" for n, t in delay)
    suffix = f", delay {pattern}" if late and linear.vehicle.perception.longest > 0 else ""
    return f"{linear.vehicle.model.name} at {linear.speed:g} m/s{suffix}"


def _is_linear(linear: Any) -> None:
    from headway.theory.linear import Linear

    if not isinstance(linear, Linear):
        raise HeadwayError(f"a figure of linear theory needs what headway.linearize returns, not {shorten(linear)}")


def _curves(linear: Linear | Mapping[str, Linear], delays: Sequence[float] | None) -> list[tuple[str, Linear]]:
    """Return name and vehicle of each curve."""
    if isinstance(linear, Mapping):
        if delays is not None:
            raise HeadwayError("delays belong to one vehicle; vehicles by name are drawn with their own delays")
        if not linear:
            raise HeadwayError("gain_phase needs at least one vehicle")
        for lin in linear.values():
            _is_linear(lin)
        return list(linear.items())
    _is_linear(linear)
    own = linear.vehicle.perception.longest
    chosen = sorted({*_DELAYS, own}) if delays is None else [float(t) for t in delays]
    if not chosen or not all(math.isfinite(t) and t >= 0 for t in chosen):
        raise HeadwayError(f"delays must be 0 s or more, not {shorten(tuple(chosen))}")
    unit = linear.slowed(1.0).vehicle.perception.longest
    return [(f"{t:.4g} s", linear.slowed(t / unit)) for t in chosen]


def _frequencies(linears: Sequence[Linear], omega: float | None) -> Array:
    """Return frequencies [rad/s] from slow motion up to where all gains are faint."""
    marked = [w for w in (omega, *(lin.peak.frequency for lin in linears)) if w is not None and 0.0 < w < math.inf]
    sweep = np.geomspace(1e-2, 10.0, 600)
    heard = np.max([lin.gain(sweep) for lin in linears], axis=0) > _FAINT
    high = max(2.0, float(sweep[heard].max(initial=2.0)), *(2.0 * m for m in marked))
    low = min(0.02, *(0.2 * m for m in marked)) if marked else 0.02
    return np.union1d(np.geomspace(low, high, 1500), marked)


def _upper(linear: Linear) -> NDArray[np.complex128]:
    """Return the rightmost roots that are not beneath the real axis."""
    from headway.theory.roots import rightmost

    roots = rightmost(linear.characteristic, _ROOTS).roots
    return roots[roots.imag >= -1e-12]


def _oscillator(t: Array, xi: float) -> Array:
    """Return y(t) from y = 1 at rest, time in 1/ω0."""
    if xi == 1.0:
        return (1.0 + t) * np.exp(-t)
    root = np.sqrt(complex(xi * xi - 1.0))
    fast, slow = -xi - root, -xi + root
    return np.real((fast * np.exp(slow * t) - slow * np.exp(fast * t)) / (fast - slow))


def _settled(linear: Linear) -> float:
    """Return the time [s] after which the response to a step is at rest; for one that grows, long enough to show it."""
    rate = linear.decay_rate
    if rate <= 0:
        return min(4.0 / max(-rate, 1e-2), 120.0)
    end = min(12.0 / rate, 600.0)
    t = np.linspace(0.0, end, 4000)
    step = linear.step_response(t)
    moving = np.abs(step - step[-1]) > 0.01 * max(1.0, float(np.ptp(step)))
    return max(1.25 * float(t[moving].max(initial=0.0)), 1.0)


def _peaks(linear: Linear) -> str:
    """Say in words what the L∞ norm means for peaks."""
    if not linear.locally_stable:
        return "Locally unstable: the answer grows without end."
    norm = linear.impulse_norm
    if linear.peak_stable:
        return f"‖g‖₁ = {norm:.4g}: no peak of speed grows from vehicle to vehicle (L∞ string stable)."
    # so that a norm barely above 1 does not read as 1
    shown = f"{norm:.3f}" if norm >= 1.0005 else f"1 + {norm - 1.0:.1e}"
    return f"‖g‖₁ = {shown}: a peak of speed may grow up to {shown} times per vehicle (not L∞ string stable)."
