"""Text tables: finds delimiter, header, units and decimal commas; reports a bad cell by place."""

from __future__ import annotations

import csv
import re
from bisect import bisect_right
from collections import Counter
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from datetime import date
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from ...core.errors import InputError
from ..columns.column_names import split_unit
from ..columns.table import (
    Columns,
    Table,
    epoch_said,
    epoch_unit,
    heads,
    joined_stamps,
    time_columns,
)
from ..columns.units import parse_unit

# ---- dates and times of day ------------------------------------------------------

_DATE = r"(?P<date>\d{4}[-/.]\d{1,2}[-/.]\d{1,2}|\d{1,2}[-/.]\d{1,2}[-/.]\d{4})"
_CLOCK = r"(?P<clock>\d{1,2}:\d{2}:\d{2}(?:[.,:]\d{1,9})?)\s*(?P<half>[AaPp][Mm])?"
_ZONE = r"(?P<zone>Z|UTC|\s?[+-]\d{2}:?\d{2})?"
_STAMP = re.compile(rf"(?:{_DATE}[T ,_]\s*)?{_CLOCK}{_ZONE}", re.ASCII)
_DAY = 86400.0


def is_stamp(cell: str) -> bool:
    """Whether a cell holds a time of day, 23:59:59.9, with or without a date before it."""
    return ":" in cell and _STAMP.fullmatch(cell.strip()) is not None


def seconds(cells: Sequence[str]) -> np.ndarray:
    """Seconds (N,) from the first stamp, nan for an empty cell; ValueError with the index of
    the first cell that is no stamp. A time of day that falls by half a day passed midnight."""
    days: dict[str, float] = {}
    made = np.full(len(cells), np.nan)
    for k, cell in enumerate(cells):
        match = _STAMP.fullmatch(cell.strip())
        if match is None:
            if cell.strip().lower() in ("", "nan", "nat"):
                continue
            raise ValueError(k)
        hour, minute, rest = match["clock"].split(":", 2)
        if match["half"]:
            hour = int(hour) % 12 + 12 * (match["half"].lower() == "pm")
        made[k] = 3600 * int(hour) + 60 * int(minute) + float(re.sub("[,:]", ".", rest))
        if match["date"]:
            if match["date"] not in days:
                days[match["date"]] = _day(match["date"], list(days))
            made[k] += _DAY * days[match["date"]]
    known = np.flatnonzero(np.isfinite(made))
    if not days and known.size:
        made[known] += _DAY * np.r_[0, np.cumsum(np.diff(made[known]) < -_DAY / 2)]
    return made - (made[known[0]] if known.size else 0.0)


def _day(text: str, before: Sequence[str]) -> float:
    """The number of a day from the first date on; a date of unclear order is the next day."""
    dates = [[int(part) for part in re.split("[-/.]", day)] for day in (text, *before[:1])]
    for y, m, d in ((0, 1, 2), (2, 1, 0), (2, 0, 1)):
        with suppress(ValueError):
            days = [date(parts[y], parts[m], parts[d]) for parts in dates]
            if 0 <= (days[0] - days[-1]).days <= 31:
                return float((days[0] - days[-1]).days)
    return float(len(before))


# ---- numbers ---------------------------------------------------------------------

DECIMAL_COMMAS = "Decimal commas were read as decimal points."
THOUSANDS = "Commas were read as separators of thousands."
_POINTS = "Points were read as separators of thousands, commas as decimal points."
_MISSING = frozenset(
    "nan na n/a n.a. #n/a #na #value! #div/0! #num! #ref! nat null none - -- --- ? missing "
    "undefined -nan nan(ind) -nan(ind) 1.#qnan -1.#ind".split()
) | {""}
_EXPONENT = r"(?:[eEdD][+-]?\d+)?"
# Numbers with commas: of groups of thousands, or of decimals.
_ENGLISH = re.compile(rf"[+-]?(?:[1-9]\d{{0,2}}(?:,\d{{3}})+|\d*)(?:\.\d*)?{_EXPONENT}")
_GERMAN = re.compile(rf"[+-]?(?:[1-9]\d{{0,2}}(?:\.\d{{3}})+|\d*)(?:,\d*)?{_EXPONENT}")
_TYPED_OVER = re.compile(rf"[+-]?\d+(?:\.\d*)?{_EXPONENT}[\s,;(]+[A-Za-z].*")
FORTRAN = re.compile(r"(?<=[\d.])[dD](?=[+-]?\d)")


def is_missing(cell: str) -> bool:
    """Whether a cell says that there is no sample."""
    return cell.strip().lower() in _MISSING


def number(cell: str) -> float:
    """Return the number in a cell, nan for a missing one; raise ValueError for text."""
    cell = cell.strip()
    if is_missing(cell):
        return np.nan
    if "_" in cell:
        raise ValueError(cell)
    if "," in cell:
        if "." not in cell and cell.count(",") == 1:
            cell = cell.replace(",", ".")
        elif _ENGLISH.fullmatch(cell):
            cell = cell.replace(",", "")
        elif _GERMAN.fullmatch(cell):
            cell = cell.replace(".", "").replace(",", ".")
    try:
        return float(cell)
    except ValueError:
        return float(FORTRAN.sub("e", cell))


def with_remark(cell: str) -> bool:
    """Whether a cell was typed over by hand: a number and words beside it, "-1200, was -8.9"."""
    return bool(_TYPED_OVER.fullmatch(cell.strip()))


def is_number(cell: str) -> bool:
    """Whether a cell holds a number or a stamp of time."""
    try:
        return is_stamp(cell) or not np.isnan(number(cell))
    except ValueError:
        return False


def without_commas(
    source: str, rows: Sequence[tuple[int, list[str]]]
) -> tuple[list[list[str]], list[str]]:
    """The cells of (line, cells) with decimal points only, and what commas were taken for."""
    cells = [row for _, row in rows]
    marked = [c for row in cells for c in row if "," in c or "." in c]
    marked = [c for c in marked if not (is_missing(c) or is_stamp(c))]
    if not any("," in c for c in marked):
        return cells, []
    points = any("." in c for c in marked)
    english, german = (all(map(kind.fullmatch, marked)) for kind in (_ENGLISH, _GERMAN))
    if german and not (english and points):
        said, marks = _POINTS if points else DECIMAL_COMMAS, {".": "", ",": "."}
    elif english and not german:
        said, marks = THOUSANDS, {",": ""}
    else:
        return cells, _mixed(source, rows)
    table = str.maketrans(marks)
    return [[c if is_stamp(c) else c.translate(table) for c in row] for row in cells], [said]


def _mixed(source: str, rows: Sequence[tuple[int, list[str]]]) -> list[str]:
    """InputError at the line where points and commas have both occurred; text is named later."""
    points = commas = False
    for line, row in rows:
        plain = [c for c in row if not is_stamp(c) and re.fullmatch(r"[\d+.,eEdD-]*", c.strip())]
        points = points or any("." in cell for cell in plain)
        commas = commas or any("," in cell for cell in plain)
        if points and commas:
            raise InputError(
                f"{source}: line {line} mixes decimal points and decimal commas; use one."
            )
    return [DECIMAL_COMMAS] if commas else []


# ---- the table -------------------------------------------------------------------

_SNIFF = 400  # lines read to find the delimiter, the header and the first row
_STEADY = 10  # rows of numbers in a row that begin the data
_COMMENTS = ("#", "%", "//")
_BLANKS = " "  # the delimiter that stands for any number of blanks


@dataclass(frozen=True)
class _Text:
    """The lines of a text and the table in them; the numbers begin at the line ``first``, from 0.
    ``stamped`` are columns of dates and times of day, ``epoch`` those of seconds since 1970."""

    source: str
    lines: list[str]
    delimiter: str
    first: int
    names: tuple[str, ...]
    plain: tuple[str, ...]
    units: tuple[str | None, ...]
    headed: bool
    stamped: frozenset[int] = frozenset()
    epoch: dict[int, str] = field(default_factory=dict)

    def table(self) -> Table:
        where, hint = Lines(self.lines, self.first), self.one_in_a_row()
        columns, begins = (self.names, self.plain, self.units), f"line {self.first + 1}"
        table = Table(self.source, *columns, self.load, where, hint, self.headed, begins)
        return joined_stamps(table)

    def one_in_a_row(self) -> str:
        """What to do with a table of channel and value; empty for any other."""
        rows = [_cells(line, self.delimiter) for line in self.lines[self.first :][:_SNIFF]]
        for c, name in enumerate(self.names):
            cells = [row[c] for row in rows if len(row) == len(self.names)]
            channels = list(dict.fromkeys(cells))
            if c in self.stamped or any(map(is_number, channels)):
                continue
            if 2 <= len(channels) <= len(cells) / 4:
                return (
                    f"It holds one value in a row, and '{name}' says of which channel: "
                    f"{', '.join(channels[:4])}. Give each channel a column of its own, in pandas "
                    f"by pivot_table(columns='{name}', ...)."
                )
        return ""

    def load(self, indices: Sequence[int]) -> Columns:
        """The columns of these indices: at once where that is possible, else cell by cell."""
        exact = (self.stamped | set(self.epoch)) & set(indices)
        made, said = (None if exact else self.at_once(indices)) or self.by_cells(indices)
        return made, said + epoch_said(self.names, self.epoch, indices)

    def at_once(self, indices: Sequence[int]) -> Columns | None:
        """The columns at C speed; None if cells must be read one by one."""
        text, said = "\n".join(self.lines[self.first :]), []
        if any(mark in text for mark in _COMMENTS):
            text = "\n".join(line for line in self.lines[self.first :] if not _is_comment(line))
        text = text.replace('"', "")  # a delimiter between quotes shows in the count below
        if self.delimiter != "," and "," in text:
            if "." in text:
                return None
            text, said = text.replace(",", "."), [DECIMAL_COMMAS]
        data, width = self.parsed(text, indices), len(self.names)
        if data is None and self.delimiter != _BLANKS:  # perhaps only because of empty cells
            gap = re.escape(self.delimiter)
            text = re.sub(rf"(?<={gap})(?={gap}|$)|^(?={gap})", "nan", text, flags=re.MULTILINE)
            data = self.parsed(text, indices)
        if data is None:
            return None
        if self.delimiter == _BLANKS:
            whole = len(text.split()) == len(data) * width
        else:
            whole = text.count(self.delimiter) == len(data) * (width - 1)
        return (list(np.ascontiguousarray(data.T)), said) if whole else None

    def parsed(self, text: str, indices: Sequence[int]) -> np.ndarray | None:
        between = None if self.delimiter == _BLANKS else self.delimiter
        try:
            return np.loadtxt(
                text.split("\n"), delimiter=between, usecols=indices, comments=None, ndmin=2
            )
        except ValueError:
            return None

    def by_cells(self, indices: Sequence[int]) -> Columns:
        """The columns cell by cell: one empty or typed over is missing; InputError for text."""
        said: list[str] = []
        rows: list[tuple[int, list[str]]] = []
        width = len(self.names)
        last = max(k for k, line in enumerate(self.lines, 1) if line.strip())
        for k, line in enumerate(self.lines[self.first :], self.first + 1):
            if _is_comment(line):
                continue
            cells = _cells(line, self.delimiter)
            if len(cells) < width and k == last and rows:
                said.append(f"The last line ({k}) is cut off and was left out.")
                continue
            if len(cells) != width:
                raise InputError(
                    f"{self.source}: line {k} has {len(cells)} cells, "
                    f"the header names {width} columns."
                )
            rows.append((k, [cells[i] for i in indices]))
        cleaned, commas = without_commas(self.source, rows)
        numbers = [k for k, _ in rows]
        columns = [
            self.column(i, numbers, cells, said)
            for i, cells in zip(indices, zip(*cleaned, strict=True), strict=True)
        ]
        return columns, [*commas, *said]

    def column(
        self, i: int, numbers: Sequence[int], cells: Sequence[str], said: list[str]
    ) -> np.ndarray:
        """The values of a column, whose cells stand in the lines of these ``numbers``."""
        if i in self.stamped:
            try:
                return seconds(cells)
            except ValueError as error:
                k = int(error.args[0])
                raise self.no_number(i, numbers[k], cells[k], "date or time of day") from None
        with suppress(ValueError):
            if self.epoch.get(i) == "ns":  # no float64 holds them to the nanosecond
                whole = np.array(cells, dtype=np.int64)
                return (whole - whole[0]).astype(np.float64)
        with suppress(ValueError):
            if not any("_" in cell for cell in cells):
                return np.array(list(map(float, cells)))
        values = np.full(len(cells), np.nan)
        for k, cell in enumerate(cells):
            try:
                values[k] = number(cell)
            except ValueError:
                if not with_remark(cell):
                    raise self.no_number(i, numbers[k], cell, "number") from None
                place = f"line {numbers[k]}, column '{self.names[i]}'"
                said.append(f"The cell in {place} was typed over: '{cell}' is left out.")
        return values

    def no_number(self, i: int, line: int, cell: str, what: str) -> InputError:
        place = f"{self.source}: line {line}, column '{self.names[i]}'"
        return InputError(f"{place}: '{cell}' is not a {what}.")


class Lines:
    """Names the line of a row: 'line 2102'. A pickle holds the numbers, not the text."""

    def __init__(self, lines: list[str], first: int) -> None:
        self.lines, self.first = lines, first

    @cached_property
    def _shifts(self) -> list[int]:
        """The row before which each comment or blank line stands."""
        found = [i for i, line in enumerate(self.lines[self.first :]) if _is_comment(line)]
        return [i - k for k, i in enumerate(found)]

    def __call__(self, row: int) -> str:
        return f"line {self.first + 1 + row + bisect_right(self._shifts, row)}"

    def __getstate__(self) -> dict[str, Any]:
        return {"first": self.first, "_shifts": self._shifts}


def read_text(path: Path) -> Table:
    """The table in a text file of any usual encoding."""
    data, encoding = path.read_bytes(), "utf-8-sig"
    head = data[:2000]
    if data.startswith((b"\xff\xfe", b"\xfe\xff")):
        encoding = "utf-16"
    elif b"\0" in head and not any(head[1::2]):
        encoding = "utf-16-le"
    elif b"\0" in head and not any(head[::2]):
        encoding = "utf-16-be"
    elif b"\0" in data:
        raise InputError(f"{path.name} is neither text nor a MAT, NPZ or Parquet file.")
    try:
        text = data.decode(encoding, errors="strict" if encoding == "utf-8-sig" else "replace")
    except UnicodeDecodeError:
        text = data.decode("latin-1")
    return lines_table(path.name, text.replace("\r\n", "\n").replace("\r", "\n").split("\n"))


def _cells(line: str, delimiter: str) -> list[str]:
    if delimiter == _BLANKS:
        return line.split()
    if delimiter == "|":
        line = line.strip().strip("|")
    try:
        found = next(csv.reader([line], delimiter=delimiter), []) if '"' in line else None
    except csv.Error:
        return []
    if found is None:
        found = line.split(delimiter) if line else []
    cells = [cell.strip() for cell in found]
    if cells and delimiter in ";,\t":  # a delimiter of another kind at the end of the line
        cells[-1] = cells[-1].rstrip(",; ")
    return cells


def _is_comment(line: str) -> bool:
    return not line.strip() or line.lstrip().startswith(_COMMENTS)


def lines_table(source: str, lines: list[str]) -> Table:
    sniffed = [(i, line) for i, line in enumerate(lines[:_SNIFF]) if not _is_comment(line)]
    if not sniffed:
        raise InputError(f"{source} is empty: it has no line of data.")
    delimiter, width, tail = _delimiter(source, sniffed)
    numeric = [_is_numeric([row[c] for row in tail]) for c in range(width)]
    rows = [(i, _cells(line, delimiter)) for i, line in sniffed]
    likes = [_like_data(cells, numeric) for _, cells in rows]
    runs = ((0.89, _STEADY), (0.6, 6))  # some preambles hold rows of numbers, too
    starts = (
        k
        for share, length in runs
        for k in range(len(rows))
        if likes[k] and np.mean(likes[k : k + length]) > share
    )
    start = next(starts, -1)
    if start < 0:
        raise InputError(f"{source} has no row of numbers in its first {_SNIFF} lines.")
    found, first = _headers(lines, rows, start, delimiter, width), rows[start][0]
    if found is None:
        above = _names_above(rows[:start]) if delimiter == "," else 0
        if 0 < above < width:
            raise _mismatch(source, first, width, above, delimiter)
        names, plain, units = tuple(map(str, range(1, width + 1))), ("",) * width, (None,) * width
    else:
        names, plain, units = _name_columns(*found)
    if len(names) == width - 1 and not any(row[-1] for row in tail):
        names, plain, units = (*names, ""), (*plain, ""), (*units, None)
    if len(names) != width:
        raise _mismatch(source, first, width, len(names), delimiter)
    plainly = _Text(source, lines, delimiter, first, names, plain, units, found is not None)
    return _with_times(plainly, tail).table()


def _with_times(text: _Text, tail: list[list[str]]) -> _Text:
    """The same with its columns of stamps and of seconds since 1970."""
    columns = list(zip(*tail, strict=True))
    stamped = {c for c, cells in enumerate(columns) if sum(map(is_stamp, cells)) > len(cells) / 2}
    units = ["s" if c in stamped else unit for c, unit in enumerate(text.units)]
    plain = [p or "time" * (c in stamped) for c, p in enumerate(text.plain)]
    names = tuple(n or plain[c] for c, n in enumerate(text.names))
    epoch = {}
    for c in time_columns(plain, units):
        present = [number(x) for x in columns[c] if is_number(x) and not is_stamp(x)]
        unit = epoch_unit(present[0], present[-1]) if present else None
        if unit is not None:
            epoch[c] = units[c] = unit
    return replace(text, names=names, plain=tuple(plain), units=tuple(units),
                   stamped=frozenset(stamped), epoch=epoch)  # fmt: skip


def _names_above(rows: Sequence[tuple[int, list[str]]]) -> int:
    """The number of names in a header that only rows of numbers separate from the data; 0 if none.
    Decimal commas between commas make rows of many lengths: 0,5 but 0."""
    words = [k for k, (_, cells) in enumerate(rows) if not any(map(is_number, cells))]
    last = words[-1] if words else len(rows)
    names = rows[last][1] if last + 1 < len(rows) else []
    return len(names) if len(names) > 1 and all(names) else 0


def _mismatch(source: str, line: int, width: int, names: int, delimiter: str) -> InputError:
    hint = (
        "if these are decimal commas, separate the columns by semicolons"
        if delimiter == "," and width > names
        else "name every column once"
    )
    return InputError(
        f"{source}: line {line + 1} has {width} cells but the header names {names}; {hint}."
    )


def _is_numeric(cells: Sequence[str]) -> bool:
    present = [cell for cell in cells if not is_missing(cell)]
    return 2 * sum(map(is_number, present)) > len(present)


def _delimiter(source: str, sniffed: list[tuple[int, str]]) -> tuple[str, int, list[list[str]]]:
    """Return the delimiter, the usual number of cells, and the last rows of that many."""
    tail = [line for _, line in sniffed[-max(3, len(sniffed) // 4) :]]
    found = []
    for delimiter in "\t;|," + _BLANKS:
        rows = [_cells(line, delimiter) for line in tail]
        width = Counter(map(len, rows)).most_common(1)[0][0]
        if width < 2:
            continue
        rows = [row for row in rows if len(row) == width]
        filled = [cells for cells in zip(*rows, strict=True) if any(cells)]
        share = float(np.mean([_is_numeric(cells) for cells in filled]))
        if delimiter == _BLANKS and share < 0.5:  # words of a text
            continue
        found.append((share, delimiter, width, rows))
    if found:
        return max(found, key=lambda one: one[0])[1:]
    if any(is_number(_cells(line, ";")[0]) for line in tail if _cells(line, ";")):
        raise InputError(
            f"{source} has one column; a record needs u and one of w, theta "
            "in columns separated by comma, semicolon or tab."
        )
    raise InputError(f"{source} is not a table: no columns of numbers were found in it.")


def _like_data(cells: list[str], numeric: list[bool]) -> bool:
    if len(cells) != len(numeric) or not any(map(is_number, cells)):
        return False
    wrong = sum(n and not is_number(c) and c != "" for c, n in zip(cells, numeric, strict=True))
    return wrong <= max(1, len(cells) // 4)


def _headers(
    lines: list[str],
    rows: list[tuple[int, list[str]]],
    start: int,
    delimiter: str,
    width: int,
) -> tuple[list[str], list[str] | None] | None:
    """The cells of the header and of the line of units, if there is one; None without a header."""
    first = rows[start][0]
    if start == 0:
        remarks = [line.lstrip(" \t#%/") for line in lines[:first] if line.strip()]
        rows_of_names = [_header_cells(remark, delimiter, width) for remark in remarks]
        fit = [c for c in rows_of_names if len(c) == width and not any(map(is_number, c))]
        if (
            len(fit) > 1
            and 2 * sum(parse_unit(c.strip("[]()")) is not None for c in fit[-1]) > width
        ):
            return fit[-2], fit[-1]
        return (fit[-1], None) if fit else None
    by_turns = keyed([row for _, row in rows[:start]], width)
    if by_turns is not None:
        return by_turns
    last = _header_cells(lines[rows[start - 1][0]], delimiter, width)
    if all(is_missing(cell) or is_number(cell) for cell in last):
        return None
    known = [parse_unit(cell.strip("[]()")) for cell in last if cell]
    if start > 1 and any(known):
        above = _header_cells(lines[rows[start - 2][0]], delimiter, width)
        if len(above) == len(last):
            return above, last
    return last, preamble_units([row for _, row in rows[: start - 1]], last)


def _header_cells(line: str, delimiter: str, width: int) -> list[str]:
    """The names in a header, whose units may hold blanks."""
    if delimiter != _BLANKS:
        return _cells(line, delimiter)
    line = line.strip()
    for split in (
        line.split(),
        re.findall(r"[^\s\[(]+(?:\s*(?:\[[^\]]*\]|\([^)]*\)))?", line),
        re.split(r"\s{2,}|\t", line),
        [cell.strip() for cell in re.split(r"[,;|]", line)],
    ):
        if len(split) == width:
            return split
    return line.split()


def _name_columns(
    headers: list[str], unit_line: list[str] | None
) -> tuple[tuple[str, ...], tuple[str, ...], tuple[str | None, ...]]:
    found = heads(headers)
    if unit_line is not None:
        below = [cell.strip("[]() ") or None for cell in unit_line]
        found = [(n, p, unit or b) for (n, p, unit), b in zip(found, below, strict=True)]
    while found and found[-1][0] == "" and found[-1][2] is None:
        found.pop()
    if not found:
        return (), (), ()
    name, _, unit = found[0]
    known = parse_unit(unit) if unit else None
    if not name and known is not None and known.quantity == "time":
        found[0] = ("time", "time", unit)  # some recorders leave the first name empty
    names, plain, units = zip(*found, strict=True)
    return names, plain, units


def keyed(rows: list[list[str]], width: int) -> tuple[list[str], list[str] | None] | None:
    """A header of key and value by turns, as automation scopes write it: a time per channel."""
    found = {}
    for row in rows:
        if len(row) == width and width % 2 == 0 and row[0] and len(set(row[::2])) == 1:
            found[row[0]] = row[1::2]
    if "Name" not in found:
        return None
    key = next((key for key in found if "time" in key.lower()), "")
    time = split_unit(key)[1] or "ms"
    below = next((found[key] for key in found if key.lower().startswith("unit")), [""] * width)
    names = [name for value in found["Name"] for name in (f"{value}.time", value)]
    return names, [unit for value in below for unit in (time, value)]


def preamble_units(rows: list[list[str]], header: list[str]) -> list[str] | None:
    """Units in a line of the preamble whose first cell is a word such as Y_Unit_Label."""
    for row in rows:
        cells = row[1:]
        if len(row) == len(header) and "unit" in row[0].lower() and any(cells):
            if all(parse_unit(cell) for cell in cells if cell):
                return ["", *cells]
    return None
