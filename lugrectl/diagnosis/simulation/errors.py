"""Errors of models on held-out samples, and what their one-step predictions leave."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...blocks.block import unit_for
from ...blocks.model import Model
from ...core.errors import InputError
from ...estimates.covariance import Residuals, residuals_of
from ...estimates.findings import Traces
from .likelihood import Fit, fitted, innovations, whitened
from .prepared import Prepared
from .runs import Run, Windows

DIVERGES = "The {} model diverges in simulation, so it has no {}."


@dataclass(frozen=True, eq=False)
class Judged:
    """Errors of models on samples that nothing has seen.

    ``error``, ``free_error`` and ``torque_error`` are as in the JSON document, with None where a
    value is missing or a simulation diverged; ``messages`` say why.
    """

    error: dict[str, Any]
    free_error: dict[str, Any]
    torque_error: dict[str, Any]
    traces: Traces
    messages: tuple[str, ...]


def errors(ready: Prepared, models: Mapping[str, Model | None]) -> Judged:
    """Simulate models from the recorded torque alone, and let one observer see what they miss.

    Restarts begin from the state of an observer that has seen samples before the restart only. The
    observer of the residual torque has the gain of "refitted" for all models.

    Parameters
    ----------
    models : mapping
        By name, "declared", "refitted", "augmented": None where values are missing.

    Raises
    ------
    InputError
        If no model is given.
    """
    fits = {name: fitted(ready, model) for name, model in models.items() if model is not None}
    if not fits:
        raise InputError("errors need a model that has all of its values.")
    jump = fits.get("refitted", [*fits.values()][-1]).jump
    measured = np.concatenate([run.recorded[:, ready.channel] for run in ready.runs])
    held_out = np.isfinite(ready.along(ready.test, lambda _, where: where.counted))
    simulated = {k: ready.along(ready.test, _restarted(ready, f)) for k, f in fits.items()}
    residual = {k: ready.along(ready.everywhere, _missing(f, jump)) for k, f in fits.items()}
    seen = np.isfinite(ready.along(ready.everywhere, lambda _, where: where.counted)) & held_out
    said: list[str] = []
    error = _each(models, "error", said, lambda k: _rms((measured - simulated[k])[held_out]))
    free = _each(models, "error without restarts", said, lambda k: _free(ready, fits[k]))
    torque = _each(models, "torque error", said, lambda k: _rms(residual[k][seen]))
    spread = max(float(np.std(measured[held_out])), 1e-300)
    fit = {k: None if e is None else 100.0 * (1.0 - e / spread) for k, e in error.items()}
    unit = {"signal": ready.signal, "unit": ready.unit}
    counts = {"samples": int(held_out.sum()), "horizon": ready.horizon}
    traces = Traces(ready.t, measured, held_out, simulated, residual, _signals(ready, fits, jump))
    return Judged(
        {**unit, **counts, **error, "noise_floor": ready.noise_floor, "fit": fit},
        {**unit, "in_sample": ready.in_sample, **free},
        {"unit": unit_for("N m", ready.model.motion), **torque},
        traces,
        (*ready.messages, *said),
    )


def _each(
    models: Mapping[str, Model | None], what: str, said: list[str], of: Callable[[str], float]
) -> dict[str, float | None]:
    """A value for each model: None where there is no model or it is not a number, which is said."""
    made: dict[str, float | None] = {}
    for name, model in models.items():
        value = None if model is None else of(name)
        made[name] = value if value is not None and np.isfinite(value) else None
        if value is not None and made[name] is None:
            said.append(DIVERGES.format(name, what))
    return made


def _rms(e: np.ndarray) -> float:
    """Root mean square; nan or inf where a simulation diverged."""
    with np.errstate(over="ignore", invalid="ignore"):
        return float(np.sqrt(np.mean(e**2))) if len(e) else np.nan


def _restarted(ready: Prepared, fit: Fit) -> Callable[[Run, Windows], np.ndarray]:
    def signal(run: Run, where: Windows) -> np.ndarray:
        return fit.drive.simulate(run, fit.values, fit.jump, where)[..., ready.channel]

    return signal


def _missing(fit: Fit, jump: float) -> Callable[[Run, Windows], np.ndarray]:
    """The torque missing on the resisting side, N m, as the observer estimates it."""

    def torque(run: Run, where: Windows) -> np.ndarray:
        y, _ = fit.drive.observe(run, [fit.values], [jump], where)
        K, _ = fit.drive.gain(run, fit.values, jump)
        return -fit.values["J"] / run.dt * (innovations(run.y[where.counted], y[0]) @ K[1])

    return torque


def _free(ready: Prepared, fit: Fit) -> float:
    """RMS error of the simulation without restarts."""
    e = [
        (run.recorded[where.counted] - fit.drive.simulate(run, fit.values, fit.jump, where))
        for run, ranges in zip(ready.runs, ready.free, strict=True)
        for where in ranges
        if np.isfinite(run.own[ready.channel])
    ]
    return _rms(np.concatenate([x[..., ready.channel].ravel() for x in e]))


def _signals(ready: Prepared, fits: Mapping[str, Fit], jump: float) -> dict[str, np.ndarray]:
    """The motion as the observer of the last model has it: without noise, nan where it has none."""
    last = [*fits.values()][-1]

    def motion(k: int) -> np.ndarray:
        def one(run: Run, where: Windows) -> np.ndarray:
            return last.drive.observe(run, [last.values], [jump], where)[0][0, ..., k]

        return ready.along(ready.everywhere, one)

    theta, w = motion(0), motion(1)
    dt = np.concatenate([np.full(len(run.t), run.dt) for run in ready.runs])
    a = np.append(np.diff(w), np.nan) / dt
    u = np.concatenate([run.u for run in ready.runs])
    return {"t": ready.t, "theta": theta, "w": w, "u": u, "a": a}


def residuals(ready: Prepared, model: Model) -> Residuals:
    """The tests of what the one-step predictions leave, of w where it is a sensor's.

    Over the training windows of the runs of one rate, those with the most samples.

    Raises
    ------
    InputError
        If a value of the model is missing.
    """
    fit = fitted(ready, model)
    runs = [(run, where) for run, where in zip(ready.runs, ready.train, strict=True)]
    rate = max(runs, key=lambda pair: pair[1].start.size * pair[1].length)[0].dt
    e, u = [], []
    channel = int(next(run for run, _ in runs if run.dt == rate).seen[-1])
    for run, where in runs:
        if run.dt == rate and where.start.size and channel in run.seen:
            e.append(whitened(fit.drive, run, [fit.values], [fit.jump], where)[0][0, ..., channel])
            u.append(run.u[where.counted])
    return residuals_of(("theta", "w")[channel], np.concatenate(e), np.concatenate(u))


def torque_noise(ready: Prepared, model: Model) -> float:
    """Standard deviation of the torque that the model does not predict, per sample, N m."""
    fit = fitted(ready, model)
    return fit.jump * fit.values["J"]
