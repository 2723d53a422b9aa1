"""The H-infinity norm of a state-space model, in floating point, without slycot.

A frequency with a singular value equal to a level g is a zero of g^2 I - T(-s)^T T(s) on the
imaginary axis (Boyd, Balakrishnan and Kabamba 1989). From the largest value that is known, the
zeros of the next higher level and the points between them give a larger one, or none (Bruinsma
and Steinbuch 1990): a few eigenvalue problems, each of the third power of the order. A sampled
T(z) is evaluated on the circle; its zeros are those of the same function of v, with
z = (1 + v)/(1 - v).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import control as ct
import numpy as np
from scipy.linalg import schur, solve_sylvester
from scipy.optimize import minimize_scalar

from .exact import hurwitz
from .pencil import EPS, balanced, level_zeros, solve_shifted
from .sampled import inside, is_sampled, mapped_states, on_circle, sample_time
from .transfer import state_space_polynomials
from .verdict import show_poles

RISE = 1e-11  # of the largest value: the next level is higher by this
LEVELS = 60
EXACT = 16  # states up to which stability is decided in exact arithmetic: some seconds
OFF = 1e-2  # of its size: further off the axis, rounding has not moved a zero from it
UNSEEN = 1e-13  # of its inputs and outputs: a mode of less does not show, by rounding
UNKNOWN = "whether the system is stable is within rounding"
MANY = 1e3  # rounding of the matrices moves a pole by up to this times EPS
BESIDE = np.array([-2.0, -1.0, -0.5, -0.2, 0.2, 0.5, 1.0, 2.0])  # widths from a pole


@dataclass(frozen=True)
class StateResponse:
    """T(s) = C (sI - A)^-1 B + D, or T(z) where ``dt`` is given; any number of channels."""

    A: np.ndarray
    B: np.ndarray
    C: np.ndarray
    D: np.ndarray
    dt: float | None = None

    @classmethod
    def of(cls, T: Any) -> StateResponse:
        """Raises InputError for values that are not finite."""
        A, B, C, D = balanced(*(np.asarray(M, dtype=float) for M in (T.A, T.B, T.C, T.D)))
        return cls(A, B, C, D, sample_time(T) if is_sampled(T) else None)

    @property
    def size(self) -> str:
        """What the norm is the largest value of."""
        return "|T|" if self.D.size == 1 else "the largest singular value of T"

    @cached_property
    def poles(self) -> np.ndarray:
        return np.linalg.eigvals(self.A) if len(self.A) else np.zeros(0)

    @property
    def rounding(self) -> float:
        """How far rounding of the matrices may move a pole."""
        return MANY * EPS * max(float(np.linalg.norm(self.A)), 0.0 if self.dt is None else 1.0)

    def beyond(self, poles: np.ndarray) -> np.ndarray:
        """How far right of the axis, or outside the circle, poles are."""
        return np.real(poles) if self.dt is None else np.abs(poles) - 1

    def settled(self) -> bool | None:
        """Whether it is stable, exactly where rounding of the poles hides it; None: not known."""
        if self.beyond(self.poles).max() > self.rounding:
            return False
        if len(self.A) > EXACT:
            return None
        _, den = state_space_polynomials(ct.ss(self.A, self.B, self.C, self.D))
        return hurwitz(den) if self.dt is None else inside(den)

    @property
    def stable(self) -> bool:
        """Whether every pole is stable by more than rounding."""
        return bool((self.beyond(self.poles) < -self.rounding).all())

    def split(self) -> tuple[StateResponse, np.ndarray]:
        """The stable part, and the poles that are not stable but do not show in T.

        Without such a part (a pole that is not stable shows), the system itself and no poles.
        """
        found: Any = schur(self.A, output="complex", sort=self._is_stable)
        S, Q, many = found
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
            return self, np.zeros(0)
        return StateResponse(A1, B1, C1, self.D, self.dt), np.diag(A2)

    def _is_stable(self, pole: Any) -> bool:
        return bool(self.beyond(np.asarray(pole)) < -self.rounding)

    @property
    def rightmost(self) -> str:
        """The pole that is least stable, in words."""
        if self.dt is None:
            pole = self.poles[np.argmax(np.real(self.poles))]
            return f"its rightmost pole is {show_poles([_upper(pole)])} 1/s"
        return f"its largest pole is z = {show_poles([_upper(max(self.poles, key=abs))])}"

    def says_hidden(self, poles: np.ndarray) -> str:
        """A remark on modes that are not stable and do not show."""
        shown = show_poles([_upper(pole) for pole in poles])
        modes = f"s = {shown} 1/s" if self.dt is None else f"z = {shown}"
        return (
            f"a mode of the system that is not stable ({modes}) does not show in T, within "
            "rounding: the system itself is not stable"
        )

    @cached_property
    def triangular(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """A, B and C in the coordinates in which A is triangular."""
        found: Any = schur(self.A, output="complex")
        S, Q = found
        return S, Q.conj().T @ self.B, self.C @ Q

    def _states(self, w: float) -> np.ndarray:
        """C (sI - A)^-1 B at w, or at v = jw."""
        if math.isinf(w) and self.dt is None:
            return np.zeros(self.D.shape)
        S, B, C = self.triangular
        right = solve_shifted(S, B, 1j * w if self.dt is None else on_circle(w))
        if right is None:
            raise np.linalg.LinAlgError("singular matrix")
        return C @ right

    def at(self, w: float) -> float:
        """The largest singular value of T at w, or of T(z) at v = jw."""
        return _norm(self.D + self._states(w)) if len(self.A) else _norm(self.D)

    @cached_property
    def _sweep(self) -> tuple[np.ndarray, list[np.ndarray]]:
        """Points at, between and within a few widths of the poles; C (sI - A)^-1 B there.

        A level far from the top has its zeros off the axis by more than such a width.
        """
        with np.errstate(all="ignore"):
            rates = self.poles if self.dt is None else np.log(self.poles.astype(complex)) / self.dt
        w, width = np.imag(rates), np.abs(np.real(rates))
        sharp = (width > 0) & (width < 10 * w)
        near = (w[sharp, None] + width[sharp, None] * BESIDE).ravel()
        near = near if self.dt is None else np.tan(0.5 * self.dt * near)
        places = np.unique([*_places(self._continuous.poles), *near[near > 0]])
        return places, [self._states(x) for x in places]

    def plus(self, D: float) -> StateResponse:
        """The same with another direct term; what is known of A serves both."""
        made = replace(self, D=self.D + D)
        known = ("poles", "triangular", "_sweep")
        made.__dict__.update({name: getattr(self, name) for name in known if len(self.A)})
        return made

    @cached_property
    def _continuous(self) -> StateResponse:
        """The system itself, or the one in v with the same values."""
        if self.dt is None:
            return self
        return StateResponse(*mapped_states(self.A, self.B, self.C, self.D))

    def _level_zeros(self, level: float) -> np.ndarray:
        """The frequencies with a singular value equal to the level are among these."""
        of = self._continuous
        zeros: Any = level_zeros(of.A, of.B, of.C, of.D, level**2)
        return zeros[np.abs(zeros.real) <= OFF * np.abs(zeros)]

    def peak(self) -> tuple[float, float]:
        """The norm of a stable system and its frequency in rad/s; inf: approached as w grows."""
        best, w = self._best(np.array([0.0, math.inf]))
        if len(self.A):
            places, states = self._sweep
            k = int(np.argmax([_norm(self.D + x) for x in states]))
            best, w = max(
                (best, w), self._top(*places[[max(k - 1, 0), k, min(k + 1, len(places) - 1)]])
            )
        for _ in range(LEVELS if len(self.A) and best > 0 else 0):
            found, at = self._best(_places(self._level_zeros(best * (1 + RISE))))
            if found <= best * (1 + RISE):
                break
            best, w = found, at
        if 0 < w < math.inf:
            best, w = self._top(w, w * (1 - 1e-4), w * (1 + 1e-4))
        return best, w if self.dt is None else 2 * math.atan(w) / self.dt

    def _best(self, places: np.ndarray) -> tuple[float, float]:
        values = [self.at(w) for w in places]
        k = int(np.argmax(values))
        return values[k], float(places[k])

    def _top(self, w: float, low: float, high: float) -> tuple[float, float]:
        """The largest value at w, or at the top of a peak between two frequencies about it."""
        sharp = {"xatol": 1e-12 * w}
        found: Any = minimize_scalar(
            lambda x: -self.at(x), bounds=(low, high), method="bounded", options=sharp
        )
        return max((self.at(w), float(w)), (-float(found.fun), float(found.x)))


def _norm(M: np.ndarray) -> float:
    return float(abs(M[0, 0])) if M.size == 1 else float(np.linalg.norm(M, 2))


def _upper(pole: Any) -> complex:
    return complex(pole.real, abs(pole.imag))


def _places(roots: np.ndarray) -> np.ndarray:
    """The frequencies of roots, and points between and beyond them."""
    marks = np.concatenate([np.abs(roots), np.abs(np.imag(roots))])
    marks = np.unique(marks[np.isfinite(marks) & (marks > 0)])
    if not len(marks):
        return np.array([0.0, 1.0])
    ends = [0.0, 0.1 * marks[0], 10 * marks[-1]]
    return np.concatenate([ends, marks, np.sqrt(marks[1:] * marks[:-1])])
