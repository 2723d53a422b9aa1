"""A transfer function that was made of a state-space form, without what rounding left in it."""

from __future__ import annotations

from typing import Any

import control as ct
import numpy as np

from .pencil import EPS

SAID = (
    "; a coefficient of L that only rounding keeps from 0 (a pole at s = 0, or none beside the "
    "highest power) was taken for 0"
)


def cleared(L: Any) -> tuple[Any, str]:
    """L, and a remark where it changed.

    det(sI - A + BC) - det(sI - A) leaves leading coefficients of the numerator that are eps times
    those of the denominator, and a pole at s = 0 becomes one of eps times the largest pole.
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
    if len(den) > 1 and den[-2] and abs(den[-1]) <= EPS * abs(den[-2]) * _largest(den):
        bottom[-1] = 0.0
    if (top == num).all() and (bottom == den).all():
        return L, ""
    return ct.tf(top, bottom, L.dt), SAID


def _largest(den: np.ndarray) -> float:
    """The size of the largest root."""
    return float(np.abs(np.roots(den / den[0])).max())
