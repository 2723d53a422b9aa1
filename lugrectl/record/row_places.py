"""The place of a row in what the user has: a line of a text file, or a row of a table."""

from __future__ import annotations

import re
from bisect import bisect_right
from collections.abc import Callable

_LINE = re.compile(r"line (\d+)")
_ASKED = 400  # most questions to a file before a pickle names rows in place of lines


def row_number(row: int) -> str:
    """'row 2100', counted from 0 as arrays are."""
    return f"row {row}"


class Places:
    """Describes rows: 'line 2102' where the file counts lines, else 'row 2100' from 0.

    A pickle keeps the numbers of the lines, not the text of the file.
    """

    def __init__(self, where: Callable[[int], str], samples: int) -> None:
        self._where, self._samples = where, samples

    def __call__(self, row: int) -> str:
        text = self._where(row)
        return text if _LINE.fullmatch(text) else row_number(row)

    def __reduce__(self) -> tuple[object, tuple[object, ...]]:
        starts = self._starts()
        return (Lines, tuple(zip(*starts, strict=True))) if starts else (TableRows, ())

    def _line(self, row: int) -> int | None:
        match = _LINE.fullmatch(self._where(row))
        return int(match[1]) if match else None

    def _starts(self) -> list[tuple[int, int]] | None:
        """Rows after which lines without numbers follow, as (row, line minus row)."""
        first, last = self._line(0), self._line(max(self._samples - 1, 0))
        if first is None or last is None:
            return None
        found, asked = [(0, first)], _ASKED
        row, end = 0, self._samples - 1
        while last - end != found[-1][1]:  # comments or blank lines lie between
            low, high, shift = row, end, found[-1][1]
            while high - low > 1:
                middle, asked = (low + high) // 2, asked - 1
                line = self._line(middle)
                if line is None or asked < 0:
                    return None
                low, high = (low, middle) if line - middle != shift else (middle, high)
            row = high
            found.append((row, (self._line(row) or 0) - row))
        return found


class Lines:
    """Lines of a text file: from each of ``rows`` on the line is the row plus its shift."""

    def __init__(self, rows: tuple[int, ...], shifts: tuple[int, ...]) -> None:
        self.rows, self.shifts = rows, shifts

    def __call__(self, row: int) -> str:
        return f"line {row + self.shifts[bisect_right(self.rows, row) - 1]}"


class TableRows:
    """Rows of a table in memory, counted from 0."""

    def __call__(self, row: int) -> str:
        return row_number(row)
