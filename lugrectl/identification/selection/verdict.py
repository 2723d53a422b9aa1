"""The verdict: set algebra on the table."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from statistics import NormalDist

import numpy as np

from ...blocks.block import unit_for
from ...estimates.findings import NOT_NAMED
from ..balance import UNRELATED
from ..candidates import friction_laws, speed_lag
from ..candidates.base_model import Base, Record, rms
from ..candidates.candidate import Contender, enter
from ..candidates.refined_friction import each_in_its_own_law, in_its_own_law
from ..regression.numbers import (
    ALIKE_SCALES,
    ALPHA,
    FAR,
    HALF,
    HALF_RESPONSE,
    HIDING,
    KNOWN_TIME,
    LEAST,
    MORE,
    MOST,
    OFF,
    REST,
    SECOND,
    SECOND_GAIN,
    STIFFLY,
    TOGETHER,
    UNKNOWN,
)
from ..regression.score import paired
from . import stepwise
from .events import Events, events, explained
from .table import ALIKE, Bars, Table, as_good, bar_of, best_of, decided, tabulate

LAW_PARTS = {part.name for part in friction_laws.PARTS}
MOST_ALTERNATIVES = 3
MOST_BESIDE = 3  # other effects beside which two explanations are compared again


UNSURE = NOT_NAMED + ": declare J, or record faster changes of speed."
SUSPECT = "With it, {} would explain what stays."
HEAVIER = (
    "The inertia is {:.2g} times the declared one: a load that the declared value does not have, "
    "or a wrong value."
)
LOADED = (
    "The inertia is {:.2g} times the declared one. It may be a load behind a coupling: windows of "
    "{:.2g} ms, which this record needs, do not show a resonance above about {:.2g} Hz. Or the "
    "declared value is wrong."
)
TOO_HEAVY = (
    "Torque and acceleration contradict the declared inertia of {0:.3g} {1}: the log shows "
    "{2:.3g} {1}, less than 1/{3:g} of it. u is not the torque that causes this motion, or J or u "
    "is in another unit."
)
SMALL = (
    "A torque of {:.2g} % of friction that depends on {} stays unexplained. It makes the simulated "
    "motion drift, but is too small to be called missing: without a name, that begins at {:.2g} %."
)
LEAVES = (
    "{} would be a torque of {:.2g} % of friction, but {:.2g} % would stay that follows no signal "
    "of the log."
)
TIED = (
    "A torque that depends on {} explains the record as well as one that depends on {}, which has "
    "fewer parameters."
)


@dataclass(frozen=True, eq=False)
class Decision:
    """What the table says.

    ``alternatives`` explain the record as well as the first of ``effects``. ``beside`` is the table
    with that one in the base; ``gravity`` joined the base before the first. ``only_inertia``: of
    the effects the record shows no more than the inertia of a load. ``events`` are the times of
    torques that nothing predicts. ``suspect`` would be named if the inertia were known.
    """

    verdict: str
    effects: tuple[Contender, ...] = ()
    alternatives: tuple[Contender, ...] = ()
    depends_on: frozenset[str] = frozenset()
    table: Table | None = None
    beside: Table | None = None
    gravity: Contender | None = None
    unknown: Contender | None = None
    only_inertia: bool = False
    events: tuple[float, ...] = ()
    messages: tuple[str, ...] = field(default=())
    suspect: Contender | None = None

    @property
    def last(self) -> Base:
        """The base with all effects in it that are named."""
        assert self.table is not None
        more = any(c is not self.gravity for c in self.effects)
        base = self.beside.base if more and self.beside is not None else self.table.base
        second = [c for c in self.effects if c.base is base and self.beside is not None]
        return second[0].joined() if second else base


def decide(
    record: Record, least: float = LEAST, alpha: float = ALPHA, weighed: bool = True
) -> Decision:
    """From the record to the verdict; ``weighed``: gravity may join the base before all else."""
    table, heavy, also = decided(record, weighed)
    bars = Bars(least, NormalDist().inv_cdf(1 - alpha))
    found = _of(record, table, bars)
    if not record.sure and heavy is None:
        refused = found.verdict == "adequate" and _stays(found.last) > UNKNOWN * least
        if refused or _explained(found):  # what stays may be anything, or would have a name
            return Decision("refused", table=found.table, messages=(_unsure(found),))
        return judged(replace(found, messages=(UNSURE, *found.messages)))
    found = found if heavy is None else _with_weight(found, heavy, also)
    small = all(c.share < UNKNOWN * least for c in found.effects)
    found = _with_load(found) if small and found.verdict != "unexplained" else found
    found = _with_law(found, bars) if record.sure else found
    return judged(_if_it_explains(found, bars))


def without(found: Decision, c: Contender, least: float = LEAST, alpha: float = ALPHA) -> Decision:
    """The decision without a named effect, and without what explains the record as well as it."""
    assert found.table is not None
    left = [e for e in found.effects if e is not c]
    alike = () if c is found.effects[0] else found.alternatives
    own = [e for e in left if e is not found.gravity]
    if own and own[0].entry.name not in LAW_PARTS:
        effects = stepwise.chained(found.table.base, own)
        heavy = [e for e in left if e is found.gravity]
        beside = tabulate(effects[-1].joined())
        verdict = found.verdict if alike or found.verdict != "ambiguous" else "found"
        return replace(found, effects=(*heavy, *effects), alternatives=alike, beside=beside,
                       verdict=verdict)  # fmt: skip
    bars = Bars(least, NormalDist().inv_cdf(1 - alpha))
    nothing = _nameless(found.table, bars.proven(found.table, found.table.unknown), least)
    if not left:
        return replace(nothing, messages=(*found.messages, *nothing.messages))
    verdict = "found" if nothing.verdict == "adequate" else nothing.verdict
    return replace(nothing, verdict=verdict, effects=tuple(left), gravity=found.gravity,
                   messages=(*found.messages, *nothing.messages))  # fmt: skip


def judged(found: Decision) -> Decision:
    """The decision, if a drive can be as it says; of unknown torques the simplest speaks."""
    assert found.table is not None
    last, found = found.last, _simplest(found)
    if found.unknown is not None and not _at_bound(found.unknown):
        last = found.unknown.joined()
    said = contradiction(last)
    if said is not None:
        suspect = found.suspect  # it says what the base cannot
        said = said if suspect is None or contradiction(suspect.joined()) else UNSURE
        return Decision("refused", table=found.table, messages=(said,))
    return found


def _if_it_explains(found: Decision, bars: Bars) -> Decision:
    """The decision, if what is named is more than what stays, which no sensor's noise is."""
    if not found.effects or found.only_inertia or found.verdict == "unexplained":
        return found
    assert found.table is not None
    named = float(np.linalg.norm([c.size for c in found.effects]))
    stays = _stays(found.last)
    if named > stays:
        return found
    names = " and ".join(c.name for c in found.effects)
    said = LEAVES.format(names, 100.0 * named, 100.0 * stays)
    known = bars.proven(found.table, found.table.unknown)
    nothing = _nameless(found.table, known, bars.least)
    return replace(nothing, messages=(*found.messages, said, *nothing.messages))


def _explained(found: Decision) -> bool:
    """Whether a named effect explains as much as the unknown torque."""
    one, other = found.suspect, found.unknown
    return one is not None and other is not None and as_good(one, other)


def _unsure(found: Decision) -> str:
    return UNSURE if found.suspect is None else f"{UNSURE} {SUSPECT.format(found.suspect.name)}"


def _stays(base: Base) -> float:
    """What it leaves and no sensor's noise is, as a share of friction."""
    return float(np.sqrt(max(base.left**2 - base.noise**2, 0.0)))


def _simplest(found: Decision) -> Decision:
    """With the unknown torque of the fewest effective parameters, of those that explain the record
    equally well."""
    own = found.unknown
    if own is None or found.verdict != "unexplained" or found.events:
        return found
    tables = [table for table in (found.table, found.beside) if table and table.base is own.base]
    alike = [c for table in tables for c in table.unknown if c is own or as_good(c, own)]
    best = min(alike, key=lambda c: c.freedom, default=own)
    others = [c.depends_on for c in alike if not c.depends_on >= best.depends_on]
    tied = [TIED.format(_on(signals), _on(best.depends_on)) for signals in others]
    return replace(found, unknown=best, depends_on=best.depends_on,
                   messages=(*found.messages, *tied))  # fmt: skip


def _on(signals: frozenset[str]) -> str:
    return " and ".join(sorted(signals))


def _with_law(found: Decision, bars: Bars) -> Decision:
    """With what no other row shows: parts of friction that the law does not have, a late speed."""
    if found.verdict not in ("adequate", "found", "ambiguous"):
        return found
    last = found.table if found.beside is None else found.beside
    assert last is not None
    least = max(bar_of(friction_laws.PARTS), bars.open_in(last))
    parts = []
    for c in friction_laws.rows(found.last):
        d, se = c.above(c.base)
        large = c.share > bars.least or _nearly_all(c, bars.least)
        if d > least and d > bars.z * se and large:
            parts.append(c)
    parts += _late(found, bars.least)
    verdict = "found" if parts and found.verdict == "adequate" else found.verdict
    return replace(found, verdict=verdict, effects=(*found.effects, *parts))


def _matters(c: Contender, table: Table, least: float) -> bool:
    """Whether its torque is large enough.

    Where the declared law imitates it so that little is left, that little is its own only if no
    unknown torque explains more.
    """
    best = max((free.gain for free in table.unknown), default=0.0)
    return c.share > least or (_nearly_all(c, least) and c.gain > best)


def _nearly_all(c: Contender, least: float) -> bool:
    """Whether its torque is large, and what the law does not imitate of it is most of what the
    base leaves."""
    return c.size > least and c.share > MOST * c.base.left


def _late(found: Decision, least: float) -> list[Contender]:
    """A speed that lags the position by more than friction's least torque."""
    c = speed_lag.row(found.last)
    return [c] if c is not None and speed_lag.sure(c) and c.share > least else []


def _of(record: Record, table: Table, bars: Bars) -> Decision:
    good = [c for c in bars.proven(table, table.named) if _matters(c, table, _floor(c, bars.least))]
    suspect, good = (None, good) if record.sure else (next(iter(good), None), [])
    known = bars.proven(table, table.unknown)
    free = [c for c in known if c.share > UNKNOWN * bars.least]
    if not good:
        return replace(_nameless(table, known, bars.least), suspect=suspect)
    good = each_in_its_own_law(good)
    close = [good[0], *(c for c in good[1:] if as_good(c, good[0]))][: 1 + MOST_ALTERNATIVES]
    beside = tabulate(close[0].joined())
    if len(close) > 1:
        close = _again(table, bars.proven(beside, beside.named), close)
        if close[0] is not good[0]:
            beside = tabulate(close[0].joined())
    close += [late for c in close for late in speed_lag.instead_of(c)]
    verdict = "ambiguous" if len(close) > 1 else "found"
    found = Decision(verdict, (close[0],), tuple(close[1:]), table=table, beside=beside)
    return _what_is_left(found, free, bars)


def _floor(c: Contender, least: float) -> float:
    """The smallest share of friction at which it is named."""
    late = c.name in ("input_delay", "actuator_lag")
    known = late and max(c.values.values()) > c.base.record.latest + 1e-3
    return KNOWN_TIME * least if known else least


def _nameless(table: Table, known: list[Contender], least: float) -> Decision:
    """The decision where no effect is named, from the unknown torques that are certain."""
    free = [c for c in known if c.share > UNKNOWN * least]
    if free:
        return Decision("unexplained", depends_on=free[0].depends_on, table=table, unknown=free[0])
    found = _with_incidents(table, events(table.base), least)
    if not known or known[0].share < least or found.verdict != "adequate":
        return found
    said = SMALL.format(100.0 * known[0].share, _on(known[0].depends_on), 100.0 * UNKNOWN * least)
    return replace(found, messages=(*found.messages, said))


def _with_incidents(table: Table, odd: Events, least: float) -> Decision:
    """Nothing is named and no torque is unknown, but for what happens at a few instants."""
    nothing = Decision("adequate", table=table)
    if not odd.share > max(UNKNOWN * least, table.base.left):
        return nothing
    if not odd.returns:
        return replace(nothing, messages=(odd.sentence(unit_of(table.base)),), events=odd.times)
    cause = _cause(table, odd)
    if cause is None:
        return _eventful(nothing, odd)
    return Decision("found", (cause,), table=table, beside=tabulate(cause.joined()))


def _cause(table: Table, odd: Events) -> Contender | None:
    """The effect that explains all events, each predicted from the others, if one does."""
    bar = bar_of(table.named)
    able = (c for c in table.named if c.gain > bar and explained(odd, table.base, c.made.r))
    return next(able, None)


def unit_of(base: Base) -> str:
    """The unit of its torque or force."""
    return unit_for("N m", base.record.motion.motion)


def _eventful(found: Decision, odd: Events) -> Decision:
    """Unexplained, with when it happens."""
    assert found.table is not None
    rows, unit = found.table.unknown, unit_of(found.table.base)
    surer = (c for c in rows if c.gain > max(MORE, c.above(c.base)[1]))
    known = (c.depends_on for c in surer if c.share > REST * odd.share)
    likely = next(known, frozenset({"t"}))
    return replace(
        found,
        verdict="unexplained",
        alternatives=(),
        depends_on=likely,
        events=odd.times,
        messages=(*found.messages, odd.sentence(unit)),
    )


def _again(table: Table, beside: Sequence[Contender], close: list[Contender]) -> list[Contender]:
    """Those that explain equally well, compared once more beside what else the record shows.

    A torque that none of them has is an error in all blocks, and differences drown in it.
    """
    own = {c.name: c for c in close}
    more = [c for c in beside if c.own and c.name not in own]
    if not more:
        return close
    base = table.base.beside([c.its for c in more[:MOST_BESIDE]])
    again = best_of(in_its_own_law(enter(base, c.entry)) for c in close)
    kept = [c.name for c in again if c is again[0] or as_good(c, again[0])]
    return [own[name] for name in kept] or close


def _what_is_left(found: Decision, free: list[Contender], bars: Bars) -> Decision:
    """An unknown torque or a second effect beside the best one."""
    best, beside = found.effects[0], found.beside
    assert beside is not None
    more = bars.proven(beside, [c for c in beside.named if c.name != best.name])
    likeliest, least = more[0] if more else None, bars.least
    second = likeliest if likeliest and _large(likeliest, best, least) else None
    rest = bars.proven(beside, beside.unknown)
    odd = _beyond(best, likeliest, rest, free, least) or _at_once(best, second, free)
    far = _nothing_near(best, rest, free, least)
    another = second is not None and second.name not in {c.name for c in found.alternatives}
    if second is not None and (odd is not None or another):
        several, odd = _several(found, best, second, free, bars)
        if odd is None:
            return several
    odd = far or odd
    if odd is not None:
        kept = () if _far(best, free) else found.effects
        return replace(found, verdict="unexplained", effects=kept, alternatives=(),
                       depends_on=odd.depends_on, unknown=odd)  # fmt: skip
    return found


def _several(
    found: Decision, best: Contender, second: Contender, free: list[Contender], bars: Bars
) -> tuple[Decision, Contender | None]:
    """All effects of the record, each the best beside the others; an unknown torque instead."""

    def fits(c: Contender, table: Table) -> bool:
        return bool(bars.proven(table, [c])) and _large(c, best, bars.least)

    assert found.table is not None
    start = found.table.base
    effects = stepwise.all_of([best, second], fits)
    effects, also = stepwise.exchanged(start, effects, fits)
    effects = stepwise.chained(start, effects)
    table = tabulate(effects[-1].joined())
    verdict = "ambiguous" if also else "found"
    made = replace(found, verdict=verdict, effects=tuple(effects), alternatives=also, beside=table)
    return made, _instead(effects, [c for c in table.unknown if fits(c, table)], free, start)


def _instead(
    effects: list[Contender], rest: list[Contender], free: list[Contender], start: Base
) -> Contender | None:
    """An unknown torque that stays beside all effects, or does alone what they do together."""
    last, most = effects[-1], max(effects, key=lambda c: c.share)
    large = [c for c in rest if c.share > REST * most.share and c.gain > REST * most.gain]
    if large:
        return free[0] if free else large[0]
    if not free:
        return None
    d, se = paired(last.blocks, free[0].blocks)
    over, error = free[0].above(effects[0])
    alone = free[0].gain > TOGETHER * float(np.sum(last.blocks - start.score))
    better = over > max(ALIKE * error, REST * effects[0].gain)
    return free[0] if alone and better and not d > ALIKE * se else None


def _large(c: Contender, best: Contender, least: float) -> bool:
    """Whether a second effect is large enough to be named: beside the first, or in what stays."""
    enough = min(SECOND * best.size, MOST * c.base.left)
    large = c.share > least and c.size > max(UNKNOWN * least, enough)
    return large and c.gain > SECOND_GAIN * best.gain


def _beyond(
    best: Contender,
    likeliest: Contender | None,
    rest: list[Contender],
    free: list[Contender],
    least: float,
) -> Contender | None:
    """An unknown torque that stays beside the best effect, and that no other effect is."""
    large = next((c for c in rest if c.share > max(least, REST * best.size)), None)
    if large is None or large.gain < REST * best.gain:
        return None
    d, se = paired(large.blocks, likeliest.blocks) if likeliest else (large.gain, 1.0)
    return None if d < ALIKE * se else free[0] if free else large


def _at_once(best: Contender, second: Contender | None, free: list[Contender]) -> Contender | None:
    """An unknown torque that does alone what two named effects do together."""
    if not free or second is None:
        return None
    d, se = free[0].above(best)
    both = free[0].gain > TOGETHER * (best.gain + second.gain)
    return free[0] if both and d > max(ALIKE * se, REST * best.gain) else None


def _nothing_near(
    best: Contender, rest: list[Contender], free: list[Contender], least: float
) -> Contender | None:
    """An unknown torque that nothing with a name comes near."""
    stays = any(c.share > UNKNOWN * least for c in rest)
    return free[0] if stays and _far(best, free) else None


def _far(best: Contender, free: list[Contender]) -> bool:
    """Whether nothing that has a name comes near an unknown torque."""
    if not (free and free[0].gain > FAR * best.gain):
        return False
    d, se = free[0].above(best)
    return d > ALIKE * se


def _with_load(found: Decision) -> Decision:
    """A load that turns with the motor is seen as its inertia only, where windows are wide."""
    assert found.table is not None
    base, h = found.table.base, found.table.base.record.rows.h
    ratio = base.J / (base.record.declared.get("J") or np.inf)
    close = [c for c in found.table.named if c.name in ("elastic_coupling", "backlash")]
    if ratio < STIFFLY or _scaled(base, ratio):
        return found
    if h < HIDING or len(close) < 2:
        return replace(found, messages=(HEAVIER.format(ratio), *found.messages))
    said = LOADED.format(ratio, 2e3 * h, HALF_RESPONSE / h)
    return replace(
        found,
        verdict="ambiguous",
        effects=tuple(close[:1]),
        alternatives=tuple(close[1:]),
        beside=None,
        only_inertia=True,
        messages=(said, *found.messages),
    )


def _scaled(base: Base, ratio: float) -> bool:
    """Whether friction, too, is so many times the declared: then the torque has another scale."""
    declared = base.record.declared.get("Fc") or np.inf
    return abs(float(np.median(base.level)) / declared / ratio - 1.0) < ALIKE_SCALES


def _with_weight(found: Decision, heavy: Contender, also: tuple[Contender, ...]) -> Decision:
    """With the gravity that joined the base; alone, with what explains the record as well."""
    made = replace(found, gravity=heavy, effects=(heavy, *found.effects))
    if found.effects or found.depends_on:
        return made
    return replace(made, verdict="ambiguous" if also else "found", alternatives=also)


def _at_bound(unknown: Contender) -> bool:
    """Whether an unknown torque stands for the inertia of the motion: it explains any torque."""
    J = unknown.base.record.J
    return bool(J) and unknown.J < 1.01 * J[0]


def contradiction(last: Base) -> str | None:
    """Why no drive is as the last model says; None if one may be."""
    record = last.record
    declared = record.declared.get("J")
    if declared and record.lighter is not None and record.J and last.J < 1.01 * record.J[0]:
        unit = unit_for("kg m2", record.motion.motion)
        return TOO_HEAVY.format(declared, unit, record.lighter, OFF)
    left = _left(last)
    return (
        UNRELATED.format(100.0 * left) if left > HALF else None
    )  # an effect as large would be unseen


def _left(base: Base) -> float:
    """What a model leaves, as a share of the torque."""
    return rms(base.made.r) * base.view.scale.sigma / max(rms(base.y), 1e-300)
