"""What the model declares already: columns of the base, the torque that reaches the drive.

The strength of a declared effect is free. What else it has is as declared.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from ...blocks.block import Block
from ...blocks.model import Part
from ..regression.smooth_motion import Motion
from .driven_load import torques
from .friction_terms import Law

TURNING = "gravity"


def applied(parts: Sequence[Part], m: Motion) -> np.ndarray:
    """The torque behind the declared effects on the input, (n,); an open one passes it."""
    u = m.u
    for part in parts:
        passes = None in part.values.values() or (part.block.states and part.block.exact is None)
        if "input" in part.block.acts and not passes:
            u = through(part.block, _values(part), u, m)
    return u


def through(block: Block, values: Mapping[str, float], u: np.ndarray, m: Motion) -> np.ndarray:
    """A torque behind an effect on the input, stretch by stretch."""
    exact = block.exact
    if exact is not None:
        return np.concatenate([exact(u[p], m.dt, **values) for p in m.pieces])
    signals = {"u": u, "theta": m.theta, "w": m.w, "t": m.t}
    return np.asarray(block(*(signals[name] for name in block.reads), **values)[0])


def terms(parts: Sequence[Part], law: Law, m: Motion, load: np.ndarray) -> list[np.ndarray]:
    """Columns (n,) of the declared torques and changes of friction, for a strength of 1."""
    made = []
    for part in parts:
        block = part.block
        if block.name == TURNING or not _known(part) or {"input", "sensor"} & set(block.acts):
            continue
        if block.states:
            made += _driven(part, m)
            continue
        values = {k: v for k, v in _values(part).items() if k != block.gain}
        made.append(_one(block, {**values, block.gain: 1.0}, law, m, load))
    return made


def _one(
    block: Block, values: Mapping[str, float], law: Law, m: Motion, load: np.ndarray
) -> np.ndarray:
    signals = {"t": m.t, "theta": m.theta, "w": m.w, "load": load}
    shared = {"J": 1.0} if "J" in block.parameters else {}
    out = block(*(signals[name] for name in block.reads), **shared, **values)
    total = np.zeros(len(m))
    for act, change in block.deeds(out):
        weight = {"torque": 1.0, "Fc": law.z, "+Fc": law.z, "Fv": m.w, "J": m.a}.get(act)
        total = total if weight is None else total + change * weight
    return total


def _driven(part: Part, m: Motion) -> list[np.ndarray]:
    """A declared load behind a spring or a gap."""
    v = _values(part)
    if v.get("load_inertia", 0.0) <= 0.0 or v.get("stiffness", 0.0) <= 0.0:
        return []
    return [torques(part.block, m.path, m.dt, [v])[:, 0]]


def _values(part: Part) -> dict[str, float]:
    return {k: float(v) for k, v in part.values.items() if v is not None}


def _known(part: Part) -> bool:
    """Whether all but its strength has a value."""
    return all(v is not None for k, v in part.values.items() if k != part.block.gain)
