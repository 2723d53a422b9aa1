"""What friction may do near rest: shapes that turn over, dip, or hold, and their choice."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..dataset.measured_bristle import GONE, along
from .constants import (
    CLEARLY,
    DIP_SPEEDS,
    DIPS,
    FEWEST_TURNS,
    LEAST_COLUMN,
    REST_TORQUE,
    RISE,
    SIGNIFICANT,
    TURN_DISTANCES,
    TURNS,
)
from .fit import Fit, fit, independent, regress
from .terms import Term
from .track import Track
from .windows import Source


@dataclass(frozen=True)
class Bristle:
    """Coulomb friction that turns over within a distance after a reversal (Dahl).

    As :func:`~lugrectl.identification.dataset.measured_bristle.along`; sign(w) for a distance of 0.
    """

    distance: float

    def __call__(self, track: Track) -> np.ndarray:
        if not self.distance:
            return np.sign(track.speed)
        return along(*track.strokes, self.distance)


@dataclass(frozen=True)
class Between:
    """The difference of two turning distances."""

    near: float
    far: float

    def __call__(self, track: Track) -> np.ndarray:
        return Bristle(self.far)(track) - Bristle(self.near)(track)


@dataclass(frozen=True)
class Dip:
    """sign(w) exp(-(|w|/speed)^power), power 1 or 2: friction that falls with speed (Stribeck)."""

    speed: float
    power: int

    def __call__(self, track: Track) -> np.ndarray:
        x = np.abs(track.speed / self.speed).astype(np.float32)  # six digits, in half the time
        x = np.minimum(x if self.power == 1 else x * x, GONE)
        return np.sign(track.speed) * np.exp(-x)


@dataclass(frozen=True)
class Bend:
    """w |w| / speed^2: friction that grows faster than the speed (drag)."""

    speed: float

    def __call__(self, track: Track) -> np.ndarray:
        return track.speed * np.abs(track.speed) / self.speed**2


def stopping(track: Track) -> np.ndarray:
    """At rest, the direction of the motion before."""
    return track.stopping


def starting(track: Track) -> np.ndarray:
    """At rest, the direction of the motion after."""
    return track.starting


def shapes_near_rest(speed: float, half_width: float) -> list[Term]:
    """The terms that carry what the shape of friction near rest leaves open."""
    length = speed * half_width
    turns = [
        Term(f"turn {i}", Between(a * length, b * length), share, True)
        for i, ((a, b), share) in enumerate(TURNS)
    ]
    dips = [Term(f"near dip {v}", Dip(v * speed, 1), share, True) for v, share in DIPS]
    rest = [Term(c.__name__, c, REST_TORQUE, True) for c in (stopping, starting)]
    return [*turns, *dips, *rest]


def with_rest(tracks: Sequence[Track], limit: float) -> list[Track]:
    """The tracks with the direction before and after each rest, |w| < ``limit``."""
    return [_with_rest(track, limit) for track in tracks]


def _with_rest(track: Track, limit: float) -> Track:
    rests = np.abs(track.speed) < limit
    moving = np.flatnonzero(~rests)
    if not len(moving):
        none = np.zeros(len(track))
        return replace(track, stopping=none, starting=none)
    i = np.searchsorted(moving, np.arange(len(track)))
    before = np.sign(track.speed[moving[np.maximum(i - 1, 0)]]) * (i > 0)
    after = np.sign(track.speed[moving[np.minimum(i, len(moving) - 1)]]) * (i < len(moving))
    return replace(track, stopping=rests * before, starting=rests * after)


@dataclass(frozen=True, eq=False)
class Chosen:
    """A fit with the shape that was taken.

    ``anchor`` is that fit in the first comparison, ``others`` all fits of that comparison.
    """

    fit: Fit
    anchor: Fit | None = None
    others: tuple[Fit, ...] = ()


def with_turning(source: Source, made: Fit, speed: float) -> Chosen:
    """Coulomb friction that turns over within a distance, where that is clearly more likely."""
    length = speed * made.half_width
    low, high, count = TURN_DISTANCES
    distances = length * np.geomspace(low, high, count)
    shapes = [Term("Fc", Bristle(float(x)), friction=True) for x in distances]
    if "Fc" not in made.names:
        return Chosen(made)
    place = made.names.index("Fc")
    return _choose(source, made, shapes, place)


def with_dip(source: Source, made: Fit, speed: float, lowest: float) -> Chosen:
    """Friction that falls with speed (Stribeck), or is lower right at rest."""
    speeds = np.geomspace(lowest, max(0.25 * speed, 1.01 * lowest), DIP_SPEEDS)
    shapes = [Term("dip", Dip(float(v), n), friction=True) for v in speeds for n in (1, 2)]
    return _choose(source, made, shapes, None, RISE * speed)


def _choose(
    source: Source, made: Fit, shapes: Sequence[Term], place: int | None, rise: float = 0.0
) -> Chosen:
    """The most likely of the shapes, in the place of a term or beside all of them."""
    terms, m = list(made.terms), len(made.terms)
    setting = made.setting
    all_of = source.windows(made.half_width, [*terms, *shapes], setting.rest, made.delay)
    if all_of is None:
        return Chosen(made)
    plain = regress(all_of.only(range(m)), terms, setting, made.delay)
    tried = []
    for i, shape in enumerate(shapes):
        if np.abs(all_of.X[:, m + i]).max() <= LEAST_COLUMN:
            continue
        picked = [m + i if k == place else k for k in range(m)]
        named = [shape if k == place else term for k, term in enumerate(terms)]
        if place is None:
            picked, named = [*picked, m + i], [*named, shape]
        tried.append(regress(all_of.only(picked), named, setting, made.delay, plain))
    if place is None:
        tried = [f for f in tried if _is_dip(f, m, rise)]
    if not tried:
        return Chosen(made)
    best = max(tried, key=lambda f: f.score)
    others = (plain, *tried)
    if best.score <= plain.score + CLEARLY:
        return Chosen(made, plain, others)
    again = fit(source, made.half_width, best.terms, setting, made.delay)
    return Chosen(again, best, others) if again else Chosen(made, plain, others)


def _is_dip(made: Fit, at: int, rise: float) -> bool:
    """A dip is significant; friction that is lower near rest is so right at rest only."""
    column = made.terms[at].column
    assert isinstance(column, Dip)
    significant = abs(made.p[at]) > SIGNIFICANT * np.sqrt(made.V[at, at])
    return bool(significant and (made.p[at] > 0 or column.speed < rise))


def reversals(tracks: Sequence[Track], rest: float) -> int:
    """How often the motion turns."""
    moving = [np.sign(p.speed[np.abs(p.speed) >= rest]) for p in tracks]
    return sum(int(np.count_nonzero(np.diff(side))) for side in moving)


def turns_often(tracks: Sequence[Track], rest: float) -> bool:
    """Whether there are reversals enough to see how friction turns over."""
    return reversals(tracks, rest) >= FEWEST_TURNS


def spread(taken: Fit, anchor: Fit, others: Sequence[Fit]) -> np.ndarray:
    """sum_j pi_j (p_j - p)(p_j - p)', over fits j that the windows hardly distinguish.

    pi_j is proportional to exp(score_j / k), with k windows for each independent one. p are the
    values of ``anchor``.
    """
    score = np.array([f.score for f in others]) / independent(taken)
    share = np.exp(score - score.max())
    share /= share.sum()
    gap = np.array([difference(taken, f, anchor) for f in others])
    return (share[:, None] * gap).T @ gap


def difference(taken: Fit, other: Fit, anchor: Fit) -> np.ndarray:
    """What ``other`` says of the coefficients of ``taken``, minus what ``anchor`` says of them."""
    own = dict(zip(anchor.names, anchor.p, strict=False))
    said = dict(zip(other.names, other.p, strict=False))
    gap = np.zeros(len(taken.p))
    for i, name in enumerate(taken.names):
        if name in own and name in said:
            gap[i] = said[name] - own[name]
    m, n, k = len(taken.names), len(other.names), len(anchor.names)
    if len(taken.p) > m and len(other.p) > n and len(anchor.p) > k:
        gap[m:] = other.p[n:] - anchor.p[k:]
    return gap
