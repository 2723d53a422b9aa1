"""Transfer functions of the friction-compensated loops: exact, their coefficients rounded once."""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from functools import wraps
from typing import Any, ParamSpec

import control as ct

from ..blocks.model import values_of
from ..core.errors import InputError
from .delayed import DelayedTransfer, reduced
from .exact import Poly, Quasi, add, divide, gcd, mul, poly, scale
from .transfer import not_negative, number, parameter, read_transfer, to_float

Ratio = tuple[Poly, Poly]
Taken = ParamSpec("Taken")


@dataclass(frozen=True)
class Controller:
    """C(s) = Kp + Kd s/(Td s + 1) + I(s) + X(s), every number exact.

    I(s) is Ki/(tau s + 1) if tau > 0, Ki/(s + leak) if leak > 0, else Ki/s. Td is
    ``derivative_filter``; X is ``added``, any further term of C in lowest terms.
    """

    kp: Fraction
    ki: Fraction
    kd: Fraction
    tau: Fraction
    derivative_filter: Fraction
    leak: Fraction
    added: Ratio = ((), (1,))

    @property
    def integral(self) -> Ratio:
        """I(s); without integral action 0/1, so that no common factor s appears."""
        if not self.ki:
            return (), (1,)
        return poly([self.ki]), (1, self.tau) if self.tau else (self.leak, 1)

    @property
    def derivative(self) -> Ratio:
        """Kd s/(Td s + 1)."""
        if not self.kd:
            return (), (1,)
        return (0, self.kd), poly([1, self.derivative_filter])

    @property
    def on_error(self) -> Ratio:
        """C(s) without the derivative action."""
        (num, den), (more, below) = self.integral, self.added
        if more:  # over the least common denominator, so that no shared pole is counted twice
            shared = gcd(den, below)
            left, right = divide(den, shared)[0], divide(below, shared)[0]
            num, den = add(mul(num, right), mul(more, left)), mul(den, right)
        return add(num, scale(den, self.kp)), den

    @property
    def pure_integral(self) -> bool:
        return bool(self.ki) and not self.tau and not self.leak

    def parts(self, J: Fraction, order: int) -> Ratio:
        """J s^order and C(s), each times the denominators in C."""
        (error_num, error_den), (rate_num, rate_den) = self.on_error, self.derivative
        inertia = mul(poly([0] * order + [J]), mul(error_den, rate_den))
        return inertia, add(mul(error_num, rate_den), mul(rate_num, error_den))


@dataclass(frozen=True)
class Loop:
    """The parts of a T(s): J, sigma0, sigma1, C, and order (1: velocity, 2: position)."""

    J: Fraction
    sigma0: Fraction
    sigma1: Fraction
    order: int
    controller: Controller

    def T(self) -> Ratio:
        """(sigma1 s + sigma0)/(J s^order + C(s)), exactly."""
        C = self.controller
        num = mul(poly([self.sigma0, self.sigma1]), mul(C.on_error[1], C.derivative[1]))
        return num, add(*C.parts(self.J, self.order))


class LoopT(ct.TransferFunction):
    """T(s) with its ``loop``, so that ``spr_check`` can propose a repair.

    Anything computed from it is a plain control.TransferFunction.
    """

    loop: Loop


def _gains(
    p: Any,
    kp: float = 0,
    ki: float = 0,
    kd: float = 0,
    tau: float | None = None,
    *,
    derivative_filter: float | None = None,
    leak: float | None = None,
    controller: Any = None,
    dead_time: float = 0.0,
) -> dict[str, Any]:
    """Read the arguments of a loop: the drive, C(s) and the dead time."""
    gains = (number(kp, "kp"), number(ki, "ki"), number(kd, "kd"))
    lag = not_negative(tau, "tau", "time constant")
    smoothing = not_negative(derivative_filter, "derivative_filter", "time constant")
    rate = not_negative(leak, "leak", "leak rate", "1/s")
    if lag and rate:
        raise InputError(
            "tau and leak are both given, but the integral action is Ki/(tau s + 1) or "
            "Ki/(s + leak); give one of them."
        )
    added = ((), (1,)) if controller is None else read_transfer(controller, "C")
    C = Controller(*gains, lag, smoothing, rate, added)
    return {"p": values_of(p), "C": C, "dead_time": not_negative(dead_time, "dead_time")}


def _gains_and_prefilter(
    p: Any,
    kp: float = 0,
    ki: float = 0,
    kd: float = 0,
    tau: float | None = None,
    prefilter: bool | float = False,
    *,
    derivative_filter: float | None = None,
    leak: float | None = None,
    controller: Any = None,
    dead_time: float = 0.0,
) -> dict[str, Any]:
    """Read the same with a prefilter."""
    more = {"derivative_filter": derivative_filter, "leak": leak, "controller": controller}
    read = _gains(p, kp, ki, kd, tau, **more, dead_time=dead_time)
    return {**read, "prefilter": prefilter}


def _taking(read: Callable[Taken, dict[str, Any]]) -> Callable[..., Callable[Taken, Any]]:
    """Give a loop the arguments of ``read``, which reads them."""

    def decorate(make: Callable[..., Any]) -> Callable[Taken, Any]:
        signature = inspect.signature(read).replace(return_annotation="Any")

        @wraps(make)
        def loop(*args: Taken.args, **kwargs: Taken.kwargs) -> Any:
            try:
                signature.bind(*args, **kwargs)
            except TypeError as error:
                raise TypeError(f"{make.__name__}() {error}") from None
            return make(**read(*args, **kwargs))

        loop.__signature__ = signature  # type: ignore
        return loop

    return decorate


@_taking(_gains)
def position_T(p: Any, C: Controller, dead_time: Fraction) -> Any:
    """T(s) = (sigma1 s + sigma0)/(J s^2 + C(s)), the SPR condition of the existing observer.

    C(s) = Kp + Kd s/(Td s + 1) + I(s) + X(s) acts on the position error (Canudas de Wit et al.,
    1995). Viscous friction that is not compensated adds to Kd.

    Parameters
    ----------
    p : Parameters, Model or any object with attributes J, sigma0, sigma1
        In kg m2, N m/rad, N m s/rad.
    kp, ki, kd : float
        Gains in N m/rad, N m/(rad s) (with tau: N m/rad), N m s/rad.
    tau : float, optional
        Time constant in s of a filtered integral, I(s) = Ki/(tau s + 1); 0 is none.
    derivative_filter : float, optional
        Time constant Td in s; None or 0 is the pure Kd s.
    leak : float, optional
        Rate in 1/s of a leaky integral, I(s) = Ki/(s + leak). With neither tau nor leak, I = Ki/s.
    controller : control.TransferFunction, optional
        X(s), any continuous transfer function with one input and one output as for
        :func:`spr_check`, taken in lowest terms and added to the other terms.
    dead_time : float
        Dead time h of the torque in s, exact: T(s) = (sigma1 s + sigma0)/(J s^2 + C(s) exp(-s h)).

    Returns
    -------
    control.TransferFunction, or with a dead time DelayedTransfer
        The position error of the existing observer's loop is -T(s) (z - zhat). It remembers its
        loop, for :func:`spr_repair`.

    Raises
    ------
    InputError
        For values that are not finite, a negative time constant or leak, tau and leak together,
        and a zero denominator.

    Notes
    -----
    T(s) is that of the source paper, section 3.1. Derived here: with PD control it is SPR exactly
    if Kp > 0 and sigma1 Kd > sigma0 J.

    With a dead time the observer's torque is late too: the error is -T(s) (z(t) - zhat(t - h)), so
    that the paper's proof, which needs z - zhat, does not carry over as it stands. Nor is T ever
    positive real: as w grows, w^2 Re T is (sigma1 Kd cos(w h) - sigma0 J)/J^2, below 0 again and
    again. In a velocity loop without Kd, Re T tends to sigma1/J, and T may be SPR.

    Examples
    --------
    A PD controller, with and without integral action:

    >>> p = lg.table1()
    >>> bool(lg.spr_check(lg.position_T(p, kp=15.0, kd=1.2)))
    True
    >>> bool(lg.spr_check(lg.position_T(p, kp=15.0, ki=30.0, kd=1.2)))
    False
    """
    return _error_T(p, 2, C, dead_time)


@_taking(_gains)
def velocity_T(p: Any, C: Controller, dead_time: Fraction) -> Any:
    """T(s) = (sigma1 s + sigma0)/(J s + C(s)): C as in ``position_T``, on the velocity error.

    Parameters
    ----------
    p : Parameters, Model or any object with attributes J, sigma0, sigma1
        In kg m2, N m/rad, N m s/rad.
    kp, ki, kd : float
        Gains in N m s/rad, N m/rad (with tau: N m s/rad), N m s2/rad.
    tau, derivative_filter, leak, controller, dead_time
        As in :func:`position_T`.

    Returns
    -------
    control.TransferFunction, or with a dead time DelayedTransfer
        The velocity error of the existing observer's loop is -T(s) (z - zhat). It remembers its
        loop, for :func:`spr_repair`.

    Raises
    ------
    InputError
        As :func:`position_T`.

    Examples
    --------
    A P controller is SPR; a PI is only positive real:

    >>> p = lg.table1()
    >>> [lg.spr_check(lg.velocity_T(p, kp=1.6, ki=ki)).classification for ki in (0.0, 0.16)]
    ['SPR', 'PR']
    """
    return _error_T(p, 1, C, dead_time)


@_taking(_gains_and_prefilter)
def position_loop_tf(p: Any, C: Controller, dead_time: Fraction, prefilter: bool | float) -> Any:
    """Reference to position with friction fully compensated (plant 1/(J s^2)).

    theta/r = E(s)/(J s^2 + D(s) + E(s)) with E(s) = Kp + I(s) + X(s), D(s) = Kd s/(Td s + 1)
    and all other terms as in :func:`position_T`.

    Parameters
    ----------
    p : Parameters, Model or any object with an attribute J
        In kg m2.
    kp, ki, kd, tau, derivative_filter, leak, controller
        As in :func:`position_T`. D acts on the measured velocity, not on the error, so it is not in
        the numerator; give a D on the error as ``controller``.
    prefilter : bool or float
        Adds a/(s + a) in front, a in 1/s; True is the source paper's 2/(s + 2).
    dead_time : float
        Dead time h of the torque in s, exact: both E(s) and D(s) are then times exp(-s h).

    Returns
    -------
    control.TransferFunction, or with a dead time DelayedTransfer
        theta/r, without unit.

    Raises
    ------
    InputError
        As :func:`position_T`, and for a < 0.

    Notes
    -----
    Friction that is not compensated (Fv) is not included.

    Examples
    --------
    The loop of the source paper is unstable, because J s^3 + Kp s + Ki has no s^2 term; a
    derivative gain corrects it:

    >>> p = lg.table1()
    >>> bool((lg.position_loop_tf(p, kp=15.0, ki=1.55).poles().real < 0).all())
    False
    >>> bool((lg.position_loop_tf(p, kp=15.0, ki=1.55, kd=0.3).poles().real < 0).all())
    True
    """
    return _reference_tf(p, 2, C, prefilter, dead_time)


@_taking(_gains_and_prefilter)
def velocity_loop_tf(p: Any, C: Controller, dead_time: Fraction, prefilter: bool | float) -> Any:
    """Reference to velocity with friction fully compensated (plant 1/(J s)).

    w/r = E(s)/(J s + D(s) + E(s)), with the terms of :func:`position_loop_tf`: Kd multiplies the
    measured acceleration, like an added inertia.

    Parameters
    ----------
    p : Parameters, Model or any object with an attribute J
        In kg m2.
    kp, ki, kd, tau, derivative_filter, leak, controller
        As in :func:`velocity_T`.
    prefilter, dead_time
        As in :func:`position_loop_tf`.

    Returns
    -------
    control.TransferFunction, or with a dead time DelayedTransfer
        w/r, without unit.

    Raises
    ------
    InputError
        As :func:`position_loop_tf`.

    Examples
    --------
    The source paper's PI controller: its slow pole is near -ki/kp.

    >>> T = lg.velocity_loop_tf(lg.table1(), kp=1.6, ki=0.16)
    >>> np.round(np.sort(T.poles().real), 1).tolist()
    [-727.2, -0.1]
    """
    return _reference_tf(p, 1, C, prefilter, dead_time)


@_taking(_gains)
def position_L(p: Any, C: Controller, dead_time: Fraction) -> Any:
    """The open loop L(s) = C(s) exp(-s h)/(J s^2) of a position loop, cut at the torque.

    C(s) as in ``position_T``; friction is fully compensated.

    Parameters
    ----------
    p : Parameters, Model or any object with an attribute J
        In kg m2.
    kp, ki, kd, tau, derivative_filter, leak, controller, dead_time
        As in :func:`position_T`.

    Returns
    -------
    control.TransferFunction, or with a dead time DelayedTransfer
        L(s), without unit, for :func:`stability_check`.

    Raises
    ------
    InputError
        As :func:`position_T`.

    Examples
    --------
    A PD controller, and how much dead time it stands:

    >>> L = lg.position_L(lg.table1(), kp=15.0, kd=1.2)
    >>> round(1e3 * lg.stability_check(L).delay_margin, 2)
    2.84
    """
    return _open_loop(p, 2, C, dead_time)


@_taking(_gains)
def velocity_L(p: Any, C: Controller, dead_time: Fraction) -> Any:
    """The open loop L(s) = C(s) exp(-s h)/(J s) of a velocity loop, cut at the torque.

    C(s) as in ``velocity_T``; friction is fully compensated.

    Parameters
    ----------
    p : Parameters, Model or any object with an attribute J
        In kg m2.
    kp, ki, kd, tau, derivative_filter, leak, controller, dead_time
        As in :func:`velocity_T`.

    Returns
    -------
    control.TransferFunction, or with a dead time DelayedTransfer
        L(s), without unit, for :func:`stability_check`.

    Raises
    ------
    InputError
        As :func:`velocity_T`.

    Examples
    --------
    The source paper's PI controller is unstable with a dead time of 2.5 ms:

    >>> L = lg.velocity_L(lg.table1(), kp=1.6, ki=0.16, dead_time=2.5e-3)
    >>> bool(lg.stability_check(L))
    False
    """
    return _open_loop(p, 1, C, dead_time)


def _error_T(p: Any, order: int, C: Controller, delay: Fraction) -> Any:
    J, sigma0, sigma1 = (parameter(p, name) for name in ("J", "sigma0", "sigma1"))
    loop = Loop(J, sigma0, sigma1, order, C)
    if delay:
        inertia, torque = C.parts(J, order)
        return reduced(Quasi.of([(0, loop.T()[0])]), Quasi.of([(0, inertia), (delay, torque)]))
    T = LoopT(*rounded(*loop.T()))
    T.loop = loop
    return T


def _reference_tf(
    p: Any, order: int, C: Controller, prefilter: bool | float, delay: Fraction
) -> ct.TransferFunction | DelayedTransfer:
    num, filtered = mul(C.on_error[0], C.derivative[1]), (1,)
    if prefilter is not False and prefilter is not None:
        pole = number(2 if prefilter is True else prefilter, "prefilter")
        if pole <= 0:
            raise InputError(f"prefilter is {float(pole):g} 1/s, but its pole must be above 0.")
        num, filtered = mul(num, (pole,)), (pole, 1)
    inertia, torque = (mul(part, filtered) for part in C.parts(parameter(p, "J"), order))
    if delay:
        return reduced(Quasi.of([(delay, num)]), Quasi.of([(0, inertia), (delay, torque)]))
    output = "theta" if order == 2 else "w"
    return ct.TransferFunction(*rounded(num, add(inertia, torque)), inputs="r", outputs=output)


def _open_loop(p: Any, order: int, C: Controller, delay: Fraction) -> Any:
    inertia, torque = C.parts(parameter(p, "J"), order)
    if delay:
        return reduced(Quasi.of([(delay, torque)]), Quasi.of([(0, inertia)]))
    return ct.TransferFunction(*rounded(torque, inertia), inputs="u", outputs="u")


def rounded(num: Poly, den: Poly) -> tuple[list[float], list[float]]:
    """Coefficients in descending powers, each rounded once."""
    if not den:
        raise InputError("J and all gains are 0: the loop has no denominator; give one of them.")
    top, bottom = ([to_float(Fraction(c)) for c in reversed(p or (0,))] for p in (num, den))
    if not all(map(math.isfinite, top + bottom)):
        raise InputError("A coefficient of the loop is above 1e308; give smaller gains.")
    return top, bottom
