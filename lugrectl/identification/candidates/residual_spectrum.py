"""The spectrum of what a base leaves: where a torque that swings may be."""

from __future__ import annotations

import numpy as np

from .base_model import Base

LOWEST, HIGHEST = 0.2, 60.0  # Hz
PERIODS = 2.0  # of a wave in the record: what has not come back is not seen to be periodic
FASTEST = 0.4  # of the rate of the windows


def lowest(base: Base) -> float:
    """The lowest frequency, Hz, of which the record shows that it comes back."""
    return max(LOWEST, PERIODS / float(base.record.motion.t[-1]))


def spectrum(base: Base) -> tuple[np.ndarray, np.ndarray]:
    """Frequencies, Hz, and what a wave of each would take off the residual; 0 outside the range.

    A wave that the base has already takes nothing off: each is seen beside the columns of the base.
    """
    return base.record.once("spectrum", base, lambda: _spectrum(base))


def _spectrum(base: Base) -> tuple[np.ndarray, np.ndarray]:
    rows = base.record.rows
    place = np.round((rows.t - rows.t[0]) / rows.step).astype(int)
    n = 1 << int(np.ceil(np.log2(2 * (place[-1] + 1))))

    def power(x: np.ndarray) -> np.ndarray:
        y = np.zeros(n)
        y[place] = x * base.roots
        return np.abs(np.fft.rfft(y)) ** 2

    f = np.fft.rfftfreq(n, rows.step)
    room = np.sum(base.roots**2) - sum(power(q) for q in base.basis.T)
    seen = (f > lowest(base)) & (f < min(HIGHEST, FASTEST / rows.step))
    return f, power(base.residual) / np.maximum(room, 1e-3 * np.max(room)) * seen
