"""Headers of measuring programs: names and units in the lines above the numbers."""

from __future__ import annotations

from ..columns.column_names import split_unit
from ..columns.units import parse_unit


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
