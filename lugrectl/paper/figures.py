"""Figures of the reproduction; pyplot is not used."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from ..report import diagnosis_plots
from ..report.canvas import inline_svg
from .bench import Outcome
from .results import PaperFigure, Reproduction

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_BINS = 400  # a long trace is drawn by the lowest and highest value in this many bins
LINES: dict[str, dict[str, Any]] = {
    "none": {"color": diagnosis_plots.MEASURED},
    "natural": {"color": "#c47f17"},
    "k 0.35": {"color": "#2f7d4f"},
    "k 5": {"color": "#2f7d4f", "ls": "--"},
    "k 20": {"color": "#2f7d4f", "ls": ":"},
    "proposed": {"color": diagnosis_plots.AFTER},
    "Ki 160": {"color": diagnosis_plots.BEFORE},
    "Ki 5200": {"color": diagnosis_plots.BEFORE, "ls": "--"},
}


def thinned(t: np.ndarray, y: np.ndarray, bins: int = _BINS) -> tuple[np.ndarray, np.ndarray]:
    """The trace, or its lowest and highest value in equal bins, so that no peak is lost."""
    size = -(-len(y) // bins)
    if size <= 2:
        return t, y
    whole = len(y) // size * size
    pieces, times = y[:whole].reshape(-1, size), t[:whole].reshape(-1, size)
    ends = np.sort([np.argmin(pieces, axis=1), np.argmax(pieces, axis=1)], axis=0)
    at = np.arange(len(pieces))
    return times[at, ends].T.ravel(), pieces[at, ends].T.ravel()


def paper_figure(figure: PaperFigure, ax: Axes) -> Axes:
    """Reference and the three responses."""
    ax.plot(
        *thinned(figure.reference.t, figure.reference.y),
        color=diagnosis_plots.QUIET,
        lw=4.5,
        label="reference",
    )
    looks = (
        {"color": diagnosis_plots.MEASURED, "ls": "--", "zorder": 3},
        {"color": diagnosis_plots.BEFORE},
        {"color": diagnosis_plots.AFTER, "lw": 1.8},
    )
    names = ("no friction", "friction, no observer", "friction, proposed observer")
    for trace, name, look in zip(figure.responses, names, looks, strict=True):
        ax.plot(*thinned(trace.t, trace.y), **{"lw": 1.2, **look}, label=name)
    symbol = "w" if figure.unit == "rad/s" else "theta"
    ax.set(xlabel="t [s]", ylabel=f"{symbol} [{figure.unit}]", xlim=figure.reference.t[[0, -1]])
    _headed(ax, f"{figure.key.capitalize()} loop, as in the paper's figure", 2)
    return ax


def sweep(o: Outcome, ax: Axes) -> Axes:
    """RMS error over the error of the observer's parameters, logarithmic."""
    x = np.array([row.x for row in o.rows], dtype=float)
    values = np.array([row.rms for row in o.rows]) * 1e3
    for i, c in enumerate(o.study.compensations):
        mark = {} if c.observer is None else {"marker": "o", "ms": 3}
        ax.plot(x, values[:, i], lw=1.5, **mark, **LINES[c.short], label=c.short)
    ax.set_yscale("log")
    unit = o.rows[0].measure.unit
    ax.set(xlabel="error of the observer's parameters [%]", ylabel=f"RMS error [m{unit}]")
    _headed(ax, o.study.title, 4)
    return ax


def traces(o: Outcome, ax: Axes) -> Axes:
    """The signal of one case over time."""
    drawn = o.study.drawn
    assert drawn is not None
    for trace in o.traces:
        y = np.abs(trace.y) if drawn.log else trace.y
        ax.plot(*thinned(trace.t, y * 1e3), lw=1.3, **LINES[trace.name], label=trace.name)
    name = f"{drawn.signal} [m{drawn.unit}]"
    if drawn.log:
        ax.set_yscale("log")
        ax.set_ylim(bottom=1e-3)
        name = f"|{drawn.signal}| [m{drawn.unit}]"
    ax.set(xlabel="t [s]", ylabel=name, xlim=drawn.span)
    _headed(ax, f"{o.study.title}: {o.study.cases[drawn.case].label}", 4)
    return ax


def envelopes(o: Outcome, ax: Axes) -> Axes:
    """Largest |e| in each second, logarithmic: growth at a constant rate is a straight line."""
    drawn = o.study.drawn
    assert drawn is not None
    edges = np.arange(drawn.span[0], drawn.span[1] + 0.5)
    for trace in o.traces:
        starts = np.searchsorted(trace.t, edges)
        peaks = [np.abs(trace.y[a:b]).max() for a, b in zip(starts, starts[1:], strict=False)]
        shown = np.maximum(peaks, 1e-9) * 1e3
        ax.plot(edges[:-1] + 0.5, shown, lw=1.5, **LINES[trace.name], label=trace.name)
    ax.set_yscale("log")
    ax.set_ylim(bottom=1e-3)
    ax.set(xlabel="t [s]", ylabel=f"largest |e| in a second [m{drawn.unit}]", xlim=drawn.span)
    _headed(ax, f"{o.study.title}: {o.study.cases[drawn.case].label}", 4)
    return ax


def study_figure(o: Outcome, ax: Axes) -> Axes:
    """The figure of a study: a sweep, long envelopes, or traces."""
    if o.study.drawn is None:
        return sweep(o, ax)
    return (envelopes if o.study.loop == "position" else traces)(o, ax)


def drawings(r: Reproduction) -> dict[str, str]:
    """Inline SVG by key of figure ("paper-velocity", ...) and study."""
    made = {}
    for figure in r.figures:
        made[f"paper-{figure.key}"] = inline_svg(
            partial(paper_figure, figure), f"paper-{figure.key}"
        )
    for o in r.outcomes:
        made[o.study.key] = inline_svg(partial(study_figure, o), o.study.key)
    return made


def _headed(ax: Axes, title: str, columns: int) -> None:
    """Title with the legend below it, above the axes."""
    entries = len(ax.get_legend_handles_labels()[0])
    rows = -(-entries // columns)
    ax.set_title(title, pad=8 + 14 * rows)
    ax.legend(
        loc="lower left",
        bbox_to_anchor=(0.0, 1.0),
        ncols=columns,
        fontsize="small",
        borderaxespad=0.2,
        borderpad=0.0,
        handlelength=1.8,
        columnspacing=1.4,
    )
