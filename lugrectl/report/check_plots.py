"""The plots of the linear checks: Re T and Nyquist, the largest |G|, the band, the open loop."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ..core.errors import InputError
from ..linear.curve import curve, name
from ..linear.curve import size as size_of
from .canvas import on_pyplot, style

if TYPE_CHECKING:
    from matplotlib.axes import Axes

NEAR_MINUS_1 = 5.0  # up to which |L| the Nyquist curve is drawn
MARK, LINE = "#c0392b", "#2c5f8a"


def realness(verdict: Any, ax: Any = None) -> Sequence[Axes]:
    """Re T(jw) with the band edge and the margin, and the Nyquist curve."""
    edge = verdict.band_edge
    w, T = curve(verdict._source, *([edge] if math.isfinite(edge) else []))
    of = name(verdict._source)
    good = np.isfinite(T)
    w, re, im = w[good], np.real(T[good]), np.imag(T[good])

    def real(own: Axes) -> None:
        own.semilogx(w, re, color=LINE)
        own.axhline(0.0, color="0.4", lw=0.8)
        size = np.max(np.abs(re), initial=0.0)
        own.set_yscale("symlog", linthresh=max(1e-3 * size, 1e-300))
        if 0 < edge < w[-1]:
            own.axvline(edge, color=MARK, ls="--", label=f"band edge {edge:.4g} rad/s")
            own.legend()
        shown = verdict and math.isfinite(verdict.margin)
        margin = f", margin {verdict.margin:.4g} 1/s" if shown else ""
        own.set(xlabel="w [rad/s]", ylabel=f"Re {of}", title=f"{verdict.classification}{margin}")

    def nyquist(own: Axes) -> None:
        own.plot(re, im, color=LINE)
        own.axvline(0.0, color=MARK, ls="--", label="Re T = 0")
        own.set(xlabel=f"Re {of}", ylabel=f"Im {of}", title="Nyquist, w > 0")
        own.legend()

    return _panels([real, nyquist], ax)


def gain(verdict: Any, ax: Any = None) -> Sequence[Axes]:
    """|T(jw)| with its largest value."""
    at = verdict.frequency
    w, T = curve(verdict._source, *([at] if math.isfinite(at) else []))
    of = size_of(verdict._source)

    def size(own: Axes) -> None:
        own.loglog(w, np.abs(T), color=LINE)
        if math.isfinite(verdict.gain):
            place = "as w grows" if math.isinf(at) else f"at {at:.4g} rad/s"
            label = f"largest: {verdict.gain:.4g} {place}"
            own.axhline(verdict.gain, color=MARK, ls="--", label=label)
            if w[0] <= at <= w[-1]:
                own.plot([at], [verdict.gain], "o", color=MARK)
            own.legend()
        own.set(xlabel="w [rad/s]", ylabel=of, title="L2 gain")

    return _panels([size], ax)


def band(verdict: Any, ax: Any = None) -> Sequence[Axes]:
    """Magnitude and phase with the bandwidth."""
    width = verdict.bandwidth
    w, T = curve(verdict._source, *([width] if math.isfinite(width) else []))
    of = size_of(verdict._source)
    with np.errstate(divide="ignore"):
        decibel = 20 * np.log10(np.abs(T))

    def magnitude(own: Axes) -> None:
        own.semilogx(w, decibel, color=LINE)
        if math.isfinite(width):
            label = f"bandwidth {width:.4g} rad/s ({verdict.hertz:.4g} Hz)"
            own.axvline(width, color=MARK, ls="--", label=label)
            own.plot([width], [np.interp(np.log(width), np.log(w), decibel)], "o", color=MARK)
            own.legend()
        own.set(xlabel="w [rad/s]", ylabel=f"{of} [dB]", title="Bandwidth")

    def phase(own: Axes) -> None:
        own.semilogx(w, np.degrees(np.unwrap(np.angle(T))), color=LINE)
        if math.isfinite(width):
            own.axvline(width, color=MARK, ls="--")
        own.set(xlabel="w [rad/s]", ylabel="phase [deg]")

    return _panels([magnitude, phase], ax)


def loop(verdict: Any, ax: Any = None) -> Sequence[Axes]:
    """Magnitude and phase of the open loop with the crossovers, and the Nyquist curve."""
    w, L = curve(verdict._source, *verdict.crossovers)
    at = np.array(verdict.crossovers)
    turned = np.degrees(np.unwrap(np.angle(L)))
    turned -= 360.0 * (turned[0] > 90.0)  # an open loop begins with the lag of its integrators

    def magnitude(own: Axes) -> None:
        own.loglog(w, np.abs(L), color=LINE)
        own.axhline(1.0, color="0.4", lw=0.8)
        if len(at):
            own.plot(at, np.ones(len(at)), "o", color=MARK, label="crossover")
            own.legend()
        said = "stable" if verdict else "not stable"
        if math.isfinite(verdict.delay_margin):
            said += f", delay margin {verdict.delay_margin:.4g} s"
        own.set(xlabel="w [rad/s]", ylabel="|L(jw)|", title=f"Closed loop {said}")

    def phase(own: Axes) -> None:
        own.semilogx(w, turned, color=LINE)
        own.axhline(-180.0, color="0.4", lw=0.8)
        own.plot(at, np.interp(at, w, turned), "o", color=MARK)
        own.set(xlabel="w [rad/s]", ylabel="phase [deg]")

    def nyquist(own: Axes) -> None:
        near = np.abs(L) < NEAR_MINUS_1
        shown = np.where(near, L, np.nan)
        own.plot(np.real(shown), np.imag(shown), color=LINE)
        own.plot([-1.0], [0.0], "+", color=MARK, ms=10, label="-1")
        own.set(xlabel="Re L(jw)", ylabel="Im L(jw)", title="Nyquist, w > 0")
        own.legend()

    return _panels([magnitude, phase, nyquist], ax)


def _panels(panels: list[Any], ax: Any) -> Sequence[Axes]:
    """Draw into a new figure, or into as many Axes as are given (the first panels)."""
    if ax is None:
        return on_pyplot(panels)
    given = list(np.ravel(np.asarray(ax, dtype=object)))
    if len(given) > len(panels) or not all(hasattr(one, "plot") for one in given):
        raise InputError(f"ax must be an Axes, or a list of up to {len(panels)} of them.")
    with style():
        for panel, own in zip(panels, given, strict=False):
            panel(own)
    return given
