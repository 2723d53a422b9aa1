"""State-space systems in floating point, at the cost of a few eigenvalue problems.

Between neighbouring zeros of T(s) + T(-s), or of |T|^2 - c, on the imaginary axis nothing changes
its sign: a point in each gap decides, with what rounding of the matrices may change there. The
H-infinity norm: a frequency with a singular value equal to a level g is a zero of
g^2 I - T(-s)^T T(s) on the axis (Boyd, Balakrishnan and Kabamba 1989). From the largest value that
is known, the zeros of the next higher level and the points between them give a larger one, or none
(Bruinsma and Steinbuch 1990). Times grow with the third power of the order; exact arithmetic takes
minutes at 30 states. T(z) is evaluated on the circle, with the matrices as they are; its zeros are
those of the same function of v (:mod:`border`).
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property
from itertools import pairwise
from typing import Any, NamedTuple

import control as ct
import numpy as np
from scipy.linalg import eig, get_lapack_funcs, matrix_balance, schur, solve_sylvester
from scipy.optimize import brentq, minimize_scalar

from ..core.errors import InputError
from .border import Axis, border_of
from .transfer import EPS, state_space_polynomials
from .verdict import Falls, NoGain, Realness

SHARP = 1e-6  # relative distance of the two sides of an edge that counts as none
HALVINGS = 40
LARGEST = 1e140  # its square, and that of its inverse, are floats
RISE = 1e-11  # of the largest value: the next level is higher by this
LEVELS = 60
EXACT = 16  # states up to which stability is decided in exact arithmetic: some seconds
OFF = 1e-2  # of its size: further off the axis, rounding has not moved a zero from it
UNSEEN = 1e-13  # of its inputs and outputs: a mode of less does not show, by rounding
UNDECIDED = "whether the system is stable is within rounding"
MANY = 1e3  # rounding of the matrices moves a pole by up to this times EPS
BESIDE = np.array([-2.0, -1.0, -0.5, -0.2, 0.2, 0.5, 1.0, 2.0])  # widths from a pole
AT_BORDER = "within rounding on the border of stability"
AT_HALF = 1e-13  # a pole this near to z = -1 is moved inside by this
FAR = 700.0  # samples^-1: the margin of a pole at z = 0 is searched up to this
SINGLE = 1e-9  # relative distance of two candidates that count as one
NEAREST, FURTHER = 1e-13, 2.0  # of an edge: the first point beside it, and the next ones

Function = Callable[[float], tuple[float, float]]  # value and rounding bound at a frequency


class Edge(NamedTuple):
    """A change of sign at ``at``; at ``low`` and ``high``, beside it, the sign is sure."""

    at: float
    low: float
    high: float

    @property
    def sharp(self) -> bool:
        return math.isfinite(self.high) and self.high - self.low <= SHARP * self.high

    @property
    def first(self) -> float:
        """Up to where nothing changes: the edge, or the last sure point before a blurred one."""
        return self.at if self.sharp else self.low

    def __str__(self) -> str:
        if self.sharp:
            return f"{self.at:.6g}"
        return f"(between {self.low:.9g} and {self.high:.9g}: rounding decides)"


@dataclass(frozen=True)
class SureSigns:
    """The signs ``above`` at the points ``at``, where the value exceeds its rounding bound, and the
    ``edges`` between; ``touches``: where it is 0 within rounding between points of one sign, or at
    an end."""

    at: np.ndarray
    above: np.ndarray
    edges: tuple[Edge, ...]
    touches: tuple[Edge, ...] = ()

    @classmethod
    def of(cls, function: Function, points: Any, values: Any = None) -> SureSigns:
        """``points`` (n,) ascend; ``values`` (n, 2) are those there, where they are known."""
        made = np.array([function(x) for x in points] if values is None else values)
        x, sure = np.asarray(points), np.flatnonzero(np.abs(made[:, 0]) > made[:, 1])
        at, above = x[sure], made[sure, 0] > 0
        turns = np.flatnonzero(above[1:] != above[:-1])
        edges = tuple(edge(function, *at[k : k + 2].tolist()) for k in turns)
        return cls(at, above, edges, tuple(_touches(function, x, sure, above)))

    def below_beyond(self) -> SureSigns:
        """The same of a function that is below 0 as the frequency grows without end."""
        if len(self.above) and not self.above[-1]:
            return self
        last = float(self.at[-1]) if len(self.at) else 0.0
        edges = (*self.edges, Edge(last, last, math.inf)) if len(self.at) else ()
        at, above = np.append(self.at, math.inf), np.append(self.above, False)
        return SureSigns(at, above, edges, self.touches)


def _touches(
    function: Function, x: np.ndarray, sure: np.ndarray, above: np.ndarray
) -> Iterator[Edge]:
    """The stretches of points without a sure sign, not those in which it changes."""
    ends = [-1, *sure.tolist(), len(x)]
    for i, (k, m) in enumerate(pairwise(ends)):
        inner = 0 < i < len(sure)
        if m == k + 1 or (inner and above[i] != above[i - 1]):
            continue
        low, high = float(x[k + 1]), float(x[m - 1])
        at = 0.5 * (low + high)
        low = beside(function, low, float(x[k])) if k >= 0 else low
        yield Edge(at, low, beside(function, high, float(x[m])) if m < len(x) else high)


def edge(function: Function, a: float, b: float) -> Edge:
    """The change of sign between two points with different, sure signs."""
    found: Any = brentq(lambda x: function(x)[0], a, b, xtol=1e-300, rtol=np.float64(1e-13))
    at = float(found)
    return Edge(at, beside(function, at, a), beside(function, at, b))


def beside(function: Function, at: float, end: float) -> float:
    """The nearest point on the way from an edge to ``end`` that has, surely, the sign there."""
    sign = math.copysign(1.0, function(end)[0])
    step = NEAREST * (abs(at) or abs(end))
    while step < abs(end - at):
        x = at + math.copysign(step, end - at)
        value, slack = function(x)
        if sign * value > slack:
            return x
        step *= FURTHER
    return end


def last_that_holds(holds: Callable[[float], bool], high: float) -> float:
    """The largest value up to ``high`` for which it holds, as for all smaller ones; bisection."""
    if holds(high * (1 - 1e-12)):
        return high
    low = 0.0
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if holds(middle) else (low, middle)
    return low


_trtrs: Any = get_lapack_funcs("trtrs", dtype=complex)  # without the checks of solve_triangular


def solve_shifted(
    S: np.ndarray, b: np.ndarray, s: complex, transposed: bool = False
) -> np.ndarray | None:
    """(s I - S)^-1 b of an upper triangle S, or of its transpose; None where that is singular."""
    M = -S
    np.fill_diagonal(M, M.diagonal() + s)
    found, singular = _trtrs(M, b, trans=int(transposed))
    return None if singular else found


def zeros_of(A: np.ndarray, B: np.ndarray, C: np.ndarray, D: Any) -> np.ndarray:
    """The finite zeros of a system with as many inputs as outputs."""
    scale = math.sqrt(max(np.linalg.norm(B), 1e-300) / max(np.linalg.norm(C), 1e-300))
    left = np.block([[A, B / scale], [C * scale, np.atleast_2d(D)]])
    right = np.diag([*np.ones(len(A)), *np.zeros(len(C))])
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")
        pairs: Any = eig(left, right, right=False, homogeneous_eigvals=True)
        alpha, beta = pairs
        return (alpha / beta)[np.abs(beta) > 1e-14 * np.abs(alpha).max()]


@dataclass(frozen=True)
class StateSystem:
    """T = C (sI - A)^-1 B + D, or of z, with any number of channels.

    ``shift``: T(s - shift), or T(exp(-shift) z), instead. ``unseen``: modes that are not stable and
    were taken out, as they do not show in T; ``lost``: whether one is so beyond rounding. Places
    on the border are v, jv = s.
    """

    A: np.ndarray
    B: np.ndarray
    C: np.ndarray
    D: np.ndarray
    border: Axis = Axis()
    shift: float = 0.0
    unseen: tuple[complex, ...] = ()
    lost: bool = False
    meaning, said = "||y||_2 <= {:.6g} ||u||_2 from rest", ""

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
        """The least stable first, without the shift."""
        return self.border.order(np.linalg.eigvals(self.A) if len(self.A) else np.zeros(0))

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
    def surely_stable(self) -> bool:
        """Whether every pole is stable by more than rounding."""
        return bool((self.beyond < -self.rounding).all())

    @cached_property
    def stable(self) -> bool | None:
        """Whether every pole is, exactly where rounding hides it; None where this takes long."""
        if self.surely_stable:
            return True
        if self.beyond.max() > self.rounding:
            return False
        if len(self.A) > EXACT:
            return None
        _, den = state_space_polynomials(ct.ss(self.A, self.B, self.C, self.D))
        return self.border.stable(den)

    @property
    def seen(self) -> str:
        return self.border.show(self.poles)

    @property
    def hidden(self) -> str:
        """A remark on the modes that do not show; empty without one."""
        if not self.unseen:
            return ""
        return (
            f"a mode of the system that is not stable ({self.border.modes(self.unseen)}) does not "
            "show in T, within rounding: the system itself is not stable"
        )

    def shown(self) -> StateSystem:
        """The same without modes that are not stable and do not show."""
        if self.surely_stable:
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
        poles = self.border.order(np.diag(A2))
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

    def at(self, v: float) -> tuple[complex, float]:
        """T of one channel at jv, and what rounding of the matrices may change of it."""
        (S, B, C), D = self.triangular, float(self.D[0, 0])
        s = self.border.point(v, self.shift)
        if math.isinf(abs(s)):
            return complex(D), 0.0
        b, c = B[:, 0], C[0]
        right, left = solve_shifted(S, b, s), solve_shifted(S, c, s, transposed=True)
        if right is None or left is None:
            return complex(math.nan), math.inf
        reach = float(np.linalg.norm(left) * np.linalg.norm(right))
        size = float(np.linalg.norm(c) * np.linalg.norm(right)) + abs(D)
        return complex(c @ right) + D, EPS * ((self.norm + abs(s)) * reach + size)

    def real_part(self, v: float) -> tuple[float, float]:
        t, slack = self.at(v)
        return t.real, slack

    def _states(self, v: float) -> np.ndarray:
        """C (sI - A)^-1 B at jv."""
        s = self.border.point(v)
        if math.isinf(abs(s)):
            return np.zeros(self.D.shape)
        S, B, C = self.triangular
        right = solve_shifted(S, B, s)
        if right is None:
            raise np.linalg.LinAlgError("singular matrix")
        return C @ right

    def size_at(self, v: float) -> float:
        return _norm(self.D + self._states(v)) if len(self.A) else _norm(self.D)

    # --- where something may change ---

    @cached_property
    def continuous(self) -> StateSystem:
        """The system, its shift apart, or the one in v with the same values."""
        if self.border.dt is None:
            return self
        grow, eye = math.exp(self.shift), np.eye(len(self.A))
        A, B, C = self.A * grow, self.B, self.C * grow
        if np.abs(np.linalg.eigvals(A) + 1).min(initial=1.0) < AT_HALF:  # v is infinite there
            A = A * (1 - AT_HALF)
        inverse, root = np.linalg.inv(A + eye), math.sqrt(2)
        D = self.D - C @ inverse @ B
        return StateSystem(inverse @ (A - eye), root * inverse @ B, root * C @ inverse, D)

    def mirrored_zeros(self, sign: float) -> np.ndarray:
        """The zeros of T(s) + sign T(-s); among those with sign -1, where T(jw) is real."""
        of = self.continuous
        A = of.A + of.shift * np.eye(len(of.A))
        zero = np.zeros_like(A)
        return zeros_of(
            np.block([[A, zero], [zero, -A.T]]),
            np.vstack([of.B, of.C.T]),
            np.hstack([of.C, -sign * of.B.T]),
            (1.0 + sign) * of.D,
        )

    def level_zeros(self, square: float) -> np.ndarray:
        """The zeros of T(s)^T T(-s) - square I."""
        of = self.continuous
        A, B, C, D = of.A, of.B, of.C, of.D
        return zeros_of(
            np.block([[A, np.zeros_like(A)], [-C.conj().T @ C, -A.conj().T]]),
            np.vstack([B, -C.conj().T @ D]),
            np.hstack([D.conj().T @ C, B.conj().T]),
            D.conj().T @ D - square * np.eye(B.shape[1]),
        )

    def places(self, zeros: np.ndarray) -> np.ndarray:
        """0, the places of zeros and poles, points between them and beyond."""
        found = between(np.concatenate([zeros, self.border.marks(self.poles)]))
        return found if self.border.dt is None else np.append(found, math.inf)

    def signs(self, function: Function, points: np.ndarray, values: Any = None) -> SureSigns:
        """The signs of a function of v, and where they change, in rad/s."""
        w = [self.border.frequency(v) for v in points]
        return SureSigns.of(lambda x: function(self.border.place(x)), w, values)

    # --- the checks ---

    def falls(self, power: Fraction) -> Falls:
        """Where |T|^2 crosses ``power`` times its value at w = 0, as far as rounding can tell."""
        dc, slack = self.at(0.0)
        if not slack < abs(dc):  # nan too
            integrates = np.abs(self.border.marks(self.poles)).min() <= self.rounding
            return Falls(math.inf if integrates else 0.0, said=" within rounding")
        square = float(power) * abs(dc) ** 2

        def above(v: float) -> tuple[float, float]:
            t, rounding = self.at(v)
            size = abs(t) ** 2 / square
            share = rounding / max(abs(t), rounding) + slack / abs(dc)
            return size - 1.0, 2 * size * share + EPS

        signs = self.signs(above, self.places(self.level_zeros(square)))
        first = min([*signs.edges[:1], *signs.touches[:1]], key=lambda e: e.low, default=None)
        width, said = first.first if first else math.inf, ""
        if first and (first in signs.touches or not first.sharp):
            said = f", or up to {first.high:.6g} rad/s: rounding decides"
        return Falls(abs(dc), tuple(e.first for e in signs.edges), width, said)

    def no_gain(self) -> NoGain | None:
        if self.stable and not self.lost:
            return None
        said = UNDECIDED if not self.lost and self.stable is None else "the system is not stable"
        least_stable = self.unseen[0] if self.lost else self.poles[0]
        upper = complex(least_stable.real, abs(least_stable.imag))
        shown = self.border.show([upper]).removeprefix("poles ")
        return NoGain(f"{said}: its {self.border.least} pole is {shown}")

    @property
    def size(self) -> str:
        """What the gain is the largest value of."""
        return "|T|" if self.D.size == 1 else "the largest singular value of T"

    @cached_property
    def _sweep(self) -> tuple[np.ndarray, list[np.ndarray]]:
        """Points at, between and within a few widths of the poles; C (sI - A)^-1 B there."""
        # a level far from the top has its zeros off the axis by more than such a width
        rates = self.border.rates(self.poles)
        w, width = np.imag(rates), np.abs(np.real(rates))
        sharp = (width > 0) & (width < 10 * w)
        near = self.border.place((w[sharp, None] + width[sharp, None] * BESIDE).ravel())
        places = np.unique([*between(self.continuous.poles), *near[near > 0]])
        return places, [self._states(x) for x in places]

    @cached_property
    def sensitivity(self) -> StateSystem:
        """1/(1 + T)."""
        own = 1.0 / (1.0 + float(self.D[0, 0]))
        A = self.A - self.B @ self.C * own
        return StateSystem(A, self.B * own, -self.C * own, np.array([[own]]), self.border)

    def plus(self, D: float) -> StateSystem:
        """The same with another direct term; what is known of A serves both."""
        result = replace(self, D=self.D + D)
        known = ("poles", "triangular", "_sweep")
        vars(result).update({name: getattr(self, name) for name in known if len(self.A)})
        return result

    def largest(self) -> tuple[float, float]:
        best, v = self._best(np.array([0.0, math.inf]))
        if len(self.A):
            places, states = self._sweep
            k = int(np.argmax([_norm(self.D + x) for x in states]))
            about = places[[k, max(k - 1, 0), min(k + 1, len(places) - 1)]]
            best, v = max((best, v), self._top(*about))
        for _ in range(LEVELS if len(self.A) and best > 0 else 0):
            zeros: Any = self.level_zeros((best * (1 + RISE)) ** 2)
            near = zeros[np.abs(zeros.real) <= OFF * np.abs(zeros)]
            found, at = self._best(between(near))
            if found <= best * (1 + RISE):
                break
            best, v = found, at
        if 0 < v < math.inf:
            best, v = self._top(v, v * (1 - 1e-4), v * (1 + 1e-4))
        return best, self.border.frequency(v)

    def _best(self, places: np.ndarray) -> tuple[float, float]:
        values = [self.size_at(v) for v in places]
        k = int(np.argmax(values))
        return values[k], float(places[k])

    def _top(self, v: float, low: float, high: float) -> tuple[float, float]:
        """The largest value at v, or at the top of a peak between two places about it."""
        sharp = {"xatol": 1e-12 * v}
        found: Any = minimize_scalar(
            lambda x: -self.size_at(x), bounds=(low, high), method="bounded", options=sharp
        )
        return max((self.size_at(v), float(v)), (-float(found.fun), float(found.x)))

    # --- realness ---

    def realness(self) -> Realness:
        found = self._realness()
        hidden = f"; {self.hidden}" if self.hidden else ""
        return found._replace(reason=f"{found.reason} (decided in floating point){hidden}")

    def _realness(self) -> Realness:
        v = self.places(self.mirrored_zeros(1.0))
        values = np.array([self.real_part(x) for x in v])
        end, least = self.at_infinity()
        signs = self.signs(self.real_part, v, values)
        if end < -least:
            signs = signs.below_beyond()
        touch = next((zone for zone in signs.touches if zone.low > 0), None)
        below, why = self._first_below(signs, touch)
        name = self.border.real
        if (over := self.beyond > self.rounding).any():
            poles = f"T has poles {self.border.outside} ({self.border.show(self.poles[over])})"
            blur = f"{name} is 0 within rounding at {touch} rad/s" if touch else ""
            return Realness("not PR", "; ".join(filter(None, [poles, why or blur])), below)
        if why:
            return Realness("not PR", why, below)
        if self.beyond.max() > -self.rounding:
            return self._on_the_border()
        if signs.touches:
            w = signs.touches[0].at if touch is None else touch.at
            reason = f"{name} >= 0, but it is 0 at w = {w:.6g} rad/s within rounding"
            return Realness("PR", reason, touch.first if touch else math.inf, rounded=True)
        if end <= least:
            reason = f"{name} > 0 at every finite w, but {self._limit(end)} within rounding"
            return Realness("WSPR", reason)
        where, tail = self.border.least_stable(self.poles[0]), f" and {self._limit(end)}"
        if self.border.dt:
            k = int(np.argmin(values[:, 0]))
            w = self.border.frequency(v[k])
            tail = f", about {values[k, 0]:.6g} at w = {w:.6g} rad/s"
        return Realness("SPR", f"{where}, {name} > 0 at every w{tail}", margin=self.margin())

    def _on_the_border(self) -> Realness:
        """With poles that are, within rounding, neither stable nor unstable."""
        at = self.border.show(self.poles[self.beyond > -self.rounding])
        S = self.sensitivity if self.D[0, 0] > -1 else None
        if S is None or (S.beyond > S.rounding).any():  # n + d is not Hurwitz
            why = f"a pole is repeated or its residue is not positive where T has one, at {at}"
            return Realness("not PR", f"{why}, {AT_BORDER}")
        return Realness("PR", f"{self.border.real} >= 0, with poles, {AT_BORDER}: {at}")

    def _first_below(self, signs: SureSigns, touch: Edge | None) -> tuple[float, str]:
        """Up to where Re T > 0 in rad/s, and the first band with Re T < 0 in words, if any;
        ``touch``: where Re T is first 0 within rounding, w = 0 apart."""
        if signs.above.all():
            return touch.first if touch else math.inf, ""
        ends = signs.edges if signs.above[0] else (Edge(0.0, 0.0, 0.0), *signs.edges)
        low, high, later = ends[0], ends[1] if len(ends) > 1 else None, (len(ends) - 1) // 2
        said = f"{self.border.real} < 0 for w > {low} rad/s"
        last = self.border.frequency(math.inf)
        if high is not None or math.isfinite(last):
            more = f" and at {later} higher places" if later else ""
            said = f"{self.border.real} < 0 for {low} < w < {high or f'{last:.6g}'} rad/s{more}"
        if signs.touches and not signs.touches[0].low:
            said += f"; below {signs.touches[0].high:.6g} rad/s rounding decides on its sign"
        if touch is None or touch.low > low.first:
            return low.first, said
        return touch.first, f"{said}; before it, it is 0 within rounding at {touch} rad/s"

    def at_infinity(self) -> tuple[float, float]:
        """The limit of Re T(jw), or without D of w^2 Re T(jw), and what rounding may change."""
        if self.border.dt:  # the circle is closed: half the rate is a point like all others
            return math.inf, 0.0
        if D := float(self.D[0, 0]):
            return D, 0.0
        A = self.A + self.shift * np.eye(len(self.A))
        sizes = np.linalg.norm(self.C) * np.linalg.norm(self.B) * self.norm
        return -float(np.real(self.C @ A @ self.B)[0, 0]), EPS * float(sizes)

    def _limit(self, end: float) -> str:
        power = "" if self.D.any() else "w^2 "
        return f"{power}{self.border.real} tends to {end:.6g} as w grows"

    def margin(self) -> float:

        def is_real(eps: float) -> bool:
            """Whether Re T(s - eps) is nowhere below 0 beyond rounding."""
            moved = replace(self, shift=eps)
            vars(moved).update(triangular=self.triangular, poles=self.poles)
            end, least = moved.at_infinity()
            values = map(moved.at, moved.places(moved.mirrored_zeros(1.0)))
            return end >= -least and all(t.real >= -slack for t, slack in values)

        dt = self.border.dt or 1.0
        high = -dt * float(np.real(self.border.rates(self.poles)).max())
        high = high if math.isfinite(high) else FAR
        return last_that_holds(is_real, high) / dt


def between(marks: np.ndarray) -> np.ndarray:
    """0, the frequencies of roots, and points between and beyond them."""
    marks = np.concatenate([np.abs(marks), np.abs(np.imag(marks))])
    marks = np.sort(marks[np.isfinite(marks) & (marks > 0)])
    marks = marks[np.append(True, np.diff(marks) > SINGLE * marks[1:])] if len(marks) else marks
    if not len(marks):
        return np.array([0.0, 1.0])
    ends = [0.0, 0.1 * marks[0], 10 * marks[-1]]
    return np.sort(np.concatenate([ends, marks, np.sqrt(marks[1:] * marks[:-1])]))


def _norm(M: np.ndarray) -> float:
    return float(abs(M[0, 0])) if M.size == 1 else float(np.linalg.norm(M, 2))
