"""How likely one-step predictions make a record, and the noise of the torque that suits them best.

The innovations of the right model are white, whether or not the drive was in closed loop
(prediction-error method, Ljung, System Identification, ch. 7).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

import numpy as np

from ...blocks.model import Model
from ...core.errors import InputError
from .drive import Drive, Values
from .prepared import Prepared, spread
from .runs import Run, Windows

ENOUGH = 20_000  # samples on which the noise of the torque is found
COARSE = np.linspace(-10.5, 3.0, 10)  # natural logarithms of factors on the usual dw/dt ...
FINE = np.array([-1.0, -0.5, 0.5, 1.0])  # ... and around the best of these
USUAL = 0.02  # s, over which dw/dt is usual
WORST = 1e100  # innovation of a model that diverges; its square can still be added up


@dataclass(frozen=True, eq=False)
class Fit:
    """A model with the noise of dw/dt (rad/s2) that makes its predictions most likely."""

    drive: Drive
    values: dict[str, float]
    jump: float


def fitted(ready: Prepared, model: Model) -> Fit:
    """The model as it is, with its noise; once for each in a study. InputError where a value is
    missing."""
    model, memory = model.with_defaults(), ready.memory
    values = model.known()
    if missing := [k for k in model.values() if k not in values]:
        raise InputError(f"{model.name}: {', '.join(missing)} has no value to simulate with.")
    parts = (model.friction, *model.effects)
    structure = _Structure(model.motion, tuple((p.key, id(p.block)) for p in parts), model)
    drive, key = _drive(structure), (structure.parts, *values.values())
    if key not in memory:
        memory[key] = Fit(drive, values, tuned(ready, drive, values, begun=memory.get("jump")))
        memory["jump"] = memory[key].jump
    return memory[key]


@dataclass(frozen=True)
class _Structure:
    """What is traced of a model, whatever its values are; the model keeps its blocks alive."""

    motion: str
    parts: tuple[tuple[str, int], ...]
    model: Model = field(compare=False)


@lru_cache(maxsize=64)
def _drive(structure: _Structure) -> Drive:
    return Drive(structure.model)


def tuned(ready: Prepared, drive: Drive, values: Values, begun: float | None = None) -> float:
    """The noise of dw/dt, rad/s2, that makes the predictions of training windows most likely.

    ``begun``: that of a model like it, from where the likelier neighbour is followed.
    """
    usual, few = max(map(_usual, ready.runs)), spread(ready.train, ENOUGH)

    def totals(logs: np.ndarray) -> np.ndarray:
        made = loglik(ready, drive, [values] * len(logs), usual * np.exp(logs), few)
        return np.nan_to_num(made.sum(axis=1), nan=-np.inf)

    best = COARSE[np.argmax(totals(COARSE)) if begun is None else _climbed(totals, begun / usual)]
    a, b, _ = np.polyfit(FINE, totals(best + FINE), 2)
    peak = np.clip(-0.5 * b / a, FINE[0], FINE[-1]) if a < 0 else 0.0
    return usual * float(np.exp(best + peak))


def _climbed(totals: Callable[[np.ndarray], np.ndarray], begun: float) -> int:
    """The place of the likeliest of COARSE, from the one next to a factor on."""
    at, known = int(np.argmin(np.abs(COARSE - np.log(begun)))), dict[int, float]()
    while True:
        near = [i for i in (at - 1, at, at + 1) if 0 <= i < len(COARSE)]
        new = [i for i in near if i not in known]
        known |= zip(new, totals(COARSE[new]).tolist(), strict=True) if new else ()
        best = max(near, key=lambda i: known[i])
        if best == at:
            return at
        at = best


def _usual(run: Run) -> float:
    """The usual size of dw/dt, rad/s2."""
    w, n = run.speed, min(run.count(USUAL), len(run.t) // 3)
    return max(float(np.std(w[n:] - w[:-n])) / (n * run.dt), 1e-12)


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
