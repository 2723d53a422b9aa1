"""The plain answer is the floor: a finer fit must not leave more of the torque than it does."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy.signal import oaconvolve

from ..identification.balance import Balance
from ..tracing.fit import Fitted

MORE = 1.05  # times what the plain balance leaves; a finer fit that leaves more has failed ...
POINTS = 0.003  # ... if it is also this share of the RMS torque more
FAILED = (
    "The fit by simulation failed: in the same windows it leaves {:.1f} % of the RMS torque, the "
    "plain torque balance {:.1f} %."
)


def failure(fitted: Fitted, plain: Balance) -> str | None:
    """What to say where a fit leaves more of the torque than the plain balance; None if it holds.

    Both are RMS of the residual torque, averaged over the windows of the balance in which the
    drive slides, as a share of the RMS torque there.
    """
    left = share_left(fitted, plain)
    if left is None or plain.left is None or left <= MORE * plain.left + POINTS:
        return None
    return FAILED.format(100.0 * left, 100.0 * plain.left)


def share_left(fitted: Fitted, plain: Balance) -> float | None:
    """Share of the RMS torque that a fit leaves in the windows of the balance."""
    windows, half = plain.residual, plain.half_width
    if windows is None or not half or not plain.left:
        return None
    squares, balanced, count = 0.0, 0.0, 0
    for mine, theirs in _means(fitted, plain):
        squares, balanced = squares + float(mine @ mine), balanced + float(theirs @ theirs)
        count += len(mine)
    return plain.left * float(np.sqrt(squares / balanced)) if count and balanced else None


def _means(fitted: Fitted, plain: Balance) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """For each stretch of the data: the residual of the fit, and of the balance, in windows."""
    data, windows, half = fitted.predictor.data, plain.residual, plain.half_width or 0.0
    assert windows is not None
    J, a = fitted.values["J"], data.log.a
    rest = fitted.predictor.torque(fitted.values, built_up=True) - J * a
    bump = _bump(half / data.dt)
    for begin, end in data.runs:
        t = data.log.t[begin:end]
        at = windows.sliding & (windows.run == data.run[begin])
        at &= (windows.t > t[0] + half) & (windows.t < t[-1] - half)
        if at.any() and end - begin > len(bump):
            mean = oaconvolve(rest[begin:end], bump, "same")
            yield np.interp(windows.t[at], t, mean), windows.value[at]


def _bump(half: float) -> np.ndarray:
    """Weights (1 - s^2)^4 over -half..half samples, of sum 1."""
    s = np.arange(-int(half), int(half) + 1) / max(half, 1.0)
    made = (1.0 - np.clip(s, -1.0, 1.0) ** 2) ** 4
    return made / made.sum()
