"""The plot of a recommendation: the error of each observer, from exact to wrong parameters."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from .canvas import drawn
from .loop_plots import COLOURS
from .wording import readable

if TYPE_CHECKING:
    from matplotlib.axes import Axes


@drawn
def errors(made: Any, ax: Axes) -> Axes:
    """A line for each candidate from its smallest to its largest error; the best is on top."""
    from matplotlib.ticker import LogLocator, NullFormatter

    from .canvas import headed

    rows = list(reversed(made.ranked))
    ends = np.array([[min(row.errors.values()), row.worst] for row in rows]).reshape(-1, 2)
    factor, unit = readable([made.none, *ends[:, 1]], made.unit)
    y = np.arange(len(rows))
    ax.hlines(y, *(factor * ends.T), color=COLOURS["none"], lw=3.0)
    ax.scatter(factor * ends[:, 1], y, color=COLOURS["after"], zorder=3, label="worst case")
    exact = [factor * next(iter(row.errors.values())) for row in rows]
    ax.scatter(exact, y, color="w", edgecolors=COLOURS["after"], zorder=3, label="exact parameters")
    ax.axvline(factor * made.none, color=COLOURS["before"], label="without an observer")
    ax.set(xscale="log", xlabel=f"RMS error of {made.signal} [{unit}]", yticks=y)
    ax.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    ax.xaxis.set_major_formatter("{x:g}")
    ax.xaxis.set_minor_formatter(NullFormatter())
    ax.set_yticklabels([row.name for row in rows])
    ax.legend(fontsize=8)
    headed(ax, "Observers on this drive")
    return ax
