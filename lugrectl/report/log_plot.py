"""The log as it was read: torque and motion over time, the friction curve, the plain fit."""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Iterator
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from ..blocks.block import unit_for
from .canvas import HALF, drawn, headed, inline_svg, on_pyplot
from .loop_plots import COLOURS
from .wording import number, readable

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from ..identification.balance import Balance
    from ..record.stretches import Stretch

MEASURED, FITTED, LEFT_OUT = "#3b4450", COLOURS["after"], "#e9b44c"
NOTICED = "What was noticed."
_BINS = 1500  # of time over which a long signal is drawn as a band from least to greatest value
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
    made = [("Torque as it was recorded; shaded: left out.", partial(signal, balance, role="u"))]
    for role in ("w", "theta"):
        if getattr(some, role) is not None:
            made.append((f"{role} as it was recorded.", partial(signal, balance, role=role)))
    if balance.curve:
        made.append(("Friction over speed, with 95 % bars.", partial(curve, balance)))
    if balance.residual is not None:
        made.append(("What the plain torque balance leaves.", partial(fit, balance)))
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
    for which, colour, label in (
        (windows.sliding, FITTED, "sliding"),
        (~windows.sliding, LEFT_OUT, "near rest"),
    ):
        y = factor * windows.value[which]
        ax.plot(t[which], y, ".", ms=2.0, color=colour, label=label, rasterized=True)
    ax.set(xlabel="t [s]", ylabel=f"residual torque [{unit}]")
    left = number(100.0 * (balance.left or 0.0), 2)
    _titled(ax, "")
    headed(ax, f"Plain fit: leaves {left} % of the RMS torque")
    return ax


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
