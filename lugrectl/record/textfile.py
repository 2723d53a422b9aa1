"""Text tables: finds delimiter, header, units and decimal commas; reports a bad cell by place."""

from __future__ import annotations

import csv
import re
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..errors import InputError
from .units import parse_unit

_SNIFF = 400  # lines read to find the delimiter, the header and the first row
_MISSING = {"", "nan", "na", "n/a", "null", "none", "-"}
_DECIMAL_COMMAS = "Decimal commas were read as decimal points."


@dataclass(frozen=True)
class Table:
    """Named columns of a file, read only on request.

    ``load(indices)`` returns the float64 columns of these indices and notes on how they were
    read; ``where(row)`` describes the place of a row in the file.
    """

    source: str
    names: tuple[str, ...]
    units: tuple[str | None, ...]
    load: Callable[[Sequence[int]], tuple[list[np.ndarray], list[str]]]
    where: Callable[[int], str]


@dataclass(frozen=True)
class _Layout:
    delimiter: str
    width: int
    first: int  # index of the first row of numbers
    names: tuple[str, ...]
    units: tuple[str | None, ...]


def split_unit(header: str) -> tuple[str, str | None]:
    """Split 'name [unit]' or 'name (unit)' into name and unit (None if there is none)."""
    match = re.fullmatch(r"(.*?)\s*(?:\[([^\[\]]*)\]|\(([^()]*)\))", header.strip())
    if match is None:
        return header.strip(), None
    return match[1], (match[2] or match[3] or "").strip() or None


def read_text(path: Path) -> Table:
    lines = _decode(path)
    layout = _layout(path.name, lines)

    def load(indices: Sequence[int]) -> tuple[list[np.ndarray], list[str]]:
        fast = _load_fast(lines, layout, indices)
        return fast or _load_slow(path.name, lines, layout, indices)

    return Table(
        path.name,
        layout.names,
        layout.units,
        load,
        lambda row: _where(lines, layout.first, row),
    )


def _decode(path: Path) -> list[str]:
    data = path.read_bytes()
    if data.startswith((b"\xff\xfe", b"\xfe\xff")):
        text = data.decode("utf-16", errors="replace")
    elif b"\0" in data:
        raise InputError(f"{path.name} is neither text nor a MAT, NPZ or Parquet file.")
    else:
        try:
            text = data.decode("utf-8-sig")
        except UnicodeDecodeError:
            text = data.decode("latin-1")
    return text.replace("\r\n", "\n").replace("\r", "\n").split("\n")


def _cells(line: str, delimiter: str) -> list[str]:
    if '"' not in line:
        return [cell.strip() for cell in line.split(delimiter)] if line else []
    try:
        return [cell.strip() for cell in next(csv.reader([line], delimiter=delimiter), [])]
    except csv.Error:
        return []


def _is_comment(line: str) -> bool:
    return not line.strip() or line.lstrip().startswith("#")


def _number(cell: str) -> float:
    """Return the number in a cell, nan for a missing one; raise ValueError for text."""
    cell = cell.strip()
    if cell.lower() in _MISSING:
        return np.nan
    if "_" in cell:
        raise ValueError(cell)
    if "," in cell and "." not in cell:
        cell = cell.replace(",", ".")
    return float(cell)


def _is_number(cell: str) -> bool:
    try:
        return not np.isnan(_number(cell))
    except ValueError:
        return False


def _layout(source: str, lines: list[str]) -> _Layout:
    sniffed = [(i, line) for i, line in enumerate(lines[:_SNIFF]) if not _is_comment(line)]
    if not sniffed:
        raise InputError(f"{source} is empty: it has no line of data.")
    delimiter, width, tail = _delimiter(source, sniffed)
    numeric = [2 * sum(_is_number(row[c]) for row in tail) > len(tail) for c in range(width)]
    rows = [(i, _cells(line, delimiter)) for i, line in sniffed]
    likes = [_like_data(cells, numeric) for _, cells in rows]
    start = next(
        (k for k in range(len(rows)) if likes[k] and np.mean(likes[k : k + 6]) > 0.6),
        -1,
    )
    if start < 0:
        raise InputError(f"{source} has no row of numbers in its first {_SNIFF} lines.")
    heads = _headers(source, lines, rows, start, delimiter)
    names, units = _name_columns(heads[0], heads[1])
    if len(names) == width - 1 and not any(row[-1] for row in tail):
        names, units = (*names, ""), (*units, None)
    if len(names) != width:
        hint = (
            "if these are decimal commas, separate the columns by semicolons"
            if delimiter == "," and width > len(names)
            else "name every column once"
        )
        raise InputError(
            f"{source}: line {rows[start][0] + 1} has {width} cells but the header names "
            f"{len(names)}; {hint}."
        )
    return _Layout(delimiter, width, rows[start][0], names, units)


def _delimiter(source: str, sniffed: list[tuple[int, str]]) -> tuple[str, int, list[list[str]]]:
    """Return the delimiter, the usual number of cells, and the last rows of that many."""
    tail = [line for _, line in sniffed[-max(3, len(sniffed) // 4) :]]
    for delimiter in "\t;,":
        rows = [_cells(line, delimiter) for line in tail]
        width = Counter(map(len, rows)).most_common(1)[0][0]
        if width >= 2:
            return delimiter, width, [row for row in rows if len(row) == width]
    if any(_is_number(_cells(line, ";")[0]) for line in tail if _cells(line, ";")):
        raise InputError(
            f"{source} has one column; a record needs u and one of w, theta "
            "in columns separated by comma, semicolon or tab."
        )
    raise InputError(f"{source} is not a table: no columns of numbers were found in it.")


def _like_data(cells: list[str], numeric: list[bool]) -> bool:
    if len(cells) != len(numeric) or not any(map(_is_number, cells)):
        return False
    wrong = sum(n and not _is_number(c) and c != "" for c, n in zip(cells, numeric, strict=True))
    return wrong <= max(1, len(cells) // 4)


def _headers(
    source: str,
    lines: list[str],
    rows: list[tuple[int, list[str]]],
    start: int,
    delimiter: str,
) -> tuple[list[str], list[str] | None]:
    """Return the cells of the header and of the line of units under it, if there is one."""
    first = rows[start][0]
    if start == 0:
        remarks = [line.lstrip(" \t#") for line in lines[:first] if line.strip()]
        cells = _cells(remarks[-1], delimiter) if remarks else []
        if len(cells) < 2 or len(cells) != len(rows[0][1]):
            raise InputError(
                f"{source} has no header: write the names of the columns, for instance "
                f"t{delimiter}u{delimiter}theta, above the numbers of line {first + 1}."
            )
        return cells, None
    last = rows[start - 1][1]
    known = [parse_unit(cell.strip("[]()")) for cell in last if cell]
    if start > 1 and any(known) and len(rows[start - 2][1]) == len(last):
        return rows[start - 2][1], last
    return last, None


def _name_columns(
    heads: list[str], unit_line: list[str] | None
) -> tuple[tuple[str, ...], tuple[str | None, ...]]:
    pairs = [split_unit(head) for head in heads]
    if unit_line is not None:
        below = [cell.strip("[]() ") or None for cell in unit_line]
        pairs = [(name, unit or b) for (name, unit), b in zip(pairs, below, strict=True)]
    while pairs and pairs[-1] == ("", None):
        pairs.pop()
    if not pairs:
        return (), ()
    name, unit = pairs[0]
    known = parse_unit(unit) if unit else None
    if not name and known is not None and known.quantity == "time":
        pairs[0] = ("time", unit)  # some recorders leave the first name empty
    names, units = zip(*pairs, strict=True)
    return names, units


def _load_fast(
    lines: list[str], layout: _Layout, indices: Sequence[int]
) -> tuple[list[np.ndarray], list[str]] | None:
    """Read the columns at C speed; None if cells must be read one by one."""
    text, said = "\n".join(lines[layout.first :]), []
    if "#" in text:
        text = "\n".join(line for line in lines[layout.first :] if not _is_comment(line))
    text = text.replace('"', "")  # a delimiter between quotes shows in the count below
    if layout.delimiter != "," and "," in text:
        if "." in text:
            return None
        text, said = text.replace(",", "."), [_DECIMAL_COMMAS]
    data = _parsed(text.split("\n"), layout, indices)
    if data is None:  # perhaps only because of empty cells
        gap = re.escape(layout.delimiter)
        text = re.sub(rf"(?<={gap})(?={gap}|$)|^(?={gap})", "nan", text, flags=re.MULTILINE)
        data = _parsed(text.split("\n"), layout, indices)
    if data is None or text.count(layout.delimiter) != len(data) * (layout.width - 1):
        return None
    return list(np.ascontiguousarray(data.T)), said


def _parsed(body: list[str], layout: _Layout, indices: Sequence[int]) -> np.ndarray | None:
    try:
        return np.loadtxt(body, delimiter=layout.delimiter, usecols=indices, comments=None, ndmin=2)
    except ValueError:
        return None


def _load_slow(
    source: str, lines: list[str], layout: _Layout, indices: Sequence[int]
) -> tuple[list[np.ndarray], list[str]]:
    """Read cell by cell: an empty cell is a missing sample, other text raises InputError."""
    said: list[str] = []
    rows: list[list[float]] = []
    points = commas = False
    body = lines[layout.first :]
    last = max(k for k, line in enumerate(body) if not _is_comment(line))
    for k, line in enumerate(body[: last + 1]):
        if _is_comment(line):
            continue
        number = layout.first + k + 1
        cells = _cells(line, layout.delimiter)
        if len(cells) < layout.width and k == last and rows:
            said.append(f"The last line ({number}) is cut off and was left out.")
            continue
        if len(cells) != layout.width:
            raise InputError(
                f"{source}: line {number} has {len(cells)} cells, "
                f"the header names {layout.width} columns."
            )
        used = [cells[i] for i in indices]
        rows.append(_row(source, number, used, [layout.names[i] for i in indices]))
        points = points or any("." in cell for cell in used)
        commas = commas or any("," in cell for cell in used)
        if points and commas:
            raise InputError(
                f"{source}: line {number} mixes decimal points and decimal commas; use one."
            )
    if commas:
        said.insert(0, _DECIMAL_COMMAS)
    return list(np.array(rows, dtype=np.float64).T), said


def _row(source: str, number: int, cells: list[str], names: list[str]) -> list[float]:
    try:
        if not any("_" in cell for cell in cells):
            return [float(cell) for cell in cells]
    except ValueError:
        pass
    values = []
    for cell, name in zip(cells, names, strict=True):
        try:
            values.append(_number(cell))
        except ValueError:
            raise InputError(
                f"{source}: line {number}, column '{name}': '{cell}' is not a number."
            ) from None
    return values


def _where(lines: list[str], first: int, row: int) -> str:
    """Return 'line n' for the row-th row of numbers (from 0)."""
    count = -1
    for number, line in enumerate(lines[first:], start=first + 1):
        count += not _is_comment(line)
        if count == row:
            return f"line {number}"
    return f"row {row + 1}"
