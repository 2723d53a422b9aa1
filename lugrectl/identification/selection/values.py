"""The values of the named model as the comparison has them, with their joint covariance.

The last row of the table is a linear regression in all but what was searched (a delay, a
frequency, the presliding distance, ...). So each of these has one more column, the slope of the
torque along it, and leaving a part of the record out moves all values together. What another
description of friction makes of them is counted as an error, too: a spread over blocks does not
show it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ...blocks.block import REGISTRY, Block
from ...blocks.model import Model
from ..candidates.base_model import LEVELS, SLIGHT, WEIGHT, Base, Columns
from ..candidates.candidate import Contender, enter
from ..candidates.effect_columns import columns
from ..candidates.friction_level import on_level
from ..candidates.friction_shape import columns_at
from ..candidates.friction_terms import LAW, NAMES
from ..candidates.search import applied
from ..candidates.spring_loads import load_columns
from ..candidates.start_values import CURVE, bristle, curve_of, values_of
from ..regression.numbers import BIASED, FEWEST_PARTS, SLIGHTLY, SPREADS
from ..regression.robust_regression import Solution, solve
from ..regression.score import Blocks, moves

STEP = 1e-3  # relative, of a value that was searched
MAD = 1.48  # standard deviations in a median of absolute values
NEAR = 0.2  # relative: what was searched in all of a record is so near in a part of it
LOAD = "damping_ratio"  # among the values of a load on a spring


@dataclass(frozen=True)
class Valued:
    """Values by key, "J" or "effect.parameter", and their covariance (n, n), SI.

    ``sure`` are those of which the record says something: the others have no interval.
    ``trained`` are the values without the samples that are held out, ``spread`` the usual
    standard deviations over parts of the record alone.
    """

    values: Mapping[str, float]
    matrix: np.ndarray = field(compare=False, repr=False)
    sure: frozenset[str] = frozenset()
    trained: Mapping[str, float] = field(default_factory=dict)
    spread: Mapping[str, float] = field(default_factory=dict)

    def half(self, key: str) -> float | None:
        """Half of the 95 % interval; None where there is none."""
        if key not in self.sure:
            return None
        i = list(self.values).index(key)
        return 1.96 * float(np.sqrt(self.matrix[i, i]))

    def may_be_nothing(self, name: str, whole: bool = False) -> bool:
        """Whether an effect's strength may as well be the value that changes nothing, by its spread
        over the record; by its ``whole`` interval, where it joined before all else, or where the
        record has too few parts for a spread."""
        block = REGISTRY["effect", name]
        key, neutral = f"{name}.{block.gain}", block.own[block.gain].neutral
        if key not in self.sure or neutral is None or not np.isfinite(neutral):
            return False
        half = (self.half(key) or 0.0) if whole else 1.96 * self.spread[key]
        return abs(self.values[key] - neutral) < half

    def by(self, places: Mapping[str, str]) -> Valued:
        """The same under other names of the effects; without those that have none there."""
        new = {k: self._key(k, places) for k in self.values}
        at = [i for i, k in enumerate(self.values) if new[k]]
        kept = {new[k]: v for k, v in self.values.items() if new[k]}
        sure = frozenset(new[k] for k in self.sure if new[k])
        trained = {new[k]: v for k, v in self.trained.items() if new[k]}
        spread = {new[k]: v for k, v in self.spread.items() if new[k]}
        return Valued(kept, self.matrix[np.ix_(at, at)], sure, trained, spread)

    @staticmethod
    def _key(key: str, places: Mapping[str, str]) -> str:
        name, dot, own = key.partition(".")
        place = places.get(name, "")
        return f"{place}.{own}" if dot and place else "" if dot else key


@dataclass(frozen=True, eq=False)
class HeldOut:
    """Samples that no value may have seen: of a run, from one time (s) to another."""

    run: np.ndarray
    start: np.ndarray
    end: np.ndarray

    def has(self, run: np.ndarray, t: np.ndarray, margin: float) -> np.ndarray:
        """Which of these samples are held out, or so near that a window has some (n,)."""
        made = np.zeros(len(t), bool)
        for r, a, b in zip(self.run, self.start, self.end, strict=True):
            made |= (run == r) & (t > a - margin) & (t < b + margin)
        return made


@dataclass(frozen=True, eq=False)
class _Slope:
    """A value that was searched: whose it is, how near another part of the record has it, and the
    torque (m,) that one more of it adds."""

    owner: int
    key: str
    near: float
    torque: np.ndarray


def valued(
    last: Base,
    effects: Sequence[Contender],
    model: Model,
    held_out: HeldOut | None = None,
) -> Valued:
    """The values of a base with ``effects`` in it, in the order in which they joined.

    ``last`` is the base where there are none.
    """
    chain = _chain(effects)
    base = replace(chain[-1].joined(), levels=None) if chain else last
    slopes = list(_slopes(base, chain))
    whole = _with_slopes(base.columns, slopes)
    made = solve(whole.X, base.y, whole.prior, whole.low, whole.high, base.view.scale)
    made = _at_zero(made, base.made, len(slopes))
    read = _reader(base, chain, slopes, model)
    values = read(made.b)
    keys, at = list(values), np.array(list(values.values()))
    C, usual = _covariance(base, whole, made, lambda b: _apart(read(b), values))
    kindred = _kindred(base, chain, keys, at)
    spread = dict(zip(keys, np.hypot(usual, kindred).tolist(), strict=True))
    if "gravity" not in {c.name for c in chain} and "gravity.amplitude" in spread:
        spread["gravity.amplitude"] += SLIGHTLY * base.friction_rms  # what every drive has of it
    C[np.diag_indices(len(at))] += kindred**2
    for other in _descriptions(base):
        d = _apart(read(np.append(other, np.zeros(len(slopes)))), values)
        C += np.outer(d, d)
    C[np.diag_indices(len(at))] += (BIASED * at) ** 2
    free = {c.name for c in chain if c.own or c.u is not None}
    sure = {k for k in keys if "." not in k or k.split(".")[0] in {*free, "gravity"}}
    if not values["Fc"] < values["Fs"] < _breaks_away(base):  # at a bound, vs means nothing either
        sure -= {"Fs", "vs"}
    trained = values
    if held_out is not None:
        trained = read(_without(base, whole, held_out, slopes).b)
    return Valued(values, C, frozenset(sure & {k for k in keys if values[k]}), trained, spread)


def _without(base: Base, whole: Columns, held_out: HeldOut, slopes: Sequence[_Slope]) -> Solution:
    """The coefficients, and small steps of what was searched, from the other samples alone."""
    rows, m = base.record.rows, base.record.motion
    kept = ~held_out.has(m.run[rows.at], m.stamp[rows.at], rows.h)
    if kept.sum() < 2 * whole.X.shape[1]:
        kept[:] = True
    prior = whole.prior.copy()
    prior[len(prior) - len(slopes) :] = [1.0 / s.near**2 for s in slopes]
    return solve(whole.X[kept], base.y[kept], prior, whole.low, whole.high, base.view.scale)


def _chain(effects: Sequence[Contender]) -> list[Contender]:
    """The effects, each beside those before it."""
    made: list[Contender] = []
    for c in effects:
        base = made[-1].joined() if made else c.base
        made.append(c if c.base is base else enter(base, c.entry))
    return made


def _at_zero(made: Solution, exact: Solution, slopes: int) -> Solution:
    """The solution without steps of the values that were searched, with its freedom."""
    state = np.append(exact.state, np.zeros(slopes, int))
    return replace(made, b=np.append(exact.b, np.zeros(slopes)), r=exact.r, state=state,
                   weight=exact.weight)  # fmt: skip


def _with_slopes(c: Columns, slopes: Sequence[_Slope]) -> Columns:
    if not slopes:
        return c
    return c + Columns.free(np.column_stack([s.torque for s in slopes]))


# ---------------------------------------------------------------------- what was searched
def _slopes(base: Base, chain: Sequence[Contender]) -> Iterator[_Slope]:
    """One for each value that was searched, where the torque follows it."""
    yield from _law_slopes(base)
    places = _places(base, chain)
    for i, c in enumerate(chain):
        for key, value in c.values.items():
            torque = _torque(base, c, base.made.b[places[i]])
            step = _step(base, c, key, value)
            if torque is None or not step:
                continue
            made = (torque({**c.values, key: value + step}) - torque(dict(c.values))) / step
            if np.all(np.isfinite(made)) and np.any(made):
                yield _Slope(i, key, NEAR * abs(value), made)


def _law_slopes(base: Base) -> Iterator[_Slope]:
    """Of the presliding distance and the Stribeck speed, in their logarithms."""
    x0, vs = base.law.x0, base.law.vs
    b = base.made.b
    k = min(len(b), base.columns.X.shape[1])
    for key, at in (("x0", (x0 * (1 + STEP * 10), vs)), ("vs", (x0, vs * (1 + STEP * 10)))):
        made = (columns_at(base, at).X[:, :k] - base.columns.X[:, :k]) @ b[:k] / (STEP * 10)
        if np.any(made):
            yield _Slope(-1, key, NEAR, made)


def _torque(
    base: Base, c: Contender, b: np.ndarray
) -> Callable[[Mapping[str, float]], np.ndarray] | None:
    """The torque (m,) of an effect with other values; None where it has no slope."""
    block: Block = REGISTRY["effect", c.name]
    if c.u is not None and "input" in block.acts:
        return lambda v: (
            c.base.record.driving(c.base.u) - c.base.record.driving(applied(c.base, block, dict(v)))
        )
    if not c.own or c.u is not None or c.entry.by_run or c.entry.moved is not None:
        return None
    if LOAD in c.values:
        return lambda v: load_columns(c.base, block, [tuple(v.values())]) @ b
    if block.states:
        return None
    levels = replace(c.base, levels=c.made.b[LEVELS], friction=c.base.friction_rms)
    return lambda v: columns(levels, block, v).X @ b


def _step(base: Base, c: Contender, key: str, value: float) -> float:
    """A step of a value, small beside what changes the torque; 0 where it has no slope."""
    p = REGISTRY["effect", c.name].own.get(key)
    if p is not None and (p.choices or key == "side"):
        return 0.0
    if p is not None and p.whole and base.record.motion.motion == "rotary":
        return 0.0
    if key == "time":  # one window shows it
        return 0.0
    if key == "position":
        return STEP * base.record.motion.span
    return STEP * value


def _places(base: Base, chain: Sequence[Contender]) -> list[slice]:
    """Where the columns of each effect are: the last ones, in the order in which they joined."""
    end, made = base.columns.X.shape[1], []
    for c in reversed(chain):
        made.append(slice(end - c.own, end))
        end -= c.own
    return made[::-1]


# ---------------------------------------------------------------------- coefficients -> values
def _reader(
    base: Base, chain: Sequence[Contender], slopes: Sequence[_Slope], model: Model
) -> Callable[[np.ndarray], dict[str, float]]:
    """What makes values of coefficients."""
    places, levels = _places(base, chain), _levels(base)
    parts = [_on_level(base, c, places[i], levels) for i, c in enumerate(chain)]
    first = len(base.made.b)
    heavy = base.gravity and not any(c.name == "gravity" for c in chain)

    def read(b: np.ndarray) -> dict[str, float]:
        moved: dict[int, dict[str, float]] = {}
        for s, x in zip(slopes, b[first:], strict=True):
            moved.setdefault(s.owner, {})[s.key] = float(x)
        own = moved.get(-1, {})
        x0 = base.law.x0 * float(np.exp(np.clip(own.get("x0", 0.0), -2, 2)))
        vs = base.law.vs * float(np.exp(np.clip(own.get("vs", 0.0), -2, 2)))
        J = max(float(b[0]), 1e-300)
        made = {"J": max(float(b[0]), 0.0), **levels(b), "vs": vs}  # 0 is its bound: not sure
        made |= bristle(made["Fc"], b[LEVELS], x0)
        if heavy:
            A, B = b[WEIGHT : WEIGHT + 2]
            made |= {"gravity.amplitude": float(np.hypot(A, B))}
            made |= {"gravity.phase": float(np.arctan2(B, A))}
        for i, c in enumerate(chain):
            steps = moved.get(i, {})
            values = {k: v + steps.get(k, 0.0) for k, v in c.values.items()}
            entry = replace(c.entry, values=values)
            of_level = parts[i]
            part = 1.0 if of_level is None else of_level(made)
            whole = np.append(c.made.b[: len(c.made.b) - c.own], part * b[places[i]])
            whole[0] = J
            one = replace(c, entry=entry, made=replace(c.made, b=whole))
            made |= {f"{c.name}.{k}": v for k, v in values_of(one, model).items()}
        return made

    return read


def _on_level(
    base: Base,
    c: Contender,
    place: slice,
    levels: Callable[[np.ndarray], dict[str, float]],
) -> Callable[[Mapping[str, float]], float] | None:
    """What makes the coefficient of an effect on friction a part of the level that is shown.

    Its columns have friction as the table has it, a sum of many shapes.
    """
    block = REGISTRY["effect", c.name]
    if not (on_level(block) and c.own) or c.entry.by_run:
        return None
    shown, b = levels(base.made.b), base.made.b[place]
    own = np.zeros(len(NAMES))
    own[[NAMES.index(k) for k in CURVE]] = shown["Fc"], shown["Fs"] - shown["Fc"], shown["Fv"]
    plain = columns(replace(base, levels=own), block, c.values).X @ b
    torque = base.columns.X[:, place] @ b
    key = "Fv" if "Fc" not in block.acts else "Fc"
    factor = float(torque @ plain) / max(float(plain @ plain), 1e-300)
    return lambda made: factor * shown[key] / max(made[key], 1e-9 * shown[key] + 1e-300)


def _levels(base: Base) -> Callable[[np.ndarray], dict[str, float]]:
    """Coulomb level, stiction and viscous friction of the coefficients of a base."""
    curve, most = curve_of(base.law), _breaks_away(base)

    def levels(b: np.ndarray) -> dict[str, float]:
        made = curve(b[LEVELS])
        return {**made, "Fs": min(made["Fs"], max(made["Fc"], most))}

    return levels


def _breaks_away(base: Base) -> float:
    """The largest torque of the record: no friction at rest is above it, as the drive moved."""
    return float(np.max(np.abs(base.record.motion.u))) + float(np.max(np.abs(base.weight)))


# ---------------------------------------------------------------------- errors
def _apart(a: Mapping[str, float], b: Mapping[str, float]) -> np.ndarray:
    """The differences of two sets of values, angles by the shorter way."""
    d = np.array([a[k] - b[k] for k in b])
    turns = np.array([k.endswith("phase") for k in b], bool)
    return np.where(turns, (d + np.pi) % (2 * np.pi) - np.pi, d)


def _covariance(
    base: Base, whole: Columns, made: Solution, apart: Callable[[np.ndarray], np.ndarray]
) -> tuple[np.ndarray, np.ndarray]:
    """Of the values: the larger of the jackknives over short and over long parts of the record,
    and the standard deviations from what they move by without a usual short part.

    What drifts lasts for longer than a short part, and one part may say most of a value.
    """
    moved = [_moved(whole, made, base, blocks, apart) for blocks in _parts(base)]
    each = [(len(p) - 1) / len(p) * p.T @ p for p in moved]
    usual = MAD * np.sqrt(len(moved[0])) * np.median(np.abs(moved[0]), axis=0)
    spread = np.sqrt(np.max([np.diag(c) for c in each], axis=0)) * SPREADS
    C = max(each, key=lambda c: float(np.trace(c / np.maximum(np.outer(spread, spread), 1e-300))))
    own = np.sqrt(np.maximum(np.diag(C), 1e-300))
    return C * np.outer(spread / own, spread / own), usual


def _parts(base: Base) -> list[Blocks]:
    """The blocks of the table, and fewer, longer ones."""
    short, rows = base.record.blocks, base.record.rows
    duration = float(base.record.motion.t[-1])
    return [short, Blocks.of(rows.t, duration, duration / FEWEST_PARTS)]


def _moved(
    c: Columns,
    made: Solution,
    base: Base,
    blocks: Blocks,
    apart: Callable[[np.ndarray], np.ndarray],
) -> np.ndarray:
    """How the values move without each part (parts, values): all coefficients together, since
    those of friction share its torque."""
    d = np.zeros((len(blocks.full), len(made.b)))
    d[:, made.free] = moves(made, c.X, c.prior, base.view.scale, blocks)
    p = np.array([apart(made.b + one) for one in d])
    return p - p.mean(axis=0)


def _kindred(
    base: Base, chain: Sequence[Contender], keys: Sequence[str], at: np.ndarray
) -> np.ndarray:
    """Standard deviations of the values from what every drive has of an effect's own kind: a little
    of its torque, a torque that is a little early or late, an instant within a window."""
    sizes = {c.name: SLIGHTLY / max(c.whole, SLIGHTLY) for c in chain}
    made = np.zeros(len(keys))
    for i, key in enumerate(keys):
        name, _, own = key.partition(".")
        p = REGISTRY["effect", name].own[own] if own else None
        if p is None or name not in sizes:
            continue
        if own == "time":
            made[i] = base.record.rows.h
        elif p.unit == "s" and own == REGISTRY["effect", name].gain:
            made[i] = 0.5 * base.record.lateness
        elif p.angle:
            made[i] = sizes[name]
        elif own == REGISTRY["effect", name].gain:
            made[i] = sizes[name] * abs(at[i])
    return made


def _descriptions(base: Base) -> Iterator[np.ndarray]:
    """The coefficients under other descriptions: friction of the declared shapes only, and without
    what every drive has of an offset and an unbalance."""
    law = [LEVELS.start + i for i, k in enumerate(NAMES) if k not in LAW]
    for gone in (law, SLIGHT):
        c = base.columns
        X = c.X.copy()
        X[:, gone] = 0.0
        made = solve(X, base.y, c.prior, c.low, c.high, base.view.scale, near=base.made.state)
        yield np.where(np.isin(np.arange(len(made.b)), gone), 0.0, made.b)
