"""Loops over elements that the kernel is made of: each over whole slices, so that it vectorises."""

from __future__ import annotations

from numba import njit

# Inside the kernel nothing is allocated, so no references need to be counted (which took half the time); and all
# is put in place, as a call would hand over seven words for an array and hundreds for a Platoon or a State.
_alone = {"error_model": "numpy", "nogil": True, "_nrt": False, "no_cpython_wrapper": True, "no_cfunc_wrapper": True}
fast = njit(forceinline=True, **_alone)

#: for what few platoons need, or few steps: a call less matters less than a second less of compiling
seldom = njit(**_alone)


@seldom
def scale_add(out, x, y, c):
    """x + c y."""
    for i in range(out.size):
        out[i] = x[i] + c * y[i]


@seldom
def scale_add2(out, x, y, c, z, d):
    """x + c y + d z."""
    for i in range(out.size):
        out[i] = x[i] + c * y[i] + d * z[i]


@fast
def weigh4(out, a, b, c, d, w):
    """Weighted sum of four rows."""
    w0, w1, w2, w3 = w[0], w[1], w[2], w[3]
    for i in range(out.size):
        out[i] = w0 * a[i] + w1 * b[i] + w2 * c[i] + w3 * d[i]


@seldom
def weigh5(out, a, b, c, d, e, w):
    """Weighted sum of five rows."""
    w0, w1, w2, w3, w4 = w[0], w[1], w[2], w[3], w[4]
    for i in range(out.size):
        out[i] = w0 * a[i] + w1 * b[i] + w2 * c[i] + w3 * d[i] + w4 * e[i]


@seldom
def clip(out, low, high):
    """Cut off at least and largest values."""
    for i in range(out.size):
        u = out[i]
        u = low[i] if u < low[i] else u
        out[i] = high[i] if u > high[i] else u


@seldom
def times(out, factor):
    """Multiply in place."""
    for i in range(out.size):
        out[i] *= factor[i]


@seldom
def toward(out, command, actual, lag):
    """Rate of a first-order actuator: (command - actual)/lag."""
    for i in range(out.size):
        out[i] = (command[i] - actual[i]) / lag[i]


@fast
def copy(out, a):
    """Copy a row."""
    for i in range(out.size):
        out[i] = a[i]


@fast
def spread(out, a):
    """Copy one lane to all, or lane by lane."""
    if a.size == 1:
        out[:] = a[0]
    else:
        for i in range(out.size):
            out[i] = a[i]


@fast
def ballistic_step(xn, vn, x, v, a, h):
    """v + a h and x + (v + v_new) h/2; says whether a vehicle would reverse."""
    found = 0
    for i in range(xn.size):
        u = v[i] + h * a[i]
        xn[i] = x[i] + 0.5 * h * (v[i] + u)
        vn[i] = u
        found |= u < 0.0
    return found != 0


@seldom
def ballistic_stops(xn, vn, x, v, a):
    """A vehicle that would reverse stops within the step, after v²/(2|a|)."""
    for i in range(xn.size):
        if vn[i] < 0.0:
            xn[i] = x[i] - 0.5 * v[i] * v[i] / a[i]
            vn[i] = 0.0


@seldom
def third(out, a, b, slope_a, slope_b, h):
    """Hermite cubic one third into the step."""
    for i in range(out.size):
        out[i] = (20.0 * a[i] + 7.0 * b[i] + h * (4.0 * slope_a[i] - 2.0 * slope_b[i])) / 27.0


@fast
def stage(X, V, x, v, a, b, h, aa, hv):
    """Positions and speeds of a stage: x + h v + aa a, v + hv b."""
    for i in range(X.size):
        X[i] = x[i] + h * v[i] + aa * a[i]
        V[i] = v[i] + hv * b[i]


@fast
def finish(xn, vn, x, v, k1, k2, k3, k4, h):
    """The classical Runge-Kutta step in Nyström form."""
    sixth, square = h / 6.0, h * h / 6.0
    for i in range(xn.size):
        middle = k2[i] + k3[i]
        xn[i] = x[i] + h * v[i] + square * (k1[i] + middle)
        vn[i] = v[i] + sixth * (k1[i] + 2.0 * middle + k4[i])


@seldom
def step_state(out, start, j1, j2, j3, j4, h):
    """The same step for a state whose rates of change are j1 … j4."""
    sixth = h / 6.0
    for i in range(out.size):
        out[i] = start[i] + sixth * (j1[i] + 2.0 * (j2[i] + j3[i]) + j4[i])


@fast
def any_closed_or_reversing(ahead, own, speed, length):
    """Whether a gap closed or a speed turned negative."""
    found = 0
    for i in range(own.size):
        found |= (ahead[i] - own[i] <= length[i]) | (speed[i] < 0.0)
    return found != 0


@seldom
def changed_sides(start, end, low, high, go, speed, ahead, own, length, watch, happened):
    """Whether a gap closed, a speed turned negative, a standing vehicle is asked to go, or a command crossed a limit.

    Only of elements with `watch`; what happened is noted.
    """
    found = 0
    for i in range(own.size):
        event = ahead[i] - own[i] <= length[i]
        event |= (speed[i] < 0.0) & (go[i] != 0.0)
        event |= (end[i] > 0.0) & (go[i] == 0.0)
        event |= ((start[i] < low[i]) != (end[i] < low[i])) | ((start[i] > high[i]) != (end[i] > high[i]))
        event &= watch[i] != 0.0
        happened[i] = 1.0 if event else happened[i]
        found |= event
    return found != 0


@fast
def any_closed(ahead, own, length):
    """Whether a gap closed."""
    found = 0
    for i in range(own.size):
        found |= ahead[i] - own[i] <= length[i]
    return found != 0


@seldom
def closed(ahead, own, length, watch, happened):
    """Whether a gap closed, of elements with `watch`; noted."""
    found = 0
    for i in range(own.size):
        event = (ahead[i] - own[i] <= length[i]) & (watch[i] != 0.0)
        happened[i] = 1.0 if event else happened[i]
        found |= event
    return found != 0
