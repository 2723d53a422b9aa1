"""A load behind a spring or a gap along the measured motion: the block's own function, in a loop.

The measured position drives the load, whatever the torque was. Each sample is cut into steps of
at most a quarter of a radian of the load's own oscillation; the stretch of the spring is taken in
the middle of a step (a leapfrog, of second order).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cache
from typing import Any

import numpy as np

from ...engine.emit import Emitter, indent
from ...engine.graph import Graph
from ...engine.load import compiler, load
from ...spec import Block

FINEST = 0.25  # rad of the load's own oscillation in one step

_LOOP = """
@fast
def run(v, dt, steps, p, out):
    for s in range(len(p)):
{values}
        h = dt / steps[s]
        w = v[0]
        w_load = v[0]
        twist = 0.0
        for k in range(len(v)):
            w = v[k]
            total = 0.0
            for j in range(steps[s]):
                twist = twist + 0.5 * h * (w - w_load)
{body}
                total = total + {torque}
                w_load = w_load + h * ({rate})
                twist = twist + 0.5 * h * (w - w_load)
            out[s, k] = total / steps[s]
"""
_LANES = """
def run(v, dt, steps, p, out):
    most = int(max(steps))
    h = dt / most
    {names}, = p.T
    w_load = np.full(len(p), v[0])
    twist = np.zeros(len(p))
    for k in range(len(v)):
        w = v[k]
        total = np.zeros(len(p))
        for j in range(most):
            twist = twist + 0.5 * h * (w - w_load)
{body}
            total = total + {torque}
            w_load = w_load + h * ({rate})
            twist = twist + 0.5 * h * (w - w_load)
        out[:, k] = total / most
"""


def torques(
    block: Block, path: np.ndarray, dt: float, sets: Sequence[Mapping[str, float]]
) -> np.ndarray:
    """Torque on the motor of loads with these values, (sets, n), driven by the position path."""
    keys = list(block.parameters)
    p = np.array([[float(one[k]) for k in keys] for one in sets])
    ringing = np.sqrt([one["stiffness"] / one["load_inertia"] for one in sets])
    steps = (ringing * dt / FINEST).astype(np.int64) + 1
    v = np.diff(path, append=path[-1]) / dt
    out = np.empty((len(sets), len(path)))
    _loop(block)(v, float(dt), steps, p, out)
    return out


def of_unit_load(frequency: float, damping: float, gap: float | None = None) -> dict[str, float]:
    """The values of a load of 1 kg m2 with that frequency (Hz), damping ratio and gap (rad)."""
    omega = 2 * np.pi * frequency
    values = {"load_inertia": 1.0, "stiffness": omega**2, "damping": 2 * damping * omega}
    return values if gap is None else values | {"gap": gap}


def _loop(block: Block) -> Callable[..., Any]:
    return _compiled(block.function, tuple(block.parameters), compiler())


@cache
def _compiled(function: Callable[..., Any], keys: tuple[str, ...], made_by: str | None) -> Any:
    graph = Graph()
    signals = [graph.symbol(name) for name in ("w", "twist", "w_load")]
    values = {k: graph.symbol(k) for k in keys}
    torque, _, rate = function(*signals, **values)
    emitter = Emitter("scalar" if made_by else "array", fixed=keys)
    torque, rate = emitter.write([torque, rate])
    if made_by:
        own = [f"{k} = p[s, {i}]" for i, k in enumerate(keys)]
        head = indent([*own, *emitter.head], 2)
        text = _LOOP.format(values=head, body=indent(emitter.body, 4), torque=torque, rate=rate)
        return load(text, made_by).run
    body = indent([*emitter.head, *emitter.body], 3)
    text = _LANES.format(names=", ".join(keys), body=body, torque=torque, rate=rate)
    return load(text, "numpy").run
