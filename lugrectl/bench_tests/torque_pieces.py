"""The torque as pieces: held, rising in a ramp, or anything else."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

RARE = 0.01  # of the rows at either end, which tell no span: peaks of a loop
JUMP = 0.02  # of the span of u, from which a change within a row is a step
FLAT = 0.02  # of the span of u, by which a held torque may differ from its mean (RMS)
STRAIGHT = 0.02  # of its own height, by which a ramp may differ from a line (RMS)
CERTAIN = 5.0  # standard deviations of the noise of u, that are no step
MOST = 400  # bends: a torque with more is no bench test's
SHORTEST = 4  # rows of a piece


@dataclass(frozen=True)
class Piece:
    """Rows ``at``; the torque is ``level + slope (t - t0)``, with t0 that of the first row."""

    at: slice
    level: float
    slope: float
    held: bool
    ramp: bool


def pieces(t: np.ndarray, u: np.ndarray, step: float) -> list[Piece]:
    """The pieces of u between its steps and its bends."""
    span = float(np.ptp(np.quantile(u, (RARE, 1 - RARE)))) or float(np.ptp(u))
    if not span:
        return [Piece(slice(0, len(u)), float(u[0]), 0.0, True, False)]
    noise = 1.4826 * float(np.median(np.abs(np.diff(u)))) / np.sqrt(2)
    far = JUMP * span + CERTAIN * noise
    jumps = np.flatnonzero(np.abs(np.diff(u)) > far) + 1
    edges = [0, *jumps.tolist(), len(u)]
    left = [(a, b) for a, b in zip(edges, edges[1:], strict=False) if b - a >= SHORTEST][::-1]
    made, bends = [], 0
    while left:
        a, b = left.pop()
        bend = _bend(t[a:b], u[a:b], far + step) if bends < MOST else None
        if bend is None:
            made.append(_piece(t, u, slice(a, b), span, step + noise))
            continue
        bends += 1
        left += [(x, y) for x, y in ((a + bend, b), (a, a + bend)) if y - x >= SHORTEST]
    return made


def _bend(t: np.ndarray, u: np.ndarray, far: float) -> int | None:
    """The row farthest from the chord, if it is off (Douglas and Peucker, 1973)."""
    off = np.abs(u - u[0] - (u[-1] - u[0]) * (t - t[0]) / (t[-1] - t[0]))
    i = int(np.argmax(off))
    return i if off[i] > far and 0 < i < len(u) - 1 else None


def _piece(t: np.ndarray, u: np.ndarray, at: slice, span: float, step: float) -> Piece:
    t, u = t[at] - t[at.start], u[at]
    held = bool(np.std(u) < FLAT * span + step)
    slope, level = np.polyfit(t, u, 1)
    height = abs(slope) * t[-1]
    off = float(np.std(u - level - slope * t))
    ramp = height > 5 * FLAT * span and off < STRAIGHT * height + step
    if held and not ramp:
        return Piece(at, float(np.mean(u)), 0.0, True, False)
    return Piece(at, float(level), float(slope), False, bool(ramp))
