"""Weighted means over windows, with the derivative on the weight.

The weight phi(t) is a bump of area 1 and half-width L, (1 - (t/L)^2)^4. By parts,

    integral phi x' dt = -integral phi' x dt,    integral phi x'' dt = integral phi'' x dt,

so that no signal is ever differentiated.
"""

from __future__ import annotations

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.polynomial import Polynomial

from .constants import DENSE

_BUMP = (1 - Polynomial([0, 0, 1])) ** 4
BUMP = _BUMP / (_BUMP.integ()(1) - _BUMP.integ()(-1))
_AREA = BUMP.integ()
IN_CACHE = 32_000  # samples of windows that are weighted at a time
FACTORIAL = (1.0, 1.0, 2.0)


def weights(half_width: float, order: int, shift: float = 0.0, cell: bool = False) -> np.ndarray:
    """Weights k_j with sum k_j x_j = integral of phi x^(order), in samples.

    Exact for polynomials up to degree order + 1.

    Parameters
    ----------
    half_width : float
        Half-width L of the bump, in samples.
    order : int
        Derivative of x, 0 to 2.
    shift : float
        The bump's centre, in samples after the middle of the weights.
    cell : bool
        For a signal that is held over one sample around its centre: phi is averaged over it.
    """
    half = int(np.ceil(half_width + abs(shift))) + cell
    at = np.arange(-half, half + 1) - shift
    s = np.clip(at / half_width, -1, 1)
    k = _averaged(at, half_width, order) if cell else _derivative(s, half_width, order)
    powers = np.vander(at / half_width, order + 2, increasing=True)
    basis, want = powers * BUMP(s)[:, None], np.zeros(order + 2)
    want[order] = FACTORIAL[order] / half_width**order
    return k + basis @ np.linalg.solve(powers.T @ basis, want - powers.T @ k)


def _derivative(s: np.ndarray, half_width: float, order: int) -> np.ndarray:
    """(-1)^order phi^(order), per sample."""
    bump = BUMP.deriv(order) if order else BUMP
    return bump(s) * (-1) ** order / half_width ** (order + 1)


def _averaged(at: np.ndarray, half_width: float, order: int) -> np.ndarray:
    """The same, averaged over one sample."""
    whole = (BUMP.deriv(order - 1) if order > 1 else BUMP) if order else _AREA
    high, low = (np.clip((at + x) / half_width, -1, 1) for x in (0.5, -0.5))
    return (whole(high) - whole(low)) * (-1) ** order / half_width**order


def means(x: np.ndarray, k: np.ndarray, at: np.ndarray) -> np.ndarray:
    """The weighted means of x with the weights k around the samples ``at``."""
    if len(at) * DENSE > len(x):
        from scipy.signal import oaconvolve  # slow to import

        middle = x[len(x) // 2]  # which keeps rounding small for a large offset
        return oaconvolve(x - middle, k[::-1], "same")[at] + middle * k.sum()
    windows, first = sliding_window_view(x, len(k)), at - len(k) // 2
    size = max(IN_CACHE // len(k), 1)  # a copy of all windows at once would not stay in the cache
    parts = [windows[first[i : i + size]] @ k for i in range(0, len(first), size)]
    return np.concatenate(parts) if parts else np.zeros(0)


def wholly(ok: np.ndarray, reach: int, at: np.ndarray) -> np.ndarray:
    """Which of the samples ``at`` have no bad sample within ``reach``."""
    bad = np.append(0, np.cumsum(~ok))
    return bad[np.minimum(at + reach + 1, len(ok))] == bad[np.maximum(at - reach, 0)]
