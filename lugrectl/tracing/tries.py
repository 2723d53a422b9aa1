"""Proposals (multi-start): initial values that non-linear effects propose, and the best of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from scipy.ndimage import uniform_filter1d
from scipy.optimize import minimize

from ..blocks.parts import Part as Placed
from ..spec import Block
from .driven import strengths
from .evaluate import missing_torque
from .fit import Fitted
from .likelihood import loglik, whitened
from .predictor import Predictor
from .score import Score, alone_by_parts, orthonormal, whitened_by_parts

DOSE = 0.1  # factor on an effect's series: small as a derivative, but above integration errors
SMEAR = 0.03  # s over which impacts are averaged, so that a small timing error counts little
MANY = 60  # sets, above which only the smoothed torque is compared
STARTS = 3  # sets from which an effect is fitted
LEAST_POWER = 0.02  # least explained share of the smoothed torque for a set to be refined
QUIETER = (1.0, 0.4, 0.15)  # factors on the noise of dw/dt for a set at full strength
POLISH = 60  # evaluations of the smoothed torque around the best set

Values = Mapping[str, float]
Found = tuple[float, dict[str, float]]


def tried(base: Fitted, made: Block, predictor: Predictor, key: str, score: Score) -> list[Found]:
    """The best of the sets that an effect proposes: promise, and all initial values.

    A small dose of its series gives the direction of its change of the innovations. Among sets of
    the same direction, one whose strength agrees with the estimated one is preferred. The best
    set is used twice: with the plant values unchanged, and with them refitted beside it.
    """
    sets = _sets(base, made, key, base.values)
    found: list[Found] = []
    if sets and made.states and made.acts == ("torque",):
        found += Resemblance(base, made, key).best(sets)
    if sets and len(sets) <= MANY:
        worth, columns = _doses(base, predictor, key, score, sets)
        best, *others = np.argsort(worth)[::-1][:STARTS]
        moved = _sets(base, made, key, score.followed(columns[best]))
        found += [(worth[best], one) for one in (*moved[best : best + 1], sets[best])]
        found += [(worth[i], sets[i]) for i in others]
        found += _wholes(base, predictor, sets) if hides(made) else []
    return sorted(found, key=lambda one: -one[0])[:STARTS]


def hides(made: Block) -> bool:
    """True if a refit can hide an effect: it has no linear part that a score test would find."""
    return bool(made.tries) and made.acts != ("torque",)


def _wholes(base: Fitted, predictor: Predictor, sets: Sequence[Values]) -> list[Found]:
    """The gain of the best set at full strength, with the best of several noise levels.

    Around rest a direction gives no information: whether the drive sticks or slips is not a small
    change.
    """
    noises = [replace(base.noise, jump=base.noise.jump * f) for f in QUIETER]
    tried = [(one, q) for one in sets for q in noises]
    white = whitened(predictor, [one for one, _ in tried], base.where, [q for _, q in tried])
    gains = [
        float(loglik(predictor, w, q, one, base.where).sum()) - base.total
        for w, (one, q) in zip(white, tried, strict=True)
    ]
    best = int(np.argmax(np.nan_to_num(gains, nan=-np.inf)))
    return [(gains[best], dict(tried[best][0]))] if gains[best] > 0.0 else []


def _sets(base: Fitted, made: Block, key: str, plant: Values) -> list[dict[str, float]]:
    """All values of the model for each set, including plant values that the set changes."""
    assert made.tries is not None
    sets = []
    for given in made.tries(base.predictor.data.log, plant):
        own = {f"{key}.{k}": float(given.get(k, p.value)) for k, p in made.own.items()}
        moved = {k: float(v) for k, v in given.items() if k in base.values}
        sets.append(dict(plant) | moved | own)
    return sets


def _doses(
    base: Fitted, predictor: Predictor, key: str, score: Score, sets: Sequence[Values]
) -> tuple[list[float], np.ndarray]:
    """Gain in log-likelihood along each set's direction, and the innovations' change, (sets,
    samples), by the whole effect.

    The gain is reduced if the estimated strength differs from that of the set.
    """
    little = predictor.like(predictor.model, {key: DOSE})
    own = [base.values | {k: v for k, v in one.items() if k.startswith(f"{key}.")} for one in sets]
    white = whitened_by_parts(little, own, base)
    columns = ((score.white - white) / DOSE).reshape(len(sets), -1)
    worth = []
    for column in columns:
        gain, (c,) = score.gain(column[None])
        fits = c > 0.0 and np.isfinite(gain)
        worth.append(float(gain / (1.0 + np.log(c) ** 2)) if fits else 0.0)
    return worth, columns


class Resemblance:
    """Share of the missing torque that an effect with states explains, both smoothed in time."""

    def __init__(self, base: Fitted, made: Block, key: str) -> None:
        self.base, self.made, self.placed = base, made, Placed(f"{key}.", made)
        log = self.log = base.predictor.data.log
        self.width = max(1, round(SMEAR / log.dt))
        weights = base.predictor.weights(base.values)
        known = np.array([log.w, np.ones_like(log.w), *weights.values()])
        self.basis = orthonormal(self._seen(known))
        torque = missing_torque(base.predictor, base.values, base.where, base.noise)
        self.target = self._rest(uniform_filter1d(torque, self.width, axis=-1).reshape(1, -1))[0]

    def _seen(self, series: np.ndarray) -> np.ndarray:
        seen = uniform_filter1d(series[:, self.base.where.counted], self.width, axis=-1)
        return seen.reshape(len(series), -1)

    def _rest(self, series: np.ndarray) -> np.ndarray:
        return series - (series @ self.basis) @ self.basis.T

    def power(self, sets: Sequence[Values]) -> tuple[np.ndarray, np.ndarray]:
        """Share of the target that each set explains, and the best factor on its torque."""
        parts = alone_by_parts(self.made, self.log, [self.placed.arguments(s) for s in sets])
        d = np.concatenate([self._rest(self._seen(part)) for part in parts])
        size = np.maximum(np.sum(d * d, axis=1), 1e-300)
        c = np.maximum(d @ self.target, 0.0) / size
        return c * c * size / np.maximum(self.target @ self.target, 1e-300), c

    def best(self, sets: Sequence[Values]) -> list[Found]:
        """The sets that explain most, refined, with their estimated gain in log-likelihood."""
        power, c = self.power(sets)
        top = np.argsort(-power)[:2]
        return [
            (self.worth(float(power[k])), self._polished(self._scaled(sets[k], float(c[k]))))
            for k in top
            if power[k] > LEAST_POWER
        ]

    def _scaled(self, start: Values, c: float) -> dict[str, float]:
        """Scale mass, spring and damper by c, if that makes c times the torque."""
        strong = {f"{self.placed.prefix}{k}" for k in strengths(self.made)}
        scaled = {k: v * c if k in strong else v for k, v in start.items()}
        (before, after), (_, factor) = self.power([start, scaled])
        return scaled if abs(after - before) < 0.01 and abs(factor - 1.0) < 0.1 else dict(start)

    def worth(self, power: float) -> float:
        """Gain in log-likelihood for such a share; a smoothed stretch counts as one sample."""
        return -0.5 * len(self.target) / self.width * float(np.log1p(-min(power, 1.0 - 1e-9)))

    def _polished(self, start: Values) -> dict[str, float]:
        """A set nearby that explains more, by a simplex search in logarithms."""
        names = [f"{self.placed.prefix}{k}" for k, p in self.made.own.items() if p.fitted]

        def at(x: np.ndarray) -> dict[str, float]:
            moved = {k: float(start[k] * np.exp(v)) for k, v in zip(names, x, strict=True)}
            return dict(start) | moved

        def miss(x: np.ndarray) -> float:
            power, c = self.power([at(x)])
            return -float(power[0]) + 0.01 * float(np.log(max(c[0], 1e-9)) ** 2)

        options = {"maxfev": POLISH, "initial_simplex": _simplex(len(names))}
        return at(minimize(miss, np.zeros(len(names)), method="Nelder-Mead", options=options).x)


def _simplex(n: int) -> np.ndarray:
    return np.vstack([np.zeros(n), 0.15 * np.eye(n)])
