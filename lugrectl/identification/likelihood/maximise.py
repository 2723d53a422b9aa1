"""Maximum likelihood (prediction error method): parameters from one-step predictions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import NamedTuple

import numpy as np
from scipy import stats

from ..dataset.dataset import Data
from ..dataset.kalman import Noise
from ..dataset.windows import Windows
from ..unknown_torque.discrepancy import inverse, unit_diagonal
from .change_times import placed
from .likelihood import loglik, slopes, tune, whitened
from .parameters import (
    Coordinate,
    Prior,
    coordinates,
    free_keys,
    inside,
    is_instant,
    known,
    stated_cost,
    weak,
)
from .predictor import Predictor, Values

FLAT = 1e-8  # of the scaled information, below which a direction is not identified
ANYWHERE = 1e50  # how far an unidentified coordinate may move
PART = 0.1  # component of a direction, from which a parameter belongs to it
ROUNDS = 3  # of noise, change times and steps, at most
SAME = 1.0  # gain in log-likelihood of a round, below which it is the last
SETTLED = 0.1  # gain in log-likelihood that a step promises, below which it is the last
NOISE_STEPS = (1.0, 0.6, 0.25, 1.5)  # factors tried at each step of a fit ...
QUIET = 0.01  # ... that promises this for each sample; a smaller gain hardly changes the noise


@dataclass(frozen=True)
class Fitted:
    """Values at the maximum of the likelihood, with what is needed to assess them.

    ``anchor`` holds the centre of the prior; ``loglik`` has one value for each window; ``parts``
    and ``scores`` are the windows' information and gradient in the coordinates, for intervals;
    ``innovations`` are whitened, (windows, length, channels). ``others`` are other maxima that are
    as likely: the intervals contain theirs.
    """

    predictor: Predictor
    values: dict[str, float]
    free: tuple[Coordinate, ...]
    where: Windows
    noise: Noise
    loglik: np.ndarray
    innovations: np.ndarray = field(repr=False)
    parts: np.ndarray = field(repr=False)
    scores: np.ndarray = field(repr=False)
    anchor: dict[str, float] = field(default_factory=dict)
    instants: dict[str, tuple[float, float]] = field(default_factory=dict)
    others: tuple[Fitted, ...] = ()
    discrepancy: np.ndarray | float = field(default=0.0, repr=False)

    @property
    def total(self) -> float:
        """Log-likelihood, with the priors that the model states."""
        return float(self.loglik.sum()) - stated_cost(self.free, self.values)

    @property
    def torque_noise(self) -> float:
        """Standard deviation of the torque that the model does not predict, per sample."""
        return self.noise.jump * self.values["J"]

    @property
    def information(self) -> np.ndarray:
        return self.parts.sum(0)

    def covariance(self) -> np.ndarray:
        """Covariance of the coordinates: the larger of the model's own and the jackknife over
        windows.

        The jackknife stays valid where the innovations are coloured, and where a few windows hold
        most of the information. A coordinate that hardly any window identifies keeps its prior
        variance.
        """
        believed = np.diag(weak(self.free)) + known(self.free, self.values, bounds=True)
        own = inverse(self.information + believed)
        scatter = jackknife(self.parts, self.scores, believed)
        size = np.maximum(np.diag(own), 1e-12 * scatter + 1e-300)
        ratio = np.sqrt(np.maximum(scatter / size, 1.0))
        return own * np.outer(ratio, ratio) + self.discrepancy

    def flat(self) -> list[tuple[str, ...]]:
        """Keys of which the record identifies a combination only, by direction."""
        stated = known(self.free, self.values, bounds=True)
        return flat(self.information + stated, self.free)

    def intervals(self) -> dict[str, tuple[float, float]]:
        """95 % intervals by key; that of a phase may reach beyond half a turn.

        A parameter that the record cannot identify, or only a single window of it, has none.
        """
        unidentified = {key for keys in self.flat() for key in keys}
        width = np.sqrt(np.diag(self.covariance())) * stats.t.ppf(0.975, len(self.scores) - 1)
        made = dict(self.instants)
        for c, half in zip(self.free, width, strict=True):
            if c.key in unidentified or half > ANYWHERE:
                continue
            ends = c.ends(self.values, half)
            if ends is not None:
                made[c.key] = ends
        theirs = [(other.values, other.intervals()) for other in self.others]
        for key, (low, high) in made.items():
            every = [ends.get(key, (own[key], own[key])) for own, ends in theirs]
            made[key] = min([low, *(a for a, _ in every)]), max([high, *(b for _, b in every)])
        return made


def flat(
    information: np.ndarray, coords: Sequence[Coordinate], least: float = FLAT
) -> list[tuple[str, ...]]:
    """Keys of which only a combination is identified, for each direction with less information
    than ``least``."""
    values, axes = np.linalg.eigh(unit_diagonal(information)[0])
    return [
        tuple(c.key for c, part in zip(coords, axis, strict=True) if abs(part) > PART)
        for value, axis in zip(values, axes.T, strict=True)
        if value < least
    ]


def jackknife(
    parts: np.ndarray, scores: np.ndarray, believed: np.ndarray | float = 0.0
) -> np.ndarray:
    """Jackknife variance of each coordinate: how far the optimum moves without each window.

    ``parts`` (windows, p, p) and ``scores`` (windows, p) are their information and gradients,
    ``believed`` (p, p) is the information of the prior. A coordinate that only one window
    identifies moves without bound when that window is left out.
    """
    whole, n = parts.sum(0) + believed, len(parts)
    moved = np.full(scores.shape, ANYWHERE)
    for i, (part, score) in enumerate(zip(parts, scores, strict=True)):
        rest = whole - part
        known = np.flatnonzero(np.diag(rest) > FLAT * np.diag(whole))
        moved[i, known] = inverse(rest[known][:, known]) @ score[known]
    return (n - 1) / n * np.sum(np.square(moved), axis=0)


def fit(
    predictor: Predictor,
    values: Values,
    free: Sequence[str],
    where: Windows,
    noise: Noise,
    *,
    anchor: Values | None = None,
    most: int = 30,
    rough: bool = False,
    hold: bool = False,
) -> Fitted:
    """Maximise the likelihood of the predictions over the free values and the noise of dw/dt.

    At most ``most`` Levenberg-Marquardt steps, with the noise adapted in each. ``anchor`` is the
    centre of a weak prior (default: ``values``), which keeps unidentified directions at their
    declared values. ``rough`` leaves out what only intervals need. With ``hold`` the first steps
    hold the noise as given. (Under a large noise the observer gain is high and compensates wrong
    values; then no small change of the values and the noise together is better.) A fit ends
    with the step that promises hardly any gain, or when two steps in a row do not keep what they
    promise.
    """
    anchor = dict(values) | dict(anchor or {})
    declared = predictor.declarations()
    moments = [k for k in free if is_instant(declared[k])]
    anchor = predictor.model.kept(anchor)
    coords = coordinates(predictor, [k for k in free if k not in moments], anchor)
    coords = [c.around(values[c.key]) for c in coords]
    values = inside(coords, values, predictor.model)
    place_all = partial(placed, predictor, moments, where)
    climb = _Climb(predictor, coords, where, Prior.at(coords, anchor))
    if hold:
        values, _ = place_all(values, noise, edges=False)
        values, noise, *_ = climb.up(values, noise, most, (1.0,))
    linear = None
    for _ in range(ROUNDS):
        noise, _ = tune(predictor, values, where, noise, width=0.25)
        values, _ = place_all(values, noise, edges=False)
        values, noise, linear, gain = climb.up(values, noise, most)
        if linear is not None and gain < SAME:
            break
    else:
        noise, _ = tune(predictor, values, where, noise, width=0.25)
        linear = None
    values, instants = place_all(values, noise, edges=not rough)
    if linear is None or moments:
        linear = climb.linearised(values, noise)
    white = whitened(predictor, [values], where, noise)[0]
    return Fitted(
        predictor, values, tuple(coords), where, noise,
        loglik(predictor, white, noise, values, where), white, linear.parts, linear.scores,
        anchor, instants,
    )  # fmt: skip


def again(found: Fitted, *, most: int = 30, rough: bool = False) -> Fitted:
    """Refit everything from the values of a fit, some fields of which may have been replaced."""
    return fit(
        found.predictor, found.values, free_keys(found.predictor), found.where, found.noise,
        anchor=found.anchor, most=most, rough=rough,
    )  # fmt: skip


def standing(predictor: Predictor, values: Values, where: Windows, noise: Noise) -> Fitted:
    """Given values and noise; nothing is free."""
    white = whitened(predictor, [values], where, noise)[0]
    each = loglik(predictor, white, noise, values, where)
    own, many = dict(values), len(white)
    parts, scores = np.zeros((many, 0, 0)), np.zeros((many, 0))
    return Fitted(predictor, own, (), where, noise, each, white, parts, scores, own)


def tuned(found: Fitted) -> Fitted:
    """The same values with the noise that makes them most likely."""
    noise, each = tune(found.predictor, found.values, found.where, found.noise)
    return replace(found, noise=noise, loglik=each)


def seen_on(found: Fitted, where: Windows) -> Fitted:
    """The same values and noise on other windows; what intervals need stays."""
    there = standing(found.predictor, found.values, where, found.noise)
    return replace(found, where=where, loglik=there.loglik, innovations=there.innovations)


def refitted(found: Fitted, data: Data) -> Fitted:
    """A few steps from the values of a fit, on other data of the same samples."""
    free = [c.key for c in found.free] + list(found.instants)
    return fit(
        found.predictor.on(data), found.values, free, found.where, found.noise,
        anchor=found.anchor, most=8, rough=True,
    )  # fmt: skip


def identified_covariance(found: Fitted) -> np.ndarray:
    """Covariance of the coordinates that the record identifies, 0 for the others, (coords,
    coords)."""
    C = found.covariance()
    known = np.diag(C) < ANYWHERE
    return np.where(np.outer(known, known), C, 0.0)


def information(A: np.ndarray, r: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A A' and the score A r of samples, A (..., coords, n) and r (..., n)."""
    return A @ A.swapaxes(-1, -2), (A @ r[..., None])[..., 0]


@dataclass(frozen=True)
class _Linear:
    """Linearised innovations: information A'A and score A'r of each window."""

    parts: np.ndarray
    scores: np.ndarray

    def moved(self, dx: np.ndarray) -> _Linear:
        """The same after a small step."""
        return replace(self, scores=self.scores - self.parts @ dx)


class _Reached(NamedTuple):
    """Where steps have led: values and noise, the gain on the way, what is linearised there."""

    values: dict[str, float]
    noise: Noise
    linear: _Linear | None
    gain: float


@dataclass(frozen=True)
class _Climb:
    """Levenberg-Marquardt steps towards the maximum of likelihood and prior."""

    predictor: Predictor
    coords: Sequence[Coordinate]
    where: Windows
    prior: Prior

    def up(
        self, values: Values, noise: Noise, most: int, factors: Sequence[float] = NOISE_STEPS
    ) -> _Reached:
        current, damping = dict(values), 1e-3
        noise, total = self.judged(current, noise, (1.0,))
        first, small = total, 0
        linear = self.linearised(current, noise)
        for _ in range(most):
            ahead, promised, dx = self.ahead(linear, current, damping)
            loud = promised > QUIET * self.where.counted.size
            better, reached = self.judged(ahead, noise, factors if loud else (1.0,))
            if reached > total:
                small = small + 1 if reached - total < SETTLED else 0
                current, noise, total = ahead, better, reached
            if promised < SETTLED or promised < SAME and total != reached:
                linear = linear.moved(dx) if total == reached else linear
                break
            if small == 2:
                return _Reached(current, noise, None, total - first)
            if total == reached:
                damping = max(0.1 * damping, 1e-8)
                linear = self.linearised(current, noise)
            else:
                damping *= 100.0
        return _Reached(current, noise, linear, total - first)

    def judged(self, values: Values, noise: Noise, factors: Sequence[float]) -> tuple[Noise, float]:
        """The best of some noises for these values, and the sum of log-likelihood and prior."""
        noises = [replace(noise, jump=noise.jump * f) for f in factors]
        white = whitened(self.predictor, [values] * len(noises), self.where, noises)
        totals = [
            loglik(self.predictor, w, q, values, self.where).sum()
            for w, q in zip(white, noises, strict=True)
        ]
        best = int(np.argmax(np.nan_to_num(totals, nan=-np.inf)))
        return noises[best], float(totals[best]) - self.prior.cost(values)

    def ahead(
        self, linear: _Linear, values: Values, damping: float
    ) -> tuple[dict[str, float], float, np.ndarray]:
        """The values after a step, the gain that the linearised innovations promise, the step."""
        pull, weight = self.prior.pull(values)
        gradient, H = linear.scores.sum(0) + pull, linear.parts.sum(0) + weight
        stuck = [c.stuck(values[c.key], g) for c, g in zip(self.coords, gradient, strict=True)]
        if any(stuck):
            gradient, H = np.where(stuck, 0.0, gradient), H * ~np.logical_or.outer(stuck, stuck)
        dx = _step(H, gradient, damping)
        promised = float(gradient @ dx - 0.5 * dx @ H @ dx)
        return moved(values, self.coords, dx), promised, dx

    def linearised(self, values: Values, noise: Noise) -> _Linear:
        r, A = slopes(self.predictor, values, self.coords, self.where, noise)
        A, r = A.swapaxes(0, 1), r.reshape(len(r), -1)
        return _Linear(*information(A.reshape(*A.shape[:2], r.shape[1]), r))


def _step(H: np.ndarray, gradient: np.ndarray, damping: float) -> np.ndarray:
    scale = np.sqrt(np.maximum(np.diag(H), 1e-300))
    unit = H / np.outer(scale, scale) + damping * np.eye(len(scale))
    return np.linalg.lstsq(unit, gradient / scale, rcond=1e-12)[0] / scale


def moved(values: Values, coords: Sequence[Coordinate], dx: np.ndarray) -> dict[str, float]:
    """The values after a step, which in a logarithm is limited to a factor of two."""
    made = dict(values)
    for c, step in zip(coords, dx, strict=True):
        limited = step if c.kind == "linear" else np.clip(step, -0.7, 0.7)
        made[c.key] = c.back(c.into(values) + limited, made)
    return made
