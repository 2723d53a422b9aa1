"""The residual tests as a picture."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from .canvas import drawn

if TYPE_CHECKING:
    from matplotlib.axes import Axes

COLOURS = {"autocorrelation": "#1f6fb4", "cross": "#d1622b"}
LABELS = {"autocorrelation": "of the residual", "cross": "with the change of u before"}


@drawn
def correlations(r: Any, ax: Axes) -> Axes:
    """Autocorrelation and cross-correlation over the lag, with their 99 % bound."""
    ax.axhspan(-r.bound, r.bound, color="#e6eaef", label="99 % of chance")
    for i, (name, colour) in enumerate(COLOURS.items()):
        y = getattr(r, name)
        first = 1 if name == "autocorrelation" else 0
        ax.vlines(r.lags[first:] + 0.2 * i, 0.0, y[first:], color=colour, lw=2, label=LABELS[name])
    ax.set(xlabel="lag [samples]", ylabel="correlation")
    ax.set_title(f"Prediction errors of {r.signal}", pad=22)
    ax.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=3, fontsize="small",
              borderaxespad=0.2, borderpad=0.0)  # fmt: skip
    return ax
