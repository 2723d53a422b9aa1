"""A last polish of values that a torque balance hardly sees, by one-step predictions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...blocks.declared_values import Stated
from ...blocks.model import Model
from ...core.errors import InputError
from ...estimates.covariance import Joint
from .likelihood import Fit, fitted, loglik, tuned, whitened
from .prepared import Prepared, spread

ENOUGH = 40_000  # samples of training windows that are used, evenly spread
WEAK = 1.5  # standard deviation of a coordinate about its start where nothing else is known
WIDE = 0.3  # the same from which a start is no more than a guess: factors on it are tried
FACTORS = (1.0, 0.03, 0.1, 0.3, 0.6, 1.7, 3.0, 10.0, 30.0)
STEP = 1e-3  # of a coordinate, for slopes
MOST, LEAST = 20, 0.1  # steps of a climb, and gain in log-likelihood below which it ends
PARTS, NOISES = (1.0, 0.5, 0.2, 0.05), (1.0, 0.6, 1.5)  # of a step; factors on the noise
FARTHEST = 0.7  # of a coordinate in one step
HALF = 1.96  # standard deviations in half a 95 % interval
NONE = Joint((), np.zeros(0), np.zeros((0, 0)), np.zeros(0, bool))


@dataclass(frozen=True, eq=False)
class Polished:
    """All values of the model after a polish, SI, and the distribution of the free ones that the
    record determines.

    ``gain`` is how much more likely left-out training windows are, in log-likelihood, and ``error``
    its standard error. ``gained``: it is above that, or the polish only confirms the values before
    within their intervals and loses no more. Else the values are those before, of no distribution.
    """

    values: dict[str, float]
    joint: Joint
    gained: bool
    gain: float = 0.0
    error: float = 0.0


def polish(
    ready: Prepared, model: Model, free: Sequence[str], start: Joint | None = None
) -> Polished:
    """Make one-step predictions of training windows most likely, from the model's values on.

    Gauss-Newton steps on the innovations e of an observer with the gain for the noise of dw/dt,
    which is found beside them: minimise the sum of e' S^-1 e / 2 + log det(S) / 2 and the priors.

    ``free`` are keys of ``model.values()``; held values, counts per turn, choices and instants stay
    as they are, and bounds hold. ``start`` is what is known beforehand, a Gaussian prior; other
    values have the std that the model states, or a weak prior: a factor of 4.5 about the start.
    Free those that the balance knows, too, or their errors move the others. The covariance is the
    larger of the likelihood's own and the jackknife's over windows: it knows of no error of the
    model that is the same in all windows. InputError for an unknown key or a missing value.
    """
    begun = fitted(ready, model)
    climb = _climb(ready, begun, model, free, start)
    before = climb.each(begun)
    if not climb.keys or len(before) < 2:
        return Polished(begun.values, NONE, False)
    fit = climb.up(climb.scanned())
    parts, scores, each = climb.linear(fit)
    H = parts.sum(0) + climb.weight
    off = np.array([np.linalg.solve(H - p, s) for p, s in zip(parts, scores, strict=True)])
    without = each - np.sum(scores * off, 1) - 0.5 * np.einsum("wi,wij,wj->w", off, parts, off)
    gain = float(np.sum(without - before))
    error = float(np.std(without - before)) * len(each) ** 0.5
    own, scatter = np.linalg.inv(H), (1.0 - 1.0 / len(off)) * np.sum(off**2, axis=0)
    wider = np.sqrt(np.maximum(scatter / np.diag(own), 1.0))
    C = own * np.outer(wider, wider)
    prior = np.diag(np.linalg.inv(climb.weight))
    at = np.flatnonzero((np.diag(C) < 0.25 * prior) | (prior < WIDE**2))
    moved = np.abs(climb.x(fit.values) - climb.x(begun.values)) / np.sqrt(np.diag(C))
    confirmed = len(at) > 0 and bool(np.all(moved[at] < HALF))
    if gain <= (-error if confirmed else error):
        return Polished(begun.values, NONE, False, gain, error)
    names = tuple(climb.keys[i] for i in at)
    found = np.array([fit.values[k] for k in names])
    slopes = np.where(climb.log[at], found, climb.size[at])
    joint = Joint(names, found, C[np.ix_(at, at)] * np.outer(slopes, slopes), climb.log[at])
    return Polished(fit.values, joint, True, gain, error)


@dataclass(frozen=True, eq=False)
class _Climb:
    """Steps towards the maximum of likelihood and priors.

    A coordinate x is the logarithm of a value or, where it may be 0 or less, its part of ``size``.
    Priors are Gaussian about ``middle``, with the information ``weight``.
    """

    ready: Prepared
    begun: Fit
    keys: tuple[str, ...]
    log: np.ndarray
    size: np.ndarray
    ends: np.ndarray
    middle: np.ndarray
    weight: np.ndarray

    def x(self, values: Mapping[str, float]) -> np.ndarray:
        v = np.array([values[k] for k in self.keys])
        return np.where(self.log, np.log(np.where(self.log, v, 1.0)), v / self.size)

    def values(self, x: np.ndarray) -> dict[str, float]:
        """All values inside their bounds; Fs does not fall below Fc."""
        v = np.where(self.log, np.exp(np.where(self.log, np.minimum(x, 700.0), 0.0)), x * self.size)
        made = self.begun.values | dict(zip(self.keys, np.clip(v, *self.ends).tolist()))  # noqa: B905
        if {"Fc", "Fs"} & {*self.keys} and {"Fc", "Fs"} <= {*made}:
            made["Fs"] = max(made["Fs"], made["Fc"])
        return made

    def cost(self, values: Mapping[str, float]) -> float:
        off = self.x(values) - self.middle
        return 0.5 * float(off @ self.weight @ off)

    def each(self, fit: Fit) -> np.ndarray:
        """Log-likelihood of each window."""
        where = spread(self.ready.train, ENOUGH)
        return loglik(self.ready, fit.drive, [fit.values], [fit.jump], where)[0]

    def best(self, sets: Sequence[dict[str, float]], jumps: Sequence[float]) -> tuple[float, Fit]:
        """The likeliest of some values, each with its noise."""
        where, drive = spread(self.ready.train, ENOUGH), self.begun.drive
        made = loglik(self.ready, drive, sets, jumps, where).sum(axis=1)
        made = np.nan_to_num(made - [self.cost(v) for v in sets], nan=-np.inf)
        i = int(np.argmax(made))
        return float(made[i]), Fit(drive, sets[i], jumps[i])

    def scanned(self) -> Fit:
        """The best of factors on each value that is no more than a guess, one after the other."""
        fit, std = self.begun, np.sqrt(np.diag(np.linalg.inv(self.weight)))
        moved = False
        for i in np.flatnonzero(self.log & (std > WIDE)):
            steps = np.log(FACTORS)[:, None] * (np.arange(len(std)) == i)
            sets = [self.values(self.x(fit.values) + step) for step in steps]
            fit = self.best(sets, [fit.jump] * len(sets))[1]
            moved = moved or fit.values is not sets[0]
        if not moved:
            return fit
        return replace(fit, jump=tuned(self.ready, fit.drive, fit.values, fit.jump))

    def up(self, fit: Fit) -> Fit:
        """Gauss-Newton steps, shorter where the whole one loses, each with the best noise."""
        for _ in range(MOST):
            parts, scores, each = self.linear(fit)
            x, total, most = self.x(fit.values), each.sum() - self.cost(fit.values), -np.inf
            slope = scores.sum(0) - self.weight @ (x - self.middle)
            step = np.linalg.solve(parts.sum(0) + self.weight, slope)
            step *= min(1.0, FARTHEST / max(float(np.max(np.abs(step))), 1e-300))
            for part in PARTS:
                sets = [self.values(x + part * step)] * len(NOISES)
                most, ahead = self.best(sets, [fit.jump * factor for factor in NOISES])
                if most > total:
                    fit = ahead
                    break
            if most < total + LEAST:
                break
        return fit

    def linear(self, fit: Fit) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Information (windows, x, x), slope (windows, x) and log-likelihood (windows,)."""
        x, n, made = self.x(fit.values), len(self.keys), []
        sets = [fit.values, *(self.values(x + STEP * row) for row in np.eye(n))]
        both = zip(self.ready.runs, spread(self.ready.train, ENOUGH), strict=True)
        for run, where in ((run, where) for run, where in both if where.start.size):
            white, each = whitened(fit.drive, run, sets, [fit.jump] * (n + 1), where)
            e = white.reshape(n + 1, len(where.start), -1).swapaxes(0, 1)
            A = (e[:, :1] - e[:, 1:]) / STEP
            made.append((A @ A.swapaxes(1, 2), (A @ e[:, 0, :, None])[..., 0], each[0]))
        parts, scores, each = map(np.concatenate, zip(*made, strict=True))
        return parts, scores, each


def _climb(
    ready: Prepared, begun: Fit, model: Model, free: Sequence[str], start: Joint | None
) -> _Climb:
    """The coordinates of the free values, their bounds and priors."""
    own, keys = model.declarations(), []
    for key in free:
        if key not in own:
            raise InputError(f"free: {model.name} has no '{key}'; it has {', '.join(own)}.")
        p = own[key]
        instant = p.unit == "s" and p.low < 0.0  # the likelihood is not smooth in it
        if p.fitted and not (key in model.held() or p.whole or p.choices or instant):
            keys.append(key)
    said, values = [model.stated.get(k, Stated()) for k in keys], begun.values
    low = [own[k].low if one.low is None else one.low for k, one in zip(keys, said, strict=True)]
    high = [
        own[k].high if one.high is None else one.high for k, one in zip(keys, said, strict=True)
    ]
    found = np.array([values[k] for k in keys])
    log = (np.array([own[k].low for k in keys]) >= 0.0) & (found > 0.0)
    usual = [float(np.std(ready.runs[0].u)) if own[k].unit == "N m" else 0.1 for k in keys]
    size = np.maximum(np.abs(found), usual)
    made = _Climb(ready, begun, tuple(keys), log, size, np.array([low, high]), found, np.eye(0))
    slopes, known = np.where(log, found, size), () if start is None else start.names
    std = np.array(
        [np.inf if k in known else one.std or np.inf for k, one in zip(keys, said, strict=True)]
    )
    weight = np.diag(WEAK**-2.0 + (slopes / std) ** 2)
    at = [i for i, k in enumerate(keys) if k in known]
    if start is not None and at:
        rows = [known.index(keys[i]) for i in at]
        C = start.matrix[np.ix_(rows, rows)] / np.outer(slopes[at], slopes[at])
        weight[np.ix_(at, at)] += np.linalg.pinv(C, hermitian=True)
    declared = {k: v for k, v in ready.model.known().items() if k in keys}
    stated = {k: declared.get(k, values[k]) for k, s in zip(keys, std, strict=True) if s < np.inf}
    return replace(made, middle=made.x({**values, **stated}), weight=weight)
