"""A recorded torque that is a fraction of a sample late against the motion."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.optimize import minimize_scalar

from ..blocks.effects.actuator import held_late
from ..errors import Refused
from .beside import beside
from .data import Data
from .fit import Fitted, refitted
from .proof import gained, share
from .repeated import filtered

LATE = 100.0  # least gain in log-likelihood for a torque moved ahead, also without the best window
GONE = 0.3  # share of the unforeseen torque that must go with it
FELT = 0.05  # of the torque's change from sample to sample: less unforeseen is no lateness
# samples; half of what is missing goes from 0.2 on, a short log shows only half of one as such
TRIED, FARTHER = (0.3, 0.5, 0.8), (2.0, 4.0, 8.0)
FARTHEST = 1.25  # samples: an instant or the interval before it instead of the one after
PLACED = 0.02  # samples
# of the second difference: none, what the line half-way between two samples takes off a swing, and
# what a logged mean of two has taken off beside
SHARP = (0.0, 0.125, 0.25)


def dated(found: Fitted) -> Data | None:
    """The data with the torque moved ahead by up to a sample, where that is far more likely.

    What a model takes for the torque of the interval after a sample is often logged as its value
    at the sample, or as the mean of the interval before it. Half a sample of that looks like an
    elastic coupling. A torque that is early is left alone: a delay of the drive looks the same;
    so is one beside a filtered speed, which may run ahead of what moves it.

    Raises
    ------
    Refused
        Where it is later than that.
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
        f"u comes {1e3 * best * data.dt:.2g} ms later than the motion that it causes, by the "
        "fitted model: they are skewed in time against each other, or u went through a filter.",
        "Record u and the motion at the same instants and unfiltered, or shift u by that time.",
    )


def _placed(found: Fitted, farthest: float) -> float:
    """By how many samples u is late, where the fit is best."""
    data = found.predictor.data

    def cost(samples: float) -> float:
        return -refitted(found, ahead(data, samples)).total

    bounds = (0.0, max(FARTHEST, farthest))
    best = minimize_scalar(cost, bounds=bounds, method="bounded", options={"xatol": PLACED})
    return float(best.x)


def _clearly_later(found: Fitted, tried: Sequence[float]) -> float | None:
    """The best of these numbers of samples by which u may be late, if it is beyond doubt."""
    data = found.predictor.data
    fits = beside(lambda samples: refitted(found, ahead(data, samples)), tried)
    clear = [(f.total, n) for n, f in zip(tried, fits, strict=True) if _clearly(found, f)]
    return max(clear)[1] if clear else None


def _clearly(found: Fitted, moved: Fitted) -> bool:
    return gained(found, moved) > LATE and share(found, moved) > GONE


def ahead(data: Data, samples: float, sharp: float = 0.0) -> Data:
    """The data with a torque that comes so many samples earlier.

    A line between samples takes (w dt)^2 / 8 off a swing of w rad/s half-way, ``sharp`` gives
    back sharp (w dt)^2.
    """
    u, early = data.u.copy(), samples * data.dt
    part = samples % 1.0
    for a, b in data.runs:  # a delay, turned round in time
        line = held_late(data.u[a:b][::-1], data.dt, early)[::-1]
        bend = np.diff(np.pad(line, 1, mode="edge"), 2)
        u[a:b] = line - 4.0 * part * (1.0 - part) * sharp * bend
    return data.moved(u, early)
