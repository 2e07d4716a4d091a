"""One follower behind a recorded vehicle, many candidates side by side: the compiled loop of calibration.

A lane is a candidate: parameters, lag, initial state and *delay* of its own, which the lanes of
`headway.engine` must share. Steps are uniform, so a delay is a whole number of steps and a rest, and
the weights that read the past (cubic Hermite, as in the engine) are the same at every step.

The scheme is of third order with one evaluation of the law per step: the acceleration is
extrapolated linearly, the law is asked at the end of the step, and speed and position follow from
the parabola through the last three accelerations (Adams-Bashforth-Moulton, PEC). An actuator lag is
integrated exactly for a command that is linear within the step, so that it may go to 0.
"""

from __future__ import annotations

from numba import njit

from headway.engine.compile import address_of, call_rate
from headway.models.signal import AHEAD, OWN

__all__ = ["follow"]


@njit(error_model="numpy", nogil=True, _nrt=False, no_cpython_wrapper=True, no_cfunc_wrapper=True)
def _mend(place, S, V, A, before, a0, a1, command, start, ahead, h, crash, left):
    """Stop vehicles that would reverse; note those that collide or are not finite, and put them back."""
    for b in range(place.size):
        if V[b] < 0.0:
            # it stops within the step, at an even rate, and stands until the law lets it go
            wrong = h * before[b] + h * h * (3.0 * A[b] + 10.0 * a0[b] - a1[b]) / 24.0
            right = 0.5 * h * before[b] * before[b] / (before[b] - V[b])
            place[b] += right - wrong
            S[b] += wrong - right
            V[b], A[b] = 0.0, 0.0
        if not S[b] > 0.0 or not A[b] * A[b] < 1e12:
            if crash[b] == 0.0:
                crash[b] = left
            place[b], S[b], V[b], A[b], command[b] = ahead[0], start[0, b], ahead[1], 0.0, 0.0


@njit(error_model="numpy", nogil=True, cache=True, _nrt=False)
def follow(
    address, codes, same, shift, weight, lag, limits, parameters, lead, start, h, every, observed, sums, crash, path,
    ring, signals, sources, command, place,
):  # fmt: skip
    """Drive every lane along one record; see `headway.calibration.loop` for the arrays.

    A lane that collides or leaves the finite numbers is put back where it began. B lanes, S signals, n steps, N
    samples.

    Args:
        address: of the compiled law.
        codes: (S, columns) the row of `SIGNAL_TABLE` of each signal.
        same: (S,) the earlier signal with the same own speed, -1 if there is none.
        shift: (2 S, B) whole steps back, of each half of a signal.
        weight: (2 S, 5, B) weights of the past, of each half of a signal.
        lag: (3, B) weights of the actuator.
        limits: (2,) least and largest acceleration [m/s²].
        parameters: (parameters, B).
        lead: (5, n) motion of the vehicle ahead and of the platoon's first.
        start: (2, B) initial gap [m] and speed [m/s].
        h: the step [s].
        every: steps from sample to sample.
        observed: (4, N) recorded gap and speed, and 1 where they are there.
        sums: (2, B) gains the squared errors of gap [m²] and speed [m²/s²].
        crash: (B,) becomes the share of the record that is left after a collision, 0 without one.
        path: (2, N, B) becomes gaps and speeds at samples, if it has any rows.
        ring: (3, a power of two, B) room for the last gaps, speeds and accelerations.
        signals: (S + 1, B) room for what the law hears.
        sources: (S, 3) room for where it hears it.
        command: (2, B) room for accelerations asked for, before and now.
        place: (B,) room for how far each lane has come [m].
    """
    B = start.shape[1]
    M = ring.shape[1] - 1  # the ring has a power of two of rows
    n = lead.shape[1]
    S, V, A = ring[0], ring[1], ring[2]
    keep = path.shape[1] > 0
    for i in range(sources.shape[0]):
        sources[i, 0] = address_of(signals, i * B)
        sources[i, 1] = address_of(signals, codes.shape[0] * B)
        sources[i, 2] = sources[i, 1]
    for b in range(B):
        signals[codes.shape[0], b] = 0.0
        place[b] = 0.0
        command[0, b] = 0.0
        crash[b] = 0.0
    for j in range(n):
        q, o, p = j & M, (j - 1) & M, (j - 2) & M
        if j == 0:
            for b in range(B):
                S[0, b], V[0, b], A[0, b] = start[0, b], start[1, b], 0.0
        else:
            for b in range(B):
                a0 = A[o, b]
                a1 = A[p, b] if j > 1 else a0
                u = V[o, b] + h * (1.5 * a0 - 0.5 * a1)
                dx = h * V[o, b] + h * h * (4.0 * a0 - a1) / 6.0
                V[q, b] = u if u > 0.0 else 0.0
                S[q, b] = start[0, b] + lead[0, j] - (place[b] + (dx if dx > 0.0 else 0.0))
                A[q, b] = 2.0 * a0 - a1
        for i in range(codes.shape[0]):
            order, of, less = codes[i, 0], codes[i, 1], codes[i, 2]
            k1, w1, k2, w2 = shift[2 * i], weight[2 * i], shift[2 * i + 1], weight[2 * i + 1]
            out = signals[i]
            if order == 0:
                for b in range(B):
                    k = j - k1[b]
                    if k <= 0:
                        out[b] = start[0, b]
                    else:
                        x, y = (k - 1) & M, k & M
                        out[b] = (
                            w1[0, b] * S[x, b] + w1[1, b] * S[y, b]
                            + w1[2, b] * (lead[1, k - 1] - V[x, b]) + w1[3, b] * (lead[1, k] - V[y, b])
                        )  # fmt: skip
            elif order == 1 and (of == OWN or less == OWN):
                if same[i] >= 0:
                    for b in range(B):
                        out[b] = signals[same[i], b]
                else:
                    for b in range(B):
                        k = j - k2[b]
                        if k <= 0:
                            own = start[1, b]
                        else:
                            x, y = (k - 1) & M, k & M
                            own = w2[0, b] * V[x, b] + w2[1, b] * V[y, b] + w2[2, b] * A[x, b] + w2[3, b] * A[y, b]
                        out[b] = own
                if less == OWN:
                    for b in range(B):
                        k = j - k1[b]
                        if k <= 0:
                            ahead = lead[1, 0]
                        else:
                            ahead = (
                                w1[0, b] * lead[1, k - 1] + w1[1, b] * lead[1, k]
                                + w1[2, b] * lead[2, k - 1] + w1[3, b] * lead[2, k]
                            )  # fmt: skip
                        out[b] = ahead - out[b]
            elif of == OWN:
                for b in range(B):
                    k = j - k1[b]
                    out[b] = 0.0 if k <= 0 else w1[4, b] * A[(k - 1) & M, b] + (1.0 - w1[4, b]) * A[k & M, b]
            elif order == 1:
                row = 1 if of == AHEAD else 3
                for b in range(B):
                    k = j - k1[b]
                    if k <= 0:
                        out[b] = lead[row, 0]
                    else:
                        out[b] = (
                            w1[0, b] * lead[row, k - 1] + w1[1, b] * lead[row, k]
                            + w1[2, b] * lead[row + 1, k - 1] + w1[3, b] * lead[row + 1, k]
                        )  # fmt: skip
            else:
                row = 2 if of == AHEAD else 4
                for b in range(B):
                    k = j - k1[b]
                    # a delay that ends exactly at the start sees its right limit
                    if k < 0 or (k == 0 and w1[4, b] > 0.0):
                        out[b] = 0.0
                    elif k == 0:
                        out[b] = lead[row, 0]
                    else:
                        out[b] = w1[4, b] * lead[row, k - 1] + (1.0 - w1[4, b]) * lead[row, k]
        call_rate(
            address, address_of(sources, 0), address_of(parameters, 0), address_of(command, B), B, 0,
            parameters.shape[1], 0,
        )  # fmt: skip
        low, high = limits[0], limits[1]
        for b in range(B):
            u = command[1, b]
            u = low if u < low else u
            command[1, b] = high if u > high else u
        if j == 0:
            for b in range(B):
                # behind a lag the vehicle starts without acceleration
                A[0, b] = command[1, b] if lag[0, b] == 0.0 else 0.0
        else:
            bad = 0
            for b in range(B):
                a0, v0 = A[o, b], V[o, b]
                a1 = A[p, b] if j > 1 else a0
                a = lag[0, b] * a0 + lag[1, b] * command[0, b] + lag[2, b] * command[1, b]
                v = v0 + h * (5.0 * a + 8.0 * a0 - a1) / 12.0
                x = place[b] + h * v0 + h * h * (3.0 * a + 10.0 * a0 - a1) / 24.0
                s = start[0, b] + lead[0, j] - x
                bad |= (v < 0.0) | (not s > 0.0) | (not a * a < 1e12)
                place[b], S[q, b], V[q, b], A[q, b] = x, s, v, a
            if bad:
                _mend(
                    place,
                    S[q],
                    V[q],
                    A[q],
                    V[o],
                    A[o],
                    A[p if j > 1 else o],
                    command[1],
                    start,
                    lead[:, j],
                    h,
                    crash,
                    (n - j) / n,
                )
        for b in range(B):
            command[0, b] = command[1, b]
        if j % every == 0:
            i = j // every
            gap, speed, wg, wv = observed[0, i], observed[1, i], observed[2, i], observed[3, i]
            for b in range(B):
                e, f = S[q, b] - gap, V[q, b] - speed
                sums[0, b] += wg * e * e
                sums[1, b] += wv * f * f
            if keep:
                for b in range(B):
                    path[0, i, b] = S[q, b]
                    path[1, i, b] = V[q, b]
