"""Whether held-out samples show a torque that those used for fitting did not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .evaluate import missing_torque
from .fit import Fitted
from .predictor import Values, Windows
from .proof import LEAST_SIZE

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
    friction = fitted.predictor.friction(fitted.values)[fitted.where.counted]
    least = LEAST_SIZE * float(np.sqrt(np.mean(friction**2)))
    noise = replace(fitted.noise, jump=least / fitted.values["J"])
    known, new = (
        np.sqrt(np.mean(missing_torque(fitted.predictor, v, w, noise) ** 2, axis=1))
        for v, w in ((fitted.values, fitted.where), (values or fitted.values, test))
    )
    new[_open(fitted, test)] = 0.0
    return np.flatnonzero(new > MORE * max(least, float(np.max(known))))


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
