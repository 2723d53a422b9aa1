"""Plots of loops: tracking, observers, what to compensate, limit cycles, sweeps, tables; and over
frequency: the linear checks (rad/s), a measured response and a tuned loop (Hz)."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ..blocks.block import unit_for
from ..core.errors import InputError
from ..core.numeric import Z95
from ..core.unit_names import si_unit
from ..linear.curve import curve
from ..linear.curve import name as name_of
from ..linear.curve import size as size_of
from ..linear.passivity import least_power
from .canvas import AFTER, BEFORE, LINE, MARK, QUIET, drawn, headed, octaves, on_pyplot, style
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
MOST = 10.0  # |D| that is drawn: beyond it are rest and growth without a stick


@drawn
def table(made: Any, ax: Axes) -> Axes:
    rows, errors = np.atleast_2d(made.values), np.atleast_2d(made.error)
    ways = _WAYS if len(rows) == 2 else (("table", AFTER),)
    x = made.points
    if made.periodic:  # close the curve at the first point
        x = np.r_[x, x[0] + 2.0 * np.pi]
        rows, errors = (np.column_stack([y, y[:, :1]]) for y in (rows, errors))
    for y, error, (label, colour) in zip(rows, errors, ways, strict=True):
        ax.fill_between(x, y - Z95 * error, y + Z95 * error, color=colour, alpha=0.2, lw=0)
        ax.plot(x, y, color=colour, lw=1.6, label=label)
    signal, name = made.signals[0], "torque" if made.unit == "N m" else "force"
    over = f"{signal}{' modulo one turn' * made.periodic} [{si_unit(signal, made.motion)}]"
    title = f"Unexplained {name} over {signal}, as a table"
    return headed(ax, title, xlabel=over, ylabel=f"{name} [{made.unit}]")


@drawn
def tracking(made: Any, ax: Axes) -> Axes:
    """Motion minus reference over time, for the loops that stayed stable."""
    errors = {key: run.y - run.r for key, run in made.runs.items()}
    factor, unit = readable([float(np.max(np.abs(e))) for e in errors.values()], made.unit)
    for key, run in made.runs.items():
        ax.plot(run.t, factor * errors[key], color=COLOURS[key], lw=1.3, label=key)
    signal = "w" if made.kind == "velocity" else "theta"
    title = "Tracking error in simulation"
    return headed(ax, title, xlabel="t [s]", ylabel=f"error of {signal} [{unit}]")


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
    ax.set(xscale="log", yticks=y, yticklabels=[row.name for row in rows])
    octaves(ax.xaxis)
    return headed(ax, "Observers on this drive", xlabel=f"RMS error of {made.signal} [{unit}]")


@drawn
def assurance(made: Any, ax: Axes) -> Axes:
    """The upper error over the share of each observer, with the bands of what was chosen."""
    factor, unit = readable([made.none], made.unit)
    ax.set(yscale="log")
    octaves(ax.yaxis)
    for name in dict.fromkeys(one.observer for one in made.tried):
        rows = sorted((one.scale, one.upper) for one in made.tried if one.observer == name)
        x, y = np.array(rows).T
        ax.plot(x, factor * y, ".-", lw=1.0, label=name)
    for label, colour, middle, ends, x in (
        ("without", QUIET, made.none, made.none_band, 0.0),
        ("to be dared", AFTER, made.error, made.band, made.scale),
    ):
        bars = factor * np.abs(np.array([ends]).T - middle)
        look = {"fmt": "o", "color": colour, "capsize": 4, "label": f"{label}, 95 %"}
        ax.errorbar([x], [factor * middle], bars, **look)
    error = f"RMS error on {100.0 * made.confidence:g} % of drives [{unit}]"
    title = made._title().removeprefix("Assurance: ").capitalize()
    return headed(ax, title, xlabel="share of the estimate", ylabel=error)


@drawn
def chance(made: Any, ax: Axes) -> Axes:
    """Amplitude over period of the members that hunt."""
    ax.plot(made.periods, made.amplitudes, "o", color=BEFORE, label="drives that hunt")
    title = made._title().capitalize()
    return headed(ax, title, xlabel="period [s]", ylabel=f"amplitude [{made.unit}]")


@drawn
def growth(found: Any, ax: Axes) -> Axes:
    """T(e)/e over the error e at breakaway; cycles where it is 1."""
    ax.set(xscale="log", yscale="log")
    if found.curve is not None:
        x, D = found.curve
        ax.plot(x, np.exp(np.where(np.abs(D) < MOST, D, np.nan)), color=LINE, label="T(e)/e")
    ax.axhline(1.0, color="0.4", lw=0.8)
    for stable, colour, name in ((True, MARK, "stable cycle"), (False, UNSTABLE, "unstable")):
        sizes = [c.amplitude for c in found.cycles if c.stable == stable]
        if sizes:
            fill = colour if stable else "none"
            ax.plot(sizes, np.ones(len(sizes)), "o", color=colour, mfc=fill, label=name)
    if found.basin:
        ax.axvline(found.basin, color=UNSTABLE, ls="--", label="border of rest")
    over = f"error at breakaway [{unit_for('rad', found.motion)}]"
    title = found._title()[:1].upper() + found._title()[1:]
    return headed(ax, title, xlabel=over, ylabel="error at the next turn / error")


@drawn
def sliding(found: Any, ax: Axes) -> Axes:
    """How fast a deviation from steady sliding grows over the speed, and both speeds."""
    if found.growth is not None:
        ax.semilogx(*found.growth, color=LINE, label="growth of a small deviation")
    ax.axhline(0.0, color="0.4", lw=0.8)
    for name, speed, colour in (
        ("sliding is unstable below", found.speed_start, UNSTABLE),
        ("no stick-slip above", found.speed_end, MARK),
    ):
        if speed and np.isfinite(speed):
            ax.axvline(speed, color=colour, ls="--", label=name)
    title = found._title()[:1].upper() + found._title()[1:]
    return headed(ax, title, xlabel=f"speed v [{found.unit}]", ylabel="growth [1/s]")


@drawn
def regions(found: Any, ax: Axes) -> Axes:
    """The regions over two gains, with the user's gains."""
    from matplotlib.colors import ListedColormap
    from matplotlib.patches import Patch

    (one, two), (first, second) = found.names, found.values
    colours = ListedColormap(list(REGIONS.values()))
    ax.pcolormesh(first, second, found.region.T, cmap=colours, vmin=0, vmax=3, shading="nearest")
    pairs = REGIONS.items()
    marks: list[Any] = [Patch(facecolor=c, edgecolor="0.5", label=name) for name, c in pairs]
    if one in found.gains and two in found.gains:
        at = ([found.gains[one]], [found.gains[two]])
        marks += ax.plot(*at, "k*", ms=12, label="your gains")
    ax.set(xscale="log", yscale="log")
    label = "friction, times what is believed" if two == "friction" else two
    return headed(ax, "Where the loop hunts", marks, xlabel=one, ylabel=label)


@drawn
def sweep(found: Any, ax: Axes, output: str | None = None) -> Axes:
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
    return headed(ax, f"{found.name}, {len(values)} members", xlabel="t [s]", ylabel=name)


# ---- over frequency


NEAR_MINUS_1 = 3.0  # up to which |L| the Nyquist curve is drawn
CERTAIN = 0.95  # the least coherence that is drawn as certain
_DASHED: dict[str, Any] = {"color": MARK, "ls": "--"}
TURN = np.exp(2j * np.pi * np.linspace(0.0, 1.0, 361))
OVER = "w [rad/s]"
TURNED = -450.0  # deg: a dead time turns on and on, far below every margin


def realness(verdict: Any, ax: Any = None) -> Sequence[Axes]:
    edge = verdict.band_edge
    w, T = _curve(verdict, edge)
    w, re = w[np.isfinite(T)], np.real(T[np.isfinite(T)])
    shown = verdict and math.isfinite(verdict.margin)
    margin = f", margin {verdict.margin:.4g} 1/s" if shown else ""
    said = f"{verdict.classification}{margin}", f"band edge {edge:.4g} rad/s"
    axes = _marked(ax, w, re, edge, said, ylabel=f"Re {name_of(verdict._source)}")
    least = max(1e-3 * np.max(np.abs(re), initial=0.0), 1e-300)  # signed, without a kink
    axes[0].set_yscale("asinh", linear_width=least)
    return axes


def gain(verdict: Any, ax: Any = None) -> Sequence[Axes]:
    at = verdict.frequency
    w, T = _curve(verdict, at)
    place = "as w grows" if math.isinf(at) else f"at {at:.4g} rad/s"
    title = f"L2 gain, largest: {verdict.gain:.4g} ({_decibel(verdict.gain):.4g} dB) {place}"
    return _marked(ax, w, _decibel(T), at, (title,), ylabel=f"{size_of(verdict._source)} [dB]")


def band(verdict: Any, ax: Any = None) -> Sequence[Axes]:
    width = verdict.bandwidth
    w, T = _curve(verdict, width)
    title = f"bandwidth {width:.4g} rad/s ({verdict.hertz:.4g} Hz)"
    return _marked(ax, w, _decibel(T), width, (title,), ylabel=f"{size_of(verdict._source)} [dB]")


def passivity(verdict: Any, ax: Any = None) -> Sequence[Axes]:
    """The least power that the friction takes, over w^2, and the speed at which it is 0."""
    speed = verdict.speed
    w = np.geomspace(1e-3, 1e2, 800) * (speed if math.isfinite(speed) else verdict._source[-1])
    title = f"The friction is {'passive' if verdict else 'not passive'}"
    said = title, f"may give energy back above {speed:.4g} rad/s"
    power = {"xlabel": "|w| [rad/s]", "ylabel": "least (w F - dV/dt)/w^2 [N m s/rad]"}
    return _marked(ax, w, least_power(w, *verdict._source), speed, said, **power)


def _marked(
    ax: Any, w: np.ndarray, y: np.ndarray, at: float, said: Sequence[str], **axes: Any
) -> Sequence[Axes]:
    """Draw y over w; ``said``: the title, and what is at the frequency that is marked."""

    def panel(own: Axes) -> None:
        _line(own, w, y)
        if w[0] <= at <= w[-1]:
            own.axvline(at, **_DASHED, label="".join(said[1:]) or None)
            own.plot([at], [np.interp(at, w, y)], "o", color=MARK)
        own.set_xlabel(OVER)
        headed(own, said[0], **axes)

    return _panels([panel], ax)


def loop(verdict: Any, ax: Any = None) -> Sequence[Axes]:
    """Magnitude and phase of the open loop with its margins, and the Nyquist curve."""
    at = np.array([w for w in verdict.crossovers if w > 0])
    said = f"Closed loop {'stable' if verdict else 'not stable'}"
    if math.isfinite(verdict.delay_margin):
        said += f", delay margin {verdict.delay_margin:.4g} s"
    ends = {of: _place(verdict, of) for of in ("gain", "phase", "modulus")}
    w, L = curve(verdict._source, *at, *(ends[k] for k in ("gain", "modulus") if ends[k]))
    crossing = np.interp(ends["gain"], w, np.real(L)) + 1j * np.interp(ends["gain"], w, np.imag(L))
    of = name_of(verdict._source, "L")
    turned = _turned(L, w, ends["phase"], verdict.phase_margin)

    def size(own: Axes) -> None:
        _line(own, w, _decibel(L), 0.0)
        own.plot(at, np.zeros(len(at)), "o", color=MARK, label="crossover")
        if ends["gain"]:
            level = float(_decibel(crossing))
            label = f"gain margin {-level:.4g} dB at {ends['gain']:.4g} rad/s"
            own.plot([ends["gain"]] * 2, [level, 0.0], color=MARK, lw=2, label=label)
        headed(own, said, xlabel=OVER, ylabel=f"|{of}| [dB]")

    def phase(own: Axes) -> None:
        _line(own, w, turned, -180.0)
        own.plot(at, np.interp(at, w, turned), "o", color=MARK)
        if ends["phase"]:
            span = [-180.0, verdict.phase_margin - 180.0]
            own.plot([ends["phase"]] * 2, span, color=MARK, lw=2, label=_said(verdict, "phase"))
        low = min([TURNED, *np.interp(at, w, turned) - 90.0])
        own.set_ylim(max(own.get_ylim()[0], low))
        headed(own, "", xlabel=OVER, ylabel="phase [deg]")

    def nyquist(own: Axes) -> None:
        _about_minus_1(own, L, verdict, crossing.real if ends["gain"] else -math.inf)
        headed(own, "Nyquist, w > 0", columns=1, xlabel=f"Re {of}", ylabel=f"Im {of}")

    return _panels([size, phase, nyquist], ax)


def _about_minus_1(own: Axes, L: np.ndarray, verdict: Any, crossing: float) -> None:
    """L(jw) near -1 with its margins; ``crossing``: where it meets the axis, -inf if nowhere."""
    shown = np.where(np.abs(L) < NEAR_MINUS_1, L, np.nan)
    own.plot(np.real(shown), np.imag(shown), color=LINE)
    own.plot(np.real(TURN), np.imag(TURN), ":", color="0.4", lw=0.8)
    own.plot([-1.0], [0.0], "+", color=MARK, ms=10, label="-1")
    if crossing > -NEAR_MINUS_1:
        label = _said(verdict, "gain")
        own.plot([-1.0, crossing], [0.0, 0.0], color="#e08214", label=label)
    if _place(verdict, "phase"):
        arc = -np.exp(1j * np.radians(np.linspace(0.0, verdict.phase_margin, 181)))
        own.plot(np.real(arc), np.imag(arc), color="#1b7837", label=_said(verdict, "phase"))
    if 0 < verdict.modulus_margin < math.inf:
        ring = verdict.modulus_margin * TURN - 1
        label = f"{_said(verdict, 'modulus')}, Ms {verdict.Ms:.4g}"
        own.plot(np.real(ring), np.imag(ring), "--", color=MARK, lw=1, label=label)
    own.set_aspect("equal", adjustable="datalim")


def _curve(verdict: Any, at: float) -> tuple[np.ndarray, np.ndarray]:
    return curve(verdict._source, *([at] if math.isfinite(at) else []))


def _line(own: Axes, w: np.ndarray, y: np.ndarray, level: float | None = None) -> None:
    own.semilogx(w, y, color=LINE)
    if level is not None:
        own.axhline(level, color="0.4", lw=0.8)


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


def bode(found: Any) -> Sequence[Axes]:
    """Magnitude, phase and coherence over Hz, certain points in full; gains with their loop."""
    f = found.frequency / (2.0 * np.pi)
    sure = np.where(found.certain, 1.0, np.nan)

    def curves(ax: Axes, raw: np.ndarray, clean: np.ndarray) -> None:
        ax.semilogx(f, raw, color=BEFORE, lw=0.9, label="as recorded")
        ax.plot(f, clean, color=QUIET, lw=1.0)
        ax.plot(f, clean * sure, ".-", color=LINE, lw=1.5, ms=2.5, label="friction taken out")

    def magnitude(ax: Axes) -> None:
        sizes = (found.low, found.magnitude, found.high, np.asarray(found.raw.frdata)[0, 0])
        low, size, high, raw = map(_decibel, sizes)
        curves(ax, raw, size)
        floor = np.nanmin(size) - 20.0  # a band that reaches 0 ends there
        ax.fill_between(f, np.maximum(low, floor), high, color=LINE, alpha=0.25, lw=0)
        for mode in found.modes:
            hertz, dots = mode.frequency / (2.0 * np.pi), mode.kind == "antiresonance"
            look = {"color": MARK, "lw": 0.9, "ls": ":" if dots else "--"}
            ax.axvline(hertz, **look, label=f"{mode.kind} {hertz:.3g} Hz")
        bad = f[found.governed]
        title = f"Friction governs {bad[0]:.3g} to {bad[-1]:.3g} Hz" if len(bad) else ""
        headed(ax, title, ylabel=f"|P| [dB of {found.unit}]")

    def phase(ax: Axes) -> None:
        curves(ax, np.degrees(found.raw_phase), np.degrees(found.phase))
        ax.set(ylabel="phase [deg]")

    def coherence(ax: Axes) -> None:
        ax.semilogx(f, found.coherence, color=LINE, lw=1.2)
        ax.axhline(CERTAIN, color=MARK, ls="--", lw=0.9)
        ax.set(xlabel="f [Hz]", ylabel="coherence", ylim=(0.0, 1.02))

    own, more = [magnitude, phase, coherence], _of_gains(found.gains) if found.gains else []
    axes = on_pyplot([*own, *more], columns=2 if more else 1)
    for ax in axes[: len(own)]:
        ax.set_xlim(f[0], f[-1])
        octaves(ax.xaxis)
    return axes


def tuning(found: Any) -> Sequence[Axes]:
    return on_pyplot(_of_gains(found), columns=2)


def _of_gains(found: Any) -> list[Callable[[Axes], None]]:
    def nyquist(ax: Axes) -> None:
        L = np.asarray(found.loop.frdata)[0, 0]
        Ms, wide = found.margins.Ms, NEAR_MINUS_1
        circle = -1.0 + TURN / Ms
        ax.plot(np.real(L), np.imag(L), color=LINE, lw=1.3, label="L")
        ax.plot(np.real(circle), np.imag(circle), color=MARK, lw=0.9, label=f"Ms {Ms:.2f}")
        ax.plot(np.real(TURN), np.imag(TURN), color="0.7", lw=0.7, ls=":")
        ax.plot([-1.0], [0.0], "+", color=MARK)
        ax.set(xlim=(-wide, wide / 3), ylim=(-wide / 1.5, wide / 1.5), aspect="equal")
        gains = found.cascade or {k: getattr(found, k) for k in ("kp", "ki", "kd")}
        said = ", ".join(f"{k} {v:.4g}" for k, v in gains.items() if v)
        headed(ax, f"{found._title()}: {said}", xlabel="Re L", ylabel="Im L")

    def step(ax: Axes) -> None:
        t, y = found.step()
        what = "speed" if found.structure == "PI" else "position"
        ax.plot(t, y, color=LINE, lw=1.3)
        ax.axhline(1.0, color="0.7", lw=0.7)
        ax.set(xlabel="t [s]", ylabel=f"{what} / reference", xlim=(0.0, t[-1] / 2))
        ax.set_title(f"A step of the {what}, without friction")

    return [nyquist, step]
