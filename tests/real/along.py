"""The torque residual of the package's models along a measured motion.

Of the balance its terms, each with its coefficient. Of a declared or diagnosed model

    residual = J (dw/dt of the model, driven by u along the measured theta and w, minus a)

States of friction and effects follow the motion; each is stepped exactly as if linear in itself.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from lugrectl.blocks.model import Model, as_model
from lugrectl.blocks.plant import assemble
from lugrectl.identification.balance.estimate import estimate
from lugrectl.identification.balance.problem import Ground, ground_of
from lugrectl.identification.balance.speed_offset import with_offset
from lugrectl.identification.balance.track import Track
from lugrectl.record import Log, stretches

from .motion import Motion, Run

FINER = 8  # steps for each sample: a load on a spring moves within one
SMALL = 1e-6  # of a state's scale, for its own slope


def balanced(logs: Sequence[Log], model: Mapping[str, Any]) -> Callable[[Run], np.ndarray]:
    """The balance of some runs, as a function that gives the residual of others.

    A drift with time is that in the middle of the fitted runs. Without an answer the residual is
    the torque itself.
    """
    ground = ground_of(stretches(logs)[0], as_model(dict(model)), {})
    found = estimate(with_offset(ground)) if isinstance(ground, Ground) else None
    if found is None:
        return lambda run: run.motion.u
    fit, still = found.fit, found.fit.setting.rest

    def missing(run: Run) -> np.ndarray:
        m, track = run.motion, _track(run.motion, still)
        own = {"J": m.a, "Fv": m.w}
        columns = [own[t.key] if t.column is None else t.column(track) for t in fit.terms]
        return m.late(fit.delay + run.hold) - sum(
            p * x for p, x in zip(fit.p, columns, strict=False)
        )

    return missing


def _track(m: Motion, still: float) -> Track:
    zero = np.zeros_like(m.t)
    dt = float(m.t[1] - m.t[0]) if len(m.t) > 1 else 1.0
    return Track(
        0, dt, m.t, m.u, m.angle(), m.w, m.use, zero, m.w, still, stopping=zero, starting=zero
    )


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
