"""Dates and times of day in text, as seconds from the first of them."""

from __future__ import annotations

import re
from collections.abc import Sequence
from datetime import date

import numpy as np

_DATE = r"(?P<date>\d{4}[-/.]\d{1,2}[-/.]\d{1,2}|\d{1,2}[-/.]\d{1,2}[-/.]\d{4})"
_CLOCK = r"(?P<clock>\d{1,2}:\d{2}:\d{2}(?:[.,:]\d{1,9})?)\s*(?P<half>[AaPp][Mm])?"
_ZONE = r"(?P<zone>Z|UTC|\s?[+-]\d{2}:?\d{2})?"
_STAMP = re.compile(rf"(?:{_DATE}[T ,_]\s*)?{_CLOCK}{_ZONE}", re.ASCII)
_DAY = 86400.0


def is_stamp(cell: str) -> bool:
    """Whether a cell holds a time of day, 23:59:59.9, with or without a date before it."""
    return ":" in cell and _STAMP.fullmatch(cell.strip()) is not None


def seconds(cells: Sequence[str]) -> np.ndarray:
    """Seconds (N,) from the first stamp; nan where a cell is empty.

    A time of day without date that falls by more than half a day has passed midnight. Raises
    ValueError with the index of the first cell that is no stamp.
    """
    days: dict[str, float] = {}
    made = np.full(len(cells), np.nan)
    dated = False
    for k, cell in enumerate(cells):
        match = _STAMP.fullmatch(cell.strip())
        if match is None:
            if cell.strip().lower() in ("", "nan", "nat"):
                continue
            raise ValueError(k)
        made[k] = _of_day(match["clock"], match["half"])
        if match["date"]:
            dated = True
            if match["date"] not in days:
                days[match["date"]] = _day(match["date"], list(days))
            made[k] += _DAY * days[match["date"]]
    known = np.flatnonzero(np.isfinite(made))
    if not dated and known.size:
        made[known] += _DAY * np.r_[0, np.cumsum(np.diff(made[known]) < -_DAY / 2)]
    return made - (made[known[0]] if known.size else 0.0)


def _of_day(clock: str, half: str | None) -> float:
    hour, minute, rest = clock.split(":", 2)
    h = int(hour) % 12 + 12 * (half.lower() == "pm") if half else int(hour)
    return 3600 * h + 60 * int(minute) + float(re.sub("[,:]", ".", rest))


def _day(text: str, before: Sequence[str]) -> float:
    """The number of a day from the first date on; a date of unclear order is the next day."""
    if not before:
        return 0.0
    parts = [_parts(text), _parts(before[0])]
    for order in ("ymd", "dmy", "mdy"):
        try:
            then, first = (_date(part, order) for part in parts)
        except ValueError:
            continue
        if 0 <= (then - first).days <= 31:
            return float((then - first).days)
    return float(len(before))


def _parts(text: str) -> list[int]:
    return [int(part) for part in re.split("[-/.]", text)]


def _date(parts: Sequence[int], order: str) -> date:
    by = dict(zip(order, parts, strict=True))
    return date(by["y"], by["m"], by["d"])
