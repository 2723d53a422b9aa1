"""The arrays behind the plots of a diagnosis and of an identification."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from .results import Traces
from .tracing.evaluate import Judged, missing_torque
from .tracing.fit import Fitted
from .tracing.job import Job
from .tracing.windows import windows


def traces(job: Job, final: Fitted, judged: Mapping[str, Judged | None]) -> Traces:
    """Simulated motion on held-out samples, residual torque, and the smoothed signals."""
    data, test = job.data, job.parts.test
    n, at = len(data.t), test.counted
    held_out = np.zeros(n, dtype=bool)
    held_out[at] = True
    simulated = {k: _placed(n, at, j.simulated) for k, j in judged.items() if j is not None}
    train = job.parts.train
    whole = windows(data.runs, train.burn, train.length)
    residual = {}
    for name, f in (("refitted", job.base), ("augmented", final)):
        torque = missing_torque(f.predictor, f.values, whole, job.base.noise)
        residual[name] = _placed(n, whole.counted, torque)
    log = data.log
    signals = {"t": log.t, "theta": log.theta, "w": log.w, "u": log.u, "a": log.a}
    return Traces(data.t, data.measured, held_out, simulated, residual, signals)


def _placed(n: int, at: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Values at their sample indices, nan elsewhere."""
    whole = np.full(n, np.nan)
    whole[at] = values
    return whole
