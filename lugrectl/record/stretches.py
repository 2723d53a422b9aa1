"""Logs as stretches of uniform time for the torque balance: stamps interpolated, no more."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .clock import FEWEST, typical_step
from .log import Log
from .stamped import Stamped
from .stretch import Stretch
from .usable import usable


def stretches(logs: Sequence[Log]) -> tuple[list[Stretch], list[str]]:
    """The stretches of uniform time in the logs of one drive, and what was noticed, as sentences.

    A stretch ends where rows are lost, where time starts again and where the position jumps.
    """
    found, said = [], []
    for run, log in enumerate(logs):
        rows = usable(log)
        said += [f"{log.source}: {s}" if len(logs) > 1 else s for s in rows.said]
        for part in rows.parts():
            made = _stretch(run, rows, part)
            if made is not None and made.ok.sum() >= FEWEST:
                found.append(made)
    return found, said


def _stretch(run: int, rows: Stamped, part: slice) -> Stretch | None:
    """One part on its own even grid; None without two samples of each channel."""
    t = rows.t[part]
    values = {role: rows.channels[role][part] for role in rows.required}
    if len(t) < FEWEST or any(np.isfinite(x).sum() < FEWEST for x in values.values()):
        return None
    steps = max(round((t[-1] - t[0]) / typical_step(np.diff(t))), 1)
    grid = np.linspace(t[0], t[-1], steps + 1)
    dt = float(t[-1] - t[0]) / steps
    made, ok = {}, np.ones(len(grid), bool)
    for role, x in values.items():
        good = np.isfinite(x)
        made[role] = np.interp(grid, t[good], x[good])
        ok &= _near(grid, t[good], dt)
    return Stretch(run, dt, grid, made["u"], made.get("theta"), made.get("w"), ok)


def _near(grid: np.ndarray, t: np.ndarray, dt: float) -> np.ndarray:
    """Whether each instant lies beside a good sample, with at most one missing."""
    after = np.searchsorted(t, grid - 1e-6 * dt).clip(0, len(t) - 1)
    before = (after - (t[after] > grid + 1e-6 * dt)).clip(0)
    return t[after] - t[before] < 2.5 * dt
