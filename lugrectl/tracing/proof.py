"""How much a fit gained over another, and how much torque its observer supplies."""

from __future__ import annotations

import numpy as np

from .fit import Fitted

LOUD = 0.01  # of friction: the unpredicted torque per sample


def gained(before: Fitted, after: Fitted) -> float:
    """Gain in log-likelihood, without the gain of the best window."""
    gain = after.loglik - before.loglik
    return float(gain.sum() - max(gain.max(), 0.0))


def share(before: Fitted, after: Fitted) -> float:
    """Part of the unpredicted power of the acceleration that the newer model explains."""
    return max(0.0, 1.0 - (after.noise.jump / before.noise.jump) ** 2)


def friction_size(fitted: Fitted) -> float:
    """RMS friction torque in the training windows, N m; at most the RMS of the applied torque,
    which a bad fit may exceed by far."""
    at, predictor = fitted.where.counted, fitted.predictor
    torques = predictor.friction(fitted.values), predictor.data.u
    return min(float(np.sqrt(np.mean(torque[at] ** 2))) for torque in torques)


def loud(fitted: Fitted) -> bool:
    """True if the observer supplies more torque than sensor noise alone can explain."""
    return fitted.torque_noise > LOUD * friction_size(fitted)
