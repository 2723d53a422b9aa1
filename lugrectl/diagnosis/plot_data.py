"""The arrays behind the plots of a diagnosis and of an identification."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ..estimates.findings import Traces
from ..identification.dataset.kalman import Noise
from ..identification.dataset.windows import windows
from ..identification.likelihood.maximise import Fitted
from ..identification.likelihood.simulation_error import Judged, missing_torque
from .study import Job


def traces(job: Job, final: Fitted, judged: Mapping[str, Judged | None]) -> Traces:
    """Simulated motion on held-out samples, residual torque, and the smoothed signals."""
    data, test = job.data, job.parts.test
    n, at = len(data.t), test.counted
    held_out = np.zeros(n, dtype=bool)
    held_out[at] = True
    simulated = {k: _placed(n, at, j.simulated) for k, j in judged.items() if j is not None}
    residual = {
        "refitted": residual_torque(job, job.base, job.base.noise),
        "augmented": residual_torque(job, final, job.base.noise),
    }
    log = data.log
    signals = {"t": log.t, "theta": log.theta, "w": log.w, "u": log.u, "a": log.a}
    return Traces(data.t, data.measured, held_out, simulated, residual, signals)


def residual_torque(job: Job, fitted: Fitted, noise: Noise) -> np.ndarray:
    """Torque that a fit leaves, at each sample, for the observer gain of ``noise``; nan where there
    is no lead-in."""
    train, data = job.parts.train, job.data
    whole = windows(data.runs, train.burn, train.length)
    torque = missing_torque(fitted.predictor, fitted.values, whole, noise)
    return _placed(len(data.t), whole.counted, torque)


def _placed(n: int, at: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Values at their sample indices, nan elsewhere."""
    whole = np.full(n, np.nan)
    whole[at] = values
    return whole
