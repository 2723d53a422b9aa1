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
    """The stretches of uniform time in the logs of one drive, and what was noticed, as sentences;
    one ends where rows are lost, where time starts again and where the position jumps."""
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
    """One part on its own even grid; None without two samples of each channel. An instant is ``ok``
    between good samples of which at most one is missing."""
    t = rows.t[part]
    used = [*rows.required, *(["d"] if "d" in rows.channels else [])]
    values = {role: rows.channels[role][part] for role in used}
    if len(t) < FEWEST or any(np.isfinite(x).sum() < FEWEST for x in values.values()):
        return None
    dt = typical_step(np.diff(t))
    steps = max(round((t[-1] - t[0]) / dt), 1)
    grid, dt = np.linspace(t[0], t[-1], steps + 1), float(t[-1] - t[0]) / steps
    made, ok = {}, np.ones(len(grid), bool)
    # of the clock: rows that a logger writes in bursts come at long and at short steps
    ticks = np.r_[0, np.cumsum(multiples(np.diff(t), dt))]
    for role, x in values.items():
        good = np.isfinite(x)
        at, tick = t[good], ticks[good]
        made[role] = on_grid(role, at, x[good], grid, dt)
        after = np.searchsorted(at, grid - 1e-6 * dt)
        ok &= (after < len(at)) & (grid > at[0] - 1e-6 * dt)
        after = after.clip(0, len(at) - 1)
        before = (after - (at[after] > grid + 1e-6 * dt)).clip(0)
        ok &= tick[after] - tick[before] <= 2
    sound = np.flatnonzero(ok)
    if not len(sound):
        return None
    cut = slice(int(sound[0]), int(sound[-1]) + 1)
    channels = {role: x[cut] for role, x in made.items()}
    raw = values.get("theta")  # between the stamps theta is on no count any more
    step = 0.0 if raw is None else lattice_step(raw[np.isfinite(raw)])
    return Stretch(run=run, dt=dt, t=grid[cut], ok=ok[cut], count=step, **channels)


@dataclass(frozen=True, eq=False, kw_only=True)
class Stretch:
    """Uniform time, nothing filtered: at most the stamps are interpolated."""

    run: int  # index of the log that it comes from
    dt: float  # s
    t: np.ndarray  # (M,) s
    u: np.ndarray  # N m or N
    theta: np.ndarray | None = None  # rad or m
    w: np.ndarray | None = None  # rad/s or m/s
    ok: np.ndarray  # False where a sample is missing, bad or bridged over more than a sample
    d: np.ndarray | None = None  # measured load torque
    count: float = 0.0  # step of the encoder, rad; 0 where there is none to see
