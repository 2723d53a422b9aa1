"""A table of named columns, whatever it was read from."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...core.errors import InputError
from .column_names import fitting, split_unit, stamp_pair, unit_in_name

Columns = tuple[list[np.ndarray], list[str]]  # the columns, and notes on how they were read


_SHOWN = 30  # names that a sentence lists at most


# Seconds since 1970 in the years from 2001 to 2096, in s, ms, us and ns.
_EPOCH = {"s": 1.0, "ms": 1e3, "us": 1e6, "ns": 1e9}


@dataclass(frozen=True)
class Table:
    """Named columns of a file, read only on request.

    ``load(indices)`` returns the float64 columns of these indices and notes on how they were
    read; ``where(row)`` describes the place of a row in the file. ``plain`` are the names
    without units, by which roles are found; ``hint`` is a sentence for a table whose columns
    cannot be identified; ``headed`` is False where the file has no names.
    """

    source: str
    names: tuple[str, ...]
    units: tuple[str | None, ...]
    load: Callable[[Sequence[int]], Columns]
    where: Callable[[int], str]
    plain: tuple[str, ...] = ()
    hint: str = ""
    headed: bool = True

    def __post_init__(self) -> None:
        if not self.plain:
            object.__setattr__(self, "plain", self.names)

    def listed(self) -> str:
        """The names as ``--columns`` takes them, in a sentence."""
        twice = {name for name in self.names if self.names.count(name) > 1}
        names = [
            f"'{name}' (column {i + 1})" if name in twice else f"'{name}'"
            for i, name in enumerate(self.names)
        ]
        rest = len(names) - _SHOWN
        return ", ".join(names[:_SHOWN]) + (f" and {rest} more" if rest > 0 else "")


def heads(headers: Sequence[str]) -> list[tuple[str, str, str | None]]:
    """Name, plain name and unit of each header.

    The name is the header without a unit in brackets; the plain name is also without one behind
    it, as in torque_mNm.
    """
    made = []
    for header in headers:
        name, unit = split_unit(header)
        plain, other = (name, None) if unit else unit_in_name(name.strip("%_ "))
        made.append((name, plain.strip("%_ ") or name, unit or other))
    return made


def joined_stamps(table: Table) -> Table:
    """The table with a column of t for whole seconds and nanoseconds in two columns."""
    pairs = stamp_pair(table.names)
    if not pairs:
        return table
    many, places = len(table.names), list(pairs.values())

    def load(indices: Sequence[int]) -> Columns:
        wanted = [i for i in indices if i < many]
        more = [places[i - many] for i in indices if i >= many]
        every = [*wanted, *(i for seconds, rest, _ in more for i in (seconds, rest))]
        got, said = table.load(list(dict.fromkeys(every)))
        by = dict(zip(dict.fromkeys(every), got, strict=True))
        return [by[i] if i < many else _together(by, *places[i - many]) for i in indices], said

    names = [name for name in pairs if name not in table.names]
    if len(names) < len(pairs):
        return table
    return replace(
        table,
        names=(*table.names, *names),
        plain=(*(_part_of_stamp(i, p, places) for i, p in enumerate(table.plain)), *names),
        units=(*table.units, *("s" for _ in names)),
        load=load,
    )


def _part_of_stamp(i: int, plain: str, places: Sequence[tuple[int, int, float]]) -> str:
    return "" if any(i in (seconds, rest) for seconds, rest, _ in places) else plain


def _together(by: dict[int, np.ndarray], seconds: int, rest: int, unit: float) -> np.ndarray:
    whole = by[seconds]
    known = whole[np.isfinite(whole)]
    return (whole - (known[0] if known.size else 0.0)) + unit * by[rest]


def epoch_unit(first: float, last: float) -> str | None:
    """The unit in which two numbers are seconds since 1970, None if they are not."""
    for unit, per in _EPOCH.items():
        if 1e9 * per <= first <= last < 4e9 * per:
            return unit
    return None


def time_columns(plain: Sequence[str], units: Sequence[str | None]) -> list[int]:
    """The columns without a unit that may be t."""
    free = [i for i in range(len(plain)) if units[i] is None]
    return [i for i in free if fitting([plain[i]], "t", [0])[0]]


def array_table(
    source: str,
    columns: Sequence[tuple[str, str, str | None, np.ndarray]],
    hint: str = "",
    headed: bool = True,
) -> Table:
    """The table of (name, plain name, unit, values (N,)) in memory."""
    names, plain, units, arrays = (list(part) for part in zip(*columns, strict=True))
    epoch = epochs(plain, units, arrays)
    units = [epoch.get(i, unit) for i, unit in enumerate(units)]

    def load(indices: Sequence[int]) -> Columns:
        chosen = [arrays[i] for i in indices]
        if len({values.size for values in chosen}) > 1:
            sizes = ", ".join(f"{names[i]} {arrays[i].size}" for i in indices)
            raise InputError(f"{source}: the columns differ in length ({sizes}).")
        return [as_float(values) for values in chosen], epoch_said(names, epoch, indices)

    where = "sample {}"
    made = Table(
        source, tuple(names), tuple(units), load, lambda row: where.format(row + 1),
        tuple(plain), hint, headed,
    )  # fmt: skip
    return joined_stamps(made)


def epochs(
    plain: Sequence[str], units: Sequence[str | None], columns: Sequence[np.ndarray]
) -> dict[int, str]:
    """Which columns are seconds since 1970, and their unit."""
    found = {}
    for i in time_columns(plain, units):
        values = columns[i]
        values = values[np.isfinite(values)] if values.dtype.kind == "f" else values
        numbers = values.dtype.kind in "iuf" and values.size
        unit = epoch_unit(float(values.flat[0]), float(values.flat[-1])) if numbers else None
        if unit is not None:
            found[i] = unit
    return found


def epoch_said(names: Sequence[str], epoch: dict[int, str], indices: Sequence[int]) -> list[str]:
    """Notes on the columns that were taken for seconds since 1970."""
    return [
        f"'{names[i]}' holds {epoch[i]} since 1970 (its unit is not stated)."
        for i in indices
        if epoch.get(i, "s") != "s"
    ]


def as_float(values: np.ndarray) -> np.ndarray:
    """Numbers as float64; large whole numbers, as of a clock, relative to the first of them."""
    if values.dtype.kind in "iu" and values.size and int(np.max(values)) > 2**53:
        values = values.astype(np.int64) - np.int64(values[0])
    return np.asarray(values, dtype=np.float64)
