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
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property
from typing import Any

import control as ct
import numpy as np
from scipy.linalg import eig, get_lapack_funcs, matrix_balance, schur, solve_sylvester
from scipy.optimize import minimize_scalar

from ..core.display import show_poles
from ..core.errors import InputError
from .border import Border, border_of
from .system import FEWER, Edge, Signs, System, last
from .transfer import EPS, state_space_polynomials

LARGEST = 1e140  # its square, and that of its inverse, are floats
RISE = 1e-11  # of the largest value: the next level is higher by this
LEVELS = 60
EXACT = 16  # states up to which stability is decided in exact arithmetic: some seconds
OFF = 1e-2  # of its size: further off the axis, rounding has not moved a zero from it
UNSEEN = 1e-13  # of its inputs and outputs: a mode of less does not show, by rounding
MANY = 1e3  # rounding of the matrices moves a pole by up to this times EPS
BESIDE = np.array([-2.0, -1.0, -0.5, -0.2, 0.2, 0.5, 1.0, 2.0])  # widths from a pole
AT_HALF = 1e-13  # a pole this near to z = -1 is moved inside by this
SINGLE = 1e-9  # relative distance of two candidates that count as one

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
class StateSystem(System):
    """T = C (sI - A)^-1 B + D, or of z, with any number of channels.

    ``less``: T(s - less), or T((1 - less) z), instead. ``unseen``: modes that are not stable and
    were taken out, as they do not show in T; ``lost``: whether one is so beyond rounding. Places
    on the border are v, jv = s.
    """

    A: np.ndarray
    B: np.ndarray
    C: np.ndarray
    D: np.ndarray
    border: Border = Border()
    less: float = 0.0
    unseen: tuple[complex, ...] = ()
    lost: bool = False
    basis = " (decided in floating point, within its rounding)"

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
        modes = self.border.show(self.unseen, "s = ")
        return (
            f"a mode of the system that is not stable ({modes}) does not show in T, within "
            "rounding: the system itself is not stable"
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

    def at(self, v: float) -> tuple[complex, float]:
        """T of one channel at jv, and what rounding of the matrices may change of it."""
        (S, B, C), D = self.triangular, float(self.D[0, 0])
        s = self.border.point(v, self.less)
        if math.isinf(abs(s)):
            return complex(D), 0.0
        b, c = B[:, 0], C[0]
        right, left = solve_shifted(S, b, s), solve_shifted(S, c, s, transposed=True)
        if right is None or left is None:
            return complex(math.nan), math.inf
        reach = float(np.linalg.norm(left) * np.linalg.norm(right))
        size = float(np.linalg.norm(c) * np.linalg.norm(right)) + abs(D)
        return complex(c @ right) + D, EPS * ((self.norm + abs(s)) * reach + size)

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
        """The system, ``less`` apart, or the one in v with the same values."""
        if self.border.dt is None:
            return self
        grow, eye = 1.0 / (1.0 - self.less), np.eye(len(self.A))
        A, B, C = self.A * grow, self.B, self.C * grow
        if np.abs(np.linalg.eigvals(A) + 1).min(initial=1.0) < AT_HALF:  # v is infinite there
            A = A * (1 - AT_HALF)
        inverse, root = np.linalg.inv(A + eye), math.sqrt(2)
        D = self.D - C @ inverse @ B
        return StateSystem(inverse @ (A - eye), root * inverse @ B, root * C @ inverse, D)

    def mirrored_zeros(self, part: str) -> np.ndarray:
        """The zeros of T(s) + T(-s) ("real"), or of T(s) - T(-s) ("imag")."""
        of, sign = self.continuous, 1.0 if part == "real" else -1.0
        A = of.A + of.less * np.eye(len(of.A))
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

    def signs(self, part: str, level: Any = 0, doubt: float = 0.0) -> Signs:
        size = part == "size"
        zeros = self.level_zeros(float(level)) if size else self.mirrored_zeros(part)

        def function(w: float) -> tuple[float, float]:
            t, slack = self.at(self.border.place(w))
            if not size:
                return getattr(t, part), slack
            above, share = abs(t) ** 2 / float(level), slack / max(abs(t), slack) + doubt
            return above - 1.0, 2.0 * above * share + EPS

        w = [self.border.frequency(v) for v in self.places(zeros)]
        found = Signs.of(function, w)
        if part == "real" and self.limit[0] < 0 and found.first * (-1) ** len(found.edges) > 0:
            sure = max((x for x in w if abs(function(x)[0]) > function(x)[1]), default=0.0)
            return found._replace(edges=(*found.edges, Edge(sure, sure, math.inf)))
        return found

    # --- the checks ---

    def dc(self) -> tuple[Any, float]:
        value, slack = self.at(0.0)
        if slack < abs(value):
            return abs(value), slack / abs(value)
        return math.inf if np.abs(self.border.marks(self.poles)).min() <= self.rounding else 0, 0.0

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

    def closed(self, gain: float = 1.0) -> StateSystem:
        """1/(1 + gain T)."""
        if gain * float(self.D[0, 0]) == -1:
            raise InputError(
                "L(s) is -1 as s grows, so that the closed loop L/(1 + L) is improper."
            )
        own = 1.0 / (1.0 + gain * float(self.D[0, 0]))
        A = self.A - self.B @ self.C * (gain * own)
        return StateSystem(A, self.B * own, -gain * self.C * own, np.array([[own]]), self.border)

    def plus(self, c: float) -> StateSystem:
        """The same with another direct term; what is known of A serves both."""
        result = replace(self, D=self.D + c)
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

    @property
    def right(self) -> float:
        return int((self.beyond > self.rounding).sum())

    @property
    def outside(self) -> str:
        over = self.poles[self.beyond > self.rounding]
        return f"poles {self.border.outside} ({self.border.show(over)})" if len(over) else ""

    @property
    def on_border(self) -> str:
        on = self.poles[np.abs(self.beyond) <= self.rounding]
        at = f"within rounding on the border of stability ({self.border.show(on)})"
        return at if len(on) else ""

    @property
    def fits(self) -> bool:
        """With poles on the border; without, Re T >= 0 is enough."""
        return not self.on_border or (float(self.D[0, 0]) > -1 and not self.closed().right)

    @property
    def trouble(self) -> str:
        upper = [p for p in self.poles[self.beyond >= -self.rounding] if p.imag >= 0]
        where = self.border.outside
        where += "" if self.right else " or, within rounding, on its border"
        return f"poles {where} ({show_poles(upper)}), found in floating point" if upper else ""

    @property
    def least_stable(self) -> str:
        return self.border.least_stable(self.poles[0])

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

    def _is_real(self, less: Fraction) -> bool:
        """Whether Re T(s - less) is nowhere below 0 beyond rounding."""
        moved = replace(self, less=float(less))
        vars(moved).update(triangular=self.triangular, poles=self.poles)
        values = map(moved.at, moved.places(moved.mirrored_zeros("real")))
        return moved.limit[0] >= 0 and all(t.real >= -slack for t, slack in values)

    def margin(self) -> float:
        slowest = -float(self.beyond.max()) * (1 - 1e-12)
        return self.border.rate(float(last(self._is_real, Fraction(slowest), FEWER)))

    # --- the loop closed over T ---

    @property
    def open_at_infinity(self) -> bool:
        return abs(float(self.D[0, 0])) >= 1

    def ends(self) -> list[tuple[float, float]]:
        there = [(self.border.frequency(v), *self.at(v)) for v in (0.0, math.inf)]
        return [(w, value.real) for w, value, slack in there if slack < abs(value)]

    def known(self, factors: list[float]) -> float:
        """A beginning or an end of T that is 0 within rounding may be reached beyond it."""
        ends = [slack for value, slack in map(self.at, (0.0, math.inf)) if abs(value) <= slack]
        return min((1.0 / float(slack) for slack in ends if slack), default=math.inf)


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
