"""The verdict: set algebra on the table."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from . import late_speed, laws_as_rows, limits, rounds
from .base import Base, Record
from .contender import Contender
from .numbers import LEAST, REST, SECOND, UNKNOWN
from .score import paired
from .table import ALIKE, Table, as_good, decided, tabulate

NOTHING = 2.6  # the same between the best of about thirty and nothing
KNOWN_TIME = 0.33  # of `least` for a delay that is 1 ms or more beyond what is free


@dataclass(frozen=True, eq=False)
class Decision:
    """What the table says.

    ``alternatives`` explain the record as well as the first of ``effects``. ``beside`` is the table
    with that one in the base; ``gravity`` joined the base before the first.
    """

    verdict: str
    effects: tuple[Contender, ...] = ()
    alternatives: tuple[Contender, ...] = ()
    depends_on: frozenset[str] = frozenset()
    table: Table | None = None
    beside: Table | None = None
    gravity: Contender | None = None
    unknown: Contender | None = None
    messages: tuple[str, ...] = field(default=())

    @property
    def last(self) -> Base:
        """The base with all effects in it that are named."""
        assert self.table is not None
        return self.table.base if self.beside is None else self.beside.base


def decide(record: Record, least: float = LEAST) -> Decision:
    """From the record to the verdict."""
    table, heavy, also = decided(record)
    found = _of(record, table, least)
    found = found if heavy is None else _with_weight(found, heavy, also)
    return replace(_with_law(found, least), messages=limits.unseen(record))


def _with_law(found: Decision, least: float) -> Decision:
    """With what no other row shows: parts of friction that the law lacks, a late speed."""
    assert found.table is not None
    record = found.table.base.record
    if found.verdict not in ("adequate", "found", "ambiguous") or not record.sure:
        return found
    many = float(np.log(len(laws_as_rows.PARTS))) + 2
    parts = []
    for c in laws_as_rows.rows(found.last):
        d, se = c.above(c.base)
        if d > many and d > NOTHING * se and c.share > least:
            parts.append(c)
    parts += _late(found, least)
    verdict = "found" if parts and found.verdict == "adequate" else found.verdict
    return replace(found, verdict=verdict, effects=(*found.effects, *parts))


def _late(found: Decision, least: float) -> list[Contender]:
    """A speed that lags the position by more than friction's least torque."""
    c = late_speed.row(found.last)
    return [c] if c is not None and late_speed.sure(c) and c.share > least else []


def _of(record: Record, table: Table, least: float) -> Decision:
    base = table.base
    many = float(np.log(max(len(table.named), 1))) + 2

    def proven(c: Contender, over: Base) -> bool:
        d, se = c.above(over)
        return d > many and d > NOTHING * se

    def floor(c: Contender) -> float:
        late = c.name in ("input_delay", "actuator_lag")
        free = record.lateness + 1e-3
        return KNOWN_TIME * least if late and max(c.values.values()) > free else least

    good = [c for c in table.named
            if proven(c, base) and c.share > floor(c) and c.share > 0.25 * base.left]  # fmt: skip
    free = [c for c in table.unknown if proven(c, base) and c.share > UNKNOWN * least]
    if not record.sure:
        good = []
    if not good:
        if not free:
            return Decision("adequate", table=table)
        signals = free[0].depends_on
        return Decision("unexplained", depends_on=signals, table=table, unknown=free[0])
    best = good[0]
    also = tuple(c for c in good[1:] if as_good(c, best))[:3]
    verdict = "ambiguous" if also else "found"
    found = Decision(verdict, (best,), also, table=table)
    return _what_is_left(found, best, free, least, many)


def _what_is_left(
    found: Decision, best: Contender, free: list[Contender], least: float, many: float
) -> Decision:
    """The table again with the best effect in the base: an unknown torque or a second effect."""
    beside = tabulate(best.joined())
    over = beside.base

    def proven(c: Contender) -> bool:
        d, se = c.above(over)
        return d > many and d > NOTHING * se

    rest = [c for c in beside.unknown if proven(c)]
    more = [c for c in beside.named if proven(c) and c.name != best.name]
    second = more[0] if more else None
    odd = _odd(best, second, rest, free, least)
    found = replace(found, beside=beside)
    if second is not None:
        large = second.share > max(UNKNOWN * least, SECOND * best.share)
        if large and second.gain > 0.15 * best.gain:
            several, odd = _several(found, best, second, free, least, many)
            if odd is None:
                return several
    if odd is not None:
        far = _far(best, rest, free, least)
        kept = () if far else found.effects
        return replace(found, verdict="unexplained", effects=kept, alternatives=(),
                       depends_on=odd.depends_on, unknown=odd)  # fmt: skip
    return found


def _several(
    found: Decision,
    best: Contender,
    second: Contender,
    free: list[Contender],
    least: float,
    many: float,
) -> tuple[Decision, Contender | None]:
    """All effects of the record, each the best beside the others; an unknown torque instead."""

    def fits(c: Contender, over: Base) -> bool:
        d, se = c.above(over)
        large = c.share > max(UNKNOWN * least, SECOND * best.share)
        return large and d > many and d > NOTHING * se

    assert found.table is not None
    start = found.table.base
    effects, _ = rounds.all_of([best, second], fits)
    effects, also = rounds.exchanged(start, effects, fits)
    effects = rounds.chained(start, effects)
    table = tabulate(effects[-1].joined())
    verdict = "ambiguous" if also else "found"
    made = replace(found, verdict=verdict, effects=tuple(effects), alternatives=also, beside=table)
    last, most = effects[-1], max(effects, key=lambda c: c.share)
    rest = [c for c in table.unknown if fits(c, table.base) and c.share > REST * most.share]
    if rest and rest[0].gain > REST * most.gain:
        return made, free[0] if free else rest[0]
    if free:  # it does alone what the named effects do together
        d, se = paired(last.blocks, free[0].blocks)
        over, error = free[0].above(best)
        alone = free[0].gain > 0.9 * float(np.sum(last.blocks - start.score))
        if alone and not d > ALIKE * se and over > max(ALIKE * error, REST * best.gain):
            return made, free[0]
    return made, None


def _odd(
    best: Contender,
    second: Contender | None,
    rest: list[Contender],
    free: list[Contender],
    least: float,
) -> Contender | None:
    """An unknown torque without which the named effects are not the answer."""
    odd = None
    large = next((c for c in rest if c.share > max(UNKNOWN * least, REST * best.share)), None)
    if large is not None and large.gain > REST * best.gain:
        d, se = paired(large.blocks, second.blocks) if second else (large.gain, 1.0)
        if d > ALIKE * se:
            odd = free[0] if free else large
    if free and second is not None:  # it does alone what two named effects do together
        d, se = free[0].above(best)
        both = free[0].gain > 0.9 * (best.gain + second.gain)
        if d > max(ALIKE * se, REST * best.gain) and both:
            odd = free[0]
    return free[0] if _far(best, rest, free, least) else odd


def _far(best: Contender, rest: list[Contender], free: list[Contender], least: float) -> bool:
    """Whether nothing that has a name comes near an unknown torque."""
    stays = any(c.share > UNKNOWN * least for c in rest)
    if not (free and stays and free[0].gain > 1.5 * best.gain):
        return False
    d, se = free[0].above(best)
    return d > ALIKE * se


def _with_weight(found: Decision, heavy: Contender, also: tuple[str, ...]) -> Decision:
    assert found.table is not None
    alone = not found.effects and not found.depends_on
    if not alone:
        return replace(found, gravity=heavy, effects=(heavy, *found.effects))
    return replace(found, verdict="ambiguous" if also else "found", effects=(heavy,), gravity=heavy)
