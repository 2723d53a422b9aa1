"""Effects that a single window tells: a stop that is met once."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .fit import Fitted, information, weighed
from .proof import firmness, share, strength
from .slopes import slopes

ONCE = 0.9  # of the information on a strength, from which a single window tells it
ALL = 0.99  # of what is missing, that is gone with an effect which nothing else confirms
PIECES = 8  # of such a window


def told_once(fitted: Fitted, key: str) -> bool:
    """Whether one window tells nearly all of an effect's strength: others cannot confirm it."""
    if strength(fitted, key)[0] not in [c.key for c in fitted.free]:
        return False
    told = _told(fitted, key)
    return bool(np.max(told) > ONCE * np.sum(told))


def firm_by_itself(without: Fitted, fitted: Fitted, key: str) -> float:
    """How firm an effect is by pieces of the window that tells it; 0 if something is left.

    What is met once may be anything; not so if a law with a few values foresees all its samples.
    """
    if share(without, fitted) < ALL:
        return 0.0
    window = int(np.argmax(_told(fitted, key)))
    parts, scores = _pieces(fitted, key, window)
    finer = replace(
        fitted,
        parts=np.concatenate([np.delete(fitted.parts, window, axis=0), parts]),
        scores=np.concatenate([np.delete(fitted.scores, window, axis=0), scores]),
    )
    return firmness(finer, key)


def _told(fitted: Fitted, key: str) -> np.ndarray:
    """Information on an effect's strength, by window."""
    i = _place(fitted, key)
    return fitted.parts[:, i, i]


def _place(fitted: Fitted, key: str) -> int:
    return [c.key for c in fitted.free].index(strength(fitted, key)[0])


def _pieces(fitted: Fitted, key: str, window: int) -> tuple[np.ndarray, np.ndarray]:
    """Information and gradient of pieces of a window that tell as much of the strength each."""
    where = replace(fitted.where, start=fitted.where.start[[window]])
    r, A = slopes(fitted.predictor, fitted.values, fitted.free, where, fitted.noise)
    (A,), (r,) = weighed(r, A, fitted.noise)
    told = np.cumsum(np.sum(A[_place(fitted, key)] ** 2, axis=-1))
    ends = np.searchsorted(told, told[-1] * np.arange(1, PIECES) / PIECES)
    cut = zip(np.split(A, ends, axis=1), np.split(r, ends), strict=True)
    pieces = [information(a.reshape(len(a), -1), e.ravel()) for a, e in cut]
    parts, scores = zip(*pieces, strict=True)
    return np.array(parts), np.array(scores)
