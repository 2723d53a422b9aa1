"""How much of what is missing is a function of some signals, and which of them to name."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

CLEAR = 0.5  # of what any torque could explain, above which a function is taken to be it
CLEARER = 0.95  # the same where a loop that fights any disturbance makes it likely
SURE = 2.5  # standard errors that it must have
CERTAIN = 5.0  # standard errors of one that need not be clear
NEARLY = 0.85  # of the best function's share, from which one of fewer signals is preferred
TINY = 1e-9  # natural log units, or a share


@dataclass(frozen=True)
class Dependence:
    """How much a torque that depends on some signals explains.

    ``share`` is the part, cross-validated, of what the best torque of any kind would bring;
    ``t`` that share over its standard error, by how much stretches of the record differ.
    ``answers``: a loop that fights a disturbance makes such a function likely.
    """

    signals: tuple[str, ...]
    share: float
    t: float
    answers: bool = False


def judged(
    signals: tuple[str, ...], gain: np.ndarray, most: np.ndarray, *, answers: bool = False
) -> Dependence:
    """The share of ``most`` that a function gains, both by stretch of the record; each counts
    at most as much as it holds. The error comes from leaving out each of them in turn."""
    gain = np.clip(gain, -most, most)
    total = float(most.sum())
    share = float(gain.sum()) / max(total, TINY * (TINY + total))
    rest = (gain.sum() - gain) / np.maximum(most.sum() - most, TINY * (TINY + total))
    error = float(np.sqrt((len(gain) - 1) * np.var(rest)))
    return Dependence(signals, share, share / max(error, TINY), answers)


def clearest(found: Sequence[Dependence]) -> Dependence | None:
    """The best function that is clear, one of fewer signals preferred; none where none is."""
    clear = [d for d in found if d.t > SURE and d.share > (CLEARER if d.answers else CLEAR)]
    return _simplest(clear)


def surest(found: Sequence[Dependence]) -> Dependence | None:
    """The same of those that are certain, though noise may hide most of them."""
    return _simplest([d for d in found if d.t > CERTAIN and not d.answers])


def _simplest(clear: Sequence[Dependence]) -> Dependence | None:
    if not clear:
        return None
    best = max(d.share for d in clear)
    near = [d for d in clear if d.share > NEARLY * best]
    return min(near, key=lambda d: (len(d.signals), -d.share))
