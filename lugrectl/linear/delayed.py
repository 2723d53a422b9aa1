"""Transfer functions with exact dead times, and loops of blocks linearized around them.

A transfer function is a ratio of sums of p(s) exp(-sT). The block of a dead time h is the Pade form
p1' = r p2, p2' = r (12 (q - p1) - 6 p2), out = q - p2 with r = 1/h in python-control. So in the
linear system its input q is known from the row of p2, and with p2 = q - v the signal v that leaves
it becomes an input of its own: v = q exp(-s h).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import combinations
from typing import Any

import control as ct
import numpy as np

from ..blocks.controllers import DeadTime, dead_times
from ..core.errors import InputError
from ..core.validation import array, shown
from .border import Border, is_sampled
from .exact import Poly, Quasi, add, divide, gcd, mul, scale
from .transfer import (
    coefficients,
    is_measured,
    not_negative,
    number,
    require_continuous_siso,
    response,
    state_space_polynomials,
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


STEP = 1e-6  # of the differences, as control.linearize has it
NOISE = 1e-6  # what the differences leave of a path that is not there


def linearize(
    system: Any,
    x0: Any = 0,
    u0: Any = 0,
    t: float = 0.0,
    *,
    input: str | None = None,
    output: str | None = None,
    params: Mapping[str, Any] | None = None,
) -> Any:
    """The linear system about an operating point, its dead times exact.

    As ``control.linearize``, with central differences; the dead times of the package's blocks
    (:func:`dead_time`, the effect ``input_delay`` of a model, ``delay=`` of :func:`cascade_loop`)
    are not linearized as the Pade form that they are in python-control: T(s) holds exp(-s h).

    Parameters
    ----------
    system : control.NonlinearIOSystem
        A block or a loop: :func:`velocity_loop`, :func:`cascade_loop`, ``control.interconnect``.
    x0, u0 : array_like, control.OperatingPoint
        States and inputs of the operating point, in the order of the system; 0 is at rest.
    t : float
        Time in s, where the system depends on it.
    input, output : str, optional
        The labels of one input and one output, such as "r" and "w"; needed where there are several
        and a dead time is not 0.
    params : dict, optional
        Parameters that differ from the system's, by key.

    Returns
    -------
    DelayedTransfer or control.StateSpace
        A state-space model if no dead time is above 0.

    Raises
    ------
    InputError
        If the system is no control system in continuous time, or for an unknown label.

    Notes
    -----
    The states of the Pade form keep their places in x0; their values do not matter. Two dead
    times in one system are exact too. With ``output`` given, an integrator that neither it nor
    another state reads is left out: the position of a drive whose loop is closed over w. It is no
    part of ``open_loop`` either, where only the output reads it.

    Examples
    --------
    A cascade with 1 ms of dead time in the drive, about rest, with viscous friction only; the
    loop around the dead time stands 0.76 ms more:

    >>> p = lg.Model.of(J=0.0022, friction="viscous", Fv=0.018)
    >>> loop = lg.cascade_loop(p, kv=20.0, kp=1.6, ki=16.0, lag=5e-4, delay=1e-3)
    >>> T = lg.linearize(loop, input="r", output="theta")
    >>> T.dead_times
    (0.001,)
    >>> round(1e3 * lg.stability_check(T.open_loop).delay_margin, 2)
    0.76
    """
    if not hasattr(system, "linearize") or system.isdtime(strict=True):
        raise InputError(
            f"system is {shown(system)}, but a continuous control system or block is needed."
        )
    late = [one for one in dead_times(system, params) if np.isfinite(one.seconds)]
    linear = _differences(system, x0, u0, t, params)
    inputs = _chosen(input, system.input_labels, "input", late)
    outputs = _chosen(output, system.output_labels, "output", late)
    A, B, C, D = _without_pade(linear, late)
    made = [number(one.seconds, "delay") for one in late if one.seconds > 0]
    columns = [*inputs, *range(B.shape[1] - len(made), B.shape[1])]
    around = [*range(len(C) - len(made), len(C))]
    rows = [*outputs, *around]
    keep = [*range(len(A))] if output is None and not made else _read(A, C[rows])
    A, B, C = A[np.ix_(keep, keep)], B[np.ix_(keep, columns)], C[:, keep]
    model = ct.ss(A, B, C[rows], D[np.ix_(rows, columns)])
    if not made:
        model.set_inputs([system.input_labels[k] for k in inputs])
        model.set_outputs([system.output_labels[k] for k in outputs])
        return model
    T = closed_over(model, made)
    return replace(T, outside=len(A) - len(_read(A, C[around])))


def _read(A: np.ndarray, C: np.ndarray) -> list[int]:
    """The states without integrators that nothing reads, no other state and no row of C: the
    position of a drive in a loop over its speed adds a pole at s = 0 that is no part of it."""
    keep = [*range(len(A))]
    while True:
        free = [k for k in keep if not A[keep, k].any() and not C[:, k].any()]
        if not free:
            return keep
        keep = [k for k in keep if k not in free]


def closed_over(model: Any, late: Sequence[Fraction]) -> DelayedTransfer:
    """T(s) from the first input to the first output, where each further output, delayed, is the
    further input."""
    # With H the response of the model, z the diagonal of exp(-s h) and H22 its part of the further
    # channels, T = det(I - H z, of all channels but the first input's)/det(I - H22 z); both are
    # sums of principal minors of H.
    tops, den = state_space_polynomials(model)
    sets = [S for k in range(len(late) + 1) for S in combinations(range(1, len(late) + 1), k)]
    num_terms, den_terms = [], []
    for S in sets:
        delay, sign = sum((late[i - 1] for i in S), Fraction(0)), (-1) ** len(S)
        num_terms.append((delay, scale(_minor(tops, (0, *S), den), sign)))
        den_terms.append((delay, scale(_minor(tops, S, den), sign)))
    return reduced(Quasi.of(num_terms), Quasi.of(den_terms))


def _minor(tops: Any, S: tuple[int, ...], den: Poly) -> Poly:
    """The principal minor of H of the channels S times ``den``, a polynomial."""
    if not S:
        return den
    minor = _determinant([[tops[i][k] for k in S] for i in S])
    for _ in S[1:]:
        minor = divide(minor, den)[0]
    return minor


def _determinant(M: list[list[Poly]]) -> Poly:
    if len(M) == 1:
        return M[0][0]
    total: Poly = ()
    for k, top in enumerate(M[0]):
        rest = [[*row[:k], *row[k + 1 :]] for row in M[1:]]
        total = add(total, scale(mul(top, _determinant(rest)), (-1) ** k))
    return total


def _differences(system: Any, x0: Any, u0: Any, t: float, params: Any) -> list[np.ndarray]:
    """A, B, C and D by central differences."""
    if isinstance(system, ct.StateSpace):
        return [np.asarray(M, dtype=float) for M in (system.A, system.B, system.C, system.D)]
    for value, name, many in ((x0, "x0", system.nstates), (u0, "u0", system.ninputs)):
        if not isinstance(value, ct.OperatingPoint):
            rows = array(value, name)
            if rows.ndim and rows.size != many:
                raise InputError(f"{name} needs {many} values, or one for all, such as 0.")
            if not np.isfinite(rows).all():
                raise InputError(f"{system.name}: {name} must be finite.")
    try:
        one, other = (
            system.linearize(x0, u0, t=t, params=params, eps=step) for step in (STEP, -STEP)
        )
    except (ValueError, TypeError, RuntimeError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"{system.name} cannot be linearized there: {error}.") from None
    pairs = zip((one.A, one.B, one.C, one.D), (other.A, other.B, other.C, other.D), strict=True)
    return [0.5 * (np.asarray(a) + np.asarray(b)) for a, b in pairs]


def _chosen(label: str | None, labels: list[str], what: str, late: list[DeadTime]) -> list[int]:
    if label is None:
        if len(labels) > 1 and any(one.seconds > 0 for one in late):
            raise InputError(
                f"the system has {len(labels)} {what}s and a dead time: give {what}=, one of "
                f"{', '.join(labels)}."
            )
        return [*range(len(labels))]
    if label not in labels:
        raise InputError(f"{what} is {shown(label)}, but there is {', '.join(labels)}.")
    return [labels.index(label)]


def _without_pade(
    linear: list[np.ndarray], late: list[DeadTime]
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """The system without the states of its dead times, whose inputs and outputs are the last."""
    A, B, C, D = linear
    first = [one.place for one in late]
    second = [k + 1 for k in first]
    keep = [k for k in range(len(A)) if k not in {*first, *second}]
    on = [k for k, one in enumerate(late) if one.seconds > 0]
    places = [second[k] for k in on]
    # q = Q x + P p2 + R u of the signals that enter, from the rows of p2
    size = np.array([12.0 / late[k].seconds for k in on])[:, None]
    Q, R = A[np.ix_(places, keep)] / size, B[places] / size
    P = A[np.ix_(places, places)] / size + 0.5 * np.eye(len(places))
    P[np.abs(P) < NOISE] = 0.0
    # p2 = q - v = P p2 + Q x + R u - v
    solve = np.linalg.inv(np.eye(len(places)) - P)
    x_to, u_to, v_to = solve @ Q, solve @ R, -solve
    columns = np.vstack([A[np.ix_(keep, places)], C[:, places]])
    states, own = len(keep), np.vstack([A[np.ix_(keep, keep)], C[:, keep]])
    inputs = np.vstack([B[keep], D])
    own, inputs, new = own + columns @ x_to, inputs + columns @ u_to, columns @ v_to
    A1, C1 = own[:states], np.vstack([own[states:], x_to])
    B1 = np.hstack([inputs[:states], new[:states]])
    below = np.hstack([u_to, v_to + np.eye(len(places))])
    D1 = np.vstack([np.hstack([inputs[states:], new[states:]]), below])
    return A1, B1, C1, D1
