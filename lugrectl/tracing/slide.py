"""Residual regression (inverse dynamics): on which signals the missing torque depends in sliding.

If a drive sticks and slips, one error of a model spoils a whole window of its predictions. The
balance of torque and motion over short cells has no memory: it uses each sliding cell by itself,
and gives no information on a drive at rest.
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

CELL = 0.01  # s, length of a cell
BLOCKS = 40  # of consecutive cells, between which the error of a share is estimated
FOLDS, TIMED_FOLDS = 5, 4
TOGETHER = 3  # consecutive cells in a fold in time
RIDGES = (1e-3, 1e-2, 1e-1, 1.0)
NEIGHBOURS = (1, 2, 4, 8, 16)  # cells on either side that predict the one between them
SUPPLIED = 3.0  # times the torque that the observer supplies: most that can be missing
NEARLY_ALL = 0.9  # of what is missing, from which a function is almost all of it
LEAST_TAKEN = 0.3  # of its power, which an effect must explain
MOMENTS = 0.3  # part of the cells, at most, that counts as a few instants
INFORMATIVE, MORE_MOMENTS = 0.7, 0.45  # the same if no other function has that share
FAR_LESS = 0.35  # of what the best other function leaves, at most
FREE = 1e-3  # ridge on the errors of the model's parameters
MOST = 200 * BLOCKS  # cells, at most
FEWEST = 3 * BLOCKS  # cells, at least
STRIBECK = 0.05  # of the largest speed, where the friction law has no Stribeck speed


@dataclass(frozen=True, eq=False)
class Sliding:
    """Torque missing from the balance of the sliding drive, and on which signals it depends.

    ``missing`` (cells,) in N m; ``known`` (cells, terms): regressors for errors of the model's
    parameters; ``rows``: sample in the middle of each cell; ``expected`` (cells,): acceleration
    of the model, rad/s2.
    """

    log: Log
    rows: np.ndarray
    missing: np.ndarray
    known: np.ndarray
    expected: np.ndarray

    @cached_property
    def torque(self) -> float:
        """All missing torque, RMS, N m."""
        missed = self._missed_by_known[False]
        return float(np.sqrt(np.mean(missed))) if len(missed) else 0.0

    @cached_property
    def dependences(self) -> tuple[Dependence, ...]:
        """Shares of all functions of the signals that are tested."""
        if not len(self.missing):
            return ()
        made = shapes(self.log, self.rows, np.arange(len(self.rows)), self.expected)
        made += [bumps(self.log, self.rows), *hystereses(self.log, self.rows)]
        return (self._in_time(), *map(self._dependence, made))

    def of_signals(self) -> Dependence | None:
        """The clearest of the functions of repeating signals (not time)."""
        return clearest([d for d in self.dependences if "t" not in d.signals])

    def of_signals_for_sure(self) -> Dependence | None:
        """The same if it is certain, even if its share is small."""
        return surest([d for d in self.dependences if "t" not in d.signals])

    def of_time(self) -> Dependence | None:
        """The clearest of the functions of time."""
        return clearest([d for d in self.dependences if "t" in d.signals])

    def of_moments(self) -> Dependence | None:
        """The same if all is missing at a few instants, and no other signal explains nearly as
        much: a single event, whatever the speed and position then."""
        best, explained = self.of_time(), self._explained
        if best is None or 1.0 - best.share > FAR_LESS * (1.0 - explained) ** 2:
            return None
        return (
            best if self._spread < (MOMENTS if explained > INFORMATIVE else MORE_MOMENTS) else None
        )

    def comes_back(self) -> bool:
        """True if the missing torque is a function of repeating signals (not time) and is spread
        over more than ``MOMENTS`` of the record."""
        return self.of_signals() is not None and self._spread > MOMENTS

    def of_fading(self) -> Dependence | None:
        """Friction or a torque constant that changes slowly.

        None if a repeating signal explains nearly as much, or if a slow torque explains more: that
        may be a position passed slowly.
        """
        best = max(self._fading, key=lambda d: d.share, default=None)
        if best is None or len(best.signals) == 1 or clearest([best]) is None:
            return None
        return best if 1.0 - best.share < FAR_LESS * (1.0 - self._explained) else None

    @cached_property
    def _fading(self) -> list[Dependence]:
        made = fading(self.log, self.rows) if len(self.missing) else []
        return [self._dependence(shape) for shape in made]

    @cached_property
    def _explained(self) -> float:
        """The largest share of a function of repeating signals, without weak evidence."""
        back = (d for d in self.dependences if "t" not in d.signals and not d.answers)
        return max((d.share for d in back), default=0.0)

    @cached_property
    def _spread(self) -> float:
        """Part of the cells that contain nearly all of what is missing."""
        missed = np.sort(self._missed_by_known[False])[::-1]
        held = np.cumsum(missed) < NEARLY_ALL * np.sum(missed)
        return float(np.mean(held)) if len(held) else 1.0

    def share(self, signals: tuple[str, ...]) -> float:
        """The largest share of a function of these signals."""
        every = (*self.dependences, *self._fading)
        return max((d.share for d in every if d.signals == signals), default=0.0)

    def size(self, of: Dependence) -> float:
        """RMS torque of one of the functions, N m."""
        return self.torque * float(np.sqrt(of.share))

    @cached_property
    def _block(self) -> np.ndarray:
        return np.arange(len(self.missing)) * BLOCKS // max(len(self.missing), 1)

    def _fold(self, timed: bool) -> np.ndarray:
        cell = np.arange(len(self.missing))
        return cell // TOGETHER % TIMED_FOLDS if timed else self._block % FOLDS

    @cached_property
    def _missed_by_known(self) -> dict[bool, np.ndarray]:
        """Squared residuals with regressors for the model's own errors only, by ``timed`` folds."""
        if not len(self.missing):
            return dict.fromkeys((False, True), self.missing)
        own = [np.zeros(self.known.shape[1])]
        return {t: _missed(self.known, self.missing, self._fold(t), own)[0] for t in (False, True)}

    def _in_time(self) -> Dependence:
        """Share of an arbitrary function of time: each cell is predicted by those around it."""
        X = self.known
        r = self.missing - X @ np.linalg.lstsq(X, self.missing, rcond=None)[0]
        missed = [(r - _between(r, self.rows, width)) ** 2 for width in NEIGHBOURS]
        return self._judged(("t",), missed, timed=True)

    def _dependence(self, shape: Shape) -> Dependence:
        B = shape.B[:, np.any(shape.B != 0.0, axis=0)]
        X = np.column_stack([self.known, B / np.linalg.norm(B, axis=0)])
        stiff = np.arange(X.shape[1]) >= self.known.shape[1]
        missed = _missed(X, self.missing, self._fold(shape.timed), [r * stiff for r in RIDGES])
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
class MissingFunction:
    """A function of signals missing from the balance of the sliding drive.

    ``share`` is its part of the missing power, ``torque`` its RMS and ``whole`` the RMS of all
    that is missing, both in N m.
    """

    signals: tuple[str, ...]
    share: float
    torque: float
    whole: float

    def stays(self, after: Fitted) -> bool:
        """True if it is almost all that is missing and a model with one more effect leaves it."""
        return self.share > NEARLY_ALL and self._left(after) > 1.0 - LEAST_TAKEN

    def is_better_than(self, after: Fitted) -> bool:
        """True if it is almost all that is missing and leaves less than half of what effects do."""
        more = self._left(after) > 2.0 * (1.0 - self.share)
        return self.share > NEARLY_ALL and more and _is_supplied(while_sliding(after).torque, after)

    def _left(self, after: Fitted) -> float:
        """Part of the missing power that another model leaves."""
        return (while_sliding(after).torque / self.whole) ** 2


def _is_supplied(torque: float, fitted: Fitted) -> bool:
    """True if the observer supplies as much as the missing torque, within ``SUPPLIED``."""
    supplied = missing_torque(fitted.predictor, fitted.values, fitted.where, fitted.noise)
    return torque < SUPPLIED * float(np.std(supplied))


def missing_function(fitted: Fitted, *, timed: bool = False) -> MissingFunction | None:
    """What is clearly missing while the drive slides; None if nothing is.

    It counts only if samples that were not fitted show it as well, and if the observer supplies
    as much: too much smoothing of the motion makes a torque seem to be missing. A function of time
    counts only if ``timed``.
    """
    return _seen_twice(fitted, lambda s: s.of_signals() or (s.of_time() if timed else None))


def hidden_in_noise(fitted: Fitted) -> MissingFunction | None:
    """What is certainly missing while the drive slides, even if noise hides most of it.

    In 39 random drives without a missing effect it was at most 0.42 of the least size.
    """
    return _seen_twice(fitted, Sliding.of_signals_for_sure)


def _seen_twice(
    fitted: Fitted, look: Callable[[Sliding], Dependence | None]
) -> MissingFunction | None:
    """What is missing in the fitted windows, if the whole record shows it as well and the
    observer supplies it."""
    sliding = while_sliding(fitted)
    best = look(sliding)
    if not best or not look(while_sliding(fitted, everywhere=True)):
        return None
    found = MissingFunction(best.signals, best.share, sliding.size(best), sliding.torque)
    return found if _is_supplied(found.torque, fitted) else None


def while_sliding(fitted: Fitted, *, everywhere: bool = False) -> Sliding:
    """Torque missing from the balance of torque and measured acceleration, by functions of signals.

    It is regressed on the model's net torque, on torque and friction with free coefficients, and
    on one function. So a function of the torque is meaningful, although the torque contains
    whatever is missing. The shares are cross-validated: coefficients come from other blocks of the
    record than those on which they count; in time, from neighbouring cells. The gain of a block is
    limited to what is missing in it. Used are the fitted windows, or all samples if
    ``everywhere``. Empty if the drive hardly slides, or if the model's torque is not a number.
    """
    data = fitted.predictor.data
    at = cells(data, CELL)
    at = at.only(sliding(data, at) & (everywhere | fitted_cells(fitted, at)))
    at = at.only(_enough(len(at.start)))
    rows = at.start + at.size // 2
    predictor, values = fitted.predictor, fitted.values
    net = at.mean(running(predictor.torque(values, built_up=True)))
    missing = values["J"] * at.mean(running(data.log.a)) - net
    if len(rows) < FEWEST or not np.all(np.isfinite(missing)):
        rows = rows[:0]
        at, net, missing = at.only(rows), net[:0], missing[:0]
    known = _known(fitted, data, at, net)
    return Sliding(data.log, rows, missing, known, net / fitted.values["J"])


def _enough(count: int) -> np.ndarray:
    """Which cells of a long record are used: equal stretches, evenly spread over it."""
    place = np.arange(count) * BLOCKS % max(count, 1) / max(count, 1)  # within its block
    return place < MOST / max(count, MOST)


def sliding(data: Data, at: Cells) -> np.ndarray:
    """True if the drive slides in a cell and in its neighbours, all in the same direction.

    Near a reversal the motion is smoothed across it, and friction depends on the motion before.
    """
    w, slides = moving(data, at)
    way = np.pad(np.where(slides, np.sign(w), 0.0), 1)
    return slides & (way[:-2] == way[1:-1]) & (way[2:] == way[1:-1])


def fitted_cells(fitted: Fitted, at: Cells) -> np.ndarray:
    """True if a cell lies in the fitted windows."""
    counts = np.zeros(len(fitted.predictor.data.t))
    counts[fitted.where.counted] = 1.0
    return at.mean(running(counts)) == 1.0


def _known(fitted: Fitted, data: Data, at: Cells, net: np.ndarray) -> np.ndarray:
    """Regressors for errors of the model's parameters, scaled to unit size."""
    u = at.mean(running(data.u - data.d))
    columns = np.column_stack([net, u, *friction_terms(fitted, data, at)])
    return columns / np.maximum(np.linalg.norm(columns, axis=0), 1e-300)


def friction_terms(fitted: Fitted, data: Data, at: Cells) -> list[np.ndarray]:
    """Unit viscous and Coulomb friction, the excess near rest (Stribeck), and a constant."""
    w = at.mean(running(data.log.w))
    vs = fitted.values.get("vs", STRIBECK * data.log.fastest)
    eps = fitted.values.get("eps", EPS.value)
    level, both = (stribeck(w, Fc=1.0, Fs=Fs, Fv=0.0, vs=vs, eps=eps)[0] for Fs in (1.0, 2.0))
    return [w, level, both - level, np.ones_like(w)]


def _between(r: np.ndarray, rows: np.ndarray, width: int) -> np.ndarray:
    """Weighted mean of up to ``width`` cells before and after each, nearer ones weighted more.

    0 if there are none.
    """
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
    """Squared errors of predictions from the other folds, for each ridge on the columns."""
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
