"""Plots of a friction map: torque over speed, and the residuals of the models."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..blocks.block import unit_for
from ..core.numeric import Z95
from .canvas import drawn
from .loop_plots import COLOURS
from .wording import readable

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_POINT = "#3b4450"
_CURVES = {"refitted": COLOURS["before"], "augmented": COLOURS["after"]}
_DOT: dict[str, Any] = {"fmt": "o", "ms": 4.0, "lw": 1.0}


@drawn
def torque(made: Any, ax: Axes) -> Axes:
    """Mean torque over speed, one point with its 95 % bar per run, and the models' curves."""
    factor = _labelled(made, ax, "mean", made.u)
    left = made.at < 0.0
    for name, curve in made.curves.items():
        for side, label in ((left, name), (~left, None)):
            ax.plot(made.at[side], factor * curve[side], color=_CURVES[name], label=label)
    for which, face, label in ((~made.held_out, _POINT, None), (made.held_out, "w", "held out")):
        y, bars = (factor * values[which] for values in (made.u, Z95 * made.error))
        ax.errorbar(made.w[which], y, bars, color=_POINT, mfc=face, label=label, **_DOT)
    return _titled(ax, made, "Mean {} over speed, one point for each run")


@drawn
def missed(made: Any, ax: Axes) -> Axes:
    """Mean torque of each run minus that of the models at its speed."""
    rest = {k: made.u - np.interp(made.w, made.at, curve) for k, curve in made.curves.items()}
    factor = _labelled(made, ax, "residual", rest["refitted"])
    for name, left in rest.items():
        y, bars = factor * left, factor * Z95 * made.error
        ax.errorbar(made.w, y, bars, color=_CURVES[name], label=name, **_DOT)
    ax.axhline(0.0, color=_POINT, lw=1.0)
    return _titled(ax, made, "Residual {}, measured minus model")


def _labelled(made: Any, ax: Axes, which: str, values: np.ndarray) -> float:
    """Label the axes; returns the factor that brings the torque into the unit on them."""
    factor, unit = readable([float(np.max(np.abs(values)))], unit_for("N m", made.motion))
    speed = unit_for("rad/s", made.motion)
    ax.set(xlabel=f"w [{speed}]", ylabel=f"{which} {_name(made)} [{unit}]")
    return factor


def _titled(ax: Axes, made: Any, title: str) -> Axes:
    from .canvas import headed

    headed(ax, title.format(_name(made)))
    return ax


def _name(made: Any) -> str:
    return "torque" if made.motion == "rotary" else "force"
