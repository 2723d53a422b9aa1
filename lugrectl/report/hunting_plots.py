"""Pictures of limit cycles: the growth from stick to stick, and the regions over two gains."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from .canvas import drawn, empty, headed

if TYPE_CHECKING:
    from matplotlib.axes import Axes

LINE, STABLE, UNSTABLE = "#2c5f8a", "#c0392b", "#5b6675"
REGION_COLOURS = ("#cfe8d5", "#f7e3b0", "#f0b8ae", "#d5d5dd")
NAMES = ("quiet", "can be started", "hunting", "undecided")
AXES = {"friction": "friction, times what is believed"}
MOST = 10.0  # |D| that is drawn: beyond it are rest and growth without a stick


@drawn
def growth(found: Any, ax: Axes) -> Axes:
    """T(e)/e over the error e at breakaway; cycles where it is 1."""
    unit = "rad" if found.motion == "rotary" else "m"
    if found.curve is not None:
        x, D = found.curve
        ax.loglog(x, np.exp(np.where(np.abs(D) < MOST, D, np.nan)), color=LINE, label="T(e)/e")
    ax.axhline(1.0, color="0.4", lw=0.8)
    ax.set(xscale="log", yscale="log")
    for stable, colour, name in ((True, STABLE, "stable cycle"), (False, UNSTABLE, "unstable")):
        sizes = [c.amplitude for c in found.cycles if c.stable == stable]
        if sizes:
            fill = colour if stable else "none"
            ax.plot(sizes, np.ones(len(sizes)), "o", color=colour, mfc=fill, label=name)
    if found.basin:
        ax.axvline(found.basin, color=UNSTABLE, ls="--", label="border of rest")
    if found.curve is None and not found.cycles:
        empty(ax, "no cycle was found")
    ax.set(xlabel=f"error at breakaway [{unit}]", ylabel="error at the next turn / error")
    headed(ax, found._title()[:1].upper() + found._title()[1:])
    return ax


@drawn
def regions(found: Any, ax: Axes) -> Axes:
    """The regions over two gains, with the user's gains."""
    from matplotlib.colors import ListedColormap
    from matplotlib.patches import Patch

    (one, two), (first, second) = found.names, found.values
    colours = ListedColormap(REGION_COLOURS)
    ax.pcolormesh(first, second, found.region.T, cmap=colours, vmin=0, vmax=3, shading="nearest")
    both = zip(REGION_COLOURS, NAMES, strict=True)
    marks = [Patch(facecolor=c, edgecolor="0.5", label=n) for c, n in both]
    if one in found.gains and two in found.gains:
        at = ([found.gains[one]], [found.gains[two]])
        marks += ax.plot(*at, "k*", ms=12, label="your gains")
    ax.set(xscale="log", yscale="log", xlabel=one, ylabel=AXES.get(two, two))
    headed(ax, "Where the loop hunts", marks)
    return ax
