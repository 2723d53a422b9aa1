"""How likely one-step predictions make a record, and the noise of the torque that suits them best.

The innovations of the right model are white, whether or not the drive was in closed loop
(prediction-error method, Ljung, System Identification, ch. 7).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...blocks.model import Model
from ...core.errors import InputError
from .drive import Drive, Values
from .runs import Run, Windows
from .split import Prepared, spread

ENOUGH = 20_000  # samples on which the noise of the torque is found
COARSE = np.linspace(-10.5, 3.0, 10)  # natural logarithms of factors on the usual dw/dt ...
FINE = np.array([-1.0, -0.5, 0.5, 1.0])  # ... and around the best of these
WORST = 1e100  # innovation of a model that diverges; its square can still be added up


@dataclass(frozen=True, eq=False)
class Fit:
    """A model with the noise of dw/dt (rad/s2) that makes its predictions most likely."""

    drive: Drive
    values: dict[str, float]
    jump: float

    def simulated(self, run: Run, where: Windows) -> np.ndarray:
        """theta and w from the torque alone, (windows, length, 2)."""
        return self.drive.simulate(run, self.values, self.jump, where)

    def observed(self, jump: float, run: Run, where: Windows) -> np.ndarray:
        """The torque missing on the resisting side, N m, as the observer for this noise adds it,
        and the observer's theta and w, (windows, length, 3)."""
        y = self.drive.observe(run, [self.values], [jump], where)[0][0]
        K = self.drive.gain(run, self.values, jump)[0][1]
        missing = -self.values["J"] / run.dt * innovations(run.y[where.counted], y) @ K
        return np.concatenate([missing[..., None], y], axis=-1)


def fitted(ready: Prepared, model: Model) -> Fit:
    """The model as it is, with its noise; once for each in a study. InputError where a value is
    missing."""
    model, memory = model.with_defaults(), ready.memory
    values = model.known()
    if missing := [k for k in model.values() if k not in values]:
        raise InputError(f"{model.name}: {', '.join(missing)} has no value to simulate with.")
    structure = tuple((part.key, id(part.block)) for part in (model.friction, *model.effects))
    if structure not in memory:
        memory[structure] = Drive(model), model
    drive, key = memory[structure][0], (structure, *values.values())
    if key not in memory:
        memory[key] = Fit(drive, values, tuned(ready, drive, values))
    return memory[key]


def tuned(ready: Prepared, drive: Drive, values: Values) -> float:
    """The noise of dw/dt, rad/s2, that makes the predictions of training windows most likely."""
    usual, few = max(run.usual for run in ready.runs), spread(ready.train, ENOUGH)

    def totals(logs: np.ndarray) -> np.ndarray:
        made = loglik(ready, drive, [values] * len(logs), usual * np.exp(logs), few)
        return np.nan_to_num(made.sum(axis=1), nan=-np.inf)

    best = COARSE[np.argmax(totals(COARSE))]
    a, b, _ = np.polyfit(FINE, totals(best + FINE), 2)
    peak = np.clip(-0.5 * b / a, FINE[0], FINE[-1]) if a < 0 else 0.0
    return usual * float(np.exp(best + peak))


def loglik(
    ready: Prepared, drive: Drive, sets: Sequence[Values], jumps: Any, windows: Sequence[Windows]
) -> np.ndarray:
    """Gaussian log-likelihood of each window of all runs, for each set, (sets, windows)."""
    made = [
        whitened(drive, run, sets, jumps, where)[1]
        for run, where in zip(ready.runs, windows, strict=True)
        if where.start.size
    ]
    return np.concatenate(made, axis=1)


def whitened(
    drive: Drive, run: Run, sets: Sequence[Values], jumps: Any, where: Windows
) -> tuple[np.ndarray, np.ndarray]:
    """Innovations scaled to unit covariance for a correct model, (sets, windows, length, 2), and
    the log-likelihood of each window, (sets, windows).

    Samples that repeat one count weigh less: they are not independent, and predicting them is no
    merit of a model.
    """
    jumps = [float(jump) for jump in jumps]
    y, _ = drive.observe(run, sets, jumps, where)
    e, size = innovations(run.y[where.counted], y), np.empty((len(sets), 2))
    weight = run.weight[where.counted]
    for i, (values, jump) in enumerate(zip(sets, jumps, strict=True)):
        root = np.linalg.cholesky(drive.gain(run, values, jump)[1])
        e[i] = e[i] @ np.linalg.inv(root).T * np.sqrt(weight)
        size[i] = np.diag(root)
    constant = np.log(size) @ weight.sum(axis=1).T
    return e, -0.5 * np.einsum("swnc,swnc->sw", e, e) - constant


def innovations(measured: np.ndarray, predicted: np.ndarray) -> np.ndarray:
    """Measured minus predicted: 0 where nothing was recorded, ``WORST`` if it is not a number."""
    e = np.clip(np.nan_to_num(measured - predicted, nan=WORST), -WORST, WORST)
    e[..., np.isnan(measured)] = 0.0
    return e
