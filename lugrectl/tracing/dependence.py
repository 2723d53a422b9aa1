"""Explained share: how much missing torque is a function of some signals, and which to name."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

CLEAR = 0.5  # of what an arbitrary torque could explain: above, a function is accepted
CLEARER = 0.95  # the same for a function that feedback makes likely
SURE = 2.5  # standard errors that the share must exceed
CERTAIN = 5.0  # standard errors from which a smaller share is accepted
NEARLY = 0.85  # of the best share, from which a function of fewer signals is preferred
TINY = 1e-9  # natural log units, or a share


@dataclass(frozen=True)
class Dependence:
    """How much a torque that depends on some signals explains.

    ``share`` is the cross-validated part of what an arbitrary torque would gain; ``t`` is that
    share over its standard error, from the scatter between stretches of the record. ``answers``:
    feedback correlates these signals with any disturbance, so the dependence is weak evidence.
    """

    signals: tuple[str, ...]
    share: float
    t: float
    answers: bool = False


def judged(
    signals: tuple[str, ...], gain: np.ndarray, most: np.ndarray, *, answers: bool = False
) -> Dependence:
    """The share of ``most`` that a function gains, both given by stretch of the record.

    No stretch counts more than it holds. The error is a jackknife over the stretches.
    """
    gain = np.clip(gain, -most, most)
    total = float(most.sum())
    share = float(gain.sum()) / max(total, TINY * (TINY + total))
    rest = (gain.sum() - gain) / np.maximum(most.sum() - most, TINY * (TINY + total))
    error = float(np.sqrt((len(gain) - 1) * np.var(rest)))
    return Dependence(signals, share, share / max(error, TINY), answers)


def clearest(found: Sequence[Dependence]) -> Dependence | None:
    """The best function with a clear share, fewer signals preferred; None if there is none."""
    clear = [d for d in found if d.t > SURE and d.share > (CLEARER if d.answers else CLEAR)]
    return _simplest(clear)


def surest(found: Sequence[Dependence]) -> Dependence | None:
    """The same among functions that are certain, even if noise hides most of the torque."""
    return _simplest([d for d in found if d.t > CERTAIN and not d.answers])


def _simplest(clear: Sequence[Dependence]) -> Dependence | None:
    if not clear:
        return None
    best = max(d.share for d in clear)
    near = [d for d in clear if d.share > NEARLY * best]
    return min(near, key=lambda d: (len(d.signals), -d.share))
