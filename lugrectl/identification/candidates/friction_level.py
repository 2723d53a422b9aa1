"""Effects on the level of friction, in the friction that is there beside them.

Such an effect multiplies the level of friction. The base without it has another level, bent
towards what the effect does; so its columns are made again from the fit with it in.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...blocks.block import REGISTRY, Block
from .base_model import LEVELS, Base
from .candidate import Contender, enter
from .effect_columns import by_run, columns

LEVELS_OF_FRICTION = {"Fc", "Fs", "Fv"}
TIMES = 12


def on_level(block: Block) -> bool:
    """Whether the effect multiplies the level of friction at each instant."""
    return bool(LEVELS_OF_FRICTION & set(block.acts)) and not block.states


def levelled(c: Contender) -> Contender:
    """The contender in its own friction, where that explains more."""
    block = REGISTRY["effect", c.name]
    if not on_level(block) or not c.own or not np.isfinite(c.gain):
        return c
    for _ in range(TIMES):
        made = columns(_beside(c), block, c.values)
        made = by_run(c.base, made) if c.entry.by_run else made
        again = enter(c.base, replace(c.entry, columns=made))
        if not again.gain > c.gain:
            break
        c = again
    return c


def _beside(c: Contender) -> Base:
    """The base with the levels of friction that the contender finds."""
    base = c.base
    return replace(base, levels=c.made.b[LEVELS], friction=base.friction_rms)
