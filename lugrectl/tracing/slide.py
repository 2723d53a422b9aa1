"""On which signals it hangs what the torque balance lacks while the drive slides.

Where a drive sticks and slips, one mistake of a model spoils a whole window of its predictions.
The balance of torque and motion over short cells knows nothing of what came before: it takes
every sliding cell for itself, and says nothing of a drive at rest.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve

from ..blocks.friction import EPS, stribeck
from .balance import Cells, cells, moving, running
from .data import Data
from .dependence import Dependence, clearest, judged
from .evaluate import missing_torque
from .fit import Fitted
from .shapes import Shape, in_time, shapes

CELL = 0.01  # s
BLOCKS = 40  # of cells in a row, by which the share's error is found
FOLDS, TIMED_FOLDS = 5, 4
TOGETHER = 3  # cells in a row that a fold in time has
RIDGES = (1e-3, 1e-2, 1e-1, 1.0)
FINE, FINEST = 0.1, 400  # s between the points of a function of time, and most of them
SUPPLIED = 3.0  # times what the observer supplies, that a missing torque can be at most
NEARLY_ALL = 0.9  # share above which an effect is to take a part of it
LEAST_TAKEN = 0.3  # of its power
FREE = 1e-3  # ridge of what the model may have wrong
MOST = 200 * BLOCKS  # cells
FEWEST = 3 * BLOCKS  # cells
STRIBECK = 0.05  # of the largest speed, where the friction law has no Stribeck speed


@dataclass(frozen=True)
class Sliding:
    """What the balance of the sliding drive lacks: ``torque`` N m RMS, and on what it hangs."""

    torque: float
    dependences: tuple[Dependence, ...]

    def hangs_on(self, *, timed: bool) -> Dependence | None:
        """The clearest of the functions that hold time, or of those that do not."""
        return clearest([d for d in self.dependences if ("t" in d.signals) == timed])

    def share(self, signals: tuple[str, ...]) -> float:
        """The most that a function of these signals explains."""
        return max((d.share for d in self.dependences if d.signals == signals), default=0.0)

    def size(self, of: Dependence) -> float:
        """RMS torque of one of the functions, N m."""
        return self.torque * float(np.sqrt(of.share))


@dataclass(frozen=True)
class Lack:
    """A function of signals that is missing from the balance of the sliding drive, N m RMS, and
    all that the balance lacks."""

    signals: tuple[str, ...]
    share: float
    torque: float
    whole: float

    def stays(self, after: Fitted) -> bool:
        """Whether a model with one more effect leaves it, though it is almost all that lacks."""
        return self.share > NEARLY_ALL and self._left(after) > 1.0 - LEAST_TAKEN

    def is_better_than(self, after: Fitted) -> bool:
        """Whether the function, almost all that lacks, leaves less than half of what effects do."""
        more = self._left(after) > 2.0 * (1.0 - self.share)
        return self.share > NEARLY_ALL and more and _is_supplied(while_sliding(after).torque, after)

    def _left(self, after: Fitted) -> float:
        """Part of the power of all that was missing that another model leaves."""
        return (while_sliding(after).torque / self.whole) ** 2


def _is_supplied(torque: float, fitted: Fitted) -> bool:
    """Whether the observer has to make up for a missing torque."""
    supplied = missing_torque(fitted.predictor, fitted.values, fitted.where, fitted.noise)
    return torque < SUPPLIED * float(np.std(supplied))


def lacking(fitted: Fitted) -> Lack | None:
    """What is clearly missing while the drive slides, None where nothing is.

    What the balance lacks counts where samples that were not fitted show it, too, and where the
    observer supplies as much: a motion that was smoothed too much feigns a lack.
    """
    sliding = while_sliding(fitted)
    best = sliding.hangs_on(timed=False)
    if not best or not while_sliding(fitted, everywhere=True).hangs_on(timed=False):
        return None
    torque = sliding.size(best)
    if not _is_supplied(torque, fitted):
        return None
    return Lack(best.signals, best.share, torque, sliding.torque)


def while_sliding(fitted: Fitted, *, everywhere: bool = False) -> Sliding:
    """What the balance of torque and measured acceleration lacks, as functions of signals.

    It is regressed on the model's net torque, on torque and friction with free strengths, and on
    one function: then a function of the torque means something, though the torque holds
    whatever is missing. The weights come from other blocks of the record than those on which
    they count; in time, from cells next to these. Every block counts at most as much as it
    holds. Of the windows that were fitted, or ``everywhere``. Nothing where the drive hardly
    slides, or where the model's torque is no number.
    """
    data = fitted.predictor.data
    at = cells(data, CELL)
    at = at.only(_sliding(data, at) & (everywhere | _fitted(fitted, at)))
    at = at.only(_enough(len(at.start)))
    if len(at.start) < FEWEST:
        return Sliding(0.0, ())
    predictor, values, J = fitted.predictor, fitted.values, fitted.values["J"]
    rubbing = predictor.rubbing(values) - predictor.friction(values)
    net = at.mean(running(predictor.torque(values) - rubbing))
    lack, known = J * at.mean(running(data.log.a)) - net, _known(fitted, data, at, net)
    if not np.all(np.isfinite(lack)):
        return Sliding(0.0, ())
    block, rows = np.arange(len(net)) * BLOCKS // len(net), at.start + at.size // 2
    made = shapes(data.log, rows, np.arange(len(net)), net / J)
    made.append(in_time(data.log.t[rows], FINE, FINEST))
    left = _missed(known, lack, block % FOLDS, np.zeros(known.shape[1]))
    torque = float(np.sqrt(np.mean(left)))
    return Sliding(torque, tuple(_dependence(shape, known, lack, block) for shape in made))


def _enough(count: int) -> np.ndarray:
    """Which cells of a long record count: stretches of as many in a row, all along it."""
    place = np.arange(count) * BLOCKS % max(count, 1) / max(count, 1)  # within its block
    return place < MOST / max(count, MOST)


def _sliding(data: Data, at: Cells) -> np.ndarray:
    """Whether the drive slides in a cell, and in those beside it, all in one direction.

    Next to a reversal the motion is smoothed over it, and friction hangs on what came before.
    """
    w, slides = moving(data, at)
    way = np.pad(np.where(slides, np.sign(w), 0.0), 1)
    return slides & (way[:-2] == way[1:-1]) & (way[2:] == way[1:-1])


def _fitted(fitted: Fitted, at: Cells) -> np.ndarray:
    """Whether a cell lies in the windows that were fitted."""
    counts = np.zeros(len(fitted.predictor.data.t))
    counts[fitted.where.counted] = 1.0
    return at.mean(running(counts)) == 1.0


def _known(fitted: Fitted, data: Data, at: Cells, net: np.ndarray) -> np.ndarray:
    """What the model may have wrong, a column of unit size each."""
    u, w = at.mean(running(data.u - data.d)), at.mean(running(data.log.w))
    vs = fitted.values.get("vs", STRIBECK * data.log.fastest)
    level, both = (stribeck(w, Fc=1.0, Fs=Fs, Fv=0.0, vs=vs, eps=EPS.value)[0] for Fs in (1.0, 2.0))
    columns = np.column_stack([net, u, w, level, both - level, np.ones_like(w)])
    return columns / np.maximum(np.linalg.norm(columns, axis=0), 1e-300)


def _dependence(shape: Shape, known: np.ndarray, lack: np.ndarray, block: np.ndarray) -> Dependence:
    cell = np.arange(len(lack))
    fold = cell // TOGETHER % TIMED_FOLDS if shape.timed else block % FOLDS
    B = shape.B[:, np.any(shape.B != 0.0, axis=0)]
    X = np.column_stack([known, B / np.linalg.norm(B, axis=0)])
    stiff = np.arange(X.shape[1]) >= known.shape[1]
    whole = np.bincount(block, _missed(known, lack, fold, np.zeros(known.shape[1])))
    left = [np.bincount(block, _missed(X, lack, fold, ridge * stiff)) for ridge in RIDGES]
    return judged(shape.signals, whole - min(left, key=np.sum), whole)


def _missed(X: np.ndarray, r: np.ndarray, fold: np.ndarray, ridge: np.ndarray) -> np.ndarray:
    """Squares of what the other folds do not foretell."""
    each = [X[fold == k] for k in range(int(fold.max()) + 1)]
    grams = np.array([x.T @ x for x in each])
    sides = np.array([x.T @ r[fold == k] for k, x in enumerate(each)])
    missed = np.empty(len(r))
    for k, x in enumerate(each):
        H = grams.sum(0) - grams[k] + np.diag(ridge + FREE)
        own = fold == k
        missed[own] = (r[own] - x @ solve(H, sides.sum(0) - sides[k], assume_a="pos")) ** 2
    return missed
