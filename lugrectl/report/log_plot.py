"""The log as it was read: torque and motion over time, the friction curve, the plain fit."""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Iterator
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from ..blocks.block import unit_for
from ..core.numeric import top_speed
from ..core.unit_names import si_unit
from ..estimates.balance import Balance, at_samples, friction
from .canvas import AFTER as FITTED
from .canvas import HALF, MEASURED, binned, drawn, headed, on_pyplot
from .page import Figure
from .wording import number, readable

if TYPE_CHECKING:
    from matplotlib.axes import Axes

LEFT_OUT = "#e9b44c"
TITLES = {"u": "Torque", "w": "Speed", "theta": "Angle"}
_BINS = 1500  # of time over which a long signal is drawn as a band from least to greatest value
_MEANS, _DOTS = 160, 4000  # bins in which a residual is averaged, and points of it
_REST = 0.02  # of the top speed, below which a sample is at rest
_LINES = 14  # of remarks beside the plots
_COLUMNS = 78  # of a line of remarks


def plot(balance: Balance) -> list[Axes]:
    """All panels in one new figure of pyplot; returns their Axes."""
    panels = [figure.draw for figure in figures(balance)]
    return on_pyplot([*panels, *([partial(remarks, balance)] if balance.said else [])], columns=2)


def figures(balance: Balance) -> list[Figure]:
    """Every plot that there is something for; the remarks are text in a report."""
    panels = _panels(balance) if balance.stretches else ()
    return [Figure(f"log-{i}", caption, draw, HALF) for i, (caption, draw) in enumerate(panels)]


def _panels(balance: Balance) -> Iterator[tuple[str, Callable[..., Any]]]:
    """Caption and plot."""
    some = balance.stretches[0]
    motion = [role for role in ("w", "theta") if getattr(some, role) is not None]
    shaded = "; shaded: left out" if any(not one.ok.all() for one in balance.stretches) else ""
    yield f"Torque as it was recorded{shaded}.", partial(signal, balance, role="u")
    for role in motion:
        yield f"{role} as it was recorded.", partial(signal, balance, role=role)
    if balance.curve:
        yield "Friction over speed, with 95 % bars, and the plain fit.", partial(curve, balance)
    if balance.residual is not None:
        yield "What the plain torque balance leaves.", partial(fit, balance)
        for role in dict.fromkeys(("w", *motion)):
            caption = f"The same over {role}, with its mean; without samples at rest."
            yield caption, partial(rest, balance, role=role)


def starts(balance: Balance) -> list[float]:
    """What is added to the time of each stretch, so that runs follow one another."""
    made, shift, last, run = [], 0.0, 0.0, None
    for one in balance.stretches:
        if run is not None and one.run != run:
            shift = last - float(one.t[0])
        made.append(shift)
        run, last = one.run, shift + float(one.t[-1])
    return made


@drawn
def signal(balance: Balance, ax: Axes, role: str = "u") -> Axes:
    """A channel over time; a long one as the band between its least and greatest values."""
    for one, shift in zip(balance.stretches, starts(balance), strict=True):
        t, low, high = envelope(one.t + shift, getattr(one, role))
        ax.fill_between(t, low, high, color=MEASURED, lw=0.6, rasterized=True)
        edges = np.flatnonzero(np.diff(np.r_[False, ~one.ok, False]))
        for a, b in edges.reshape(-1, 2):  # samples that are not used
            start, end = float(one.t[a]) + shift, float(one.t[b - 1]) + shift
            ax.axvspan(start, end, color=LEFT_OUT, alpha=0.5, lw=0)
    _between_runs(balance, ax)
    ax.set(xlabel="t [s]", ylabel=f"{role} [{si_unit(role, balance.motion)}]")
    ax.margins(x=0.01)
    return headed(ax, f"{TITLES[role]} as recorded")


@drawn
def curve(balance: Balance, ax: Axes) -> Axes:
    """Friction torque in bins of speed, both directions."""
    points, values = balance.curve, balance.values()
    w, torque = (np.array([getattr(p, k) for p in points]) for k in ("w", "torque"))
    factor, unit = readable([np.abs(torque).max(initial=0.0)], unit_for("N m", balance.motion))
    bars = np.array([p.ci95 or (p.torque, p.torque) for p in points])
    sides = np.abs(bars - torque[:, None]).T
    ax.errorbar(w, factor * torque, factor * sides, fmt="o", ms=4, lw=1.0, color=FITTED)
    for side in (-1, 1) if "Fc" in values and balance.half_width is not None else ():
        x = np.linspace(0.0, side * (side * w).max(initial=0.0), 2)
        law = friction(balance, x, side) + values.get("constant_torque", 0.0)
        ax.plot(x, factor * law, color=MEASURED, lw=1.2, label="plain fit" if side > 0 else None)
    ax.set(xlabel=f"w [{unit_for('rad/s', balance.motion)}]", ylabel=f"friction [{unit}]")
    ax.margins(x=0.01)
    return headed(ax, "Friction over speed")


@drawn
def fit(balance: Balance, ax: Axes) -> Axes:
    """What the plain balance leaves of the torque, in windows over time."""
    windows = balance.residual
    assert windows is not None
    pairs = zip(balance.stretches, starts(balance), strict=True)
    shifts = {one.run: shift for one, shift in pairs}
    t = windows.t + np.array([shifts.get(int(run), 0.0) for run in windows.run])
    factor, unit = readable([np.abs(windows.value).max()], unit_for("N m", balance.motion))
    _between_runs(balance, ax)
    ax.plot(t, factor * windows.value, ".", ms=2.0, color=FITTED, rasterized=True)
    ax.set(xlabel="t [s]", ylabel=f"residual torque [{unit}]")
    ax.margins(x=0.01)
    left = number(100.0 * (balance.left or 0.0), 2)
    return headed(ax, f"Plain fit: leaves {left} % of the RMS torque")


@drawn
def rest(balance: Balance, ax: Axes, role: str = "theta") -> Axes:
    """The same over speed or angle, and its mean; samples at rest would cover all others."""
    parts = [at_samples(balance, one) for one in balance.stretches]
    w, x, y = (np.concatenate([part[k] for part in parts]) for k in ("w", role, "left"))
    good = np.isfinite(y)
    moving = good & (np.abs(w) > _REST * top_speed(w[good]))
    good = moving if moving.any() else good
    x, y = x[good], y[good]
    span = 2.0 * np.pi if role == "theta" and balance.motion == "rotary" else 0.0
    turns = span > 0.0 and bool(np.ptp(x) > span)
    x = np.mod(x, span) if turns else x
    edges = np.linspace(x.min(), x.max(), max(4, min(_MEANS, len(x) // 20)) + 1)
    factor, unit = readable([np.quantile(np.abs(y), 0.99)], unit_for("N m", balance.motion))
    some = slice(None, None, max(1, len(x) // _DOTS))
    ax.plot(x[some], factor * y[some], ".", ms=1.5, color=MEASURED, alpha=0.25, rasterized=True)
    ax.plot(*binned(x, factor * y, edges), color=FITTED, lw=1.8)
    low, high = np.quantile(factor * y, [0.005, 0.995])
    ax.set_ylim(1.3 * low - 0.3 * high, 1.3 * high - 0.3 * low)
    over = f"{role}{' modulo one turn' * turns} [{si_unit(role, balance.motion)}]"
    ax.set(xlabel=over, ylabel=f"residual torque [{unit}]")
    ax.margins(x=0.01)
    return headed(ax, f"Plain fit: what it leaves over {role}, and its mean")


def _between_runs(balance: Balance, ax: Axes) -> None:
    """A line where a run ends and the next one begins."""
    parts, shifts = balance.stretches, starts(balance)
    for before, one, shift in zip(parts, parts[1:], shifts[1:], strict=False):
        if one.run != before.run:
            ax.axvline(float(one.t[0]) + shift, color="#9aa4b0", lw=0.9, ls="--")


@drawn
def remarks(balance: Balance, ax: Axes) -> Axes:
    """What was noticed while the log was read, as text."""
    bullet: Any = {"initial_indent": "- ", "subsequent_indent": "  "}
    lines = [line for note in balance.said for line in textwrap.wrap(note, _COLUMNS, **bullet)]
    if len(lines) > _LINES:
        lines = [*lines[: _LINES - 1], "  ..."]
    ax.axis("off")
    text = "\n".join(lines)
    ax.text(0.0, 1.0, text, va="top", family="monospace", fontsize=7.5, transform=ax.transAxes)
    return headed(ax, "What was noticed")


def envelope(t: np.ndarray, x: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times, least and greatest values in so many bins; the samples themselves if there are few."""
    if len(x) <= 2 * _BINS:
        return t, x, x
    edges = np.linspace(0, len(x), _BINS + 1).astype(int)[:-1]
    with np.errstate(invalid="ignore"):
        return t[edges], np.fmin.reduceat(x, edges), np.fmax.reduceat(x, edges)
