"""Global search for effects whose likelihood has many local maxima.

The noise may be larger in single windows, so that those in which a hidden state was missed do not
decide (tempering).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.optimize import differential_evolution

from .driven import Driven, driven
from .fit import Fitted, again, tuned
from .likelihood import loglik, whitened
from .noise import Noise
from .windows import spread

ENOUGH, LEAST_WINDOWS = 8_000, 12  # counted samples to search on, and least windows
WIDTHS = (np.inf, 1.0, 0.4)  # search widths about the best set, in units of the box's ``near``
QUIETER = ((0.5, 0.1), (1.0, 0.3), (1.0, 0.3))  # noise factors: a set counts by the better one
ROUNDS = (25, 12, 12)  # generations
CROWD = 8  # sets in a generation, for each searched number
STEPS = 10  # iterations of the fit after each search
WORST = 1e6  # innovation assigned to a set that makes the plant unstable


def forgiving(fitted: Fitted) -> Fitted:
    """The same values, with a noise that may be larger in single windows."""
    return tuned(replace(fitted, noise=replace(fitted.noise, uneven=True)))


def sharpened(fitted: Fitted) -> Fitted:
    """Refit with such a noise."""
    return again(forgiving(fitted))


def search_all(found: Fitted, key: str, loads: Sequence[Driven] | None = None) -> dict[str, float]:
    """Values of the best maximum, by a global search and then by narrower ones.

    The search starts from the values found and from ``loads``, fits of the load driven by the
    measured motion (computed if None). Each search is followed by a fit of all parameters.
    """
    few = _on_few(found)
    starts = [
        replace(few, values=one.values) for one in (driven(found, key) if loads is None else loads)
    ]
    best = max([few, *(again(s, most=STEPS, rough=True) for s in starts)], key=lambda f: f.total)
    for width, factors, rounds in zip(WIDTHS, QUIETER, ROUNDS, strict=True):
        best = _within(best, key, width, factors, rounds)
    return best.values


def closer(found: Fitted, key: str) -> Fitted:
    """Search again near a result from a thinned log, which shows an impact only roughly."""
    best = _within(_on_few(found), key, WIDTHS[1], QUIETER[1], ROUNDS[1])
    other = again(replace(found, values=best.values), most=0)
    return max(found, other, key=lambda f: forgiving(f).total)


def _on_few(found: Fitted) -> Fitted:
    return forgiving(replace(found, where=spread(found.where, ENOUGH, LEAST_WINDOWS)))


def _within(best: Fitted, key: str, width: float, factors: Sequence[float], rounds: int) -> Fitted:
    """The best set within ``width`` of ``best``, after a fit of all parameters."""
    noises = [replace(best.noise, jump=best.noise.jump * factor) for factor in factors]
    values = _searched(best, key, noises, width, rounds)
    start = replace(best, values=values, noise=noises[-1])
    return max(best, again(start, most=STEPS, rough=True), key=lambda f: f.total)


def _searched(
    found: Fitted, key: str, noises: Sequence[Noise], width: float, rounds: int
) -> dict[str, float]:
    """The best set within ``width`` of the one found, by differential evolution."""
    predictor, values = found.predictor, found.values
    made = predictor.model.part(key).block
    assert made.box is not None
    own = {k: values[f"{key}.{k}"] for k in made.own}
    box = made.box(predictor.data.log, {**values, **own})
    low, high = box.low, box.high
    if np.isfinite(width):
        x = np.clip(box.into(own), low, high)
        low, high = np.maximum(low, x - width * box.near), np.minimum(high, x + width * box.near)

    def whole(x: np.ndarray) -> dict[str, float]:
        given = box.at(x)
        return values | {f"{key}.{k}" if k in made.own else k: v for k, v in given.items()}

    def cost(crowd: np.ndarray) -> np.ndarray:
        sets = [whole(x) for x in crowd.T]
        return -np.max([_likelihoods(found, sets, noise) for noise in noises], axis=0)

    best = differential_evolution(
        cost, list(zip(low, high, strict=True)), maxiter=rounds, popsize=CROWD, tol=0.0,
        rng=np.random.default_rng(len(low)), polish=False, init="sobol", updating="deferred",
        vectorized=True,
    )  # fmt: skip
    return whole(best.x)


def _likelihoods(found: Fitted, sets: Sequence[dict[str, float]], noise: Noise) -> list[float]:
    white = whitened(found.predictor, sets, found.where, noise)
    white = np.clip(np.nan_to_num(white, nan=WORST), -WORST, WORST)
    pairs = zip(white, sets, strict=True)
    return [float(loglik(found.predictor, w, noise, s, found.where).sum()) for w, s in pairs]
