"""The least error on a record: that of the rig's own plant, from the state the machine truly had.

It runs over the windows of the diagnosis under the torque as recorded and shares nothing with the
package. No estimate of the state can reach it, for position only by far.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..drives.record import Case
from ..drives.run import replay


def floor(case: Case, records: Sequence[Any], found: Any) -> float | None:
    """RMS error of the rig's own plant over the windows on which the package was judged."""
    if found.traces is None or found.error is None:
        return None
    signal, horizon = found.error["signal"], found.error["horizon"]
    total, count = 0.0, 0
    for run, (t, held_out) in zip((case, *case.more), stretches(records, found), strict=True):
        starts = restarts(t, held_out, horizon)
        if not len(starts):
            continue
        e = _missed(run, signal, starts, horizon)
        total, count = total + float(e @ e), count + len(e)
    return float(np.sqrt(total / count)) if count else None


def stretches(records: Sequence[Any], found: Any) -> list[tuple[np.ndarray, np.ndarray]]:
    """Times and held-out flags of each record, cut from the diagnosis' traces."""
    edges = np.cumsum([0, *(r.samples for r in records)])
    held_out = np.zeros(edges[-1], dtype=bool)
    seen = found.traces.held_out[: edges[-1]]
    held_out[: len(seen)] = seen
    return [(r.t, held_out[a:b]) for r, a, b in zip(records, edges[:-1], edges[1:], strict=True)]


def restarts(t: np.ndarray, held_out: np.ndarray, horizon: float) -> np.ndarray:
    """Times at which a window of the horizon starts within the held-out stretches."""
    dt = float(np.median(np.diff(t)))
    span = max(1, round(horizon / dt))
    flags = np.flatnonzero(np.diff(np.concatenate([[0], held_out.astype(int), [0]])))
    made = []
    for a, b in zip(flags[::2], flags[1::2], strict=True):
        made += [t[i] for i in range(a, b - span + 1, span)]
    return np.array(made)


def _missed(run: Case, signal: str, starts: np.ndarray, horizon: float) -> np.ndarray:
    """Recorded minus simulated, at the recorded samples inside the windows."""
    done, c = run.hidden, run.columns
    every, half = done.t, 0.5 / done.setup.rate
    kept = np.searchsorted(every, c["t"] - 1e-9)
    torque = done.signals["u"].copy()
    offset = run.truth.get("nuisance", {}).get("offset", 0.0)
    zero = run.truth.get("nuisance", {}).get("zero", 0.0)
    torque[kept] = c["u"] - offset
    restart = np.zeros(len(every), dtype=bool)
    restart[np.minimum(np.searchsorted(every, starts - half), len(every) - 1)] = True
    theta, w = replay(done, torque, restart)
    at = np.searchsorted(starts, every + half, side="right") - 1
    inside = (at >= 0) & (every + half < starts[np.maximum(at, 0)] + horizon)
    inside = inside[kept]
    simulated = {"theta": theta + zero, "w": w}[signal][kept]
    return (c[signal] - simulated)[inside]
