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
    """ "low to high", with the digits that the width knows; where both ends are one number in all
    digits that are shown, "low +- <unit of the last digit"."""
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


def to_interval(value: float, width: float, digits: int) -> str:
    """A value in so many digits, or fewer where an interval of this width knows fewer."""
    if not value or not 0.0 < width < math.inf:
        return number(value, digits)
    known = math.ceil(math.log10(PLACES * abs(value) / width))
    return number(value, min(max(known, 1), digits))


@dataclass(frozen=True)
class Grid:
    """A table; ``align`` holds one letter, l or r, for each column."""

    head: tuple[str, ...]
    align: str
    rows: tuple[tuple[str, ...], ...]


def grid_text(grid: Grid) -> list[str]:
    """The lines of a table, its columns aligned."""
    table = [grid.head, *grid.rows]
    widths = [max(len(row[i]) for row in table) for i in range(len(grid.head))]

    def line(row: tuple[str, ...]) -> str:
        cells = [
            cell.ljust(w) if side == "l" else cell.rjust(w)
            for cell, w, side in zip(row, widths, grid.align, strict=True)
        ]
        return ("  " + "  ".join(cells)).rstrip()

    return [line(row) for row in table]


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
    """Base of what shows itself: ``repr`` in a few lines, an HTML table in Jupyter.

    By default the rows are the fields of a dataclass; ``_units`` gives the units of some. Arrays
    are shown by size and range, never in full.
    """

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
        return "\n".join([_one_line(self._title()), *(_lines(row, wide) for row in rows)])

    def _repr_html_(self) -> str:
        rows = "\n".join(map(_html_row, self._rows()))
        title = html.escape(self._title())
        if not rows:
            return f"<div>{title}</div>"
        return f"<div><strong>{title}</strong>\n<table><tbody>\n{rows}\n</tbody></table></div>"


def _lines(row: Row, wide: int) -> str:
    start = f"  {row.name.ljust(wide)}  "
    return textwrap.fill(
        row.text() or NONE,
        WIDTH,
        initial_indent=start,
        subsequent_indent=" " * len(start),
        break_long_words=False,
        break_on_hyphens=False,
    )


def _html_row(row: Row) -> str:
    left = "text-align: left; vertical-align: top"  # Jupyter's own is to the right
    name, said = html.escape(row.name), html.escape(row.text() or NONE)
    first = f'<td style="{left}; white-space: nowrap">{name}</td>'
    return f'<tr>{first}<td style="{left}">{said}</td></tr>'


def brief(value: Any) -> str:
    """Any value in a few words."""
    if value is None:
        return NONE
    if isinstance(value, Shown):
        return value._title()
    if isinstance(value, np.ndarray):
        return _array(value)
    if isinstance(value, (float, np.floating)):
        return f"{value:.6g}"
    if isinstance(value, complex):
        return f"{value:.4g}"
    if isinstance(value, Mapping):
        return _several([f"{k} {brief(v)}" for k, v in value.items()], "; ")
    if isinstance(value, (tuple, list)):
        return _several([brief(v) for v in value])
    if isinstance(value, str):
        return _one_line(value)
    said = repr(value)
    return said if len(said) <= WIDTH and "\n" not in said else type(value).__name__


def _one_line(text: str) -> str:
    return " ".join(text.split())


def _several(said: list[str], between: str = ", ") -> str:
    more = f" and {len(said) - _MOST} more" if len(said) > _MOST else ""
    return between.join(said[:_MOST]) + more or "none"


def _array(values: np.ndarray) -> str:
    size = " x ".join(map(str, values.shape)) if values.ndim > 1 else str(values.size)
    if values.dtype == bool:
        return f"{int(values.sum())} of {size}"
    numbers = values[np.isfinite(values)] if values.dtype.kind in "iuf" else values[:0]
    if not numbers.size:
        return f"{size} values"
    return f"{size} values, {numbers.min():.6g} to {numbers.max():.6g}"
