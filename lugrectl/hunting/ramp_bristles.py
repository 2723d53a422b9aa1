"""Stick-slip under the reference r = v t of a drive whose friction has states, by simulation."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import control as ct
import numpy as np

from ..blocks import controllers
from ..blocks.model import Model
from ..blocks.plant import plant
from ..simulation.response import simulate
from .lanes import Loop
from .ramp_map import errors
from .simulated import quietly

PERIODS, STICKS, WAITS = 20.0, 15.0, 3.0  # 2 pi/wn, Fs/(kp v) and kp/ki that a part of a run lasts
PARTS, POINTS = 8, 3000  # parts of a run, at most, and points of a part
STEADY = 0.99  # relative size of the error's swing in a part and the one before: it persists
SLOW, FAST = 0.1, 0.5  # of v: a drive that is slower sticks; one that is always faster slides
STARTS = 8  # errors at breakaway
SHARE = 0.9  # of the torque at breakaway: a stick in which a run begins

Run = Callable[[float, Any], Any]


def ramp_run(model: Model, loop: Loop) -> Run:
    """``run(v, state)``: the state after a stick-slip that persists at v; None: it slides on.

    The loop is that of e = theta - v t, so that nothing in it grows but theta.
    """
    frame = ct.nlsys(
        lambda t, x, u, p: [u[0] - u[1]], lambda t, x, u, p: x, inputs=["w", "v"], outputs=["e"],
        states=["e"], name="frame",
    )  # fmt: skip
    parts = [plant(model), frame, controllers.pid(loop.kp, loop.ki, loop.kd)]
    system = ct.interconnect(
        parts, inputs=["v"], outputs=["w", "e"], check_unused=False, name="loop"
    )

    def run(v: float, state: Any) -> Any:
        span = PERIODS * 2.0 * np.pi / loop.wn + STICKS * loop.curve.Fs / (loop.kp * v)
        span = max(span, WAITS * loop.kp / loop.ki if loop.ki else 0.0)
        t, swing, slowest = np.linspace(0.0, span, POINTS), np.inf, 0.0
        for _ in range(PARTS):
            done = quietly(simulate, system, t, {"v": v}, state)
            w, e = np.asarray(done.outputs)[:, POINTS // 5 :]
            was, swing, slowest = swing, float(np.ptp(e)), float(w.min())
            if slowest > FAST * v:
                return None
            state = np.asarray(done.states)[:, -1]
            state[0] = 0.0  # theta, which nothing reads
            if slowest < SLOW * v and STEADY * was < swing < was / STEADY:
                return state
        return state if slowest < SLOW * v else None

    return run


def candidates(
    model: Model, loop: Loop, run: Run, v: np.ndarray, error: float
) -> Iterator[tuple[float, Any]]:
    """Speeds at which stick-slip persists and its state, from the highest."""
    starts = [_stuck(model, loop, -x * loop.unit) for x in errors(loop, error, STARTS)]
    for speed in v[::-1]:
        found = (run(float(speed), start) for start in starts)
        state = next((s for s in found if s is not None), None)
        if state is not None:
            yield float(speed), state


def followed(run: Run, v: np.ndarray, state: Any) -> list[Any]:
    """Where stick-slip from a state persists, from speed to speed: the state then."""
    made = []
    for speed in v:
        state = run(float(speed), state)
        made.append(state)
        if state is None:
            break
    return made


def _stuck(model: Model, loop: Loop, e: float) -> list[float]:
    """A stick at the error e, or without ki at the torque's, before it breaks away."""
    u = SHARE * loop.curve.Fs
    more = [0.0] * (len(model.friction.block.states) - 1)
    bend = u / float(dict(model.friction.values)["sigma0"] or np.inf)
    own = [e, (u + loop.kp * e) / loop.ki] if loop.ki else [-u / loop.kp, 0.0]
    return [0.0, 0.0, bend, *more, *own]
