"""Tables of named columns in memory: a dict of arrays, a structured array, a DataFrame.

A DataFrame is known by what it can do; pandas is never imported.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import datetime
from typing import Any

import numpy as np

from ...core.errors import InputError
from ...core.validation import array, real, shown
from .column_names import split_unit
from .roles import fits_role
from .table import Table, as_float, epoch_said, epochs, heads

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
    """The columns as those of a file; ``named`` are the roles whose columns the user names.

    Names may carry units, ``w [rpm]``. Instants become seconds from the first. The index of a
    DataFrame is a column where it holds instants or has a usual name of t, and no column is t.
    """
    source, columns = source_of(given), _columns(given)
    if _is_frame(given):
        columns += _index(given, [split_unit(name)[0] for name, _ in columns], named)
    if not columns:
        raise InputError(f"{source} has no columns.")
    described = heads([name for name, _ in columns])
    units = [
        "s" if _is_dated(values) else unit
        for (_, _, unit), (_, values) in zip(described, columns, strict=True)
    ]

    names, plain = tuple(name for name, _, _ in described), tuple(p for _, p, _ in described)
    epoch = epochs(plain, units, [_as_array(values) for _, values in columns])
    units = [epoch.get(i, unit) for i, unit in enumerate(units)]

    def numbers(i: int) -> np.ndarray:
        name, values = columns[i]
        if i in epoch:
            return as_float(np.asarray(values).ravel())
        return _numbers(f"{source}: column '{name}'", values)

    def load(indices: Sequence[int]) -> tuple[list[np.ndarray], list[str]]:
        chosen = [numbers(i) for i in indices]
        if len({values.size for values in chosen}) > 1:
            pairs = zip(indices, chosen, strict=True)
            sizes = ", ".join(f"{columns[i][0]} {values.size}" for i, values in pairs)
            raise InputError(f"{source}: the columns differ in length ({sizes}).")
        return chosen, epoch_said(names, epoch, indices)

    return Table(source, names, tuple(units), load, lambda row: f"sample {row + 1}", plain)


def _as_array(values: Any) -> np.ndarray:
    try:
        return np.asarray(values)
    except ValueError:  # ragged
        return np.zeros(0)


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
    """The index as the column of t, or nothing."""
    index = getattr(frame, "index", None)
    if not hasattr(index, "dtype"):
        return []
    own = _label(getattr(index, "name", None) or "")
    if "t" in named:
        return [(own, index)] if named["t"] in {own, split_unit(own)[0]} - {*names, ""} else []
    if fits_role(names, "t"):
        return []
    if fits_role([split_unit(own)[0]], "t"):
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
        return _seconds(values)
    try:  # pandas knows how its own missing values become nan
        made = np.asarray(values.to_numpy(dtype=float, na_value=np.nan))
    except (AttributeError, TypeError, ValueError):
        made = array(_without_none(where, values), where)
    if made.ndim == 0 or made.size != max(made.shape):
        raise InputError(f"{where} must hold one number for each sample, not {shown(values)}.")
    return made.ravel()


def _without_none(where: str, values: Any) -> Any:
    """The same with nan for None."""
    try:
        made = np.asarray(values)
    except ValueError:  # ragged
        return values
    if made.dtype.kind != "O" and made.dtype.kind not in "US":
        return values
    for k, value in enumerate(made.ravel()):
        if value is not None and real(value) is None:
            raise InputError(f"{where} holds {shown(value)} at sample {k + 1}, which is no number.")
    return [np.nan if value is None else value for value in made.ravel()]


def _seconds(values: Any) -> np.ndarray:
    """Instants as seconds from the first of them, durations in seconds; nan where there is none."""
    if not hasattr(values, "dtype"):
        return np.array([(value - values[0]).total_seconds() for value in values])
    kind = "datetime64[ns]" if values.dtype.kind == "M" else "timedelta64[ns]"
    if hasattr(values, "to_numpy"):
        values = values.to_numpy(dtype=kind)  # one with a time zone, too
    stamps = np.asarray(values).astype(kind)
    if values.dtype.kind == "M":
        known = stamps[~np.isnat(stamps)]
        stamps = stamps - (known[0] if known.size else stamps[:1])
    return stamps / np.timedelta64(1, "s")
