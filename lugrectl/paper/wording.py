"""The reproduction in words and tables: shared by text, page and JSON."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

from ..linear.verdict import show_poles
from ..report.wording import NONE, Grid, Section
from .bench import Outcome, Row
from .results import SMALL, PaperFigure, Reproduction, milli, slips, width_of

UNITS = {
    "J": ("kg m2", "total inertia"),
    "sigma0": ("N m/rad", "bristle stiffness"),
    "sigma1": ("N m s/rad", "bristle damping"),
    "Fc": ("N m", "Coulomb friction"),
    "Fs": ("N m", "stiction"),
    "Fv": ("N m s/rad", "viscous friction"),
    "vs": ("rad/s", "Stribeck velocity"),
}


def headline(r: Reproduction) -> tuple[str, str]:
    """The title of the page and its first paragraph."""
    v, pi = (width_of(r, loop, "paper's PI") for loop in ("velocity", "position"))
    return "The position PI of the paper is unstable once friction is compensated", (
        f"Its velocity loop is confirmed ({v.hertz:.1f} Hz). "
        f"Its position loop crosses -3 dB at {pi.hertz:.1f} Hz, but its poles are "
        f"{show_poles(pi.poles)} 1/s: J s^3 + Kp s + Ki has no s^2 term for any Ki > 0. The "
        f"oscillation grows by e every {1 / pi.poles[0].real:.1f} s, too slowly to be seen in a "
        "figure of a few seconds. Which observer tracks best depends on its gains and on the "
        "scenario: every table below names both."
    )


def opening(r: Reproduction) -> list[Section]:
    """Paper against toolkit, Table 1, bandwidths."""
    rows = tuple((c.paper, c.found, c.status) for c in r.claims)
    compared = Section(
        "Paper and recomputation", (), Grid(("paper", "recomputed", ""), "lll", rows)
    )
    return [compared, _table1(r), _widths(r, "velocity"), _widths(r, "position")]


def _table1(r: Reproduction) -> Section:
    rows = tuple(
        (UNITS[f.name][1], f.name, f"{getattr(r.parameters, f.name):g}", UNITS[f.name][0])
        for f in fields(r.parameters)
    )
    return Section("Table 1", (), Grid(("parameter", "", "value", "unit"), "llrl", rows))


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
    plant = "1/(J s)"
    if loop == "position":
        plant = "1/(J s^2), D on the measured speed"
        lines += (
            "PID and PD are chosen for the same crossing. PID: damping ratio 0.71 and the paper's "
            "Ki/Kp. PD: Kd 5 % above sigma0 J/sigma1, where T(s) becomes SPR.",
        )
    foot = (
        f"Friction compensated, plant {plant}. Last column: T(s) in the condition of the existing "
        "observer, whose proof needs SPR and the feed-forward."
    )
    grid = Grid(("controller", "gains", "Hz", "level", "T(s)"), "llrll", rows)
    return Section(f"Bandwidth, {loop} loop", lines, grid, foot)


def figure_section(figure: PaperFigure) -> Section:
    """One figure of the paper: scenario and errors."""
    unit = f"m{figure.unit}"
    window = f"{figure.window[0]:g} to {figure.window[1]:g} s"
    rows = tuple((name, milli(value)) for name, value in figure.errors.items())
    lines = (figure.scenario,)
    if figure.key == "position":
        lines += (
            "With friction compensated the oscillation that the start of the prefilter excites "
            "does not decay; a table below shows the same loop over 100 s.",
        )
    grid = Grid(("loop", f"RMS error {window} [{unit}]"), "lr", rows)
    return Section(f"The paper's {figure.key} figure", lines, grid)


def study_section(o: Outcome) -> Section:
    """One study: scenario, ranking, table, meaning of the columns."""
    said = _said(o)
    lines = [f"{o.study.scenario} {said}", *(_ranking(o, i) for i in o.study.ranked)]
    head = ("", *(c.short for c in o.study.compensations))
    rows = tuple((_label(o, row), *(milli(v) for v in row.rms)) for row in o.rows)
    grid = Grid(head, "l" + "r" * len(o.study.compensations), rows)
    return Section(o.study.title, (*lines, *o.study.notes), grid, _columns(o))


def _columns(o: Outcome) -> str:
    """The meaning of the columns, with every gain."""
    said = ["k: existing observer and its gain"]
    for c in o.study.compensations[1:]:
        gains = ", ".join(f"{k[0].upper() + k[1:]} = {v:g}" for k, v in c.gains.items())
        if c.observer is None:
            said.append(f"{c.short}: no observer, PI with {gains}")
        elif c.short == c.observer and gains:
            said.append(f"{c.short}: {gains}")
    return "; ".join(said) + "."


def _alike(o: Outcome) -> bool:
    return len({row.measure for row in o.rows}) == 1


def _said(o: Outcome) -> str:
    m = o.rows[0].measure
    if _alike(o):
        return f"RMS of {m.signal} over {m.window[0]:g} to {m.window[1]:g} s, in m{m.unit}."
    units = {row.measure.unit for row in o.rows}
    if len(units) == 1:
        return f"RMS of {m.signal} over the stated window, in m{m.unit}."
    return "RMS over the stated window."


def _label(o: Outcome, row: Row) -> str:
    if _alike(o):
        return row.label
    m = row.measure
    window = f"{m.window[0]:g}-{m.window[1]:g} s"
    units = {r.measure.unit for r in o.rows}
    what = f" {m.signal} [m{m.unit}]" if len(units) > 1 else ""
    return f"{row.label},{what} {window}"


def _ranking(o: Outcome, index: int) -> str:
    """The compensations of one row with their gains, best first; ties within 0.5 % are joined."""
    row, m = o.rows[index], o.rows[index].measure
    order = sorted(zip(row.rms, o.study.compensations, strict=True), key=lambda pair: pair[0])
    groups: list[list[Any]] = []
    for value, c in order:
        if groups and value <= max(1.005 * groups[-1][0], SMALL):
            groups[-1][1].append(c)
        else:
            groups.append([value, [c]])
    said = "; ".join(
        f"{' and '.join(c.label for c in o.study.compensations if c in tied)} ({milli(value)})"
        for value, tied in groups
    )
    window = f"{m.window[0]:g} to {m.window[1]:g} s"
    return f"Best first in this scenario, {row.label}, {window}, RMS in m{m.unit}: {said}."


def closing() -> list[Section]:
    """The errors in the paper's text."""
    rows = tuple(tuple(s.values()) for s in slips())
    grid = Grid(("label", "status", "why"), "lll", rows)
    return [Section("Where the paper's text does not hold as printed", (), grid)]
