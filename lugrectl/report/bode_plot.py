"""The plot of a measured frequency response: magnitude with its band, phase, coherence."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from .canvas import headed, on_pyplot
from .tuning_plot import panels

if TYPE_CHECKING:
    from matplotlib.axes import Axes

LINE, RAW, FAINT, MARK = "#2c5f8a", "#d1622b", "#b9c2cd", "#c0392b"
CERTAIN = 0.95  # the least coherence that is drawn as certain


def bode(found: Any) -> Sequence[Axes]:
    """Magnitude, phase and coherence over Hz; only points of high coherence are drawn in full.
    With gains also their loop and its step."""
    from matplotlib.ticker import LogLocator

    f = found.frequency / (2.0 * np.pi)
    sure = np.where(found.certain, 1.0, np.nan)
    raw = np.asarray(found.raw.frdata)[0, 0]
    unit = found.unit

    def magnitude(ax: Axes) -> None:
        with np.errstate(divide="ignore"):
            low, size, high = (20 * np.log10(x) for x in (found.low, found.magnitude, found.high))
            before = 20 * np.log10(np.abs(raw))
        ax.semilogx(f, before, color=RAW, lw=0.9, label="as recorded")
        ax.plot(f, size, color=FAINT, lw=1.0)
        floor = np.nanmin(size) - 20.0  # a band that reaches 0 ends there
        ax.fill_between(f, np.maximum(low, floor), high, color=LINE, alpha=0.25, lw=0)
        ax.plot(f, size * sure, ".-", color=LINE, lw=1.5, ms=2.5, label="friction taken out")
        for mode in found.modes:
            hertz, first = mode.frequency / (2.0 * np.pi), mode.kind == "antiresonance"
            ax.axvline(hertz, color=MARK, ls=":" if first else "--", lw=0.9)
            ax.annotate(
                f"{hertz:.3g} Hz ",
                (hertz, 0.02 if first else 0.98),
                xycoords=("data", "axes fraction"),
                rotation=90,
                fontsize="x-small",
                color=MARK,
                ha="right",
                va="bottom" if first else "top",
            )
        ax.set(ylabel=f"|P| [dB of {unit}]")
        bad = f[found.governed]
        said = f"Friction governs {bad[0]:.3g} to {bad[-1]:.3g} Hz" if len(bad) else ""
        headed(ax, said)

    def phase(ax: Axes) -> None:
        ax.semilogx(f, np.degrees(found.raw_phase), color=RAW, lw=0.9)
        ax.plot(f, np.degrees(found.phase), color=FAINT, lw=1.0)
        ax.plot(f, np.degrees(found.phase) * sure, ".-", color=LINE, lw=1.5, ms=2.5)
        ax.set(ylabel="phase [deg]")

    def coherence(ax: Axes) -> None:
        ax.semilogx(f, found.coherence, color=LINE, lw=1.2)
        ax.axhline(CERTAIN, color=MARK, ls="--", lw=0.9)
        ax.set(xlabel="f [Hz]", ylabel="coherence", ylim=(0.0, 1.02))

    own = [magnitude, phase, coherence]
    more = panels(found.gains) if found.gains else []
    axes = on_pyplot(own + more, columns=2 if more else 1)
    for ax in axes[: len(own)]:
        ax.set_xlim(f[0], f[-1])
        ax.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        ax.xaxis.set_major_formatter("{x:g}")
        ax.xaxis.set_minor_formatter("")
    return axes
