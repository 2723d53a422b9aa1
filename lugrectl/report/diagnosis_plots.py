"""Plots of a diagnosis or an identification. Each takes ``ax=None`` and returns the Axes."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from ..blocks.block import unit_for
from ..core.errors import InputError
from . import comparison_section, friction_map_plots, loop_plots
from .canvas import drawn, headed, inline_svg, on_pyplot
from .views import Residual, binned, limits, motion_of, residual, rms_over_time, simulated, stretch
from .wording import readable

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MEASURED, BEFORE, AFTER, QUIET = "#3b4450", "#d1622b", "#1f6fb4", "#b9c2cd"
_POINTS = 2500  # largest number of points drawn of a scatter or a line
_DOTS: dict[str, Any] = {"ms": 2.5, "alpha": 0.25, "mew": 0, "rasterized": True}


@drawn
def motion(d: Any, ax: Axes) -> Axes:
    """Measured and simulated signal over the two held-out seconds with the largest error."""
    traces = d.traces
    if simulated(traces, "refitted") is None:
        raise InputError("this diagnosis holds no simulated motion to plot.")
    cut = stretch(traces)
    step = max((cut.stop - cut.start) // _POINTS, 1)
    cut = slice(cut.start, cut.stop, step)
    t = traces.t[cut]
    ax.plot(t, traces.measured[cut], color=QUIET, lw=3.5, label="measured")
    for name, color, values in _models(d):
        ax.plot(t, values[cut], color=color, lw=1.3, label=f"simulated, {name}")
    ax.set(xlabel="t [s]", ylabel="{} [{}]".format(*_signal(d)), xlim=(t[0], t[-1]))
    headed(ax, "Measured and simulated, held-out samples")
    return ax


@drawn
def error(d: Any, ax: Axes) -> Axes:
    """RMS of measured minus simulated over the whole record, in short bins of held-out samples."""
    traces = d.traces
    if simulated(traces, "refitted") is None:
        raise InputError("this diagnosis holds no simulated motion to plot.")
    curves = [(n, c, *rms_over_time(traces.t, traces.measured - v)) for n, c, v in _models(d)]
    name, unit = _signal(d)
    factor, unit = readable([float(np.nanmax(rms)) for *_, rms in curves], unit)
    for label, color, edges, rms in curves:
        ax.stairs(factor * rms, edges, baseline=None, color=color, lw=1.4, label=label)
    floor = (d.error or {}).get("noise_floor")
    if floor:
        ax.axhline(factor * floor, color=MEASURED, lw=1.0, ls=":", label="sensor noise")
    ax.set(xlabel="t [s]", ylabel=f"RMS error of {name} [{unit}]")
    ax.set_xlim(traces.t[0], traces.t[-1])
    _from_zero_or_log(ax, [factor * rms for *_, rms in curves])
    headed(ax, "Error over the record, held-out samples")
    return ax


@drawn
def torque(d: Any, ax: Axes) -> Axes:
    """Residual torque against the signal that explains it: samples and their mean."""
    view = residual(d)
    if view is None:
        raise InputError("this diagnosis holds no residual torque to plot.")
    edges, unit = view.edges(), unit_for("N m", motion_of(d))
    some, shown = _some(len(view.x)), list(limits(view.before, 1.0))
    name = "residual torque" if unit == "N m" else "residual force"
    factor, unit = readable(shown, unit)
    shown = [factor * y for y in shown]
    for torque, label, color in _residuals(view):
        y = factor * torque
        x, mean = binned(view.x, y, edges)
        ax.plot(view.x[some], y[some], ".", **_DOTS, color=color)
        ax.plot(x, mean, color="white", lw=3.6)
        ax.plot(x, mean, color=color, lw=2.0, label=f"{label}, mean")
        shown += list(mean[np.isfinite(mean)])
    times = f" x sign({view.times})" if view.times else ""
    ax.set(xlabel=view.label, ylabel=f"{name}{times} [{unit}]", xlim=(edges[0], edges[-1]))
    margin = 0.15 * (max(shown) - min(shown))
    ax.set_ylim(min(shown) - margin, max(shown) + margin)
    headed(ax, f"{name.capitalize()}{', held-out samples' * view.held_out}")
    return ax


PANELS: dict[str, tuple[Callable[..., Any], str]] = {
    "budget": (
        comparison_section.bars,
        "Where the torque goes, RMS as a share of friction: blue what is missing from the model.",
    ),
    "motion": (
        motion,
        "Measured and simulated motion over the two held-out seconds where the refitted model has "
        "its largest error. The models are simulated from the recorded torque alone; where they "
        "jump, they are restarted from the measured motion.",
    ),
    "map": (
        lambda d, ax: friction_map_plots.torque(d.map, ax),
        "Mean torque of each run over its mean speed, with 95 % bars, and the fitted curves.",
    ),
    "missed": (
        lambda d, ax: friction_map_plots.missed(d.map, ax),
        "Mean torque minus the fitted curves. The bars are the 95 % intervals of the means.",
    ),
    "error": (error, "Error of the simulated motion on held-out samples, in short bins."),
    "torque": (torque, "Residual torque: single samples (dots) and their mean (lines)."),
    "table": (
        lambda d, ax: loop_plots.table(d.table, ax),
        "The residual torque as a table, with its 95 % band. It describes the residual without "
        "a physical explanation.",
    ),
    "tracking": (
        lambda d, ax: loop_plots.tracking(d.compensation, ax),
        "Tracking error of the simulated loop: motion minus reference.",
    ),
}


def available(d: Any) -> list[str]:
    """Names of the plots for which the diagnosis holds data; none if it was refused."""
    if getattr(d, "verdict", None) in (None, "refused"):
        return []
    names = (
        ["motion", "error"] if simulated(getattr(d, "traces", None), "refitted") is not None else []
    )
    found = getattr(d, "comparison", None)
    names += ["budget"] if found is not None and found.budget else []
    names += ["map", "missed"] if getattr(d, "map", None) is not None else []
    names += ["torque"] if getattr(d, "traces", None) is not None and residual(d) else []
    names += ["table"] if getattr(d, "table", None) is not None else []
    made = getattr(d, "compensation", None)
    return names + (["tracking"] if made is not None and made.runs else [])


def overview(d: Any, ax: Axes | None = None) -> Any:
    """All plots that the result has data for, in one new figure; returns an array of their Axes.

    If there is only one plot, its Axes is returned. With ``ax`` given, only the first plot
    (measured and simulated motion, if there is any) is drawn into it, and that Axes is returned.
    Raises InputError when there is nothing to plot.
    """
    names = available(d)
    if not names:
        raise InputError("there is nothing to plot here (refused, or without traces).")
    if ax is not None:
        return PANELS[names[0]][0](d, ax)
    axes = on_pyplot([partial(PANELS[name][0], d) for name in names], columns=2)
    return axes[0] if len(axes) == 1 else np.array(axes, dtype=object)


def drawings(d: Any) -> list[tuple[str, str]]:
    """Caption and inline SVG of every plot that the result has data for; pyplot is not used."""
    return [
        (PANELS[name][1], inline_svg(partial(PANELS[name][0], d), name)) for name in available(d)
    ]


def _from_zero_or_log(ax: Axes, curves: list[np.ndarray]) -> None:
    """A logarithmic axis where one of the curves would lie on the axis beside the other."""
    middles = [float(np.nanmedian(y)) for y in curves]
    if 0 < min(middles) < 0.1 * max(middles):
        ax.set_yscale("log")
    else:
        ax.set_ylim(bottom=0)


def _models(d: Any) -> list[tuple[str, str, np.ndarray]]:
    """Name, colour and trace of each model to draw: refitted and, with effects, augmented."""
    refitted, augmented = (simulated(d.traces, name) for name in ("refitted", "augmented"))
    made = [] if refitted is None else [("refitted", BEFORE, refitted)]
    if augmented is not None and d.effects:
        made.append(("augmented", AFTER, augmented))
    return made


def _residuals(view: Residual) -> list[tuple[np.ndarray, str, str]]:
    made = [(view.before, "refitted", BEFORE)]
    return made if view.after is None else [*made, (view.after, "augmented", AFTER)]


def _signal(d: Any) -> tuple[str, str]:
    """The signal that errors refer to, and its unit."""
    error = d.error or {}
    return error.get("signal", "w"), error.get("unit") or unit_for("rad/s", motion_of(d))


def _some(n: int) -> np.ndarray:
    """Indices of at most ``_POINTS`` samples, chosen at random but always the same."""
    if n <= _POINTS:
        return np.arange(n)
    return np.random.default_rng(0).choice(n, _POINTS, replace=False)
