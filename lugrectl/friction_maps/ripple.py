"""Order analysis: the ripple of the torque over the angle, in runs at steady speed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import signal, stats

from ..blocks.block import Block, members, unit_for
from ..core.numeric import rms
from ..estimates.findings import Candidate, Estimate, Finding
from ..identification.candidates.applicable import worth_trying
from ..record import Record
from .curve import Curve
from .points import angle, torque, turns

LEAST_TURNS = 3.0  # of a run, so that orders half an order apart are separated
HIGHEST = 8  # order that is examined
LEAST_RUNS = 6
ONCE, OFTEN = "gravity", "torque_ripple"  # a ripple of once per turn has another name
CHANCE = 0.01  # probability that any order is named although there is no ripple


@dataclass(frozen=True)
class Swing:
    """A torque ripple of ``order`` per turn: its amplitude and 95 % interval, N m."""

    order: int
    amplitude: float
    low: float
    high: float


def swings(records: Sequence[Record]) -> tuple[Swing, ...]:
    """The orders at which the torque has a significant ripple, largest first.

    An order is named if its power exceeds that of half an order beside it on either side in more
    runs than by chance (one in three): noise of any colour does not do that. The phases of the runs
    are not compared, as each starts at an arbitrary angle.
    """
    long = [r for r in records if turns(r) >= LEAST_TURNS]
    if len(long) < LEAST_RUNS:
        return ()
    steps = np.arange(1.0, 2 * HIGHEST + 2) / 2.0
    power = np.array([_power(record, steps) for record in long])
    found = [_swing(order, power) for order in range(1, HIGHEST + 1)]
    return tuple(sorted((s for s in found if s), key=lambda s: -s.amplitude))


def _power(record: Record, orders: np.ndarray) -> np.ndarray:
    """Squared amplitude of the torque at each order of a turn."""
    theta = angle(record)
    assert theta is not None
    u = signal.detrend(torque(record))
    u = u * np.hanning(len(u)) * 2.0
    return np.abs(2.0 * np.exp(-1j * np.outer(orders, theta)) @ u / len(u)) ** 2


def _swing(order: int, power: np.ndarray) -> Swing | None:
    """``power`` is (runs, half orders from 1/2 on)."""
    below, own, above = power[:, 2 * order - 2 : 2 * order + 1].T
    count, wins = len(own), int(np.sum(own > np.maximum(below, above)))
    if stats.binom.sf(wins - 1, count, 1.0 / 3.0) > CHANCE / HIGHEST:
        return None
    excess = own - 0.5 * (below + above)
    mean, width = float(np.mean(excess)), float(stats.sem(excess) * stats.t.ppf(0.975, count - 1))
    size = np.sqrt(np.maximum([mean, mean - width, mean + width], 0.0))
    return Swing(order, *map(float, size))


def finding_of(swing: Swing, whole: Curve) -> Finding:
    """The ripple as the first effect that can cause it; the others are alternatives, since a map
    cannot distinguish them.

    The phase is not among the values: each run starts at an arbitrary angle.
    """
    worth = [members("effect")[name] for name in worth_trying(whole.model)]
    able = [block for block in worth if _makes(block, swing.order)]
    first, *others = sorted(able, key=lambda b: b.acts != ("torque",))
    size, unit = _swung(first, whole), first.parameters[first.gain].unit
    strength, low, high = (x / size for x in (swing.amplitude, swing.low, swing.high))
    own = {first.gain: Estimate(strength, unit_for(unit, whole.model.motion), (low, high))}
    if _order(first):
        own[_order(first)] = Estimate(float(swing.order), "1/rev")
    return Finding(first.name, own, tuple(Candidate(b.name, 0.0, 0.0) for b in others))


def _swung(block: Block, whole: Curve) -> float:
    """RMS torque that the effect's strength multiplies; 1 if the strength is a torque."""
    if block.acts == ("torque",):
        return 1.0
    return rms(whole.at.u if "input" in block.acts else whole.friction)


def _makes(block: Block, order: int) -> bool:
    """True if an effect causes a ripple of this order at a steady speed."""
    name = _order(block)
    if block.name in (ONCE, OFTEN):
        return (order == 1) == (block.name == ONCE)
    if not name or "J" in block.acts:
        return False
    return block.own[name].low <= order <= block.own[name].high


def _order(block: Block) -> str:
    """The parameter of an effect that counts per turn; empty if there is none."""
    return next((k for k, p in block.own.items() if p.whole), "")


def sentence(swing: Sequence[Swing], whole: Curve) -> str:
    """The ripple over the angle in one message."""
    friction = 0.01 * rms(whole.friction)
    orders = [f"{s.order} times per turn by {s.amplitude / friction:.2g} %" for s in swing]
    return (
        f"The torque varies with the angle: {', '.join(orders)} of friction. Its phase in the runs "
        "is unknown, so it is not part of the model."
    )
