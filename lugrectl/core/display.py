"""How objects show themselves: a title and rows of name, value and unit, as text and as HTML."""

from __future__ import annotations

import html
import math
import textwrap
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, fields
from decimal import Decimal
from typing import Any, ClassVar, NamedTuple

import numpy as np

NONE = "-"
HELD = "held"  # stands where an interval would
WIDTH = 88  # columns of a text
PLACES = 5  # places of a value within its interval, at least: more digits say nothing
_MOST = 6  # entries of a list that are shown
_SENTENCES = 4  # in what a result prints of itself


def number(value: Any, digits: int = 4) -> str:
    """A number in so many digits, whole ones in full; '-' for None, NaN and infinity."""
    if value is None or not math.isfinite(value):
        return NONE
    if 10 ** (digits - 1) <= abs(value) < 1e6:
        return f"{value:.0f}"
    return f"{value:#.{digits}g}".rstrip(".")


def with_interval(estimate: Any) -> tuple[str, str]:
    """Value and 95 % interval ("low to high"), with the digits that the interval knows."""
    value, interval = estimate.value, estimate.ci95
    if getattr(estimate, "held", False):
        return f"{value:.5g}", HELD
    if getattr(estimate, "together", ""):
        return f"{value:.4g}", f"only {estimate.together}"
    if interval is None or not all(math.isfinite(x) for x in interval):
        return (f"{value:.5g}" if math.isfinite(value) else NONE), NONE
    text = _to_width(value, interval[1] - interval[0])
    if value > 0 and not float(text) and interval[0] >= 0:  # a level is not 0 for being uncertain
        text = number(value, 1)
    return text, between(interval)


def between(interval: Sequence[float]) -> str:
    """ "low to high" in the digits that the width knows; one number as "low +- <last digit"."""
    low, high = (_to_width(x, interval[1] - interval[0]) for x in interval)
    if low != high:
        return f"{low} to {high}"
    last = Decimal(low).as_tuple().exponent
    return f"{low} +- <{Decimal(10) ** int(last):g}"


def _to_width(value: float, width: float) -> str:
    """A value with the fewest decimals whose last place is at most a fifth of an interval."""
    decimals = -math.floor(math.log10(width / PLACES)) if width > 0 else 99
    if decimals < 0:
        value = round(value, decimals)
    if decimals <= 7 and abs(value) < 1e7:
        return f"{round(value, max(decimals, 0)) + 0.0:.{max(decimals, 0)}f}"  # no -0.0
    ratio = abs(value) / (width / PLACES) if width > 0 else 1e4
    return number(value, min(max(1 + math.ceil(math.log10(ratio)), 3), 8) if ratio > 0 else 3)


def show_poles(poles: Sequence[complex]) -> str:
    """Poles in 1/s in one line, a complex pair once."""
    one_each = [p for p in poles if p.imag >= 0]
    return ", ".join(
        f"{p.real:+.4g} +- {p.imag:.4g}j" if p.imag else f"{p.real:+.4g}" for p in one_each
    )


@dataclass(frozen=True)
class Grid:
    """A table; ``align`` holds one letter, l or r, for each column."""

    head: tuple[str, ...]
    align: str
    rows: tuple[tuple[str, ...], ...]


def grid_text(grid: Grid) -> list[str]:
    """The lines of a table, its columns aligned."""
    columns = []
    for side, cells in zip(grid.align, zip(grid.head, *grid.rows, strict=True), strict=True):
        wide = max(map(len, cells))
        columns.append([c.ljust(wide) if side == "l" else c.rjust(wide) for c in cells])
    return [("  " + "  ".join(row)).rstrip() for row in zip(*columns, strict=True)]


def grid_html(grid: Grid) -> str:
    """The table as HTML, every cell escaped."""

    def row(cells: tuple[str, ...], tag: str) -> str:
        made = [
            f'<{tag} class="{side}">{html.escape(cell)}</{tag}>'
            for cell, side in zip(cells, grid.align, strict=True)
        ]
        return "<tr>" + "".join(made) + "</tr>"

    rows = "\n".join(row(cells, "td") for cells in grid.rows)
    head = row(grid.head, "th")
    body = f"<thead>{head}</thead>\n<tbody>\n{rows}\n</tbody>"
    return f'<div class="table"><table>\n{body}\n</table></div>'


class Row(NamedTuple):
    """One line of what an object shows: a value with its unit, and what there is to say of it."""

    name: str
    value: Any
    unit: str = ""
    note: str = ""

    def text(self) -> str:
        """Everything behind the name."""
        return " ".join(filter(None, (brief(self.value), self.unit, self.note)))


def estimated(name: str, estimate: Any) -> Row:
    """The row of a fitted value, with its 95 % interval where it has one."""
    value, interval = with_interval(estimate)
    unit = "" if estimate.unit == "1" else estimate.unit
    return Row(name, value, unit, "" if interval == NONE else f"({interval})")


def noticed(said: Sequence[str], where: str) -> list[Row]:
    """Rows of the first sentences, and ``where`` the others are."""
    more = [Row("more", f"in .{where}")] if len(said) > _SENTENCES else []
    return [*(Row("message", one) for one in said[:_SENTENCES]), *more]


class Shown:
    """Base of what shows itself: ``repr`` in a few lines, an HTML table in Jupyter. By default the
    rows are the fields of a dataclass; ``_units`` gives the units of some."""

    _units: ClassVar[Mapping[str, str]] = {}

    def _title(self) -> str:
        return type(self).__name__

    def _rows(self) -> Iterable[Row]:
        units = self._units
        return [
            Row(f.name, getattr(self, f.name), units.get(f.name, ""))
            for f in fields(self)  # type: ignore[arg-type]
            if f.repr
        ]

    def __repr__(self) -> str:
        rows = list(self._rows())
        wide = max((len(row.name) for row in rows), default=0)
        lines = [" ".join(self._title().split())]
        for row in rows:
            start = f"  {row.name.ljust(wide)}  "
            indents: Any = {"initial_indent": start, "subsequent_indent": " " * len(start)}
            whole: Any = {"break_long_words": False, "break_on_hyphens": False}
            lines.append(textwrap.fill(row.text() or NONE, WIDTH, **indents, **whole))
        return "\n".join(lines)

    def _repr_html_(self) -> str:
        left = "text-align: left; vertical-align: top"  # Jupyter's own is to the right
        rows = "\n".join(
            f'<tr><td style="{left}; white-space: nowrap">{html.escape(row.name)}</td>'
            f'<td style="{left}">{html.escape(row.text() or NONE)}</td></tr>'
            for row in self._rows()
        )
        table = f"<table><tbody>\n{rows}\n</tbody></table>" if rows else ""
        return f"<div><strong>{html.escape(self._title())}</strong>\n{table}</div>"


def brief(value: Any) -> str:
    """Any value in a few words."""
    if value is None:
        return NONE
    if isinstance(value, Shown):
        return value._title()
    if isinstance(value, np.ndarray):
        size = " x ".join(map(str, value.shape)) if value.ndim > 1 else str(value.size)
        if value.dtype == bool:
            return f"{int(value.sum())} of {size}"
        finite = value[np.isfinite(value)] if value.dtype.kind in "iuf" else value[:0]
        span = f", {finite.min():.6g} to {finite.max():.6g}" if finite.size else ""
        return f"{size} values{span}"
    if isinstance(value, (float, np.floating)):
        return f"{value:.6g}"
    if isinstance(value, complex):
        return f"{value:.4g}"
    if isinstance(value, (Mapping, tuple, list)):
        named = isinstance(value, Mapping)
        said = [f"{k} {brief(v)}" for k, v in value.items()] if named else list(map(brief, value))
        more = f" and {len(said) - _MOST} more" if len(said) > _MOST else ""
        return ("; " if named else ", ").join(said[:_MOST]) + more or "none"
    if isinstance(value, str):
        return " ".join(value.split())
    said = repr(value)
    return said if len(said) <= WIDTH and "\n" not in said else type(value).__name__
