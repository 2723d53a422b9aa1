"""Inverse-dynamics regression: a least-squares torque balance that checks a record before a fit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..record import Record
from .data import Data

CELL = 5e-3  # s, over which torque and motion are averaged
MOVING = 0.02  # of the top speed: a slower cell does not count as sliding
BLOCKS = 20  # of time, for jackknife errors that stay valid under coloured noise


@dataclass(frozen=True)
class Cells:
    """Cells of ``size`` samples inside the runs, with room to shift them either way."""

    start: np.ndarray
    size: int

    def mean(self, total: np.ndarray, shift: int = 0) -> np.ndarray:
        """Mean of a signal over each cell, shifted by ``shift``; ``total`` is its running sum."""
        a = self.start + shift
        return (total[a + self.size] - total[a]) / self.size

    def only(self, which: np.ndarray) -> Cells:
        return Cells(self.start[which], self.size)


def cells(data: Data, span: float = CELL, room: int = 0) -> Cells:
    """Cells of ``span`` s, at least ``room`` samples away from the ends of the runs."""
    size = max(1, round(span / data.dt))
    starts = [np.arange(a + room, b - room - size + 1, size) for a, b in data.runs]
    return Cells(np.concatenate(starts), size)


def running(x: np.ndarray) -> np.ndarray:
    """Running sum, one longer than the signal."""
    return np.concatenate([[0.0], np.cumsum(x)])


@dataclass(frozen=True)
class Balance:
    """Least-squares fit of the net torque to the motion of the sliding cells.

    ``u - d = J a + Fv w + (Fc + ...) sign(w) + c w |w| + T0 + K theta``, and sin and cos of theta
    on a rotary drive. The residual is what these functions of speed and position do not describe.
    ``terms`` are scaled to unit length, ``x`` are their coefficients and ``size`` their lengths;
    ``error`` is the jackknife error of J over blocks of time; ``power_t`` is the fitted friction
    power over its own error.
    """

    cells: Cells
    terms: np.ndarray
    u: np.ndarray
    w: np.ndarray
    x: np.ndarray
    J: float
    error: float
    power_t: float
    acceleration: float
    size: np.ndarray

    @property
    def residual(self) -> np.ndarray:
        return self.u - self.terms @ self.x

    @property
    def left(self) -> float:
        """RMS of the residual torque."""
        return float(np.sqrt(np.mean(self.residual**2)))

    def torque(self, data: Data, at: Cells) -> np.ndarray:
        """Torque that the balance predicts at other cells."""
        return motion_terms(data, at)[0] / self.size @ self.x + at.mean(running(data.d))


def moving(data: Data, at: Cells) -> tuple[np.ndarray, np.ndarray]:
    """Mean speed of every cell, and whether the drive slides in it."""
    w = at.mean(running(data.log.w))
    noise = data.noise.w / np.sqrt(at.size) if np.isfinite(data.noise.w) else 0.0
    top, usual = float(np.max(np.abs(w), initial=0.0)), float(np.sqrt(np.mean(w**2)))
    return w, np.abs(w) > max(MOVING * top, min(3.0 * noise, 0.5 * usual))


def balance(data: Data, at: Cells, use: np.ndarray | None = None) -> Balance | None:
    """The balance of the sliding cells (of those in ``use``); None if they are too few."""
    _, slides = moving(data, at)
    slides = slides if use is None else slides & use
    at = at.only(slides)
    if len(at.start) < 5 * BLOCKS:
        return None
    terms, w = motion_terms(data, at)
    u = at.mean(running(data.u - data.d))
    size = np.linalg.norm(terms, axis=0)
    size = np.where(size > 0, size, 1.0)
    x, J, P = _jackknifed(terms / size, u, w)
    power_t = float(P[0] / max(_error(P), 1e-300))
    a = float(np.sqrt(np.mean(terms[:, 0] ** 2)))
    J, error = float(J[0] / size[0]), float(_error(J) / size[0])
    return Balance(at, terms / size, u, w, x, J, error, power_t, a, size)


def motion_terms(data: Data, at: Cells) -> tuple[np.ndarray, np.ndarray]:
    """Regressors of the torque, a column each, the acceleration first; and the speed."""
    log = data.log
    a, w = at.mean(running(log.a)), at.mean(running(log.w))
    offset = float(np.mean(log.theta))
    angle = at.mean(running(log.theta - offset))
    way, top = np.sign(w), max(float(np.max(np.abs(w))), 1e-300)
    columns = [a, w, way, way * np.exp(-np.abs(w) / (0.05 * top)), w * np.abs(w)]
    columns += [np.ones_like(w), angle]
    if data.motion == "rotary":
        columns += [np.sin(angle), np.cos(angle)]
    return np.column_stack(columns), w


_FRICTION = slice(1, 5)  # the terms that are odd in w
LEVEL = 2  # the term of Coulomb friction


def _jackknifed(terms, u, w) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Solution; then the first coefficient and the friction power, with all blocks and without
    each."""
    blocks = np.array_split(np.arange(len(u)), BLOCKS)
    grams = np.array([terms[b].T @ terms[b] for b in blocks])
    sides = np.array([terms[b].T @ u[b] for b in blocks])
    work = terms[:, _FRICTION].T @ w / len(w)
    every = np.arange(BLOCKS)
    kept = [every, *(every != k for k in every)]
    x = np.array([_solved(grams[k].sum(0), sides[k].sum(0)) for k in kept])
    return x[0], x[:, 0], x[:, _FRICTION] @ work


def _solved(gram: np.ndarray, side: np.ndarray) -> np.ndarray:
    return np.linalg.lstsq(gram, side, rcond=1e-12)[0]


def _error(values: np.ndarray) -> float:
    return float(np.sqrt((BLOCKS - 1) * np.var(values[1:])))


def named(records: Sequence[Record]) -> str:
    """Subject of a message: the record's source, or the number of records."""
    return records[0].source if len(records) == 1 else f"{len(records)} records"
