"""Loads behind a spring or a gap: their frequency, damping and gap are searched.

Behind a gap, the load's own friction decides where it is when the drive comes back: it is searched,
too, as the deceleration that it causes.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import product

import numpy as np

from ...blocks.block import Block
from .base_model import Base, Columns
from .candidate import Entry
from .driven_load import of_unit_load, torques

SLOWEST, FASTEST = 4.0, 60.0  # Hz of a load on its spring
FREQUENCIES, DAMPINGS = 22, (0.03, 0.1, 0.3)
GAP_FREQUENCIES, GAP_DAMPING = (45.0, 80.0, 140.0), 0.3
SOFT_FREQUENCIES, SOFT_DAMPING = (5.0, 7.5, 11.0, 17.0, 26.0), 0.2
SLOWINGS = (
    0.1,
    0.14,
    0.2,
    0.28,
    0.4,
    0.56,
    0.8,
    1.1,
)  # of the deceleration by all friction of the drive
HARD = 50.0  # Hz of a load with friction in the first search: only its gap counts then
GAPS = 90  # behind a hard spring a gap that is 5 % off loses most of what it explains
SOFTEST_HARD = 35.0  # Hz: below, a spring behind a gap is a soft one
SOFT = 3  # every so many gaps are enough behind a soft one
EDGE = 0.84  # of the slowest: below, it is an inertia that falls with frequency and no spring
CRITICAL, FASTEST_AT_ALL = 0.95, 400.0  # damping ratio, Hz
ZOOMS = (1.0, 1.0, 0.4, 0.16)  # rounds of the polish: their steps over the first ones
STEPS = (0.1, 0.4)  # of frequency and damping, in logarithms
SLOWING_STEP = 0.35  # of the deceleration by the load's friction
AT_ONCE = 4_000_000  # samples of loads that are kept at a time

Shape = tuple[float, ...]  # frequency, damping ratio; with a gap: gap, deceleration


def springs(base: Base, block: Block) -> Iterator[Entry]:
    """The most likely frequency, damping and gap of an inertia behind a spring."""
    if {"load_inertia", "stiffness", "damping"} - {*block.own} or base.record.motion.dt > 0.02:
        return
    kinds, steps = _places(base, block)
    known, base = base.known.get(block.name), base.of_any_inertia
    firsts = [_best(base, block, kind) for kind in kinds] if known is None else [known]
    zooms = ZOOMS[2 if known else 0 :]
    polished = [_polished(base, block, first, steps, zooms) for first in firsts if first]
    best = _best(base, block, polished)
    if best is None or best[0] < EDGE * SLOWEST or best[1] > CRITICAL:
        return
    made = Columns.free(load_columns(base, block, [best]), 0.0)
    names = ("frequency", "damping_ratio", "gap", "slowing")
    values: dict[str, float] = dict(zip(names, best, strict=False))
    yield Entry(block.name, values, made, cost=float(np.log(sum(map(len, kinds)))), inertial=True)


def _polished(
    base: Base, block: Block, best: Shape, steps: Sequence[float], zooms: Sequence[float]
) -> Shape:
    """The best of smaller and smaller steps around a shape."""
    soft = "gap" in block.own and best[0] < SOFTEST_HARD
    steps = [*STEPS, SOFT * steps[2], SLOWING_STEP] if soft else steps
    for zoom in zooms:
        best = _best(base, block, _around(best, [zoom * s for s in steps])) or best
    return best


def _places(base: Base, block: Block) -> tuple[list[list[Shape]], list[float]]:
    """All shapes to try, by their kind, and their distances in logarithms.

    A grid is not as close in every kind, so the best of each is polished before they are compared.
    """
    m = base.record.motion
    if "gap" not in block.own:
        top = min(FASTEST, 0.3 / m.dt)
        frequencies = np.geomspace(SLOWEST, top, FREQUENCIES).tolist()
        return [list(product(frequencies, DAMPINGS))], list(STEPS)
    reach = min(float(np.ptp(m.theta)), 2 * np.pi)
    gaps = 2 * np.geomspace(max(m.count, 4e-4 * reach), 0.04 * reach, GAPS)
    near = 0.6 * float(np.log(gaps[1] / gaps[0]))
    hard = product(GAP_FREQUENCIES, [GAP_DAMPING], gaps.tolist(), [0.0])
    usual = float(np.median(base.level)) / base.J
    rubs = [usual * s for s in SLOWINGS] if "load_friction" in block.own else []
    soft = product(SOFT_FREQUENCIES, [SOFT_DAMPING], gaps[::SOFT].tolist(), [0.0])
    rubbing = product(SOFT_FREQUENCIES, [SOFT_DAMPING], gaps[::SOFT].tolist(), rubs[::SOFT])
    slowed = product([HARD], [GAP_DAMPING], gaps.tolist(), rubs)
    kinds = [kind for kind in map(list, (hard, soft, rubbing, slowed)) if kind]
    return kinds, [*STEPS, near, SLOWING_STEP]


def _around(shape: Shape, steps: Sequence[float]) -> list[Shape]:
    """The shape and its neighbours, a step in the logarithm of each of its values."""
    turns = product(*[(-s, 0.0, s) if x else (0.0,) for s, x in zip(steps, shape, strict=True)])
    return [tuple(float(x * np.exp(d)) for x, d in zip(shape, t, strict=True)) for t in turns]


def _best(base: Base, block: Block, shapes: Sequence[Shape]) -> Shape | None:
    """The shape that explains most; None if an inertia above 0 explains nothing."""
    shapes = [s for s in shapes if 0.8 * SLOWEST < s[0] < FASTEST_AT_ALL and s[1] <= 1.0]
    if not shapes:
        return None
    gains, b = base.gains(load_columns(base, block, shapes))
    gains = np.where(b > 0, gains, -1.0)
    i = int(np.argmax(gains))
    return shapes[i] if gains[i] > 0 else None


def load_columns(base: Base, block: Block, shapes: Sequence[Shape]) -> np.ndarray:
    """The torques of loads of 1 kg m2 in the windows, (m, shapes), each computed once."""
    kept: dict[Shape, np.ndarray] = base.record.once(("loads", block.name), None, dict)
    m, narrow = base.record.motion, base.record.rows.narrow
    new, many = [s for s in shapes if s not in kept], max(1, AT_ONCE // len(m))
    for i in range(0, len(new), many):
        part = new[i : i + many]
        made = narrow @ torques(block, m.path, m.dt, [of_unit_load(*s) for s in part])
        kept.update(zip(part, np.ascontiguousarray(made.T), strict=True))
    return np.stack([kept[s] for s in shapes], axis=1)
