"""T(jw) on a grid of frequencies, for the plots of the checks."""

from __future__ import annotations

from typing import Any

import control as ct
import numpy as np

from ..core.errors import InputError
from .border import border_of, is_sampled
from .delayed import DelayedTransfer
from .transfer import is_measured, response, roots

POINTS = 800
BEYOND = 30.0  # the grid reaches this factor beyond the outermost pole, zero or mark
ROUND = np.tan(np.linspace(-1.5, 1.5, 81))  # points about each pole, in widths of its peak
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
        T = ct.TransferFunction(*([float(c) for c in np.atleast_1d(part)] for part in source))
    border, late = border_of(T), 0.0
    poles: Any = np.zeros(0, complex)
    with np.errstate(all="ignore"):
        if isinstance(T, DelayedTransfer):
            late = max(T.dead_times, default=0.0)
            around = np.array(
                [root for q in (T.num, T.den) for _, p in q.terms for root in roots(p)]
            )
            around = np.append(around, [1.0 / late] if late else [])
        else:
            poles, zeros = (border.rates(np.asarray(x, complex)) for x in (T.poles(), T.zeros()))
            around = np.append(poles, zeros)
        end = NEAR * border.frequency(np.inf)
        places = np.append(np.abs(around)[np.abs(around) <= end], marks)
        places = places[np.isfinite(places) & (places > 0)]
        places = places if len(places) else np.array([min(end / BEYOND, 1.0)])
        low, top = places.min() / BEYOND, min(places.max() * BEYOND, end)
        if late:
            top = max(min(top, TURNS / late), 3.0 / late, *(3.0 * w for w in marks if w < np.inf))
        top = end if border.dt else top
        peaks = np.abs(poles.imag)[:, None] + np.abs(poles.real)[:, None] * ROUND
        turns = np.arange(1, min(top * late * 8.0, 40.0 * POINTS)) / (8.0 * late or 1.0)
        w = np.concatenate([np.geomspace(low, top, POINTS), places, peaks.ravel(), turns])
        w = np.unique(w[(w >= low) & (w <= top)])
        values = np.asarray(
            T(np.exp(1j * w * border.dt) if border.dt else 1j * w, warn_infinite=False)
        )
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
