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
from .runs import Outcome, PaperFigure, Reproduction, milli, peaks

if TYPE_CHECKING:
    from matplotlib.axes import Axes

FILES: tuple[str, ...] = ("reproduce.html", "reproduce.json")
WIDTHS = (
    "Friction compensated; plant 1/(J s), or 1/(J s^2) with D on the measured speed. Of a loop "
    "that is not stable the frequency is where |T| crosses, not a bandwidth. Last column: T(s) in "
    "the condition of the existing observer, whose proof needs SPR and the feed-forward. PID and "
    "PD are chosen for the same crossing: damping ratio 0.71 and the paper's Ki/Kp; Kd 5 % above "
    "sigma0 J/sigma1, where T(s) becomes SPR."
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
    "no friction": {"color": MEASURED, "ls": "--", "zorder": 3},
    "friction, no observer": {"color": BEFORE},
    "friction, proposed observer": {"color": AFTER, "lw": 1.8},
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
    """Paper against toolkit, bandwidths, figures, studies, the errors in the text."""
    rows = tuple((c.paper, c.found, c.status) for c in r.claims)
    grid = Grid(("paper", "recomputed", ""), "lll", rows)
    yield Section("Paper and recomputation", (), grid, prose=(0, 2, 1))
    for loop, said in (("velocity", ""), ("position", WIDTHS)):
        rows = tuple(
            (
                w.label,
                ", ".join(f"{k.capitalize()} {v:.4g}" for k, v in w.gains.items() if v),
                f"{w.hertz:.1f}",
                w.level if w.stable else "UNSTABLE",
                w.spr or NONE,
            )
            for w in r.widths
            if w.loop == loop
        )
        grid = Grid(("controller", "gains", "Hz", "level", "T(s)"), "llrll", rows)
        yield Section(f"Bandwidth, {loop} loop", (), grid, said)
    for figure in r.figures:
        window = f"{figure.window[0]:g} to {figure.window[1]:g} s"
        rows = tuple((name, milli(value)) for name, value in figure.errors.items())
        grid = Grid(("loop", f"RMS error {window} [m{figure.unit}]"), "lr", rows)
        yield Section(f"The paper's {figure.key} figure", (figure.scenario,), grid)
        caption = "Grey: reference. The lines without friction and with the observer coincide."
        yield Figure(f"paper-{figure.key}", caption, partial(responses, figure))
    for o in r.outcomes:
        yield _study(o)
        case = f" In the case '{o.study.cases[o.study.drawn.case].label}'." if o.study.drawn else ""
        draw = partial(over_time if o.study.drawn else sweep, o)
        yield Figure(o.study.key, f"Names as in the table.{case}", draw)
    slips = tuple(tuple(slip.values()) for slip in r.summary()["slips"])
    grid, title = Grid(("label", "status", "why"), "lll", slips), "Where the paper's text does not "
    yield Section(f"{title}hold as printed", (), grid, prose=(0, 1, 2))


def _study(o: Outcome) -> Section:
    """One study: scenario, table, what its columns are."""
    measures = [row.measure for row in o.rows]
    windows, signals = {m.window for m in measures}, {m.signal for m in measures}
    units = " and ".join(sorted({f"{m.signal} in m{m.unit}" for m in measures}))
    names, rows = [c.name for c in o.study.compensations], []
    for row, m in zip(o.rows, measures, strict=True):
        window = f"{m.window[0]:g}-{m.window[1]:g} s"
        more = [*[m.signal] * (len(signals) > 1), *[window] * (len(windows) > 1)]
        rows.append((", ".join([row.label, *more]), *(milli(row.rms[name]) for name in names)))
    only = f" over {measures[0].window[0]:g} to {measures[0].window[1]:g} s"
    lines = (f"{o.study.scenario} RMS of {units}{only * (len(windows) == 1)}.", *o.study.notes)
    columns = "; ".join(f"{c.name}: {c.label}" for c in o.study.compensations)
    grid = Grid(("", *names), "l" + "r" * len(names), tuple(rows))
    return Section(o.study.title, lines, grid, f"{columns}.")


def _lines(ax: Axes, name: str, t: Any, y: Any, **more: Any) -> None:
    look: dict[str, Any] = {"lw": 1.4} | LINES[name.partition(", K1")[0]] | more
    ax.plot(t, y, **look, label=name)


def responses(figure: PaperFigure, ax: Axes) -> Axes:
    line = figure.reference
    ax.plot(*thinned(line.t, line.y), color=QUIET, lw=4.5, label="reference")
    for trace in figure.responses:
        _lines(ax, trace.name, *thinned(trace.t, trace.y))
    symbol = "w" if figure.unit == "rad/s" else "theta"
    ax.set(xlabel="t [s]", ylabel=f"{symbol} [{figure.unit}]", xlim=line.t[[0, -1]])
    return headed(ax, f"{figure.key.capitalize()} loop, as in the paper's figure", columns=2)


def sweep(o: Outcome, ax: Axes) -> Axes:
    """RMS error over the error of the observer's parameters, logarithmic."""
    x = np.array([row.x for row in o.rows], dtype=float)
    for c in o.study.compensations:
        _lines(ax, c.name, x, [1e3 * row.rms[c.name] for row in o.rows], marker="o", ms=3)
    ax.set(yscale="log", ylabel=f"RMS error [m{o.rows[0].measure.unit}]")
    ax.set_xlabel("error of the observer's parameters [%]")
    return headed(ax, o.study.title, columns=4)


def over_time(o: Outcome, ax: Axes) -> Axes:
    """The signal of one case; of a position loop the largest |e| in each second, logarithmic."""
    drawn = o.study.drawn
    assert drawn is not None
    of, envelope = drawn.signal, o.study.loop == "position"
    for trace in o.traces:
        t, y = thinned(trace.t, np.abs(trace.y) if drawn.log else trace.y)
        if envelope:
            t, y = np.arange(*drawn.span) + 0.5, np.array(peaks(trace.t, trace.y, drawn.span)[1])
        _lines(ax, trace.name, t, 1e3 * (np.maximum(y, 1e-9) if drawn.log or envelope else y))
    if drawn.log or envelope:
        ax.set(yscale="log", ylim=(1e-3, None))
        of = "largest |e| in a second" if envelope else f"|{of}|"
    ax.set(xlabel="t [s]", ylabel=f"{of} [m{drawn.unit}]", xlim=drawn.span)
    return headed(ax, f"{o.study.title}: {o.study.cases[drawn.case].label}", columns=4)


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
