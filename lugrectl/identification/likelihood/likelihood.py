"""Log-likelihood of the innovations, and the noise of dw/dt that maximises it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from ..dataset.sensor_noise import Noise
from ..dataset.windows import Windows
from .predictor import Predictor, Values

FOUR = (-1.5, -0.5, 0.5, 1.5)  # points of a grid, in steps
SHORT_LOOK = 0.5  # natural log units: steps of a grid that a cubic follows well enough
DIGITS = 6  # of such a logarithm
FARTHEST = 20.0  # the same: limit of the logarithm of the noise in rad/s2
LARGEST = 2_000_000  # counted samples in one call
WORST = 1e100  # innovation of a model that diverges; its square can still be added up


def whitened(
    predictor: Predictor,
    sets: Sequence[Values],
    where: Windows,
    noise: Noise | Sequence[Noise],
) -> np.ndarray:
    """Innovations scaled to unit covariance for a correct model, (sets, windows, length, 2).

    Repeated encoder counts are down-weighted.
    """
    y, _ = predictor.run(sets, where, noise)
    e = compared(predictor.data.y[where.counted], y)
    root = np.sqrt(predictor.data.weight[where.counted])
    noises = [noise] * len(sets) if isinstance(noise, Noise) else noise
    for i, (q, values) in enumerate(zip(noises, sets, strict=True)):
        _, S = predictor.filter(q, values)
        e[i] = e[i] @ np.linalg.inv(np.linalg.cholesky(S)).T * root
    return e


def compared(recorded: np.ndarray, predicted: np.ndarray) -> np.ndarray:
    """Recorded minus predicted values: 0 where nothing was recorded, ``WORST`` if the prediction
    is not a number."""
    e = np.clip(np.nan_to_num(recorded - predicted, nan=WORST), -WORST, WORST)
    e[..., np.isnan(recorded)] = 0.0
    return e


def loglik(
    predictor: Predictor, white: np.ndarray, noise: Noise, values: Values, where: Windows
) -> np.ndarray:
    """Gaussian log-likelihood of each window.

    Repeated encoder counts are down-weighted: they are not independent samples, and predicting
    them at rest is no merit of a model.
    """
    _, S = predictor.filter(noise, values)
    size = np.sum(white**2, axis=(1, 2))
    new = np.sum(predictor.data.weight[where.counted], axis=1)
    return -0.5 * size - new @ np.log(np.diag(np.linalg.cholesky(S)))


def tune(
    predictor: Predictor,
    values: Values,
    where: Windows,
    noise: Noise,
    *,
    width: float = 2.0,
) -> tuple[Noise, np.ndarray]:
    """The noise of dw/dt that maximises the likelihood, and the log-likelihood of each window.

    ``width`` is the half-width of the first grid of four points, in natural log units. The result
    is the peak of a cubic through four points at most half a unit apart.
    """
    seen: dict[float, np.ndarray] = {}

    def look(points: Sequence[float]) -> float:
        """The best of these points; the results are kept in ``seen``."""
        points = [round(x, DIGITS) for x in points]
        new = [x for x in points if x not in seen]
        noises = [replace(noise, jump=float(np.exp(x))) for x in new]
        white = whitened(predictor, [values] * len(noises), where, noises) if new else []
        for x, w, q in zip(new, white, noises, strict=True):
            seen[x] = np.nan_to_num(loglik(predictor, w, q, values, where), nan=-1e300)
        return max(points, key=lambda x: seen[x].sum())

    middle, step = float(np.log(noise.jump)), 2.0 * width / 3.0
    while True:
        best = look([middle + step * k for k in FOUR])
        aside = 2 * round(0.5 * (best - middle) / step)
        if aside and abs(middle) < FARTHEST:
            middle += aside * step
        elif step > SHORT_LOOK:
            middle, step = _peak(seen, middle, step), 0.2 * step
        else:
            break
    look([_peak(seen, middle, step)])
    best = max(seen, key=lambda x: seen[x].sum())
    return replace(noise, jump=float(np.exp(best))), seen[best]


def _peak(seen: Mapping[float, np.ndarray], middle: float, step: float) -> float:
    """Where the cubic through the four points around ``middle`` is highest between them."""
    around = sorted(seen, key=lambda x: abs(x - middle))[: len(FOUR)]
    y = np.array([seen[x].sum() for x in around])
    cubic = np.polyfit((np.array(around) - middle) / step, y - y.max(), 3)
    fine = np.linspace(FOUR[0], FOUR[-1], 301)
    return middle + step * float(fine[np.argmax(np.polyval(cubic, fine))])


def whitened_by_parts(
    predictor: Predictor, sets: Sequence[Values], where: Windows, noise: Noise
) -> np.ndarray:
    """Whitened innovations, in calls that limit the memory."""
    most = max(1, LARGEST // max(1, where.counted.size, len(predictor.data.t) // 2))
    parts = [sets[i : i + most] for i in range(0, len(sets), most)]
    return np.concatenate([whitened(predictor, part, where, noise) for part in parts])
