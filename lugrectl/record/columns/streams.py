"""A log of several streams: rows that hold one channel each, on one clock."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..samples.resampling import held_mean

_TOGETHER = 0.5  # share of the rows with motion that hold u, too; below, they are two streams


def merged(
    roles: Sequence[str], columns: Sequence[np.ndarray]
) -> tuple[list[np.ndarray], list[str]]:
    """Columns (N,) by role, on the rows that hold the motion, and a sentence if rows were merged:
    tools that merge topics leave a cell empty where a topic has no message."""
    by = dict(zip(roles, columns, strict=True))
    base = next((role for role in ("theta", "w") if role in by), None)
    if base is None or "t" not in by or "u" not in by:
        return list(columns), []
    t = by["t"]
    stamped = np.isfinite(t)
    rows = np.flatnonzero(np.isfinite(by[base]) & stamped)
    if len(rows) < 2 or np.isfinite(by["u"][rows]).mean() >= _TOGETHER:
        return list(columns), []
    at = np.flatnonzero(np.isfinite(by["u"]) & stamped)
    if len(at) < 2 or np.any(np.diff(t[stamped]) < 0):
        return list(columns), []
    found = {role: x if role in ("t", base) else _on(role, t, x, rows) for role, x in by.items()}
    made = [found[r][rows] if r in ("t", base) else found[r] for r in roles]
    said = (
        f"u and {base} stand in different rows: the {len(rows)} rows of {base} were used, with "
        "the torque held between its own rows."
    )
    return made, [said]


def _on(role: str, t: np.ndarray, x: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """A channel at the times of other rows; nan where its own rows are far away."""
    at = np.flatnonzero(np.isfinite(x) & np.isfinite(t))
    if len(at) < 2:
        return np.full(len(rows), np.nan)
    grid = t[rows]
    dt = float(np.median(np.diff(grid)))
    made = held_mean(t[at], x[at], grid, dt) if role == "u" else np.interp(grid, t[at], x[at])
    step = 1.5 * max(float(np.median(np.diff(t[at]))), dt)
    near = np.searchsorted(t[at], grid, side="right")
    since = grid - t[at][np.maximum(near - 1, 0)]
    made = np.where(near == 0, x[at][0], made)  # before its first message, the value of that
    return np.where((since < step) & (since > -step), made, np.nan)
