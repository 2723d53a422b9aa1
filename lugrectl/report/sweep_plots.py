"""The spread of many runs over time."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..core.errors import InputError
from .canvas import drawn
from .diagnosis_plots import AFTER

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_POINTS = 1000  # quantiles are computed at this many times at most


@drawn
def band(sweep: Any, ax: Axes, output: str | None = None) -> Axes:
    """Median and 5 to 95 % range of one signal of a sweep."""
    if output is None and (sweep.y is None or not sweep.outputs):
        raise InputError("this sweep holds no outputs to plot (with reduce none are kept).")
    name = sweep.outputs[0] if output is None else output
    every = slice(None, None, max(len(sweep.t) // _POINTS, 1))
    values, t = sweep[name][sweep.ok][:, every], sweep.t[every]
    if not len(values):
        raise InputError("no member of this sweep succeeded: there is nothing to plot.")
    low, middle, high = np.quantile(values, [0.05, 0.5, 0.95], axis=0)
    ax.fill_between(t, low, high, color=AFTER, alpha=0.25, lw=0, label="5 to 95 %")
    ax.plot(t, middle, color=AFTER, lw=1.3, label="median")
    ax.set(xlabel="t [s]", ylabel=name, title=f"{sweep.name}, {len(values)} members")
    ax.legend()
    return ax
