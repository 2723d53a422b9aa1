"""Whether held-out samples show a torque that those used for fitting did not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..spec import unit_for
from .evaluate import missing_torque, restarted
from .fit import Fitted, drawn, identified_covariance
from .predictor import Values
from .proof import LEAST_SIZE, friction_size
from .windows import Windows

FORETOLD, HALF = 0.3, 0.5  # of the held-out windows' missing power, that may be left
WORSE = 2.0  # times the error without them, above which effects are dropped
PARTLY_WORSE = 1.2  # the same of effects beside which something is left
LEAST, LARGEST = 1e-300, 1e300  # mean squares
OUTWEIGHED = 3.0  # logarithms of what gets worse, over those of what gets better
LED = 10  # part of a lead-in after which the state is known well enough for a large torque
FAR_MORE = 5.0  # times that, in a lead-in
OPENING = (
    "From {:.3g} to {:.3g} s, where only the state is found and nothing is fitted, a torque of "
    "about {:.2g} {} is missing that is not seen later: look at what the drive touches there."
)
DRAWN = 30  # sets of values within their uncertainty
MORE = 2.0  # times what may be missing, and what is missing from any window that was fitted


def surprising(fitted: Fitted, test: Windows, values: Values | None = None) -> np.ndarray:
    """The windows that the model cannot explain although it explains all that it was fitted to.

    An observer just fast enough to supply a torque of the least size worth a name follows a
    motion that hangs on chance (whether a drive sticks), but not a missing effect. Where the
    fitted samples leave open when something changed, nothing can be foreseen. With other
    ``values`` it is what these do not explain as well as the model explained what it was
    fitted to.
    """
    if fitted.noise.uneven:  # a window may have missed a hidden state
        return np.array([], dtype=int)
    new = _supplied(fitted, test, values)
    new[_open(fitted, test)] = 0.0
    return np.flatnonzero(new > MORE * _usual(fitted))


def beyond_doubt(fitted: Fitted, known: Fitted, test: Windows, found: np.ndarray) -> np.ndarray:
    """Those of the surprising windows that no values explain which all samples allow; ``known``
    is a fit to these.

    Whether a creeping drive sticks or goes on may hang on the last digit of its friction.
    """
    most = MORE * _usual(fitted)
    for values in drawn(known, identified_covariance(known), DRAWN):
        if not len(found):
            break
        where = replace(test, start=test.start[found])
        found = found[_supplied(fitted, where, values) > most]
    return found


def _supplied(fitted: Fitted, where: Windows, values: Values | None = None) -> np.ndarray:
    """RMS torque that such an observer supplies in each window."""
    noise = replace(fitted.noise, jump=_least(fitted) / fitted.values["J"])
    torque = missing_torque(fitted.predictor, values or fitted.values, where, noise)
    return np.sqrt(np.mean(torque**2, axis=1))


def _usual(fitted: Fitted) -> float:
    """The most that it supplies in any window that was fitted, or the least worth a name."""
    return max(_least(fitted), float(np.max(_supplied(fitted, fitted.where))))


def _least(fitted: Fitted) -> float:
    """The least RMS torque worth a name."""
    return LEAST_SIZE * friction_size(fitted)


def foretold(fitted: Fitted, without: Fitted, test: Windows, *, confirmed: bool = False) -> bool:
    """Whether an effect as it was fitted explains most of what held-out windows lack without it;
    half of it if another sensor has ``confirmed`` it."""
    left, lacking = (float(np.sum(_supplied(f, test) ** 2)) for f in (fitted, without))
    return left < (HALF if confirmed else FORETOLD) * lacking


def openings(fitted: Fitted) -> tuple[str, ...]:
    """What happens in the lead-in of a run's first window, which nothing is fitted to, and is far
    more than what the model lacks elsewhere: a sentence each."""
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
    """Whether effects make simulations of the held-out windows worse, clearly if they are ``sure``.

    Clearly is by more than a factor altogether, and far more in some windows than better in
    others; those aside in which a change lies that the fitted samples do not place.
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
    """Whether something changed at a moment of which only held-out samples tell."""
    return bool(np.any(_open(fitted, test)))


def _open(fitted: Fitted, test: Windows) -> np.ndarray:
    """Windows in which a change may lie that the fitted samples do not place."""
    t = fitted.predictor.data.t[test.counted]
    found = np.zeros(len(t), dtype=bool)
    for low, high in fitted.instants.values():
        found |= (t[:, 0] <= high) & (t[:, -1] >= low)
    return found


def when(fitted: Fitted, test: Windows, found: np.ndarray) -> str:
    """The times of windows, in words."""
    t = fitted.predictor.data.t[test.counted[found]]
    return ", ".join(f"{one[0]:.1f} to {one[-1]:.1f} s" for one in t)
