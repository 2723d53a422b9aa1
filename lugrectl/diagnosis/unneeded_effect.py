"""A named effect must help the fit: what does not even where it was fitted is not missing."""

from __future__ import annotations

import numpy as np

from ..identification.balance import Balance
from ..identification.likelihood.maximise import Fitted
from ..identification.selection import Comparison
from .never_worse import window_means
from .plot_data import residual_torque
from .study import Job

UNNEEDED = (
    "The comparison of torques favours {1}, but the fitted model predicts as well without it: it "
    "leaves {0:.2g} % of the friction torque."
)


def unneeded(job: Job, fewer: Fitted, won: Fitted, found: Comparison, plain: Balance) -> str | None:
    """What to say where a fit without the effect named last predicts as well.

    The comparison approximates friction that depends on its past; a fit of predictions does not.
    So an effect is not missing where the fit without it leaves less than ``least`` of the friction
    torque, and the fit with it leaves no less, both on the samples of the fit: held-out samples
    decide nothing. An unknown torque has no fit to compare.
    """
    friction = found.friction
    fitted = found.verdict in ("found", "ambiguous") and not found.only_inertia
    if friction is None or found.events or not fitted:
        return None
    before, after = (_left(job, one, plain) for one in (fewer, won))
    if before is None or after is None or before > found.least * friction or after < before:
        return None
    return UNNEEDED.format(100.0 * before / friction, found.effects[-1].name)


def _left(job: Job, fitted: Fitted, plain: Balance) -> float | None:
    """RMS torque (N m) that a fit leaves of its samples, in the windows of the balance."""
    if plain.residual is None or not plain.half_width:
        return None
    at, residual = job.parts.train.counted, residual_torque(job, fitted)
    own = np.full(len(residual), np.nan)
    own[at] = residual[at]
    mine = [mean for mean, _ in window_means(job.data, own, plain)]
    return float(np.sqrt(np.mean(np.concatenate(mine) ** 2))) if mine else None
