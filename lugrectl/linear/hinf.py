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
from scipy.linalg import get_lapack_funcs, schur, solve_sylvester
from scipy.optimize import minimize_scalar

from .exact import hurwitz
from .pencil import EPS, level_zeros, require_sizes
from .sampled import inside, is_sampled, mapped_states, on_circle, sample_time
from .transfer import state_space_polynomials
from .verdict import show_poles

RISE = 1e-11  # of the largest value: the next level is higher by this
LEVELS = 60
EXACT = 16  # states up to which stability is decided in exact arithmetic: some seconds
UNSEEN = 1e-13  # of its inputs and outputs: a mode of less does not show, by rounding
UNKNOWN = "whether the system is stable is within rounding"
MANY = 1e3  # rounding of the matrices moves a pole by up to this times EPS

_solve: Any = get_lapack_funcs("trtrs", dtype=complex)  # of a triangle, without its checks


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
        A, B, C, D = (np.asarray(M, dtype=float) for M in (T.A, T.B, T.C, T.D))
        require_sizes(A, B, C, D)
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
        step = A2 / max(np.linalg.norm(A2), 1e-300)
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
            f"a mode of the system that is not stable ({modes}) does not show in T: the system "
            "itself is not stable"
        )

    @cached_property
    def _triangular(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        found: Any = schur(self.A, output="complex")
        S, Q = found
        return S, Q.conj().T @ self.B, self.C @ Q

    def at(self, w: float) -> float:
        """The largest singular value of T at w, or of T(z) at v = jw."""
        if not len(self.A) or (math.isinf(w) and self.dt is None):
            return _norm(self.D)
        S, B, C = self._triangular
        M = -S
        np.fill_diagonal(M, M.diagonal() + (1j * w if self.dt is None else on_circle(w)))
        right, singular = _solve(M, B)
        if singular:
            raise np.linalg.LinAlgError("singular matrix")
        return _norm(self.D + C @ right)

    def plus(self, D: float) -> StateResponse:
        """The same with another direct term; what is known of A serves both."""
        made = replace(self, D=self.D + D)
        made.__dict__.update(poles=self.poles, _triangular=self._triangular)
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
        return level_zeros(of.A, of.B, of.C, of.D, level**2)

    def peak(self) -> tuple[float, float]:
        """The norm of a stable system and its frequency in rad/s; inf: approached as w grows."""
        best, w = self._best(np.array([0.0, math.inf]))
        if len(self.A):
            found = self._best(_places(self._continuous.poles))
            best, w = max((best, w), found, self._beside_poles())
        for _ in range(LEVELS if len(self.A) and best > 0 else 0):
            found, at = self._best(_places(self._level_zeros(best * (1 + RISE))))
            if found <= best * (1 + RISE):
                break
            best, w = found, at
        best, w = self._polished(best, w)
        return best, w if self.dt is None else 2 * math.atan(w) / self.dt

    def _best(self, places: np.ndarray) -> tuple[float, float]:
        values = [self.at(w) for w in places]
        k = int(np.argmax(values))
        return values[k], float(places[k])

    def _beside_poles(self) -> tuple[float, float]:
        """The largest value within a few widths of each complex pole.

        A level far from the top has its zeros off the axis by more than such a width.
        """
        with np.errstate(all="ignore"):
            rates = self.poles if self.dt is None else np.log(self.poles.astype(complex)) / self.dt
        best, place = -math.inf, 0.0
        for w, width in zip(np.imag(rates), np.abs(np.real(rates)), strict=True):
            if not 0.0 < width < 10.0 * w:
                continue
            found: Any = minimize_scalar(
                lambda x, w=w, width=width: -self.at(self._place(w + x * width)),
                bounds=(max(-2.0, -w / width), 2.0),
                method="bounded",
                options={"xatol": 1e-2},  # the levels climb the rest
            )
            if -found.fun > best:
                best, place = -float(found.fun), self._place(w + found.x * width)
        return best, place

    def _place(self, w: float) -> float:
        """Where :meth:`at` takes w rad/s."""
        return w if self.dt is None else math.tan(0.5 * w * self.dt)

    def _polished(self, best: float, w: float) -> tuple[float, float]:
        """The top of the peak near w."""
        if not 0 < w < math.inf:
            return best, w
        found: Any = minimize_scalar(
            lambda x: -self.at(w * math.exp(x)),
            bounds=(-1e-4, 1e-4),
            method="bounded",
            options={"xatol": 1e-12},
        )
        top = self.at(w * math.exp(found.x))
        return (top, w * math.exp(found.x)) if top > best else (best, w)


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
