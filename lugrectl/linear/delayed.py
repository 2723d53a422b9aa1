"""Transfer functions with exact dead times: ratios of sums of p(s) exp(-sT)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any

import control as ct
import numpy as np

from ..core.errors import InputError
from .border import Border, is_sampled
from .exact import Poly, Quasi, gcd, mul
from .transfer import (
    coefficients,
    is_measured,
    not_negative,
    number,
    require_continuous_siso,
    response,
)


@dataclass(frozen=True, repr=False)
class DelayedTransfer:
    """A transfer function with exact dead times, one input and one output.

    T(s) = N(s)/D(s), where N and D are sums of p(s) exp(-sT). Sums, products and quotients with
    each other, numbers and control systems are exact, and so is :meth:`feedback`: no Pade
    approximation is made. It is made by :func:`delayed`, :func:`linearize` and the loops'
    functions with ``dead_time=``, and T(s) of a complex s is its value.

    Attributes
    ----------
    num, den : Quasi
        N and D: ``terms`` are pairs of a dead time in s and a polynomial (lowest power first).
    cancelled : tuple
        The factor that N and D had in common, lowest power first.
    outside : int
        Number of integrators that the loop around the dead time does not read.

    Examples
    --------
    The loop of an integrator with a dead time of 1 ms, closed; at low frequency its gain is 1:

    >>> L = lg.delayed(ct.tf([300.0], [1.0, 0.0]), 1e-3)
    >>> T = L.feedback()
    >>> T
    DelayedTransfer: 300 exp(-0.001 s) / (s + 300 exp(-0.001 s))
    >>> round(abs(T(0.01j)), 6), T.dead_times
    (1.0, (0.001,))
    """

    num: Quasi
    den: Quasi
    cancelled: Poly = (1,)
    outside: int = 0

    @classmethod
    def of(cls, G: Any, name: str = "T") -> DelayedTransfer:
        """G without a dead time of its own, or as it is; InputError calls it ``name``."""
        if isinstance(G, DelayedTransfer):
            return G
        if isinstance(G, int | float | Fraction | np.number):
            return cls(Quasi.of([(0, (number(G, name),))]), Quasi.of([(0, (1,))]))
        if isinstance(G, ct.TransferFunction | ct.StateSpace):
            require_continuous_siso(G, name)
        num, den = coefficients(G, name)
        return reduced(Quasi.of([(0, num)]), Quasi.of([(0, den)]))

    @property
    def dead_times(self) -> tuple[float, ...]:
        """The dead times that appear, in s, ascending, without 0."""
        found = {late for q in (self.num, self.den) for late, _ in q.terms if late}
        return tuple(sorted(map(float, found)))

    @property
    def hidden(self) -> str:
        """A remark on a mode that is not stable and cancelled from T(s); empty without one."""
        return Border().hidden(self.cancelled)

    def __call__(self, s: Any, **_: Any) -> Any:
        """T(s) of a complex number or an array of them."""
        at = np.asarray(s, dtype=complex)
        with np.errstate(all="ignore"):
            value = self.num.at(at) / self.den.at(at)
        return value if value.ndim else complex(value)

    def frd(self, omega: Any) -> ct.FrequencyResponseData:
        """The exact response at frequencies in rad/s, for the plots of control."""
        w = np.atleast_1d(np.asarray(omega, dtype=float))
        return ct.frd(self(1j * w), w)

    def feedback(self, H: Any = 1, sign: int = -1) -> DelayedTransfer:
        """The closed loop T/(1 + T H); with ``sign`` 1, T/(1 - T H).

        Written as ``T / (1 + T)`` the poles of T appear twice and cancel, which counts as a
        hidden mode.
        """
        back = DelayedTransfer.of(H, "H")
        loop = self.num * back.num
        num, den = self.num * back.den, self.den * back.den + loop.scaled(-sign)
        return reduced(num, den, mul(self.cancelled, back.cancelled))

    @property
    def open_loop(self) -> DelayedTransfer:
        """The loop L(s) around the only dead time of T, whose poles are the zeros of 1 + L(s).

        Raises
        ------
        InputError
            For several dead times in the denominator, or none.
        """
        late = [term for term in self.den.terms if term[0]]
        if len(late) != 1 or not self.den.polynomial:
            raise InputError(
                f"T has {len(late)} dead times in its loop, but open_loop is for one; build the "
                "open loop from its parts with lg.delayed."
            )
        made = reduced(Quasi.of(late), Quasi.of([(0, self.den.polynomial)]), self.cancelled)
        both = made.cancelled
        zeros = next((k for k, c in enumerate(both) if c), len(both))
        return replace(made, cancelled=both[min(zeros, self.outside) :])

    def __add__(self, other: Any) -> DelayedTransfer:
        b = DelayedTransfer.of(other)
        num = self.num * b.den + b.num * self.den
        return reduced(num, self.den * b.den, mul(self.cancelled, b.cancelled))

    def __mul__(self, other: Any) -> DelayedTransfer:
        b = DelayedTransfer.of(other)
        return reduced(self.num * b.num, self.den * b.den, mul(self.cancelled, b.cancelled))

    def __truediv__(self, other: Any) -> DelayedTransfer:
        b = DelayedTransfer.of(other)
        return reduced(self.num * b.den, self.den * b.num, mul(self.cancelled, b.cancelled))

    def __rtruediv__(self, other: Any) -> DelayedTransfer:
        return DelayedTransfer.of(other) / self

    def __neg__(self) -> DelayedTransfer:
        return self * -1

    def __sub__(self, other: Any) -> DelayedTransfer:
        return self + -DelayedTransfer.of(other)

    def __rsub__(self, other: Any) -> DelayedTransfer:
        return -self + other

    __radd__ = __add__
    __rmul__ = __mul__

    def __repr__(self) -> str:
        return f"DelayedTransfer: {_written(self.num)} / ({_written(self.den)})"


def delayed(G: Any, dead_time: float) -> Any:
    """G(s) exp(-s T), the dead time exact.

    Parameters
    ----------
    G : control.TransferFunction, control.StateSpace, control.frd, DelayedTransfer or (num, den)
        A continuous system with one input and one output, or a measured response.
    dead_time : float
        T in s, >= 0.

    Returns
    -------
    DelayedTransfer or control.FrequencyResponseData
        Taken by :func:`bandwidth`, :func:`l2_check`, :func:`spr_check` and
        :func:`stability_check`; of a measured response a measured response.

    Raises
    ------
    InputError
        For a negative dead time and a system that is sampled or has several channels. In T(z) a
        dead time of k samples is exact as z^-k.

    Examples
    --------
    An integrator of gain K with a dead time T is stable in a closed loop up to K T = pi/2:

    >>> G = ct.tf([100.0], [1.0, 0.0])
    >>> [bool(lg.stability_check(lg.delayed(G, T))) for T in (0.0157, 0.0158)]
    [True, False]
    """
    late = not_negative(dead_time, "dead_time")
    if is_measured(G):
        w, values = response(G, "G")
        return ct.frd(values * np.exp(-1j * w * float(late)), w)
    if is_sampled(G):
        raise InputError(
            "G is sampled, where a dead time of k samples is exact as it is: multiply G(z) by "
            "z^-k, control.tf([1], [1] + [0]*k, dt)."
        )
    made = DelayedTransfer.of(G, "G")
    return DelayedTransfer(made.num.later(late), made.den, made.cancelled)


def reduced(num: Quasi, den: Quasi, cancelled: Poly = (1,)) -> DelayedTransfer:
    """num/den without a factor that all terms have in common, and without common dead time."""
    if not den:
        raise InputError("the denominator of T(s) is zero: the loop has no solution.")
    common = gcd(num.common(), den.common()) or (1,)
    first = den.terms[0][0]
    if num and num.terms[0][0] < first:
        raise InputError(
            f"T answers {float(first - num.terms[0][0]):g} s before its input: a dead time cannot "
            "be divided by."
        )
    num, den = (q.over(common).later(-first) for q in (num, den))
    return DelayedTransfer(num, den, mul(cancelled, common))


def _written(q: Quasi) -> str:
    """A quasi-polynomial in s."""
    parts = []
    for late, p in q.terms:
        powers = {i: "" if not i else "s" if i == 1 else f"s^{i}" for i, c in enumerate(p) if c}
        terms = [
            s if s and p[i] == 1 else f"{float(p[i]):g} {s}".strip() for i, s in powers.items()
        ]
        text = " + ".join(terms[::-1])
        text = f"({text})" if late and len(terms) > 1 else text
        parts.append(f"{text} exp(-{float(late):g} s)" if late else text)
    return " + ".join(parts).replace("+ -", "- ") or "0"
