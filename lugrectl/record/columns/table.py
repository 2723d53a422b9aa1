"""Tables of named columns: of a file, or in memory (dict of arrays, structured array, DataFrame).

A DataFrame is known by what it can do; pandas is never imported.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from typing import Any

import numpy as np

from ...core.errors import InputError
from ...core.validation import array, real, shown
from .names import fitting, rank, split_unit, unit_in_name

Columns = tuple[list[np.ndarray], list[str]]  # the columns, and notes on how they were read
Header = tuple[str, str, str | None]  # name, plain name (without a unit behind it), unit
_SHOWN = 30  # names that a sentence lists at most
# Seconds since 1970 in the years from 2001 to 2096, in s, ms, us and ns.
_EPOCH = {"s": 1.0, "ms": 1e3, "us": 1e6, "ns": 1e9}


def row_number(row: int) -> str:
    """Return 'row 2100', counted from 0 as arrays are."""
    return f"row {row}"


@dataclass(frozen=True)
class Table:
    """Named columns of a file, read only on request."""

    source: str
    names: tuple[str, ...]
    plain: tuple[str, ...]  # names without units, by which roles are found
    units: tuple[str | None, ...]
    load: Callable[[Sequence[int]], Columns]  # float64 columns of these indices
    where: Callable[[int], str] = row_number  # "line 2102" of a text, its header counted
    hint: str = ""  # a sentence for a table whose columns cannot be identified
    headed: bool = True  # whether the file has names
    begins: str = "sample 1"  # the place of the first row

    def listed(self) -> str:
        """The names as ``--columns`` takes them, in a sentence."""
        names = [
            f"'{name}'" + f" (column {i + 1})" * (self.names.count(name) > 1)
            for i, name in enumerate(self.names[:_SHOWN])
        ]
        rest = len(self.names) - _SHOWN
        return ", ".join(names) + (f" and {rest} more" if rest > 0 else "")


def heads(headers: Sequence[str]) -> list[Header]:
    """Name, plain name (without a unit behind it, as in torque_mNm) and unit of each header."""
    made = []
    for header in headers:
        name, unit = split_unit(header)
        plain, other = (name, None) if unit else unit_in_name(name.strip("%_ "))
        made.append((name, plain.strip("%_ ") or name, unit or other))
    return made


def joined_stamps(table: Table) -> Table:
    """The table with a column of t for whole seconds and nanoseconds in two columns."""
    places, many = {name: i for i, name in enumerate(table.names)}, len(table.names)
    pairs = (
        (name.removesuffix(ending).strip("._/ ") or "stamp", i, places[other])
        for name, i in places.items()
        for ending, fine in (("secs", "nsecs"), ("sec", "nanosec"), ("sec", "nsec"))
        if name.endswith(ending) and (other := name.removesuffix(ending) + fine) in places
    )
    own, seconds, rest = next(pairs, ("", 0, 0))
    if not own or own in places:
        return table

    def load(indices: Sequence[int]) -> Columns:
        every = [k for i in indices for k in ((i,) if i < many else (seconds, rest))]
        columns, said = table.load(every)
        left = iter(columns)
        return [next(left) if i < many else together(next(left), next(left)) for i in indices], said

    def together(whole: np.ndarray, fine: np.ndarray) -> np.ndarray:
        known = whole[np.isfinite(whole)]
        return (whole - (known[0] if known.size else 0.0)) + 1e-9 * fine

    plain = ["" if i in (seconds, rest) else name for i, name in enumerate(table.plain)]
    units, names = (*table.units, "s"), (*table.names, own)
    return replace(table, names=names, plain=(*plain, own), units=units, load=load)


def epoch_unit(first: float, last: float) -> str | None:
    """The unit in which two numbers are seconds since 1970, None if they are not."""
    return next((u for u, per in _EPOCH.items() if 1e9 * per <= first <= last < 4e9 * per), None)


def time_columns(plain: Sequence[str], units: Sequence[str | None]) -> list[int]:
    """The columns without a unit that may be t."""
    free = [i for i in range(len(plain)) if units[i] is None]
    return [i for i in free if rank(plain[i], "t") is not None]


def array_table(
    source: str,
    columns: Sequence[tuple[str, str, str | None, Any]],
    hint: str = "",
    headed: bool = True,
    number_of: Callable[[int], np.ndarray] | None = None,
) -> Table:
    """The table of (name, plain name, unit, values); ``number_of`` makes numbers of a column."""
    names, plain, units, values = (list(part) for part in zip(*columns, strict=True))
    arrays = [_as_array(one).ravel() for one in values]
    epoch = {}  # columns of seconds since 1970, and their unit
    for i in time_columns(plain, units):
        x = arrays[i]
        x = x[np.isfinite(x)] if x.dtype.kind == "f" else x
        known = x.dtype.kind in "iuf" and x.size
        unit = epoch_unit(float(x[0]), float(x[-1])) if known else None
        if unit is not None:
            epoch[i] = units[i] = unit

    def load(indices: Sequence[int]) -> Columns:
        chosen = [
            _as_float(arrays[i]) if number_of is None or i in epoch else number_of(i)
            for i in indices
        ]
        if len({one.size for one in chosen}) > 1:
            pairs = zip(indices, chosen, strict=True)
            sizes = ", ".join(f"{names[i]} {one.size}" for i, one in pairs)
            raise InputError(f"{source}: the columns differ in length ({sizes}).")
        return chosen, epoch_said(names, epoch, indices)

    table = Table(source, tuple(names), tuple(plain), tuple(units), load, hint=hint, headed=headed)
    return joined_stamps(table)


def _as_array(values: Any) -> np.ndarray:
    try:
        return np.asarray(values)
    except ValueError:  # ragged
        return np.zeros(0)


def _as_float(values: np.ndarray) -> np.ndarray:
    """Numbers as float64; large whole numbers, as of a clock, relative to the first of them."""
    if values.dtype.kind in "iu" and values.size and int(np.max(values)) > 2**53:
        values = values.astype(np.int64) - np.int64(values[0])
    return np.asarray(values, dtype=np.float64)


def epoch_said(names: Sequence[str], epoch: dict[int, str], indices: Sequence[int]) -> list[str]:
    """Notes on the columns that were taken for seconds since 1970."""
    found = [i for i in indices if epoch.get(i, "s") != "s"]
    return [f"'{names[i]}' holds {epoch[i]} since 1970 (its unit is not stated)." for i in found]


# ---- in memory -------------------------------------------------------------------

FORMS = "a path, a pandas DataFrame, a dict of arrays or a Record"


def is_table(given: Any) -> bool:
    """Whether this holds columns by name."""
    structured = isinstance(given, np.ndarray) and given.dtype.names is not None
    return isinstance(given, Mapping) or structured or _is_frame(given)


def _is_frame(given: Any) -> bool:
    return hasattr(given, "columns") and hasattr(given, "__getitem__") and hasattr(given, "shape")


def source_of(given: Any) -> str:
    """What such a table is called in a sentence."""
    return "the data frame" if _is_frame(given) else "the dict of arrays"


def table_of(given: Any, named: Mapping[str, str]) -> Table:
    """The columns as those of a file; ``named`` are the roles whose columns the user names."""
    source, columns = source_of(given), _columns(given)
    if _is_frame(given):
        columns += _index(given, [split_unit(name)[0] for name, _ in columns], named)
    if not columns:
        raise InputError(f"{source} has no columns.")
    described = zip(heads([name for name, _ in columns]), columns, strict=True)
    made = [
        (name, plain, "s" if _is_dated(values) else unit, values)
        for (name, plain, unit), (_, values) in described
    ]

    def number_of(i: int) -> np.ndarray:
        name, values = columns[i]
        return _numbers(f"{source}: column '{name}'", values)

    return array_table(source, made, number_of=number_of)


def _columns(given: Any) -> list[tuple[str, Any]]:
    """Names and columns; those of nested dicts by dotted names, what is None left out."""
    if isinstance(given, np.ndarray):
        return [(name, given[name]) for name in given.dtype.names or ()]
    if not isinstance(given, Mapping):
        at = getattr(given, "iloc", None)  # by place: a frame may have two columns of one name
        names = [_label(name) for name in given.columns]
        return [(n, given[n] if at is None else at[:, i]) for i, n in enumerate(names)]
    found = []
    for name, values in given.items():
        if isinstance(values, Mapping):
            found += [(f"{name}.{inner}", v) for inner, v in _columns(values)]
        elif values is not None and not str(name).startswith("__"):
            found.append((str(name), values))
    return found


def _label(name: Any) -> str:
    return ".".join(map(str, name)) if isinstance(name, tuple) else str(name)


def _index(frame: Any, names: Sequence[str], named: Mapping[str, str]) -> list[tuple[str, Any]]:
    """The index as the column of t, where it holds instants or is named so and no column is t."""
    index = getattr(frame, "index", None)
    if not hasattr(index, "dtype"):
        return []
    own = _label(getattr(index, "name", None) or "")
    if "t" in named:
        return [(own, index)] if named["t"] in {own, split_unit(own)[0]} - {*names, ""} else []
    if fitting(names, "t", range(len(names)))[0]:
        return []
    if rank(split_unit(own)[0], "t") is not None:
        return [(own, index)]
    return [("t", index)] if _is_dated(index) else []


def _is_dated(values: Any) -> bool:
    """Whether these are instants or durations rather than numbers."""
    if hasattr(values, "dtype"):
        return getattr(values.dtype, "kind", "") in ("M", "m")
    return isinstance(values, (list, tuple)) and bool(values) and isinstance(values[0], datetime)


def _numbers(where: str, values: Any) -> np.ndarray:
    """A column as (N,) float64; InputError names the first value that is no number."""
    if _is_dated(values):
        return seconds_of(values)
    try:  # pandas knows how its own missing values become nan
        made = np.asarray(values.to_numpy(dtype=float, na_value=np.nan))
    except (AttributeError, TypeError, ValueError):
        cells = _as_array(values)
        if cells.dtype.kind in "OUS":
            for k, value in enumerate(cells.ravel()):
                if value is not None and real(value) is None:
                    raise InputError(
                        f"{where} holds {shown(value)} at sample {k + 1}, which is no number."
                    ) from None
            values = [np.nan if value is None else value for value in cells.ravel()]
        made = array(values, where)
    if made.ndim == 0 or made.size != max(made.shape):
        raise InputError(f"{where} must hold one number for each sample, not {shown(values)}.")
    return made.ravel()


def seconds_of(values: Any) -> np.ndarray:
    """Instants as seconds from the first of them, durations in seconds; nan where there is none."""
    if not hasattr(values, "dtype"):
        return np.array([(value - values[0]).total_seconds() for value in values])
    kind = "datetime64[ns]" if values.dtype.kind == "M" else "timedelta64[ns]"
    if hasattr(values, "to_numpy"):
        values = values.to_numpy(dtype=kind)  # one with a time zone, too
    stamps = np.asarray(values).astype(kind)
    if stamps.dtype.kind == "M":
        known = stamps[~np.isnat(stamps)]
        stamps = stamps - (known[0] if known.size else stamps[:1])
    return stamps / np.timedelta64(1, "s")
