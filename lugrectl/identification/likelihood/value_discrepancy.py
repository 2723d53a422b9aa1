"""What an unknown smooth torque may do to the values of a fit by predictions."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..unknown_torque.discrepancy import Motion, Rows, discrepancy
from .likelihood import slopes
from .maximise import Fitted
from .parameters import known, weak

BLOCK = 0.02  # s, over which functions of the signals change little


def with_discrepancy(found: Fitted) -> Fitted:
    """The fit with what an unknown smooth torque may do to its values."""
    if not found.free:
        return found
    r, A = slopes(found.predictor, found.values, found.free, found.where, found.noise)
    rows, motion = _along_torque(found, r, A)
    believed = np.diag(weak(found.free)) + known(found.free, found.values, bounds=True)
    flat = A.reshape(len(A), -1)  # all at the same values: a covariance is of one linear model
    H, score = flat @ flat.T + believed, flat @ r.ravel()
    return replace(found, discrepancy=discrepancy(H, score, rows, motion.functions()))


def _along_torque(found: Fitted, r: np.ndarray, A: np.ndarray) -> tuple[Rows, Motion]:
    """Blocks of samples: innovations and slopes along the response to a torque, and the motion."""
    where, data = found.where, found.predictor.data
    v = np.sqrt(data.weight[where.counted]) * _response(found)
    n = max(1, min(round(BLOCK / data.dt), where.length))
    each = where.length // n * n

    def summed(x: np.ndarray) -> np.ndarray:
        cut = x.sum(axis=-1)[..., :each]
        cut = cut.reshape(*cut.shape[:-1], -1, n).sum(axis=-1)
        return cut.reshape(*cut.shape[:-2], -1)

    log, at = data.log, where.counted[:, :each].reshape(-1, n)
    t, theta, w, u = (x[at].mean(axis=1) for x in (log.t, log.theta, log.w, log.u))
    rows = Rows(summed(r * v), summed(A * v), summed(v**2))
    return rows, Motion(t - t.min(), theta, w, u, log.motion)


def _response(found: Fitted) -> np.ndarray:
    """The whitened innovation (2,) that a constant torque of 1 leaves.

    The observer's error x~ of theta and w settles at x~ = F (1 - K C) x~ + (0, dt/J).
    """
    predictor, values = found.predictor, found.values
    gain, S = predictor.filter(found.noise, values)
    states, dt = predictor.lanes.states, predictor.data.dt
    K = gain[[states.index("theta"), states.index("w")]]
    C = np.diag(found.noise.channels().astype(float))
    F = np.array([[1.0, dt], [0.0, 1.0]])
    settled = np.linalg.pinv(np.eye(2) - F @ (np.eye(2) - K @ C)) @ [0.0, dt / values["J"]]
    return np.linalg.inv(np.linalg.cholesky(S)) @ C @ settled
