"""Stepwise selection: which effects are significant in a map of torque over speed."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from scipy.stats import f as fisher
from scipy.stats import norm, rankdata

from ..blocks.block import Block, members
from ..blocks.model import Model
from ..core.numeric import rms
from ..estimates.findings import Candidate
from ..identification.candidates.applicable import worth_trying
from ..identification.candidates.search_ranges import grid_of, sets_of
from ..identification.likelihood.parameters import typical
from ..identification.selection import LEAST
from .curve import Curve, hangs_on_angle
from .fit import fit
from .points import Points, laid, straight

CHANCE = 0.01  # probability that any effect is named although nothing is missing
ALIKE = 4.0  # misfit, in variances, within which two models explain a map equally well
MOST_EFFECTS = 3
STEPS = 30.0  # size of a test step, in typical steps
LAW = Candidate("stribeck", 0.0, 0.0)  # the declared law's own fall at low speed
QUARTERS = [0.0, np.pi / 2.0, np.pi, -np.pi / 2.0]  # of a phase: one is near enough to start from
DRAWS, CHANCE_LEFT = 999, 0.01  # permutations of the residuals, and the level of their test

Named = tuple[str, Curve]
End = tuple[list[tuple[str, list[str]]], Curve]


@dataclass(frozen=True)
class Chosen:
    """An accepted effect, and what explains the map equally well."""

    key: str
    name: str
    tied: tuple[Candidate, ...]


@dataclass(frozen=True)
class Choice:
    """The best fit of the declared law, that with the accepted effects, and all candidates."""

    base: Curve
    final: Curve
    steps: tuple[Chosen, ...]
    ranking: tuple[Candidate, ...]


def choose(base: Curve, say: Callable[[str], None], simpler: Curve | None = None) -> Choice:
    """Add the effect that explains most, refit everything, repeat.

    If several explain a map equally well each is followed: a later effect may distinguish them.
    ``simpler`` is the law without its fall at low speed, which may imitate an effect: its way is
    taken where it explains more for its number of values. Where the fall explains the map as well
    it is tied with the effect.
    """
    tried = _tried(base, say, 1)
    steps, final = _best(_followed(base, tried, say, 1))
    if simpler is not None:
        other, end = _best(_followed(simpler, _tried(simpler, say, 1), say, 1))
        if other and price(end) < price(final):
            even = final.misfit < end.misfit + ALIKE and other[0][0] not in dict(steps)
            made = [_looked_again(end, *step) for step in other]
            made[0] = replace(made[0], tied=(*made[0].tied, *([LAW] if even else [])))
            return Choice(base, end, tuple(made), _ranking(base, tried))
    made = [_looked_again(final, *step) for step in steps]
    return Choice(base, final, tuple(made), _ranking(base, tried))


def _best(ends: Sequence[End]) -> End:
    """The end with the fewest values of those that explain most for their number."""
    least = min(price(curve) for _, curve in ends)
    even = [end for end in ends if price(end[1]) < least + ALIKE]
    return min(even, key=lambda end: (len(end[1].coords), price(end[1])))


def price(curve: Curve) -> float:
    """The misfit, and for each value what one may explain by chance."""
    return curve.misfit + ALIKE * len(curve.coords)


def _tried(current: Curve, say: Callable[[str], None], turn: int) -> list[Named]:
    """The model with each candidate, best first."""
    say(f"trying effects that depend on speed, round {turn}")
    names = candidates(current.model, current.at)
    tried = [(name, _with(current, name)) for name in names]
    return sorted(tried, key=lambda one: one[1].misfit)


def _followed(
    current: Curve, tried: Sequence[Named], say: Callable[[str], None], turn: int
) -> list[End]:
    """All ways on: the keys of the effects added, what explained as much, and the model."""
    chance = CHANCE / max(len(tried), 1)
    sound = [(n, c) for n, c in tried if by_chance(current, c) < chance and _worth(c)]
    even, ways = _even(sound), []
    for name, curve in even:
        step = curve.model.effects[-1].key, [n for n, _ in even if n != name]
        more = [] if turn == MOST_EFFECTS else _tried(curve, say, turn + 1)
        ways += [([step, *rest], end) for rest, end in _followed(curve, more, say, turn + 1)]
    return ways or [([], replace(current, rivals=tuple(curve for _, curve in tried)))]


def candidates(model: Model, at: Points) -> list[str]:
    """Applicable effects that a drive at steady speed shows, by its speed or its angles alone.

    Those over the angle add linearly: a place or a count per turn would be searched in the means
    of a few runs.
    """
    every = [(name, members("effect")[name]) for name in worth_trying(model)]
    return [
        name
        for name, made in every
        if shows(made, at) and (not hangs_on_angle(made) or _adds_linearly(made))
    ]


def shows(made: Block, at: Points) -> bool:
    """True if an effect shows at a steady speed, by this speed alone or by the angles passed."""
    bare = not (made.states or made.exact) and (made.load or not made.timed)
    acts = {act.removeprefix("+") for act in made.acts}
    read = {"w", "theta"} if at.over_angle else {"w"}
    return bare and set(made.inputs) <= read and acts <= {"torque", "Fc", "Fs", "Fv"}


def _adds_linearly(made: Block) -> bool:
    """True if an effect is linear in its strength and over the span of its other parameters."""
    return all(p.span is not None for k, p in made.own.items() if k != made.gain)


def _worth(curve: Curve) -> bool:
    return curve.size(curve.model.effects[-1].key) > LEAST


def by_chance(before: Curve, after: Curve) -> float:
    """Probability that chance reduces the misfit as much (F test, weights of the larger model).

    The point that gains most in each direction is left out: what one speed shows is no law.
    """
    gains = before.gains(after)
    ways = [gains[after.at.w * side > 0.0] for side in (-1.0, 1.0)]
    certain = sum(way.sum() - way.max() for way in ways if len(way))
    more = len(after.coords) - len(before.coords)
    free = len(after.sigma) - len(after.coords) - len(ways)
    if more < 1 or free < 1:
        return 1.0
    return float(fisher.sf(certain / more / max(after.cost(after.sigma) / free, 1.0), more, free))


def least_seen(curve: Curve) -> float:
    """The smallest torque of an effect with one value that the test can find, over friction.

    Such a torque gains its square over the scatter at every point; the F test does not count the
    point that gains most in each direction.
    """
    at, many = curve.at, max(len(candidates(curve.model, curve.at)), 1)
    ways = len(np.unique(np.sign(at.w)))
    free = len(at.w) - len(curve.coords) - 1 - ways
    if free < 1:
        return np.inf
    gain = float(fisher.isf(CHANCE / many, 1, free)) / (len(at.w) - ways)
    return float(np.median(curve.sigma[: len(at.w)])) * float(np.sqrt(gain)) / rms(curve.friction)


def left_over(curve: Curve, seed: int) -> bool:
    """True if the residual still depends on speed (permutation test).

    Then residuals of neighbours in speed are alike, or those of the same speed in both directions.
    The test uses ranks: one run far off is no evidence.
    """
    ways = [curve.at.w * side > 0.0 for side in (-1.0, 1.0)]
    order = [np.flatnonzero(way)[np.argsort(np.abs(curve.at.w[way]))] for way in ways]
    ranks = rankdata(curve.residual / curve.sigma[: len(curve.at.w)])
    sizes, e = [np.abs(curve.at.w[o]) for o in order], norm.ppf(ranks / (len(ranks) + 1.0))
    draw = np.random.default_rng(seed)
    drawn = [draw.permuted(np.tile(e[o], (DRAWS, 1)), axis=1) for o in order]
    drawn = [np.concatenate([e[o][None], d]) for o, d in zip(order, drawn, strict=True)]
    alike = _alike(sizes, drawn)  # the first are the residuals as they are
    rare = np.mean(alike >= alike[:, :1], axis=1)
    size = float(np.std(curve.residual)) / float(np.std(curve.at.u))
    return bool(min(rare) <= 0.5 * CHANCE_LEFT and size > LEAST)


def _alike(sizes: Sequence[np.ndarray], ways: Sequence[np.ndarray]) -> np.ndarray:
    """How alike residuals (draws, n) of neighbours in speed are, and those of the two directions;
    (2, draws)."""
    beside = np.sum([np.sum(e[:, 1:] * e[:, :-1], axis=1) for e in ways], axis=0)
    if not all(map(len, sizes)):
        return np.array([beside])
    there = ways[1] @ [np.interp(sizes[0], sizes[1], one) for one in np.eye(len(sizes[1]))]
    return np.array([beside, np.abs(np.sum(ways[0] * there, axis=1))])


def _with(current: Curve, name: str) -> Curve:
    """The best fit with one more effect."""
    made = members("effect")[name]
    model = current.model.with_effect(name, {k: p.value for k, p in made.own.items()})
    key = model.effects[-1].key
    starts = [
        current.values
        | {k: v for k, v in own.items() if k in current.values}
        | {f"{key}.{k}": float(own.get(k, p.value)) for k, p in made.own.items()}
        for own in _starts(current, made)
    ]
    return fit(model, current.at, starts, current.anchor, current.opened, current.apart)


def _starts(current: Curve, made: Block) -> list[dict[str, float]]:
    """Sets of values that the effect proposes, or a small one at each point of its grids."""
    log = laid(current.at, current.model.motion).log
    if sets := sets_of(made):
        return sets(log, current.values)
    little = _little(made, current.at, current.model.motion)
    grids = {k: grid(log).tolist() for k in made.own if (grid := grid_of(made, k))}
    grids |= {k: QUARTERS for k, p in made.own.items() if p.angle and k not in grids}
    return [{made.gain: little} | dict(zip(grids, one, strict=True))
            for one in product(*grids.values())]  # fmt: skip


def _little(made: Block, at: Points, motion: str) -> float:
    """A small strength: at none at all, the other values of an effect show nothing."""
    return STEPS * typical(made.parameters[made.gain], laid(at, motion).log)


def _even(sound: Sequence[Named]) -> list[Named]:
    """Those that explain the map as well as the first."""
    if not sound:
        return []
    top = sound[0][1]
    most = top.cost(top.sigma) + ALIKE
    return [(name, curve) for name, curve in sound if curve.cost(top.sigma) < most]


def _looked_again(whole: Curve, key: str, others: Sequence[str]) -> Chosen:
    """An effect with the ties that explain as much beside the later effects, too."""
    tied = []
    if others:
        without = _without(whole, key)
        tried = [(name, _with(without, name)) for name in others]
        even = [(n, c) for n, c in tried if c.cost(whole.sigma) < whole.cost(whole.sigma) + ALIKE]
        tied = [_candidate(without, n, c) for n, c in even]
    return Chosen(key, whole.model.part(key).block.name, tuple(tied))


def _without(whole: Curve, key: str) -> Curve:
    rest = tuple(part for part in whole.model.effects if part.key != key)
    values, anchor = (
        {k: v for k, v in of.items() if not k.startswith(f"{key}.")}
        for of in (whole.values, whole.anchor)
    )
    bare = replace(whole.model, effects=rest)
    return fit(bare, whole.at, [values], anchor, whole.opened, whole.apart)


def _ranking(current: Curve, tried: Sequence[tuple[str, Curve]]) -> tuple[Candidate, ...]:
    made = [_candidate(current, name, curve) for name, curve in tried]
    return tuple(sorted(made, key=lambda c: -c.score))


def _candidate(before: Curve, name: str, after: Curve) -> Candidate:
    key = after.model.effects[-1].key + "."
    own = {k.removeprefix(key): v for k, v in after.values.items() if k.startswith(key)}
    whole = before.cost(after.sigma)
    gain = whole - after.cost(after.sigma)
    return Candidate(name, 0.5 * gain, gain / whole, own)


def started(model: Model, at: Points) -> list[dict[str, float]]:
    """Start values of a fit: the declared ones, and guesses where one is missing."""
    given, size = model.values(), np.abs(at.w)
    level, slope = straight(at, model.motion)
    Fc = given.get("Fc") or max(float(level), 0.05 * float(np.std(at.u)))
    guess = {"Fc": Fc, "Fs": 1.2 * Fc, "Fv": max(float(slope), 0.05 * Fc / size.max())}
    known = {k: v for k, v in given.items() if v is not None}
    default = {k: p.value for k, p in model.declarations().items()}
    for part in model.effects:
        default[f"{part.key}.{part.block.gain}"] = _little(part.block, at, model.motion)
    whole = {k: float(v) for k, v in (default | guess | known).items() if k in given}
    turned = [k for k, p in model.declarations().items() if p.angle and k not in known]
    phases = [dict(zip(turned, one, strict=True)) for one in product(QUARTERS, repeat=len(turned))]
    return [whole | phase for phase in phases]
