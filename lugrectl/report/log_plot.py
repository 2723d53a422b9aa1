"""The log as it was read: torque and motion over time, the friction curve, the plain fit."""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.signal import savgol_filter

from ..blocks.block import unit_for
from .canvas import HALF, drawn, headed, inline_svg, on_pyplot
from .loop_plots import COLOURS
from .views import binned
from .wording import number, readable

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from ..estimates.balance import Balance
    from ..record.stretches import Stretch

MEASURED, FITTED, LEFT_OUT = "#3b4450", COLOURS["after"], "#e9b44c"
NOTICED = "What was noticed."
_BINS = 1500  # of time over which a long signal is drawn as a band from least to greatest value
_MEANS, _DOTS = 160, 4000  # bins in which a residual is averaged, and points of it
_SMOOTH = 0.03  # s over which the motion is differentiated
_LINES = 14  # of remarks beside the plots
_COLUMNS = 78  # of a line of remarks


def starts(balance: Balance) -> list[float]:
    """What is added to the time of each stretch, so that runs follow one another."""
    made, shift, last, run = [], 0.0, 0.0, None
    for one in balance.stretches:
        if run is not None and one.run != run:
            shift = last - float(one.t[0])
        made.append(shift if run is not None else 0.0)
        run, last = one.run, shift + float(one.t[-1])
    return made


def plot(balance: Balance) -> list[Axes]:
    """All panels in one new figure of pyplot; returns their Axes."""
    return on_pyplot([panel for _, panel in panels(balance)], columns=2)


def panels(balance: Balance) -> list[tuple[str, Callable[[Axes], Any]]]:
    """Caption and panel of each plot that there is something for."""
    noticed = (NOTICED, partial(remarks, balance))
    some = balance.stretches[0] if balance.stretches else None
    if some is None:
        return [noticed] if balance.said else []
    shaded = "; shaded: left out" if any(left_out(one) for one in balance.stretches) else ""
    made = [(f"Torque as it was recorded{shaded}.", partial(signal, balance, role="u"))]
    for role in ("w", "theta"):
        if getattr(some, role) is not None:
            made.append((f"{role} as it was recorded.", partial(signal, balance, role=role)))
    if balance.curve:
        made.append(
            ("Friction over speed, with 95 % bars, and the plain fit.", partial(curve, balance))
        )
    if balance.residual is not None:
        made.append(("What the plain torque balance leaves.", partial(fit, balance)))
        over = ["w", *(["theta"] if some.theta is not None else [])]
        made += [(f"The same over {role}, with its mean.", partial(rest, balance, role=role))
                 for role in over]  # fmt: skip
    if balance.said:
        made.append(noticed)
    return made


def drawings(balance: Balance) -> list[tuple[str, str]]:
    """Caption and inline SVG of each panel but the remarks, which a report has as text."""
    made = [panel for panel in panels(balance) if panel[0] != NOTICED]
    return [
        (caption, inline_svg(panel, f"log-{i}", HALF)) for i, (caption, panel) in enumerate(made)
    ]


@drawn
def signal(balance: Balance, ax: Axes, role: str = "u") -> Axes:
    """A channel over time; a long one as the band between its least and greatest values."""
    for one, shift in zip(balance.stretches, starts(balance), strict=True):
        t, low, high = envelope(one.t + shift, getattr(one, role))
        ax.fill_between(t, low, high, color=MEASURED, lw=0.6, rasterized=True)
        for a, b in left_out(one):
            ax.axvspan(one.t[a] + shift, one.t[b - 1] + shift, color=LEFT_OUT, alpha=0.5, lw=0)
    _between_runs(balance, ax)
    ax.set(xlabel="t [s]", ylabel=f"{role} [{_unit(role, balance.motion)}]")
    return _titled(ax, {"u": "Torque", "w": "Speed", "theta": "Angle"}[role] + " as recorded")


@drawn
def curve(balance: Balance, ax: Axes) -> Axes:
    """Friction torque in bins of speed, both directions."""
    points = balance.curve
    w, torque = (np.array([getattr(p, k) for p in points]) for k in ("w", "torque"))
    factor, unit = readable(
        [float(np.abs(torque).max(initial=0.0))], unit_for("N m", balance.motion)
    )
    bars = np.array([p.ci95 or (p.torque, p.torque) for p in points])
    sides = np.abs(bars - torque[:, None]).T
    ax.errorbar(w, factor * torque, factor * sides, fmt="o", ms=4, lw=1.0, color=FITTED)
    values = {k: v for k, v in balance.values().items() if k in ("Fc", "Fv", "constant_torque")}
    for side in (-1, 1) if "Fc" in values and balance.half_width is not None else ():
        x = np.linspace(0.0, side * (side * w).max(initial=0.0), 2)
        law = _friction(values, x, side) + values.get("constant_torque", 0.0)
        ax.plot(x, factor * law, color=MEASURED, lw=1.2, label="plain fit" if side > 0 else None)
    ax.set(xlabel=f"w [{unit_for('rad/s', balance.motion)}]", ylabel=f"friction [{unit}]")
    return _titled(ax, "Friction over speed")


@drawn
def fit(balance: Balance, ax: Axes) -> Axes:
    """What the plain balance leaves of the torque, in windows over time."""
    windows = balance.residual
    assert windows is not None
    shifts: dict[int, float] = {}
    for one, shift in zip(balance.stretches, starts(balance), strict=True):
        shifts.setdefault(one.run, shift)
    t = windows.t + np.array([shifts.get(int(run), 0.0) for run in windows.run])
    factor, unit = readable([float(np.abs(windows.value).max())], unit_for("N m", balance.motion))
    _between_runs(balance, ax)
    ax.plot(t, factor * windows.value, ".", ms=2.0, color=FITTED, rasterized=True)
    ax.set(xlabel="t [s]", ylabel=f"residual torque [{unit}]")
    left = number(100.0 * (balance.left or 0.0), 2)
    _titled(ax, "")
    headed(ax, f"Plain fit: leaves {left} % of the RMS torque")
    return ax


@drawn
def rest(balance: Balance, ax: Axes, role: str = "theta") -> Axes:
    """The same over the speed or the angle, of a rotary drive over one turn, and its mean."""
    parts = [sampled_rest(balance, one) for one in balance.stretches]
    x = np.concatenate([part[role] for part in parts])
    y = np.concatenate([part["left"] for part in parts])
    good = np.isfinite(y)
    x, y = x[good], y[good]
    span = 2.0 * np.pi if role == "theta" and balance.motion == "rotary" else 0.0
    turns = span > 0.0 and np.ptp(x) > span
    x = np.mod(x, span) if turns else x
    edges = np.linspace(x.min(), x.max(), max(4, min(_MEANS, len(x) // 20)) + 1)
    factor, unit = readable([float(np.quantile(np.abs(y), 0.99))], unit_for("N m", balance.motion))
    some = slice(None, None, max(1, len(x) // _DOTS))
    ax.plot(x[some], factor * y[some], ".", ms=1.5, color=MEASURED, alpha=0.25, rasterized=True)
    ax.plot(*binned(x, factor * y, edges), color=FITTED, lw=1.8)
    low, high = np.quantile(factor * y, [0.005, 0.995])
    ax.set_ylim(1.3 * low - 0.3 * high, 1.3 * high - 0.3 * low)
    over = f"{role} modulo one turn" if turns else role
    ax.set(xlabel=f"{over} [{_unit(role, balance.motion)}]", ylabel=f"residual torque [{unit}]")
    return _titled(ax, f"Plain fit: what it leaves over {role}, and its mean")


def sampled_rest(balance: Balance, one: Stretch) -> dict[str, Any]:
    """theta, w and what the fit leaves at the samples of a stretch; NaN near rest.

    The windows of the fit are wider than a wave over a few degrees. The slow part is theirs; how
    a sample departs from its window is u minus inertia and friction there.
    """
    windows, values = balance.residual, balance.values()
    assert windows is not None
    n, dt = len(one.t), float(one.t[1] - one.t[0])
    width = 2 * min(max(round(_SMOOTH / dt / 2), 2), (n - 1) // 2 - 1) + 1
    nothing: dict[str, Any] = {k: np.full(n, np.nan) for k in ("theta", "w", "left")}
    at = (windows.run == one.run) & (windows.t >= one.t[0]) & (windows.t <= one.t[-1])
    if width < 5 or at.sum() < 3:
        return nothing
    smooth: Any = partial(savgol_filter, window_length=width, polyorder=3, delta=dt)
    if one.theta is None:
        w, a = smooth(one.w), smooth(one.w, deriv=1)
    else:
        w, a = smooth(one.theta, deriv=1), smooth(one.theta, deriv=2)
    fast = one.u - values.get("J", 0.0) * a - _friction(values, w, np.sign(w))
    total, half = np.r_[0.0, np.cumsum(fast) * dt], float(np.median(np.diff(windows.t[at])))
    ends = [np.clip(windows.t[at] + k * half, one.t[0], one.t[-1] + dt) for k in (-1, 1)]
    low, high = (np.interp(end, np.r_[one.t, one.t[-1] + dt], total) for end in ends)
    slow = windows.value[at] - (high - low) / (ends[1] - ends[0])
    slides = (one.t >= windows.t[at].min()) & (one.t <= windows.t[at].max())
    left = np.where(slides & one.ok, fast + np.interp(one.t, windows.t[at], slow), np.nan)
    return {"theta": nothing["theta"] if one.theta is None else one.theta, "w": w, "left": left}


def _friction(values: Mapping[str, float], w: np.ndarray, side: np.ndarray | float) -> np.ndarray:
    """That of the plain fit at speeds w in the direction ``side``."""
    return values.get("Fc", 0.0) * side + values.get("Fv", 0.0) * w


def _between_runs(balance: Balance, ax: Axes) -> None:
    """A line where a run ends and the next one begins."""
    run = None
    for one, shift in zip(balance.stretches, starts(balance), strict=True):
        if run not in (None, one.run):
            ax.axvline(float(one.t[0]) + shift, color="#9aa4b0", lw=0.9, ls="--")
        run = one.run


@drawn
def remarks(balance: Balance, ax: Axes) -> Axes:
    """What was noticed while the log was read, as text."""
    lines = [line for note in balance.said for line in _bullet(note)]
    if len(lines) > _LINES:
        lines = [*lines[: _LINES - 1], "  ..."]
    ax.axis("off")
    text = "\n".join(lines)
    ax.text(0.0, 1.0, text, va="top", family="monospace", fontsize=7.5, transform=ax.transAxes)
    return _titled(ax, "What was noticed")


def _bullet(note: str) -> list[str]:
    return textwrap.wrap(note, _COLUMNS, initial_indent="- ", subsequent_indent="  ")


def envelope(t: np.ndarray, x: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times, least and greatest values in so many bins; the samples themselves if there are few."""
    if len(x) <= 2 * _BINS:
        return t, x, x
    edges = np.linspace(0, len(x), _BINS + 1).astype(int)[:-1]
    with np.errstate(invalid="ignore"):
        return t[edges], np.fmin.reduceat(x, edges), np.fmax.reduceat(x, edges)


def left_out(one: Stretch) -> Iterator[tuple[int, int]]:
    """First and last (exclusive) sample of each part of a stretch that is not used."""
    edges = np.flatnonzero(np.diff(np.r_[False, ~one.ok, False]))
    return ((int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True))


def _unit(role: str, motion: str) -> str:
    return unit_for({"u": "N m", "w": "rad/s", "theta": "rad"}[role], motion)


def _titled(ax: Axes, title: str) -> Axes:
    ax.set_title(title)
    ax.margins(x=0.01)
    return ax
