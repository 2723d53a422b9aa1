"""How much of an effect a refit of the declared structure cannot take over."""

from __future__ import annotations

import numpy as np

from .bench import Run
from .machines import NO_LOAD


def visible(run: Run) -> float:
    """RMS of the effect torque without what J, the friction levels and a declared load explain."""
    s, m = run.signals, run.setup.machine
    w, angle = s["w_true"], s["theta_true"]
    way = np.tanh(w / (0.1 * m.vs))
    slow = np.exp(-np.minimum((w / m.vs) ** 2, 50.0))
    shapes = [np.gradient(w, run.t), w, way, way * slow, np.clip(s["z"] * m.sigma0, -m.Fs, m.Fs)]
    if m.load[0] != NO_LOAD:
        shapes += [np.sin(angle), np.cos(angle)] if m.rotary else [np.ones_like(w)]
    A = np.column_stack([x / max(float(np.sqrt(np.mean(x**2))), 1e-12) for x in shapes])
    left = s["effect"] - A @ np.linalg.lstsq(A, s["effect"], rcond=None)[0]
    return float(np.sqrt(np.mean(left**2)))
