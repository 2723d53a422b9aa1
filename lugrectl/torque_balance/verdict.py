"""The answer of the torque balance: what is missing, and every value, from one last fit.

Effects are added to the table's base while they are proven and large enough, chosen on training
rows; where no name comes near what an unknown torque explains, two are tried at once. Names stand
where the last fit holds them and where the torque error of rows falls that no fit and no choice has
seen; then all rows give the values.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..blocks.block import is_ours, members
from ..blocks.model import Model
from ..core.errors import Refused
from ..core.numeric import Z95, rms
from ..core.regression import TINY, Prior, log_density, paired, robust, spread
from ..record import Stretch
from . import constants as const
from .columns import refused
from .friction import OFFSET, WEIGHT, Term, View
from .last_fit import (
    Design,
    Interval,
    LastFit,
    State,
    Value,
    apart,
    best_law,
    other_views,
    state_of,
    tells,
)
from .maps import MapView, Still
from .motion import Sensors
from .search import Search
from .seen import refuse_dead, seen
from .table import Contender, Table, Unknown, errors_of, is_lateness, proven
from .windows import Rows, Width

LEFT_OUT = "{}: it was not compared. A block must take arrays: np.where in place of if."
SHAPES = {"stribeck": ("bump", "short_tail", "long_tail"), "presliding": ()}


class Decision:
    """``verdict``, ``table.chosen`` (the likeliest first), ``alternatives`` to each by name,
    ``depends_on`` of an unknown torque; ``named``, ``unknown`` are the rows of the table."""

    def __init__(
        self,
        view: View,
        width: Width | Still,
        never: Collection[str] = (),
        least: float = const.FLOOR,
        alpha: float = const.ALPHA,
    ) -> None:
        self.view, self.width, self.never = view, width, view.never.union(never)
        self.least, self.alpha = least, alpha
        own = [b for b in members("effect").values() if not is_ours(b.home)]
        self.notes = [LEFT_OUT.format(why) for why in map(refused, own) if why]
        self.memory: dict[str, Any] = {}
        self._known: dict[tuple[int, ...], tuple[list[Contender], list[Contender]]] = {}
        self.joined: list[Term] = []  # so large that they join the base before anything is judged
        self.heavy: dict[str, list[str]] = {}  # the names that explain these as well
        self.linear = view.model.motion == "linear"
        self.table = table = Table(view)
        self.strangers = Unknown(table, self.linear, width.sure)
        self._look()
        self._weight_first()
        if self.named and self.named[0].gain > const.SURELY:
            table.restart(self.named[0])
        table.richest(self.named, self.unknown)
        self._look()
        self.e0, self.left, self.rest = table.e, table.left, table.rest
        self.before = table.X, table.y, table.prior, self.view.u
        self.free_of_base = int(table.fit.free.sum())
        self.decide(frozenset())

    def _search(self) -> Search:
        return Search(self.table, self.width.sure, self.never, self.memory)

    def _look(self) -> None:
        """The rows of the table beside the base as it stands."""
        self.search = self._search()
        self.named, self.unknown = self.search.rows(), self.strangers.rows()

    def _beside(self) -> tuple[list[Contender], list[Contender]]:
        """The rows beside what is chosen; looked for once, as the chosen ones live on in them."""
        key = tuple(id(c) for c in self.table.chosen)
        if key not in self._known:
            self._known[key] = self._search().rows(), self.strangers.rows()
        return self._known[key]

    # ---- a load that hides everything else
    def _weight_first(self) -> None:
        """Gravity so large that nothing else can be seen before it is in the model joins the base;
        where an inertia plays its part and hides it, the whole base is settled again with it."""
        known = {t.name for t in self.view.terms}
        if WEIGHT in known or WEIGHT in self.never or self.linear or self.view.motion.span < 0.8:
            return
        weight = next((c for c in self.named if c.name == WEIGHT), None)
        if not (self.width.heavy or weight is not None and weight.share > const.PART):
            return
        if weight is None or weight.gain < const.SURELY:
            if self.width.heavy:
                self._join(const.ALIKE)
            return
        if self.width.heavy or self._beside_the_likeliest(weight):
            rivals = (c for c in self.named if c.name in (OFFSET, "return_spring"))
            alike = [c for c in rivals if self.alike(weight, c)]
            best, left = self._likeliest([weight, *alike]) if alike else (WEIGHT, [])
            self._join(np.inf)
            others = [name for name in (best, *left) if name != WEIGHT]
            self.heavy = {WEIGHT: others} if others else {}

    def _join(self, less: float) -> None:
        """Gravity becomes part of the base, unless that leaves more than ``less`` of before."""
        v, table = self.view, self.table
        before = table.left * v.size
        term = Term(members("effect")[WEIGHT], WEIGHT, {}, np.zeros(2))
        v.terms.append(term)
        table.restart()
        if table.left * v.size < less * before:
            self.joined = [term]
            self._look()
        else:
            v.terms.remove(term)
            table.restart()

    def _beside_the_likeliest(self, weight: Contender) -> bool:
        """Is it still there beside the likeliest contender, whatever that is?"""
        top = self.named[0]
        if weight.gain >= 0.5 * top.gain:
            return True
        if top.C is None or weight.C is None:
            return False
        C, prior = np.column_stack([top.C, weight.C]), Prior.joined(top.prior, weight.prior)
        both = self.table.enter(Contender(WEIGHT, {}, top.block, C=C, prior=prior))
        large = rms(weight.C @ both.b[-2:]) > const.PART * self.view.size
        return both.gain - top.gain > max(const.SURELY, 0.2 * weight.gain) and large

    # ---- what is proven, what is large enough, what is better
    def proven(self, c: Contender, e0: np.ndarray) -> bool:
        return proven(*paired(c.e, e0), self.alpha)

    def floor(self, c: Contender) -> float:
        """The least share of friction that is worth a name: a delay is known as a time."""
        late = c.lateness and max(c.q.values()) > const.FREE_LATE + 1e-3
        return const.PART * self.least if late else self.least

    def better(self, a: Contender, b: Contender) -> bool:
        gain, error = paired(a.e, b.e)
        return gain > max(errors_of(self.alpha) * error, 3.0)

    def alike(self, c: Contender, other: Contender) -> bool:
        """Whether a last fit must decide, as another comes near: rows near rest prove none."""
        return other.gain > const.ALIKE * c.gain or not self.better(c, other)

    # ---- the verdict
    def decide(self, banned: Collection[str]) -> None:
        """From the table without the banned names: the best, its rivals, what stands beside it."""
        self.banned = frozenset(banned)
        self.verdict, self.depends_on = "adequate", []
        self.alternatives: dict[str, list[str]] = {}
        self.table.back(self.before)
        large = [c for c in self.named if c.name not in banned
                 and c.share > max(self.floor(c), 0.25 * self.left)]  # fmt: skip
        good = [c for c in large if self.proven(c, self.e0)]
        self.odd = [c for c in self.unknown if self.proven(c, self.e0) and c.share > 2 * self.least]
        if good:
            self.verdict = "found"
            self._extend(self._among(good[0], good[1 : const.FIRSTS]))
        elif self.odd:
            self.verdict, self.depends_on = "unexplained", sorted(self.odd[0].depends_on)
        if self.verdict == "unexplained" and self.odd and large:
            self._two_at_once(large[: const.SEVERAL])
        absent = [_part(self.table, n) for n in missing(self.view.model) if n not in banned]
        self.parts = [p for p in absent
                      if proven(p.gain, p.error, self.alpha) and p.share > const.FLOOR]  # fmt: skip

    def _among(self, c: Contender, others: Sequence[Contender]) -> Contender:
        """The likeliest of c and of those that explain as much, each in a last fit of its own;
        those that this does not disprove are its alternatives."""
        alike = [o for o in others if o.gain > const.PART * c.gain and self.alike(c, o)][:3]
        if not alike:
            return c
        best, left = self._likeliest([c, *alike])
        if left:
            self.alternatives[best], self.verdict = left, "ambiguous"
        return next(o for o in (c, *alike) if o.name == best)

    def _likeliest(self, contenders: Sequence[Contender]) -> tuple[str, list[str]]:
        """The likeliest, each in a last fit of its own, and those that this does not disprove."""
        of = {c.name: c for c in contenders}
        fits = {name: self._by_last_fit(c) for name, c in of.items()}
        best = max(fits, key=lambda name: float(np.sum(fits[name][0])))
        e, stretches = fits[best]
        few = stretches < const.FEW and not self.view.is_map  # then the table must disprove it, too

        def stays(name: str) -> bool:
            alike = few and not self.better(of[best], of[name])
            return alike or not proven(*paired(e, fits[name][0]), self.alpha)

        return best, [name for name in fits if name != best and stays(name)]

    def _by_last_fit(self, c: Contender) -> tuple[np.ndarray, int]:
        """Log density of each block under a last fit with c too; its independent stretches."""
        view, table = copy(self.view), self.table
        state = state_of(table)
        state.terms += c.terms([t.name for t in state.terms])
        last = best_law(view, state, table.scale, straight=True)
        r = last.fit.r * last.scale / table.scale
        e = view.blocks.seen(r, table.stretch(last.values["J"]))
        return e, Interval(last).stretches

    def _extend(self, c: Contender) -> None:
        """c joins the base; what is left decides: a further name, an unknown torque, or none."""
        table = self.table
        table.extend(c)
        named, unknown = self._beside()
        rest = [g for g in unknown if self.proven(g, table.e)]
        more = [n for n in named if self.proven(n, table.e) and n.name not in self._taken()]
        odd, far = self._stranger(rest, more)
        if odd is not None:
            self.verdict, self.alternatives = "unexplained", {}
            self.depends_on = sorted(odd.depends_on)
            if far:  # no name comes near: none is given
                table.back(self.before)
            return
        second = next((n for n in more if n.share > const.BEYOND * self.floor(n)), None)
        if second is not None and len(table.chosen) < const.SEVERAL:
            large = [n for n in more if n is not second and n.share > self.floor(n)]
            self._extend(self._among(second, large))

    def _taken(self) -> set[str]:
        """Names that cannot be added: chosen, struck, or another word for a chosen one."""
        names = {c.name for c in self.table.chosen} | self.banned
        blocks = [c.block for c in self.table.chosen if c.block is not None]
        for alike in (is_lateness, lambda block: "twist" in block.states):
            if any(map(alike, blocks)):  # one drive has one of them
                names |= {n for n, block in members("effect").items() if alike(block)}
        return names

    def _stranger(
        self, rest: list[Contender], more: list[Contender]
    ) -> tuple[Contender | None, bool]:
        """An unknown torque that takes much of what the named ones took and that no further name
        comes near; or one that does more than all names together. And whether by far."""
        first = self.table.chosen[0]
        gained = float(np.sum(self.table.e - self.e0))
        best, top, odd = more[0].gain if more else 0.0, self.odd[0] if self.odd else None, None
        large = [g for g in rest if g.share > max(2 * self.least, const.PART * first.share)]
        if large and large[0].gain > const.PART * first.gain and best < const.ALIKE * large[0].gain:
            odd = top or large[0]
        if top is None or not any(g.share > 2 * self.least for g in rest):
            return odd, False
        if not self.better(top, first):
            return odd, False
        if more and top.gain > max(gained + best, (1 + const.PART) * first.gain):
            odd = top
        far = top.gain > const.BEYOND * (gained + best)
        return (top if far else odd), far

    def _two_at_once(self, firsts: list[Contender]) -> None:
        """One unknown torque may be two that have names: the pair that explains more than it."""
        table, pairs = self.table, []
        saved = self.verdict, self.alternatives, self.depends_on, list(table.chosen)
        for c in firsts:
            table.back(self.before)
            table.extend(c)
            named = self._beside()[0]
            more = [n for n in named if n.name not in self._taken() and n.share > self.floor(n)]
            if more:
                pairs.append((float(np.sum(more[0].e - self.e0)), c, more[0]))
        table.back(self.before)
        if pairs:
            total, c, n = max(pairs, key=lambda p: p[0])
            if total > const.ALIKE * self.odd[0].gain and self.proven(n, self.e0):
                self.verdict, self.alternatives, self.depends_on, self.odd = "found", {}, [], []
                table.extend(c)
                self._extend(n)
                return
        for c in saved[3]:
            table.extend(c)
        self.verdict, self.alternatives, self.depends_on = saved[:3]


@dataclass(frozen=True)
class Part:
    """A part of friction: how much it gains in nats, the standard error, its share of friction."""

    name: str
    gain: float
    error: float
    share: float


def missing(model: Model) -> list[str]:
    """The parts that neither the declared law nor a declared effect has."""
    law, here = model.friction, {p.block.name for p in model.effects}
    has = {"stribeck": "Fs" in law.values or not {"Fc"} <= law.values.keys(),
           "presliding": bool(law.block.states) or "Fc" not in law.values}  # fmt: skip
    return [name for name, there in has.items() if not there and name not in here]


def _part(table: Table, name: str) -> Part:
    """A part that is missing, by the base with and without it."""
    v = table.view
    X = table.X.copy()
    if name == "presliding":
        rigid = const.SLIGHT * float(v.grids()[0][0])
        own = v.base(rigid, v.vs).X
        X[:, : own.shape[1]] = own
    for shape in SHAPES[name]:
        X[:, v.names.index(shape)] = 0.0
    fit = robust(X, table.y, table.prior, table.scale, v.noise, table.root**2)
    e = v.blocks.left_out(fit, X, table.prior, table.scale, 1.0)
    full = v.blocks.left_out(table.fit, table.X, table.prior, table.scale, 1.0)
    gain, error = paired(full, e)
    return Part(name, gain, error, rms(table.X @ table.fit.b - X @ fit.b) / v.size)


TOO_FEW = "the runs at steady speed are too few to fit some and to judge on others."
MORE = "Record at least three speeds in each direction."


@dataclass(frozen=True, eq=False)
class Split:
    """Rows to fit and choose on, and rows to judge on: masks (m,) that share no sample."""

    train: np.ndarray
    test: np.ndarray

    @classmethod
    def of(cls, view: View, held_out: Sequence[Any] = ()) -> Split:
        """``held_out``: (run, start, end), s; none: every other part, or third run of a map."""
        rows, m = view.rows, view.motion
        t, run = m.stamp[rows.at], m.run[rows.at]
        held_out = held_out if len(held_out) else view.held_out
        if not len(held_out) and view.is_map:
            raise Refused(TOO_FEW, MORE)
        if not len(held_out):
            return cls._alternate(rows)
        train, test = np.ones(len(rows), bool), np.zeros(len(rows), bool)
        for own, start, end in held_out:
            here = run == own
            test |= here & (t >= start + rows.reach) & (t <= end - rows.reach)
            train &= ~(here & (t >= start - rows.reach) & (t <= end + rows.reach))
        enough = train.sum() >= 2 * const.LEAST_ROWS and test.sum() >= const.LEAST_ROWS
        return cls(train, test) if view.is_map or enough else cls._alternate(rows)

    @classmethod
    def _alternate(cls, rows: Rows) -> Split:
        length = min(
            const.PART_TIME,
            max((rows.t[-1] - rows.t[0]) / (2 * const.PARTS), const.AGAIN * rows.reach),
        )
        place = rows.t / max(length, 1e-12)
        odd = place.astype(int) % 2 == 1
        edge = np.abs(place - np.round(place)) * length < min(rows.reach, 0.1 * length)
        return cls(~odd & ~edge, odd & ~edge)


@dataclass(frozen=True, eq=False)
class Unseen:
    """What a fit to other rows leaves on held-out rows: ``r`` (m,) at ``t`` (m,), N m."""

    r: np.ndarray
    t: np.ndarray
    error: float  # its RMS
    stays: float  # RMS of what lasts longer than a window: torque that nothing explains

    @classmethod
    def of(cls, last: LastFit, test: View) -> Unseen:
        """``last`` is a fit to other rows of the same log."""
        design = Design(test, last.state)
        return cls.left(design.y - design.X @ last.fit.b, test.rows)

    @classmethod
    def left(cls, r: np.ndarray, rows: Rows) -> Unseen:
        r = np.clip(r, -_far(r), _far(r))
        return cls(r, rows.t, rms(r), structured(r, rows.t, rows.step, rows.h))


def gain(without: Unseen, other: Unseen, duration: float) -> float:
    """By how many standard errors ``other`` predicts held-out stretches better, by log density."""
    stretch = (without.t / max(const.BLOCK, duration / const.LONG_BLOCKS)).astype(int)
    there = np.bincount(stretch) > 0
    scale = spread(other.r) + TINY
    both = [np.bincount(stretch, log_density(one.r / scale))[there] for one in (other, without)]
    total, error = paired(*both)
    return total / error


def _far(r: np.ndarray) -> float:
    """From where on a row is far off, and counts no more."""
    return 2 * const.CLIP * spread(r) + TINY


def lasting(r: np.ndarray, rows: Rows) -> float:
    """RMS over all rows of those that are far off: for longer than the windows around one bad
    sample are (contacts, bursts), or again and again (an impact at each reversal). The largest
    stretch of them is left out: what is there once decides nothing."""
    off = np.flatnonzero(np.abs(r) > _far(r))
    t, size = rows.t[off], r[off] ** 2
    ends = [0, *(np.flatnonzero(np.diff(t) > 2 * rows.step) + 1).tolist(), len(off)]
    every = [slice(a, b) for a, b in zip(ends[:-1], ends[1:], strict=True) if b > a]
    if len(every) < const.AGAIN:
        every = [at for at in every if t[at.stop - 1] - t[at.start] > const.SEVERAL * rows.reach]
    power = [float(size[at].sum()) for at in every]
    return float(np.sqrt((sum(power) - max(power, default=0.0)) / len(r)))


def structured(r: np.ndarray, t: np.ndarray, step: float, h: float) -> float:
    """RMS of what of a residual lasts longer than a window, by its correlation beyond one."""
    first, found = max(4, int(np.ceil(2 * h / max(step, 1e-9)))), 0.0
    for k in {first, int(1.5 * first), 2 * first, 3 * first}:
        if len(r) < 4 * k:
            continue
        lag = t[k:] - t[:-k]
        c = (r[k:] * r[:-k])[np.abs(lag - np.median(lag)) < 0.5 * step]
        if len(c) > 8:
            found = max(found, abs(float(np.mean(c))) - 2 * float(np.mean(r * r)) / np.sqrt(len(c)))
    return float(np.sqrt(max(found, 0.0)))


PLANT = ("J", "Fc", "Fv")  # as uncertain as the name of an effect; a scale of u multiplies them
GREASE_NAME = "sublinear_viscous"
LAG_NAME = "velocity_sensor_lag"
WHOLE_INERTIA = "elastic_coupling"  # what an inertia that is far too large is a trace of
NO_GAIN = (
    "What could be named does not lower the torque error on rows that no fit has seen, or leaves "
    "more than it explains."
)
UNTESTED = "the model has as many values as there are runs: nothing can be tested."
MORE_SPEEDS = "Record runs at more speeds."
TOO_SHORT = "the record is too short to judge what is missing: {} blocks of {:.3g} ms are needed."
LONGER = "Record a longer run in which the drive moves."
NO_MOTION = "Most of the torque has nothing to do with the motion."
STAYS = "Torque of {:.2g} % of friction stays, and nothing explains it."
LATE_SPEED = "w is {:.3g} ms behind dtheta/dt."


@dataclass(eq=False)
class Answer:
    """What the torque balance says of a log: ``values`` (value, low, high) by name, with their
    ``covariance`` over ``interval.names``; errors of held-out rows ``without`` and ``with_names``,
    by the fits to training rows ``refitted`` and ``trained``."""

    verdict: str
    decision: Decision | None  # None where nothing was searched
    view: View
    split: Split
    last: LastFit  # of the model that is shown, to all rows
    interval: Interval
    values: dict[str, Value]
    covariance: np.ndarray
    without: Unseen
    with_names: Unseen
    refitted: LastFit
    trained: LastFit
    alternatives: dict[str, list[str]] = field(default_factory=dict)  # to a named one
    candidates: list[str] = field(default_factory=list)  # were named, and are not held
    depends_on: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    lag: Value | None = None
    only_inertia: bool = False
    rivals: list[LastFit] = field(default_factory=list)
    declared_error: float | None = None

    @property
    def named(self) -> list[Term]:
        return self.last.state.named

    @property
    def parts(self) -> list[str]:
        """The parts of friction that the declared law does not have."""
        return [] if self.decision is None else [p.name for p in self.decision.parts]

    @property
    def sure(self) -> bool:
        """Whether the log determines the inertia."""
        return self.view.sure and tells(self.values["J"])


def answer(
    stretches: Sequence[Stretch],
    model: Model,
    held_out: Sequence[tuple[int, float, float]] = (),
    least: float = const.FLOOR,
    alpha: float = const.ALPHA,
) -> Answer:
    """Verdict, names and values; Refused where nothing can be learnt. ``held_out`` are (run, start,
    end), in s of the logs, ``least`` the smallest torque that is worth a name, as a share of
    friction, ``alpha`` the chance that a gain is called proven and is none."""
    view, few, width = seen(stretches, model)
    refuse_dead(view, width)
    if not view.is_map and view.motion.duration < 2 * const.FEWEST_BLOCKS * view.rows.h:
        raise Refused(TOO_SHORT.format(const.FEWEST_BLOCKS, 2e3 * view.rows.h), LONGER)
    if view.is_map and view.values >= len(np.unique(view.motion.run)):
        raise Refused(UNTESTED, MORE_SPEEDS)
    split = Split.of(few, held_out)
    train, test = few.on(split.train), few.on(split.test)
    decision = Decision(train, width, (), least, alpha)
    judge = _Judge(few, train, test, split, decision, view)
    if not view.is_map and judge.short():
        judge.keep(Decision(few.on(), width, (), least, alpha))
    made = judge.answer()
    if not view.is_map:
        return made
    # a few runs fewer name less: all are chosen by, and a choice by a part says how it predicts
    train, test, other = view.on(), view.on(), made
    decision = Decision(train, width, (), least, alpha)
    made = _Judge(view, train, test, split, decision, view).answer()
    for key in ("without", "with_names", "refitted", "trained", "declared_error"):
        setattr(made, key, getattr(other, key))
    assert isinstance(view, MapView)
    if made.verdict != "unexplained" and view.follows_speed(made.last.left):
        made.verdict, made.depends_on = "unexplained", ["w"]
    return made


class _Judge:
    """The last fit and the errors of held-out rows, until both hold what is named: chosen on
    training rows, fitted to all, struck where that fit does not hold it, judged on the others. Of a
    long log, ``view`` are parts that are enough for this; ``every`` row gives the values."""

    def __init__(
        self, view: View, train: View, test: View, split: Split, decision: Decision, every: View
    ) -> None:
        self.view, self.train, self.test, self.split = view, train, test, split
        self.decision, self.all = decision, every
        self.struck: set[str] = set()
        self.candidates: list[tuple[float, str]] = []
        self.notes: list[str] = []
        self.absent: frozenset[str] = frozenset()  # parts of friction that are not named
        self.whole: tuple[Interval, np.ndarray] | None = None  # intervals by every description
        self.apart: tuple[LastFit, list[dict[str, float]]] | None = None  # by others of them

    def answer(self) -> Answer:
        last = self._held()
        trained = self._on_training_rows(last.state)
        without = self._without(trained.state)
        full, plain = Unseen.of(trained, self.test), Unseen.of(without, self.test)
        verdict, named = self._verdict(last, full, plain, without)
        if not named and (self.absent or last.state.named):
            last = self._plain(last)
            trained = self._on_training_rows(last.state)
        if not named:  # the declared model is what is shown
            without, plain = trained, Unseen.of(trained, self.test)
            full = plain
        few, last = last, self._of_all(last)
        interval, V = self._intervals(last, few)
        d, rivals = self.decision, self._rivals(few)
        other = [apart(rival, few) for rival in rivals]
        V = V + interval.between([{k: x for k, x in one.items() if k in PLANT} for one in other])
        left = few.left_by_declared(self.test)
        made = Answer(
            verdict, d, self.all, self.split, last, interval, interval.values(V), V, plain, full,
            without, trained, d.alternatives, depends_on=d.depends_on,
            notes=[*d.notes, *self.notes], rivals=rivals,
            # the largest first, but what the plain answer has
            candidates=[name for _, name in sorted(self.candidates)
                        if not (name == OFFSET and last.design.constant)],
            declared_error=None if left is None else Unseen.left(left, self.test.rows).error,
        )  # fmt: skip
        self._late_speed(made)
        self._whole_inertia(made)
        return made

    def short(self) -> bool:
        """Whether names are given, of so few independent stretches that half of them mislead."""
        d = self.decision
        if not (d.table.chosen or d.parts):
            return False
        last = LastFit(d.view, state_of(d.table), d.table.scale)
        return Interval(last).stretches < const.FEW

    def keep(self, whole: Decision) -> None:
        """Of the names of training rows those that all rows have, too."""
        there = {*_names(whole), *(t.name for t in whole.joined)}
        there |= {n for names in whole.alternatives.values() for n in names}
        while own := {*_names(self.decision)} - there:
            self.struck |= own
            self.decision.decide(self.struck)

    # ---- what the last fit holds
    def _held(self) -> LastFit:
        """The last fit to all rows, with the names that it holds."""
        while True:
            self._share()
            last = best_law(self.view, self._found_again(self.view), self.decision.table.scale)
            last = self._without_small_waves(last)
            values = Interval(last).values()
            last = self._bent(last, values)
            lost = self._lost(last, values)
            if not lost and last.state.named:
                interval, V = self._intervals(last, last)
                lost = self._lost(last, interval.values(V))
            if not lost:
                return last
            self._strike(last, lost[-1])

    def _found_again(self, view: View) -> State:
        """The chosen effects at their values on all rows: an order, an instant, a gap."""
        d, table = self.decision, Table(view, self.decision.table.scale)
        for c in d.table.chosen:
            search = Search(table, d.width.sure, d.never, dict(d.memory), only={c.name})
            rows = [row for row in search.rows() if row.order == c.order]
            rows.append(table.enter(search.again(c)))
            table.extend(max(rows, key=lambda row: row.gain))
        return state_of(table)

    def _without_small_waves(self, last: LastFit) -> LastFit:
        """Of several waves of one effect, those that the fit holds beside the first."""
        names = [t.name for t in last.state.terms]
        if len(names) == len(set(names)):
            return last
        values = Interval(last).values()
        kept = [t for i, t in enumerate(last.state.terms)
                if t.declared or t.name not in names[:i] or holds(last, values, i)]  # fmt: skip
        if len(kept) == len(names):
            return last
        return LastFit(self.view, last.state.copy(terms=[t.copy() for t in kept]), last.scale)

    def _lost(self, last: LastFit, values: dict[str, Value]) -> list[int]:
        """Effects that the fit does not hold; of further ones those explaining less than stays."""
        stays = Unseen.left(last.left, self.view.rows).stays / self.view.size
        own = [i for i, t in enumerate(last.state.terms)
               if not t.declared and t.name != GREASE_NAME]  # fmt: skip
        names = [last.state.terms[i].name for i in own]
        floors = {c.name: self.decision.floor(c) for c in reversed(self.decision.table.chosen)}

        def kept(i: int) -> bool:
            name, share = last.state.terms[i].name, last.share(i)
            large = name not in floors or share > (1 - const.PART) * floors[name]
            return holds(last, values, i) and large and (i == own[0] or share > stays)

        # waves of one effect count once
        return [i for j, i in enumerate(own) if names.index(names[j]) == j and not kept(i)]

    def _strike(self, last: LastFit, i: int) -> None:
        name = last.state.terms[i].name
        self.notes.append(f"{name} is not held by the last fit.")
        if last.share(i) > 2 * self.decision.least:  # large, but not sure, or more stays
            self.candidates.append((-last.share(i), name))
        self.struck.add(name)
        d = self.decision
        if name in {t.name for t in d.joined}:
            for v in (self.view, self.train, self.test):
                v.terms = [t for t in v.terms if t.name != name]
            self.decision = Decision(self.train, d.width, {*d.never, name}, d.least, d.alpha)
        else:
            d.decide(self.struck)

    def _bent(self, last: LastFit, values: dict[str, Value]) -> LastFit:
        """A bend of the friction curve that is worth a name is an effect; else it is dropped."""
        state = last.state
        if not state.grease:
            return last
        x, bend = values["grease"], last.bend()
        stays = Unseen.left(last.left, self.view.rows).stays / self.view.size
        sure = x[0] < 2 * x[1]  # a bend is any curve
        plain = state.copy(grease=0.0)
        if not self.view.motion.one_way and sure and bend > max(self.decision.least, stays):
            block = members("effect")[GREASE_NAME]
            c = np.array([last.fit.b[last.design.names.index("grease")]])
            plain.terms.append(Term(block, GREASE_NAME, {"exponent": state.grease}, c))
        return LastFit(self.view, plain, last.scale)

    # ---- held-out rows
    def _share(self) -> None:
        """What the table has settled of friction holds on all rows."""
        joined = [t for t in self.train.terms if not t.declared]
        for other in (self.view, self.test):
            other.terms = [t for t in other.terms if t.declared]
            other.terms += [t.copy() for t in joined]
            other.settle_as(self.train)

    def _on_training_rows(self, state: State) -> LastFit:
        """The same names fitted to training rows, from where the table ended."""
        scale, names = self.decision.table.scale, {t.key for t in state.terms}
        begun = state_of(self.decision.table)
        begun.terms = [t for t in begun.terms if t.key in names]
        here = {t.key for t in begun.terms}
        begun.terms += [t.copy() for t in state.terms if t.key not in here]
        return best_law(self.train, begun, scale, straight=True)

    def _without(self, state: State) -> LastFit:
        """The same without names, and with what every drive has held to its size."""
        absent = frozenset(p.name for p in self.decision.parts)
        bare = state.without_names(grease=0.0, bare=True, absent=absent)
        return best_law(self.train, bare, self.decision.table.scale, straight=True)

    def _verdict(
        self, last: LastFit, full: Unseen, plain: Unseen, without: LastFit
    ) -> tuple[str, bool]:
        """The verdict with the held-out error, and whether names are shown."""
        d, v, state = self.decision, self.view, last.state
        named = [i for i, t in enumerate(state.terms) if not t.declared]
        if not named and not d.parts:
            return self._without_names(last, v, full, const.MOSTLY), False
        if d.heavy and {t.name for t in d.joined} & {state.terms[i].name for i in named}:
            d.alternatives |= d.heavy
        verdict = "ambiguous" if d.alternatives else "found"
        shares = [*(last.share(i) for i in named), *(p.share for p in d.parts)]
        stays = full.stays / v.size
        # runs are too few for a standard error
        sure = v.is_map or gain(plain, full, v.motion.duration) > errors_of(d.alpha)
        if not (sure and full.error < plain.error and np.linalg.norm(shares) > stays):
            # what could be named is no more than a candidate; without it little may stay
            self.candidates += [(-last.share(i), state.terms[i].name) for i in named]
            self.candidates += [(-p.share, p.name) for p in d.parts]
            rest = -1.0 if d.parts else 2 * d.least
            self.absent, d.parts = frozenset(p.name for p in d.parts), []
            d.alternatives = {}
            self.notes.append(NO_GAIN)
            return self._without_names(without, self.train, plain, rest), False
        if full.error > const.MOSTLY * v.force:
            return "unexplained", True
        clear = min(shares) > const.SEVERAL * stays and d.rest < const.MOSTLY
        if d.verdict == "unexplained" and not clear:
            return "unexplained", True
        d.depends_on = []
        return verdict, True

    def _without_names(self, fit: LastFit, of: View, plain: Unseen, most: float) -> str:
        """The verdict of a fit where nothing is named: whether torque stays that matters, which is
        said, or the table leaves more than ``most`` of friction."""
        d = self.decision
        rare = lasting(fit.left, of.rows) if of.sure else 0.0  # else J a is in it
        left = max(plain.stays, rare) / self.view.size
        much = left > 2 * d.least and not self.view.is_map
        if not much and d.verdict != "unexplained" and d.rest < most:
            return "adequate"
        if d.rest > const.MOSTLY:
            self.notes.append(NO_MOTION)
        elif much:
            self.notes.append(STAYS.format(100 * left))
        if d.unknown and not d.depends_on:
            d.depends_on = sorted(d.unknown[0].depends_on)
        return "unexplained"

    def _plain(self, last: LastFit) -> LastFit:
        """The declared model alone, fitted to all rows."""
        state = last.state.without_names(absent=self.absent, constant=True)
        return best_law(self.view, state, last.scale, straight=True)

    # ---- all rows
    def _of_all(self, few: LastFit) -> LastFit:
        """The fit of the same model to all rows."""
        if self.all is self.view:
            return few
        state = few.state.copy()
        self.all.terms = [t.copy() for t in self.view.terms]
        self.all.settle_as(self.train)
        if state.named:
            again = {t.key: t for t in self._found_again(self.all).terms}
            state.terms = [again.get(t.key, t) for t in state.terms]
        return LastFit(self.all, state, few.scale, turns=2)

    def _intervals(self, last: LastFit, few: LastFit) -> tuple[Interval, np.ndarray]:
        """Intervals of the model that is shown; how much its description matters, ``few`` say."""
        if self.whole is None or self.whole[0].last is not last:
            interval = Interval(last)
            V = interval.covariance() + interval.between(self._others(few))
            last.state.apply(last.view)
            self.whole = interval, V
        return self.whole

    def _others(self, last: LastFit) -> list[dict[str, float]]:
        """How far the values by every other description are from those of a fit."""
        if self.apart is None or self.apart[0] is not last:
            orders = [t.q[k] for t in last.state.terms for k in t.q if t.block.own[k].whole]
            widest = np.inf  # a window that hides a wave tells nothing of it
            if orders and not self.view.is_map:
                slow = float(np.quantile(self.view.rows.w, 0.2)) + 1e-9
                widest = 5 / (max(orders) * slow) / self.view.rows.h
            self.apart = last, other_views(last, widest)
        return self.apart[1]

    def _rivals(self, last: LastFit) -> list[LastFit]:
        """The drive with an alternative in place of the one name: J, Fc, Fv are as uncertain."""
        own, d, made = last.state.named, self.decision, []
        for c in d.named if len(own) == 1 else ():
            if c.name in d.alternatives.get(own[0].name, ()):
                other = last.state.without_names()
                other.terms += c.terms()
                made.append(LastFit(self.view, other, last.scale, turns=2))
        return made

    # ---- sensors, and loads that only the inertia shows
    def _late_speed(self, made: Answer) -> None:
        """w that lags theta is named where theta shows it."""
        if self.view.is_map:
            return
        sensors: Sensors = self.view.motion.sensors
        lag, error = sensors.lag, sensors.lag_error
        late = lag > max(const.LATE_W, 5 * error) and abs(sensors.gain - 1) < const.NEAR
        if not late or LAG_NAME in {t.name for t in self.view.terms}:
            return
        made.notes.append(LATE_SPEED.format(1e3 * lag))
        v, J = self.view, abs(made.values["J"][0])
        jerk = v.rows.narrow @ v.motion.slope(v.motion.acceleration)
        cost = J * lag * rms(jerk) / v.size  # what it would do to a torque
        odd = self.decision.odd and self.decision.odd[0].share > const.LITTLE
        own = not sensors.differenced  # else its lag is that of a computation
        if made.verdict == "adequate" and not odd and own and cost > const.FLOOR:
            made.lag = lag, lag - Z95 * error, lag + Z95 * error
            made.verdict = "found"

    def _whole_inertia(self, made: Answer) -> None:
        """An inertia far above the declared one that nothing named explains: a load."""
        J, d = self.view.declared.get("J"), self.decision
        told = any(c.inertial for c in d.table.chosen)
        strange = made.verdict == "unexplained" and bool(d.unknown) and d.unknown[0].gain > 300
        if not J or not made.sure or told or strange or made.values["J"][1] < const.GROWN * J:
            return
        ratios = {k: made.values[k][0] / x for k in PLANT if (x := self.view.declared.get(k))}
        if common_factor(ratios):  # the scale of u is another one
            return
        made.only_inertia, made.verdict, made.depends_on = True, "ambiguous", []
        made.alternatives = {WHOLE_INERTIA: ["backlash"]}
        made.notes.append("J is that of drive and load together; the drive's own lies below.")


def common_factor(ratios: Mapping[str, float]) -> float | None:
    """By how much J, Fc and Fv are all larger than declared, as another scale of u makes them."""
    own = np.array([ratios.get(k, 0.0) for k in PLANT])
    alike = bool(own.all()) and np.ptp(own) < const.LITTLE * own.mean()
    return float(own.mean()) if alike else None


def _names(d: Decision) -> list[str]:
    return [*(c.name for c in d.table.chosen), *(p.name for p in d.parts)]


def holds(last: LastFit, values: dict[str, Value], i: int) -> bool:
    """Whether the interval of an effect excludes that there is none, and is inside its bounds."""
    term, v = last.state.terms[i], last.view
    own = {k: values[f"{term.key}.{k}"] for k in term.block.own if f"{term.key}.{k}" in values}
    gain, p = own[term.block.gain], term.block.own[term.block.gain]
    if not np.isfinite([*own.values()]).all():
        return False
    if p.unit == "kg m2" and values["J"][1] <= 0:
        return False  # which inertia is whose?
    for k, x in own.items():  # an instant must be known to within half of the log
        q = term.block.own[k]
        if q.instant and x[2] - x[1] > 0.5 * v.motion.duration:
            return False
    if p.neutral is not None and np.isfinite(p.neutral) and gain[1] <= p.neutral <= gain[2]:
        return False
    ratio = p.unit == "1" and np.isfinite(p.high)
    return not (ratio and max(abs(gain[1]), abs(gain[2])) >= p.high and abs(gain[0]) > 0.9 * p.high)
