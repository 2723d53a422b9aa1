"""Where plots are drawn: a plot is a function ``draw(what, ax)``; without ``ax`` it opens a figure
of pyplot (:func:`drawn`). Figures of reports never touch pyplot, so that none is left behind."""

from __future__ import annotations

import functools
import io
import re
import textwrap
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ..core.errors import InputError

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MEASURED, BEFORE, AFTER, QUIET = "#3b4450", "#d1622b", "#1f6fb4", "#b9c2cd"
LINE, MARK = "#2c5f8a", "#c0392b"  # of a curve over frequency, and of what is marked on it
SIZE = (6.4, 3.3)  # inches, of one plot
_TITLE = 62  # letters in a line of its title
HALF = (4.2, 2.6)  # of one of two side by side on a page
_RC: dict[Any, Any] = {
    "font.size": 10,
    "font.family": "sans-serif",
    "text.usetex": False,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": "#5b6675",
    "axes.grid": True,
    "grid.color": "#e6eaef",
    "axes.axisbelow": True,
    "axes.titlesize": 10.5,
    "axes.titlelocation": "left",
    "legend.frameon": False,
    "svg.fonttype": "path",
    "svg.hashsalt": "lugrectl",
}
Draw = Callable[..., Any]  # of what is drawn and the Axes


def drawn(draw: Draw) -> Draw:
    """Let a plot do without ``ax``: it then opens a figure of its own."""

    @functools.wraps(draw)
    def shown(what: Any, ax: Axes | None = None, *more: Any, **options: Any) -> Any:
        if ax is not None:
            return draw(what, ax, *more, **options)
        return on_pyplot([lambda own: draw(what, own, *more, **options)])[0]

    return shown


def on_pyplot(panels: list[Callable[[Axes], Any]], columns: int = 1) -> list[Axes]:
    """Draw panels into one new figure of pyplot, which a panel that fails takes away."""
    import matplotlib.pyplot as plt

    if not panels:
        raise InputError("there is nothing to plot here (refused, or without traces).")
    columns = min(columns, len(panels))
    rows = -(-len(panels) // columns)
    size = (SIZE[0] * columns, SIZE[1] * rows)
    # Outside the style: the first figure loads the backend, whose settings must stay.
    figure = plt.figure(figsize=size, layout="constrained")
    try:
        with style():
            last = len(panels) - 1  # it takes what is left of its row
            places: list[Any] = [*range(1, last + 1), (last + 1, rows * columns)]
            axes = [figure.add_subplot(rows, columns, place) for place in places]
            for panel, ax in zip(panels, axes, strict=True):
                panel(ax)
    except BaseException:
        plt.close(figure)
        raise
    return axes


def inline_svg(panel: Callable[[Axes], Any], name: str, size: tuple[float, float] = SIZE) -> str:
    """One panel as SVG inside an HTML page, with ids of its own; a smaller size: larger letters."""
    from matplotlib.figure import Figure

    file = io.StringIO()
    with style():
        figure = Figure(figsize=size, layout="constrained", dpi=100)
        panel(figure.subplots())
        figure.savefig(file, format="svg", dpi=160)
    svg = file.getvalue()
    svg = svg[svg.index("<svg") :]
    svg = re.sub(r"<metadata>.*?</metadata>\s*", "", svg, flags=re.DOTALL)
    svg = re.sub(r'\sxmlns(:\w+)?="[^"]*"', "", svg)
    svg = re.sub(r'(\bid="|url\(#|href="#)', rf"\g<1>{name}-", svg)
    return svg.replace("<svg ", f'<svg role="img" aria-label="{name}" ', 1).strip()


def style() -> Any:
    import matplotlib

    return matplotlib.rc_context(_RC)


def headed(ax: Axes, title: str, marks: Sequence[Any] = (), columns: int = 3, **axes: Any) -> Axes:
    """Set ``axes``, and the title above the legend of all labels, or of ``marks``."""
    ax.set(**axes)
    known = marks or ax.get_legend_handles_labels()[0]
    ax.set_title(textwrap.fill(title, _TITLE), pad=8 + 14 * -(-len(known) // columns))
    if known:
        place: Any = {"loc": "lower left", "bbox_to_anchor": (0.0, 1.0), "borderaxespad": 0.2}
        ax.legend(handles=known, ncols=columns, fontsize="small", borderpad=0.0, **place)
    return ax


def octaves(axis: Any) -> None:
    """Name 1, 2 and 5 of each decade of a logarithmic axis in plain numbers."""
    from matplotlib.ticker import LogLocator, NullFormatter

    axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axis.set_major_formatter("{x:g}")
    axis.set_minor_formatter(NullFormatter())


def binned(
    x: np.ndarray, y: np.ndarray, edges: np.ndarray, least: int = 5
) -> tuple[np.ndarray, np.ndarray]:
    """Centres and means of y in bins of x; NaN for bins of fewer than ``least`` finite values."""
    good = np.isfinite(x) & np.isfinite(y)
    bins = len(edges) - 1
    where = np.clip(np.searchsorted(edges, x[good], side="right") - 1, 0, bins - 1)
    count = np.bincount(where, minlength=bins)
    total = np.bincount(where, weights=y[good], minlength=bins)
    mean = np.where(count >= least, total / np.maximum(count, 1), np.nan)
    return (edges[1:] + edges[:-1]) / 2, mean
