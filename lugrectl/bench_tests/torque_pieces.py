"""The torque as pieces: held, rising in a ramp, or anything else."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .motion import Motion

JUMP = 0.02  # of the span of u, from which a change within a row is a step
FLAT = 0.02  # of the span of u, by which a held torque may differ from its mean (RMS)
STRAIGHT = 0.02  # of its own height, by which a ramp may differ from a line (RMS)
SHORTEST = 4  # rows of a piece


@dataclass(frozen=True)
class Piece:
    """Rows ``at``; the torque is ``level + slope (t - t0)``, with t0 that of the first row."""

    at: slice
    level: float
    slope: float
    held: bool
    ramp: bool


def pieces(one: Motion) -> list[Piece]:
    """The pieces of u between its steps."""
    span = float(np.ptp(one.u))
    if not span:
        return [Piece(slice(0, len(one)), float(one.u[0]), 0.0, True, False)]
    jumps = np.flatnonzero(np.abs(np.diff(one.u)) > JUMP * span) + 1
    edges = np.r_[0, jumps, len(one)]
    pairs = zip(edges[:-1], edges[1:], strict=True)
    return [_piece(one, slice(int(a), int(b)), span) for a, b in pairs if b - a >= SHORTEST]


def _piece(one: Motion, at: slice, span: float) -> Piece:
    t, u = one.t[at] - one.t[at.start], one.u[at]
    held = bool(np.std(u) < FLAT * span)
    slope, level = np.polyfit(t, u, 1)
    height = abs(slope) * t[-1]
    off = float(np.std(u - level - slope * t))
    ramp = height > 5 * FLAT * span and off < STRAIGHT * height + one.step
    if held and not ramp:
        return Piece(at, float(np.mean(u)), 0.0, True, False)
    return Piece(at, float(level), float(slope), False, bool(ramp))
