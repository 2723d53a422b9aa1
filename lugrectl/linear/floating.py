"""Checks of a state-space model in floating point, at the cost of a few eigenvalue problems.

Between neighbouring zeros of T(s) + T(-s), or of |T|^2 - c, on the imaginary axis nothing changes
its sign: a point in each gap decides, with what rounding of the matrices may change there. Times
grow with the third power of the order; exact arithmetic takes minutes at 30 states.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Self

import numpy as np
from scipy.linalg import eig, matrix_balance, schur, solve_triangular

from ..core.errors import InputError
from .sure_signs import Edge, Function, SureSigns
from .transfer import require_continuous_siso
from .verdict import show_poles

EPS = 8 * np.finfo(float).eps  # of the norm of A: rounding that turning the coordinates leaves
HALVINGS = 40
SINGLE = 1e-9  # relative distance of two candidates that count as one


@dataclass(frozen=True)
class Model:
    """C (sI - A)^-1 B + D with one input and one output; ``shift``: T(s - shift) instead."""

    A: np.ndarray
    B: np.ndarray
    C: np.ndarray
    D: float
    shift: float = 0.0

    @classmethod
    def of(cls, T: Any) -> Model:
        require_continuous_siso(T, "T")
        return cls.balanced(T)

    @classmethod
    def balanced(cls, T: Any) -> Self:
        """In units of the states that make rows and columns of A alike: powers of two, exactly."""
        A, B, C, D = (np.asarray(M, dtype=float) for M in (T.A, T.B, T.C, T.D))
        if not all(np.isfinite(M).all() for M in (A, B, C, D)):
            raise InputError("an entry of the state-space matrices is not a finite number.")
        if not len(A):
            return cls(A, B, C, float(D[0, 0]))
        found: Any = matrix_balance(A, permute=False, separate=True)
        A, (units, _) = found
        return cls(A, B / units[:, None], C * units, float(D[0, 0]))

    @cached_property
    def norm(self) -> float:
        return float(np.linalg.norm(self.A))

    @cached_property
    def triangular(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """A, B and C in the coordinates in which A is triangular."""
        found: Any = schur(self.A, output="complex")
        S, Q = found
        return S, Q.conj().T @ self.B[:, 0], self.C[0] @ Q

    @cached_property
    def poles(self) -> np.ndarray:
        """In 1/s, rightmost first, without the shift."""
        poles = np.linalg.eigvals(self.A)
        return poles[np.lexsort((poles.imag, -poles.real))]

    @property
    def uncertain(self) -> float:
        """A real part of a pole in 1/s below which rounding decides on its side."""
        return 1e3 * EPS * self.norm

    @property
    def stable(self) -> bool:
        return bool(self.poles[0].real < 0)

    @property
    def decided(self) -> bool:
        """Whether no pole is so near to the axis that rounding decides on its side."""
        return bool(np.abs(np.real(self.poles)).min() > self.uncertain)

    def at(self, w: float) -> tuple[complex, float]:
        """T(jw), and what rounding of the matrices may change of it."""
        S, b, c = self.triangular
        s = self.point(w)
        if math.isinf(abs(s)):
            return complex(self.D), 0.0
        M = s * np.eye(len(S)) - S
        if not np.diag(M).all():
            return complex(math.nan), math.inf
        right = solve_triangular(M, b)
        left = solve_triangular(M, c, trans=1)
        reach = float(np.linalg.norm(left) * np.linalg.norm(right))
        size = float(np.linalg.norm(c) * np.linalg.norm(right)) + abs(self.D)
        return complex(c @ right) + self.D, EPS * ((self.norm + abs(s)) * reach + size)

    def real_part(self, w: float) -> tuple[float, float]:
        """Re T(jw), and what rounding of the matrices may change of it."""
        t, slack = self.at(w)
        return t.real, slack

    def point(self, w: float) -> complex:
        """Where on the axis, moved by the shift, w is."""
        return 1j * w - self.shift

    @property
    def marks(self) -> np.ndarray:
        """The poles, in the variable whose imaginary axis the frequencies lie on."""
        return self.poles

    def places(self, zeros: np.ndarray) -> np.ndarray:
        """0, the frequencies of zeros and poles, points between them and beyond, in rad/s."""
        marks = np.concatenate([zeros, self.marks])
        marks = np.concatenate([np.abs(marks), np.abs(np.imag(marks))])
        marks = np.sort(marks[np.isfinite(marks) & (marks > 0)])
        marks = marks[np.append(True, np.diff(marks) > SINGLE * marks[1:])] if len(marks) else marks
        if not len(marks):
            return np.array([0.0, 1.0])
        between = np.sqrt(marks[1:] * marks[:-1])
        return np.sort(np.concatenate([[0.0, 0.1 * marks[0], 10 * marks[-1]], marks, between]))

    def signs(self, function: Function, points: np.ndarray, values: Any = None) -> SureSigns:
        """The signs of a function of frequency, and where they change."""
        return SureSigns.of(function, points, values)

    def realness_zeros(self) -> np.ndarray:
        """The zeros of T(s) + T(-s)."""
        return self._mirrored_zeros(1.0)

    def real_zeros(self) -> np.ndarray:
        """The zeros of T(s) - T(-s), among them where T(jw) is real."""
        return self._mirrored_zeros(-1.0)

    def _mirrored_zeros(self, sign: float) -> np.ndarray:
        A = self.A + self.shift * np.eye(len(self.A))
        zero = np.zeros_like(A)
        return zeros_of(
            np.block([[A, zero], [zero, -A.T]]),
            np.vstack([self.B, self.C.T]),
            np.hstack([self.C, -sign * self.B.T]),
            (1.0 + sign) * self.D,
        )

    def level_zeros(self, square: float) -> np.ndarray:
        """The zeros of T(s) T(-s) - square."""
        return level_zeros(self.A, self.B, self.C, np.atleast_2d(self.D), square)

    def shifted(self, eps: float) -> Self:
        """The same with another shift."""
        moved = replace(self, shift=eps)
        vars(moved)["triangular"], vars(moved)["poles"] = self.triangular, self.poles
        return moved

    def is_real(self) -> bool:
        """Whether Re T is nowhere negative beyond rounding, where its sign may change."""
        values = map(self.at, self.places(self.realness_zeros()))
        return all(t.real >= -slack for t, slack in values)


def level_zeros(
    A: np.ndarray, B: np.ndarray, C: np.ndarray, D: np.ndarray, square: float
) -> np.ndarray:
    """The zeros of T(-s)^T T(s) - ``square`` I (Boyd, Balakrishnan and Kabamba 1989)."""
    return zeros_of(
        np.block([[A, np.zeros_like(A)], [-C.conj().T @ C, -A.conj().T]]),
        np.vstack([B, -C.conj().T @ D]),
        np.hstack([D.conj().T @ C, B.conj().T]),
        D.conj().T @ D - square * np.eye(B.shape[1]),
    )


def zeros_of(A: np.ndarray, B: np.ndarray, C: np.ndarray, D: Any) -> np.ndarray:
    """The finite zeros of a system with as many inputs as outputs."""
    scale = math.sqrt(max(np.linalg.norm(B), 1e-300) / max(np.linalg.norm(C), 1e-300))
    left = np.block([[A, B / scale], [C * scale, np.atleast_2d(D)]])
    right = np.diag([*np.ones(len(A)), *np.zeros(len(C))])
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")
        pairs: Any = eig(left, right, right=False, homogeneous_eigvals=True)
    alpha, beta = pairs
    with np.errstate(all="ignore"):
        return (alpha / beta)[np.abs(beta) > 1e-14 * np.abs(alpha).max()]


@dataclass(frozen=True)
class Realness:
    """What floating point says of Re T(jw): a kind, "" where it cannot say; why; the band edge."""

    kind: str
    reason: str
    edge: float = math.inf
    margin: float = 0.0
    rounded: bool = False


def realness(model: Model) -> Realness:
    """The kind of a model; "" where a pole is on the axis or cancels right of it."""
    if not len(model.A):
        return Realness("", "no poles")
    first = model.poles[0].real
    if first > -model.uncertain:
        if first <= model.uncertain or not is_seen(model):
            return Realness("", "a pole on the axis, or one that cancels")
        shown = show_poles([p for p in map(complex, model.poles) if p.real > model.uncertain])
        return Realness("not PR", f"T has poles right of the imaginary axis ({shown} 1/s)", 0.0)
    w = model.places(model.realness_zeros())
    values = np.array([model.real_part(x) for x in w])
    real, slack = values.T
    end, least = _at_infinity(model)
    if (real < -slack).any() or end < -least:
        return _not_real(model, w, values, min(end + least, 0.0))
    limit = ("Re T(jw)" if model.D else "w^2 Re T(jw)") + f" tends to {end:.6g} as w grows"
    near = np.flatnonzero(real <= slack)
    if len(near):
        k = near[0]
        reason = f"Re T(jw) >= 0, but it is 0 at w = {w[k]:.6g} rad/s within rounding"
        return Realness("PR", reason, math.inf if w[k] == 0 else float(w[k]), rounded=True)
    if end <= least:
        return Realness("WSPR", f"Re T(jw) > 0 at every finite w, but {limit} within rounding")
    reason = (
        f"poles left of the axis (the rightmost at Re s = {model.poles[0].real:.6g} 1/s), "
        f"Re T(jw) > 0 at every w and {limit}"
    )
    return Realness("SPR", reason, math.inf, _margin(model))


def is_seen(model: Model, size: Any = np.real) -> bool:
    """Whether the rightmost pole (the one of the largest ``size``) has a residue that is not 0."""
    found: Any = eig(model.A, left=True)
    poles, left, right = found
    k = int(np.argmax(size(poles)))
    to, of = left[:, k].conj(), right[:, k]
    residue = (model.C[0] @ of) * (to @ model.B[:, 0]) / (to @ of)
    sizes = np.linalg.norm(model.C) * np.linalg.norm(model.B)
    return bool(abs(residue) > 1e-9 * sizes)


def _at_infinity(model: Model) -> tuple[float, float]:
    """The limit of Re T(jw), or without D of w^2 Re T(jw), and what rounding may change of it."""
    if model.D:
        return model.D, 0.0
    A = model.A + model.shift * np.eye(len(model.A))
    sizes = np.linalg.norm(model.C) * np.linalg.norm(model.B) * model.norm
    return float(-(model.C @ A @ model.B)[0, 0]), EPS * float(sizes)


def _not_real(model: Model, w: np.ndarray, values: np.ndarray, end: float) -> Realness:
    """The first band with Re T(jw) < 0; ``end`` < 0: so it is as w grows without end."""
    signs = model.signs(model.real_part, w, values)
    if end < 0:
        signs = signs.below_beyond()
    low, high, later = signs.first_band()
    to = f"{low} < w < {high} rad/s" if high else f"w > {low} rad/s"
    more = f" and at {later} higher places" if later else ""
    return Realness("not PR", f"Re T(jw) < 0 for {to}{more}", low.first)


def _margin(model: Model) -> float:
    """The largest eps with T(s - eps) positive real."""

    def holds(eps: float) -> bool:
        moved = model.shifted(eps)
        end, least = _at_infinity(moved)
        return end >= -least and moved.is_real()

    return last_that_holds(holds, -float(model.poles[0].real))


def last_that_holds(holds: Callable[[float], bool], high: float) -> float:
    """The largest value up to ``high`` for which it holds, as for all smaller ones; bisection."""
    if holds(high * (1 - 1e-12)):
        return high
    low = 0.0
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if holds(middle) else (low, middle)
    return low


def level_crossings(model: Model, power: float) -> tuple[Edge, ...]:
    """Where |T(jw)|^2 changes its side of ``power`` |T(0)|^2, w in rad/s, ascending."""
    dc, rounding = model.at(0.0)
    square = power * abs(dc) ** 2

    def above(w: float) -> tuple[float, float]:
        t, slack = model.at(w)
        size = abs(t) ** 2 / square
        return size - 1.0, 2 * size * (slack / max(abs(t), slack) + rounding / abs(dc)) + EPS

    return model.signs(above, model.places(model.level_zeros(square))).edges
