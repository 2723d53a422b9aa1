"""The table: what the base leaves, explained by each effect and by an unknown torque."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from ...blocks.block import Block
from ...engine.runtime.threads import beside
from ..candidates import search
from ..candidates import unknown_torque as unknown
from ..candidates.base_model import Base, Columns, Record, View, rms
from ..candidates.candidate import Contender, Entry, enter
from ..candidates.friction_level import levelled
from ..candidates.friction_shape import settled
from ..candidates.position_error import corrected
from ..regression.numbers import COARSE, LEAST, MORE, UNKNOWN
from ..regression.robust_regression import Scale, solve, weights

SETTLE = 20.0  # nats from which the base is settled beside the likeliest effect
USED = 2.0  # nats from which an explanation is a part of the richest description
RICH = 0.3  # of friction: prior of a named effect in it
HELD = 0.03  # of the inertia: prior of it there, or what imitates u would take it away
MAD = 1.38  # sigma of a Student density of 4 degrees of freedom, in medians of the absolute value
MOST_LEVERAGE = 0.95
TURNED = 0.8  # rad of travel from which gravity is looked for first
HEAVY = 0.3  # of friction: gravity that hides what else is missing
ALIKE = 2.33  # paired standard errors within which two models explain equally well
OFFSETS = {"constant_torque", "coulomb_asymmetry"}  # they differ near reversals only
PART = 0.3  # of the gain of the best, below which another is not as good


@dataclass(frozen=True, eq=False)
class Table:
    """A base, the named contenders and the unknown torques, each the best of its name."""

    base: Base
    named: tuple[Contender, ...]
    unknown: tuple[Contender, ...]

    @property
    def rows(self) -> list[Contender]:
        return sorted([*self.named, *self.unknown], key=lambda c: -c.gain)


def tabulate(base: Base) -> Table:
    """All contenders against one base."""

    def named(block: Block) -> list[Contender]:
        with np.errstate(all="ignore"):  # each thread has its own
            best = best_of(enter(base, e) for e in search.entries(base, block))
            return [corrected(levelled(c)) for c in best]

    def free(entry: Entry) -> list[Contender]:
        with np.errstate(all="ignore"):
            return [enter(base, entry)]

    works = [partial(named, block) for block in search.shown(base)]
    works += [partial(free, entry) for entry in unknown.entries(base)]
    found = best_of(c for made in beside(lambda work: work(), works) for c in made)
    return Table(
        base,
        tuple(c for c in found if not c.depends_on),
        tuple(c for c in found if c.depends_on),
    )


def best_of(contenders: Iterable[Contender]) -> list[Contender]:
    """The best of each name, the best first."""
    best: dict[str, Contender] = {}
    for c in contenders:
        if c.name not in best or c.gain > best[c.name].gain:
            best[c.name] = c
    return sorted(best.values(), key=lambda c: -c.gain)


def with_known(base: Base, table: Table) -> Base:
    """The base that knows the shapes of loads behind springs: they are searched once."""
    loads = {c.name: tuple(c.values.values()) for c in table.named if "damping_ratio" in c.values}
    return replace(base, known=loads)


def decided(
    record: Record, weighed: bool = True
) -> tuple[Table, Contender | None, tuple[Contender, ...]]:
    """The table of a record, with the scale of its richest description.

    A first, quick table finds presliding and Stribeck speed beside the likeliest effect, and the
    noise; a second one decides. Gravity so large that nothing else can be seen before it is in the
    model joins the base: it is returned, with what explains the record as well.
    """
    base = in_time(settled(record))
    record, first = base.record, tabulate(base)
    base = with_known(base, first)
    heavy, also = weight(first) if weighed else (None, ())
    gravity = heavy is not None
    if gravity:
        base = replace(settled(record, base.view, True), known=base.known)
        first = tabulate(base)
    top = first.named[0] if first.named else None
    if top is not None and top.gain > SETTLE:
        again = settled(record, base.view, gravity, top.its if top.own else None, top.u)
        base = replace(again, known=base.known)
    return tabulate(base.seen_as(richest(base, first))), heavy, also


def in_time(base: Base) -> Base:
    """The base with the torque as late as it found it, where a derivative is too coarse for that.

    What the derivative leaves of a shift s is s^2 u''/2.
    """
    record, s = base.record, float(base.made.b[1])
    m = record.motion
    left = 0.5 * s * s * rms(record.mean(m.slope(m.slope(m.u))))
    if left < COARSE * LEAST * base.friction_rms:
        return base
    return settled(record.later(s))


def weight(table: Table) -> tuple[Contender | None, tuple[Contender, ...]]:
    """Gravity that hides everything else, and what explains the record as well."""
    record = table.base.record
    g = next((c for c in table.named if c.name == "gravity"), None)
    if g is None or record.motion.span < TURNED or not record.sure:
        return None, ()
    top = table.named[0]
    if g.share < HEAVY or g.gain < SETTLE or not (record.heavy or g.gain > 0.5 * top.gain):
        return None, ()
    also = [c for c in table.named if c.name in ("constant_torque", "return_spring")]
    close = tuple(c for c in also if c.gain > 0.97 * g.gain or as_good(c, g))
    return g, close


def as_good(c: Contender, best: Contender) -> bool:
    """Whether the record does not distinguish a contender from the best one.

    An offset and an asymmetry differ where presliding decides, which windows hardly see: they are
    alike while their models differ by less than a torque without a name has to have.
    """
    d, se = best.above(c)
    alike = d < max(ALIKE * se, 3.0)
    if {best.name, c.name} == OFFSETS:
        torque = best.columns.X @ best.made.b - c.columns.X @ c.made.b
        alike = alike or rms(torque) < UNKNOWN * LEAST * best.base.friction_rms
    return c.gain > PART * best.gain and alike


def richest(base: Base, table: Table) -> View:
    """Scale of the noise and weights of the windows, with everything in the model at once.

    Each term has its prior. The inertia stays near that of the base: else what imitates u would
    take it away, and the noise with it.
    """
    own = base.columns
    parts = [_with_prior(c, base) for c in table.named if c.gain > USED and c.share > 0.002]
    parts += [c.its for c in table.unknown if c.gain > USED]
    c = own
    for part in parts:
        c = c + part
    X, y = c.X, base.y - base.J * c.X[:, 0]
    prior, low, high = c.prior.copy(), c.low.copy(), c.high.copy()
    prior[0], low[0], high[0] = 1 / (HELD * base.J) ** 2, -np.inf, np.inf
    k = own.X.shape[1]
    low[k:], high[k:] = -np.inf, np.inf
    scale = base.view.scale
    made = solve(X, y, prior, low, high, scale, rounds=4)
    e = made.r * scale.sigma
    spread = MAD * float(np.median(np.abs(e)))
    sigma = spread * float(np.sqrt(1 + min(0.5, X.shape[1] / len(e))))
    weight = weights(e / max(sigma, 1e-300))
    sigma = max(sigma, MAD * float(np.median(np.abs(e) / _room(X, weight, prior, sigma))))
    sigma = max(sigma, 1e-9 * rms(base.y))
    J = max(float(made.b[0]) + base.J, 0.5 * base.J)
    return View(Scale(sigma, scale.noise), weights(e / sigma), J, quick=False)


def _room(X: np.ndarray, weight: np.ndarray, prior: np.ndarray, sigma: float) -> np.ndarray:
    """What a fit to all leaves of a row, over what a fit without the row would leave."""
    G = X.T @ (X * weight[:, None])
    own = np.diag(G).copy()
    G[np.diag_indices(len(G))] += prior * sigma**2 + 1e-10 * own + 1e-300
    lever = np.einsum("ij,ij->i", X, np.linalg.solve(G, X.T).T) * weight
    return np.maximum(1 - lever, 1 - MOST_LEVERAGE)


def _with_prior(c: Contender, base: Base) -> Columns:
    """The columns of a named effect, or what its torque takes off u, with a wide prior."""
    own = c.its
    X = own.X if c.own else base.record.mean(base.u - (base.u if c.u is None else c.u))[:, None]
    k = X.shape[1]
    prior = np.mean(X**2, axis=0) / (RICH * base.friction_rms) ** 2
    return Columns(X, prior, np.full(k, -np.inf), np.full(k, np.inf))


@dataclass(frozen=True)
class Bars:
    """The least share of friction that matters, and standard errors that chance does not reach."""

    least: float
    z: float

    def proven(self, table: Table, contenders: Sequence[Contender]) -> list[Contender]:
        """Those better than the base by more than the choice among so many may give."""
        bar = bar_of(table.named)
        above = [(c, *c.above(table.base)) for c in contenders]
        return [c for c, d, se in above if d > bar and d > self.z * se]

    def open_in(self, table: Table) -> float:
        """Nats of a torque that matters and stays unexplained: models may well differ as much."""
        large = [c for c in table.unknown if c.share > self.least]
        return max((c.gain for c in self.proven(table, large)), default=0.0)


def bar_of(choice: Sequence[object]) -> float:
    """Nats that the best of a choice may gain by chance."""
    return float(np.log(max(len(choice), 1))) + MORE
