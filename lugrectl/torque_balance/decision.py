"""One decision from the table: which effects are missing, and what stands beside them.

Effects are added while they are proven and large enough; where no name comes near what an unknown
torque explains, two are tried at once.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from copy import copy
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..blocks.block import is_ours, members
from ..blocks.model import Model
from ..core.numeric import rms
from ..core.regression import Prior, paired, robust
from . import constants as const
from .columns import refused
from .friction import OFFSET, WEIGHT, Term, View
from .last_fit import Interval, best_law, state_of
from .maps import Still
from .search import Search
from .table import Contender, Table, Unknown, errors_of, is_lateness, proven
from .windows import Width

LEFT_OUT = "{}: it was not compared. A block must take arrays: np.where in place of if."
SHAPES = {"stribeck": ("bump", "short_tail", "long_tail"), "presliding": ()}


class Decision:
    """``verdict``, ``table.chosen`` (the likeliest first), ``alternatives`` to each by name,
    ``depends_on`` of an unknown torque; ``named``, ``unknown`` are the rows of the table beside
    the base. ``least`` is the smallest share of friction that is worth a name.
    """

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
        self.before, self.free_of_base = table.mark(), int(table.fit.free.sum())
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
        if not (self.width.heavy or weight is not None and weight.share > const.HEAVY):
            return
        if weight is None or weight.gain < const.SURELY:
            if self.width.heavy:
                self._join(const.LESS)
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
        large = rms(weight.C @ both.b[-2:]) > const.HEAVY * self.view.size
        return both.gain - top.gain > max(const.SURELY, 0.2 * weight.gain) and large

    # ---- what is proven, what is large enough, what is better
    def proven(self, c: Contender, e0: np.ndarray) -> bool:
        return proven(*paired(c.e, e0), self.alpha)

    def floor(self, c: Contender) -> float:
        """The least share of friction that is worth a name: a delay is known as a time."""
        late = c.lateness and max(c.q.values()) > const.FREE_LATE + 1e-3
        return const.LATE_FLOOR * self.least if late else self.least

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
            self._two_at_once(large[: const.TOGETHER])
        absent = [_part(self.table, n) for n in missing(self.view.model) if n not in banned]
        self.parts = [p for p in absent
                      if proven(p.gain, p.error, self.alpha) and p.share > const.FLOOR]  # fmt: skip

    def _among(self, c: Contender, others: Sequence[Contender]) -> Contender:
        """The likeliest of c and of those that explain as much, each in a last fit of its own;
        those that this does not disprove are its alternatives."""
        alike = [o for o in others if o.gain > const.RIVAL * c.gain and self.alike(c, o)][:3]
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
        return e, int(Interval(last).blocks[0][-1]) + 1

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
        second = next((n for n in more if n.share > const.SECOND * self.floor(n)), None)
        if second is not None and len(table.chosen) < const.MOST:
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
        large = [g for g in rest if g.share > max(2 * self.least, const.REST * first.share)]
        if large and large[0].gain > const.REST * first.gain and best < const.NEAR * large[0].gain:
            odd = top or large[0]
        if top is None or not any(g.share > 2 * self.least for g in rest):
            return odd, False
        if not self.better(top, first):
            return odd, False
        if more and top.gain > max(gained + best, (1 + const.REST) * first.gain):
            odd = top
        far = top.gain > const.FAR * (gained + best)
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
            if total > const.NEAR * self.odd[0].gain and self.proven(n, self.e0):
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
        rigid = const.RIGID * float(v.grids()[0][0])
        own = v.base(rigid, v.vs)
        X[:, : own.shape[1]] = own
    for shape in SHAPES[name]:
        X[:, v.names.index(shape)] = 0.0
    fit = robust(X, table.y, table.prior, table.scale, v.noise, table.root**2)
    e = v.blocks.left_out(fit, X, table.prior, table.scale, 1.0)
    full = v.blocks.left_out(table.fit, table.X, table.prior, table.scale, 1.0)
    gain, error = paired(full, e)
    return Part(name, gain, error, rms(table.X @ table.fit.b - X @ fit.b) / v.size)
