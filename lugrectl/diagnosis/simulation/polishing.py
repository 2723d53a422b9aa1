"""A last polish of values that a torque balance hardly sees, by one-step predictions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from ...blocks.model import Model
from ...core.numeric import Z95
from ...estimates.covariance import Joint
from .drive import ENOUGH, Fit, fitted, loglik, tuned, whitened
from .records import Prepared, spread

WEAK = 1.5  # standard deviation of a coordinate about its start where nothing else is known
WIDE = 0.3  # the same from which a start is no more than a guess: factors on it are tried
FACTORS = (1.0, 0.03, 0.1, 0.3, 0.6, 1.7, 3.0, 10.0, 30.0)
STEP = 1e-3  # of a coordinate, for slopes
MOST, LEAST = 20, 0.1  # steps of a climb, and gain in log-likelihood below which it ends
PARTS, NOISES = (1.0, 0.5, 0.2, 0.05), (1.0, 0.6, 1.5)  # of a step; factors on the noise
FARTHEST = 0.7  # of a coordinate in one step
FLAT, TINY = 1e-4, 1e-300  # of Fc, least excess of Fs; least variance of a prior
NONE = Joint((), np.zeros(0), np.zeros((0, 0)), np.zeros(0, bool))


@dataclass(frozen=True, eq=False)
class Polished:
    """All values of the model after a polish and the distribution of those that it determined."""

    values: dict[str, float]
    joint: Joint = NONE
    gained: bool = False  # else the values are those before, of no distribution


def polish(
    ready: Prepared, model: Model, free: Sequence[str], start: Joint = NONE, always: bool = False
) -> Polished:
    """Make one-step predictions of training windows most likely, from the model's values on.

    Gauss-Newton steps on the innovations e of an observer with the gain for the noise of dw/dt,
    which is found beside them: minimise the sum of e' S^-1 e / 2 + log det(S) / 2 and the priors.
    ``start`` is what is known beforehand; other values have the std that the model states, or a
    weak prior: a factor of 4.5 about the start. ``always`` keeps the values whatever left-out
    windows say: nothing else tells them. Free those that the balance knows, too, or their errors
    move the others. The covariance is the larger of the likelihood's own and the jackknife's over
    windows: it knows of no error of the model that is the same in all. InputError without a value.
    """
    begun = fitted(ready, model)
    climb = _Climb(ready, begun, model, free, start)
    before = loglik(ready, begun.drive, [begun.values], [begun.jump], climb.where)[0]
    if climb.keys and len(before) > 1:
        with suppress(np.linalg.LinAlgError):  # the model diverges along this log
            return _at_top(climb, begun, before, always)
    return Polished(begun.values)


def _at_top(climb: _Climb, begun: Fit, before: np.ndarray, always: bool) -> Polished:
    """The likeliest values, what is known of them, and whether left-out windows (n,) gain, to first
    order (Takeuchi's criterion), or all values before are within their intervals."""
    tops = [climb.up(one) for one in dict.fromkeys((begun, climb.scanned()))]
    _, fit = climb.best([top.values for top in tops], [top.jump for top in tops])
    parts, scores, each = climb.linear(fit)
    H = parts.sum(0) + climb.weight
    off = np.array([np.linalg.solve(H - p, s) for p, s in zip(parts, scores, strict=True)])
    off *= np.minimum(1.0, FARTHEST / np.maximum(np.max(np.abs(off), axis=1), 1e-300))[:, None]
    own = np.linalg.inv(H)
    gains = each - np.einsum("wi,ij,wj->w", scores, own, scores) - before
    gain, error = float(gains.sum()), float(np.std(gains)) * len(gains) ** 0.5
    scatter = (1.0 - 1.0 / len(off)) * np.sum(off**2, axis=0)
    wider = np.sqrt(np.maximum(scatter / np.diag(own), 1.0))
    C = own * np.outer(wider, wider)
    prior = np.diag(np.linalg.inv(climb.weight))
    at = np.flatnonzero((np.diag(C) < 0.25 * prior) | (prior < WIDE**2))
    moved = np.abs(climb.x(fit.values) - climb.x(begun.values)) / np.sqrt(np.diag(C))
    confirmed = len(at) > 0 and bool(np.all(moved[at] < Z95))
    if not always and gain <= error and not confirmed:
        return Polished(begun.values)
    names, rates = tuple(climb.keys[i] for i in at), climb.rates(fit.values)
    if "Fs" in climb.keys:  # what it is above Fc has a log-normal distribution, and its variance
        V = float(np.clip(C[-1, -1], 1e-12, 1.0))
        rates[-1, -1] *= np.sqrt(np.exp(V) * np.expm1(V) / V)
    found, matrix = np.array([fit.values[k] for k in names]), rates @ C @ rates.T
    joint = Joint(names, found, matrix[at[:, None], at], climb.log[at])
    return Polished(fit.values, joint, True)


class _Climb:
    """Steps towards the maximum of likelihood and Gaussian priors (``middle``, ``weight``) in
    coordinates: the logarithm of a value or, where it may be 0 or less, its part of ``size``."""

    def __init__(
        self, ready: Prepared, begun: Fit, model: Model, free: Sequence[str], start: Joint
    ) -> None:
        own, values = model.declarations(), begun.values
        self.ready, self.begun, rotary = ready, begun, model.motion == "rotary"
        self.where = spread(ready.train, ENOUGH)
        fixed = model.held() | {k for k, p in own.items() if p.choices or not p.fitted}
        fixed |= {k for k, p in own.items() if p.whole and rotary or p.unit == "s" and p.low < 0.0}
        keys = [k for k in free if k not in fixed and np.isfinite(values[k])]
        self.keys = keys = tuple(sorted(keys, key="Fs".__eq__))  # Fs last, as it stands on Fc
        self.bounds = [model.bounds(k) for k in keys]
        found = np.array([values[k] for k in keys])
        self.log = (np.array([own[k].low for k in keys]) >= 0.0) & (found > 0.0)
        usual = [float(np.std(ready.runs[0].u)) if own[k].unit == "N m" else 0.1 for k in keys]
        self.size = np.maximum(np.abs(found), usual)
        std = {k: s.std for k, s in model.stated.items() if s.std and k in keys}
        known = np.diag([std.get(k, np.inf) ** -2.0 for k in keys])
        if before := [k for k in start.names if k in keys and k not in std]:
            here, at = [keys.index(k) for k in before], [start.names.index(k) for k in before]
            C = start.matrix[np.ix_(at, at)]
            size = np.maximum(np.diag(C), TINY) ** 0.5
            scaled = np.linalg.pinv(C / np.outer(size, size), hermitian=True)
            known[np.ix_(here, here)] = scaled / np.outer(size, size)
        rates = self.rates(values)
        self.weight = np.eye(len(keys)) / WEAK**2 + rates.T @ known @ rates
        declared = {k: v for k, v in ready.model.known().items() if k in std}
        self.middle = self.x({**values, **declared})

    def amounts(self, values: Mapping[str, float]) -> np.ndarray:
        """The values; of Fs how much it is above Fc."""
        Fc, Fs = values.get("Fc", 0.0), values.get("Fs", 0.0)
        return np.array([({**values, "Fs": max(Fs - Fc, FLAT * Fc)})[k] for k in self.keys])

    def rates(self, values: Mapping[str, float]) -> np.ndarray:
        """Derivatives of the values by the coordinates, (n, n)."""
        made = np.diag(np.where(self.log, self.amounts(values), self.size))
        if {"Fc", "Fs"} <= {*self.keys}:
            made[-1, self.keys.index("Fc")] = values["Fc"]
        return made

    def x(self, values: Mapping[str, float]) -> np.ndarray:
        v = self.amounts(values)
        return np.where(self.log, np.log(np.where(self.log, v, 1.0)), v / self.size)

    def values(self, x: np.ndarray) -> dict[str, float]:
        """All values inside their bounds; Fs does not fall below Fc."""
        made = dict(self.begun.values)
        ways = zip(self.keys, self.log, self.size, self.bounds, x, strict=True)
        for k, log, size, (low, high), v in ways:
            value = float(np.exp(min(v, 700.0)) if log else v * size)
            value += made.get("Fc", 0.0) if k == "Fs" else 0.0
            made[k] = min(max(value, low), high)
        if "Fc" in self.keys and "Fs" in made:
            made["Fs"] = max(made["Fs"], made["Fc"])
        return made

    def cost(self, values: Mapping[str, float]) -> float:
        off = self.x(values) - self.middle
        return 0.5 * float(off @ self.weight @ off)

    def best(self, sets: Sequence[dict[str, float]], jumps: Sequence[float]) -> tuple[float, Fit]:
        """The likeliest of some values, each with its noise."""
        each = loglik(self.ready, self.begun.drive, sets, jumps, self.where)
        made = each.sum(axis=1) - [self.cost(v) for v in sets]
        i = int(np.argmax(np.nan_to_num(made, nan=-np.inf)))
        return float(made[i]), Fit(self.begun.drive, sets[i], jumps[i])

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
            return self.begun
        return replace(fit, jump=tuned(self.ready, fit.drive, fit.values, fit.jump))

    def up(self, fit: Fit) -> Fit:
        """Gauss-Newton steps, shorter where the whole one loses, each with the best noise."""
        for _ in range(MOST):
            parts, scores, each = self.linear(fit)
            x, total, most = self.x(fit.values), each.sum() - self.cost(fit.values), -np.inf
            slope = scores.sum(0) - self.weight @ (x - self.middle)
            step = np.linalg.solve(parts.sum(0) + self.weight, slope)
            step *= min(1.0, FARTHEST / max(float(np.max(np.abs(step))), TINY))
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
        both = [*zip(self.ready.runs, self.where, strict=True)]
        for run, where in (pair for pair in both if pair[1].size):
            white, each = whitened(fit.drive, run, sets, [fit.jump] * (n + 1), where)
            e = white.reshape(n + 1, len(where.start), -1).swapaxes(0, 1)
            A = (e[:, :1] - e[:, 1:]) / STEP
            made.append((A @ A.swapaxes(1, 2), (A @ e[:, 0, :, None])[..., 0], each[0]))
        parts, scores, each = map(np.concatenate, zip(*made, strict=True))
        return parts, scores, each
