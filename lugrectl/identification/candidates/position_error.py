"""An error of the position sensor, taken out of the motion itself.

To first order it is two columns along the measured motion. A large one also bends the speed that
friction sees and the place of everything else, so the motion is corrected and all of the base is
made again along it:  theta + error(theta) = theta_m.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...blocks.block import REGISTRY, Block
from ..regression.smooth_motion import Motion
from .base_model import Record
from .candidate import Contender, enter
from .effect_columns import columns, spanned
from .friction_shape import along
from .friction_terms import Laws

TIMES = 4
WITHIN = 6  # fixed-point rounds: an amplitude of 0.5 is then exact to 2 %
LARGEST = 0.6  # rad
WORTH = 20.0  # nats from which the motion is corrected


def corrected(c: Contender) -> Contender:
    """The contender along the motion without the error, where that explains more."""
    block = REGISTRY["effect", c.name]
    free = spanned(block)
    if "theta_m" not in block.fresh or free is None or c.gain < WORTH:
        return c
    place = complex(*c.coefficients)
    for _ in range(TIMES):
        if not abs(place) < LARGEST:
            break
        values = {block.gain: abs(place), free: float(np.angle(place))}
        record = moved(c.base.record, block, values)
        own = along(c.base, record)
        entry = replace(c.entry, values=values, columns=columns(own, block, {}), moved=record)
        again = enter(c.base, entry)
        if not again.gain > c.gain:
            break
        c, place = again, place + complex(*again.coefficients)
    return c


def moved(record: Record, block: Block, values: dict[str, float]) -> Record:
    """The record along the motion without the error of the sensor."""
    m, rows = record.motion, record.rows
    theta = _without(m, m.theta, block, values)
    start = np.concatenate([np.full(p.stop - p.start, _start(m, p)) for p in m.pieces])
    path = _without(m, m.path + start, block, values) - start
    motion = replace(m, theta=theta, path=path, w=m.slope(theta))
    a = rows.narrow @ motion.stiff
    laws = Laws(motion, record.declared, record.laws.rough)
    return replace(record, motion=motion, rows=replace(rows, a=a), laws=laws, _kept={})


def _start(m: Motion, piece: slice) -> float:
    """How far a stretch of the path is from the place."""
    return float(np.median(m.theta[piece] - m.path[piece]))


def _without(m: Motion, x: np.ndarray, block: Block, values: dict[str, float]) -> np.ndarray:
    """The place without the error."""
    at, true = block.fresh.index("theta_m"), x
    for _ in range(WITHIN):
        signals = {"w": m.w, "theta": true}
        true = x - (block(*(signals[k] for k in block.inputs), **values)[at] - true)
    return true
