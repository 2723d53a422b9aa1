"""Times, inputs and initial states in the forms that a user may give."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .errors import InputError


def times(t: ArrayLike) -> np.ndarray:
    """The times as an array; InputError if they do not increase."""
    grid = np.array(t, dtype=float)
    if grid.ndim != 1 or not len(grid) or not np.all(np.isfinite(grid)):
        raise InputError("t must be a list of finite times.")
    back = np.flatnonzero(np.diff(grid) <= 0)
    if len(back):
        k = int(back[0])
        raise InputError(f"t must increase; after {grid[k]:g} s comes {grid[k + 1]:g} s.")
    return grid


def inputs(name: str, labels: Sequence[str], t: np.ndarray, given: Any) -> np.ndarray:
    """The inputs as (m, N), by name or in every form that python-control takes."""
    if isinstance(given, Mapping):
        return by_name(name, labels, t, given)
    rows: Any = 0.0 if given is None else given
    if isinstance(rows, (list, tuple)) and len(rows) != len(t):
        rows = np.vstack([_row(part, len(t)) for part in rows]) if rows else 0.0
    u = np.array(rows, dtype=float)
    count = len(labels)
    if u.ndim == 0:
        u = np.full((count, len(t)), float(u))
    if u.ndim == 1 and count == 1:
        u = u[None]
    if u.shape != (count, len(t)):
        raise InputError(
            f"{name} needs inputs ({', '.join(labels)}) of shape ({count}, {len(t)}), "
            f"not {u.shape}."
        )
    _finite(labels, t, u)
    return u


def by_name(
    name: str, labels: Sequence[str], t: np.ndarray, given: Mapping[str, Any]
) -> np.ndarray:
    """Inputs from a dict, each a number or (N,); 0 if left out."""
    strange = [k for k in given if k not in labels]
    if strange:
        known = ", ".join(labels) or "none"
        raise InputError(f"{name}: there is no external input '{strange[0]}'; known: {known}.")
    u = np.zeros((len(labels), len(t)))
    for row, label in zip(u, labels, strict=True):
        values = np.asarray(given.get(label, 0.0), dtype=float)
        if values.shape not in ((), (len(t),)):
            raise InputError(
                f"input {label} must be a finite number or {len(t)} of them, not {values.shape}."
            )
        row[:] = values
    _finite(labels, t, u)
    return u


def _finite(labels: Sequence[str], t: np.ndarray, u: np.ndarray) -> None:
    bad = np.argwhere(~np.isfinite(u))
    if len(bad):
        i, k = bad[0]
        raise InputError(f"input {labels[i]} is {u[i, k]} at t = {t[k]:.6g} s.")


def _row(part: Any, samples: int) -> np.ndarray:
    row = np.asarray(part, dtype=float)
    if row.ndim == 2 or (row.ndim == 1 and len(row) == samples):
        return np.atleast_2d(row)
    return np.outer(row, np.ones(samples))


def start(name: str, states: int, x0: Any) -> np.ndarray:
    """Initial states: a number for all, or a list (of lists) that is padded with zeros."""
    if np.ndim(x0) == 0 and not isinstance(x0, (list, tuple)):
        return np.full(states, float(x0))
    parts = x0 if isinstance(x0, (list, tuple)) else [x0]
    values = np.concatenate([np.ravel(np.asarray(part, dtype=float)) for part in parts] or [[]])
    if len(values) > states:
        raise InputError(f"{name} has {states} states, x0 has {len(values)}.")
    if not np.all(np.isfinite(values)):
        raise InputError(f"{name}: x0 must be finite.")
    return np.concatenate([values, np.zeros(states - len(values))])
