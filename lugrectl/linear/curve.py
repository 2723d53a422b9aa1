"""T(jw) at many frequencies, for the plots of the checks."""

from __future__ import annotations

from typing import Any

import control as ct
import numpy as np

from ..core.errors import InputError
from .delayed import DelayedTransfer
from .system import spread
from .transfer import border_of, is_measured, is_sampled, response

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
    border, late = border_of(T), 0.0
    end = top = NEAR * border.frequency(np.inf)
    with np.errstate(all="ignore"):
        if isinstance(T, DelayedTransfer):
            around, late = T.num.roots() + T.den.roots(), max(T.dead_times, default=0.0)
            end = max(TURNS / late, *(3.0 * w for w in marks if w < np.inf)) if late else end
        else:
            around = border.rates(np.append(T.poles(), T.zeros()))
        w = spread(around, *marks, late=late, top=top, end=end)
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
