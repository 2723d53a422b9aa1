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
from scipy.linalg import eig, schur, solve_triangular
from scipy.optimize import brentq

from ..core.errors import InputError
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
        A, B, C, D = (np.asarray(M, dtype=float) for M in (T.A, T.B, T.C, T.D))
        if not all(np.isfinite(M).all() for M in (A, B, C, D)):
            raise InputError("an entry of the state-space matrices is not a finite number.")
        return cls(A, B, C, float(D[0, 0]))

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
        M = s * np.eye(len(S)) - S
        right = solve_triangular(M, b)
        left = solve_triangular(M, c, trans=1)
        reach = float(np.linalg.norm(left) * np.linalg.norm(right))
        size = float(np.linalg.norm(c) * np.linalg.norm(right)) + abs(self.D)
        return complex(c @ right) + self.D, EPS * ((self.norm + abs(s)) * reach + size)

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

    def realness_zeros(self) -> np.ndarray:
        """The zeros of T(s) + T(-s)."""
        A = self.A + self.shift * np.eye(len(self.A))
        zero = np.zeros_like(A)
        return zeros_of(
            np.block([[A, zero], [zero, -A.T]]),
            np.vstack([self.B, self.C.T]),
            np.hstack([self.C, -self.B.T]),
            2 * self.D,
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
    values = np.array([(t.real, slack) for t, slack in map(model.at, w)])
    real, slack = values[:, 0], values[:, 1]
    end, least = _at_infinity(model)
    if (real < -slack).any() or end < -least:
        return _not_real(model, w, real, slack, end, least)
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


def _not_real(
    model: Model, w: np.ndarray, real: np.ndarray, slack: np.ndarray, end: float, least: float
) -> Realness:
    below = real < -slack
    if end < -least:
        below = below | (w >= w[-1])
    first = int(np.argmax(below))
    low = crossing(lambda x: model.at(x)[0].real, w, first, real) if first else 0.0
    after = np.flatnonzero(~below[first:])
    high = math.inf
    if len(after):
        k = first + int(after[0])
        high = crossing(lambda x: model.at(x)[0].real, w, k, real)
    to = f"{low:.6g} < w < {high:.6g} rad/s" if high < math.inf else f"w > {low:.6g} rad/s"
    more = f" and at {many} higher places" if (many := _more(below, first)) else ""
    edge = low if first and (real[1:first] > 0).any() else 0.0
    return Realness("not PR", f"Re T(jw) < 0 for {to}{more}", edge)


def _more(below: np.ndarray, first: int) -> int:
    later = below[first:]
    return int(np.count_nonzero(np.diff(later.astype(int)) == 1))


def crossing(function: Any, w: np.ndarray, k: int, values: np.ndarray) -> float:
    """Where a function changes its sign between w[k - 1] and w[k]."""
    if values[k - 1] * values[k] >= 0:
        return float(w[k])
    found: Any = brentq(function, w[k - 1], w[k], xtol=1e-300, rtol=np.float64(1e-13))
    return float(found)


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


def level_crossings(model: Model, power: float) -> tuple[float, ...]:
    """Where |T(jw)|^2 changes its side of ``power`` |T(0)|^2, in rad/s, ascending."""
    square = power * abs(model.at(0.0)[0]) ** 2

    def above(w: float) -> float:
        return abs(model.at(w)[0]) ** 2 / square - 1.0

    w = model.places(model.level_zeros(square))
    values = np.array([above(x) for x in w])
    ends = np.flatnonzero((values[1:] < 0) != (values[:-1] < 0)) + 1
    return tuple(crossing(above, w, int(k), values) for k in ends)
