"""The plots of the linear checks: Re T and Nyquist, the largest |G|, the band, the open loop.

Sizes are in dB, phases go on without a jump, and frequencies are in rad/s, in all of them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ..core.errors import InputError
from ..linear.curve import curve, name
from ..linear.curve import size as size_of
from ..linear.passivity import least_power
from .canvas import on_pyplot, style

if TYPE_CHECKING:
    from matplotlib.axes import Axes

NEAR_MINUS_1 = 3.0  # up to which |L| the Nyquist curve is drawn
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
        own.set_yscale("asinh", linear_width=max(1e-3 * size, 1e-300))  # signed, without a kink
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
        own.semilogx(w, _decibel(T), color=LINE)
        if math.isfinite(verdict.gain):
            place = "as w grows" if math.isinf(at) else f"at {at:.4g} rad/s"
            most = float(_decibel(verdict.gain))
            label = f"largest: {verdict.gain:.4g} ({most:.4g} dB) {place}"
            own.axhline(most, color=MARK, ls="--", label=label)
            if w[0] <= at <= w[-1]:
                own.plot([at], [most], "o", color=MARK)
            own.legend()
        own.set(xlabel="w [rad/s]", ylabel=f"{of} [dB]", title="L2 gain")

    return _panels([size], ax)


def band(verdict: Any, ax: Any = None) -> Sequence[Axes]:
    """Magnitude and phase with the bandwidth."""
    width = verdict.bandwidth
    w, T = curve(verdict._source, *([width] if math.isfinite(width) else []))
    of = size_of(verdict._source)
    decibel = _decibel(T)

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
    """Magnitude and phase of the open loop with its margins, and the Nyquist curve."""
    at = np.array([w for w in verdict.crossovers if w > 0])
    gain, phase, modulus = (_place(verdict, k) for k in ("gain", "phase", "modulus"))
    w, L = curve(verdict._source, *at, *(x for x in (gain, modulus) if x))
    of = name(verdict._source, "L")
    value = lambda x: complex(*(np.interp(x, w, part) for part in (np.real(L), np.imag(L))))  # noqa: E731
    turned = _turned(L, w, phase, verdict.phase_margin)

    def size_(own: Axes) -> None:
        own.semilogx(w, _decibel(L), color=LINE)
        own.axhline(0.0, color="0.4", lw=0.8)
        own.plot(at, np.zeros(len(at)), "o", color=MARK, label="crossover")
        if gain:
            level = float(_decibel(value(gain)))
            label = f"gain margin {-level:.4g} dB at {gain:.4g} rad/s"
            own.plot([gain, gain], [level, 0.0], color=MARK, lw=2, label=label)
        said = "stable" if verdict else "not stable"
        if math.isfinite(verdict.delay_margin):
            said += f", delay margin {verdict.delay_margin:.4g} s"
        own.set(xlabel="w [rad/s]", ylabel=f"|{of}| [dB]", title=f"Closed loop {said}")
        own.legend()

    def phase_(own: Axes) -> None:
        own.semilogx(w, turned, color=LINE)
        own.axhline(-180.0, color="0.4", lw=0.8)
        own.plot(at, np.interp(at, w, turned), "o", color=MARK)
        if phase:
            ends = [-180.0, verdict.phase_margin - 180.0]
            label = f"phase margin {verdict.phase_margin:.4g} deg at {phase:.4g} rad/s"
            own.plot([phase, phase], ends, color=MARK, lw=2, label=label)
            own.legend()
        own.set(xlabel="w [rad/s]", ylabel="phase [deg]")

    def nyquist(own: Axes) -> None:
        shown = np.where(np.abs(L) < NEAR_MINUS_1, L, np.nan)
        own.plot(np.real(shown), np.imag(shown), color=LINE)
        turn = np.exp(2j * np.pi * np.linspace(0.0, 1.0, 361))
        own.plot(np.real(turn), np.imag(turn), ":", color="0.4", lw=0.8)
        own.plot([-1.0], [0.0], "+", color=MARK, ms=10, label="-1")
        if gain and (x := value(gain).real) > -NEAR_MINUS_1:
            own.plot([-1.0, x], [0.0, 0.0], color="#e08214", label=_said(verdict, "gain"))
        if phase:
            arc = -np.exp(1j * np.radians(np.linspace(0.0, verdict.phase_margin, 181)))
            own.plot(np.real(arc), np.imag(arc), color="#1b7837", label=_said(verdict, "phase"))
        if 0 < verdict.modulus_margin < math.inf:
            ring = verdict.modulus_margin * turn - 1
            label = f"{_said(verdict, 'modulus')}, Ms {verdict.Ms:.4g}"
            own.plot(np.real(ring), np.imag(ring), "--", color=MARK, lw=1, label=label)
        own.set(xlabel=f"Re {of}", ylabel=f"Im {of}", title="Nyquist, w > 0")
        own.set_aspect("equal", adjustable="datalim")
        own.legend()

    return _panels([size_, phase_, nyquist], ax)


def passivity(verdict: Any, ax: Any = None) -> Sequence[Axes]:
    """The least power that the friction takes, over w^2, and the speed at which it is 0."""
    own_speed = verdict.speed if math.isfinite(verdict.speed) else verdict._source[-1]
    w = np.geomspace(1e-3, 1e2, 800) * own_speed
    power = least_power(w, *verdict._source)

    def least(own: Axes) -> None:
        own.semilogx(w, power, color=LINE)
        own.axhline(0.0, color="0.4", lw=0.8)
        if math.isfinite(verdict.speed):
            label = f"may give energy back above {verdict.speed:.4g} rad/s"
            own.axvline(verdict.speed, color=MARK, ls="--", label=label)
            own.legend()
        said = "passive" if verdict else "not passive"
        ylabel = "least (w F - dV/dt)/w^2 [N m s/rad]"
        own.set(xlabel="|w| [rad/s]", ylabel=ylabel, title=f"The friction is {said}")

    return _panels([least], ax)


def _place(verdict: Any, of: str) -> float:
    """The frequency of a margin; 0 where it is not a point of the picture."""
    at = getattr(verdict, f"{of}_margin_frequency")
    return at if math.isfinite(at) else 0.0


def _said(verdict: Any, of: str) -> str:
    value, at = (getattr(verdict, f"{of}_margin{k}") for k in ("", "_frequency"))
    unit = " deg" if of == "phase" else ""
    return f"{of} margin {value:.4g}{unit} at {at:.4g} rad/s"


def _turned(L: np.ndarray, w: np.ndarray, at: float, margin: float) -> np.ndarray:
    """The phase in deg without jumps, which at the crossover is that of its margin."""
    turned = np.degrees(np.unwrap(np.angle(L)))
    if not at:  # an open loop begins with the lag of its integrators
        return turned - 360.0 * (turned[0] > 90.0)
    return turned - 360.0 * round((np.interp(at, w, turned) + 180.0 - margin) / 360.0)


def _decibel(T: Any) -> np.ndarray:
    with np.errstate(divide="ignore"):
        return 20 * np.log10(np.abs(T))


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
