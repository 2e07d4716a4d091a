"""Exact prescribed motion: position, speed and acceleration of a leader at any time, from one description.

A motion is a sequence of pieces. In each, with u the time since the piece began,

    v(u) = c0 + c1 u + c2 u² + c3 u³ + Σ_k A_k sin(φ_k + ω_k u + β_k u²/2)

and position and acceleration are its exact integral and derivative. Where pieces meet, the
derivative that jumps there is known, so that the engine can put a step on it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from headway.arrays import Array

__all__ = ["Motion", "MotionPiece", "at_lanes", "polyline", "smooth_curve"]

Side = Literal["left", "right"]

#: largest order of a jump in the position's derivatives that matters to a fourth-order method
HIGHEST_ORDER = 4


class MotionPiece(NamedTuple):
    """One smooth piece of speed: its start [s], polynomial and harmonics (amplitude, ω, φ, β)."""

    start: float
    poly: tuple[float, ...]
    harmonics: tuple[tuple[float, float, float, float], ...] = ()


@dataclass(frozen=True, eq=False)
class Motion:
    """Motion of a leader that drove at constant `before` [m/s] until t = 0; position(0) = 0.

    `start` (P,) times at which pieces begin (the first is 0), `poly` (4, P) their coefficients,
    `harmonics` (4, K, P) amplitude, ω, φ and β of their sines.
    """

    before: float
    start: Array
    poly: Array
    harmonics: Array
    origin: Array

    @classmethod
    def of(cls, before: float, pieces: Sequence[MotionPiece]) -> Motion:
        """Assemble a motion of pieces, the first of which starts at 0."""
        count = max(len(p.harmonics) for p in pieces)
        poly = np.zeros((4, len(pieces)))
        harmonics = np.zeros((4, count, len(pieces)))
        for i, piece in enumerate(pieces):
            poly[: len(piece.poly), i] = piece.poly
            for k, h in enumerate(piece.harmonics):
                harmonics[:, k, i] = h
        return cls.from_arrays(before, np.array([p.start for p in pieces], dtype=float), poly, harmonics)

    @classmethod
    def from_arrays(cls, before: float, start: Array, poly: Array, harmonics: Array) -> Motion:
        """Assemble a motion of arrays; positions at the starts of pieces are summed exactly."""
        motion = cls(before, start, poly, harmonics, np.zeros(start.size))
        lengths = np.diff(start)
        travelled = motion._integral(np.arange(start.size - 1), lengths)
        return cls(before, start, poly, harmonics, np.concatenate(([0.0], np.cumsum(travelled))))

    def at(self, time: ArrayLike, side: Side = "right") -> tuple[Array, Array, Array]:
        """Position [m], speed [m/s] and acceleration [m/s²] at `time` (any shape).

        `side` says which limit is meant where a piece ends. An impulse of acceleration (a jump of
        the speed) is not represented: both limits of the acceleration are finite.
        """
        t = np.asarray(time, dtype=float)
        t, index = _locate(self.start, t, side)
        piece = np.maximum(index, 0)
        u = t - self.start[piece]
        past = index < 0
        x = np.where(past, self.before * t, self.origin[piece] + self._integral(piece, u))
        v = np.where(past, self.before, self._derivative(piece, u, 0))
        a = np.where(past, 0.0, self._derivative(piece, u, 1))
        return x, v, a

    def jumps(self, until: float) -> tuple[Array, NDArray[np.int64]]:
        """Times [s] in [0, until] at which a derivative of the position jumps, and its order (1 speed … 4)."""
        inside = self.start <= until
        piece = np.flatnonzero(inside)
        order = np.full(piece.size, HIGHEST_ORDER + 1)
        for derivative in range(HIGHEST_ORDER - 1, -1, -1):
            right = self._derivative(piece, np.zeros(piece.size), derivative)
            before = self.before if derivative == 0 else 0.0
            lengths = self.start[piece[1:]] - self.start[piece[:-1]]
            left = np.concatenate(([before], self._derivative(piece[:-1], lengths, derivative)))
            order[np.abs(right - left) > 1e-9 * (1.0 + np.abs(left))] = derivative + 1
        keep = order <= HIGHEST_ORDER
        return self.start[piece][keep], order[keep]

    def lowest_speed(self, until: float) -> tuple[float, float]:
        """Time [s] and value [m/s] of the least speed on [0, until], within a grid of 4000 times and all piece ends."""
        grid = np.linspace(0.0, until, 4001)
        ends = self.start[self.start <= until]
        times = np.concatenate((grid, ends, ends))
        speeds = np.concatenate((self.at(grid)[1], self.at(ends)[1], self.at(ends, "left")[1]))
        worst = int(np.argmin(speeds))
        return float(times[worst]), float(speeds[worst])

    def _derivative(self, piece: NDArray[np.int64], u: Array, order: int) -> Array:
        """The `order`-th derivative of the speed in `piece` at local time `u`."""
        c = self.poly[:, piece]
        if order == 0:
            result = c[0] + u * (c[1] + u * (c[2] + u * c[3]))
        elif order == 1:
            result = c[1] + u * (2.0 * c[2] + u * 3.0 * c[3])
        elif order == 2:
            result = 2.0 * c[2] + 6.0 * u * c[3]
        else:
            result = 6.0 * c[3]
        for k in range(self.harmonics.shape[1]):
            amplitude, omega, phase, beta = self.harmonics[:, k, piece]
            angle, rate = phase + u * (omega + 0.5 * beta * u), omega + beta * u
            if order == 0:
                result = result + amplitude * np.sin(angle)
            elif order == 1:
                result = result + amplitude * rate * np.cos(angle)
            elif order == 2:
                result = result + amplitude * (beta * np.cos(angle) - rate**2 * np.sin(angle))
            else:
                result = result - amplitude * (3.0 * beta * rate * np.sin(angle) + rate**3 * np.cos(angle))
        return result

    def _integral(self, piece: NDArray[np.int64], u: Array) -> Array:
        """Distance driven in `piece` up to local time `u`."""
        c = self.poly[:, piece]
        result = u * (c[0] + u * (c[1] / 2.0 + u * (c[2] / 3.0 + u * c[3] / 4.0)))
        for k in range(self.harmonics.shape[1]):
            amplitude, omega, phase, beta = self.harmonics[:, k, piece]
            result = result + amplitude * _sine_integral(omega, phase, beta, u)
        return result


def _locate(start: Array, t: Array, side: Side) -> tuple[Array, NDArray[np.int64]]:
    """Times, moved onto a knot that only rounding separates them from, and the piece of each (-1: before 0)."""
    for offset in (0, 1):
        knot = start[np.clip(np.searchsorted(start, t) - offset, 0, start.size - 1)]
        t = np.where(np.abs(knot - t) < 2e-9, knot, t)
    return t, np.searchsorted(start, t, side=side) - 1


def at_lanes(motions: Sequence[Motion], time: Array, side: Side = "right") -> tuple[Array, Array, Array]:
    """Position, speed and acceleration (T, lanes) of several motions at times (T,)."""
    first = motions[0]
    if len(motions) == 1 or any(not np.array_equal(m.start, first.start) for m in motions[1:]):
        parts = [m.at(time, side) for m in motions]
        return tuple(np.stack([p[q] for p in parts], axis=-1) for q in range(3))  # type: ignore[return-value]  # three
    # pieces of all motions side by side make one motion whose pieces are looked up per lane
    count = first.start.size
    most = max(m.harmonics.shape[1] for m in motions)
    padded = [np.pad(m.harmonics, ((0, 0), (0, most - m.harmonics.shape[1]), (0, 0))) for m in motions]
    together = Motion(
        0.0, np.tile(first.start, len(motions)), np.concatenate([m.poly for m in motions], axis=1),
        np.concatenate(padded, axis=2), np.concatenate([m.origin for m in motions]),
    )  # fmt: skip
    before = np.array([m.before for m in motions])
    t = np.asarray(time, dtype=float)[:, None]
    t, index = _locate(first.start, t, side)
    piece = np.maximum(index, 0) + count * np.arange(len(motions))
    u, past = t - together.start[piece], index < 0
    x = np.where(past, before * t, together.origin[piece] + together._integral(piece, u))
    v = np.where(past, before, together._derivative(piece, u, 0))
    return x, v, np.where(past, 0.0, together._derivative(piece, u, 1))


def _sine_integral(omega: Array, phase: Array, beta: Array, u: Array) -> Array:
    """∫_0^u sin(φ + ω t + β t²/2) dt; a Fresnel integral where β ≠ 0."""
    with np.errstate(all="ignore"):
        # sin(a) sin(b) form: no cancellation for small ω u
        half = 0.5 * omega * u
        plain = np.where(omega == 0.0, np.sin(phase) * u, 2.0 * np.sin(phase + half) * np.sin(half) / omega)
        if not np.any(beta):
            return plain
        from scipy.special import fresnel

        scale = np.sqrt(np.abs(beta) / np.pi)
        angle = phase - omega**2 / (2.0 * beta)
        (s1, c1), (s0, c0) = fresnel(scale * (u + omega / beta)), fresnel(scale * omega / beta)
        swept = (np.sign(beta) * (s1 - s0) * np.cos(angle) + (c1 - c0) * np.sin(angle)) / scale
        # a slow sweep has a huge `angle`, whose rounding would be felt: there integration by parts converges at once
        rate = omega + beta * u
        slow = (np.minimum(omega**2, rate**2) > 1e4 * np.abs(beta)) & (omega * rate > 0)
        by_parts = _by_parts(phase + u * (omega + 0.5 * beta * u), rate, beta) - _by_parts(phase, omega, beta)
    return np.where(beta == 0.0, plain, np.where(slow, by_parts, swept))


def _by_parts(angle: Array, rate: Array, beta: Array) -> Array:
    """Antiderivative of sin(angle) where the rate of the angle grows by β: four integrations by parts, β ≪ rate²."""
    q = beta / rate**2
    even, odd = 1.0 - q * q * (3.0 - 105.0 * q * q), q * (1.0 - 15.0 * q * q)
    return -(np.cos(angle) * even + np.sin(angle) * odd) / rate


def polyline(before: float, time: ArrayLike, speed: ArrayLike) -> Motion:
    """Speed that is linear between knots (T,); two knots at the same time make a jump; constant after the last."""
    t, v = np.asarray(time, dtype=float), np.asarray(speed, dtype=float)
    length = np.diff(t)
    keep = np.append(length > 0, True)
    slope = np.append(np.divide(np.diff(v), length, out=np.zeros(length.size), where=length > 0), 0.0)
    poly = np.zeros((4, int(keep.sum())))
    poly[0], poly[1] = v[keep], slope[keep]
    return Motion.from_arrays(before, t[keep], poly, np.zeros((4, 0, poly.shape[1])))


def smooth_curve(before: float, time: ArrayLike, speed: ArrayLike) -> Motion:
    """Speed through knots (T,) by monotone cubics (PCHIP): continuous acceleration, never beyond the knots."""
    from scipy.interpolate import PchipInterpolator

    t, v = np.asarray(time, dtype=float), np.asarray(speed, dtype=float)
    curve = PchipInterpolator(t, v)
    poly = np.concatenate((curve.c[::-1], np.zeros((4, 1))), axis=1)
    poly[0, -1] = v[-1]
    return Motion.from_arrays(before, t, poly, np.zeros((4, 0, poly.shape[1])))
