"""T(jw) on a grid of frequencies, for the plots of the checks."""

from __future__ import annotations

from typing import Any

import control as ct
import numpy as np

from lugrectl.core.errors import InputError

from .measured import is_measured, response

POINTS = 800
BEYOND = 30.0  # the grid reaches this factor beyond the outermost pole, zero or mark


def curve(source: Any, *marks: float) -> tuple[np.ndarray, np.ndarray]:
    """Frequencies in rad/s and T(jw), of anything that the checks take.

    ``marks`` are frequencies that the grid must include.
    """
    if source is None:
        raise InputError("this verdict was not made by a check, so there is nothing to draw.")
    if is_measured(source):
        return response(source)
    T = source if isinstance(source, ct.TransferFunction | ct.StateSpace) else _made(source)
    places = np.abs([*T.poles(), *T.zeros(), *marks])
    places = places[np.isfinite(places) & (places > 0)]
    if not len(places):
        places = np.ones(1)
    w = np.geomspace(places.min() / BEYOND, places.max() * BEYOND, POINTS)
    w = np.unique(np.concatenate([w, places]))
    with np.errstate(all="ignore"):
        return w, np.ravel(np.asarray(T(1j * w, warn_infinite=False)))


def _made(pair: Any) -> Any:
    num, den = ([float(c) for c in np.atleast_1d(part)] for part in pair)
    return ct.tf(num, den)
