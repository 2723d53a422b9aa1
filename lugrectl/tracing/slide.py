"""On which signals it hangs what the torque balance lacks while the drive slides.

Where a drive sticks and slips, one mistake of a model spoils a whole window of its predictions.
The balance of torque and motion over short cells knows nothing of what came before: it takes
every sliding cell for itself, and says nothing of a drive at rest.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import solve

from ..blocks.friction import EPS, stribeck
from .balance import Cells, cells, moving, running
from .data import Data, Log
from .dependence import Dependence, clearest, judged, surest
from .evaluate import missing_torque
from .fit import Fitted
from .shapes import Shape, bumps, fading, hystereses, shapes

CELL = 0.01  # s
BLOCKS = 40  # of cells in a row, by which the share's error is found
FOLDS, TIMED_FOLDS = 5, 4
TOGETHER = 3  # cells in a row that a fold in time has
RIDGES = (1e-3, 1e-2, 1e-1, 1.0)
NEIGHBOURS = (1, 2, 4, 8, 16)  # cells on either side that foretell the one between them
SUPPLIED = 3.0  # times what the observer supplies, that a missing torque can be at most
NEARLY_ALL = 0.9  # of what is missing; an effect is to take a part of such a share
LEAST_TAKEN = 0.3  # of its power
MOMENTS = 0.3  # part of the cells that a few moments are
TELLING, MORE_MOMENTS = 0.7, 0.45  # the same beside a function with a smaller share
FAR_LESS = 0.35  # of what another function leaves; the less, the more that tells
FREE = 1e-3  # ridge of what the model may have wrong
MOST = 200 * BLOCKS  # cells
FEWEST = 3 * BLOCKS  # cells
STRIBECK = 0.05  # of the largest speed, where the friction law has no Stribeck speed


@dataclass(frozen=True, eq=False)
class Sliding:
    """What the balance of the sliding drive lacks, and on what it hangs.

    ``lack`` (cells,) in N m; ``known`` (cells, terms) what the model may have wrong; ``rows`` the
    sample in the middle of each cell; ``expected`` (cells,) the model's acceleration, rad/s2.
    """

    log: Log
    rows: np.ndarray
    lack: np.ndarray
    known: np.ndarray
    expected: np.ndarray

    @cached_property
    def torque(self) -> float:
        """All that is missing, RMS, N m."""
        missed = self._missed_by_known[False]
        return float(np.sqrt(np.mean(missed))) if len(missed) else 0.0

    @cached_property
    def dependences(self) -> tuple[Dependence, ...]:
        """As which functions of the signals it can be seen."""
        if not len(self.lack):
            return ()
        made = shapes(self.log, self.rows, np.arange(len(self.rows)), self.expected)
        made += [bumps(self.log, self.rows), *hystereses(self.log, self.rows)]
        return (self._in_time(), *map(self._dependence, made))

    def of_signals(self) -> Dependence | None:
        """The clearest of the functions of signals that come back."""
        return clearest([d for d in self.dependences if "t" not in d.signals])

    def of_signals_for_sure(self) -> Dependence | None:
        """The same where it is certain, however little of what is missing it is."""
        return surest([d for d in self.dependences if "t" not in d.signals])

    def of_time(self) -> Dependence | None:
        """The clearest of the functions that hold time."""
        return clearest([d for d in self.dependences if "t" in d.signals])

    def of_moments(self) -> Dependence | None:
        """The same where all is missing in a few moments, and no other signal tells nearly as
        much of it: what takes hold of a drive for once, at whatever speed and place that is."""
        best, told = self.of_time(), self._told
        if best is None or 1.0 - best.share > FAR_LESS * (1.0 - told) ** 2:
            return None
        return best if self._spread < (MOMENTS if told > TELLING else MORE_MOMENTS) else None

    def comes_back(self) -> bool:
        """Whether a function of signals that come back tells it, and it is no matter of moments."""
        return self.of_signals() is not None and self._spread > MOMENTS

    def of_fading(self) -> Dependence | None:
        """Friction or a torque constant that changes slowly, where no signal that comes back tells
        nearly as much, and no slow torque: that may be a place passed slowly."""
        best = max(self._fading, key=lambda d: d.share, default=None)
        if best is None or len(best.signals) == 1 or clearest([best]) is None:
            return None
        return best if 1.0 - best.share < FAR_LESS * (1.0 - self._told) else None

    @cached_property
    def _fading(self) -> list[Dependence]:
        made = fading(self.log, self.rows) if len(self.lack) else []
        return [self._dependence(shape) for shape in made]

    @cached_property
    def _told(self) -> float:
        """The most that a function of signals that come back explains."""
        back = (d for d in self.dependences if "t" not in d.signals and not d.answers)
        return max((d.share for d in back), default=0.0)

    @cached_property
    def _spread(self) -> float:
        """Part of the cells that hold nearly all of what is missing."""
        missed = np.sort(self._missed_by_known[False])[::-1]
        held = np.cumsum(missed) < NEARLY_ALL * np.sum(missed)
        return float(np.mean(held)) if len(held) else 1.0

    def share(self, signals: tuple[str, ...]) -> float:
        """The most that a function of these signals explains."""
        every = (*self.dependences, *self._fading)
        return max((d.share for d in every if d.signals == signals), default=0.0)

    def size(self, of: Dependence) -> float:
        """RMS torque of one of the functions, N m."""
        return self.torque * float(np.sqrt(of.share))

    @cached_property
    def _block(self) -> np.ndarray:
        return np.arange(len(self.lack)) * BLOCKS // max(len(self.lack), 1)

    def _fold(self, timed: bool) -> np.ndarray:
        cell = np.arange(len(self.lack))
        return cell // TOGETHER % TIMED_FOLDS if timed else self._block % FOLDS

    @cached_property
    def _missed_by_known(self) -> dict[bool, np.ndarray]:
        """Squares that no function but the model's own errors leave, by whether folds are timed."""
        if not len(self.lack):
            return dict.fromkeys((False, True), self.lack)
        own = [np.zeros(self.known.shape[1])]
        return {t: _missed(self.known, self.lack, self._fold(t), own)[0] for t in (False, True)}

    def _in_time(self) -> Dependence:
        """As any function of time: each cell is foretold by those around it."""
        X = self.known
        r = self.lack - X @ np.linalg.lstsq(X, self.lack, rcond=None)[0]
        missed = [(r - _between(r, self.rows, width)) ** 2 for width in NEIGHBOURS]
        return self._judged(("t",), missed, timed=True)

    def _dependence(self, shape: Shape) -> Dependence:
        B = shape.B[:, np.any(shape.B != 0.0, axis=0)]
        X = np.column_stack([self.known, B / np.linalg.norm(B, axis=0)])
        stiff = np.arange(X.shape[1]) >= self.known.shape[1]
        missed = _missed(X, self.lack, self._fold(shape.timed), [r * stiff for r in RIDGES])
        return self._judged(shape.signals, missed, timed=shape.timed, answers=shape.answers)

    def _judged(
        self,
        signals: tuple[str, ...],
        missed: Sequence[np.ndarray],
        *,
        timed: bool,
        answers: bool = False,
    ) -> Dependence:
        whole = np.bincount(self._block, self._missed_by_known[timed])
        left = min((np.bincount(self._block, m) for m in missed), key=np.sum)
        return judged(signals, whole - left, whole, answers=answers)


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


def lacking(fitted: Fitted, *, timed: bool = False) -> Lack | None:
    """What is clearly missing while the drive slides, None where nothing is.

    What the balance lacks counts where samples that were not fitted show it, too, and where the
    observer supplies as much: a motion that was smoothed too much feigns a lack. As a function
    of time only if ``timed``.
    """
    return _seen_twice(fitted, lambda s: s.of_signals() or (s.of_time() if timed else None))


def hidden_in_noise(fitted: Fitted) -> Lack | None:
    """What is certainly missing while the drive slides, however much noise is missing beside it.

    Of 39 drawn sound drives none lacked more than 0.42 of the least size that is worth a name.
    """
    return _seen_twice(fitted, Sliding.of_signals_for_sure)


def _seen_twice(fitted: Fitted, look: Callable[[Sliding], Dependence | None]) -> Lack | None:
    """What the windows lack that were fitted, where the whole record shows it as well and the
    observer makes up for it."""
    sliding = while_sliding(fitted)
    best = look(sliding)
    if not best or not look(while_sliding(fitted, everywhere=True)):
        return None
    found = Lack(best.signals, best.share, sliding.size(best), sliding.torque)
    return found if _is_supplied(found.torque, fitted) else None


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
    at = at.only(sliding(data, at) & (everywhere | fitted_cells(fitted, at)))
    at = at.only(_enough(len(at.start)))
    rows = at.start + at.size // 2
    predictor, values = fitted.predictor, fitted.values
    net = at.mean(running(predictor.torque(values, built_up=True)))
    lack = values["J"] * at.mean(running(data.log.a)) - net
    if len(rows) < FEWEST or not np.all(np.isfinite(lack)):
        rows = rows[:0]
        at, net, lack = at.only(rows), net[:0], lack[:0]
    known = _known(fitted, data, at, net)
    return Sliding(data.log, rows, lack, known, net / fitted.values["J"])


def _enough(count: int) -> np.ndarray:
    """Which cells of a long record count: stretches of as many in a row, all along it."""
    place = np.arange(count) * BLOCKS % max(count, 1) / max(count, 1)  # within its block
    return place < MOST / max(count, MOST)


def sliding(data: Data, at: Cells) -> np.ndarray:
    """Whether the drive slides in a cell, and in those beside it, all in one direction.

    Next to a reversal the motion is smoothed over it, and friction hangs on what came before.
    """
    w, slides = moving(data, at)
    way = np.pad(np.where(slides, np.sign(w), 0.0), 1)
    return slides & (way[:-2] == way[1:-1]) & (way[2:] == way[1:-1])


def fitted_cells(fitted: Fitted, at: Cells) -> np.ndarray:
    """Whether a cell lies in the windows that were fitted."""
    counts = np.zeros(len(fitted.predictor.data.t))
    counts[fitted.where.counted] = 1.0
    return at.mean(running(counts)) == 1.0


def _known(fitted: Fitted, data: Data, at: Cells, net: np.ndarray) -> np.ndarray:
    """What the model may have wrong, a column of unit size each."""
    u = at.mean(running(data.u - data.d))
    columns = np.column_stack([net, u, *friction_terms(fitted, data, at)])
    return columns / np.maximum(np.linalg.norm(columns, axis=0), 1e-300)


def friction_terms(fitted: Fitted, data: Data, at: Cells) -> list[np.ndarray]:
    """Viscous and Coulomb friction, what is above it near rest, and a constant, one unit each."""
    w = at.mean(running(data.log.w))
    vs = fitted.values.get("vs", STRIBECK * data.log.fastest)
    eps = fitted.values.get("eps", EPS.value)
    level, both = (stribeck(w, Fc=1.0, Fs=Fs, Fv=0.0, vs=vs, eps=eps)[0] for Fs in (1.0, 2.0))
    return [w, level, both - level, np.ones_like(w)]


def _between(r: np.ndarray, rows: np.ndarray, width: int) -> np.ndarray:
    """What the cells up to ``width`` before and after each one say of it, the nearer the more; 0
    where there are none."""
    place = (rows - rows[0]) // np.min(np.diff(rows))
    weight = np.minimum(np.arange(1, 2 * width + 2), np.arange(2 * width + 1, 0, -1.0))
    weight[width] = 0.0
    there, value = np.zeros((2, int(place[-1]) + 1))
    there[place], value[place] = 1.0, r
    summed, count = (np.convolve(x, weight, "same")[place] for x in (value, there))
    return summed / np.maximum(count, 1.0)


def _missed(
    X: np.ndarray, r: np.ndarray, fold: np.ndarray, ridges: Sequence[np.ndarray]
) -> list[np.ndarray]:
    """Squares of what the other folds do not foretell, for each ridge on the columns."""
    each = [X[fold == k] for k in range(int(fold.max()) + 1)]
    grams = np.array([x.T @ x for x in each])
    sides = np.array([x.T @ r[fold == k] for k, x in enumerate(each)])
    missed = [np.empty(len(r)) for _ in ridges]
    for k, x in enumerate(each):
        H, g, own = grams.sum(0) - grams[k], sides.sum(0) - sides[k], fold == k
        for out, ridge in zip(missed, ridges, strict=True):
            weights = solve(H + np.diag(ridge + FREE), g, assume_a="pos")
            out[own] = (r[own] - x @ weights) ** 2
    return missed
