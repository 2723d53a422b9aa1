"""Breakaway ramps: the torque rises until the axis runs away; static friction where it does.

The first count may be late or early (bristles yield before): the instant is that from which the
motion grows with the third power of time, as under a torque that rises from balance.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import stats
from scipy.optimize import nnls

from ...blocks.block import unit_for
from ...estimates.bench_test import BenchTable, BenchTest, in_words
from ...estimates.findings import Estimate
from .momentum import interval
from .motion import Motion, Piece

FEWEST = 3  # breakaways
RAMPS, MOSTLY = 0.3, 0.8  # of the rows: ramps that end in motion; these and held torque
REST = 5  # rows of rest before a breakaway
EARLY = 0.005  # of the travel after a breakaway, over which its beginning is fitted
COUNTS = 28.0  # standard deviations of the noise that this must be at least
TRIED, EARLIEST = 50, 2.5  # instants, back from where it is seen by so much of the time it grows in
SURE = 0.5  # of the time until it is seen, by which the instant may be wrong
POWERS = ((2, 4), (2, 4, 8))  # of time, with which the speed grows, in one case or another
KIND = "breakaway_ramps"


@dataclass(frozen=True)
class Breakaway:
    """The torque and the angle at which an axis ran away."""

    torque: float
    x: float
    known: float  # what is not known of the torque, a standard deviation


def breakaway_ramps(motions: Sequence[Motion], motion: str) -> BenchTest | None:
    """Static friction in each direction and at each place, with its scatter."""
    parts = [(one, piece) for one in motions for piece in one.pieces]
    every = sum(map(len, motions))
    held = sum(p.at.stop - p.at.start for _, p in parts if p.held)

    def enough(ramps: int) -> bool:
        return ramps >= RAMPS * every and ramps + held >= MOSTLY * every

    if not enough(sum(p.at.stop - p.at.start for _, p in parts if p.ramp)):
        return None
    tried = [(piece.at, _breakaway(one, piece)) for one, piece in parts]
    found = [b for _, b in tried if b is not None]
    if len(found) < FEWEST or not enough(sum(at.stop - at.start for at, b in tried if b)):
        return None
    unit = unit_for("N m", motion)
    torque, known = (np.array([getattr(b, k) for b in found]) for k in ("torque", "known"))
    ways = {"Fs_forward": torque > 0, "Fs_backward": torque < 0}
    ways = {k: at for k, at in ways.items() if at.any()}
    freedom = len(found) - len(ways)
    if freedom < 1:
        return None
    rest = np.concatenate([np.abs(torque[at]) - np.abs(torque[at]).mean() for at in ways.values()])
    scatter = float(np.sqrt(rest @ rest / freedom))
    values = {}
    for k, at in ways.items():
        size, error = float(np.abs(torque[at]).mean()), scatter / np.sqrt(at.sum())
        values[k] = interval(size, error, freedom, unit, resolution=float(known[at].mean()))
    low, high = scatter * np.sqrt(freedom / stats.chi2.ppf((0.975, 0.025), freedom))
    ends = (max(float(low) - float(known.mean()), 0.0), float(high) + float(known.mean()))
    values["Fs_scatter"] = Estimate(scatter, unit, ends)
    many = " and ".join(f"{at.sum()} {k[3:]}" for k, at in ways.items())
    x = "x [m]" if motion == "linear" else "theta [rad]"
    rows = tuple((b.x, "forward" if b.torque > 0 else "backward", abs(b.torque)) for b in found)
    table = BenchTable((x, "direction", f"Fs [{unit}]"), rows)
    return BenchTest(KIND, f"Breakaway in {many} ramps: {in_words(values)}.", values, table)


def _breakaway(one: Motion, piece: Piece) -> Breakaway | None:
    """The breakaway in a ramp: the longest motion that follows a rest."""
    if not piece.ramp:
        return None
    inside = [s for s in one.strokes if piece.at.start + REST <= s.start < piece.at.stop]
    inside = [s for s in inside if one.side[s.start] == np.sign(piece.slope)]
    stroke = max(inside, key=lambda s: np.ptp(one.x[s]), default=None)
    found = None if stroke is None else _instant(one, piece, stroke)
    if stroke is None or found is None:
        return None
    t, error = found
    torque = piece.level + piece.slope * (t - one.t[piece.at.start] - 0.5 * one.dt)
    if np.sign(torque) != np.sign(piece.slope):
        return None
    known = float(np.hypot(piece.slope * np.hypot(error, 0.6 * one.dt), one.step / np.sqrt(12)))
    return Breakaway(float(torque), float(one.x[stroke.start - REST]), known)


def _instant(one: Motion, piece: Piece, stroke: slice) -> tuple[float, float] | None:
    """When the axis runs away, with its standard deviation: over all instants by likelihood."""
    y = one.x if one.w is None else one.w
    side, width = one.side[stroke.start], 3 * one.noise
    back = max(one.window + REST, stroke.stop - stroke.start)
    before = max(stroke.start - back, piece.at.start)
    rest = float(np.median(y[max(before - 2 * REST, 0) : before + 1]))
    moved = side * (y[before : stroke.stop] - rest)
    least = max(EARLY * moved.max(), COUNTS * one.noise)
    end = int(np.argmax(moved > least)) if np.any(moved > least) else len(moved)
    low = np.flatnonzero(moved[:end] <= width)
    seen = int(low[-1]) + 1 if len(low) else 0
    stop = min(max(end, seen + 6), len(moved), piece.at.stop - before)
    if stop - seen < 4:
        return None
    t = one.t[before : before + stop]
    y = moved[seen:stop]
    tried = t[seen] - (t[-1] - t[seen]) * np.linspace(0.0, EARLIEST, TRIED)
    tried = tried[tried >= one.t[piece.at.start]]
    if not len(tried):
        return None
    alike = max(len(y) * width / max(moved[:stop].max(), width), 1.0) if one.angle else 1.0
    weight = np.zeros(len(tried))
    for powers in POWERS:
        misfits = np.array([_misfit(t[seen:] - at, y, one, powers) for at in tried])
        unit = max(one.noise**2, float(misfits.min()) / len(y)) * alike
        likely = np.exp(-0.5 * (misfits - misfits.min()) / unit)
        weight += likely / likely.sum()
    mean = float(np.average(tried, weights=weight))
    spread = float(np.sqrt(np.average((tried - mean) ** 2, weights=weight)))
    return mean, float(np.hypot(spread, SURE * (t[seen] - mean)))


def _misfit(t: np.ndarray, y: np.ndarray, one: Motion, powers: Sequence[int]) -> float:
    """What is left of a motion that grows from t = 0 under a rising torque, ever faster."""
    s = t / t[-1]
    columns = [s ** (power + one.angle) for power in powers]
    if one.angle:  # where in its count the axis rested is unknown
        both = [np.full(len(t), 1.75 * one.noise), np.full(len(t), -1.75 * one.noise)]
        columns += both
    return float(nnls(np.column_stack(columns), y)[1]) ** 2
