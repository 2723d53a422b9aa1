"""The checks of a transfer function with exact dead times, decided on the imaginary axis.

Each condition is the sign of an even quasi-polynomial F(jw), which is real, and ``axis.signs``
misses none of its changes.
"""

from __future__ import annotations

import math
from fractions import Fraction
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.optimize import minimize_scalar

from ..core.errors import InputError
from .axis import Signs, reach, settled, signs, zeros
from .delayed import DelayedTransfer
from .floating import last_that_holds
from .quasi import Quasi

RISE = 1e-7  # of the gain: nothing is above it by more
SAME = 1e-12
LEVELS = 60
TURNS = 3e4  # rad of phase of a dead time up to which a shifted function is followed
START = 400  # frequencies at which the search for the largest value begins


def square(q: Quasi) -> Quasi:
    """|q(jw)|^2 as an even quasi-polynomial."""
    return q * q.mirror()


def real_part(a: Quasi, b: Quasi) -> Quasi:
    """Re(a(jw) conj b(jw)) as an even quasi-polynomial."""
    whole = a * b.mirror()
    return (whole + whole.mirror()).scaled(Fraction(1, 2))


def unstable(q: Quasi) -> str:
    """The poles of a system with the denominator q that are not stable; empty where all are."""
    right, origin, on_axis = zeros(q)
    if math.isinf(right):
        return (
            "infinitely many poles right of the imaginary axis, or as near to it as any: a dead "
            "time acts on the highest power of s"
        )
    if right:
        return f"{poles(int(right))} right of the imaginary axis"
    if origin or on_axis is not None:
        return f"a pole on the imaginary axis, at w = {on_axis or 0.0:.6g} rad/s"
    return ""


def poles(count: int) -> str:
    return f"{count} pole{'s' * (count != 1)}"


def crossings(T: DelayedTransfer, c: Fraction) -> tuple[float, tuple[float, ...]]:
    """|T(0)|, nan or inf without one, and where |T(jw)|^2 crosses c |T(0)|^2, in rad/s."""
    top, bottom = T.num.taylor(0), T.den.taylor(0)
    if not top or not bottom:
        return (math.inf if top else math.nan), ()
    above = square(T.num).scaled(bottom**2) + square(T.den).scaled(-c * top**2)
    return abs(float(top / bottom)), signs(above).changes


def largest(T: DelayedTransfer, *near: float) -> tuple[float, float]:
    """sup |T(jw)| of a stable T, to 1e-7, and the w at which it is; inf: as w grows.

    ``near``: frequencies at which |T| is known to be large, which shorten the search.
    """
    best, at = _higher((_size(T, 0.0), 0.0), (_limit(T), math.inf))
    if math.isinf(best):
        return best, at
    N, D = square(T.num), square(T.den)
    w = np.append(near, np.geomspace(1e-6, 1.0, START) * (reach(D) or 1.0))
    best, at = _higher((best, at), _top(T, w))
    for _ in range(LEVELS):
        level = Fraction(best * (1 + RISE)) ** 2
        found = signs(D.scaled(level) + N.scaled(-1))
        ends = np.array([0.0, *found.changes])
        places = np.concatenate([np.sqrt(ends[1:-1] * ends[2:]), ends[-1:] * 2, found.touches])
        if found.first > 0 and not found.changes and not found.touches:
            return best, at
        higher = _higher((best, at), _top(T, places))
        if higher[0] <= best * (1 + RISE):
            return higher
        best, at = higher
    return best, at


def _higher(a: tuple[float, float], b: tuple[float, float]) -> tuple[float, float]:
    """The larger of two values with their places, the first where rounding decides."""
    return b if b[0] > a[0] * (1 + SAME) else a


def _size(T: DelayedTransfer, w: float) -> float:
    return abs(T(1j * w))


def _top(T: DelayedTransfer, w: np.ndarray) -> tuple[float, float]:
    """The largest |T| among frequencies, climbed to its top."""
    sizes = np.abs(T(1j * w))
    k = int(np.argmax(np.where(np.isfinite(sizes), sizes, 0.0)))
    late = max(T.dead_times, default=0.0)
    width = min(0.05 * w[k], 0.5 / late) if late else 0.05 * w[k]
    found: Any = minimize_scalar(
        lambda x: -_size(T, x),
        bounds=(w[k] - width, w[k] + width),
        method="bounded",
        options={"xatol": 1e-10 * w[k]},
    )
    return max((float(sizes[k]), float(w[k])), (_size(T, found.x), float(found.x)))


def _limit(T: DelayedTransfer) -> float:
    """The largest |T(jw)| as w grows without end, of a stable T."""
    if T.num.degree > T.den.degree:
        return math.inf
    return max(map(abs, limits(T)), default=0.0)


def limits(T: DelayedTransfer) -> tuple[float, ...]:
    """The real values that T(jw) takes again and again, or tends to, as w grows; none for 0 and
    infinity."""
    if T.num.degree != T.den.degree:
        return ()
    top, bottom = T.num.leading, T.den.leading
    late = sorted({*top, *bottom})
    if len(late) > 2:
        raise InputError(
            "the gain as w grows is undecided: several dead times act on the highest power of s; "
            "add the lag that the drive has."
        )
    if len(late) == 1:
        return (float(top[late[0]] / bottom[late[0]]),)
    # (a + b z)/(c + d z) is a circle about the real axis, which it crosses at z = 1 and z = -1.
    a, b, c, d = (p.get(k, Fraction(0)) for p in (top, bottom) for k in late)
    return tuple(float(n / m) if m else math.inf for n, m in ((a + b, c + d), (a - b, c - d)))


def realness(T: DelayedTransfer) -> tuple[str, float, float, str]:
    """Classification, margin in 1/s, band edge in rad/s and reason."""
    real = real_part(T.num, T.den)
    sign = signs(real) if real else Signs(0, ())
    edge = _edge(sign)
    if cause := _why_not(T, sign):
        return "not PR", 0.0, edge, cause
    if not real:
        why = "T is zero" if not T.num else "T is lossless, Re T(jw) = 0 at every w"
        return "PR", 0.0, edge, why
    if weak := _why_not_strictly(T, sign):
        return "PR", 0.0, edge, weak
    high, last = 2 * min(T.num.degree, T.den.degree), real.degree
    power = "Re T(jw)" if T.num.degree >= T.den.degree else "w^2 Re T(jw)"
    if last < high:
        why = f"Re T(jw) > 0 at every finite w, but {power} tends to 0 as w grows"
        return "WSPR", 0.0, edge, why
    why = f"all poles are left of the axis, Re T(jw) > 0 at every w, and {power} stays above 0"
    return "SPR", _margin(T), edge, f"{why} as w grows"


def _edge(sign: Signs) -> float:
    if sign.first <= 0:
        return 0.0
    return min([*sign.changes[:1], *sign.touches[:1]], default=math.inf)


def _why_not(T: DelayedTransfer, sign: Signs) -> str:
    """Why T is not positive real; empty where it is."""
    right, origin, on_axis = zeros(T.den)
    if right or on_axis is not None:
        return f"T has {unstable(T.den)}"
    causes = []
    if sign.first < 0 or sign.changes:
        causes.append(f"Re T(jw) < 0 {_bands(sign)}")
    degree = T.den.degree - T.num.degree
    if T.num and abs(degree) > 1:
        causes.append(f"the relative degree is {degree}, which must be -1, 0 or 1")
    if T.num and degree == -1 and not _grows_positively(T):
        causes.append("T grows with w, and not as s times a positive number")
    if origin > 1 or (origin and T.num.taylor(0) / T.den.taylor(1) < 0):
        causes.append("the pole at s = 0 is repeated or its residue is not positive")
    return "; ".join(causes)


def _why_not_strictly(T: DelayedTransfer, sign: Signs) -> str:
    """Why a positive real T is not strictly so; empty where it is, or weakly."""
    if T.den.order():
        return "a simple pole with a positive residue at s = 0"
    if not T.num.taylor(0):
        return "Re T(jw) >= 0, but T has a zero at s = 0"
    if sign.touches:
        return f"Re T(jw) >= 0, but it touches 0 at w = {sign.touches[0]:.6g} rad/s"
    return ""


def _grows_positively(T: DelayedTransfer) -> bool:
    top, bottom = T.num.leading, T.den.leading
    return {*top, *bottom} == {0} and top[0] / bottom[0] > 0


def _bands(sign: Signs) -> str:
    """The bands in which Re T < 0, in words: the first of them."""
    ends = [0.0, *sign.changes] if sign.first < 0 else [*sign.changes]
    pairs = list(pairwise([*ends, math.inf]))[0::2]
    shown = [
        f"for {low:.6g} < w < {high:.6g} rad/s"
        if low and math.isfinite(high)
        else f"for w < {high:.6g} rad/s"
        if math.isfinite(high)
        else f"for w > {low:.6g} rad/s"
        for low, high in pairs[:2]
    ]
    if not sign.complete:
        return f"first {shown[0]}, and again and again as w grows: the dead time turns the phase"
    more = f" and at {len(pairs) - 2} higher places" if len(pairs) > 2 else ""
    return " and ".join(shown) + more


def _margin(T: DelayedTransfer) -> float:
    """The largest eps with T(s - eps) positive real, of an SPR T."""
    most = max(TURNS / max(T.dead_times), 10.0 * (reach(T.den) or 0.0))

    def holds(eps: float) -> bool:
        moved = DelayedTransfer(T.num.shifted(eps), T.den.shifted(eps))
        real = real_part(moved.num, moved.den)
        if (reach(moved.den) or math.inf) > most:
            return False  # short of a chain of poles: eps is too large, or so by about 1e-4
        try:
            return settled(real) is not None and not _why_not(moved, signs(real))
        except InputError:
            return False

    high = 1.0 / max(T.dead_times)
    while holds(high):
        high *= 2.0
    return last_that_holds(holds, high)
