"""Logs as stretches of uniform time for the torque balance: stamps interpolated, no more."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .log import Log
from .samples.clock import FEWEST, multiples, typical_step
from .samples.resampling import on_grid
from .samples.rows import Stamped
from .samples.usable import usable
from .signal_noise import lattice_step


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
    values = {role: rows.channels[role][part] for role in rows.used}
    if len(t) < FEWEST or any(np.isfinite(x).sum() < FEWEST for x in values.values()):
        return None
    dt = typical_step(np.diff(t))
    steps = max(round((t[-1] - t[0]) / dt), 1)
    grid, dt = np.linspace(t[0], t[-1], steps + 1), float(t[-1] - t[0]) / steps
    made, near = {}, []
    ticks = np.r_[0, np.cumsum(multiples(np.diff(t), dt))]
    for role, x in values.items():
        good = np.isfinite(x)
        made[role] = on_grid(role, t[good], x[good], grid, dt)
        near.append(_near(grid, t[good], ticks[good], dt))
    ok = np.all(near, axis=0)
    sound = np.flatnonzero(ok)
    if not len(sound):
        return None
    used = slice(int(sound[0]), int(sound[-1]) + 1)
    cut = {role: x[used] for role, x in made.items()}
    theta, w = cut.get("theta"), cut.get("w")
    raw = values.get("theta")  # between the stamps theta is on no count any more
    return Stretch(
        run, dt, grid[used], cut["u"], theta, w, ok[used], cut.get("d"),
        0.0 if raw is None else lattice_step(raw[np.isfinite(raw)]),
    )  # fmt: skip


def _near(grid: np.ndarray, t: np.ndarray, ticks: np.ndarray, dt: float) -> np.ndarray:
    """Whether each instant lies between good samples, with at most one missing.

    ``ticks`` are those of the clock at the good samples: rows that a logger writes in bursts come
    at long and at short steps, and none of them is missing.
    """
    after = np.searchsorted(t, grid - 1e-6 * dt)
    inside = (after < len(t)) & (grid > t[0] - 1e-6 * dt)
    after = after.clip(0, len(t) - 1)
    before = (after - (t[after] > grid + 1e-6 * dt)).clip(0)
    return inside & (ticks[after] - ticks[before] <= 2)


@dataclass(frozen=True, eq=False)
class Stretch:
    """Uniform time, nothing filtered: at most the stamps are interpolated.

    ``run`` is the index of the log that it comes from, ``dt`` the step in s. ``t`` (s), ``u``
    (N m or N), ``theta`` (rad or m) and ``w`` (rad/s or m/s) are (M,), theta and w None where
    not recorded, ``d`` (M,) the measured load torque. ``ok`` (M,) is False where a sample is
    missing, bad or bridged over more than a sample. ``count`` is the step of the encoder, rad; 0
    where there is none to see.
    """

    run: int
    dt: float
    t: np.ndarray
    u: np.ndarray
    theta: np.ndarray | None
    w: np.ndarray | None
    ok: np.ndarray
    d: np.ndarray | None = None
    count: float = 0.0
