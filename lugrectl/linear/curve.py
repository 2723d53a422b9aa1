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
    """Frequencies in rad/s and T(jw), or T(exp(jw dt)) up to half the sampling rate, of anything
    that the checks take.

    ``marks`` are frequencies that the grid must include.
    """
    if source is None:
        raise InputError("this verdict was not made by a check, so there is nothing to draw.")
    if is_measured(source):
        return response(source)
    if isinstance(source, DelayedTransfer):
        late = max(source.dead_times, default=0.0)
        own = [w for w in marks if 0 < w < math.inf]
        both = [p for q in (source.num, source.den) for _, p in q.terms]
        sizes = [abs(root) for p in both for root in roots(p) if root]
        places = [*own, *sizes, *([1.0 / late] if late else [])] or [1.0]
        low, top = min(places) / BEYOND, max(places) * BEYOND
        if late:  # steps that follow the phase of the dead times
            top = max(min(top, TURNS / late), *(3.0 * w for w in own), 3.0 / late)
        steps = np.arange(1, min(top * late * 8.0, 40.0 * POINTS)) / (8.0 * late) if late else []
        w = np.unique(np.concatenate([np.geomspace(low, top, POINTS), steps, own]))
        return w[w >= low], source(1j * w[w >= low])
    T: Any = source
    if not isinstance(T, ct.TransferFunction | ct.StateSpace):
        T = ct.tf(*([float(c) for c in np.atleast_1d(part)] for part in source))
    dt = border_of(T).dt
    with np.errstate(all="ignore"):
        poles, zeros = (np.asarray(x, dtype=complex) for x in (T.poles(), T.zeros()))
        poles, zeros = (x if dt is None else np.log(x) / dt for x in (poles, zeros))
    places = np.abs(np.concatenate([poles, zeros]))
    end = math.inf if dt is None else math.pi / dt
    places = np.append(places[places <= NEAR * end], marks)
    places = places[np.isfinite(places) & (places > 0)]
    if not len(places):
        places = np.ones(1) if dt is None else np.array([end / BEYOND])
    top = places.max() * BEYOND if dt is None else NEAR * end
    low = places.min() / BEYOND
    poles = poles[np.isfinite(poles)]  # so close about them that a resonance is a round curve
    width = np.abs(np.real(poles))[:, None] * np.tan(np.linspace(-1.5, 1.5, ROUND))
    peaks = (np.abs(np.imag(poles))[:, None] + width).ravel()
    peaks = peaks[(peaks > low) & (peaks < top)]
    w = np.unique(np.concatenate([np.geomspace(low, top, POINTS), places, peaks]))
    with np.errstate(all="ignore"):
        at = 1j * w if dt is None else np.exp(1j * w * dt)
        values = np.asarray(T(at, warn_infinite=False))
    if values.ndim == 3:  # of several channels the largest singular value
        values = np.linalg.norm(np.moveaxis(values, -1, 0), 2, axis=(1, 2))
    return w, np.ravel(values)


def name(source: Any, of: str = "T") -> str:
    """What is drawn: "T(jw)", or "T(exp(jw dt))" of a sampled system."""
    return f"{of}(exp(jw dt))" if is_sampled(source) else f"{of}(jw)"


def size(source: Any) -> str:
    """The name of its size, of several channels that of the largest singular value."""
    if getattr(source, "ninputs", 1) * getattr(source, "noutputs", 1) == 1:
        return f"|{name(source)}|"
    return f"largest singular value of {name(source)}"
