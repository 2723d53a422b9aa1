"""T(jw) on a grid of frequencies, for the plots of the checks."""

from __future__ import annotations

import math
from typing import Any

import control as ct
import numpy as np

from ..core.errors import InputError
from .border import border_of, is_sampled
from .delayed import DelayedTransfer
from .transfer import is_measured, response, roots

POINTS = 800
BEYOND = 30.0  # the grid reaches this factor beyond the outermost pole, zero or mark
ROUND = 81  # points about each pole
TURNS = 100.0  # rad of phase of the longest dead time that are drawn
NEAR = 0.999  # of half the sampling rate: T often has a zero there, and no phase


def curve(source: Any, *marks: float) -> tuple[np.ndarray, np.ndarray]:
    """Frequencies in rad/s, ``marks`` among them, and T(jw), or T(exp(jw dt)) up to half the
    sampling rate, of anything that the checks take."""
    if source is None:
        raise InputError("this verdict was not made by a check, so there is nothing to draw.")
    if is_measured(source):
        return response(source)
    T: Any = source
    if not isinstance(T, DelayedTransfer | ct.TransferFunction | ct.StateSpace):
        T = ct.tf(*([float(c) for c in np.atleast_1d(part)] for part in source))
    border, late, poles = border_of(T), 0.0, np.zeros(0, complex)
    if isinstance(T, DelayedTransfer):
        late = max(T.dead_times, default=0.0)
        both = [p for q in (T.num, T.den) for _, p in q.terms]
        around = [1.0 / late] if late else []
        places = np.abs([*(root for p in both for root in roots(p)), *around])
    else:
        with np.errstate(all="ignore"):
            poles, zeros = (border.rates(np.asarray(x, complex)) for x in (T.poles(), T.zeros()))
        places = np.abs(np.concatenate([poles, zeros]))
    dt, end = border.dt, border.frequency(math.inf)
    places = np.append(places[places <= NEAR * end], marks)
    places = places[np.isfinite(places) & (places > 0)]
    if not len(places):
        places = np.ones(1) if dt is None else np.array([end / BEYOND])
    low, top = places.min() / BEYOND, min(places.max() * BEYOND, NEAR * end)
    if late:
        top = max(min(top, TURNS / late), 3.0 / late, *(3.0 * w for w in marks if w < math.inf))
    top = top if dt is None else NEAR * end
    w = np.concatenate([np.geomspace(low, top, POINTS), places, _about(poles, late, top)])
    w = np.unique(w[(w >= low) & (w <= top)])
    with np.errstate(all="ignore"):
        at = 1j * w if dt is None else np.exp(1j * w * dt)
        values = np.asarray(T(at, warn_infinite=False))
    if values.ndim == 3:  # of several channels the largest singular value
        values = np.linalg.norm(np.moveaxis(values, -1, 0), 2, axis=(1, 2))
    return w, np.ravel(values)


def _about(poles: np.ndarray, late: float, top: float) -> np.ndarray:
    """So close about the poles that a resonance is a round curve, and steps that follow the phase
    of a dead time."""
    poles = poles[np.isfinite(poles)]
    width = np.abs(np.real(poles))[:, None] * np.tan(np.linspace(-1.5, 1.5, ROUND))
    near = np.abs(np.imag(poles))[:, None] + width
    steps = np.arange(1, min(top * late * 8.0, 40.0 * POINTS)) / (8.0 * late) if late else []
    return np.append(near.ravel(), steps)


def name(source: Any, of: str = "T") -> str:
    """What is drawn: "T(jw)", or "T(exp(jw dt))" of a sampled system."""
    return f"{of}(exp(jw dt))" if is_sampled(source) else f"{of}(jw)"


def size(source: Any) -> str:
    """The name of its size, of several channels that of the largest singular value."""
    if getattr(source, "ninputs", 1) * getattr(source, "noutputs", 1) == 1:
        return f"|{name(source)}|"
    return f"largest singular value of {name(source)}"
