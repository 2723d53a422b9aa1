"""Latent-force regression: on which signals the torque depends that a model fails to predict."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..spec import members
from .beside import beside
from .data import Data, Log, picked
from .dependence import Dependence, clearest, judged
from .fit import Fitted
from .likelihood import whitened
from .proof import LEAST_SIZE_OF_ALL, friction_size
from .score import weighing, whitened_by_parts
from .screening import lightened
from .shapes import Shape, pulses, shapes
from .slopes import slopes
from .windows import Windows, spread, windows

ENOUGH = 60_000  # counted samples
LEAST_WINDOWS = 24
FOLDS, TIMED_FOLDS = 5, 4
DOSE = 0.02  # of the RMS friction: torque with which the innovations' response is computed
EXPECTED = 0.1  # of the RMS friction: prior size of the torque of one piece of a function
FREE = 1e-6  # ridge on the model's own parameters, whose columns have unit size
RIDGES = (1.0, 1e1, 1e2, 1e3, 1e4, 1e5)
WORST = 1e6  # limit to the change of an innovation, if the plant becomes unstable


def depends_on(fitted: Fitted) -> tuple[str, ...]:
    """The signals of which the residual torque is a function.

    Empty if it depends on none of them, or if its torque is below the least size.
    """
    best = clearest(dependences(lightened(fitted)))
    return best.signals if best else ()


def dependences(fitted: Fitted) -> list[Dependence]:
    """What a torque as a function of each signal gains beside the model's parameters.

    Each function is a sum of narrow ones. Their effect on the innovations is computed by running
    the plant, so a function is not penalised for what a plant at rest cannot show. The model's
    parameters are free as well, so that a refit hides little. The gain is cross-validated:
    coefficients come from other stretches of the record than those on which they count; in time,
    from the neighbouring stretches. The gain of a window is limited to what an arbitrary torque
    could explain in it, so a single event is not taken for a function of signals that were unusual
    then. A function whose torque is below the least size gets the share 0.
    """
    regression = _Regression(fitted)
    alone = {timed: regression.gain(timed) for timed in (False, True)}
    most, least = regression.most(), LEAST_SIZE_OF_ALL * regression.friction

    def dependence(shape: Shape) -> Dependence:
        gain, torque = regression.with_function(shape)
        found = judged(shape.signals, gain - alone[shape.timed], most, answers=shape.answers)
        return found if torque > least else replace(found, share=0.0)

    return beside(dependence, regression.shapes(fitted.predictor.data.log))


class _Regression:
    """Weighted innovations of all windows of a record, and their regressors."""

    def __init__(self, fitted: Fitted) -> None:
        data, w = fitted.predictor.data, fitted.where
        chosen = spread(windows(data.runs, w.burn, w.length), ENOUGH, LEAST_WINDOWS)
        self.rows = (chosen.start[:, None] + np.arange(w.burn + w.length)).ravel()
        few, where = _apart(data, self.rows, chosen)
        f = self.fitted = replace(fitted, predictor=fitted.predictor.on(few), where=where)
        r, A = slopes(f.predictor, f.values, f.free, where, f.noise)
        self.root = weighing(r.ravel())[0].reshape(r.shape)
        self.r, self.A = self._flat(r[None])[0], self._flat(A)
        size = np.linalg.norm(self.A.reshape(len(A), -1), axis=1)
        self.A /= np.maximum(size, 1e-300)[:, None, None]
        self.friction = friction_size(f)
        # not r, which comes from a finer run: the responses are run like this one
        self.white = whitened(f.predictor, [f.values], where, f.noise)[0]

    def _flat(self, white: np.ndarray) -> np.ndarray:
        """(columns, windows, both channels), weighted."""
        return (white * self.root).reshape(len(white), len(self.root), -1)

    def shapes(self, log: Log) -> list[Shape]:
        """The functions to be tried on the windows; ``log`` is the whole record's."""
        predictor, values = self.fitted.predictor, self.fitted.values
        expected = predictor.torque(values) / values["J"]
        return shapes(log, self.rows, self.fitted.where.counted.ravel(), expected)

    def answers(self, B: np.ndarray) -> np.ndarray:
        """By how much torques (N, columns) reduce the innovations, (columns, windows, both)."""
        f, dose = self.fitted, DOSE * self.friction
        white = whitened_by_parts(f.predictor, [f.values] * B.shape[1], f, dose * B.T)
        return self._flat(np.clip(self.white - white, -WORST, WORST) / dose)

    def gain(self, timed: bool) -> np.ndarray:
        """Cross-validated gain of each window from the model's own parameters."""
        own = np.full(len(self.A), FREE)
        return _validated(*_normal(self.A, self.r), self._fold(timed), own)

    def with_function(self, shape: Shape) -> tuple[np.ndarray, float]:
        """The same with a function added, at the best ridge; and the RMS of its torque."""
        rows, own = self.fitted.where.counted.ravel(), np.full(len(self.A), FREE)
        B = shape.B[:, np.any(shape.B[rows] != 0.0, axis=0)]
        more = self.answers(B)
        H, g = _normal(np.concatenate([self.A, more]), self.r)
        stiff = np.full(len(more), (EXPECTED * self.friction) ** -2)
        penalties = [np.append(own, ridge * stiff) for ridge in RIDGES]
        gains = [_validated(H, g, self._fold(shape.timed), one) for one in penalties]
        best = int(np.argmax(np.sum(gains, axis=1)))
        weights = _weights(H, g, penalties[best])[len(own) :]
        return gains[best], float(np.std(B[rows] @ weights))

    def _fold(self, timed: bool) -> np.ndarray:
        n = self.A.shape[1]
        return np.arange(n) % TIMED_FOLDS if timed else np.arange(n) * FOLDS // n

    def most(self) -> np.ndarray:
        """Gain of each window from an arbitrary torque, less its degrees of freedom."""
        where, data = self.fitted.where, self.fitted.predictor.data
        local = pulses(where.length, data.dt)
        B = np.zeros((len(data.t), local.shape[1]))
        B[where.counted] = local
        H, g = _normal(self.answers(B), self.r)
        M = H + np.eye(H.shape[1]) * (EXPECTED * self.friction) ** -2
        gain = np.einsum("wi,wi->w", g, np.linalg.solve(M, g[..., None])[..., 0])
        spent = np.trace(np.linalg.solve(M, H), axis1=1, axis2=2)
        return np.maximum(0.5 * (gain - spent), 0.0)


def _apart(data: Data, rows: np.ndarray, where: Windows) -> tuple[Data, Windows]:
    """The windows alone, each with its lead-in as a run of its own."""
    few, whole = picked(data, rows), where.burn + where.length
    start = np.arange(0, len(rows), whole)
    runs = tuple((int(a), int(a) + whole) for a in start)
    return replace(few, runs=runs, log=replace(few.log, runs=runs)), replace(where, start=start)


def _normal(X: np.ndarray, r: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """X X' and X r of each window."""
    Z = X.transpose(1, 0, 2)
    return Z @ Z.transpose(0, 2, 1), np.einsum("wkn,wn->wk", Z, r)


def _weights(H: np.ndarray, g: np.ndarray, penalty: np.ndarray) -> np.ndarray:
    return np.linalg.lstsq(H.sum(0) + np.diag(penalty), g.sum(0), rcond=None)[0]


def _validated(H: np.ndarray, g: np.ndarray, fold: np.ndarray, penalty: np.ndarray) -> np.ndarray:
    """Gain of each window with the coefficients from the other folds."""
    gain = np.zeros(len(g))
    for k in range(int(fold.max()) + 1):
        own = fold == k
        c = _weights(H[~own], g[~own], penalty)
        gain[own] = g[own] @ c - 0.5 * np.einsum("i,wij,j->w", c, H[own], c)
    return gain


def signals_of(names: Sequence[str]) -> tuple[str, ...]:
    """The signals that effects depend on; friction depends on w."""
    made: list[str] = []
    for name in names:
        block = members("effect")[name]
        levels = {act.removeprefix("+") for act in block.acts}
        friction = "w" if {"Fc", "Fs", "Fv"} & levels else None
        made += [s for s in ("t" if block.timed else None, *block.inputs, friction) if s]
    return tuple(dict.fromkeys(made))
