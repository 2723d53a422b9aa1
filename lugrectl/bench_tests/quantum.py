"""The step of a register."""

from __future__ import annotations

import numpy as np

ROUNDING = 1e-7  # of the span, below which two values are one
FEWEST = 12  # steps between values: of a few levels none is known
DENSE = 0.7  # values per row from which a signal is no register's


def smallest(x: np.ndarray) -> float:
    """The step between the values that a signal takes, beyond rounding; 0 where they lie dense
    or are but a few levels."""
    values = np.unique(x)
    steps = np.diff(values)
    steps = steps[steps > ROUNDING * np.ptp(x)]
    if len(steps) < FEWEST or len(values) > DENSE * len(x):
        return 0.0
    return float(np.quantile(steps, 0.05))
