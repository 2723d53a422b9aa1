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

from ...blocks.block import Block
from ...engine.codegen.python_source import Emitter, indent
from ...engine.expression.graph import Graph, sharp
from ...engine.runtime.backend import compiler, load
from ...engine.runtime.c_compiler import has_wide

FINEST = 0.25  # rad of the load's own oscillation in one step

# the loads are innermost: a processor computes one while it waits for another. Products and sums
# are rounded one by one: a load in a gap is chaotic, and a machine must not decide on its values
_LOOP = """
@fast
def run(v, dt, steps, first, p, load_at, twist_at, out):
    h = dt / steps
    for s in range(len(load_at)):
        load_at[s] = v[0]
        twist_at[s] = 0.0
    for k in range(len(v)):
        w = v[k]
        for s in range(len(load_at)):
            out[k, first + s] = 0.0
        for j in range(steps):
            for s in range(len(load_at)):
{values}
                w_load = load_at[s]
                twist = twist_at[s] + 0.5 * h * (w - w_load)
{body}
                out[k, first + s] = out[k, first + s] + ({torque}) / steps
                w_load = w_load + h * ({rate})
                load_at[s] = w_load
                twist_at[s] = twist + 0.5 * h * (w - w_load)
"""
_LANES = """
def run(v, dt, steps, first, p, w_load, twist, out):
    h = dt / steps
    half = 0.5 * h
    {names}, = p
    w_load = np.full(p.shape[1], v[0])
    twist = np.zeros(p.shape[1])
{head}
    for k, w in enumerate(v.tolist()):
        total = 0.0
        for j in range(steps):
            twist = twist + half * (w - w_load)
{body}
            total = total + {torque}
            w_load = w_load + h * ({rate})
            twist = twist + half * (w - w_load)
        out[k] = total / steps
"""


def torques(
    block: Block, path: np.ndarray, dt: float, sets: Sequence[Mapping[str, float]]
) -> np.ndarray:
    """Torque on the motor of loads with these values, (n, sets), driven by the position path."""
    ringing = np.sqrt([one["stiffness"] / one["load_inertia"] for one in sets])
    steps = (ringing * dt / FINEST).astype(np.int64) + 1
    v = np.diff(path, append=path[-1]) / dt
    made_by = _made_by()
    if made_by == "numpy":  # a loop in Python takes as long for all as for one
        steps[:] = steps.max()
    order = np.argsort(steps, kind="stable")
    known = {k: own.value for k, own in block.parameters.items()}
    p = np.array([[float((known | sets[i])[k]) for i in order] for k in known])
    without = frozenset(k for k, values in zip(known, p, strict=True) if not values.any())
    smooth = frozenset(k for k, own in block.parameters.items() if own.smooths)
    run = _compiled(block.function, tuple(known), without, smooth, made_by)
    out = np.empty((len(v), len(sets)))
    first = 0
    for many, lanes in zip(*np.unique(steps, return_counts=True), strict=True):
        some, room = np.ascontiguousarray(p[:, first : first + lanes]), np.empty((2, lanes))
        run(v, float(dt), int(many), first, some, room[0], room[1], out)
        first += int(lanes)
    return out if np.all(np.diff(order) > 0) else out[:, np.argsort(order)]


def of_unit_load(
    frequency: float, damping: float, gap: float | None = None, slowing: float = 0.0
) -> dict[str, float]:
    """The values of a load of 1 kg m2 with that frequency (Hz), damping ratio and gap (rad), which
    its own friction slows by ``slowing`` (rad/s2)."""
    omega = 2 * np.pi * frequency
    values = {"load_inertia": 1.0, "stiffness": omega**2, "damping": 2 * damping * omega}
    values |= {"load_friction": slowing} if slowing else {}
    return values if gap is None else values | {"gap": gap}


def _made_by() -> str:
    """What computes the loop: "even" (C, several loads at once), "c", "numba", else "numpy"."""
    made_by = compiler() or "numpy"
    return "even" if made_by == "c" and has_wide() else made_by


@cache
def _compiled(
    function: Callable[..., Any],
    keys: tuple[str, ...],
    without: frozenset[str],
    smooth: frozenset[str],
    made_by: str,
) -> Any:
    """The loop of a load, without the terms of parameters that are 0 in all sets, and with a sign
    where others only smooth it."""
    graph = Graph()
    signals = [graph.symbol(name) for name in ("w", "twist", "w_load")]
    values = {k: graph.constant(0.0) if k in without else graph.symbol(k) for k in keys}
    torque, _, rate = function(*signals, **values)
    torque, rate = sharp([torque, rate], [values[k] for k in smooth])
    emitter = Emitter({"numpy": "array", "even": "wide"}.get(made_by, "scalar"), fixed=keys)
    torque, rate = emitter.write([torque, rate])
    code = {"torque": torque, "rate": rate}
    if made_by == "numpy":
        head, body = indent(emitter.head, 1), indent(emitter.body, 3)
        return load(_LANES.format(names=", ".join(keys), head=head, body=body, **code), made_by).run
    own = [f"{k} = p[{i}, s]" for i, k in enumerate(keys)]
    body = indent(emitter.body, 4)
    values_read = indent([*own, *emitter.head], 4)
    return load(_LOOP.format(values=values_read, body=body, **code), made_by).run
