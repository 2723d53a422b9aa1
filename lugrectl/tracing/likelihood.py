"""Log-likelihood of the innovations, and the noise of dw/dt that maximises it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from .noise import Noise
from .predictor import Predictor, Values
from .windows import Windows

SHORT_LOOK = 0.5  # natural log units: a half-width that three points cover well enough
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

    ``width`` is the half-width of the first grid, in natural log units. The result is the vertex
    of a parabola through points one grid step apart, or a quarter of it if ``fine``.
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

    count, center = 5 if width > SHORT_LOOK else 3, float(np.log(noise.jump))
    step = 2.0 * width / (count - 1)
    while True:
        middle = center
        center = look([middle + step * (i - count // 2) for i in range(count)])
        if abs(center - middle) < (count // 2 - 0.5) * step or abs(center) > FARTHEST:
            break
    if step > SHORT_LOOK:
        center, step = _vertex(seen, center, step), 0.25 * step
        center = look([center - step, center, center + step])
    look([_vertex(seen, center, step)])
    best = max(seen, key=lambda x: seen[x].sum())
    return replace(noise, jump=float(np.exp(best))), seen[best]


def _vertex(seen: Mapping[float, np.ndarray], center: float, step: float) -> float:
    """Vertex of the parabola through a point and its neighbours; the point if one is missing."""
    around = sorted(seen, key=lambda x: abs(x - center))[:3]
    x, y = np.array(around) - center, np.array([seen[a].sum() for a in around])
    if np.ptp(x) < 1.9 * step or not np.all(np.isfinite(y)):
        return center
    bend, slope, _ = np.polyfit(x, y - y.max(), 2)
    return center if bend >= 0.0 else center + float(np.clip(-0.5 * slope / bend, -step, step))


def whitened_by_parts(
    predictor: Predictor, sets: Sequence[Values], where: Windows, noise: Noise
) -> np.ndarray:
    """Whitened innovations, in calls that limit the memory."""
    most = max(1, LARGEST // max(1, where.counted.size, len(predictor.data.t) // 2))
    parts = [sets[i : i + most] for i in range(0, len(sets), most)]
    return np.concatenate([whitened(predictor, part, where, noise) for part in parts])
