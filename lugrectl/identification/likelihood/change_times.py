"""Change times: the likelihood has steps in them, so they are located on grids, not by slopes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..dataset.kalman import Noise
from ..dataset.windows import Windows
from .likelihood import whitened
from .predictor import Predictor, Values

# of the record: half-width of the first grid; it also reaches from one window into the next, as
# the likelihood is flat between them
NEAR = 0.04
DROP = 1.92  # drop of the log-likelihood at the ends of a 95 % interval


def placed(
    predictor: Predictor,
    moments: Sequence[str],
    where: Windows,
    values: Values,
    noise: Noise,
    *,
    edges: bool = True,
) -> tuple[dict[str, float], dict[str, tuple[float, float]]]:
    """All values with the change times located one after the other, and their 95 % intervals.

    Without ``edges`` the intervals have zero width.
    """
    current, intervals = dict(values), {}
    for key in moments:
        current[key], intervals[key] = place(predictor, current, key, where, noise, edges=edges)
    return current, intervals


def place(
    predictor: Predictor,
    values: Values,
    key: str,
    where: Windows,
    noise: Noise,
    *,
    edges: bool = True,
) -> tuple[float, tuple[float, float]]:
    """The change time of highest likelihood and its 95 % interval, the other values fixed.

    If samples are missing around it, the likelihood is flat there: the middle is returned.
    """
    t, dt = predictor.data.t, predictor.data.dt
    first, last = float(t[0]), float(t[-1])

    def loglik(times: np.ndarray) -> np.ndarray:
        """Without the windows that are the same for all of these times."""
        some = between(where, t, float(np.min(times)), float(np.max(times)))
        if not len(some.start):
            return np.zeros(len(times))
        sets = [dict(values) | {key: float(time)} for time in times]
        white = whitened(predictor, sets, some, noise)
        return -0.5 * np.sum(white**2, axis=(1, 2, 3))

    apart = float(np.max(np.diff(t[where.start]), initial=0.0))
    center, reach = values[key], max(NEAR * (last - first), apart)
    while reach > dt:
        times = np.clip(center + reach * np.linspace(-1.0, 1.0, 9), first, last)
        center, reach = float(times[np.argmax(loglik(times))]), 0.3 * reach
    if not edges:
        return center, (center, center)

    def is_within(time: float) -> bool:
        there, best = loglik(np.array([time, center]))
        return bool(there > best - DROP)

    def edge(sign: float) -> float:
        inside, step = center, dt
        while first < inside < last and is_within(inside + sign * step):
            inside, step = inside + sign * step, 1.5 * step
        while step > 0.5 * dt:
            step *= 0.5
            if is_within(inside + sign * step):
                inside += sign * step
        return float(np.clip(inside + sign * 0.5 * dt, first, last))

    low, high = edge(-1.0), edge(1.0)
    middle = 0.5 * (low + high)
    return (middle if is_within(middle) else center), (low, high)


def between(where: Windows, t: np.ndarray, first: float, last: float) -> Windows:
    """The windows that overlap the interval from ``first`` to ``last``."""
    ends = where.start + where.burn + where.length - 1
    return replace(where, start=where.start[(t[where.start] <= last) & (t[ends] >= first)])
