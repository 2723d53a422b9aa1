"""The error system of the proposed observer, and the drive parameters that it depends on.

With a = sigma0 |w|/h(w) >= 0 the errors e_z = z - zhat, e_w = w - what follow

    d/dt (e_z, e_w) = (M0 + a M1) (e_z, e_w)

(eq. err_z_dot_new, err_w_dot_new). The torque u cancels; the observer's parameters and J must
be those of the drive, and d = 0.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from ..blocks.model import values_of
from ..core.errors import InputError
from ..core.validation import number

NAMES = ("J", "sigma0", "sigma1", "Fc", "Fs", "vs")


class Drive(NamedTuple):
    """The parameters that the error system depends on, checked."""

    J: float
    sigma0: float
    sigma1: float
    Fc: float
    Fs: float
    vs: float

    @property
    def low(self) -> float:
        """C1 = min(Fc, Fs), the smallest h(w), in N m (eq. proof1_eq)."""
        return min(self.Fc, self.Fs)

    @property
    def high(self) -> float:
        """C2 = max(Fc, Fs), the largest h(w), in N m (eq. proof1_eq)."""
        return max(self.Fc, self.Fs)


def drive(p: Any) -> Drive:
    """The checked parameters of a ``Parameters`` or a ``Model`` with LuGre friction.

    Raises
    ------
    InputError
        When one is missing, not a finite number, or not positive (sigma1 may be 0).
    """
    p = values_of(p)
    have = {k: getattr(p, k, None) for k in NAMES}
    missing = [k for k in NAMES if have.get(k) is None]
    if missing:
        raise InputError(f"the observer's gains need {', '.join(missing)}: give a LuGre model.")
    found = {k: number(have[k], k) for k in NAMES}
    for k, value in found.items():
        if value < 0.0 or (value == 0.0 and k != "sigma1"):
            raise InputError(f"{k} = {value:g}: the observer's error system needs {k} > 0.")
    return Drive(**found)


def bristle_errors(m: Any, slope: float = 0.0, Fv: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Build M0 and M1 for a copy of the bristles that nothing corrects.

    ``slope`` is that of dz/dt over e_w where the copy does not know w, and ``Fv`` the viscous
    friction that it then gets wrong; both are 0 for one that reads w.
    """
    at_rest = [[0.0, slope], [-m.sigma0 / m.J, -(m.sigma1 * slope + Fv) / m.J]]
    return np.array(at_rest), np.array([[-1.0, 0.0], [m.sigma1 / m.J, 0.0]])


def error_matrices(p: Any, K1: float, K2: float) -> tuple[np.ndarray, np.ndarray]:
    """M0 and M1 of d/dt (e_z, e_w) = (M0 + a M1)(e_z, e_w), a = sigma0 |w|/h(w) in 1/s.

    Parameters
    ----------
    p : Parameters or Model
        With LuGre friction.
    K1 : float
        Without unit.
    K2 : float
        In N m s/rad.

    Notes
    -----
    Source paper, eq. err_z_dot_new and err_w_dot_new, K3 = (K2 - sigma1 K1)/J.
    """
    m = drive(p)
    K3 = (K2 - m.sigma1 * K1) / m.J
    at_rest, sliding = bristle_errors(m)
    return at_rest - [[0.0, K1], [0.0, K3]], sliding


def slowest_pole(p: Any, K1: float, K2: float) -> float:
    """Largest real part in 1/s of the error system's poles at w = 0.

    Roots of s^2 + K3 s - K1 sigma0/J. No rate that holds for every w(t) can be faster than this.
    """
    m = drive(p)
    half = (K2 - m.sigma1 * K1) / m.J / 2.0
    product = -K1 * m.sigma0 / m.J
    root = half * half - product
    if root < 0.0 or half <= 0.0:
        return -half + math.sqrt(max(root, 0.0))
    return -product / (half + math.sqrt(root))
