"""Input denoising: noise on the recorded torque is removed if that explains the motion better."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from .beside import beside
from .data import Data
from .fit import Fitted, refitted
from .noise import NORMAL_MAD, sensor_noise

CALM = 50.0  # least gain in log-likelihood for a denoised torque
ROUGH = 0.002  # noise of the torque over its size: below, it is not denoised
WIDEST = 0.15  # s, of the coarsest detail that is examined
SLOW = 3.2  # removed part over the sample-to-sample noise: above, it is a ripple and no noise
LARGE = 2.5  # typical sizes of a detail, from which it may be signal
SPLINE = np.array([1.0, 4.0, 6.0, 4.0, 1.0]) / 16.0


def calmed(found: Fitted) -> Data | None:
    """Data with a denoised torque; None if that is not clearly more likely.

    Measurement noise on the torque never reached the drive. It makes the estimated inertia too
    large, and any effect that smooths the torque (a lag) look real. Noise from a controller also
    shows in the motion, so it is kept. The likelihood selects up to which level details are
    denoised.
    """
    data = found.predictor.data
    rough = sensor_noise(data.u)
    if rough < ROUGH * float(np.std(data.u)):
        return None
    top = int(np.log2(max(WIDEST / data.dt, 2.0)))
    fits = _fits(found, range(top, 0, -2))
    best = max(fits, key=lambda level: fits[level].total)
    if fits[best].total < found.total + CALM:
        return None
    fits |= _fits(found, [level for level in (best - 1, best + 1) if 0 < level <= top])
    calm = max(fits.values(), key=lambda f: f.total).predictor.data
    return calm if np.std(data.u - calm.u) < SLOW * rough else None


def _fits(found: Fitted, levels: Iterable[int]) -> dict[int, Fitted]:
    """The model refitted with the torque denoised up to each level of detail."""
    data = found.predictor.data

    def fitted(level: int) -> Fitted:
        return refitted(found, data.with_torque(denoised(data.u, data.runs, level)))

    levels = list(levels)
    return dict(zip(levels, beside(fitted, levels), strict=True))


def denoised(u: np.ndarray, runs: Sequence[tuple[int, int]], levels: int) -> np.ndarray:
    """Denoise u (N,) in its details of 1, 2, 4, ... samples.

    Details as small as most of their level are removed. Larger ones are kept, less the noise in
    them, so steps remain steps.

    Notes
    -----
    Undecimated B3-spline wavelets (Starck, Fadili and Murtagh 2007), shrunk by
    w max(0, 1 - (k s/w)^2) with s from the median of abs(w).
    """
    out = u.copy()
    for a, b in runs:
        out[a:b] = _shrunk(u[a:b], levels)
    return out


def _shrunk(u: np.ndarray, levels: int) -> np.ndarray:
    kept = np.zeros_like(u)
    for level in range(levels):
        coarse = _spread(u, 2**level)
        detail = u - coarse
        usual = LARGE * float(np.median(np.abs(detail))) / NORMAL_MAD
        size = np.maximum(np.abs(detail), np.finfo(float).tiny)
        kept += detail * np.maximum(0.0, 1.0 - np.minimum(usual / size, 1.0) ** 2)
        u = coarse
    return u + kept


def _spread(u: np.ndarray, step: int) -> np.ndarray:
    """Spline-weighted mean of neighbours that are ``step`` samples apart."""
    padded, n = np.pad(u, 2 * step, mode="edge"), len(u)
    return SPLINE @ np.array([padded[k * step : k * step + n] for k in range(len(SPLINE))])
