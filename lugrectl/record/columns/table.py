"""Tables of named columns: of a file, or in memory (dict of arrays, structured array, DataFrame).

A DataFrame is known by what it can do; pandas is never imported.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from datetime import datetime
from typing import Any

import numpy as np

from ...core.errors import InputError
from ...core.validation import array, real, shown
from .names import fitting, rank, split_unit, unit_in_name

Columns = tuple[list[np.ndarray], list[str]]  # the columns, and notes on how they were read
Header = tuple[str, str, str | None]  # name, plain name (without a unit behind it), unit
_SHOWN = 30  # names that a sentence lists at most
_STAMPS = (("secs", "nsecs"), ("sec", "nanosec"), ("sec", "nsec"))


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

    @classmethod
    def of(cls, source: str, heads: Sequence[Header], load: Any, *more: Any) -> Table:
        names, plain, units = zip(*heads, strict=True)
        return cls(source, names, plain, units, load, *more)

    def listed(self) -> str:
        """The names as ``--columns`` takes them, in a sentence."""
        names = [
            f"'{name}'" + f" (column {i + 1})" * (self.names.count(name) > 1)
            for i, name in enumerate(self.names[:_SHOWN])
        ]
        rest = len(self.names) - _SHOWN
        return ", ".join(names) + (f" and {rest} more" if rest > 0 else "")

    def nanoseconds(self, i: int) -> int | None:
        """The column of nanoseconds that belongs to one of whole seconds."""
        return _stamps(self.names).get(i, (None,))[0]


def heads_of(headers: Sequence[str]) -> list[Header]:
    """Name, plain name (without a unit behind it, as in torque_mNm) and unit of each header."""
    made: list[Header] = []
    for header in headers:
        name, unit = split_unit(header)
        plain, other = (name, None) if unit else unit_in_name(name.strip("%_ "))
        made.append((name, plain.strip("%_ ") or name, unit or other))
    for i, (rest, own) in _stamps([name for name, *_ in made]).items():
        made[i], made[rest] = (made[i][0], own, "s"), (made[rest][0], "", None)
    return made


def _stamps(names: Sequence[str]) -> dict[int, tuple[int, str]]:
    """By place of a column of whole seconds: that of its nanoseconds, and the name of both."""
    found, places = {}, {name: i for i, name in enumerate(names)}
    for seconds, fine in _STAMPS:
        for stem in (n.removesuffix(seconds) for n in places if n.endswith(seconds)):
            own = stem.strip("._/ ") or "stamp"
            if stem + fine in places and own not in places:
                found[places[stem + seconds]] = places[stem + fine], own
    return found


def array_table(
    source: str, heads: Sequence[Header], values: Sequence[Any], hint: str = ""
) -> Table:
    """The table of columns in memory, each with its header."""

    def load(indices: Sequence[int]) -> Columns:
        chosen = [_numbers(f"{source}: column '{heads[i][0]}'", values[i]) for i in indices]
        if len({one.size for one in chosen}) > 1:
            pairs = zip(indices, chosen, strict=True)
            sizes = ", ".join(f"{heads[i][0]} {one.size}" for i, one in pairs)
            raise InputError(f"{source}: the columns differ in length ({sizes}).")
        return chosen, []

    return Table.of(source, heads, load, row_number, hint)


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
    names, values = zip(*columns, strict=True)
    heads = [
        (name, plain, "s" if _is_dated(x) else unit)
        for (name, plain, unit), x in zip(heads_of(names), values, strict=True)
    ]
    return array_table(source, heads, values)


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
        cells = np.zeros(0)
        with suppress(ValueError):  # ragged
            cells = np.asarray(values).ravel()
        if cells.dtype.kind in "OUS":
            for k, value in enumerate(cells):
                if value is not None and real(value) is None:
                    raise InputError(
                        f"{where} holds {shown(value)} at sample {k + 1}, which is no number."
                    ) from None
            values = [np.nan if value is None else value for value in cells]
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
