"""Pictures of what compensation to dare: error over its share, and cycles of members that hunt."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from .canvas import drawn, empty, headed
from .loop_plots import COLOURS
from .wording import readable

if TYPE_CHECKING:
    from matplotlib.axes import Axes


@drawn
def dared(made: Any, ax: Axes) -> Axes:
    """The upper error over the share of each observer, with the bands of what was chosen."""
    factor, unit = readable([made.none], made.unit)
    for name in dict.fromkeys(one.observer for one in made.tried):
        rows = sorted((one.scale, one.upper) for one in made.tried if one.observer == name)
        x, y = np.array(rows).T
        ax.plot(x, factor * np.where(np.isfinite(y), y, np.nan), ".-", lw=1.0, label=name)
    for key, middle, ends, x in (
        ("none", made.none, made.none_band, 0.0),
        ("after", made.error, made.band, made.scale),
    ):
        bars = factor * np.abs(np.array([ends]).T - middle)
        label = "without" if key == "none" else "to be dared"
        ax.errorbar([x], [factor * middle], bars, fmt="o", color=COLOURS[key], capsize=4,
                    label=f"{label}, 95 %")  # fmt: skip
    share = f"on {100.0 * made.confidence:g} % of drives"
    ax.set(yscale="log", xlabel="share of the estimate", ylabel=f"RMS error {share} [{unit}]")
    headed(ax, made._title().removeprefix("Assurance: ").capitalize())
    return ax


@drawn
def hunting(made: Any, ax: Axes) -> Axes:
    """Amplitude over period of the members that hunt."""
    ax.plot(made.periods, made.amplitudes, "o", color=COLOURS["before"], label="drives that hunt")
    if not len(made.periods):
        empty(ax, "none of the drives hunts")
    ax.set(xlabel="period [s]", ylabel=f"amplitude [{made.unit}]")
    headed(ax, made._title().capitalize())
    return ax
