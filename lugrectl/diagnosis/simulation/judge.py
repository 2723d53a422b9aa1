"""Errors of models on held-out samples, and what their one-step predictions leave."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from ...blocks.block import unit_for
from ...blocks.model import Model
from ...core.numeric import rms
from ...estimates.covariance import Residuals, residuals_of
from ...estimates.findings import Traces
from .drive import fitted, whitened
from .records import Prepared, Run, Windows

DIVERGES = "The {} model diverges in simulation, so it has no {}."
DIVERGED = 1e15  # of an error


@dataclass(frozen=True, eq=False)
class Judged:
    """Errors of models on samples that nothing has seen, as in the JSON document: None where a
    value is missing or a simulation diverged, as ``messages`` say."""

    error: dict[str, Any]
    free_error: dict[str, Any]
    torque_error: dict[str, Any]
    traces: Traces
    messages: tuple[str, ...]


def errors(ready: Prepared, models: Mapping[str, Model | None]) -> Judged:
    """Simulate models, "declared", "refitted", "augmented", None where values are missing, from the
    recorded torque alone. Restarts begin from the state of an observer that has seen samples before
    them only. The residual torque is what the observer of "refitted" adds to each model."""
    fits = {name: fitted(ready, model) for name, model in models.items() if model is not None}
    jump, channel = fits.get("refitted", [*fits.values()][-1]).jump, ready.channel
    measured = np.concatenate([run.recorded[:, channel] for run in ready.runs])
    free_run = {k: partial(f.drive.simulate, f.values, f.jump) for k, f in fits.items()}
    simulated = {k: ready.along(ready.test, [channel], run)[0] for k, run in free_run.items()}
    observed = {k: partial(f.observed, jump) for k, f in fits.items()}
    missing = {k: ready.along(ready.test, [0], one)[0] for k, one in observed.items()}
    residual = {k: ready.along(ready.everywhere, [0], one)[0] for k, one in observed.items()}
    theta, w = ready.along(ready.everywhere, [1, 2], [*observed.values()][-1])
    at = ready.along(ready.test, [0], lambda _, where: where.counted[..., None])[0]
    held_out = np.isfinite(at + measured)
    said: list[str] = []

    def each(what: str, of: Callable[[str], float]) -> dict[str, float | None]:
        made = {k: of(k) for k in fits}
        finite = {k: x for k, x in made.items() if x < DIVERGED}
        said.extend(DIVERGES.format(k, what) for k in made if k not in finite)
        return {k: finite.get(k) for k in models}

    error = each("error", lambda k: rms((measured - simulated[k])[held_out]))
    free = each("error without restarts", lambda k: _free(ready, free_run[k]))
    torque = each("torque error", lambda k: rms(missing[k][held_out]))
    size = max(float(np.std(measured[held_out])), 1e-300)
    fit = {k: None if e is None else 100.0 * (1.0 - e / size) for k, e in error.items()}
    motion = ready.model.motion
    signal, unit = (("theta", "rad"), ("w", "rad/s"))[channel]
    of = {"signal": signal, "unit": unit_for(unit, motion)}
    counts = {"samples": int(held_out.sum()), "horizon": ready.horizon}
    t, u, dt = np.concatenate([(run.t, run.u, run.dt + 0.0 * run.t) for run in ready.runs], axis=1)
    signals = {"t": t, "theta": theta, "w": w, "u": u, "a": np.diff(w, append=np.nan) / dt}
    return Judged(
        {**of, **counts, **error, "noise_floor": ready.noise_floor, "fit": fit},
        {**of, "in_sample": ready.in_sample, **free},
        {"unit": unit_for("N m", motion), **torque},
        Traces(t, measured, held_out, simulated, residual, signals),
        tuple(said),
    )


def _free(ready: Prepared, simulate: Callable[[Run, Windows], np.ndarray]) -> float:
    """RMS error of the simulation without restarts."""
    missed = [np.zeros((0, 2))]
    for run, ranges in zip(ready.runs, ready.free, strict=True):
        for a, b in ranges if np.isfinite(run.own[ready.channel]) else ():
            if b - a > run.gap:
                where = run.windows([(a, b)], b - a - run.gap, run.pieces)
                missed.append((run.recorded[where.counted] - simulate(run, where))[0])
    return rms(np.concatenate(missed)[:, ready.channel])


def residuals(ready: Prepared, model: Model) -> Residuals:
    """The tests of one-step predictions, over the training windows of the run with most of them."""
    fit, both = fitted(ready, model), zip(ready.runs, ready.train, strict=True)
    run, where = max(both, key=lambda pair: pair[1].size)
    channel = int(np.isfinite(run.noise[1]))
    e = whitened(fit.drive, run, [fit.values], [fit.jump], where)[0][0, ..., channel]
    return residuals_of(("theta", "w")[channel], e, run.u[where.counted])


def torque_noise(ready: Prepared, model: Model) -> float:
    """Standard deviation of the torque that the model does not predict, per sample, N m."""
    fit = fitted(ready, model)
    return fit.jump * fit.values["J"]
