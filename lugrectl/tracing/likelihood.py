"""The likelihood of what a model predicts from sample to sample."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from .noise import Noise
from .predictor import Predictor, Values, Windows


def whitened(
    predictor: Predictor,
    sets: Sequence[Values],
    where: Windows,
    noise: Noise | Sequence[Noise],
) -> np.ndarray:
    """Innovations with unit covariance where the model is right, (sets, windows, length, 2)."""
    y, _ = predictor.run(sets, where, noise)
    e = np.nan_to_num(predictor.data.y[where.counted] - y, nan=0.0, posinf=1e150, neginf=-1e150)
    noises = [noise] * len(sets) if isinstance(noise, Noise) else noise
    for i, (q, values) in enumerate(zip(noises, sets, strict=True)):
        _, S = predictor.filter(q, values)
        e[i] = e[i] @ np.linalg.inv(np.linalg.cholesky(S)).T
    return e


def loglik(predictor: Predictor, white: np.ndarray, noise: Noise, values: Values) -> np.ndarray:
    """Gaussian log-likelihood of each window."""
    _, S = predictor.filter(noise, values)
    return -0.5 * np.sum(white**2, axis=(1, 2)) - 0.5 * white.shape[1] * np.linalg.slogdet(S)[1]


def tune(
    predictor: Predictor,
    values: Values,
    where: Windows,
    noise: Noise,
    *,
    width: float = 2.0,
    close: float = 0.04,
) -> tuple[Noise, np.ndarray]:
    """The noise of dw/dt under which the innovations are most likely.

    ``width`` is how far the first look reaches, ``close`` how far the last may, in natural log
    units; the answer is good to half of that.
    """
    while True:
        factors = np.exp(width * np.linspace(-1.0, 1.0, 5))
        noises = [replace(noise, jump=noise.jump * f) for f in factors]
        white = whitened(predictor, [values] * len(noises), where, noises)
        logliks = [loglik(predictor, w, q, values) for w, q in zip(white, noises, strict=True)]
        best = int(np.argmax([ll.sum() for ll in logliks]))
        edge = best in (0, 4) and 1e-9 < noise.jump < 1e9
        noise, found = noises[best], logliks[best]
        if not edge:
            if width < close:
                return noise, found
            width *= 0.35
