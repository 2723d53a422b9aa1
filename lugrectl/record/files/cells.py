"""Numbers in the cells of a text: missing marks, decimal commas, thousands, Fortran's D."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from ...core.errors import InputError
from .dates import is_stamp

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
        cell = _with_point(cell)
    try:
        return float(cell)
    except ValueError:
        return float(FORTRAN.sub("e", cell))


def _with_point(cell: str) -> str:
    if "." not in cell and cell.count(",") == 1:
        return cell.replace(",", ".")
    if _ENGLISH.fullmatch(cell):
        return cell.replace(",", "")
    return cell.replace(".", "").replace(",", ".") if _GERMAN.fullmatch(cell) else cell


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
    """The cells of (line, cells) with decimal points only, and what commas were taken for.

    Raises InputError where the cells mix decimal points and decimal commas.
    """
    cells = [row for _, row in rows]
    marked = [c for row in cells for c in row if "," in c or "." in c]
    marked = [c for c in marked if not (is_missing(c) or is_stamp(c))]
    if not any("," in c for c in marked):
        return cells, []
    english = all(map(_ENGLISH.fullmatch, marked))
    german = all(map(_GERMAN.fullmatch, marked))
    if german and (not english or not any("." in c for c in marked)):
        said = _POINTS if any("." in c for c in marked) else DECIMAL_COMMAS
        return [[_german(c) for c in row] for row in cells], [said]
    if english and not german:
        return [[c if is_stamp(c) else c.replace(",", "") for c in row] for row in cells], [
            THOUSANDS
        ]
    return cells, _mixed(source, rows)


def _german(cell: str) -> str:
    if is_stamp(cell) or "," not in cell and cell.count(".") == 0:
        return cell
    return cell.replace(".", "").replace(",", ".")


def _mixed(source: str, rows: Sequence[tuple[int, list[str]]]) -> list[str]:
    """Raise InputError at the line where both points and commas have occurred.

    What is text in its own right is left for the reader of the cells to name.
    """
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
