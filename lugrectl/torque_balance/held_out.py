"""What a fit leaves on rows that it has not seen."""

from __future__ import annotations

import numpy as np

from ..core.regression import robust
from .last_fit import LastFit

PART = 2.0  # s: length of alternate parts
OUTLIER = 10.0  # robust standard deviations beyond which a row counts no more


def unseen(last: LastFit) -> np.ndarray:
    """Residual (m,) of every row under a fit to the other half of the record."""
    d, t = last.design, last.view.rows.t
    r = np.zeros(len(d.y))
    part = (t / min(PART, (t[-1] - t[0]) / 8)).astype(int) % 2
    for own in (0, 1):
        on, off = part == own, part != own
        if off.sum() < d.X.shape[1] + 5:
            return d.y * np.nan
        fit = robust(d.X[off], d.y[off], d.prior, last.scale, last.view.noise)
        r[on] = d.y[on] - d.X[on] @ fit.b
    return r


def clipped(r: np.ndarray) -> np.ndarray:
    """Rows that are far off count as OUTLIER times the usual."""
    far = OUTLIER * 1.4826 * float(np.median(np.abs(r))) + 1e-300
    return np.clip(r, -far, far)


def size(r: np.ndarray) -> float:
    return float(np.sqrt(np.mean(clipped(r) ** 2)))


def structured(r: np.ndarray, t: np.ndarray, step: float, h: float) -> float:
    """RMS of what of a residual lasts longer than a window: torque that nothing explains."""
    first, found = max(4, int(np.ceil(2 * h / max(step, 1e-9)))), 0.0
    r = clipped(r)
    for k in {first, int(1.5 * first), 2 * first, 3 * first}:
        if len(r) < 4 * k:
            continue
        lag = t[k:] - t[:-k]
        c = (r[k:] * r[:-k])[np.abs(lag - np.median(lag)) < 0.5 * step]
        if len(c) > 8:
            found = max(found, abs(float(np.mean(c))) - 2 * float(np.mean(r * r)) / np.sqrt(len(c)))
    return float(np.sqrt(max(found, 0.0)))
