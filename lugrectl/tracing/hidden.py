"""Initial-state estimation: the states of a load that the motion does not show, at the start of
each window."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from .blows import sharpened
from .fit import Fitted
from .likelihood import loglik, whitened
from .score import LARGEST

# twist and speed, as parts of their range
GRID = np.array([(a, b**3) for a in np.linspace(-1, 1, 13) for b in np.linspace(-1, 1, 7)])
AROUND = np.array([(a, b) for a in (-1.0, 0.0, 1.0) for b in (-1.0, 0.0, 1.0)])
CLOSER = (0.08, 0.03, 0.01)  # steps about the best state so far
QUIET = 0.3  # of the noise, at which states are compared
PLACED = 20.0  # least gain in log-likelihood of another state
TURNS = 3  # of estimating the states and refitting


def with_hidden(found: Fitted) -> Fitted:
    """Estimate the hidden states and refit, in turn, as long as that is better."""
    for _ in range(TURNS):
        other = sharpened(placed(found))
        if other.total < found.total + PLACED:
            break
        found = other
    return found


def placed(found: Fitted) -> Fitted:
    """The same values with the two hidden states at the start of each window where they are most
    likely.

    A load that floats in its gap is located by its next impact.
    """
    predictor, values, where = found.predictor, found.values, found.where
    quiet = replace(found, noise=replace(found.noise, jump=QUIET * found.noise.jump))
    (x0,) = predictor.initial([values], where)
    (known,), each = _judged(quiet, [x0]), np.arange(len(x0))
    best, reached = np.zeros((len(x0), 2)), np.full(len(x0), -np.inf)
    for steps in (GRID, *(width * AROUND for width in CLOSER)):
        tried = best + steps[:, None]
        gains = _judged(quiet, [predictor.placed(x0, values, at) for at in tried])
        top = np.argmax(gains, axis=0)
        better = gains[top, each] > reached
        best = np.where(better[:, None], tried[top, each], best)
        reached = np.maximum(reached, gains[top, each])
    kept = np.flatnonzero(reached > known + PLACED)
    hidden = {**where.hidden, **{int(where.start[i]): best[i] for i in kept}}
    return replace(found, where=replace(where, hidden=hidden))


def _judged(found: Fitted, starts: Sequence[np.ndarray]) -> np.ndarray:
    """Log-likelihood (starts, windows) from each of such states (windows, states)."""
    predictor, values, where, noise = found.predictor, found.values, found.where, found.noise
    most, made = max(1, LARGEST // where.counted.size), []
    for i in range(0, len(starts), most):
        part = starts[i : i + most]
        white = whitened(predictor, [values] * len(part), where, noise, x0=np.concatenate(part))
        made += [loglik(predictor, w, noise, values, where) for w in white]
    return np.array(made)
