"""The reproduction in words, tables and figures: as text, as a page, as files."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from .. import report
from ..core.display import NONE, Grid, show_poles
from ..report.canvas import AFTER, BEFORE, MEASURED, QUIET, headed
from ..report.page import Figure, Page, Section
from .runs import SMALL, Errors, Outcome, PaperFigure, Reproduction, milli, peaks

if TYPE_CHECKING:
    from matplotlib.axes import Axes

FILES: tuple[str, ...] = ("reproduce.html", "reproduce.json")
UNITS = {
    "J": ("kg m2", "total inertia"),
    "sigma0": ("N m/rad", "bristle stiffness"),
    "sigma1": ("N m s/rad", "bristle damping"),
    "Fc": ("N m", "Coulomb friction"),
    "Fs": ("N m", "stiction"),
    "Fv": ("N m s/rad", "viscous friction"),
    "vs": ("rad/s", "Stribeck velocity"),
}
NO_DECAY = (
    "With friction compensated the oscillation that the start of the prefilter excites does not "
    "decay; a table below shows the same loop over 100 s."
)
SAME_CROSSING = (
    "PID and PD are chosen for the same crossing. PID: damping ratio 0.71 and the paper's "
    "Ki/Kp. PD: Kd 5 % above sigma0 J/sigma1, where T(s) becomes SPR."
)
_BINS = 400  # a long trace is drawn by the lowest and highest value in this many bins
LINES: dict[str, dict[str, Any]] = {
    "none": {"color": MEASURED},
    "natural": {"color": "#c47f17"},
    "k 0.35": {"color": "#2f7d4f"},
    "k 5": {"color": "#2f7d4f", "ls": "--"},
    "k 20": {"color": "#2f7d4f", "ls": ":"},
    "proposed": {"color": AFTER},
    "Ki 160": {"color": BEFORE},
    "Ki 5200": {"color": BEFORE, "ls": "--"},
}


def write(r: Reproduction, folder: str | Path) -> list[Path]:
    """Write reproduce.html and reproduce.json into a folder, both or none."""
    report.check_folder(folder)
    content = dict(zip(FILES, (page(r).html(), r.to_json() + "\n"), strict=True))
    return report.written(content, Path(folder), "page")


def page(r: Reproduction) -> Page:
    """The reproduction, of which the text has about 80 columns."""
    v, pi = (r._width(loop, "paper's PI") for loop in ("velocity", "position"))
    title = "The position PI of the paper is unstable once friction is compensated"
    meaning = (
        f"Its velocity loop is confirmed ({v.hertz:.1f} Hz). "
        f"Its position loop crosses -3 dB at {pi.hertz:.1f} Hz, but its poles are "
        f"{show_poles(pi.poles)} 1/s: J s^3 + Kp s + Ki has no s^2 term for any Ki > 0. The "
        f"oscillation grows by e every {1 / pi.poles[0].real:.1f} s, too slowly to be seen in a "
        "figure of a few seconds. Which observer tracks best depends on its gains and on the "
        "scenario: every table below names both."
    )
    return Page(title, meaning, [*_parts(r)], kind="refused", tab="the paper recomputed")


def _parts(r: Reproduction) -> Iterator[Section | Figure]:
    """Paper against toolkit, Table 1, bandwidths, figures, studies, the errors in the text."""
    rows = tuple((c.paper, c.found, c.status) for c in r.claims)
    grid = Grid(("paper", "recomputed", ""), "lll", rows)
    yield Section("Paper and recomputation", (), grid, prose=(0, 2, 1))
    own = tuple((said, k, f"{getattr(r.parameters, k):g}", u) for k, (u, said) in UNITS.items())
    yield Section("Table 1", (), Grid(("parameter", "", "value", "unit"), "llrl", own))
    yield from (_widths(r, loop) for loop in ("velocity", "position"))
    for figure in r.figures:
        window = f"{figure.window[0]:g} to {figure.window[1]:g} s"
        rows = tuple((name, milli(value)) for name, value in figure.errors.items())
        lines = (figure.scenario, *([NO_DECAY] if figure.key == "position" else []))
        grid = Grid(("loop", f"RMS error {window} [m{figure.unit}]"), "lr", rows)
        yield Section(f"The paper's {figure.key} figure", lines, grid)
        caption = "Grey: reference. The dashed line (without friction) and the line with the "
        caption += "proposed observer coincide."
        yield Figure(f"paper-{figure.key}", caption, partial(responses, figure))
    for o in r.outcomes:
        yield _study(o)
        yield _drawn(o)
    slips = tuple(tuple(slip.values()) for slip in r.summary()["slips"])
    grid, title = Grid(("label", "status", "why"), "lll", slips), "Where the paper's text does not "
    yield Section(f"{title}hold as printed", (), grid, prose=(0, 1, 2))


def _widths(r: Reproduction, loop: str) -> Section:
    chosen = [w for w in r.widths if w.loop == loop]
    rows = tuple(
        (
            w.label,
            ", ".join(f"{k.capitalize()} {v:.4g}" for k, v in w.gains.items() if v),
            f"{w.hertz:.1f}",
            ("half power" if w.level == "half-power" else "-3 dB") if w.stable else "UNSTABLE",
            w.spr or NONE,
        )
        for w in chosen
    )
    lines = tuple(
        f"Unstable: {w.label}, poles {show_poles(w.poles)} 1/s. The frequency is where |T| "
        "crosses, not a bandwidth."
        for w in chosen
        if not w.stable
    )
    moves = loop == "position"
    plant = "1/(J s^2), D on the measured speed" if moves else "1/(J s)"
    foot = (
        f"Friction compensated, plant {plant}. Last column: T(s) in the condition of the existing "
        "observer, whose proof needs SPR and the feed-forward."
    )
    grid = Grid(("controller", "gains", "Hz", "level", "T(s)"), "llrll", rows)
    more = (SAME_CROSSING,) if moves else ()
    return Section(f"Bandwidth, {loop} loop", (*lines, *more), grid, foot)


def _study(o: Outcome) -> Section:
    """One study: scenario, ranking, table, meaning of the columns."""
    signals, units = ({getattr(row.measure, k) for row in o.rows} for k in ("signal", "unit"))
    alike = len({row.measure for row in o.rows}) == 1
    window = _window(o.rows[0], " to ") if alike else "the stated window"
    said = f"RMS over {window}."
    if len(units) == 1:
        said = f"RMS of {signals.pop()} over {window}, in m{units.pop()}."
        units = set()
    lines = [f"{o.study.scenario} {said}", *(_ranking(o, o.rows[i]) for i in o.study.ranked)]
    names = [c.name for c in o.study.compensations]
    rows = []
    for row in o.rows:
        of = f" {row.measure.signal} [m{row.measure.unit}]" if units else ""
        label = row.label if alike else f"{row.label},{of} {_window(row, '-')}"
        rows.append((label, *(milli(row.rms[name]) for name in names)))
    grid = Grid(("", *names), "l" + "r" * len(names), tuple(rows))
    return Section(o.study.title, (*lines, *o.study.notes), grid, _columns(o))


def _window(row: Errors, to: str) -> str:
    low, high = row.measure.window
    return f"{low:g}{to}{high:g} s"


def _columns(o: Outcome) -> str:
    said = ["k: existing observer and its gain"]
    for c in o.study.compensations[1:]:
        gains = ", ".join(f"{k[0].upper() + k[1:]} = {v:g}" for k, v in c.gains.items())
        if c.observer is None:
            said.append(f"{c.name}: no observer, PI with {gains}")
        elif c.name == c.observer and gains:
            said.append(f"{c.name}: {gains}")
    return "; ".join(said) + "."


def _ranking(o: Outcome, row: Errors) -> str:
    """The compensations of one row with their gains, best first; ties within 0.5 % are joined."""
    labels = {c.name: c.label for c in o.study.compensations}
    groups: list[tuple[float, list[str]]] = []
    for name, value in sorted(row.rms.items(), key=lambda pair: pair[1]):
        if groups and value <= max(1.005 * groups[-1][0], SMALL):
            groups[-1][1].append(name)
        else:
            groups.append((value, [name]))
    said = "; ".join(
        f"{' and '.join(labels[name] for name in labels if name in tied)} ({milli(value)})"
        for value, tied in groups
    )
    window, unit = _window(row, " to "), row.measure.unit
    return f"Best first in this scenario, {row.label}, {window}, RMS in m{unit}: {said}."


def responses(figure: PaperFigure, ax: Axes) -> Axes:
    line = figure.reference
    ax.plot(*thinned(line.t, line.y), color=QUIET, lw=4.5, label="reference")
    looks: dict[str, dict[str, Any]] = {
        "no friction": {"color": MEASURED, "ls": "--", "zorder": 3, "lw": 1.2},
        "friction, no observer": {"color": BEFORE, "lw": 1.2},
        "friction, proposed observer": {"color": AFTER, "lw": 1.8},
    }
    for trace, (name, look) in zip(figure.responses, looks.items(), strict=True):
        ax.plot(*thinned(trace.t, trace.y), **look, label=name)
    symbol = "w" if figure.unit == "rad/s" else "theta"
    ax.set(xlabel="t [s]", ylabel=f"{symbol} [{figure.unit}]", xlim=line.t[[0, -1]])
    return headed(ax, f"{figure.key.capitalize()} loop, as in the paper's figure", columns=2)


def _drawn(o: Outcome) -> Figure:
    """The figure of a study: a sweep, long envelopes, or traces."""
    drawn = o.study.drawn
    if drawn is None:
        said = "The table above as a figure, logarithmic. Names as in its columns."
        return Figure(o.study.key, said, partial(sweep, o))
    case = o.study.cases[drawn.case].label
    said = f"{drawn.signal} in the case '{case}', names as in the table."
    if o.study.loop == "position":
        said += " A straight line is growth or decay at a constant rate."
    return Figure(o.study.key, said, partial(over_time, o))


def sweep(o: Outcome, ax: Axes) -> Axes:
    """RMS error over the error of the observer's parameters, logarithmic."""
    x = np.array([row.x for row in o.rows], dtype=float)
    for c in o.study.compensations:
        mark = {} if c.observer is None else {"marker": "o", "ms": 3}
        values = [1e3 * row.rms[c.name] for row in o.rows]
        ax.plot(x, values, lw=1.5, **mark, **LINES[c.name], label=c.name)
    unit = o.rows[0].measure.unit
    ax.set(yscale="log", ylabel=f"RMS error [m{unit}]")
    ax.set_xlabel("error of the observer's parameters [%]")
    return headed(ax, o.study.title, columns=4)


def over_time(o: Outcome, ax: Axes) -> Axes:
    """The signal of one case; of a position loop the largest |e| in each second, logarithmic."""
    drawn = o.study.drawn
    assert drawn is not None
    name, unit, envelope = drawn.signal, f"m{drawn.unit}", o.study.loop == "position"
    for trace in o.traces:
        if envelope:
            t = np.arange(*drawn.span) + 0.5
            y, lw = np.maximum(peaks(trace.t, trace.y, drawn.span)[1], 1e-9), 1.5
        else:
            t, y = thinned(trace.t, np.abs(trace.y) if drawn.log else trace.y)
            lw = 1.3
        ax.plot(t, 1e3 * y, lw=lw, **LINES[trace.name], label=trace.name)
    ax.set(xlabel="t [s]", ylabel=f"{name} [{unit}]", xlim=drawn.span)
    if drawn.log or envelope:
        ax.set(yscale="log", ylabel=f"|{name}| [{unit}]")
        ax.set_ylim(bottom=1e-3)
    if envelope:
        ax.set_ylabel(f"largest |e| in a second [{unit}]")
    case = o.study.cases[drawn.case].label
    return headed(ax, f"{o.study.title}: {case}", columns=4)


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
