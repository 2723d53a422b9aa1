"""Plots for closing the loop: the table of an unexplained torque, the tracking errors."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..blocks.block import unit_for
from ..core.numeric import Z95
from .canvas import drawn
from .views import UNITS
from .wording import readable

if TYPE_CHECKING:
    from matplotlib.axes import Axes

COLOURS = {"none": "#b9c2cd", "before": "#d1622b", "after": "#1f6fb4"}
_WAYS = (("w > 0", COLOURS["after"]), ("w < 0", COLOURS["before"]))


@drawn
def table(made: Any, ax: Axes) -> Axes:
    """The table with its 95 % band; two lines if each direction has its own."""
    from .canvas import headed

    rows, errors = np.atleast_2d(made.values), np.atleast_2d(made.error)
    ways = _WAYS if len(rows) == 2 else (("table", COLOURS["after"]),)
    x = made.points
    if made.periodic:  # close the curve at the first point
        x = np.r_[x, x[0] + 2.0 * np.pi]
        rows, errors = (np.column_stack([y, y[:, :1]]) for y in (rows, errors))
    for y, error, (label, colour) in zip(rows, errors, ways, strict=True):
        ax.fill_between(x, y - Z95 * error, y + Z95 * error, color=colour, alpha=0.2, lw=0)
        ax.plot(x, y, color=colour, lw=1.6, label=label)
    signal = made.signals[0]
    unit = unit_for(UNITS[signal], made.motion)
    turn = " modulo one turn" if made.periodic else ""
    name = "torque" if made.unit == "N m" else "force"
    ax.set(xlabel=f"{signal}{turn} [{unit}]", ylabel=f"{name} [{made.unit}]", xlim=(x[0], x[-1]))
    headed(ax, f"Unexplained {name} over {signal}, as a table")
    return ax


@drawn
def tracking(made: Any, ax: Axes) -> Axes:
    """Motion minus reference over time, for the loops that stayed stable."""
    from .canvas import headed

    errors = {key: run.y - run.r for key, run in made.runs.items()}
    factor, unit = readable([float(np.max(np.abs(e))) for e in errors.values()], made.unit)
    for key, run in made.runs.items():
        ax.plot(run.t, factor * errors[key], color=COLOURS[key], lw=1.3, label=key)
    signal = "w" if made.kind == "velocity" else "theta"
    ax.set(xlabel="t [s]", ylabel=f"error of {signal} [{unit}]")
    ax.margins(x=0.0)
    if made.runs:
        headed(ax, "Tracking error in simulation")
    return ax
