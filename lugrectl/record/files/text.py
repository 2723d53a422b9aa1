"""Text tables: finds delimiter, header, units and decimal commas; reports a bad cell by place."""

from __future__ import annotations

import csv
import re
from collections import Counter
from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...core.errors import InputError
from ...core.validation import shown
from ..columns.names import parse_unit, split_unit
from ..columns.table import Columns, Header, Table, heads_of

# ---- dates and times of day ------------------------------------------------------

_DATE = r"(?P<date>\d{4}[-/.]\d{1,2}[-/.]\d{1,2}|\d{1,2}[-/.]\d{1,2}[-/.]\d{4})"
_CLOCK = r"(?P<clock>\d{1,2}:\d{2}:\d{2}(?:[.,:]\d{1,9})?)\s*(?P<half>[AaPp][Mm])?"
_ZONE = r"(?P<zone>Z|UTC|\s?[+-]\d{2}:?\d{2})?"
_STAMP = re.compile(rf"(?:{_DATE}[T ,_]\s*)?{_CLOCK}{_ZONE}", re.ASCII)
_NO_STAMP = ("", "nan", "nat")
_DAY = 86400.0


def is_stamp(cell: str) -> bool:
    """Whether a cell holds a time of day, 23:59:59.9, with or without a date before it, or the
    nanoseconds since 1970, which no float64 holds."""
    if cell.strip().isdecimal():
        return 10**18 < int(cell) < 4 * 10**18
    return ":" in cell and _STAMP.fullmatch(cell.strip()) is not None


def seconds(cells: Sequence[str]) -> np.ndarray:
    """Seconds (N,) from the first stamp, nan for an empty cell; ValueError with the index of
    the first cell that is no stamp. Each further date, or a time that falls by half a day without
    one, is the next day."""
    days: dict[str, float] = {}
    made = np.full(len(cells), np.nan)
    present = [k for k, cell in enumerate(cells) if cell.strip().lower() not in _NO_STAMP]
    if present and all(cells[k].strip().isdecimal() for k in present):
        made[present] = [1e-9 * (int(cells[k]) - int(cells[present[0]])) for k in present]
        return made
    for k in present:
        match = _STAMP.fullmatch(cells[k].strip())
        if match is None:
            raise ValueError(k)
        hour, minute, rest = match["clock"].split(":", 2)
        if match["half"]:
            hour = int(hour) % 12 + 12 * (match["half"].lower() == "pm")
        made[k] = 3600 * int(hour) + 60 * int(minute) + float(re.sub("[,:]", ".", rest))
        if match["date"]:
            made[k] += _DAY * days.setdefault(match["date"], len(days))
    known = np.flatnonzero(np.isfinite(made))
    if not days and known.size:
        made[known] += _DAY * np.r_[0, np.cumsum(np.diff(made[known]) < -_DAY / 2)]
    return made - (made[known[0]] if known.size else 0.0)


# ---- numbers ---------------------------------------------------------------------

DECIMAL_COMMAS = "Decimal commas were read as decimal points."
_MISSING = frozenset(
    "nan na n/a n.a. #n/a #na #value! #div/0! #num! #ref! nat null none - -- --- ? missing "
    "undefined -nan nan(ind) -nan(ind) 1.#qnan -1.#ind".split()
) | {""}
_EXPONENT = r"(?:[eEdD][+-]?\d+)?"
# Numbers with commas: of groups of thousands, or of decimals.
_ENGLISH = re.compile(rf"[+-]?(?:[1-9]\d{{0,2}}(?:,\d{{3}})+|\d*)(?:\.\d*)?{_EXPONENT}")
_GERMAN = re.compile(rf"[+-]?(?:[1-9]\d{{0,2}}(?:\.\d{{3}})+|\d*)(?:,\d*)?{_EXPONENT}")
_FIGURES = re.compile(r"[\d+.,eEdD-]*\d[\d+.,eEdD-]*")
_TYPED_OVER = re.compile(rf"[+-]?\d+(?:\.\d*)?{_EXPONENT}[\s,;(]+[A-Za-z].*")
_FORTRAN = re.compile(r"(?<=[\d.])[dD](?=[+-]?\d)")


def is_missing(cell: str) -> bool:
    """Whether a cell says that there is no sample."""
    return cell.strip().lower() in _MISSING


def number(cell: str) -> float:
    """Return the number in a cell, nan for a missing one; raise ValueError for text."""
    if is_missing(cell):
        return np.nan
    if "_" in cell:
        raise ValueError(cell)
    return float(_FORTRAN.sub("e", cell))


def with_remark(cell: str) -> bool:
    """Whether a cell was typed over by hand: a number and words beside it, "-1200, was -8.9"."""
    return bool(_TYPED_OVER.fullmatch(cell.strip()))


def is_number(cell: str) -> bool:
    """Whether a cell holds a number, with a point or commas, or a stamp of time."""
    cell = cell.strip()
    if "," in cell and not is_stamp(cell):
        return bool(
            _FIGURES.fullmatch(cell) and (_ENGLISH.fullmatch(cell) or _GERMAN.fullmatch(cell))
        )
    try:
        return is_stamp(cell) or not np.isnan(number(cell))
    except ValueError:
        return False


def decimals(cells: Iterable[str]) -> tuple[dict[str, str], list[str]]:
    """What points and commas in these cells are to be replaced by, and how they were read."""
    marked = [c for c in cells if "," in c or "." in c]
    if not any("," in c for c in marked):
        return {}, []
    marked = [c.strip() for c in marked if _FIGURES.fullmatch(c.strip())]
    if not marked:
        return {}, []
    points = any("." in c for c in marked)
    english, german = (all(map(kind.fullmatch, marked)) for kind in (_ENGLISH, _GERMAN))
    if german and not points:
        return {",": "."}, [DECIMAL_COMMAS]
    if german and not english:
        said = "Points were read as separators of thousands, commas as decimal points."
        return {".": "", ",": "."}, [said]
    return ({",": ""}, ["Commas were read as separators of thousands."]) if english else ({}, [])


# ---- the table -------------------------------------------------------------------

_SNIFF = 400  # lines read to find the delimiter, the header and the first row
_STEADY = 10  # rows of numbers in a row that begin the data
_COMMENTS = ("#", "%", "//")
_PASSED = re.compile(r"\n\s*\n|#|%|//")  # in a text that may hold lines without numbers
_BLANKS = " "  # the delimiter that stands for any number of blanks


@dataclass(frozen=True)
class Line:
    """Names the line of a row: 'line 2102'."""

    numbers: Sequence[int]

    def __call__(self, row: int) -> str:
        return f"line {self.numbers[row]}"


@dataclass(frozen=True)
class _Rows:
    """The lines of numbers of a text, and their numbers; ``stamped`` are its columns of dates and
    times of day."""

    source: str
    text: str
    numbers: Sequence[int]
    names: tuple[str, ...]
    delimiter: str
    stamped: set[int]

    def load(self, indices: Sequence[int]) -> Columns:
        """The columns of these indices: at once where that is possible, else cell by cell."""
        at_once = None if self.stamped & set(indices) else self.at_once(indices)
        return at_once or self.by_cells(indices)

    def at_once(self, indices: Sequence[int]) -> Columns | None:
        """The columns at C speed; None if cells must be read one by one."""
        # a delimiter between quotes shows in the count below
        text, said, gap = self.text.replace('"', ""), [], re.escape(self.delimiter)
        if self.delimiter != "," and "," in text:
            if "." in text:
                return None
            text, said = text.replace(",", "."), [DECIMAL_COMMAS]
        blank = self.delimiter == _BLANKS
        empty = rf"(?<={gap})(?={gap}|$)|^(?={gap})"
        for again in (False,) if blank else (False, True):
            text = re.sub(empty, "nan", text, flags=re.MULTILINE) if again else text
            with suppress(ValueError):
                apart = None if blank else self.delimiter
                rows = np.loadtxt(
                    text.split("\n"), delimiter=apart, usecols=indices, comments=None, ndmin=2
                )
                cells = len(text.split()) if blank else text.count(self.delimiter) + len(rows)
                whole = cells == len(rows) * len(self.names)
                return (list(np.ascontiguousarray(rows.T)), said) if whole else None
        return None

    def by_cells(self, indices: Sequence[int]) -> Columns:
        """The columns cell by cell: one empty or typed over is missing; InputError for text."""
        rows, width, said = self.cells(), len(self.names), []
        if len(rows[-1]) < width and len(rows) > 1:
            said.append(
                f"The last line ({self.numbers[len(rows) - 1]}) is cut off and was left out."
            )
            rows.pop()
        odd = next((k for k, row in enumerate(rows) if len(row) != width), None)
        if odd is not None:
            raise _mismatch(self.source, self.numbers[odd], len(rows[odd]), width, self.delimiter)
        columns = [[row[i] for row in rows] for i in indices]
        marks, commas = decimals(c for cells in columns for c in cells)
        table = str.maketrans(marks)
        if marks:
            columns = [
                [c.translate(table) if _FIGURES.fullmatch(c) and not is_stamp(c) else c for c in x]
                for x in columns
            ]
        made = [self.column(i, x, said) for i, x in zip(indices, columns, strict=True)]
        return made, [*commas, *said]

    def cells(self, most: int | None = None) -> list[list[str]]:
        return [_cells(line, self.delimiter) for line in self.text.split("\n")[:most]]

    def column(self, i: int, cells: Sequence[str], said: list[str]) -> np.ndarray:
        """The values of a column."""
        if i in self.stamped:
            try:
                return seconds(cells)
            except ValueError as error:
                raise self.no_number(i, int(error.args[0]), cells, "date or time of day") from None
        with suppress(ValueError):
            if not any("_" in cell for cell in cells):
                return np.array(list(map(float, cells)))
        values = np.full(len(cells), np.nan)
        for k, cell in enumerate(cells):
            try:
                values[k] = number(cell)
            except ValueError:
                if not with_remark(cell):
                    what = "number with a decimal point" if is_number(cell) else "number"
                    raise self.no_number(i, k, cells, what) from None
                place = f"line {self.numbers[k]}, column '{self.names[i]}'"
                said.append(f"The cell in {place} was typed over: {shown(cell)} is left out.")
        return values

    def no_number(self, i: int, row: int, cells: Sequence[str], what: str) -> InputError:
        place = f"{self.source}: line {self.numbers[row]}, column '{self.names[i]}'"
        return InputError(f"{place}: {shown(cells[row])} is not a {what}.")

    def one_in_a_row(self) -> str:
        """What to do with a table of channel and value; empty for any other."""
        rows = [row for row in self.cells(_SNIFF) if len(row) == len(self.names)]
        for name, cells in zip(self.names, zip(*rows, strict=True), strict=False):
            channels = list(dict.fromkeys(cells))
            if 2 <= len(channels) <= len(cells) / 4 and not any(map(is_number, channels)):
                return (
                    f"It holds one value in a row, and '{name}' says of which channel: "
                    f"{', '.join(channels[:4])}. Give each channel a column of its own, in pandas "
                    f"by pivot_table(columns='{name}', ...)."
                )
        return ""


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
    return text_table(path.name, text.replace("\r\n", "\n").replace("\r", "\n"))


def _cells(line: str, delimiter: str) -> list[str]:
    if delimiter == _BLANKS:
        return line.split()
    if delimiter == "|":
        line = line.strip().strip("|")
    found = line.split(delimiter) if line else []
    if '"' in line:
        with suppress(csv.Error):
            found = next(csv.reader([line], delimiter=delimiter), [])
    cells = [cell.strip() for cell in found]
    if cells and delimiter in ";,\t":  # a delimiter of another kind at the end of the line
        cells[-1] = cells[-1].rstrip(",; ")
    return cells


def _is_comment(line: str) -> bool:
    return not line.strip() or line.lstrip().startswith(_COMMENTS)


def text_table(source: str, text: str) -> Table:
    lines = text.split("\n", _SNIFF)[:_SNIFF]
    sniffed = [(i, line) for i, line in enumerate(lines) if not _is_comment(line)]
    if not sniffed:
        raise InputError(f"{source} is empty: it has no line of data.")
    delimiter, width, tail = _delimiter(source, [line for _, line in sniffed])
    columns = list(zip(*tail, strict=True))
    numeric = [*map(_is_numeric, columns)]
    likes = [_like_data(_cells(line, delimiter), numeric) for _, line in sniffed]
    starts = (
        k
        for share, length in ((0.89, _STEADY), (0.6, 6))  # some preambles hold rows of numbers, too
        for k in range(len(likes))
        if likes[k] and np.mean(likes[k : k + length]) > share
    )
    start = next(starts, -1)
    if start < 0:
        raise InputError(f"{source} has no row of numbers in its first {_SNIFF} lines.")
    first, above = sniffed[start][0], [line for _, line in sniffed[:start]]
    found = _header(above, lines[:first], delimiter, width)
    heads = found or [(str(k + 1), "", None) for k in range(width)]
    if len(heads) == width - 1 and not any(columns[-1]):
        heads.append(("", "", None))
    if len(heads) != width:
        raise _mismatch(source, first + 1, width, len(heads), delimiter)
    stamped = {c for c, x in enumerate(columns) if sum(map(is_stamp, x)) > len(x) / 2}
    for c in stamped:
        name, plain, _ = heads[c]
        heads[c] = (name or "time", plain or "time", "s")
    text, numbers = _numbered(text.split("\n", first)[-1].rstrip("\n"), first + 1)
    rows = _Rows(source, text, numbers, tuple(name for name, *_ in heads), delimiter, stamped)
    return Table.of(source, heads, rows.load, Line(numbers), rows.one_in_a_row())


def _numbered(text: str, first: int) -> tuple[str, Sequence[int]]:
    """A text without its comments and blank lines, and the numbers of the others."""
    if not _PASSED.search(text):
        return text, range(first, first + text.count("\n") + 1)
    kept = [(k, line) for k, line in enumerate(text.split("\n"), first) if not _is_comment(line)]
    return "\n".join(line for _, line in kept), [k for k, _ in kept]


def _mismatch(source: str, line: int, width: int, names: int, delimiter: str) -> InputError:
    hint = "name every column once"
    if delimiter == "," and width > names:
        hint = "if these are decimal commas, separate the columns by semicolons"
    return InputError(
        f"{source}: line {line} has {width} cells but the header names {names} columns; {hint}."
    )


def _is_numeric(cells: Sequence[str]) -> bool:
    present = [cell for cell in cells if not is_missing(cell)]
    return 2 * sum(map(is_number, present)) > len(present)


def _delimiter(source: str, lines: list[str]) -> tuple[str, int, list[list[str]]]:
    """Return the delimiter, the usual number of cells, and the last rows of that many."""
    tail = lines[-max(3, len(lines) // 4) :]
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


# ---- the header ------------------------------------------------------------------


def _header(above: list[str], before: list[str], delimiter: str, width: int) -> list[Header] | None:
    """Name, plain name and unit of each column, by the lines ``above`` the numbers, or by remarks
    if all lines ``before`` them are such; None without a header."""
    rows = [_names(line, delimiter, width) for line in above]
    if not rows:
        rows = [_names(line.lstrip(" \t#%/"), delimiter, width) for line in before if line.strip()]
        rows = [row for row in rows if len(row) == width and not any(map(is_number, row))]
    keyed = _keyed(rows, width)
    if keyed is not None:
        return _columns(*keyed)
    names = rows.pop() if rows else []
    if all(is_missing(cell) or is_number(cell) for cell in names):
        return None
    known = [parse_unit(cell.strip("[]()")) is not None for cell in names if cell]
    if rows and len(rows[-1]) == len(names) and 2 * sum(known) > len(known):
        return _columns(rows[-1], names)
    labels = (row for row in rows if len(row) == len(names) and "unit" in row[0].lower())
    below = next((row[1:] for row in labels if all(map(parse_unit, filter(None, row[1:])))), [])
    return _columns(names, ["", *below] if any(below) else [""] * len(names))


def _names(line: str, delimiter: str, width: int) -> list[str]:
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


def _columns(names: list[str], below: list[str]) -> list[Header]:
    """The columns of a header and of the units below it, without unnamed ones at the end."""
    found = [
        (name, plain, unit or cell.strip("[]() ") or None)
        for (name, plain, unit), cell in zip(heads_of(names), below, strict=True)
    ]
    while found and found[-1][0] == "" and found[-1][2] is None:
        found.pop()
    unit = parse_unit(found[0][2] or "") if found else None
    if unit is not None and unit.quantity == "time" and not found[0][0]:
        found[0] = ("time", "time", found[0][2])  # some recorders leave the first name empty
    return found


def _keyed(rows: list[list[str]], width: int) -> tuple[list[str], list[str]] | None:
    """A header of key and value by turns, as automation scopes write it: a time per channel."""
    found = {
        row[0]: row[1::2]
        for row in rows
        if len(row) == width and width % 2 == 0 and row[0] and len(set(row[::2])) == 1
    }
    if "Name" not in found:
        return None
    time = split_unit(next((key for key in found if "time" in key.lower()), ""))[1] or "ms"
    below = next((found[key] for key in found if key.lower().startswith("unit")), [""] * width)
    names = [name for value in found["Name"] for name in (f"{value}.time", value)]
    return names, [unit for value in below for unit in (time, value)]
