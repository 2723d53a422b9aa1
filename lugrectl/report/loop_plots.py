"""Plots of loops: tracking, observers, what to compensate, limit cycles, sweeps, tables."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..blocks.block import unit_for
from ..core.errors import InputError
from ..core.numeric import Z95
from ..core.unit_names import si_unit
from .canvas import AFTER, BEFORE, LINE, MARK, QUIET, drawn, empty, headed, octaves
from .wording import readable

if TYPE_CHECKING:
    from matplotlib.axes import Axes

COLOURS = {"none": QUIET, "before": BEFORE, "after": AFTER}
_WAYS = (("w > 0", AFTER), ("w < 0", BEFORE))
_POINTS = 1000  # quantiles of a sweep are computed at this many times at most
UNSTABLE = "#5b6675"
REGIONS = {
    "quiet": "#cfe8d5",
    "can be started": "#f7e3b0",
    "hunting": "#f0b8ae",
    "undecided": "#d5d5dd",
}
AXES = {"friction": "friction, times what is believed"}
MOST = 10.0  # |D| that is drawn: beyond it are rest and growth without a stick


@drawn
def table(made: Any, ax: Axes) -> Axes:
    """The table with its 95 % band; two lines if each direction has its own."""
    rows, errors = np.atleast_2d(made.values), np.atleast_2d(made.error)
    ways = _WAYS if len(rows) == 2 else (("table", AFTER),)
    x = made.points
    if made.periodic:  # close the curve at the first point
        x = np.r_[x, x[0] + 2.0 * np.pi]
        rows, errors = (np.column_stack([y, y[:, :1]]) for y in (rows, errors))
    for y, error, (label, colour) in zip(rows, errors, ways, strict=True):
        ax.fill_between(x, y - Z95 * error, y + Z95 * error, color=colour, alpha=0.2, lw=0)
        ax.plot(x, y, color=colour, lw=1.6, label=label)
    signal = made.signals[0]
    unit = si_unit(signal, made.motion)
    turn = " modulo one turn" if made.periodic else ""
    name = "torque" if made.unit == "N m" else "force"
    ax.set(xlabel=f"{signal}{turn} [{unit}]", ylabel=f"{name} [{made.unit}]", xlim=(x[0], x[-1]))
    return headed(ax, f"Unexplained {name} over {signal}, as a table")


@drawn
def tracking(made: Any, ax: Axes) -> Axes:
    """Motion minus reference over time, for the loops that stayed stable."""
    errors = {key: run.y - run.r for key, run in made.runs.items()}
    factor, unit = readable([float(np.max(np.abs(e))) for e in errors.values()], made.unit)
    for key, run in made.runs.items():
        ax.plot(run.t, factor * errors[key], color=COLOURS[key], lw=1.3, label=key)
    signal = "w" if made.kind == "velocity" else "theta"
    ax.set(xlabel="t [s]", ylabel=f"error of {signal} [{unit}]")
    ax.margins(x=0.0)
    return headed(ax, "Tracking error in simulation") if made.runs else ax


@drawn
def recommendation(made: Any, ax: Axes) -> Axes:
    """A line for each observer from its smallest to its largest error; the best is on top."""
    rows = list(reversed(made.ranked))
    ends = np.array([[min(row.errors.values()), row.worst] for row in rows]).reshape(-1, 2)
    factor, unit = readable([made.none, *ends[:, 1]], made.unit)
    y = np.arange(len(rows))
    ax.hlines(y, *(factor * ends.T), color=QUIET, lw=3.0)
    ax.scatter(factor * ends[:, 1], y, color=AFTER, zorder=3, label="worst case")
    exact = [factor * next(iter(row.errors.values())) for row in rows]
    ax.scatter(exact, y, color="w", edgecolors=AFTER, zorder=3, label="exact parameters")
    ax.axvline(factor * made.none, color=BEFORE, label="without an observer")
    ax.set(xscale="log", xlabel=f"RMS error of {made.signal} [{unit}]", yticks=y)
    octaves(ax)
    ax.set_yticklabels([row.name for row in rows])
    return headed(ax, "Observers on this drive")


@drawn
def assurance(made: Any, ax: Axes) -> Axes:
    """The upper error over the share of each observer, with the bands of what was chosen."""
    factor, unit = readable([made.none], made.unit)
    for name in dict.fromkeys(one.observer for one in made.tried):
        rows = sorted((one.scale, one.upper) for one in made.tried if one.observer == name)
        x, y = np.array(rows).T
        ax.plot(x, factor * np.where(np.isfinite(y), y, np.nan), ".-", lw=1.0, label=name)
    for label, colour, middle, ends, x in (
        ("without", QUIET, made.none, made.none_band, 0.0),
        ("to be dared", AFTER, made.error, made.band, made.scale),
    ):
        bars = factor * np.abs(np.array([ends]).T - middle)
        look = {"fmt": "o", "color": colour, "capsize": 4, "label": f"{label}, 95 %"}
        ax.errorbar([x], [factor * middle], bars, **look)
    share = f"on {100.0 * made.confidence:g} % of drives"
    ax.set(yscale="log", xlabel="share of the estimate", ylabel=f"RMS error {share} [{unit}]")
    return headed(ax, made._title().removeprefix("Assurance: ").capitalize())


@drawn
def chance(made: Any, ax: Axes) -> Axes:
    """Amplitude over period of the members that hunt."""
    ax.plot(made.periods, made.amplitudes, "o", color=BEFORE, label="drives that hunt")
    if not len(made.periods):
        empty(ax, "none of the drives hunts")
    ax.set(xlabel="period [s]", ylabel=f"amplitude [{made.unit}]")
    return headed(ax, made._title().capitalize())


@drawn
def growth(found: Any, ax: Axes) -> Axes:
    """T(e)/e over the error e at breakaway; cycles where it is 1."""
    unit = unit_for("rad", found.motion)
    if found.curve is not None:
        x, D = found.curve
        ax.loglog(x, np.exp(np.where(np.abs(D) < MOST, D, np.nan)), color=LINE, label="T(e)/e")
    ax.axhline(1.0, color="0.4", lw=0.8)
    ax.set(xscale="log", yscale="log")
    for stable, colour, name in ((True, MARK, "stable cycle"), (False, UNSTABLE, "unstable")):
        sizes = [c.amplitude for c in found.cycles if c.stable == stable]
        if sizes:
            fill = colour if stable else "none"
            ax.plot(sizes, np.ones(len(sizes)), "o", color=colour, mfc=fill, label=name)
    if found.basin:
        ax.axvline(found.basin, color=UNSTABLE, ls="--", label="border of rest")
    if found.curve is None and not found.cycles:
        empty(ax, "no cycle was found")
    ax.set(xlabel=f"error at breakaway [{unit}]", ylabel="error at the next turn / error")
    return headed(ax, found._title()[:1].upper() + found._title()[1:])


@drawn
def sliding(found: Any, ax: Axes) -> Axes:
    """How fast a deviation from steady sliding grows over the speed, and both speeds."""
    if found.growth is None:
        empty(ax, found._title())
    else:
        ax.semilogx(*found.growth, color=LINE, label="growth of a small deviation")
    ax.axhline(0.0, color="0.4", lw=0.8)
    for name, speed, colour in (
        ("sliding is unstable below", found.speed_start, UNSTABLE),
        ("no stick-slip above", found.speed_end, MARK),
    ):
        if speed and np.isfinite(speed):
            ax.axvline(speed, color=colour, ls="--", label=name)
    ax.set(xlabel=f"speed v [{found.unit}]", ylabel="growth [1/s]")
    return headed(ax, found._title()[:1].upper() + found._title()[1:])


@drawn
def regions(found: Any, ax: Axes) -> Axes:
    """The regions over two gains, with the user's gains."""
    from matplotlib.colors import ListedColormap
    from matplotlib.patches import Patch

    (one, two), (first, second) = found.names, found.values
    colours = ListedColormap(list(REGIONS.values()))
    ax.pcolormesh(first, second, found.region.T, cmap=colours, vmin=0, vmax=3, shading="nearest")
    marks: list[Any] = [Patch(facecolor=c, edgecolor="0.5", label=n) for n, c in REGIONS.items()]
    if one in found.gains and two in found.gains:
        at = ([found.gains[one]], [found.gains[two]])
        marks += ax.plot(*at, "k*", ms=12, label="your gains")
    ax.set(xscale="log", yscale="log", xlabel=one, ylabel=AXES.get(two, two))
    return headed(ax, "Where the loop hunts", marks)


@drawn
def sweep(found: Any, ax: Axes, output: str | None = None) -> Axes:
    """Median and 5 to 95 % range of one signal of a sweep."""
    if output is None and (found.y is None or not found.outputs):
        raise InputError("this sweep holds no outputs to plot (with reduce none are kept).")
    name = found.outputs[0] if output is None else output
    every = slice(None, None, max(len(found.t) // _POINTS, 1))
    values, t = found[name][found.ok][:, every], found.t[every]
    if not len(values):
        raise InputError("no member of this sweep succeeded: there is nothing to plot.")
    low, middle, high = np.quantile(values, [0.05, 0.5, 0.95], axis=0)
    ax.fill_between(t, low, high, color=AFTER, alpha=0.25, lw=0, label="5 to 95 %")
    ax.plot(t, middle, color=AFTER, lw=1.3, label="median")
    ax.set(xlabel="t [s]", ylabel=name)
    return headed(ax, f"{found.name}, {len(values)} members")
