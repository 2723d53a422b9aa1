"""What a drive's log keeps of a run."""

from __future__ import annotations

import numpy as np
from scipy.signal import lfilter

from .machine import Machine
from .plant import RATE


def record(m: Machine, g: np.random.Generator, run: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """``t``, ``u``, ``theta`` and, where the drive has one, ``w``: every k-th sample."""
    keep = slice(m.every - 1, None, m.every)
    out = {"t": run["t"][keep] - run["t"][keep][0], "u": _torque(m, g, run)[keep]}
    out["theta"] = run["seen"][keep].copy()
    if m.w != "none":
        out["w"] = run["heard"][keep].copy()
    if g.random() < 0.15:  # stamps of a busy computer
        dt = m.every / RATE
        out["t"] = out["t"] + dt * g.uniform(0.03, 0.15) * np.clip(
            g.standard_normal(len(out["t"])), -3, 3
        )
    if g.random() < 0.1:
        name = str(g.choice([k for k in out if k != "t"]))
        for i in g.integers(50, len(out["t"]) - 50, int(g.integers(1, 4))):
            out[name][i] += g.choice([-1, 1]) * g.uniform(2, 6) * np.ptp(out[name])
    return out


def _torque(m: Machine, g: np.random.Generator, run) -> np.ndarray:
    u = run["command"]
    if m.u == "command":
        return u.copy()
    if m.u == "mean":  # of the interval that ends at the stamp
        return lfilter(np.ones(m.every) / m.every, [1.0], u)
    noise, step, lag = m.current
    keep = np.exp(-1 / (RATE * lag))
    late = lfilter([1 - keep], [1, -keep], u)
    return np.round((late + noise * g.standard_normal(len(u))) / step) * step
