"""Systems that the engine's tests share, wired by hand."""

from __future__ import annotations

from typing import Any

import control as ct
import numpy as np

import lugrectl as lg
from lugrectl.engine.adaptive_run import Accuracy, Course, Engine, Now, Track
from lugrectl.engine.tracer import Net, traced_net

DT = 1e-3


def engine_run(
    system: Any, way: str, t: np.ndarray, x0: Any, u: Any = 0.0, *, rtol: float, hold: bool = False
) -> Track:
    """The track of a system in code of one kind, with its number of steps."""
    engine = Engine(traced_net(Net.of(system)), way)
    course = Course.along(t, np.broadcast_to(u, (system.ninputs, len(t))), 0, hold)
    p = engine.program.arguments(None)
    return engine.run(course, Now.start(x0, [], 0), p, Accuracy(rtol))


def full_model() -> lg.Model:
    """Table 1 with an effect of each kind: input (two states), level on time, torque, sign."""
    return (
        lg.Model.of(lg.table1())
        .with_effect("input_delay", {"delay": 0.003})
        .with_effect("friction_step", {"ratio": 0.3, "time": 0.1})
        .with_effect("gravity", {"amplitude": 0.2, "phase": 0.4})
        .with_effect("viscous_asymmetry", {"ratio": 0.2})
        .with_effect("quadratic_drag", {"coefficient": 0.01})
    )


def pi(kp: float = 1.6, ki: float = 0.16) -> ct.NonlinearIOSystem:
    """u = -kp e - ki q, dq/dt = e."""
    return ct.nlsys(
        lambda t, x, u, p: u[0],
        lambda t, x, u, p: -p["pi.kp"] * u[0] - p["pi.ki"] * x[0],
        inputs="e",
        outputs="u",
        states="q",
        params={"pi.kp": kp, "pi.ki": ki},
        name="pi",
    )


def velocity_loop(plant: ct.NonlinearIOSystem) -> ct.InterconnectedSystem:
    error = ct.summing_junction(["w", "-r"], "e", name="error")
    blocks = [plant, pi(), error]
    return ct.interconnect(
        blocks, inputs="r", outputs=["w", "F", "u"], params={}, check_unused=False, name="loop"
    )


def torque(samples: int, amplitude: float = 0.5) -> np.ndarray:
    t = np.arange(samples) * DT
    wave = np.sin(2 * np.pi * 5 * t) + 0.4 * np.sin(2 * np.pi * 17 * t)
    return np.column_stack([amplitude * wave, np.zeros(samples)])
