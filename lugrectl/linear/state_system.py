"""State-space systems in floating point: exact arithmetic takes minutes at 30 states.

A is made triangular once. T(jw), or T(exp(jw dt)), is then found at many frequencies at once, with
what rounding of the matrices may change of it.
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
from scipy.linalg import matrix_balance, schur, solve_sylvester

from ..core.errors import InputError
from .system import BEYOND, FEWER, Followed, Signs, from_0, last, spread, with_extremes
from .transfer import EPS, Border, border_of, state_space_polynomials

LARGEST = 1e140  # its square, and that of its inverse, are floats
EXACT = 16  # states up to which stability is decided in exact arithmetic: some seconds
UNSEEN = 1e-13  # of its inputs and outputs: a mode of less does not show, by rounding
MANY = 1e3  # rounding of the matrices moves a pole by up to this times EPS
FAR = 1e6  # times the norm of A: no frequency is beyond it


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
        near = self.poles[(np.abs(self.beyond) <= self.rounding) & (self.poles.imag >= 0)]
        return np.abs(np.imag(self.border.rates(near))).tolist()

    @cached_property
    def stable(self) -> bool | None:
        """Whether every pole is, exactly where rounding hides it; None where this takes long."""
        if not (self.right or self.on):
            return True
        if self.right:
            return False
        if len(self.A) > EXACT:
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
            return ct.ss(self.A, self.B, self.C, self.D, remove_useless_states=False).zeros()

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
            sure = float(w[np.abs(value.real) > slack].max(initial=0.0))
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
        with np.errstate(all="ignore"):
            _, value, slack = with_extremes(lambda w: moved.part(w, "real", 0.0), self._real_grid)
        return moved.limit[0] >= 0 and not (value < -slack).any()

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
