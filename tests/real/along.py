"""The torque residual of a declared or diagnosed model along a measured motion.

    residual = J (dw/dt of the model, driven by u along the measured theta and w, minus a)

States of friction and effects follow the motion; each is stepped exactly as if linear in itself.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from lugrectl.blocks.model import Model
from lugrectl.blocks.plant import assemble

from .motion import Run

FINER = 8  # steps for each sample: a load on a spring moves within one
SMALL = 1e-6  # of a state's scale, for its own slope


def residual(model: Model, run: Run) -> np.ndarray:
    """Torque missing from the model at each sample, N m (N,); positive where it drives."""
    delays = [part for part in model.effects if part.block.name == "input_delay"]
    motion = run.motion
    shift = run.hold + sum(float(part.values["delay"] or 0.0) for part in delays)
    rest = replace(model, effects=tuple(p for p in model.effects if p not in delays))
    signals = (motion.t, motion.late(shift), motion.angle(), motion.w)
    fine = np.linspace(0, len(motion.t) - 1, FINER * (len(motion.t) - 1) + 1)
    samples = np.arange(len(motion.t))
    grid = [np.interp(fine, samples, x) for x in signals]
    dw = _acceleration(rest, *grid)[::FINER]
    return float(rest.known()["J"]) * (motion.a - dw)


def _acceleration(
    model: Model, t: np.ndarray, u: np.ndarray, theta: np.ndarray, w: np.ndarray
) -> np.ndarray:
    """dw/dt of the plant at each sample, its other states carried along."""
    block, values = assemble(model), model.known()
    x, dw, dt = _begin(model, u[0], theta[0], w[0]), np.empty(len(t)), t[1] - t[0]

    def rates(k: int, state: np.ndarray) -> np.ndarray:
        """dw/dt and the rates of the states; the outputs F and w come first."""
        made: Any = block(t[k], u[k], 0.0, theta[k], w[k], *state, **values)
        return np.array([float(v) for v in made[2:]])

    for k in range(len(t)):
        dw[k], *slope = rates(k, x)
        slope = np.array(slope)
        x = x + dt * slope * _shares(lambda s, k=k: rates(k, s)[1:], x, slope, dt)
    return dw


def _begin(model: Model, u: float, theta: float, w: float) -> np.ndarray:
    """The states beside theta and w at the first sample, as their blocks say."""
    signals = {"u": u, "theta": theta, "w": w}
    blocks = [model.friction.block, *(part.block for part in model.effects)]
    inside = [block for block in blocks if "sensor" not in block.acts]
    texts = [text for block in inside for text in block.start[: len(block.states)]]
    return np.array([signals[x] if x in signals else float(x) for x in texts])


def _shares(rate: Any, x: np.ndarray, slope: np.ndarray, dt: float) -> np.ndarray:
    """(e^(a dt) - 1) / (a dt) for each state's own slope a: 1 for a state that only adds up."""
    made = np.ones_like(x)
    for i in range(len(x)):
        h = SMALL * (abs(x[i]) + abs(dt * slope[i])) + 1e-12
        moved = x.copy()
        moved[i] += h
        a = min((rate(moved)[i] - slope[i]) / h * dt, 0.0)
        made[i] = np.expm1(a) / a if a < -1e-9 else 1.0
    return made
