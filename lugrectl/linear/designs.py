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
STEPS = 16
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
    J, sigma0, sigma1, kp, ki, kd, K2 = (np.broadcast_to(part, shape).ravel() for part in parts)
    # a velocity loop is a position loop with its inertia in place of kd
    mass, damping = (J, kd) if loop == "position" else (0.0 * J, J + kd)
    with np.errstate(all="ignore"):
        width, doubt = bandwidths(mass, kp, ki, damping, float(level_power(level)))
    made = position_loop_tf if loop == "position" else velocity_loop_tf
    for i in np.flatnonzero(doubt):
        T = made(SimpleNamespace(J=float(J[i])), *(float(a[i]) for a in (kp, ki, kd)))
        width[i] = bandwidth_check(T, level).bandwidth
    kinds = error_class(mass, sigma0, sigma1, kp, ki, damping)
    stable = is_stable(mass, kp, ki, damping)
    found: Any = (*l2_gain(J, sigma0, sigma1, K2), kinds, width, stable)
    return DesignChecks(*(each.reshape(shape) for each in found))


# --- closed forms of P, PI, PD and PID, elementwise: J > 0, sigma0 > 0, sigma1 >= 0 -----------
# Signs of differences of products decide the classes; they are exact for the given floats.


def sign_of_difference(a: Any, b: Any, c: Any, d: Any) -> NDArray[np.int8]:
    """Sign of a b - c d. Rounding is monotone: only products that round alike are uncertain."""
    left, right = a * b, c * d
    sign = np.sign(left - right).astype(np.int8)
    for i in np.flatnonzero((left == right) & (((a != 0) & (b != 0)) | ((c != 0) & (d != 0)))):
        w, x, y, z = (Fraction(float(part[i])) for part in (a, b, c, d))
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


def bandwidths(J: Any, kp: Any, ki: Any, kd: Any, c: float) -> tuple[Floats, Any]:
    """First w with |T(jw)|^2 = c |T(0)|^2, T = (kp s + ki)/(J s^3 + kd s^2 + kp s + ki).

    With x = w^2 the least positive root of J^2 x^3 + a x^2 + b x + r, where a = kd^2 - 2 J kp,
    b = -((1 - c) kp^2/c + 2 ki kd), r = -(1 - c) ki^2/c: the only one unless a < 0 < b, to which
    Newton steps fall from any larger x. Also returns which answers are uncertain. T(0) = 0 is nan,
    and certain.
    """
    rest, none = (1 - c) / c, (kp == 0) & (ki == 0)
    a, b, r = kd * kd - 2 * J * kp, -(rest * kp * kp + 2 * ki * kd), -rest * ki * ki
    root = np.sqrt(
        b * b / 4 - a * r
    )  # of the polynomial without its cube, with a > 0 above the root
    without_cube = np.where(b < 0, (root - b / 2) / a, -r / (b / 2 + root))
    p, q, s = a / J**2, b / J**2, r / J**2
    bound = 2 * np.fmax(np.fmax(-p, np.sqrt(np.fmax(-q, 0.0))), np.cbrt(-s))  # Fujiwara's
    x = start = np.where(a > 0, without_cube, bound)
    step = np.zeros_like(x)
    for _ in range(STEPS):
        step = (((J * J * x + a) * x + b) * x + r) / ((3 * J * J * x + 2 * a) * x + b)
        x = x - step
        if (np.abs(step) <= SETTLED * x).all():
            break
    good = (np.abs(step) < SETTLED * x) & (x <= start * (1 + SETTLED)) & ~((a < 0) & (b > 0))
    return np.where(none, np.nan, np.sqrt(x)), ~good & ~none
