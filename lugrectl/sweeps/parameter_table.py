"""Tables of parameters in several common forms."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..core.errors import InputError

_FORMS = "a dict of columns, a list of dicts, a structured array or a DataFrame"


def columns(table: Any) -> dict[str, np.ndarray]:
    """Name -> (L,) array, or a 0-d array for a value that all members share.

    InputError for another form, text in a column, lengths that differ, a member without one of the
    parameters.
    """
    found = {str(name): _numbers(str(name), values) for name, values in _raw(table).items()}
    lengths = {name: len(values) for name, values in found.items() if values.ndim}
    if len(set(lengths.values())) > 1:
        raise InputError(f"the columns of params differ in length: {_listed(lengths)}.")
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
    if not isinstance(table, Sequence) or not all(isinstance(row, Mapping) for row in table):
        raise InputError(f"params is a {type(table).__name__}; give {_FORMS}.")
    if not table:
        raise InputError("params is an empty list: there is nothing to simulate.")
    for i, row in enumerate(table):
        odd = set(row) ^ set(table[0])
        if odd:
            raise InputError(
                f"params: members 0 and {i} do not have the same parameters; "
                f"one does not have '{sorted(map(str, odd))[0]}'."
            )
    return {name: [row[name] for row in table] for name in table[0]}


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
        raise InputError(f"the number of members is not clear: {_listed(lengths)}.")
    count = next(iter(lengths.values()), 1)
    if not count:
        raise InputError("the sweep has no members: there is nothing to simulate.")
    return count


def _listed(lengths: Mapping[str, int]) -> str:
    return ", ".join(f"{what} {length}" for what, length in lengths.items())
