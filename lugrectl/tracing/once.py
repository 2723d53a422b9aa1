"""Influence of single windows: effects that only one window supports, like a stop met once."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .fit import Fitted, information, weighed
from .proof import firmness, share, strength
from .slopes import slopes

ONCE = 0.9  # of the information on a strength: above, only this window supports it
ALL = 0.99  # of the missing power, which an effect must explain if nothing else confirms it
PIECES = 8  # into which such a window is cut


def from_one_window(fitted: Fitted, key: str) -> bool:
    """True if one window has nearly all information on an effect's strength.

    The other windows cannot confirm such an effect.
    """
    if strength(fitted, key)[0] not in [c.key for c in fitted.free]:
        return False
    by_window = _information(fitted, key)
    return bool(np.max(by_window) > ONCE * np.sum(by_window))


def firm_by_itself(without: Fitted, fitted: Fitted, key: str) -> float:
    """Significance of an effect from pieces of the window that supports it, as in
    :func:`~lugrectl.tracing.proof.firmness`; 0 if part of the torque remains unexplained.

    An event that occurs once may have any cause, unless a law with a few values predicts all its
    samples.
    """
    if share(without, fitted) < ALL:
        return 0.0
    window = int(np.argmax(_information(fitted, key)))
    parts, scores = _pieces(fitted, key, window)
    finer = replace(
        fitted,
        parts=np.concatenate([np.delete(fitted.parts, window, axis=0), parts]),
        scores=np.concatenate([np.delete(fitted.scores, window, axis=0), scores]),
    )
    return firmness(finer, key)


def _information(fitted: Fitted, key: str) -> np.ndarray:
    """Information on an effect's strength in each window, (windows,)."""
    i = _place(fitted, key)
    return fitted.parts[:, i, i]


def _place(fitted: Fitted, key: str) -> int:
    return [c.key for c in fitted.free].index(strength(fitted, key)[0])


def _pieces(fitted: Fitted, key: str, window: int) -> tuple[np.ndarray, np.ndarray]:
    """Information and gradient of pieces of a window with equal information on the strength."""
    where = replace(fitted.where, start=fitted.where.start[[window]])
    r, A = slopes(fitted.predictor, fitted.values, fitted.free, where, fitted.noise)
    (A,), (r,) = weighed(r, A, fitted.noise)
    gathered = np.cumsum(np.sum(A[_place(fitted, key)] ** 2, axis=-1))
    ends = np.searchsorted(gathered, gathered[-1] * np.arange(1, PIECES) / PIECES)
    cut = zip(np.split(A, ends, axis=1), np.split(r, ends), strict=True)
    pieces = [information(a.reshape(len(a), -1), e.ravel()) for a, e in cut]
    parts, scores = zip(*pieces, strict=True)
    return np.array(parts), np.array(scores)
