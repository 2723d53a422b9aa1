"""Tables of parameters in several common forms."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..core.errors import InputError

_FORMS = "a dict of columns, a list of dicts, a structured array or a DataFrame"


def columns(table: Any) -> dict[str, np.ndarray]:
    """Name -> (L,) array, or a 0-d array for a value that all members share.

    Raises
    ------
    InputError
        For another form, text in a column, lengths that differ, a member without one of the
        parameters.
    """
    raw = _raw(table)
    found = {str(name): _numbers(str(name), values) for name, values in raw.items()}
    lengths = {name: len(values) for name, values in found.items() if values.ndim}
    if len(set(lengths.values())) > 1:
        said = ", ".join(f"{name} {length}" for name, length in lengths.items())
        raise InputError(f"the columns of params differ in length: {said}.")
    return found


def _raw(table: Any) -> Mapping[Any, Any]:
    if table is None:
        return {}
    if isinstance(table, Mapping):
        return table
    if isinstance(table, np.ndarray):
        if table.dtype.names is None:
            raise InputError(f"params is an array without names; give {_FORMS}.")
        return {name: table[name] for name in table.dtype.names}
    if hasattr(table, "columns_of"):  # the members of a result
        return table.columns_of("plant")
    if hasattr(table, "columns") and hasattr(table, "to_numpy"):
        return {name: table[name].to_numpy() for name in table.columns}
    if isinstance(table, Sequence) and all(isinstance(row, Mapping) for row in table):
        return _by_column(table)
    raise InputError(f"params is a {type(table).__name__}; give {_FORMS}.")


def _by_column(rows: Sequence[Mapping[Any, Any]]) -> dict[Any, list[Any]]:
    if not rows:
        raise InputError("params is an empty list: there is nothing to simulate.")
    for i, row in enumerate(rows):
        odd = set(row) ^ set(rows[0])
        if odd:
            raise InputError(
                f"params: members 0 and {i} do not have the same parameters; "
                f"one does not have '{sorted(map(str, odd))[0]}'."
            )
    return {name: [row[name] for row in rows] for name in rows[0]}


def _numbers(name: str, values: Any) -> np.ndarray:
    try:
        numbers = np.asarray(values)
        if numbers.dtype.kind not in "biufO":
            raise TypeError
        numbers = numbers.astype(float)
    except (TypeError, ValueError):
        raise InputError(f"params: column '{name}' holds a value that is not a number.") from None
    if numbers.ndim > 1:
        raise InputError(
            f"params: column '{name}' has the shape {numbers.shape}; give one value "
            "for each member."
        )
    return numbers


def members(lengths: Mapping[str, int]) -> int:
    """The number of members, which all ``lengths`` must agree on; 1 if there are none."""
    if len(set(lengths.values())) > 1:
        said = ", ".join(f"{what} {length}" for what, length in lengths.items())
        raise InputError(f"the number of members is not clear: {said}.")
    count = next(iter(lengths.values()), 1)
    if not count:
        raise InputError("the sweep has no members: there is nothing to simulate.")
    return count
