"""Where the states that the motion does not tell are when a window begins: a load in its gap."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .blows import sharpened
from .fit import Fitted
from .likelihood import loglik, whitened
from .noise import Noise

GRID = [(twist, speed**3) for twist in np.linspace(-1, 1, 13) for speed in np.linspace(-1, 1, 7)]
AROUND = np.array([(a, b) for a in (-1.0, 0.0, 1.0) for b in (-1.0, 0.0, 1.0)])
CLOSER = (0.08, 0.03, 0.01)  # steps about the best place so far, as parts of the reach
QUIET = 0.3  # of the noise, under which places are compared
PLACED = 20.0  # gain in log-likelihood from which a place counts
TURNS = 3  # places and fits
AT_ONCE = 2_000_000  # counted samples in one engine call


def settled(found: Fitted) -> Fitted:
    """Fitted again with the hidden states where the windows tell that they were, as long as that
    is better."""
    for _ in range(TURNS):
        other = sharpened(placed(found))
        if other.total < found.total + PLACED:
            break
        found = other
    return found


def placed(found: Fitted) -> Fitted:
    """The same values, the states that the motion does not tell where each window begins there
    where they explain it best.

    A load that floats in its gap is told by the blow that it deals next.
    """
    noise = replace(found.noise, jump=QUIET * found.noise.jump)
    starts, count = found.where.start, len(found.where.start)
    known = _judged(found, noise, None)[0]
    best, reached = np.zeros((count, 2)), np.full(count, -np.inf)
    for steps in (np.array(GRID), *(width * AROUND for width in CLOSER)):
        tried = best + steps[:, None]
        gains = _judged(found, noise, tried)
        top, windows = np.argmax(gains, axis=0), np.arange(count)
        better = gains[top, windows] > reached
        best = np.where(better[:, None], tried[top, windows], best)
        reached = np.maximum(reached, gains[top, windows])
    kept = np.flatnonzero(reached > known + PLACED)
    hidden = {**found.where.hidden, **{int(starts[i]): best[i] for i in kept}}
    return replace(found, where=replace(found.where, hidden=hidden))


def _judged(found: Fitted, noise: Noise, tried: np.ndarray | None) -> np.ndarray:
    """Log-likelihood (places, windows) with the hidden states at places (places, windows, 2)."""
    predictor, values, where = found.predictor, found.values, found.where
    (x0,) = predictor.initial([values], where)
    starts = [x0] if tried is None else [predictor.placed(x0, values, at) for at in tried]
    most = max(1, AT_ONCE // where.counted.size)
    made = []
    for i in range(0, len(starts), most):
        part = starts[i : i + most]
        white = whitened(predictor, [values] * len(part), where, noise, x0=np.concatenate(part))
        made += [loglik(predictor, w, noise, values) for w in white]
    return np.array(made)
