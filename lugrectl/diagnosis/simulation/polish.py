"""A last polish of values that a torque balance hardly sees, by one-step predictions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ...blocks.model import Model
from ...core.errors import InputError
from ...estimates.covariance import Joint
from .likelihood import Fit, fitted, loglik, tuned, whitened
from .prepared import Prepared
from .runs import Windows

ENOUGH = 40_000  # samples of training windows that are used, evenly spread
WEAK = 1.5  # standard deviation of a coordinate about the start where nothing else is known
WIDE = 0.3  # the same from which a start is no more than a guess: factors on it are tried
FACTORS = (1.0, 0.03, 0.1, 0.3, 0.6, 1.7, 3.0, 10.0, 30.0)
STEP = 1e-3  # of a coordinate, for slopes
MOST, LEAST = 20, 0.1  # steps of a climb, and gain in log-likelihood below which it ends
PARTS, NOISES = (1.0, 0.5, 0.2, 0.05), (1.0, 0.6, 1.5)  # of a step; factors on the noise
FARTHEST = 0.7  # of a coordinate in one step
HALF = 1.96  # standard deviations in half a 95 % interval


@dataclass(frozen=True, eq=False)
class Polished:
    """Values after a polish.

    Attributes
    ----------
    values : dict
        All values of the model, SI; where nothing was gained those from before.
    joint : Joint
        The distribution of the free values that the record determines; of none where nothing was
        gained.
    gained : bool
        Whether left-out training windows are more likely with the polished values, or as likely
        where these confirm the ones before within their intervals.
    gain, error : float
        How much more likely, in log-likelihood, and its standard error over the windows.
    """

    values: dict[str, float]
    joint: Joint
    gained: bool
    gain: float = 0.0
    error: float = 0.0


def polish(
    ready: Prepared, model: Model, free: Sequence[str], start: Joint | None = None
) -> Polished:
    """Make the one-step predictions of training windows most likely, from the model's values on.

    Gauss-Newton steps on the innovations e of an observer with the gain for the noise of dw/dt,
    which is found beside them: minimise the sum of e' S^-1 e / 2 + log det(S) / 2 and the priors.

    Parameters
    ----------
    model : Model
        Its values are where the polish begins; what it states of them (bounds, std, held) holds.
    free : sequence of str
        Keys of ``model.values()`` that may change. Held values, counts per turn, choices and
        instants do not: the likelihood has no slope in them.
    start : Joint or None
        What is known of values beforehand, a Gaussian prior. Others have a weak one: a factor of
        4.5 about their value.

    Raises
    ------
    InputError
        If a key is unknown or a value of the model is missing.

    Notes
    -----
    The covariance is the larger of the likelihood's own and the jackknife's over windows.
    """
    begun = fitted(ready, model)
    few = ready.fewer(ENOUGH)
    coordinates = [c for key in free if (c := _coordinate(ready, model, key)) is not None]
    before = loglik(ready, begun.drive, [begun.values], [begun.jump], few)[0]
    none = Joint((), np.zeros(0), np.zeros((0, 0)), np.zeros(0, bool))
    if not coordinates or len(before) < 2:
        return Polished(begun.values, none, False)
    climb = _Climb(ready, begun, tuple(coordinates), few, start)
    fit = climb.up(climb.scanned())
    parts, scores, each = climb.linear(fit)
    H = parts.sum(0) + climb.weight
    off = np.array([np.linalg.solve(H - p, s) for p, s in zip(parts, scores, strict=True)])
    without = each - np.sum(scores * off, 1) - 0.5 * np.einsum("wi,wij,wj->w", off, parts, off)
    gain, error = float(np.sum(without - before)), float(np.std(without - before))
    error *= len(each) ** 0.5
    C = _covariance(H, off)
    joint = climb.joint(fit.values, C)
    at = [i for i, c in enumerate(coordinates) if c.key in joint.names]
    moved = np.abs(climb.x(fit.values) - climb.x(begun.values))[at]
    same = len(at) > 0 and bool(np.all(moved < HALF * np.sqrt(np.diag(C)[at])))
    if gain > (-error if same else error):
        return Polished(fit.values, joint, True, gain, error)
    return Polished(begun.values, none, False, gain, error)


@dataclass(frozen=True)
class _Coordinate:
    """A free value, stepped in its logarithm or, if it may be 0 or less, in parts of ``size``."""

    key: str
    log: bool
    size: float
    low: float
    high: float
    mean: float
    std: float

    def into(self, value: float) -> float:
        return float(np.log(value)) if self.log else value / self.size

    def back(self, x: float) -> float:
        value = np.exp(min(x, 700.0)) if self.log else x * self.size
        return float(np.clip(value, self.low, self.high))

    def slope(self, value: float) -> float:
        """Of the value over the coordinate."""
        return value if self.log else self.size


def _coordinate(ready: Prepared, model: Model, key: str) -> _Coordinate | None:
    """None for a value that is held, a count, a choice or an instant."""
    declared = model.declarations()
    if key not in declared:
        raise InputError(f"free: {model.name} has no value '{key}'; it has {', '.join(declared)}.")
    p, said, value = declared[key], model.stated.get(key), model.known()[key]
    instant = p.unit == "s" and p.low < 0.0
    if key in model.held() or not p.fitted or p.whole or p.choices or instant:
        return None
    low, high = (said.low, said.high) if said else (None, None)
    low, high = max(p.low, -np.inf if low is None else low), min(p.high, high or np.inf)
    usual = float(np.std(ready.runs[0].u)) if p.unit == "N m" else 0.1
    mean, std = ready.model.values().get(key), said.std if said else None
    return _Coordinate(
        key, p.low >= 0.0 and value > 0.0, max(abs(value), usual), low, high,
        value if mean is None else mean, std or np.inf,
    )  # fmt: skip


def _covariance(H: np.ndarray, off: np.ndarray) -> np.ndarray:
    """Of the coordinates, from their information and what each window moves, (n, n)."""
    own, n = np.linalg.inv(H), len(off)
    scatter = (n - 1) / n * np.sum(off**2, axis=0)
    wider = np.sqrt(np.maximum(scatter / np.diag(own), 1.0))
    return own * np.outer(wider, wider)


@dataclass(frozen=True, eq=False)
class _Climb:
    """Steps towards the maximum of likelihood and priors."""

    ready: Prepared
    begun: Fit
    coordinates: tuple[_Coordinate, ...]
    where: tuple[Windows, ...]
    start: Joint | None

    def x(self, values: Mapping[str, float]) -> np.ndarray:
        return np.array([c.into(values[c.key]) for c in self.coordinates])

    def values(self, x: np.ndarray) -> dict[str, float]:
        """All values; Fs does not fall below Fc."""
        made = dict(self.begun.values)
        made |= {c.key: c.back(v) for c, v in zip(self.coordinates, x, strict=True)}
        if "Fc" in made and "Fs" in made and {"Fc", "Fs"} & {c.key for c in self.coordinates}:
            made["Fs"] = max(made["Fs"], made["Fc"])
        return made

    @cached_property
    def weight(self) -> np.ndarray:
        """The priors' information: of ``start``, of the model's statements, and a weak one."""
        n, values = len(self.coordinates), self.begun.values
        slopes = np.array([c.slope(values[c.key]) for c in self.coordinates])
        known = self.start.names if self.start is not None else ()
        made = np.eye(n) / WEAK**2
        made += np.diag([0.0 if c.key in known else c.std**-2.0 for c in self.coordinates]) * (
            slopes**2
        )
        at = [i for i, c in enumerate(self.coordinates) if c.key in known]
        if at and self.start is not None:
            rows = [known.index(self.coordinates[i].key) for i in at]
            C = self.start.matrix[np.ix_(rows, rows)] / np.outer(slopes[at], slopes[at])
            made[np.ix_(at, at)] += np.linalg.pinv(C, hermitian=True)
        return made

    def cost(self, values: Mapping[str, float]) -> float:
        off = self.x(values) - self.middle
        return 0.5 * float(off @ self.weight @ off)

    @cached_property
    def middle(self) -> np.ndarray:
        """Where the priors are centred: at the start, or at a declared value with its std."""
        known = self.start.names if self.start is not None else ()
        stated = {c.key: c.mean for c in self.coordinates if c.std < np.inf and c.key not in known}
        return self.x(self.begun.values | stated)

    def totals(self, sets: Sequence[Mapping[str, float]], jumps: Sequence[float]) -> np.ndarray:
        """Log-likelihood and priors of each set of values."""
        made = loglik(self.ready, self.begun.drive, sets, jumps, self.where).sum(axis=1)
        return np.nan_to_num(made - [self.cost(v) for v in sets], nan=-np.inf)

    def scanned(self) -> Fit:
        """The best of factors on each value that is no more than a guess, one after the other."""
        fit, std = self.begun, np.diag(np.linalg.inv(self.weight)) ** 0.5
        for i, c in enumerate(self.coordinates):
            if c.log and std[i] > WIDE:
                steps = np.log(FACTORS)[:, None] * (np.arange(len(std)) == i)
                sets = [self.values(self.x(fit.values) + step) for step in steps]
                best = int(np.argmax(self.totals(sets, [fit.jump] * len(sets))))
                fit = replace(fit, values=sets[best])
        return replace(fit, jump=tuned(self.ready, fit.drive, fit.values))

    def up(self, fit: Fit) -> Fit:
        """Gauss-Newton steps, each of the best length and noise."""
        for _ in range(MOST):
            parts, scores, each = self.linear(fit)
            x = self.x(fit.values)
            slope = scores.sum(0) - self.weight @ (x - self.middle)
            step = np.linalg.solve(parts.sum(0) + self.weight, slope)
            step *= min(1.0, FARTHEST / max(float(np.max(np.abs(step))), 1e-300))
            sets = [self.values(x + part * step) for part in PARTS for _ in NOISES]
            jumps = [fit.jump * factor for _ in PARTS for factor in NOISES]
            totals = self.totals(sets, jumps)
            best = int(np.argmax(totals))
            gained = totals[best] - (each.sum() - self.cost(fit.values))
            if gained > 0:
                fit = replace(fit, values=sets[best], jump=jumps[best])
            if gained < LEAST:
                break
        return fit

    def linear(self, fit: Fit) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Information (windows, n, n), slope (windows, n) and log-likelihood (windows,)."""
        x, n = self.x(fit.values), len(self.coordinates)
        sets = [fit.values, *(self.values(x + STEP * row) for row in np.eye(n))]
        jumps = [fit.jump] * (n + 1)
        each = loglik(self.ready, fit.drive, sets[:1], jumps[:1], self.where)[0]
        blocks = []
        for run, where in zip(self.ready.runs, self.where, strict=True):
            if len(where.start):
                e = whitened(fit.drive, run, sets, jumps, where)[0]
                blocks.append((e.reshape(*e.shape[:2], -1)).swapaxes(0, 1))
        parts, scores = [], []
        for e in blocks:
            A = (e[:, :1] - e[:, 1:]) / STEP
            parts.append(A @ A.swapaxes(1, 2))
            scores.append((A @ e[:, 0, :, None])[..., 0])
        return np.concatenate(parts), np.concatenate(scores), each

    def joint(self, values: Mapping[str, float], C: np.ndarray) -> Joint:
        """Of the values whose covariance the record made half as wide as its prior."""
        prior = np.diag(np.linalg.inv(self.weight))
        at = [i for i in range(len(prior)) if C[i, i] < 0.25 * prior[i] or prior[i] < WIDE**2]
        own = [self.coordinates[i] for i in at]
        slopes = np.array([c.slope(values[c.key]) for c in own])
        matrix = C[np.ix_(at, at)] * np.outer(slopes, slopes)
        found = np.array([values[c.key] for c in own])
        return Joint(tuple(c.key for c in own), found, matrix, np.array([c.log for c in own], bool))
