"""One decision from the table: which effects are missing, and what stands beside them.

Effects are added while they are proven and large enough; where no name comes near what an unknown
torque explains, two are tried at once.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from copy import copy
from dataclasses import dataclass

import numpy as np

from ..blocks.block import is_ours, members
from ..blocks.model import Model
from ..core.numeric import rms
from ..core.regression import paired, robust
from . import constants as const
from .columns import refused
from .friction import OFFSET, WEIGHT, Term, View
from .last_fit import best_law, state_of
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

    def _look(self) -> None:
        self.search = Search(self.table, self.width.sure, self.never)
        self.named, self.unknown = self.search.rows(), self.strangers.rows()

    def _beside(self) -> tuple[list[Contender], list[Contender]]:
        """The rows beside what is chosen; looked for once, as the chosen ones live on in them."""
        key = tuple(id(c) for c in self.table.chosen)
        if key not in self._known:
            search = Search(self.table, self.width.sure, self.never)
            self._known[key] = search.rows(), self.strangers.rows()
        return self._known[key]

    # ---- a load that hides everything else
    def _weight_first(self) -> None:
        """Gravity so large that nothing else can be seen before it is in the model joins the base,
        with names that explain it as well; where an inertia hides it, if the base is better so."""
        known = {t.name for t in self.view.terms}
        if WEIGHT in known or WEIGHT in self.never or self.linear or self.view.motion.span < 0.8:
            return
        weight = next((c for c in self.named if c.name == WEIGHT), None)
        clear = weight is not None and weight.gain > const.SURELY
        if weight is not None and clear and (self.width.heavy or self._hides(weight)):
            rivals = (c for c in self.named if c.name in (OFFSET, "return_spring"))
            alike = [c for c in rivals if self.alike(weight, c)]
            best, left = self._likeliest([weight, *alike]) if alike else (WEIGHT, [])
            self._join(np.inf)
            others = [name for name in (best, *left) if name != WEIGHT]
            self.heavy = {WEIGHT: others} if others else {}
        elif self.width.heavy and not clear:
            self._join(const.LESS)

    def _hides(self, weight: Contender) -> bool:
        return weight.share > const.HEAVY and weight.gain >= 0.5 * self.named[0].gain

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
        if self.verdict == "unexplained" and self.odd:
            self._two_at_once(large)
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
        return e, int(last.interval.blocks[0][-1]) + 1

    def _extend(self, c: Contender) -> None:
        """c joins the base; what is left decides: a further name, an unknown torque, or none."""
        table = self.table
        table.extend(c)
        named, unknown = self._beside()
        more = [n for n in named if self.proven(n, table.e) and n.name not in self._taken()]
        odd, far = self._stranger([g for g in unknown if self.proven(g, table.e)], more)
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
        comes near, and whether it does by far more than all names together."""
        first, best = self.table.chosen[0], more[0].gain if more else 0.0
        large = [g for g in rest if g.share > 2 * self.least]
        top = self.odd[0] if self.odd and large else None
        gained = float(np.sum(self.table.e - self.e0)) + best
        if top and self.better(top, first):
            if top.gain > const.FAR * gained:
                return top, True
            if more and top.gain > max(gained, (1 + const.REST) * first.gain):
                return top, False
        much = next((g for g in large if g.share > const.REST * first.share), None)
        if much is None or max(const.REST * first.gain, best / const.NEAR) >= much.gain:
            return None, False
        return top or much, False

    def _two_at_once(self, large: list[Contender]) -> None:
        """One unknown torque may be two that have names: the pair that explains more than it."""
        table, chosen = self.table, list(self.table.chosen)
        pairs: list[tuple[float, Contender, Contender]] = []
        for c in large[: const.TOGETHER]:
            table.back(self.before)
            table.extend(c)
            more = (n for n in self._beside()[0] if n.name not in self._taken())
            n = next((n for n in more if n.share > self.floor(n)), None)
            if n is not None:
                pairs.append((float(np.sum(n.e - self.e0)), c, n))
        table.back(self.before)
        best = max(pairs, key=lambda pair: pair[0], default=None)
        enough = const.NEAR * self.odd[0].gain
        if best is None or best[0] <= enough or not self.proven(best[2], self.e0):
            for c in chosen:
                table.extend(c)
            return
        self.verdict, self.alternatives, self.depends_on, self.odd = "found", {}, [], []
        table.extend(best[1])
        self._extend(best[2])


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
