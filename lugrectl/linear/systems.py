"""Systems with exact coefficients, T(s), also with dead times, and T(z); of many states; measured.

How real a rational T is, is decided on rational numbers; of T(z) the circle is closed, so that
there is no WSPR. Of T(s) with dead times the sign of Re T(jw) and the zeros of its denominator are
decided in floating point. So are systems of many states, as exact arithmetic takes minutes at 30:
A is made triangular once, and T is known with what rounding may change of it. Between two
frequencies of a measured response log |T| and the phase are straight lines over log w (over w from
w = 0).
"""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property, reduce
from typing import Any, NamedTuple

import control as ct
import numpy as np
from scipy.linalg import matrix_balance, schur, solve_sylvester

from ..core.errors import InputError
from . import exact
from .delayed import DelayedTransfer, reduced
from .exact import Poly, Quasi
from .system import (
    BEYOND,
    BITS,
    FEWER,
    Followed,
    Margin,
    Signs,
    System,
    from_0,
    last,
    spread,
    turned,
)
from .transfer import (
    EPS,
    Border,
    border_of,
    coefficients,
    is_measured,
    is_sampled,
    require_siso,
    response,
    span,
    state_space_polynomials,
    to_float,
)

EXACT = 6  # states of a state-space model that is decided in exact arithmetic
TURNS = 3e4  # rad of phase of a dead time up to which a shifted function is followed
FEW = 16  # turns in which a sign that never settles, and the largest value, are looked for
HALVES = 40  # of the least |L| that is looked for on the negative real axis
CLOSE = 1e-3  # of |L| as w grows: a crossing that is larger by less is not looked for
ROUNDING = 1e-14  # of the sum of its terms: what floating point does not resolve of a value
LEAST = 1e-300
DRAWN = 100.0  # rad of phase of the longest dead time that are drawn
NEAR = 0.999  # of half the sampling rate: T often has a zero there, and no phase
LARGEST = 1e140  # its square, and that of its inverse, are floats
DECIDED = 16  # states up to which stability is decided in exact arithmetic: some seconds
UNSEEN = 1e-13  # of its inputs and outputs: a mode of less does not show, by rounding
MANY = 1e3  # rounding of the matrices moves a pole by up to this times EPS
FAR = 1e6  # times the norm of A: no frequency is beyond it
BETWEEN = 8  # parts of a step between two measured frequencies


class Transfer(System):
    """T(s), or T(z) as a function of v: ``given`` is T in its own variable, ``T`` in that whose
    imaginary axis the frequencies lie on."""

    def __init__(self, given: DelayedTransfer, border: Border) -> None:
        num, den = given.num, given.den
        self.given = self.T = given
        self.border, self.zero, self.excess = border, not num, den.degree - num.degree
        self.degree = max(num.degree, den.degree)
        self.hidden = border.hidden(given.cancelled)
        self.lost = bool(border.unstable(given.cancelled)[0])
        if border.dt is not None:
            mapped = (border.mapped(q.polynomial, self.degree) for q in (num, den))
            num, den = (Quasi.of([(0, p)]) for p in mapped)
            self.T = DelayedTransfer(num, den)

    def at(self, w: Any) -> tuple[Any, Any]:
        return self.T(1j * self.border.place(w)), 0.0

    def dc(self) -> Any:
        top, bottom = self.T.num.taylor(0), self.T.den.taylor(0)
        return (abs(top / bottom) if bottom else math.inf) if top else 0

    @property
    def strange(self) -> list[str]:  # type: ignore[override]
        allowed = "-1, 0 or 1" if self.border.dt is None else "0 in z: no delay, no sample ahead"
        if self.zero or abs(self.excess) <= (self.border.dt is None):
            return []
        return [f"the relative degree is {self.excess}, which must be {allowed}"]

    @cached_property
    def limit(self) -> tuple[int, str]:
        num, den = self.T.num, self.T.den
        if self.border.dt:
            return 1, ""
        real, full = num.real_product(den), 2 * min(num.degree, den.degree)
        name = "w^2 Re T(jw)" if self.excess > 0 else "Re T(jw)"
        there = real.degree >= full
        if not real.rational:
            return int(there), f"{name} {'stays above 0' if there else 'tends to 0'} as w grows"
        value = Fraction(0)
        if there:
            value = Fraction(real.polynomial[full]) * (-1) ** (full // 2)
            value /= den.polynomial[-1] ** 2
        said = f"{name} tends to {to_float(value):.6g} as w grows"
        return int(value > 0) - int(value < 0), said

    # --- the loop closed over T ---

    @property
    def open_at_infinity(self) -> bool:
        num, den = self.T.num, self.T.den
        if num.degree != den.degree:
            return num.degree > den.degree
        low = den.leading
        own = abs(low.pop(0, Fraction(0))) - sum(map(abs, low.values()))
        return own <= 0 or sum(map(abs, num.leading.values())) >= own

    def ends(self) -> list[tuple[float, float]]:
        below = self.T.den.taylor(0)
        static = [(0.0, float(self.T.num.taylor(0) / below))] if below else []
        return [*static, *((self.border.frequency(math.inf), x) for x in limits(self.T))]

    def closed(self, gain: float = 1.0) -> Transfer:
        num, den = self.given.num.scaled(Fraction(gain)), self.given.den
        if not (total := num + den):
            raise InputError("L(s) is -1, so that the closed loop L/(1 + L) has no solution.")
        return type(self)(DelayedTransfer(den, total, self.given.cancelled), self.border)

    def plus(self, c: float) -> Transfer:
        num, den = self.given.num, self.given.den
        return type(self)(DelayedTransfer(num + den.scaled(Fraction(c)), den), self.border)


class ExactSystem(Transfer):
    """A rational T, decided on rational numbers."""

    @cached_property
    def ratio(self) -> tuple[Poly, Poly]:
        return self.T.num.polynomial, self.T.den.polynomial

    @cached_property
    def poles(self) -> tuple[complex, ...]:
        """Floats: for display, not for decisions."""
        return self.border.roots(self.given.den.polynomial)

    @cached_property
    def _unstable(self) -> tuple[int, list[float]]:
        return self.border.unstable(self.given.den.polynomial)

    @property
    def right(self) -> int:
        return self._unstable[0]

    @property
    def on(self) -> list[float]:
        return self._unstable[1]

    def signs(self, part: str, level: Any = 0) -> Signs:
        num, den = self.ratio
        size, square = (exact.real_product(p, p) for p in self.ratio)
        if part == "imag":
            (a, b), (c, d) = exact.even_odd(num), exact.even_odd(den)
            found = signs_in_x(exact.add(exact.mul(b, c), exact.scale(exact.mul(a, d), -1)))
        elif part == "size":
            found = signs_in_x(exact.add(size, exact.scale(square, -Fraction(level))))
        else:
            found = self._real(exact.real_product(num, den), square)
        return found.moved(self.border.frequency)

    def _real(self, P: Poly, square: Poly) -> Signs:
        """The signs of P/square with its zeros at w = 0 and half the rate; a pole on the axis at
        which Re T is finite is no zero of it."""
        found = signs_in_x(P)
        if not P:
            return found
        common = exact.gcd(P, square)
        P, square = exact.divide(P, common)[0], exact.divide(square, common)[0]
        ends = [math.inf] * (self.border.dt is not None and len(P) < len(square))
        touches = (*[0.0] * (P[0] == 0), *signs_in_x(P).touches, *ends)
        return found._replace(touches=touches)

    def largest(self) -> tuple[float, float]:
        if self.T.num.degree > self.T.den.degree:
            return math.inf, math.inf
        most, x = exact.largest_ratio(*(exact.real_product(p, p) for p in self.ratio))
        return math.sqrt(to_float(most)), self.border.frequency(math.sqrt(x))

    @property
    def fits(self) -> bool:
        return exact.hurwitz(exact.add(*self.ratio))

    def _is_real(self, less: Fraction) -> bool:
        """Whether T(s - less), or T((1 - less) z), is positive real."""
        if self.border.dt is None:
            return exact.positive_real(*(exact.shift(p, less) for p in self.ratio))
        both = (self.given.num.polynomial, self.given.den.polynomial)
        inner = (tuple(c * (1 - less) ** i for i, c in enumerate(p)) for p in both)
        return exact.positive_real(*(self.border.mapped(p, self.degree) for p in inner))

    def margin(self) -> float:
        if not self.degree:
            return math.inf
        # Poles and zeros must stay left of the axis; the nearest is not farther than their mean.
        far = [Fraction(p[-2]) / p[-1] / (len(p) - 1) for p in self.ratio if len(p) > 1]
        high = 1 - Fraction(1, 2**60) if self.border.dt else min(far)
        return self.border.rate(to_float(last(self._is_real, high, BITS)))

    def known(self, factors: list[float]) -> float:
        return math.inf


class LateSystem(Transfer, Followed):
    @cached_property
    def _zeros(self) -> Zeros:
        return zeros(self.T.den)

    @property
    def right(self) -> float:
        return self._zeros.right

    @property
    def on(self) -> tuple[float, ...]:
        return self._zeros.on

    def at(self, w: Any) -> tuple[Any, Any]:
        s, T = 1j * np.asarray(w), self.T
        with np.errstate(all="ignore"):
            below = np.abs(T.den.at(s))
            value = T.num.at(s) / T.den.at(s)
            slack = (T.num.bound(np.abs(s)) + np.abs(value) * T.den.bound(np.abs(s))) / below
        return value, ROUNDING * slack

    def grid(self, part: str, level: float) -> tuple[np.ndarray, bool]:
        T, end = self.T, None
        if part == "real":
            end = reach(T.num.real_product(T.den))
        elif part == "imag":
            whole = T.num * T.den.mirror()
            end = reach(whole + whole.mirror().scaled(-1))
        if level and end is None:
            end = reach(T.num.squared() + T.den.squared().scaled(-Fraction(level)))
        settled, near = end is not None, self._zeros.followed
        if end is None:
            end = (reach(T.den) or 0.0) + FEW * 2.0 * math.pi / min(T.dead_times)
        w = spread(T.num.roots() + T.den.roots(), late=max(self.T.dead_times), end=end)
        return from_0(np.union1d(w, near[near < end])), settled

    def signs(self, part: str, level: Any = 0) -> Signs:
        """Of Im T those up to the largest |T| below 1 where T is real and negative."""
        if part == "imag":
            return self._imaginary()
        found = super().signs(part, level)
        if not found.complete and not found.changes:
            raise InputError(
                "as w grows, the sign of a condition on T(jw) stays undecided: its dead times act "
                "on the highest power of s; add the lag that the drive has."
            )
        return found

    def _imaginary(self) -> Signs:
        found, floor = Signs(1), max(map(abs, limits(self.T)), default=0.0)
        floor *= 1.0 + (CLOSE if floor < 1.0 else 0.1)  # beyond 1 no factor on L is stable
        if self.T.num.degree > self.T.den.degree:
            return found
        for k in range(1, HALVES):
            least = max(0.5**k, floor)
            found = super().signs("imag", least**2)
            sizes = [-float(self.at(w)[0].real) for w in found.places if w > 0]
            if (
                least == floor
                or self.grid("imag", 0.0)[1]
                or max((x for x in sizes if x < 1), default=0.0) >= least
            ):
                break
        return found

    def largest(self) -> tuple[float, float]:
        if self.T.num.degree > self.T.den.degree:
            return math.inf, math.inf
        return super().largest()

    @property
    def outside(self) -> str:
        """Beside the origin no pole on the axis can be told from one right of it."""
        return super().outside or (f"a pole {self.on_border}" if any(self.on) else "")

    @property
    def fits(self) -> bool:
        found = zeros(self.T.num + self.T.den)
        return not (found.right or found.on)

    def _is_real(self, less: Fraction) -> bool:
        T = self.T
        moved = LateSystem(DelayedTransfer(T.num.shifted(less), T.den.shifted(less)), self.border)
        if (reach(moved.T.den) or math.inf) > max(
            TURNS / max(self.T.dead_times), 10.0 * (reach(T.den) or 0.0)
        ):
            return False  # short of a chain of poles: eps is too large, or so by about 1e-4
        try:
            w, settled = moved.grid("real", 0.0)
            return settled and moved.stable is True and moved.nowhere_below_0(w)
        except InputError:
            return False

    def margin(self) -> float:
        high = 1 / Fraction(max(self.T.dead_times))
        while self._is_real(high):
            high *= 2
        return to_float(last(self._is_real, high, FEWER))

    def known(self, factors: list[float]) -> float:
        return max(factors, default=math.inf)


def transfer_system(given: DelayedTransfer, border: Border) -> Transfer:
    rational = given.num.rational and given.den.rational
    return (ExactSystem if rational else LateSystem)(given, border)


def signs_in_x(a: Poly) -> Signs:
    """The signs of a polynomial in x = w^2."""
    if not a:
        return Signs(0)
    factors = exact.squarefree(a)
    odd, even = (exact.positive_roots(reduce(exact.mul, factors[k::2], (1,))) for k in (0, 1))
    first = 1 if next(c for c in a if c) > 0 else -1
    return Signs(first, tuple(map(math.sqrt, odd)), tuple(map(math.sqrt, even)))


def reach(q: Quasi) -> float | None:
    """A frequency in rad/s above which, and |s| above which right of the axis, the highest power of
    s without dead time outweighs the rest; None where it never does."""
    last, most = q.leading, q.degree
    own = abs(last.pop(0, Fraction(0))) - sum(map(abs, last.values()))
    if own <= 0:
        return None
    ratios = [  # Fujiwara's bound on the roots of a polynomial with coefficients of these sizes
        (sum((abs(Fraction(p[i])) for _, p in q.terms if i < len(p)), Fraction(0)) / own, most - i)
        for i in range(most)
    ]
    logs = [(math.log(c.numerator) - math.log(c.denominator)) / k for c, k in ratios if c]
    return 2.0 * math.exp(max(logs)) if logs else 1.0


def limits(T: DelayedTransfer) -> tuple[float, ...]:
    """The real values that T(jw) takes again and again, or tends to, as w grows; not 0 or inf."""
    if T.num.degree != T.den.degree:
        return ()
    top, bottom = T.num.leading, T.den.leading
    late = sorted({*top, *bottom})
    if len(late) > 2:
        raise InputError(
            "the gain as w grows is undecided: several dead times act on the highest power of s; "
            "add the lag that the drive has."
        )
    if len(late) == 1:
        return (float(top[late[0]] / bottom[late[0]]),)
    # (a + b z)/(c + d z) is a circle about the real axis, which it crosses at z = 1 and z = -1.
    a, b, c, d = (p.get(k, Fraction(0)) for p in (top, bottom) for k in late)
    return tuple(float(n / m) if m else math.inf for n, m in ((a + b, c + d), (a - b, c - d)))


class Zeros(NamedTuple):
    """How many zeros are right of the imaginary axis, and the frequencies of those on it, with
    which ``right`` is a lower bound; ``followed``: frequencies, dense where it turns fast."""

    right: float
    on: tuple[float, ...] = ()
    followed: np.ndarray = np.zeros(0)


def zeros(q: Quasi) -> Zeros:
    """The argument of q(jw) is followed to ``reach``, beyond which it is that of the leading terms;
    with a dead time on the highest power infinitely many are right of the axis or near it."""
    if (end := reach(q)) is None:
        if len(q.leading) > 2:
            raise InputError(
                "stability is undecided: several dead times act on the highest power of s; add "
                "the lag that the drive has."
            )
        return Zeros(math.inf)

    def value(w: np.ndarray) -> np.ndarray:
        return q.at(1j * w)

    m = q.order()
    w = spread(q.roots(), late=float(q.terms[-1][0]), end=end)
    start, own = w[:1], float(q.taylor(m)) * 1j**m
    while abs(value(start)[0] / (own * start[0] ** m) - 1.0) > 0.1 and start[0] > LEAST:
        start = 0.125 * start
    if start[0] < w[0]:
        w = np.concatenate([np.geomspace(start[0], w[0], 100)[:-1], w])
    w, angle, on = turned(value, w)
    at_0 = (0.0,) * (m > 0)
    if on is not None:
        return Zeros(0, (*at_0, on), w)
    begin, finish = np.angle(
        value(w[[0, -1]]) / np.array([own, float(q.leading[0]) * 1j**q.degree])
    )
    return Zeros(round((q.degree - m) / 2 + (finish - begin - angle) / math.pi), at_0, w)


def solve_shifted(S: np.ndarray, b: np.ndarray, s: np.ndarray) -> np.ndarray:
    """(s I - S)^-1 b of an upper triangle S, for each of many s."""
    x = np.zeros((len(s), *b.shape), dtype=complex)
    for i in reversed(range(len(S))):
        x[:, i] = (b[i] + S[i, i + 1 :] @ x[:, i + 1 :]) / (s - S[i, i])[:, None]
    return x


@dataclass(frozen=True)
class StateSystem(Followed):
    """T = C (sI - A)^-1 B + D, or of z, with any number of channels.

    ``less``: T(s - less), or T((1 - less) z), instead. ``unseen``: modes that are not stable and
    were taken out, as they do not show in T; ``lost``: whether one is so beyond rounding.
    """

    A: np.ndarray
    B: np.ndarray
    C: np.ndarray
    D: np.ndarray
    border: Border = Border()
    less: float = 0.0
    unseen: tuple[complex, ...] = ()
    lost: bool = False
    basis = " (decided in floating point, within rounding)"

    @classmethod
    def of(cls, T: Any) -> StateSystem:
        """In units of the states that make rows and columns of A alike: powers of two, exactly.

        InputError for matrices that floating point cannot multiply.
        """
        A, B, C, D = (np.asarray(M, dtype=float) for M in (T.A, T.B, T.C, T.D))
        if len(A) and all(np.isfinite(M).all() for M in (A, B, C, D)):
            balance: Any = matrix_balance(A, permute=False, separate=True)
            A, (units, _) = balance
            B, C = B / units[:, None], C * units
            b, c = (float(np.abs(M).max(initial=0.0)) for M in (B, C))
            if b and c:
                gain = 2.0 ** round(0.5 * (math.log2(c) - math.log2(b)))
                B, C = B * gain, C / gain
        sizes = [float(np.abs(M).max(initial=0.0)) for M in (A, B, C, D)]
        if not all(map(math.isfinite, sizes)):
            raise InputError("an entry of the state-space matrices is not a finite number.")
        if far := [x for x in sizes if x and not 1 / LARGEST < x < LARGEST]:
            raise InputError(
                f"the state-space matrices hold numbers of {far[0]:.1g}, too far from 1 for "
                "floating point: give time, input or output in another unit."
            )
        return cls(A, B, C, D, border_of(T))

    # --- poles ---

    @cached_property
    def poles(self) -> np.ndarray:
        return self.border.ordered(np.linalg.eigvals(self.A) if len(self.A) else [])

    @cached_property
    def norm(self) -> float:
        return float(np.linalg.norm(self.A))

    @property
    def rounding(self) -> float:
        """How far rounding of the matrices may move a pole."""
        return MANY * EPS * max(self.norm, 0.0 if self.border.dt is None else 1.0)

    @property
    def beyond(self) -> np.ndarray:
        """How far outside the border the poles are."""
        return self.border.beyond(self.poles)

    @property
    def right(self) -> float:
        return int((self.beyond > self.rounding).sum())

    @property
    def on(self) -> list[float]:
        near = self.poles[(np.abs(self.beyond) <= self.rounding) & (np.imag(self.poles) >= 0)]
        return np.abs(np.imag(self.border.rates(near))).tolist()

    @cached_property
    def stable(self) -> bool | None:
        """Whether every pole is, exactly where rounding hides it; None where this takes long."""
        if not (self.right or self.on):
            return True
        if self.right:
            return False
        if len(self.A) > DECIDED:
            return None
        _, den = state_space_polynomials(ct.ss(self.A, self.B, self.C, self.D))
        return self.border.stable(den)

    @property
    def hidden(self) -> str:
        if not self.unseen:
            return ""
        modes = self.border.show(self.unseen, "s = ")
        return (
            f"a mode of the system that is not stable ({modes}) does not show in T, within "
            "rounding: the system itself is not stable"
        )

    def shown(self) -> StateSystem:
        """The same without modes that are not stable and do not show."""
        if not (self.right or self.on):
            return self

        def is_stable(pole: Any) -> bool:
            return bool(self.border.beyond(np.asarray(pole)) < -self.rounding)

        ordered: Any = schur(self.A, output="complex", sort=is_stable)
        S, Q, many = ordered
        A1, A2, A12 = S[:many, :many], S[many:, many:], S[:many, many:]
        X = solve_sylvester(A1, -A2, -A12)  # the coordinates in which the two do not meet
        B, C = Q.conj().T @ self.B, self.C @ Q
        B1, B2 = B[:many] - X @ B[many:], B[many:]
        C1, C2 = C[:, :many], C[:, many:] + C[:, :many] @ X
        size = np.linalg.norm(B1) * np.linalg.norm(C1) + np.linalg.norm(B2) * np.linalg.norm(C2)
        step = A2 - np.diag(A2).mean() * np.eye(len(A2))  # beside 1, powers of A2 are all alike
        step /= max(np.linalg.norm(step), 1e-300)
        seen = [C2 @ np.linalg.matrix_power(step, k) @ B2 for k in range(len(A2))]
        if not many or max(np.abs(m).max() for m in seen) > UNSEEN * size:
            return self
        poles = self.border.ordered(np.diag(A2))
        unseen = tuple(complex(pole.real, abs(pole.imag)) for pole in poles)
        lost = bool(self.border.beyond(poles).max() > self.rounding)
        return StateSystem(A1, B1, C1, self.D, self.border, unseen=unseen, lost=lost)

    # --- values ---

    @cached_property
    def triangular(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """A, B and C in the coordinates in which A is triangular."""
        found: Any = schur(self.A, output="complex")
        S, Q = found
        return S, Q.conj().T @ self.B, self.C @ Q

    def at(self, w: np.ndarray) -> tuple[np.ndarray, Any]:
        """Of one channel; of several a matrix for each w, with no rounding."""
        if not len(self.A):
            return np.full(len(w), self.D[0, 0], complex), 0.0
        s = self.border.points(np.asarray(w), self.less)
        S, B, C = self.triangular
        with np.errstate(all="ignore"):
            right = solve_shifted(S, B, s)
            T = C @ right + self.D
            if self.D.size > 1:
                return T, 0.0
            left = solve_shifted(S[::-1, ::-1].T, C[:, ::-1].T, s)
            left, right = (np.linalg.norm(x[:, :, 0], axis=1) for x in (left, right))
            size = np.linalg.norm(C) * right + abs(float(self.D[0, 0]))
            return T[:, 0, 0], EPS * ((self.norm + np.abs(s)) * left * right + size)

    def sizes(self, w: np.ndarray) -> np.ndarray:
        if self.D.size == 1:
            return super().sizes(w)
        return np.linalg.norm(self.at(w)[0], 2, axis=(1, 2))

    @property
    def size(self) -> str:
        return "|T|" if self.D.size == 1 else "the largest singular value of T"

    @cached_property
    def zeros(self) -> np.ndarray:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            whole: Any = ct.ss(self.A, self.B, self.C, self.D, remove_useless_states=False)
            return whole.zeros()

    def grid(self, part: str, level: float) -> tuple[np.ndarray, bool]:
        seen = self.poles[np.abs(self.poles - (self.border.dt is not None)) > self.rounding]
        poles = self.border.rates(seen)
        marks = np.abs([] if part == "largest" else self.border.rates(self.zeros))
        most = FAR * (self.norm / (self.border.dt or 1.0) + 1e-300)
        poles, marks = poles[np.abs(poles) < most], marks[marks < most]
        # beyond |A| + |B| |C|/gap the direct term decides
        direct = abs(float(self.D[0, 0]))
        gap = {"real": direct, "size": abs(direct - math.sqrt(level))}.get(part, 0.0)
        far = self.norm + np.linalg.norm(self.B) * np.linalg.norm(self.C) / gap if gap else 0.0
        end = max(BEYOND * np.max([*np.abs(poles), *marks, 0.0]), min(far, FAR * self.norm))
        w = spread(poles, *marks, end=end or math.inf, top=self.border.frequency(math.inf))
        return from_0(w), True

    def signs(self, part: str, level: Any = 0) -> Signs:
        found = super().signs(part, level)
        if part == "real" and self.limit[0] < 0 and found.first * (-1) ** len(found.changes) > 0:
            w = self.grid(part, 0.0)[0]
            value, slack = self.at(w)
            sure = float(w[np.abs(np.real(value)) > slack].max(initial=0.0))
            return found._replace(changes=(*found.changes, sure))
        return found

    # --- the checks ---

    def dc(self) -> Any:
        value, slack = (np.ravel(x)[0] for x in self.at(np.zeros(1)))
        if slack < abs(value):
            return float(abs(value))
        away = np.abs(self.poles - (self.border.dt is not None))
        return math.inf if away.min(initial=math.inf) <= self.rounding else 0

    def closed(self, gain: float = 1.0) -> StateSystem:
        if gain * float(self.D[0, 0]) == -1:
            raise InputError(
                "L(s) is -1 as s grows, so that the closed loop L/(1 + L) is improper."
            )
        own = 1.0 / (1.0 + gain * float(self.D[0, 0]))
        A = self.A - self.B @ self.C * (gain * own)
        return StateSystem(A, self.B * own, -gain * self.C * own, np.array([[own]]), self.border)

    def plus(self, c: float) -> StateSystem:
        result = replace(self, D=self.D + c)
        vars(result).update({k: getattr(self, k) for k in ("poles", "triangular") if len(self.A)})
        return result

    @property
    def fits(self) -> bool:
        """With poles on the border; without, Re T >= 0 is enough."""
        return not self.on or (float(self.D[0, 0]) > -1 and not self.closed().right)

    @cached_property
    def limit(self) -> tuple[int, str]:
        if self.border.dt:  # the circle is closed: half the rate is a point like all others
            return 1, ""
        end, least = float(self.D[0, 0]), 0.0
        if not end:
            A = self.A + self.less * np.eye(len(self.A))
            least = EPS * float(np.linalg.norm(self.C) * np.linalg.norm(self.B) * self.norm)
            end = -float(np.real(self.C @ A @ self.B)[0, 0])
        power = "" if self.D.any() else "w^2 "
        said = f"{power}Re T(jw) tends to {end:.6g} as w grows"
        return int(end > least) - int(end < -least), said

    @cached_property
    def _real_grid(self) -> np.ndarray:
        return self.grid("real", 0.0)[0]

    def _is_real(self, less: Fraction) -> bool:
        """Whether Re T(s - less) is nowhere below 0 beyond rounding."""
        moved = replace(self, less=float(less))
        vars(moved).update(triangular=self.triangular)
        return moved.limit[0] >= 0 and moved.nowhere_below_0(self._real_grid)

    def margin(self) -> float:
        slowest = -float(self.beyond.max()) * (1 - 1e-12)
        return self.border.rate(float(last(self._is_real, Fraction(slowest), FEWER)))

    # --- the loop closed over T ---

    @property
    def open_at_infinity(self) -> bool:
        return abs(float(self.D[0, 0])) >= 1

    def _ends(self) -> list[tuple[float, complex, float]]:
        w = np.array([0.0] if self.border.dt is None else [0.0, self.border.frequency(math.inf)])
        value, slack = self.at(w)
        made = [*zip(w.tolist(), value, np.broadcast_to(slack, len(w)), strict=True)]
        return made if self.border.dt else [*made, (math.inf, complex(self.D[0, 0]), 0.0)]

    def ends(self) -> list[tuple[float, float]]:
        if self.D.size > 1:
            return [(math.inf, float(np.linalg.norm(self.D, 2)))] * (self.border.dt is None)
        return [(w, float(value.real)) for w, value, slack in self._ends() if slack < abs(value)]

    def known(self, factors: list[float]) -> float:
        """A beginning or an end of T that is 0 within rounding may be reached beyond it."""
        ends = [slack for _, value, slack in self._ends() if abs(value) <= slack]
        return min((1.0 / float(slack) for slack in ends if slack), default=math.inf)


@dataclass(frozen=True)
class MeasuredSystem(Followed):
    """T(jw) at frequencies w in rad/s; ``right``: its poles right of the axis, as declared."""

    w: np.ndarray
    values: np.ndarray
    right: float = 0
    meaning, base = "the L2 gain is at least {:.6g}", "T at the lowest frequency"
    alike, no_margin = 0.02, math.nan
    stable, least_stable = True, ""  # type: ignore[assignment]

    @property
    def basis(self) -> str:
        return (
            f", of {span(self.w)}; between and outside them, and on whether T is stable, it says "
            "nothing"
        )

    @cached_property
    def lines(self) -> tuple[np.ndarray, np.ndarray]:
        """log |T| and the phase in rad."""
        return np.log(np.maximum(np.abs(self.values), LEAST)), np.unwrap(np.angle(self.values))

    def scale(self, w: Any) -> Any:
        """Over what they are straight: log w, and w up to the first frequency above 0."""
        first = float(self.w[self.w > 0][0])
        return np.where(w < first, w / first - 1.0, np.log(np.maximum(w, first) / first))

    def at(self, w: Any) -> tuple[Any, Any]:
        size, phase = (np.interp(self.scale(w), self.scale(self.w), y) for y in self.lines)
        return np.exp(size + 1j * phase), 0.0

    def grid(self, part: str, level: float) -> tuple[np.ndarray, bool]:
        return self.w, True

    def signs(self, part: str, level: Any = 0) -> Signs:
        return super().signs(part, level)._replace(end=float(self.w[-1]))

    def dc(self) -> Any:
        return float(abs(self.values[0]))

    def largest(self) -> tuple[float, float]:
        k = int(np.argmax(np.abs(self.values)))
        return float(abs(self.values[k])), float(self.w[k])

    # --- the loop closed over T ---

    @property
    def beyond_band(self) -> Margin:
        """The factor on T up to which the last |T| stays below 1."""
        size = float(abs(self.values[-1]))
        return Margin(1.0 / size if size else math.inf, float(self.w[-1]))

    @property
    def integrators(self) -> int:
        """How many the slope at the lowest frequency shows."""
        if not self.w[0]:
            return 0
        size = self.lines[0]
        return max(round(float((size[0] - size[1]) / math.log(self.w[1] / self.w[0]))), 0)

    def ends(self) -> list[tuple[float, float]]:
        first = self.values[0]
        return [] if self.integrators else [(0.0, math.copysign(abs(first), first.real))]

    def known(self, factors: list[float]) -> float:
        """Beyond the band |T| may be as large as at its end."""
        return self.beyond_band.value

    def closed(self, gain: float = 1.0) -> MeasuredLoop:
        return MeasuredLoop(replace(self, values=gain * self.values))


@dataclass(frozen=True)
class MeasuredLoop(Followed):
    """c + 1/(1 + L) of a measured L, stable by Nyquist's criterion."""

    L: MeasuredSystem
    c: float = 0.0

    @property
    def basis(self) -> str:
        held = f"{self.L.right or 'no'} pole{'s' * (self.L.right != 1)}"
        return (
            f", of {span(self.L.w)}, if L has {held} right of the axis and no crossover beyond them"
        )

    @cached_property
    def right(self) -> float:
        """Nan where |L| ends above 1."""
        L, n = self.L, self.L.integrators
        first, end = 1.0 + L.values[[0, -1]]
        if abs(L.values[-1]) >= 1:
            return math.nan
        # From w = 0 the short way to the first point; at the last, 1 + L goes the short way to 1.
        along_0 = (-1j) ** n
        sign = 1 if ((first - 1.0) / along_0).real >= 0 else -1
        before = along_0 * sign if n else 1 + sign * abs(first - 1.0)
        _, angle, _ = turned(lambda w: 1.0 + L.at(w)[0], L.w)
        angle += float(np.angle(first / before) - np.angle(end))
        return round(L.right + n / 2 - angle / math.pi) if math.isfinite(angle) else math.nan

    def plus(self, c: float) -> MeasuredLoop:
        return replace(self, c=self.c + c)

    def at(self, w: np.ndarray) -> tuple[np.ndarray, Any]:
        with np.errstate(divide="ignore"):
            return self.c + 1.0 / (1.0 + self.L.at(w)[0]), 0.0

    def grid(self, part: str, level: float) -> tuple[np.ndarray, bool]:
        return np.unique(np.linspace(self.L.w[:-1], self.L.w[1:], BETWEEN + 1)), True

    def ends(self) -> list[tuple[float, float]]:
        return [(math.inf, self.c + 1.0)]


def system_of(T: Any, name: str = "T") -> Any:
    """T of one input and output; InputError, which calls it ``name``, for what the checks do not
    take."""
    if is_measured(T):
        return MeasuredSystem(*response(T, name))
    if isinstance(T, DelayedTransfer):
        return transfer_system(T, Border())
    if isinstance(T, ct.TransferFunction | ct.StateSpace):
        require_siso(T, name)
    if has_many_states(T):
        return StateSystem.of(T).shown()
    num, den = (Quasi.of([(0, p)]) for p in coefficients(T, name))
    return transfer_system(reduced(num, den), border_of(T))


def has_many_states(T: Any) -> bool:
    return isinstance(T, ct.StateSpace) and T.nstates > EXACT


def curve(source: Any, *marks: float) -> tuple[np.ndarray, np.ndarray]:
    """Frequencies in rad/s, ``marks`` among them, and T(jw), or T(exp(jw dt)) up to half the
    sampling rate, of anything that the checks take."""
    if source is None:
        raise InputError("this verdict was not made by a check, so there is nothing to draw.")
    if is_measured(source):
        return response(source)
    T: Any = source
    if not isinstance(T, DelayedTransfer | ct.TransferFunction | ct.StateSpace):
        T = ct.tf(*([float(c) for c in np.atleast_1d(part)] for part in source))
    border, late = border_of(T), 0.0
    end = top = NEAR * border.frequency(np.inf)
    with np.errstate(all="ignore"):
        if isinstance(T, DelayedTransfer):
            around, late = T.num.roots() + T.den.roots(), max(T.dead_times, default=0.0)
            end = max(DRAWN / late, *(3.0 * w for w in marks if w < np.inf)) if late else end
        else:
            around = border.rates(np.append(T.poles(), T.zeros()))
        w = spread(around, *marks, late=late, top=top, end=end)
        values = np.asarray(
            T(np.exp(1j * w * border.dt) if border.dt else 1j * w, warn_infinite=False)
        )
    if values.ndim == 3:  # of several channels the largest singular value
        values = np.linalg.norm(np.moveaxis(values, -1, 0), 2, axis=(1, 2))
    return w, np.ravel(values)


def curve_name(source: Any, of: str = "T") -> str:
    """What is drawn: "T(jw)", or "T(exp(jw dt))" of a sampled system."""
    return f"{of}(exp(jw dt))" if is_sampled(source) else f"{of}(jw)"


def curve_size(source: Any) -> str:
    """The name of its size, of several channels that of the largest singular value."""
    if getattr(source, "ninputs", 1) * getattr(source, "noutputs", 1) == 1:
        return f"|{curve_name(source)}|"
    return f"largest singular value of {curve_name(source)}"
