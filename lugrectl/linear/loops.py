"""Transfer functions of the friction-compensated loops, coefficients rounded once."""

from __future__ import annotations

from typing import Any

import control as ct

from lugrectl.errors import InputError

from .exact import Poly, add, mul, poly, scale
from .transfer import number, parameter


def position_T(
    p: Any, kp: float = 0, ki: float = 0, kd: float = 0, tau: float | None = None
) -> ct.TransferFunction:
    """T(s) = (sigma1 s + sigma0)/(J s^2 + C(s)), the SPR condition of the existing observer.

    C(s) = Kp + Kd s + Ki/(tau s + 1), tau a time constant in s; Ki/s when tau is None or 0.
    C acts on the position error (Canudas de Wit et al., 1995).
    Raises InputError for values that are not finite, tau < 0, and a zero denominator.
    """
    return _error_T(p, 2, _Controller(kp, ki, kd, tau))


def velocity_T(
    p: Any, kp: float = 0, ki: float = 0, kd: float = 0, tau: float | None = None
) -> ct.TransferFunction:
    """T(s) = (sigma1 s + sigma0)/(J s + C(s)): C as in ``position_T``, on the velocity error."""
    return _error_T(p, 1, _Controller(kp, ki, kd, tau))


def position_loop_tf(
    p: Any,
    kp: float = 0,
    ki: float = 0,
    kd: float = 0,
    tau: float | None = None,
    prefilter: bool = False,
) -> ct.TransferFunction:
    """Reference to position with friction fully compensated (plant 1/(J s^2)).

    theta/r = (Kp + I(s))/(J s^2 + Kd s + Kp + I(s)), I(s) = Ki/(tau s + 1), or Ki/s when tau is
    None or 0. D acts on the measured velocity, not on the error, so Kd s is missing in the
    numerator. ``prefilter`` puts 2/(s + 2) in front. Friction left uncompensated (Fv) is not
    in here. Raises InputError as ``position_T``.
    """
    return _reference_tf(p, 2, _Controller(kp, ki, kd, tau), prefilter, "theta")


def velocity_loop_tf(
    p: Any,
    kp: float = 0,
    ki: float = 0,
    kd: float = 0,
    tau: float | None = None,
    prefilter: bool = False,
) -> ct.TransferFunction:
    """Reference to velocity with friction fully compensated (plant 1/(J s)).

    w/r = (Kp + I(s))/((J + Kd) s + Kp + I(s)), I(s) and ``prefilter`` as in
    ``position_loop_tf``: Kd multiplies the measured acceleration, like an added inertia.
    """
    return _reference_tf(p, 1, _Controller(kp, ki, kd, tau), prefilter, "w")


class _Controller:
    """Exact polynomials of C(s): the integral's denominator, all of C, the part without D."""

    def __init__(self, kp: float, ki: float, kd: float, tau: float | None) -> None:
        p_gain, i_gain, d_gain = number(kp, "kp"), number(ki, "ki"), number(kd, "kd")
        lag = number(0 if tau is None else tau, "tau")
        if lag < 0:
            raise InputError(f"tau is {float(lag):g} s, but a time constant cannot be negative.")
        # Without integral action no factor s enters numerator and denominator alike.
        self.den: Poly = (1,) if not i_gain else (1, lag) if lag else (0, 1)
        self.without_d = add(scale(self.den, p_gain), poly([i_gain]))
        self.whole = add(self.without_d, mul(self.den, poly([0, d_gain])))


def _closed_den(p: Any, order: int, C: _Controller) -> Poly:
    inertia = poly([0] * order + [parameter(p, "J")])
    return add(mul(inertia, C.den), C.whole)


def _error_T(p: Any, order: int, C: _Controller) -> ct.TransferFunction:
    bristle = poly([parameter(p, "sigma0"), parameter(p, "sigma1")])
    return _tf(mul(bristle, C.den), _closed_den(p, order, C))


def _reference_tf(
    p: Any, order: int, C: _Controller, prefilter: bool, output: str
) -> ct.TransferFunction:
    num, den = C.without_d, _closed_den(p, order, C)
    if prefilter:
        num, den = scale(num, 2), mul(den, (2, 1))
    return _tf(num, den, inputs="r", outputs=output)


def _tf(num: Poly, den: Poly, **names: str) -> ct.TransferFunction:
    if not den:
        raise InputError("J and all gains are 0: the loop has no denominator; give one of them.")
    top, bottom = ([float(c) for c in reversed(p or (0,))] for p in (num, den))
    return ct.TransferFunction(top, bottom, **names)
