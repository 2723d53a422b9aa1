"""Input-delay estimation: a recorded torque that lags the motion by a fraction of a sample."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.optimize import minimize_scalar

from ..blocks.effects.actuator import held_late
from ..engine.beside import beside
from ..errors import Refused
from .data import Data
from .fit import Fitted, refitted
from .proof import gained, share
from .repeated import filtered

LATE = 100.0  # least gain in log-likelihood for a shifted torque, without the best window
GONE = 0.3  # share of the unpredicted torque that the shift must remove
FELT = 0.05  # of the torque's change per sample: less unpredicted torque is no delay
# samples; these remove half of what a delay of 0.2 or more leaves, on a short log of 0.5 or more
TRIED, FARTHER = (0.3, 0.5, 0.8), (2.0, 4.0, 8.0)
FARTHEST = 1.25  # samples: the largest delay of a torque logged as a sample or an earlier mean
PLACED = 0.02  # samples, accuracy of the delay
# factors of the second difference: none; what linear interpolation half-way between two samples
# takes off a sine; and what a logged mean of two samples has taken off as well
SHARP = (0.0, 0.125, 0.25)


def dated(found: Fitted) -> Data | None:
    """Data with the torque shifted earlier by up to about a sample; None if that is not far more
    likely.

    The model expects the torque of the interval after a sample. Often it is logged as its value at
    the sample, or as the mean of the interval before. Half a sample of such delay looks like an
    elastic coupling. A torque that leads is not shifted, since a delay in the drive looks the same.
    Nor is one beside a filtered speed, which may lead the torque that causes it.

    Raises
    ------
    Refused
        If the torque lags by more than that.
    """
    data = found.predictor.data
    change = float(np.sqrt(np.mean(np.diff(data.u) ** 2)))
    if data.ahead or found.torque_noise < FELT * change or filtered(data):
        return None
    late = _clearly_later(found, TRIED)
    if late == TRIED[-1]:
        late = _clearly_later(found, (*TRIED[-1:], *FARTHER))
    if late is None:
        return None
    best = _placed(found, 1.5 * late)
    if best < FARTHEST:
        moves = [ahead(data, best, sharp) for sharp in SHARP]
        fits = beside(lambda moved: refitted(found, moved), moves)
        return max(fits, key=lambda f: f.total).predictor.data
    raise Refused(
        f"By the fitted model, u lags the motion that it causes by {1e3 * best * data.dt:.2g} ms: "
        "the two were not recorded at the same instants, or u was filtered.",
        "Record u and the motion at the same instants and unfiltered, or shift u by that time.",
    )


def _placed(found: Fitted, farthest: float) -> float:
    """The delay of u at which the fit is best, in samples."""
    data = found.predictor.data

    def cost(samples: float) -> float:
        return -refitted(found, ahead(data, samples)).total

    bounds = (0.0, max(FARTHEST, farthest))
    best = minimize_scalar(cost, bounds=bounds, method="bounded", options={"xatol": PLACED})
    return float(best.x)


def _clearly_later(found: Fitted, tried: Sequence[float]) -> float | None:
    """The best of these delays of u, in samples; None if none is clear."""
    data = found.predictor.data
    fits = beside(lambda samples: refitted(found, ahead(data, samples)), tried)
    clear = [(f.total, n) for n, f in zip(tried, fits, strict=True) if _clearly(found, f)]
    return max(clear)[1] if clear else None


def _clearly(found: Fitted, moved: Fitted) -> bool:
    return gained(found, moved) > LATE and share(found, moved) > GONE


def ahead(data: Data, samples: float, sharp: float = 0.0) -> Data:
    """Data with the torque shifted earlier by so many samples.

    Half-way between samples, linear interpolation reduces a sine of w rad/s by ``(w dt)^2 / 8`` of
    its size; ``sharp`` adds ``sharp (w dt)^2`` back.
    """
    u, early = data.u.copy(), samples * data.dt
    part = samples % 1.0
    for a, b in data.runs:  # a delay, in reversed time
        line = held_late(data.u[a:b][::-1], data.dt, early)[::-1]
        bend = np.diff(np.pad(line, 1, mode="edge"), 2)
        u[a:b] = line - 4.0 * part * (1.0 - part) * sharp * bend
    return data.moved(u, early)
