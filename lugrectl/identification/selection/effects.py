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
from .motion import bend


def searched(block: Block) -> list[str]:
    """The parameters in which the effect is not linear."""
    return [
        k for k, p in block.own.items() if k != block.gain and p.fitted and p.span is None
    ]


def spanned(block: Block) -> str | None:
    """The phase or the rest, if it has one: two columns give any value of it."""
    return next((k for k, p in block.own.items() if p.span is not None), None)


def columns(
    base: Base, block: Block, values: Mapping[str, float], screening: bool = False
) -> Columns:
    """The columns of an effect for a strength of 1, with the bounds of its strength."""
    p, free = block.own[block.gain], spanned(block)
    one = {**values, block.gain: 1.0}
    if free is None:
        return Columns.free(column(base, block, one, screening)[:, None], p.low, p.high)
    span = block.own[free].span
    assert span is not None
    if block.own[free].angle:  # an amplitude with a phase may have either sign
        both = [column(base, block, {**one, free: x}, screening) for x in span]
        return Columns.free(np.column_stack(both))
    middle = float(np.mean(base.record.motion.theta))
    first = column(base, block, {**one, free: middle})
    second = column(base, block, {**one, free: middle + 1.0}) - first
    made = Columns.free(np.column_stack([first, second]))
    made.low[0], made.high[0] = p.low, p.high
    return made


def column(
    base: Base, block: Block, values: Mapping[str, float], screening: bool = False
) -> np.ndarray:
    """The torque of an effect in the windows (m,), on the resisting side.

    ``screening``: from fewer samples.
    """
    m, record = base.record.motion, base.record
    every = slice(None, None, record.fewer if screening else None)
    K, narrow = record.few if screening else (record.rows.K, record.rows.narrow)
    out = outputs(base, block, values, every)
    if "sensor" in block.acts:  # the true motion is the measured one without the error
        error = out[block.fresh.index("theta_m")] - m.theta
        bent = np.concatenate([bend(error[p], m.dt) for p in m.pieces])
        return -base.J * (narrow @ bent)
    torque, inertial = [], []
    seen: set[int] = set()
    for act, change in block.deeds(out):
        if act == "input":
            torque.append(base.u[every] - change)
        elif act == "torque":
            torque.append(change)
        elif act == "J":
            inertial.append(base.J * change * record.acceleration[every])
        elif act == "Fv":
            torque.append(change * base.viscous[every])
        elif id(change) not in seen:  # the levels of Coulomb and static friction move together
            seen.add(id(change))
            torque.append(_on_level(base, block, act, change, every))
    made = K @ sum(torque) if torque else 0.0
    return made + narrow @ sum(inertial) if inertial else np.asarray(made)


def _on_level(base: Base, block: Block, act: str, change: np.ndarray, every: slice) -> np.ndarray:
    if act.startswith("+"):
        return change * base.law.z[every]
    if block.abrupt:  # it jumps with the direction, and the bristle follows
        return base.record.laws.asymmetric(base.law.x0)[every] * base.level[every]
    return change * base.coulomb[every]


def outputs(
    base: Base, block: Block, values: Mapping[str, float], every: slice = slice(None)
) -> list[Any]:
    """What a block without states puts out along the motion, each (n,)."""
    m = base.record.motion
    signals = {"t": m.t, "theta": m.theta, "w": m.w, "u": base.u, "load": base.weight}
    names = ("t", *block.inputs) if block.timed else block.inputs
    shared = {k: base.J for k, p in block.parameters.items() if p.shared and k == "J"}
    made = block(*(signals[name][every] for name in names), **shared, **values)
    size = len(m.t[every])
    kept: dict[int, np.ndarray] = {}
    for o in made:
        kept.setdefault(id(o), np.broadcast_to(np.asarray(o, float), size))
    return [kept[id(o)] for o in made]
