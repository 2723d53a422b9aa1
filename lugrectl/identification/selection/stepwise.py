"""Several effects: after each that joins the base the table is made again, then each is exchanged.

A pair can hide behind a third effect that imitates both. So each effect in turn is taken out again
and tried against all others beside those that stay.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from ..candidates.base_model import Base
from ..candidates.candidate import Contender, enter
from ..candidates.refined_friction import each_in_its_own_law
from .table import ALIKE, Table, as_good, tabulate

MOST = 4  # effects of one record
SWEEPS = 2  # times that every effect is tried against all others

Fits = Callable[[Contender, Table], bool]


def all_of(first: Sequence[Contender], fits: Fits) -> list[Contender]:
    """The effects, with those that further rounds add.

    ``fits`` says whether a contender is proven and large enough beside the base of its table.
    """
    effects = list(first)
    while len(effects) < MOST:
        table = tabulate(effects[-1].joined())
        new = next((c for c in table.named if fits(c, table)), None)
        if new is None or _better_unknown(new, table):
            break
        effects.append(new)
    return effects


def _better_unknown(c: Contender, table: Table) -> bool:
    """Whether an unknown torque explains more than the next effect."""
    if not table.unknown:
        return False
    d, se = table.unknown[0].above(c)
    return d > ALIKE * se


def exchanged(
    start: Base, effects: Sequence[Contender], fits: Fits
) -> tuple[list[Contender], tuple[Contender, ...]]:
    """Each effect the best beside the others, and what explains as much as the first of them."""
    made, also = list(effects), ()
    for _ in range(SWEEPS):
        before = [c.name for c in made]
        for i in range(len(made)):
            others = chained(start, [*made[:i], *made[i + 1 :]])
            table = tabulate(others[-1].joined())  # there are two effects at least
            best, alike = _best(made[i], table, fits)
            made[i] = best or made[i]
            also = alike if i == 0 else also
        if [c.name for c in made] == before:
            break
    return made, also


def _best(
    own: Contender, table: Table, fits: Fits
) -> tuple[Contender | None, tuple[Contender, ...]]:
    good = each_in_its_own_law([c for c in table.named if fits(c, table)])
    if not good:
        return None, ()
    mine = next((c for c in good if c.name == own.name), None)
    best = good[0]
    if mine is not None and as_good(mine, best):
        best = mine
    return best, tuple(c for c in good if c is not best and as_good(c, best))[:3]


def chained(start: Base, effects: Sequence[Contender]) -> list[Contender]:
    """The effects, each entered beside those before it."""
    base, made = start, []
    for c in effects:
        one = c if c.base is base else enter(base, c.entry)
        made.append(one)
        base = one.joined()
    return made
