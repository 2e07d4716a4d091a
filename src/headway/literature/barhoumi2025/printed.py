"""Formulas of the comparative study exactly as it prints them. NOT the theory of headway: most are wrong.

They exist for one purpose: to be drawn or printed beside the right figure, which `headway.linearize`
computes. Each says where in the paper it stands (label of the equation, or the section if it has
none) and what differs from the truth. Symbols are the paper's, except that Δv is called
`approach`: v - v_ahead, positive while the gap closes (headway's signal `dv` is its negative).
All arguments may be arrays and are broadcast; SI units.
"""

from __future__ import annotations

from typing import Any

import numpy as np

__all__ = [
    "cacc_longest_delay", "cacc_policy_error", "cacc_sufficient", "cacc_transfer", "gmm_critical_sensitivity",
    "gmm_transfer", "idm_damping", "idm_damping_sign_corrected", "idm_spacing_error", "oscillator_coefficients",
    "oscillator_speed", "oscillator_time_gap", "ovm_critical_sensitivity", "ovm_damping", "ovm_metric",
]  # fmt: skip

# -- IDM -------------------------------------------------------------------------------------------


def idm_damping(
    approach: Any, T: Any, *, speed: Any = 23.0, a: Any = 1.0, b: Any = 1.5, v0: Any = 33.33, delta: Any = 4.0
) -> Any:
    """Damping f_Δv - f_v [1/s] over (Δv [m/s], T [s]); section "String Stability Analysis of IDM Model", no label.

    Wrong: both terms of f_Δv have the sign that belongs to the approach rate, while the damped
    oscillator they are put into has the rate of the gap. It assumes s0 = 0 and s = v T silently, and
    a state with Δv ≠ 0 is no equilibrium. The paper reads its sign as "local string stability"; the
    damping decides about local stability only.
    """
    by_approach, free, by_speed = _idm_terms(approach, T, speed, a, b, v0, delta)
    return -by_approach + free + by_speed


def idm_damping_sign_corrected(
    approach: Any, T: Any, *, speed: Any = 23.0, a: Any = 1.0, b: Any = 1.5, v0: Any = 33.33, delta: Any = 4.0
) -> Any:
    """Damping [1/s] of IDM with both signs right, still with s0 = 0 and s = v T; not printed in the paper.

    At Δv = 0 it is what the printed formula should have been; the damping at the true equilibrium
    differs, because there s = (s0 + v T)/sqrt(1 - (v/v0)^δ).
    """
    by_approach, free, by_speed = _idm_terms(approach, T, speed, a, b, v0, delta)
    return by_approach + free + by_speed


def _idm_terms(approach: Any, T: Any, speed: Any, a: Any, b: Any, v0: Any, delta: Any) -> tuple[Any, Any, Any]:
    """-f_Δv, the free-road part and the interaction part of -f_v, for s = v T and s0 = 0."""
    approach, T = np.asarray(approach, dtype=float), np.asarray(T, dtype=float)
    root = np.sqrt(a * b)
    with np.errstate(divide="ignore", invalid="ignore"):
        by_approach = approach / (2.0 * T**2 * b) + np.sqrt(a) / (T * np.sqrt(b))
        free = a * delta * speed**delta / (speed * v0**delta)
        by_speed = (approach + 2.0 * T * root) ** 2 / (2.0 * T**2 * b * speed)
    return by_approach, free, by_speed


def idm_spacing_error(gap: Any, speed: Any, approach: Any = 0.0, *, T: Any = 1.5, s0: Any = 2.0, a: Any = 1.0,
                      b: Any = 1.5) -> Any:  # fmt: skip
    """E = s* - s [m]; label `error`.

    Wrong as a spacing error: it is not zero in equilibrium, where the free-road term keeps s above
    s*, and its sign is opposite to the paper's own general definition (label `SE`).
    """
    return s0 + T * speed + speed * approach / (2.0 * np.sqrt(a * b)) - gap


# -- OVM -------------------------------------------------------------------------------------------


def ovm_critical_sensitivity(gap: Any, *, v0: Any = 22.0, h: Any = 4.0) -> Any:
    """Least string-stable α = 2 v0 sech²(Δx* - h) [1/s] at `gap` [m]; label `ovm_stability` (44 is 2 v0).

    Right, without delay: it is α >= 2 V'.
    """
    # by e^{-2|x|}, which does not overflow far from h
    q = np.exp(-2.0 * np.abs(np.asarray(gap, dtype=float) - h))
    return 2.0 * v0 * 4.0 * q / (1.0 + q) ** 2


def ovm_metric(gap: Any, alpha: Any, *, v0: Any = 22.0, h: Any = 4.0) -> Any:
    """S = α - 2 v0 sech²(Δx* - h) [1/s], string stable if S >= 0; the display after label `ovm_stability`.

    Right, without delay. The map's axis Δx* stands for a speed: 6 m is V = 43.2 m/s, not the 23 m/s
    of the paper's experiments.
    """
    return np.asarray(alpha, dtype=float) - ovm_critical_sensitivity(gap, v0=v0, h=h)


def ovm_damping(gap: Any, alpha: Any, *, v0: Any = 22.0, h: Any = 4.0) -> Any:
    """So-called damping f_Δx - f_v = α (λ + 1); section "String Stability Analysis of OVM Model", no label.

    Wrong: it adds α λ [1/s²] to α [1/s]. The damping is f_Δv - f_v = α.
    """
    return np.asarray(alpha, dtype=float) * (0.5 * ovm_critical_sensitivity(gap, v0=v0, h=h) + 1.0)


# -- GMM -------------------------------------------------------------------------------------------


def gmm_critical_sensitivity(l: Any, *, gap: Any = 10.0) -> Any:  # noqa: E741  the published symbol
    """Largest "string-stable" α = l / s* at spacing exponent `l` and `gap` [m]; end of the section on GMM, no label.

    Wrong: it follows from nothing, and its units (1/m) are not those of α. Without delay every α is
    string stable; with all signals late by τ the condition is α v^m/s^l τ <= 1/2.
    """
    return np.asarray(l, dtype=float) / gap


def gmm_transfer(p: Any, *, alpha: Any = 1.5, m: Any = 1.0, l: Any = 2.0, speed: Any = 23.0, gap: Any = 10.0) -> Any:  # noqa: E741  as above
    """The "more accurate" G at complex `p` [1/s]; section on GMM, no label: (C p + C l/s) / (p² + C p + C l/s).

    Wrong: the law is proportional to the relative speed, so its derivative by the spacing is zero in
    equilibrium. What the paper rejects, C / (p + C) with C = α v^m/s^l, is right. (The section's
    own linearisation has -C l/s; the sign changes on the way to the printed G.)
    """
    c = alpha * np.asarray(speed, dtype=float) ** m / np.asarray(gap, dtype=float) ** l
    p = np.asarray(p, dtype=complex)
    top = c * p + c * l / gap
    return top / (p * p + top)


# -- CACC ------------------------------------------------------------------------------------------


def cacc_policy_error(gap: Any, speed: Any, *, r: Any = 2.0, h: Any = 1.5) -> Any:
    """e = d_des - d = r + h v - d [m]; label `cth_error`.

    Wrong sign for the control law `cacc` with kp > 0: a vehicle too far behind would brake. Right is d - d_des.
    """
    return r + h * speed - gap


def cacc_transfer(p: Any, *, kp: Any = 0.45, kd: Any = 0.25, kv: Any = 0.5, ka: Any = 0.5, delay: Any = 0.0) -> Any:
    """G at complex `p` [1/s], radio `delay` [s]; section on CACC, "error propagation transfer function", no label.

    Wrong: it drops the time gap h, and its denominator delays the vehicle's own speed like the
    received one. Without delay it amplifies a band of frequencies for every ka ≠ 1.
    """
    p = np.asarray(p, dtype=complex)
    late = np.exp(-p * delay)
    on_board = kp + kd * p
    return (on_board + (kv * p + ka * p * p) * late) / (p * p + on_board + kv * p * late)


def cacc_sufficient(kv: Any, ka: Any, *, kp: Any = 0.45, kd: Any = 0.25, omega0: Any = None) -> Any:
    """Whether ka <= kv/2 and kv >= 2 kd - kp/ω0²: "sufficient" without delay; section on CACC, item "No-delay case".

    `omega0` [rad/s] is by default the paper's natural frequency sqrt(f_s) of the printed G, sqrt(kp),
    which makes the last term 1. Wrong: neither sufficient nor necessary, for the printed G as for
    the true one. Without delay the law is string stable iff ka <= 1 + kd h and ka + kv h + kp h²/2 >= 1.
    """
    kv, ka = np.asarray(kv, dtype=float), np.asarray(ka, dtype=float)
    squared = kp if omega0 is None else np.square(omega0)
    return (ka <= 0.5 * kv) & (kv >= 2.0 * kd - kp / squared)


def cacc_longest_delay(omega: Any, kv: Any, ka: Any, *, kp: Any = 0.45) -> Any:
    """τ_max [s] at the "crossover frequency" `omega` [rad/s]; section on CACC, item "With delay".

    arccos((kv ω² - ka ω⁴ - kp)/(kv ω³))/ω, NaN where the argument lies outside [-1, 1]. Wrong: the
    argument adds terms of different units, kd and h do not occur, and ω_c is not defined.
    """
    w = np.asarray(omega, dtype=float)
    kv = np.asarray(kv, dtype=float)
    with np.errstate(divide="ignore", invalid="ignore"):
        argument = (kv * w**2 - ka * w**4 - kp) / (kv * w**3)
        return np.arccos(argument) / w


# -- the forced oscillator and the time gap --------------------------------------------------------


def oscillator_coefficients(omega: Any, *, omega0: Any, xi: Any) -> tuple[Any, Any]:
    """(A, B) [s²] of y = A cos ωt + B sin ωt under cos ωt; the pair of equations at the end of the modelling section.

    Right: the equations that the paper prints last (and leaves unsolved), although the velocity
    printed before them is not; see `oscillator_speed`.
    """
    stiff, damped = np.square(omega0) - np.square(omega), 2.0 * np.asarray(xi, dtype=float) * omega0 * omega
    d = stiff**2 + damped**2
    return stiff / d, damped / d


def oscillator_speed(time: Any, A: Any, B: Any, omega: Any) -> Any:
    """ẏ = -A ω sin ωt + B ω sin ωt [1/s per unit of A, B]; same section, no label.

    Wrong: the second term is B ω cos ωt.
    """
    return (B - A) * omega * np.sin(omega * np.asarray(time, dtype=float))


def oscillator_time_gap(gap: Any, gap_rate: Any, speed: Any) -> Any:
    """T_H' = gap / (v + ẏ) [s] of a vehicle at equilibrium `speed` whose gap changes by `gap_rate` [m/s]; same section.

    Wrong: behind a leader at constant speed the vehicle's own speed is v - ẏ, as its label `pert1` says.
    """
    return gap / (np.asarray(speed, dtype=float) + gap_rate)
