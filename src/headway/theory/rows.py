"""Compiled theory of rows: one linear vehicle a row, in the order of `COLUMNS`.

With S = f_s e^{-pτ_s} the transfer function is G = (S + p q)/(S + p r), so that on the imaginary axis

    H = (|D|² - |N|²)/ω² = |r|² - |q|² - 2 f_s Im[e^{iωτ_s}(r - q)]/ω

has all its digits for long waves too. Locally stable or not is counted by the principle of the
argument: n/2 - Δarg D(σ + iω)/π roots lie to the right of σ. Referees: `headway.theory.gain`, `roots`.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from headway.environment import compile_without_disk
from headway.theory.critical import LONGEST
from headway.theory.gain import ABOVE_ONE, BALANCED, NOISE, SAMPLES, TOLERANCE, WINDOW
from headway.theory.quasipolynomial import HIGHEST

__all__ = [
    "COLUMNS", "fill_critical_delays", "fill_decay_rates", "fill_gains", "fill_margins", "fill_peaks", "roots_right_of",
]  # fmt: skip

#: what a row holds: partial derivatives by signal, delays [s] (of dv: its leader's and its own half), lag [s]
COLUMNS = (
    "s", "v", "dv", "a", "vl", "al",
    "delay.s", "delay.v", "delay.leader", "delay.own", "delay.a", "delay.vl", "delay.al", "lag",
)  # fmt: skip

#: frequency [rad/s] up to which all rows are sampled alike, and dips looked into of what few laws need beyond
_COMMON, _REFINED = 200.0, 12

compile_without_disk()
_compiled = njit(cache=True, nogil=True, error_model="numpy")
_inlined = njit(cache=True, nogil=True, error_model="numpy", forceinline=True)

#: frequencies rise by this share of themselves, at least by this, at most by an eighth of the longest delay's half wave
_RISE, _LEAST_RISE = 0.1, 1e-3
#: argument [rad] by which D may turn between two frequencies before they are halved
_WIDE = 1.1


@_inlined
def _late(p, tau):
    if tau == 0.0:
        return complex(1.0, 0.0)
    size = math.exp(-p.real * tau) if p.real != 0.0 else 1.0
    return complex(size * math.cos(p.imag * tau), -size * math.sin(p.imag * tau))


@_inlined
def _parts(row, p):
    """Return S, r and q at complex p; most patterns delay several signals alike, and sines are what this costs."""
    at_s = _late(p, row[6])
    at_v = at_s if row[7] == row[6] else _late(p, row[7])
    at_leader = at_s if row[8] == row[6] else _late(p, row[8])
    at_own = at_v if row[9] == row[7] else _late(p, row[9])
    r = p * (1.0 + p * row[13]) + row[2] * at_own - row[1] * at_v
    q = row[2] * at_leader
    if row[3] != 0.0:
        r -= p * row[3] * _late(p, row[10])
    if row[4] != 0.0:
        q += row[4] * _late(p, row[11])
    if row[5] != 0.0:
        q += p * row[5] * _late(p, row[12])
    return row[0] * at_s, r, q


@_inlined
def _bottom(row, p):
    """Return D(p), without the factor p of a law that rests at every gap."""
    s, r, _ = _parts(row, p)
    return s + p * r if row[0] != 0.0 else r


@_inlined
def _value(row, w, gain):
    """Return H(ω), or minus |G(iω)|² if `gain`: what is to be minimized over all frequencies."""
    s, r, q = _parts(row, complex(0.0, w))
    if gain:
        if row[0] != 0.0:
            r, q = s + complex(0.0, w) * r, s + complex(0.0, w) * q
        return -(q.real * q.real + q.imag * q.imag) / (r.real * r.real + r.imag * r.imag)
    level = r.real * r.real + r.imag * r.imag - q.real * q.real - q.imag * q.imag
    if row[0] == 0.0:
        return level / (w * w)
    return level + 2.0 * (s.real * (q - r).imag - s.imag * (q - r).real) / w


@_inlined
def _longest(row):
    longest = 0.0
    for k in range(6, 13):
        longest = max(longest, row[k])
    return longest


@_inlined
def _leading(row, sigma):
    """Return the coefficients by which |D| >= now ω² - late ω² - … for short waves, lag apart."""
    if row[10] > 0.0:
        return 1.0, abs(row[3]) * math.exp(-sigma * row[10])
    return 1.0 - row[3], 0.0


@_compiled
def _end(row, sigma, top):
    """Return the frequency beyond which D's leading term exceeds the rest and `top` numerators; inf if never."""
    now, late = _leading(row, sigma)
    stretch = math.exp(-min(sigma, 0.0) * _longest(row))
    slope = stretch * (abs(row[2]) + abs(row[1]) + top * (abs(row[2]) + abs(row[4])))
    level = stretch * abs(row[0]) * (1.0 + top)
    w = 1.0
    while w < HIGHEST:
        size = math.hypot(w, sigma)
        lead = abs(now + row[13] * complex(sigma, w)) - late - top * abs(row[5])
        if lead * size * size > level + slope * size:
            return w
        w *= 1.3
    return math.inf


@_compiled
def _turned(row, sigma, w, following, before, after):
    """Return the argument by which D turns between two frequencies; halved until it turns by less than `_WIDE`."""
    turned = 0.0
    ends = np.empty(60)
    values = np.empty(60, dtype=np.complex128)
    ends[0], values[0] = following, after
    top = 0
    while top >= 0:
        angle = np.angle(values[top] * np.conj(before))
        if abs(angle) > _WIDE and top < 59 and ends[top] - w > 1e-12 * (1.0 + w):
            top += 1
            ends[top] = 0.5 * (w + ends[top - 1])
            values[top] = _bottom(row, complex(sigma, ends[top]))
        else:
            turned += angle
            w, before = ends[top], values[top]
            top -= 1
    return turned


@_compiled
def roots_right_of(row, sigma):
    """Count the roots of a row with a real part above `sigma` [1/s], by the principle of the argument; 999: a chain."""
    now, late = _leading(row, sigma)
    end = _end(row, sigma, 0.0)
    if end == math.inf or (row[13] == 0.0 and late >= abs(now)):
        return 999  # a neutral equation with a chain of roots on or beyond the line
    if sigma == 0.0 and row[0] == 0.0 and row[1] == row[2]:
        return 1  # a speed that nothing corrects
    degree = (3 if row[13] > 0.0 else 2) - (1 if row[0] == 0.0 else 0)
    step = math.pi / (8.0 * _longest(row)) if _longest(row) > 0.0 else math.inf
    w = 0.0
    before = _bottom(row, complex(sigma, 0.0))
    turned = 0.0
    while w < end:
        following = min(w + min(max(_RISE * w, _LEAST_RISE), step), end)
        after = _bottom(row, complex(sigma, following))
        angle = np.angle(after * np.conj(before))
        turned += angle if abs(angle) <= _WIDE else _turned(row, sigma, w, following, before, after)
        w, before = following, after
    lead = row[13] if row[13] > 0.0 else now
    turned += np.angle(lead * complex(0.0, 1.0) ** degree * np.conj(before))
    return round(0.5 * degree - turned / math.pi)


@_compiled
def _decay(row):
    """Return minus the real part of the rightmost root, and whether that root is a pair."""
    low, high = 0.0, 0.0
    step = 1e-3
    if roots_right_of(row, 0.0) > 0:
        while roots_right_of(row, high) > 0 and step < 1e4:
            low, high = high, high + step
            step *= 2.0
    else:
        while roots_right_of(row, low) == 0 and step < 1e4:
            low, high = low - step, low
            step *= 2.0
    if step >= 1e4:
        return math.nan, False
    while high - low > 1e-10 * (1.0 + abs(low)):
        middle = 0.5 * (low + high)
        if roots_right_of(row, middle) > 0:
            low = middle
        else:
            high = middle
    return -0.5 * (low + high), roots_right_of(row, low - 1e-9) % 2 == 0


@_compiled
def _least(row, end, gain):
    """Return the least `_value` over (0, end] and where (0: long waves); golden section refines local minima."""
    step = math.pi / (8.0 * _longest(row)) if _longest(row) > 0.0 else math.inf
    older = 0.0
    # the first sample stands for the limit of long waves; without f_s, digits are lost below 1e-4
    old = w = 1e-6 if row[0] != 0.0 else 1e-4
    h_older = math.inf
    best = h_old = _value(row, w, gain)
    where = 0.0
    while w < end:
        w = min(w + min(max(_RISE * w, _LEAST_RISE), step), end)
        h = _value(row, w, gain)
        if h < best:
            best, where = h, w
        if h_old <= h and h_old < h_older and older > 0.0:
            value, at = _golden(row, older, w, gain)
            if value < best:
                best, where = value, at
        older, old = old, w
        h_older, h_old = h_old, h
    return best, where


@_compiled
def _golden(row, a, b, gain):
    share = 0.6180339887498949
    c, d = b - share * (b - a), a + share * (b - a)
    at_c, at_d = _value(row, c, gain), _value(row, d, gain)
    while b - a > 1e-8 * b:
        if at_c < at_d:
            b, d, at_d = d, c, at_c
            c = b - share * (b - a)
            at_c = _value(row, c, gain)
        else:
            a, c, at_c = c, d, at_d
            d = a + share * (b - a)
            at_d = _value(row, d, gain)
    return (at_c, c) if at_c < at_d else (at_d, d)


@_compiled
def _tail(row):
    """Return the limit superior of |G| for short waves, and the frequency beyond which no wave needs a look."""
    now, late = _leading(row, 0.0)
    limit = abs(row[5]) / (abs(now) - late) if abs(now) > late else math.inf
    if row[13] > 0.0 or row[5] == 0.0:
        limit = 0.0
    end, shortest = _end(row, 0.0, 1.0), math.inf
    if end >= HIGHEST:
        for k in range(6, 13):
            shortest = min(shortest, row[k] if row[k] > 0.0 else math.inf)
        end = min(max(1e4, 64.0 * math.pi / shortest), HIGHEST)
    return 1.0 if abs(limit - 1.0) <= BALANCED else limit, end


@_compiled
def _beyond(row, end, gain):
    """Return the least `_value` from about `_COMMON` to `end` and where; windows of samples where all are too many."""
    step = math.pi / (16.0 * _longest(row)) if _longest(row) > 0.0 else math.inf
    resolved = SAMPLES * step
    w = older = 0.8 * _COMMON  # a dip at the seam lies in one of the two parts
    best = h_old = _short_value(row, w, gain)
    where, h_older, count = w, math.inf, 0
    depth, left, right = np.full(_REFINED, math.inf), np.empty(_REFINED), np.empty(_REFINED)
    while w < end:
        forward = min(_RISE * w, step)
        if w > resolved:
            count += 1
            if count == WINDOW:
                count, forward = 0, _RISE * w
        before, w = w, min(w + forward, end)
        h = _short_value(row, w, gain)
        if h < best:
            best, where = h, w
        if h_old <= h and h_old < h_older and before > older:
            # the dips that parabolas make the deepest are refined; resonances are parabolas of 1/|G|²
            x, y, z = (-1.0 / h_older, -1.0 / h_old, -1.0 / h) if gain else (h_older, h_old, h)
            low = y - (x - z) * (x - z) / (8.0 * (x - 2.0 * y + z)) if x - 2.0 * y + z > 0.0 else y
            worst = np.argmax(depth)
            if low < depth[worst]:
                depth[worst], left[worst], right[worst] = low, older, w
        older, h_older, h_old = before, h_old, h
    for k in range(_REFINED):
        if depth[k] < math.inf:
            at = _golden(row, left[k], right[k], gain)[1]
            value = _short_value(row, at, gain)
            if value < best:
                best, where = value, at
    return best, where


@_inlined
def _short_value(row, w, gain):
    """Return `_value` where waves are short: differences that are rounding count as 0."""
    value = _value(row, w, gain)
    if gain:
        return value
    _, r, _ = _parts(row, complex(0.0, w))
    return 0.0 if abs(value) <= NOISE * (r.real * r.real + r.imag * r.imag) else value


@_inlined
def _lowest(row, end, gain):
    """Return the least `_value` over all frequencies and where."""
    least, where = _least(row, min(end, _COMMON), gain)
    if end > _COMMON:
        other, at = _beyond(row, end, gain)
        if other < least:
            return other, at
    return least, where


@_compiled
def _margin(row):
    """Return the least H; minus infinity where short waves grow."""
    limit, end = _tail(row)
    return -math.inf if limit > 1.0 else _lowest(row, end, False)[0]


@_compiled
def _stable(row):
    return _margin(row) >= -TOLERANCE and roots_right_of(row, 0.0) == 0


@_compiled
def fill_margins(rows, margin, unstable):
    """Fill `margin` [1/s²] (see `Linear.margin`) and `unstable`, the number of growing roots, both (points,)."""
    for i in range(rows.shape[0]):
        margin[i] = _margin(rows[i])
        unstable[i] = roots_right_of(rows[i], 0.0)


@_compiled
def fill_decay_rates(rows, decay, pair):
    """Fill `decay` [1/s] and `pair`, whether the slowest motion oscillates, both (points,)."""
    for i in range(rows.shape[0]):
        decay[i], pair[i] = _decay(rows[i])


@_compiled
def fill_peaks(rows, gain, frequency):
    """Fill `gain`, sup|G| (infinite if locally unstable), and its `frequency` [rad/s], both (points,).

    The gain is above 1 exactly where the margin says that a frequency grows.
    """
    for i in range(rows.shape[0]):
        row = rows[i]
        if roots_right_of(row, 0.0) > 0:
            gain[i], frequency[i] = math.inf, math.nan
            continue
        limit, end = _tail(row)
        value, where = _lowest(row, end, True)
        size, zero = math.sqrt(-value), math.sqrt(-_value(row, 0.0, True))
        if limit > size:
            size, where = limit, math.inf
        elif where == 0.0:
            size = zero
        if _margin(row) < -TOLERANCE:
            size = max(size, ABOVE_ONE)
        elif size >= 1.0 - 1e-12:
            size, where = min(zero, 1.0), 0.0
        gain[i], frequency[i] = size, where


@_compiled
def fill_gains(rows, omega, gain):
    """Fill `gain` with |G(iω)| at one frequency `omega` [rad/s] for each row; infinite if locally unstable."""
    for i in range(rows.shape[0]):
        gain[i] = math.sqrt(-_value(rows[i], omega[i], True)) if roots_right_of(rows[i], 0.0) == 0 else math.inf


@_compiled
def fill_critical_delays(rows, delay):
    """Fill `delay` with the first one [s] at which the string verdict is lost, the pattern in each row scaled.

    It is the longest of the pattern: 0 if no delay is borne, infinite if `LONGEST` is. Rows must have a delay.
    """
    row = np.empty(rows.shape[1])
    for i in range(rows.shape[0]):
        unit = _longest(rows[i])
        row[:] = rows[i]
        # what no delay survives, however short: leading terms that come back, or pass on, by more than they are
        now, late = _leading(row, 0.0)
        never = row[13] == 0.0 and (late >= abs(now) or _tail(row)[0] > 1.0)
        row[6:13] = 0.0
        if never or not _stable(row):
            delay[i] = 0.0
            continue
        low, high, step = 0.0, 1e-3, 1e-3
        delay[i] = math.inf
        while low < LONGEST:
            row[6:13] = rows[i, 6:13] * (high / unit)
            if not _stable(row):
                while high - low > 1e-10 * high and high > 1e-12:
                    middle = 0.5 * (low + high)
                    row[6:13] = rows[i, 6:13] * (middle / unit)
                    if _stable(row):
                        low = middle
                    else:
                        high = middle
                delay[i] = 0.5 * (low + high)
                break
            low, step = high, max(1e-3, min(0.12 * high, 1.0))
            high = high + step
