"""Every effect of the catalogue as columns: its own function along the measured motion.

An effect is linear in its strength, and in a phase after A f(x, phi) = A cos(phi) f(x, 0) +
A sin(phi) f(x, pi/2). What else it has is searched.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ...spec import Block
from .base import Base, Columns

OFF = 1e-9  # of the travel


def searched(block: Block) -> list[str]:
    """The parameters in which the effect is not linear."""
    return [
        k for k, p in block.own.items() if k != block.gain and p.fitted and p.span is None
    ]


def spanned(block: Block) -> str | None:
    """The phase or the rest, if it has one: two columns give any value of it."""
    return next((k for k, p in block.own.items() if p.span is not None), None)


def columns(base: Base, block: Block, values: Mapping[str, float]) -> Columns:
    """The columns of an effect for a strength of 1, with the bounds of its strength."""
    p, free = block.own[block.gain], spanned(block)
    one = {**values, block.gain: 1.0}
    if free is None:
        return Columns.free(column(base, block, one)[:, None], p.low, p.high)
    span = block.own[free].span
    assert span is not None
    if block.own[free].angle:  # an amplitude with a phase may have either sign
        both = [column(base, block, {**one, free: x}) for x in span]
        return Columns.free(np.column_stack(both))
    middle = float(np.mean(base.record.motion.theta))
    first = column(base, block, {**one, free: middle})
    second = column(base, block, {**one, free: middle + 1.0}) - first
    made = Columns.free(np.column_stack([first, second]))
    made.low[0], made.high[0] = p.low, p.high
    return made


def column(base: Base, block: Block, values: Mapping[str, float]) -> np.ndarray:
    """The torque of an effect in the windows (m,), on the resisting side."""
    m, record = base.record.motion, base.record
    out = outputs(base, block, values)
    if "sensor" in block.acts:  # the true motion is the measured one without the error
        error = out[block.fresh.index("theta_m")] - m.theta
        from .motion import bend

        bent = np.concatenate([bend(error[p], m.dt) for p in m.pieces])
        return -base.J * (record.rows.narrow @ bent)
    torque, inertial = np.zeros(len(m)), np.zeros(len(m))
    seen: set[int] = set()
    for act, change in block.deeds(out):
        if act == "input":
            torque = torque + base.u - change
        elif act == "torque":
            torque = torque + change
        elif act == "J":
            inertial = inertial + base.J * change * record.acceleration
        elif act == "Fv":
            torque = torque + change * base.viscous
        elif id(change) not in seen:  # the levels of Coulomb and static friction move together
            seen.add(id(change))
            torque = torque + _on_level(base, block, act, change)
    made = record.mean(torque) if np.any(torque) else np.zeros(len(record.rows))
    return made + record.rows.narrow @ inertial if np.any(inertial) else made


def _on_level(base: Base, block: Block, act: str, change: np.ndarray) -> np.ndarray:
    if act.startswith("+"):
        return change * base.law.z
    if block.abrupt:  # it jumps with the direction, and the bristle follows
        return base.record.laws.asymmetric(base.law.x0) * base.level
    return change * base.coulomb


def outputs(base: Base, block: Block, values: Mapping[str, float]) -> list[Any]:
    """What a block without states puts out along the motion, each (n,)."""
    m = base.record.motion
    signals = {"t": m.t, "theta": m.theta, "w": m.w, "u": base.u, "load": base.weight}
    names = ("t", *block.inputs) if block.timed else block.inputs
    shared = {k: base.J for k, p in block.parameters.items() if p.shared and k == "J"}
    made = block(*(signals[name] for name in names), **shared, **values)
    kept: dict[int, np.ndarray] = {}
    for o in made:
        kept.setdefault(id(o), np.broadcast_to(np.asarray(o, float), len(m)))
    return [kept[id(o)] for o in made]
