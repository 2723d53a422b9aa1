"""Reading a transfer function as exact polynomials."""

from __future__ import annotations

import math
from decimal import Decimal
from fractions import Fraction
from numbers import Rational
from types import SimpleNamespace
from typing import Any

import control as ct
import numpy as np

from ..core.errors import InputError
from ..core.validation import shown
from .exact import Poly, divide, gcd, poly

EPS = 8 * np.finfo(float).eps  # of the norm of A: rounding that turning the coordinates leaves
ROUNDED = (
    "; a coefficient of L that only rounding keeps from 0 (a pole at s = 0, or none beside the "
    "highest power) was taken for 0"
)
FREQUENT = 2  # least number of frequencies of a measured response
TINY = 1e-9  # a root this near to the axis, relative to its size, is shown as not stable


def roots(p: Poly) -> tuple[complex, ...]:
    """The roots of a polynomial in 1/s, rightmost first, as floats."""
    monic = [to_float(Fraction(c) / p[-1]) for c in reversed(p)]
    if not np.all(np.isfinite(monic)):
        raise InputError("The coefficients of T(s) differ by more than 1e308; rescale time.")
    return tuple(sorted(map(complex, np.roots(monic)), key=lambda s: (-s.real, s.imag)))


def number(value: Any, what: str) -> Fraction:
    """The exact value of a finite real number; InputError for anything else."""
    try:
        if isinstance(value, str):
            raise TypeError
        float(value)  # beyond what a float holds it is none
        if isinstance(value, Rational):  # numpy integers keep a fixed width inside a Fraction
            return Fraction(int(value.numerator), int(value.denominator))
        return Fraction(value if isinstance(value, Decimal) else float(value))
    except (TypeError, ValueError, OverflowError):
        said = f"{what} is {shown(value)}, but a finite real number is needed."
        raise InputError(said) from None


def not_negative(value: Any, name: str, kind: str = "dead time", unit: str = "s") -> Fraction:
    """The exact value, 0 for None."""
    exact = number(0 if value is None else value, name)
    if exact < 0:
        raise InputError(f"{name} is {float(exact):g} {unit}, but a {kind} cannot be negative.")
    return exact


def to_float(value: Fraction) -> float:
    try:
        return float(value)
    except OverflowError:
        return math.inf if value > 0 else -math.inf


def parameter(p: Any, name: str) -> Fraction:
    if not hasattr(p, name):
        what = "the model" if isinstance(p, SimpleNamespace) else shown(p)
        raise InputError(f"{what} has no {name}: give Parameters, a Model or a model file.")
    return number(getattr(p, name), f"parameter {name}")


def read_transfer(T: Any, name: str = "T") -> tuple[Poly, Poly]:
    """Numerator and denominator in lowest terms; InputError, which calls it ``name``, for anything
    else than a continuous system of one input and one output, or a pair (num, den)."""
    if isinstance(T, ct.TransferFunction | ct.StateSpace):
        require_continuous_siso(T, name)
    return lowest_terms(*coefficients(T, name))


def coefficients(T: Any, name: str = "T") -> tuple[Poly, Poly]:
    """Numerator and denominator as they are given, in s or, of a sampled T, in z."""
    if isinstance(T, ct.TransferFunction):
        T = T.num[0][0], T.den[0][0]
    if isinstance(T, ct.StateSpace):
        tops, den = state_space_polynomials(T)
        num = tops[0][0]
    elif isinstance(T, tuple | list) and len(T) == 2:
        num, den = _descending(T[0], "numerator", name), _descending(T[1], "denominator", name)
    else:
        raise InputError(
            f"{name} is {shown(T)}, but a control.TransferFunction, a control.StateSpace "
            "or a pair (num, den) is needed; lg.linearize makes one of a nonlinear system."
        )
    if not den:
        raise InputError(f"The denominator of {name}(s) is zero.")
    return num, den


def lowest_terms(num: Poly, den: Poly) -> tuple[Poly, Poly]:
    common = gcd(num, den)
    return divide(num, common)[0], divide(den, common)[0]


def require_siso(T: Any, name: str) -> None:
    if (T.ninputs, T.noutputs) != (1, 1):
        raise InputError(
            f"{name} has {T.ninputs} inputs and {T.noutputs} outputs, but the check is for one of "
            f"each; pick one channel, such as {name}[0, 0]."
        )


def require_continuous_siso(T: Any, name: str) -> None:
    require_siso(T, name)
    if T.isdtime(strict=True):
        raise InputError(
            f"{name} is discrete-time (dt = {T.dt}), but the check is for continuous time; "
            f"give {name}(s) itself."
        )


def _descending(coefficients: Any, what: str, name: str) -> Poly:
    items = np.atleast_1d(np.asarray(coefficients, dtype=object))
    if items.ndim > 1:
        raise InputError(
            f"The {what} of {name} has {items.ndim} dimensions; give one row of numbers."
        )
    return poly([number(c, f"a coefficient of the {what}") for c in items][::-1])


def state_space_polynomials(T: Any) -> tuple[list[list[Poly]], Poly]:
    """C adj(sI - A) B + D det(sI - A), by output and input, and det(sI - A), by Faddeev and
    LeVerrier."""
    A, B, C, D = (_exact_matrix(M) for M in (T.A, T.B, T.C, T.D))
    eye = _exact_matrix(np.eye(T.nstates))
    M = eye
    nums, den = [_exact_matrix(np.zeros(D.shape))], [Fraction(1)]
    for k in range(1, T.nstates + 1):
        nums.append(C @ M @ B)
        AM = A @ M
        den.append(-sum(np.diagonal(AM), Fraction(0)) / k)
        M = AM + den[-1] * eye
    tops = [
        [poly([n[i, j] + D[i, j] * d for n, d in zip(nums, den, strict=True)][::-1]) for j in row]
        for i, row in enumerate([range(T.ninputs)] * T.noutputs)
    ]
    return tops, poly(den[::-1])


def _exact_matrix(M: Any) -> np.ndarray:
    rows = np.asarray(M, dtype=object)
    values = [number(x, "an entry of the state-space matrices") for x in rows.ravel()]
    return np.array(values, dtype=object).reshape(rows.shape)


def is_measured(T: Any) -> bool:
    return isinstance(T, ct.FrequencyResponseData)


def response(T: Any, name: str = "T") -> tuple[np.ndarray, np.ndarray]:
    """Frequencies w >= 0 in rad/s, ascending, and T(jw) there."""
    require_siso(T, name)
    w, values = np.asarray(T.omega, dtype=float), np.asarray(T.frdata, dtype=complex)[0, 0]
    if len(w) < FREQUENT:
        raise InputError(f"{name} has {len(w)} frequencies; at least {FREQUENT} are needed.")
    if not (np.isfinite(w).all() and np.isfinite(values).all() and (w >= 0).all()):
        raise InputError(f"{name}: the frequencies and values of the response must be finite.")
    order = np.argsort(w, kind="stable")
    if not np.diff(w[order]).all():
        raise InputError(f"{name} has two values at one frequency; give each frequency once.")
    return w[order], values[order]


def crossings(line: np.ndarray, level: float = 0.0) -> list[tuple[int, float]]:
    """Where straight lines go through a level: the point before and the part of the way."""
    above = line >= level
    at = np.flatnonzero(above[1:] != above[:-1])
    return [(int(k), float((level - line[k]) / (line[k + 1] - line[k]))) for k in at]


def along(w: np.ndarray, k: int, part: float) -> float:
    """The frequency a part of the way from point k to the next, over log w (over w from w = 0)."""
    low, high = float(w[k]), float(w[k + 1])
    return low * (high / low) ** part if low > 0 else low + part * (high - low)


def span(w: np.ndarray) -> str:
    return f"the {len(w)} measured frequencies from {w[0]:.6g} to {w[-1]:.6g} rad/s"


def cleared(L: Any) -> tuple[Any, str]:
    """L, and a remark where it changed: det(sI - A + BC) - det(sI - A) leaves leading coefficients
    that are eps times those of the denominator, and a pole at s = 0 one of eps times the largest.
    """
    if not isinstance(L, ct.TransferFunction) or (L.ninputs, L.noutputs) != (1, 1) or L.dt:
        return L, ""
    try:
        num, den = (np.array(p[0][0], dtype=float) for p in (L.num, L.den))
    except (TypeError, ValueError, OverflowError):
        return L, ""
    if not (np.isfinite(num).all() and np.isfinite(den).all() and np.any(num) and np.any(den)):
        return L, ""
    num, den = np.trim_zeros(num, "f"), np.trim_zeros(den, "f")
    top, bottom = num.copy(), den.copy()
    for k in range(min(len(num), len(den)) if len(num) <= len(den) else 0):
        rest = np.abs(num[k + 1 :]) > EPS * np.abs(den[len(den) - len(num) + k + 1 :])
        if abs(num[k]) > EPS * abs(den[len(den) - len(num) + k]) or not rest.any():
            break
        top[k] = 0.0
    if (
        len(den) > 1
        and den[-2]
        and abs(den[-1]) <= EPS * abs(den[-2]) * np.abs(np.roots(den / den[0])).max()
    ):
        bottom[-1] = 0.0
    if (top == num).all() and (bottom == den).all():
        return L, ""
    return ct.tf(top, bottom, L.dt), ROUNDED
