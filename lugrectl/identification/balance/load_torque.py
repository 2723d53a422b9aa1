"""The load torque, on which friction may depend: gravity and a declared constant torque."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .fit import Fit
from .problem import Ground
from .track import Track
from .windows import Source


def with_load(ground: Ground, made: Fit) -> Ground:
    """The record with the load that a fit found; never the measured torque."""
    parts = ("gravity.sin", "gravity.cos")
    if any(part.block.name == "constant_torque" for part in ground.model.effects):
        parts = (*parts, "constant_torque")
    tracks = [replace(p, load=_load(p, ground, made, parts)) for p in ground.tracks]
    old = ground.source
    return replace(ground, source=Source(tracks, old.sensors, old.held))


def _load(track: Track, ground: Ground, made: Fit, parts: tuple[str, ...]) -> np.ndarray:
    load = np.zeros(len(track))
    for term in (*ground.terms, *(term for term, _ in ground.source.held)):
        if term.key in parts and term.column is not None:
            load = load + made.value(term.key) * term.column(track)
    return load
