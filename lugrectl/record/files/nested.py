"""Columns out of nested content: structs, dicts, lists of dicts, matrices, structured arrays."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from ..columns.table import heads
from .text import is_stamp, seconds

_MOST = 200  # columns of one matrix
_DEPTH = 12
_SHORT = 0.01  # of the longest column; shorter ones are parameters, no samples
Column = tuple[str, str, str | None, np.ndarray]  # name, plain name, unit, values


def columns_of(content: Any) -> list[Column]:
    """The 1-D columns of nested content: ``rec.x[2]`` is column 2 of the matrix x in rec."""
    found = list(_flat("", content, "", _DEPTH))
    longest = max((len(values) for *_, values in found), default=0)
    made = []
    for path, label, values in found:
        if len(values) <= max(1, _SHORT * longest):
            continue
        (name, _, unit), (_, plain, other) = heads([path, label or heads([path])[0][0]])
        if values.dtype.kind in "US":
            made.append((name, plain, "s", seconds(list(values))))
        else:
            made.append((name, plain, unit or other, values))
    return made


def _flat(name: str, value: Any, label: str, depth: int) -> Iterator[tuple[str, str, np.ndarray]]:
    """(name, label, values) of each column below a value."""
    if depth == 0 or value is None:
        return
    if getattr(getattr(value, "dtype", None), "kind", "") == "O":
        value = list(np.ravel(value))
    if isinstance(value, dict):
        yield from _of_dict(name, value, depth)
    elif isinstance(value, (list, tuple)):
        yield from _of_list(name, value, label, depth)
    elif names := (array := np.asarray(value)).dtype.names:
        for field in names:
            yield from _flat(_below(name, field), array[field], "", depth - 1)
    else:
        yield from _of_array(name, array, label)


def _below(name: str, field: Any) -> str:
    return f"{name}.{field}" if name else str(field)


def _of_dict(name: str, value: dict[Any, Any], depth: int) -> Iterator[Any]:
    columns, data = value.get("columns"), value.get("data")
    if isinstance(columns, list) and isinstance(data, list) and data:  # pandas, orient="split"
        rows = [row for row in data if isinstance(row, list) and len(row) == len(columns)]
        for i, column in enumerate(columns):
            yield from _flat(_below(name, column), [row[i] for row in rows], "", depth - 1)
        return
    keys = [str(key) for key in value]
    if len(keys) > 20 and all(key.isdecimal() for key in keys):  # pandas, orient="columns"
        yield from _flat(name, list(value.values()), "", depth - 1)
        return
    label = value.get("label", value.get("Name", ""))
    for key, inner in value.items():
        if not str(key).startswith("__"):
            named = label if isinstance(label, str) and str(key) in ("values", "Data") else ""
            yield from _flat(_below(name, key), inner, named, depth - 1)


def _of_list(name: str, value: Sequence[Any], label: str, depth: int) -> Iterator[Any]:
    if not len(value):
        return
    structs = all(isinstance(item, dict) for item in value)
    if structs and len(value) >= 20:  # a dict for each sample
        rows = [_one_row(item) for item in value]
        for key in rows[0]:
            yield from _flat(_below(name, key), [row.get(key) for row in rows], "", 1)
        return
    if all(isinstance(item, str) or item is None for item in value):
        if sum(is_stamp(item or "") for item in value) > len(value) / 2:
            yield name, label or "time", np.array([item or "" for item in value])
        return
    if any(isinstance(item, (str, bytes)) for item in value):
        return
    try:
        made = np.array([np.nan if item is None else item for item in value])
    except (ValueError, TypeError):  # of unequal lengths: arrays of their own
        structs, made = len(value) < 20, np.empty(0, dtype=object)
    for i, item in enumerate(value) if structs else ():
        yield from _flat(f"{name}[{i + 1}]", item, "", depth - 1)
    if made.dtype != object:
        yield from _of_array(name, made, label)


def _one_row(item: dict[Any, Any], prefix: str = "") -> dict[str, Any]:
    """The numbers of one sample by dotted name, those of a list by index from 1."""
    row: dict[str, Any] = {}
    for key, value in item.items():
        if isinstance(value, dict):
            row |= _one_row(value, f"{prefix}{key}.")
        elif isinstance(value, list):
            row |= {f"{prefix}{key}[{i + 1}]": v for i, v in enumerate(value)}
        else:
            row[f"{prefix}{key}"] = value
    return row


def _of_array(name: str, array: np.ndarray, label: str) -> Iterator[tuple[str, str, np.ndarray]]:
    if array.dtype.kind == "M":
        array = (array - array.ravel()[:1]).astype("timedelta64[ns]") / np.timedelta64(1, "s")
        label = label or "time"
    array = np.squeeze(array)
    if array.dtype.kind not in "fiub":
        return
    if array.ndim == 1:
        yield name, label, array
    if array.ndim != 2 or min(array.shape) > _MOST or max(array.shape) < 20:
        return
    if array.shape[0] < array.shape[1]:
        array = array.T
    labels = [part.strip() for part in label.split(",")]
    for i in range(array.shape[1]):
        named = labels[i] if len(labels) == array.shape[1] else ""
        yield (f"{name}[{i + 1}]" if name else str(i + 1)), named, array[:, i]
