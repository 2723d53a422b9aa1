"""The checks on many designs at once."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..blocks.model import values_of
from ..core.errors import InputError
from ..core.result import Result
from ..core.validation import array as numbers
from ..core.validation import shown
from .band import bandwidth_check, level_power
from .loops import position_loop_tf, velocity_loop_tf

CLASSES = ("not PR", "PR", "WSPR", "SPR")
NOT_PR, PR, WSPR, SPR = range(4)
SETTLED = 1e-6  # last Newton step relative to the root; the remaining error is its square
Floats = NDArray[np.float64]
CHUNK = 8192  # designs at a time, so that temporary arrays fit into the cache
NAMES = ("J", "sigma0", "sigma1", "kp", "ki", "kd", "K2")


@dataclass(frozen=True, repr=False)
class DesignChecks(Result):
    """The checks of many designs, arrays of one shape.

    ``l2_gain``, ``l2_frequency`` as in ``l2_check``; ``classification`` an index into
    ``CLASSES`` ("not PR", "PR", "WSPR", "SPR"); ``bandwidth`` in rad/s and ``stable`` as in
    ``bandwidth_check``.
    """

    l2_gain: NDArray[np.float64]
    l2_frequency: NDArray[np.float64]
    classification: NDArray[np.int8]
    bandwidth: NDArray[np.float64]
    stable: NDArray[np.bool_]
    _units = {"l2_gain": "s", "l2_frequency": "rad/s", "bandwidth": "rad/s"}

    @property
    def spr(self) -> NDArray[np.bool_]:
        """Which T(s) are SPR."""
        return self.classification == SPR

    @property
    def names(self) -> NDArray[np.str_]:
        """The classification in words."""
        return np.array(CLASSES)[self.classification]

    def summary(self) -> dict[str, Any]:
        """Plain Python: the number of designs, and of each outcome."""
        counts = np.bincount(self.classification.ravel(), minlength=len(CLASSES))
        return {
            "designs": self.stable.size,
            "finite_gain": int(np.isfinite(self.l2_gain).sum()),
            "classification": dict(zip(CLASSES, counts.tolist(), strict=True)),
            "stable": int(self.stable.sum()),
        }


def check_designs(
    p: Any,
    kp: ArrayLike = 0.0,
    ki: ArrayLike = 0.0,
    kd: ArrayLike = 0.0,
    *,
    K2: ArrayLike,
    loop: str = "velocity",
    level: str | float = "-3dB",
) -> DesignChecks:
    """L2 gain, SPR class and bandwidth of many designs in one call.

    Gives the answers of ``l2_check(p, K2)``, ``spr_check(position_T(p, kp, ki, kd))`` and
    ``bandwidth_check(position_loop_tf(p, kp, ki, kd), level)``, or their velocity counterparts,
    by closed forms: the classes exactly for the given floats, the bandwidths to about 1e-9.

    Parameters
    ----------
    p : Parameters, Model or any object with attributes J > 0, sigma0 > 0, sigma1 >= 0
        SI units; the attributes are numbers or arrays.
    kp, ki, kd : float or array_like
        Gains in the units of :func:`position_T` or :func:`velocity_T`; pure integral action only.
    K2 : float or array_like
        Observer gain in N m s/rad. It and all the others broadcast.
    loop : "velocity" or "position"
        For the class and the bandwidth.
    level : "-3dB", "half-power" or float
        As for :func:`bandwidth_check`.

    Returns
    -------
    DesignChecks
        Arrays of the broadcast shape: ``l2_gain`` (s), ``l2_frequency`` (rad/s), ``names`` (the SPR
        classes), ``spr``, ``bandwidth`` (rad/s), ``stable``.

    Raises
    ------
    InputError
        For another loop or level, shapes that do not fit, values that are not finite or out of
        range, and a velocity loop with J + kd <= 0.

    Notes
    -----
    Designs for which the closed form is uncertain are checked one by one. All properties are those
    of the linear loop with friction compensated.

    Examples
    --------
    The least derivative gain of a PD position controller that makes T(s) SPR lies above
    sigma0 J/sigma1 = 0.953 N m s/rad:

    >>> checks = lg.check_designs(lg.table1(), 15.0, 0.0, [0.9, 1.0], K2=22.0, loop="position")
    >>> checks.spr.tolist()
    [False, True]
    """
    if not isinstance(loop, str) or loop not in ("velocity", "position"):
        raise InputError(f"loop must be 'velocity' or 'position', not {shown(loop)}.")
    p = values_of(p)
    given = [getattr(p, name, None) for name in NAMES[:3]] + [kp, ki, kd, K2]
    parts = [numbers(value, name) for value, name in zip(given, NAMES, strict=True)]
    for name, part in zip(NAMES, parts, strict=True):
        if not np.isfinite(part).all():
            raise InputError(f"{name} holds a value that is not a finite number.")
    try:
        shape = np.broadcast_shapes(*(part.shape for part in parts))
    except ValueError:
        shapes = ", ".join(f"{n} {a.shape}" for n, a in zip(NAMES, parts, strict=True) if a.ndim)
        raise InputError(f"The designs' arrays do not fit together: {shapes}.") from None
    J, sigma0, sigma1, _, _, kd, _ = parts
    for name, wrong in (
        ("J is not above 0", np.any(J <= 0)),
        ("sigma0 is not above 0", np.any(sigma0 <= 0)),
        ("sigma1 is below 0", np.any(sigma1 < 0)),
        ("J + kd is not above 0", loop == "velocity" and np.any(J + kd <= 0)),
    ):
        if wrong:
            raise InputError(f"{name} in a design; use the check of a single design for it.")
    flat = [a if a.size == 1 else np.broadcast_to(a, shape).ravel() for a in parts]
    size = int(np.prod(shape))
    out = DesignChecks(*(np.empty(size, kind) for kind in (float, float, np.int8, float, np.bool_)))
    for start in range(0, size, CHUNK):
        here = slice(start, min(start + CHUNK, size))
        _chunk([a.reshape(1) if a.size == 1 else a[here] for a in flat], here, loop, level, out)
    return DesignChecks(*(getattr(out, f).reshape(shape) for f in out.__dataclass_fields__))


def _chunk(parts: list[Any], here: slice, loop: str, level: str | float, out: DesignChecks) -> None:
    J, sigma0, sigma1, kp, ki, kd, K2 = parts
    out.l2_gain[here], out.l2_frequency[here] = l2_gain(J, sigma0, sigma1, K2)
    # a velocity loop is a position loop with its inertia in place of kd
    mass, damping = (J, kd) if loop == "position" else (0.0, J + kd)
    out.classification[here] = error_class(mass, sigma0, sigma1, kp, ki, damping)
    out.stable[here] = is_stable(mass, kp, ki, damping)
    with np.errstate(all="ignore"):
        out.bandwidth[here], doubt = bandwidths(mass, kp, ki, damping, float(level_power(level)))
    for i in np.nonzero(np.broadcast_to(doubt, out.bandwidth[here].shape))[0]:
        own, *gains = (float(a[i if a.size > 1 else 0]) for a in (J, kp, ki, kd))
        made = position_loop_tf if loop == "position" else velocity_loop_tf
        T = made(SimpleNamespace(J=own), *gains)
        out.bandwidth[here.start + i] = bandwidth_check(T, level).bandwidth


# --- closed forms of P, PI, PD and PID, elementwise: J > 0, sigma0 > 0, sigma1 >= 0 -----------
# Signs of differences of products decide the classes; they are exact for the given floats.


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


def error_class(J: Any, s0: Any, s1: Any, kp: Any, ki: Any, kd: Any) -> NDArray[np.int8]:
    """Class of (s1 s + s0)/(J s^2 + kd s + kp + ki/s); a = s1 kd - s0 J, b = s0 kp - s1 ki.

    ki = 0: P(x) = a x + s0 kp. SPR iff kp > 0, a > 0, or J = 0; WSPR iff kp > 0, a = 0; PR iff
    kp = 0, a >= 0. ki not 0: P(x) = x (a x + b); PR iff ki > 0, a >= 0, b >= 0, which implies
    kd kp >= J ki.
    """
    a, b = sign_of_difference(s1, kd, s0, J), sign_of_difference(s0, kp, s1, ki)
    strict = np.where((a > 0) | np.equal(J, 0), SPR, WSPR)
    bare = np.where(np.greater(kp, 0), strict, np.where(np.less(kp, 0), NOT_PR, PR))
    kind = np.where(np.equal(ki, 0), bare, np.greater(ki, 0) & (b >= 0))
    return np.where(a >= 0, kind, NOT_PR).astype(np.int8)


def is_stable(J: Any, kp: Any, ki: Any, kd: Any) -> NDArray[np.bool_]:
    """J s^3 + kd s^2 + kp s + ki Hurwitz, J s^2 + kd s + kp with ki = 0."""
    routh = sign_of_difference(kd, kp, J, ki) > 0
    return np.greater(kd, 0) & np.greater(kp, 0) & np.greater_equal(ki, 0) & routh


def positive_root(a: Any, half: Any, last: Any) -> Floats:
    """The positive root of a x^2 + 2 half x - last, a > 0, last >= 0, without cancellation."""
    root = np.sqrt(half * half + a * last)
    return np.where(half > 0, last / (half + root), (root - half) / a)


def bandwidths(J: Any, kp: Any, ki: Any, kd: Any, c: float) -> tuple[Floats, Any]:
    """First w with |T(jw)|^2 = c |T(0)|^2, T = (kp s + ki)/(J s^3 + kd s^2 + kp s + ki).

    With x = w^2 the least positive root of J^2 x^3 + a x^2 + b x + r, where a = kd^2 - 2 J kp,
    b = -((1 - c) kp^2/c + 2 ki kd), r = -(1 - c) ki^2/c; without J the only one. Else the
    only one unless a < 0 < b, by Cardano's formula, or the quadratic that remains for x far below
    a/J^2, and two Newton steps. Also returns which answers are uncertain, such as those where the
    level is almost touched. T(0) = 0 is nan, and certain.
    """
    rest, none = (1 - c) / c, np.equal(kp, 0) & np.equal(ki, 0)
    a = np.multiply(kd, kd) - 2 * np.multiply(J, kp)
    b = -(rest * np.multiply(kp, kp) + 2 * np.multiply(ki, kd))
    r = -rest * np.multiply(ki, ki)
    if not np.any(J):
        x = positive_root(a, b / 2, -r)
        good = np.isfinite(x) & (x > 0)
    else:
        inertia = 1 / np.multiply(J, J)
        p, q, r = np.broadcast_arrays(a * inertia, b * inertia, r * inertia)
        start, doubt = _least_positive(p, q, r)
        x = start
        for _ in range(2):
            step = (((x + p) * x + q) * x + r) / ((3 * x + 2 * p) * x + q)
            x = x - step
        good = (np.abs(step) < SETTLED * x) & (np.abs(x - start) < 1e-3 * x) & ~doubt
    return np.where(none, np.nan, np.sqrt(x)), ~good & ~none


def _least_positive(p: Any, q: Any, r: Any) -> tuple[Floats, Any]:
    """Approximate least positive root of x^3 + p x^2 + q x + r, r <= 0; whether uncertain."""
    third = p / 3
    P, Q = q / 3 - third * third, third * (third * third - q / 2) + r / 2
    P3, Q2 = P * P * P, Q * Q
    disc = P3 + Q2
    u = np.cbrt(-Q - np.copysign(np.sqrt(np.maximum(disc, 0)), Q))
    x = u - P / u - third
    three, several = disc < 0, (p < 0) & (q > 0)
    if np.any(three):  # the largest, or the least where there are several
        size = np.sqrt(-P[three])
        angle = np.arccos(np.clip(-Q[three] / size**3, -1, 1)) / 3
        turn = np.where(several[three], angle + 2 * np.pi / 3, angle)
        x[three] = 2 * size * np.cos(turn) - third[three]
    without_cube = positive_root(p, q / 2, -r)
    x = np.where((p > 0) & (p > 1e4 * without_cube), without_cube, x)
    return x, several & (np.abs(disc) < 1e-9 * (np.abs(P3) + Q2))
