"""How likely one-step predictions make a record, and the noise of the torque that suits them best.

The innovations of the right model are white, whether or not the drive was in closed loop
(prediction-error method, Ljung, System Identification, ch. 7).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...blocks.model import Model
from .drive import WORST, Drive, Values
from .prepared import Prepared
from .runs import Run, Windows

ENOUGH = 20_000  # samples on which the noise of the torque is found
COARSE = np.linspace(-10.5, 3.0, 10)  # natural logarithms of factors on the typical dw/dt ...
FINE = np.array([-1.0, -0.5, 0.5, 1.0])  # ... and around the best of these
USUAL = 0.02  # s, over which dw/dt is typical


@dataclass(frozen=True, eq=False)
class Fit:
    """A model with the noise of dw/dt (rad/s2) that makes its predictions most likely."""

    drive: Drive
    values: dict[str, float]
    jump: float


def fitted(ready: Prepared, model: Model) -> Fit:
    """The model as it is, with its noise; computed once for each model of a study.

    Raises InputError where a value is missing.
    """
    model = model.with_defaults()
    values = model.known()
    parts = (model.friction, *model.effects)
    structure = tuple((part.key, id(part.block)) for part in parts)
    if structure not in ready.memory:
        ready.memory[structure] = Drive(model)
    drive, key = ready.memory[structure], (structure, *values.values())
    if key not in ready.memory:
        ready.memory[key] = Fit(drive, values, tuned(ready, drive, values))
    return ready.memory[key]


def tuned(ready: Prepared, drive: Drive, values: Values) -> float:
    """The noise of dw/dt, rad/s2, that makes the predictions of some training windows likeliest."""
    usual = max(_typical(run) for run in ready.runs)
    few = ready.fewer(ENOUGH)

    def totals(logs: np.ndarray) -> np.ndarray:
        jumps = [usual * float(np.exp(x)) for x in logs]
        made = loglik(ready, drive, [values] * len(jumps), jumps, few)
        return np.nan_to_num(made.sum(axis=1), nan=-np.inf)

    best = COARSE[np.argmax(totals(COARSE))]
    points = best + FINE
    a, b, _ = np.polyfit(points - best, totals(points), 2)
    peak = float(np.clip(-0.5 * b / a, FINE[0], FINE[-1])) if a < 0 else 0.0
    return usual * float(np.exp(best + peak))


def _typical(run: Run) -> float:
    """The usual size of dw/dt, rad/s2."""
    w, n = run.speed(), min(run.samples(USUAL), len(run.t) // 3)
    return max(float(np.std(w[n:] - w[:-n])) / (n * run.dt), 1e-12)


def loglik(
    ready: Prepared,
    drive: Drive,
    sets: Sequence[Values],
    jumps: Sequence[float],
    windows: Sequence[Windows],
) -> np.ndarray:
    """Gaussian log-likelihood of each window of all runs, for each set, (sets, windows).

    Samples that repeat one count weigh less: they are not independent, and predicting them is no
    merit of a model.
    """
    made = []
    for run, where in zip(ready.runs, windows, strict=True):
        if len(where.start):
            e, size = whitened(drive, run, sets, jumps, where)
            each = -0.5 * np.sum(e**2, axis=(2, 3))
            made.append(each - where.length * (np.log(size) @ run.weight_seen)[:, None])
    return np.concatenate(made, axis=1)


def whitened(
    drive: Drive, run: Run, sets: Sequence[Values], jumps: Sequence[float], where: Windows
) -> tuple[np.ndarray, np.ndarray]:
    """Innovations scaled to unit covariance for a correct model, and what they were divided by.

    Returns
    -------
    e : (sets, windows, length, 2) array
        Times the root of the sensors' weights; 0 where nothing was recorded.
    size : (sets, 2) array
        The diagonal of the root of their covariance.
    """
    y, _ = drive.observe(run, sets, jumps, where)
    e = innovations(run.y[where.counted], y)
    size = np.empty((len(sets), 2))
    for i, (values, jump) in enumerate(zip(sets, jumps, strict=True)):
        root = np.linalg.cholesky(drive.gain(run, values, jump)[1])
        e[i] = e[i] @ np.linalg.inv(root).T * np.sqrt(run.weight_seen)
        size[i] = np.diag(root)
    return e, size


def innovations(measured: np.ndarray, predicted: np.ndarray) -> np.ndarray:
    """Measured minus predicted values: 0 where nothing was recorded, ``WORST`` if the prediction
    is not a number."""
    e = np.clip(np.nan_to_num(measured - predicted, nan=WORST), -WORST, WORST)
    e[..., np.isnan(measured)] = 0.0
    return e
