"""Hold-out checks: do held-out samples show a torque that the fitted ones do not?"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..spec import unit_for
from .evaluate import missing_torque, restarted
from .fit import Fitted, drawn, identified_covariance
from .predictor import Values
from .proof import LEAST_SIZE, friction_size
from .windows import Windows

PREDICTED, HALF = 0.3, 0.5  # of the held-out windows' missing power, that may remain
WORSE = 2.0  # times the error without them, above which effects are dropped
PARTLY_WORSE = 1.2  # the same for effects beside which something remains unexplained
LEAST, LARGEST = 1e-300, 1e300  # limits of mean squares
OUTWEIGHED = 3.0  # ratio of the sums of log errors: windows that get worse to those that get better
LED = 10  # part of a lead-in after which the state is known well enough to see a large torque
FAR_MORE = 5.0  # times the usual missing torque, in a lead-in
OPENING = (
    "Between {:.3g} and {:.3g} s (initialisation, not fitted) about {:.2g} {} is unexplained and "
    "does not recur. Check for contact at the start."
)
DRAWN = 30  # random sets of values within their covariance
MORE = 2.0  # times the least size, or the largest missing torque of a fitted window if larger


def surprising(fitted: Fitted, test: Windows, values: Values | None = None) -> np.ndarray:
    """The windows that the model cannot explain although it explains all fitted windows.

    The observer gain is set so that it can absorb a disturbance of the least size. That covers
    stick/slip chance, not a missing effect. Windows are excluded in which a change may lie whose
    time the fitted samples do not determine. With ``values``, the held-out windows are predicted
    with these instead of the fitted values.
    """
    if fitted.noise.uneven:  # a window may have missed a hidden state
        return np.array([], dtype=int)
    new = _supplied(fitted, test, values)
    new[_open(fitted, test)] = 0.0
    return np.flatnonzero(new > MORE * _usual(fitted))


def beyond_doubt(fitted: Fitted, known: Fitted, test: Windows, found: np.ndarray) -> np.ndarray:
    """Those of the surprising windows that no values within their covariance explain.

    ``known`` is a fit to all samples, from which the values are drawn. Whether a creeping drive
    sticks or moves on may depend on the last digit of its friction.
    """
    most = MORE * _usual(fitted)
    for values in drawn(known, identified_covariance(known), DRAWN):
        if not len(found):
            break
        where = replace(test, start=test.start[found])
        found = found[_supplied(fitted, where, values) > most]
    return found


def _supplied(fitted: Fitted, where: Windows, values: Values | None = None) -> np.ndarray:
    """RMS torque that such an observer supplies in each window, N m."""
    noise = replace(fitted.noise, jump=_least(fitted) / fitted.values["J"])
    torque = missing_torque(fitted.predictor, values or fitted.values, where, noise)
    return np.sqrt(np.mean(torque**2, axis=1))


def _usual(fitted: Fitted) -> float:
    """The most that it supplies in any fitted window, at least the least size."""
    return max(_least(fitted), float(np.max(_supplied(fitted, fitted.where))))


def _least(fitted: Fitted) -> float:
    """The least size of an effect as an RMS torque, N m."""
    return LEAST_SIZE * friction_size(fitted)


def predicted(fitted: Fitted, without: Fitted, test: Windows, *, confirmed: bool = False) -> bool:
    """True if a fitted effect explains most of what is missing from held-out windows without it.

    Half of it is enough if another sensor has ``confirmed`` the effect.
    """
    left, missing = (float(np.sum(_supplied(f, test) ** 2)) for f in (fitted, without))
    return left < (HALF if confirmed else PREDICTED) * missing


def openings(fitted: Fitted) -> tuple[str, ...]:
    """A sentence for each run with far more missing torque in its first lead-in than elsewhere.

    Nothing is fitted to a lead-in.
    """
    burn, data = fitted.where.burn, fitted.predictor.data
    lead = burn // LED
    runs = [run for run in data.runs if run[1] - run[0] > burn]
    start = np.array([a for a, _ in runs], dtype=int)
    torque, usual = _supplied(fitted, Windows(start, lead, burn - lead)), _usual(fitted)
    unit = unit_for("N m", data.motion)
    return tuple(
        OPENING.format(data.t[a], data.t[a + burn], size, unit)
        for a, size in zip(start, torque, strict=True)
        if size > FAR_MORE * usual
    )


def misled(before: Fitted, after: Fitted, test: Windows, *, sure: bool = True) -> bool:
    """True if effects make simulations of the held-out windows worse, clearly if ``sure``.

    The total error must grow by a factor, and windows must get worse by far more than others get
    better. Windows are excluded in which a change may lie whose time the fitted samples do not
    determine.
    """
    data = after.predictor.data
    measured = data.measured[test.counted]
    runs = [restarted(f.predictor, f.values, f.noise, test) for f in (before, after)]
    with np.errstate(over="ignore", invalid="ignore"):  # a simulation may run away
        sizes = np.mean((measured - np.array(runs)) ** 2, axis=-1)[:, ~_open(after, test)]
    sizes = np.clip(np.nan_to_num(sizes, nan=LARGEST), LEAST, LARGEST)
    grown = np.diff(np.log(sizes), axis=0)
    worse, better = np.maximum(grown, 0.0).sum(), np.maximum(-grown, 0.0).sum()
    without, with_it = sizes.sum(axis=1)
    factor, weight = (WORSE, OUTWEIGHED) if sure else (PARTLY_WORSE, 1.0)
    return bool(with_it > factor**2 * without and worse > weight * better)


def undated(fitted: Fitted, test: Windows) -> bool:
    """True if something changed at a time that only held-out samples can determine."""
    return bool(np.any(_open(fitted, test)))


def _open(fitted: Fitted, test: Windows) -> np.ndarray:
    """Windows in which a change may lie whose time the fitted samples do not determine."""
    t = fitted.predictor.data.t[test.counted]
    found = np.zeros(len(t), dtype=bool)
    for low, high in fitted.instants.values():
        found |= (t[:, 0] <= high) & (t[:, -1] >= low)
    return found


def when(fitted: Fitted, test: Windows, found: np.ndarray) -> str:
    """The times of the windows ``found``, as text."""
    t = fitted.predictor.data.t[test.counted[found]]
    return ", ".join(f"{one[0]:.1f} to {one[-1]:.1f} s" for one in t)
