"""Closed forms of the checks for pure P, PI, PD and PID controllers, elementwise.

Arguments are arrays or numbers that broadcast, with J > 0, sigma0 > 0, sigma1 >= 0. Signs of
differences of products decide the classes; they are exact for the given floats.
"""

from __future__ import annotations

from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import NDArray

CLASSES = ("not PR", "PR", "WSPR", "SPR")
NOT_PR, PR, WSPR, SPR = range(4)
SETTLED = 1e-6  # last Newton step relative to the root; the remaining error is its square
Floats = NDArray[np.float64]


def sign_of_difference(a: Any, b: Any, c: Any, d: Any) -> NDArray[np.int8]:
    """Sign of a b - c d. Rounding is monotone: only products that round alike are uncertain."""
    left, right = np.multiply(a, b), np.multiply(c, d)
    sign = np.asarray(np.greater(left, right), np.int8) - np.less(left, right)
    alike = np.equal(left, right)
    if np.any(alike):
        parts = np.broadcast_arrays(a, b, c, d)
        w, x, y, z = (part == 0 for part in parts)
        alike, sign = alike & ~((w | x) & (y | z)), np.array(np.broadcast_to(sign, w.shape))
        for i in zip(*np.nonzero(alike), strict=True):
            w, x, y, z = (Fraction(float(part[i])) for part in parts)
            sign[i] = (w * x > y * z) - (w * x < y * z)
    return sign


def l2_gain(J: Any, sigma0: Any, sigma1: Any, K2: Any) -> tuple[Floats, Floats]:
    """The larger of |K2|/sigma0 and J/sigma1, and where: 0 or infinity (see ``l2_check``)."""
    size = np.abs(K2)
    at_rest = sign_of_difference(size, sigma1, J, sigma0) >= 0
    with np.errstate(divide="ignore"):
        gain = np.where(at_rest, size / sigma0, np.divide(J, sigma1))
    return gain, np.where(at_rest, 0.0, np.inf)


def position_class(J: Any, s0: Any, s1: Any, kp: Any, ki: Any, kd: Any) -> NDArray[np.int8]:
    """Class of (s1 s + s0)/(J s^2 + kd s + kp + ki/s); a = s1 kd - s0 J, b = s0 kp - s1 ki.

    ki = 0: P(x) = a x + s0 kp. SPR iff kp > 0, a > 0; WSPR iff kp > 0, a = 0; PR iff kp = 0,
    a >= 0. ki not 0: P(x) = x (a x + b); PR iff ki > 0, a >= 0, b >= 0, which implies
    kd kp >= J ki.
    """
    a, b = sign_of_difference(s1, kd, s0, J), sign_of_difference(s0, kp, s1, ki)
    positive_kp = np.greater(kp, 0)
    bare = np.where(positive_kp, np.where(a > 0, SPR, WSPR), np.where(np.less(kp, 0), NOT_PR, PR))
    with_integral = np.greater(ki, 0) & (b >= 0)
    kind = np.where(np.equal(ki, 0), bare, with_integral)
    return np.where(a >= 0, kind, NOT_PR).astype(np.int8)


def velocity_class(J: Any, s0: Any, s1: Any, kp: Any, ki: Any, kd: Any) -> NDArray[np.int8]:
    """Class of (s1 s + s0)/((J + kd) s + kp + ki/s), J + kd > 0; b = s0 kp - s1 ki.

    ki = 0: P(x) = s1 (J + kd) x + s0 kp. SPR iff kp > 0; PR iff kp = 0. ki not 0:
    P(x) = x (s1 (J + kd) x + b); PR iff ki > 0 and b >= 0.
    """
    b = sign_of_difference(s0, kp, s1, ki)
    bare = np.where(np.greater(kp, 0), SPR, np.where(np.less(kp, 0), NOT_PR, PR))
    kind = np.where(np.equal(ki, 0), bare, np.greater(ki, 0) & (b >= 0))
    return np.where(np.add(J, kd) > 0, kind, NOT_PR).astype(np.int8)


def position_stable(J: Any, kp: Any, ki: Any, kd: Any) -> NDArray[np.bool_]:
    """J s^3 + kd s^2 + kp s + ki Hurwitz, J s^2 + kd s + kp with ki = 0."""
    routh = sign_of_difference(kd, kp, J, ki) > 0
    return np.greater(kd, 0) & np.greater(kp, 0) & np.greater_equal(ki, 0) & routh


def velocity_stable(J: Any, kp: Any, ki: Any, kd: Any) -> NDArray[np.bool_]:
    """(J + kd) s^2 + kp s + ki Hurwitz, (J + kd) s + kp with ki = 0."""
    turn = np.sign(np.add(J, kd))
    return (turn * kp > 0) & (turn * ki >= 0)


def velocity_bandwidth(J: Any, kp: Any, ki: Any, kd: Any, c: float) -> tuple[Floats, Any]:
    """First w with |T(jw)|^2 = c |T(0)|^2, T = (kp s + ki)/((J + kd) s^2 + kp s + ki).

    With x = w^2 the only positive root of
    c (J + kd)^2 x^2 + (c (kp^2 - 2 (J + kd) ki) - kp^2) x - (1 - c) ki^2,
    whose last two coefficients move up by one x for ki = 0. Also returns which answers are
    uncertain: those of a loop without inertia or beyond the range of floats.
    """
    M, square = np.add(J, kd), np.multiply(kp, kp)
    half = 0.5 * ((c - 1) * square - 2 * c * M * ki)
    first, last = c * M * M, (1 - c) * np.multiply(ki, ki)
    x = positive_root(first, half, last)
    return _frequency(x, kp, ki, ~(np.isfinite(x) & (x > 0)))


def positive_root(a: Any, half: Any, last: Any) -> Floats:
    """The positive root of a x^2 + 2 half x - last, a > 0, last >= 0, without cancellation."""
    root = np.sqrt(half * half + a * last)
    return np.where(half > 0, last / (half + root), (root - half) / a)


def position_bandwidth(J: Any, kp: Any, ki: Any, kd: Any, c: float) -> tuple[Floats, Any]:
    """First w with |T(jw)|^2 = c |T(0)|^2, T = (kp s + ki)/(J s^3 + kd s^2 + kp s + ki).

    With x = w^2 the least positive root of x^3 + p x^2 + q x + r, where
    p = (kd^2 - 2 J kp)/J^2, q = -((1 - c) kp^2/c + 2 ki kd)/J^2, r = -(1 - c) ki^2/(c J^2);
    the only one unless p < 0 < q. By Cardano's formula, or the quadratic that remains for x far
    below p, and two Newton steps. Also returns which answers are uncertain, such as those where
    the level is almost touched.
    """
    inertia = 1 / np.multiply(J, J)
    rest = (1 - c) / c
    p = (np.multiply(kd, kd) - 2 * np.multiply(J, kp)) * inertia
    q = -(rest * np.multiply(kp, kp) + 2 * np.multiply(ki, kd)) * inertia
    r = -rest * np.multiply(ki, ki) * inertia
    p, q, r = np.broadcast_arrays(p, q, r)
    start, doubt = _least_positive(p, q, r)
    x = start
    for _ in range(2):
        step = (((x + p) * x + q) * x + r) / ((3 * x + 2 * p) * x + q)
        x = x - step
    good = (np.abs(step) < SETTLED * x) & (np.abs(x - start) < 1e-3 * x)
    return _frequency(x, kp, ki, ~good | doubt)


def _least_positive(p: Any, q: Any, r: Any) -> tuple[Floats, Any]:
    """Approximate least positive root of x^3 + p x^2 + q x + r, r <= 0; whether uncertain."""
    third = p / 3
    P, Q = q / 3 - third * third, third * (third * third - q / 2) + r / 2
    P3, Q2 = P * P * P, Q * Q
    disc = P3 + Q2
    u = np.cbrt(-Q - np.copysign(np.sqrt(np.maximum(disc, 0)), Q))
    x = u - P / u - third
    three, several = disc < 0, (p < 0) & (q > 0)
    if np.any(three):
        x[three] = _of_three(P[three], Q[three], several[three]) - third[three]
    without_cube = positive_root(p, q / 2, -r)
    x = np.where((p > 0) & (p > 1e4 * without_cube), without_cube, x)
    return x, several & (np.abs(disc) < 1e-9 * (np.abs(P3) + Q2))


def _of_three(P: Any, Q: Any, several: Any) -> Floats:
    """The largest of three real roots of t^3 + 3 P t + 2 Q, or the least where ``several``."""
    size = np.sqrt(-P)
    angle = np.arccos(np.clip(-Q / size**3, -1, 1)) / 3
    return 2 * size * np.cos(np.where(several, angle + 2 * np.pi / 3, angle))


def _frequency(x: Any, kp: Any, ki: Any, doubt: Any) -> tuple[Floats, Any]:
    """sqrt(x); nan, and certain, where T(0) is zero."""
    no_dc = np.equal(kp, 0) & np.equal(ki, 0)
    return np.where(no_dc, np.nan, np.sqrt(x)), doubt & ~no_dc
