"""Input-delay estimation: a recorded torque that lags the motion by a fraction of a sample."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scipy.optimize import minimize_scalar

from ...blocks.effects.actuator import held_late
from ...core.errors import Refused
from ..dataset.dataset import Data
from ..dataset.derived_speed import filtered
from .likelihood import slopes, whitened
from .maximise import Fitted, again, refitted

LATE = 100.0  # least gain in log-likelihood for a shifted torque, without the best window
GONE = 0.3  # share of the unpredicted torque that the shift must remove
FELT = 0.05  # of the torque's change per sample: less unpredicted torque is no delay
TRIED = (0.3, 0.6, 1.2, 2.4, 4.8, 9.6)  # samples: a torque that is late is so by the first at least
FARTHEST = 1.25  # samples: the largest delay of a torque logged as a sample or an earlier mean
PLACED = 0.02  # samples, accuracy of the delay
# factors of the second difference: none; what linear interpolation half-way between two samples
# takes off a sine; and what a logged mean of two samples has taken off as well
SHARP = (0.0, 0.125, 0.25)

Left = Callable[..., float]  # of samples, and how sharp


def dated(found: Fitted) -> Fitted | None:
    """The fit with the torque shifted earlier by up to about a sample; None if that is not far
    more likely.

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
    left = _left(found, data)
    late = _later(left)
    if late is None:
        return None
    best = _placed(left, 0.5 * late, 2.0 * late)
    if 0.5 * (left(0.0) - left(best)) < LATE:
        return None
    moved = refitted(found, ahead(data, best))
    if not _clearly(found, moved):
        return None
    left, late = _left(moved, data), moved.predictor.data.ahead / data.dt
    best = _placed(left, max(0.0, late - 1.0), late + 1.0)
    if best < FARTHEST:
        sharp = min(SHARP, key=lambda sharp: left(best, sharp))
        return again(replace(moved, predictor=moved.predictor.on(ahead(data, best, sharp))))
    raise Refused(
        f"By the fitted model, u lags the motion that it causes by {1e3 * best * data.dt:.2g} ms: "
        "the two were not recorded at the same instants, or u was filtered.",
        "Record u and the motion at the same instants and unfiltered, or shift u by that time.",
    )


def _left(found: Fitted, data: Data) -> Left:
    """What innovations leave with the torque of ``data`` shifted, as a sum of squares.

    The values of the fit follow the shift to first order.
    """
    _, A = slopes(found.predictor, found.values, found.free, found.where, found.noise)
    Q = np.linalg.qr(A.reshape(len(A), -1).T)[0]

    def left(samples: float, sharp: float = 0.0) -> float:
        moved = found.predictor.on(ahead(data, samples, sharp))
        r = whitened(moved, [found.values], found.where, found.noise).ravel()
        taken = Q.T @ r
        return float(r @ r - taken @ taken)

    return left


def _later(left: Left) -> float | None:
    """The delay of u, in samples and within a factor of two; None if it is not late."""
    late, least = None, left(0.0)
    for samples in TRIED:
        there = left(samples)
        if not there < least:
            break
        late, least = samples, there
    return late


def _placed(left: Left, low: float, high: float) -> float:
    """The delay of u, in samples, that leaves least."""
    best = minimize_scalar(left, bounds=(low, high), method="bounded", options={"xatol": PLACED})
    return float(best.x)


def _clearly(found: Fitted, moved: Fitted) -> bool:
    gain = moved.loglik - found.loglik
    gone = 1.0 - (moved.noise.jump / found.noise.jump) ** 2
    return bool(gain.sum() - max(gain.max(), 0.0) > LATE and gone > GONE)


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
