"""The last fit: named and declared effects with a plain friction law and what every drive has, in
one regression. Every value of an answer comes from it.

    u = J a + Fc z + (Fs - Fc) z exp(-|w/vs|^delta) + Fv w + effects + nuisances + residual

What is not linear has a column of slopes, and the fit is repeated at the value that it says. For
intervals blocks are left out; laws count by their likelihood, other descriptions of the motion and
alternatives to a name by how far their values lie apart; and no sensor is better than SCALE.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from ..blocks.block import Block, members
from ..blocks.friction import free_level
from ..blocks.model import Stated
from ..core.errors import Refused
from ..core.numeric import Z95, rms
from ..core.regression import (
    TINY,
    Prior,
    left_out_covariance,
    log_density,
    memory_blocks,
    robust,
    spread,
)
from . import constants as const
from .columns import changed_input, columns, linear, nonlinear, scaled, slopes, step_of, to_values
from .friction import OFFSET, WEIGHT, Regression, Term, View
from .table import Table, is_lateness
from .windows import Rows

Name = Any  # of a coefficient: a text, (place of a term, place of its column or name of a value)
LAW = {"Fc", "Fs", "Fv", "vs", "delta"}
CONSTANT = {OFFSET, "coulomb_asymmetry"}
NEAR = {"turn": "presliding", "dip": "stribeck"}  # what friction near rest is a part of


@dataclass
class State:
    """What the last fit stands at: coefficients ``k`` of the plain law, effects, its shape."""

    k: dict[str, float]
    terms: list[Term]
    vs: float
    exponent: float = 2.0
    grease: float = 0.0  # exponent of a bend of the friction curve, 0 without one
    bare: bool = False  # what every drive has is held to its size
    constant: bool = False  # a constant torque is a term, of any size
    late: float = 0.0  # s: so much later than logged the torque acts
    absent: frozenset[str] = frozenset()  # parts of friction that the law does not have

    def copy(self, **other: Any) -> State:
        own = {"k": dict(self.k), "terms": [t.copy() for t in self.terms]}
        return replace(self, **own | other)

    @property
    def named(self) -> list[Term]:
        """The effects beside the declared ones."""
        return [t for t in self.terms if not t.declared]

    def without_names(self, **other: Any) -> State:
        return self.copy(terms=[t.copy() for t in self.terms if t.declared], **other)

    def delayed(self, view: View) -> bool:
        """Whether the torque may act at any time; at steady speeds it has none."""
        return not (self.bare or view.is_map)

    def apply(self, view: View) -> None:
        """Friction and load along the log, which effects scale."""
        m, k = view.motion, self.k
        fine, view.z = view.deflection(self.bristle(view))
        dip = m.coarse(fine * self.fall(m.fine_w))
        view.coulomb = k["Fc"] * view.z + k["dip"] * dip
        level = k["Fc"] + k["dip"] * self.fall(m.w)
        view.level = np.maximum(level, 0.1 * abs(k["Fc"]))
        view.viscous = k["Fv"] * m.w
        if self.grease:
            view.viscous = view.viscous + k.get("grease", 0.0) * view.grease(self.grease)
        view.friction, view.J = view.coulomb + view.viscous, k["J"]
        view.set_load(self.terms)
        self.dip = dip

    def bristle(self, view: View) -> float:
        """The length of the bristles, rad; next to none where the law has none."""
        return const.SLIGHT * view.x0 if "presliding" in self.absent else view.x0

    def fall(self, w: np.ndarray) -> np.ndarray:
        """exp(-|w/vs|^exponent): the Stribeck curve from 1 to 0."""
        return free_level(w, 0.0, 1.0, self.vs, self.exponent)

    def updated(self, names: Sequence[Name], b: np.ndarray, view: View) -> State:
        """The state that a fit says."""
        new = self.copy()
        for name, x in zip(names, b, strict=True):
            if isinstance(name, str):
                new.k[name] = float(x)
                if name == "late" and self.delayed(view):
                    new.late += float(x) * view.longest_hold
            elif isinstance(name[1], int):
                new.terms[name[0]].b[name[1]] = x
            else:
                term, key = new.terms[name[0]], name[1]
                p = term.block.own[key]
                term.q[key] = float(np.clip(term.q[key] + x, p.low, p.high))
        return new


class Design(Regression):
    """Rows of the last fit on one view: ``X`` (m, k), ``y`` (m,), ``names``, ``prior``."""

    def __init__(self, view: View, state: State) -> None:
        super().__init__(view.force)
        self.view, self.state = view, state
        v, m = view, view.motion
        state.apply(v)
        v.u = m.later(state.late) if state.late else m.u
        self.inputs: dict[int, np.ndarray] = {}  # torque before each effect on it
        for i, term in enumerate(state.terms):
            if term.on_input and not linear(term.block):
                self.inputs[i] = v.u
                v.u = v.changed(term.block, term.q)
        self.y = v.torque(v.u) - v.K @ m.d
        self.level = max(abs(state.k["Fc"]), 0.1 * v.force)
        self._plant()
        self._friction()
        self._background()
        for i, term in enumerate(state.terms):
            self._effect(i, term)
        for j, one, value in self._stated():
            self.prior = with_stated(self.prior, j, one, value)

    def _plant(self) -> None:
        v, add = self.view, self.add
        if v.J_range and not v.sure:  # a declared J holds where the log does not tell
            add("J", v.rows.a, low=v.J_range[0], high=v.J_range[1])
        else:
            add("J", v.rows.a, low=0.0)
        own = any(is_lateness(t.block) for t in self.state.terms)  # a delay has its own column
        most = 0.0 if own else 1.0 if self.state.bare else np.inf
        free = v.latest if self.state.bare else np.inf
        done = self.state.late / v.longest_hold
        sd = float(np.hypot(1 / Z95, done))  # a part of a hold, or, seldom, anything
        add("late", v.lateness(v.u), sd=sd, low=-most, high=min(most, free), centre=-done)

    def _friction(self) -> None:
        v, m, s, add = self.view, self.view.motion, self.state, self.add
        add("Fc", v.K @ v.z, low=-np.inf if m.one_way else 0.0)
        most = 0.0 if "stribeck" in s.absent else const.DIP * v.force
        add("dip", v.K @ s.dip, low=0.0 if v.is_map else -most, high=most)
        add("Fv", v.K @ m.w, low=0.0)
        grease = v.grease_rows(s.grease or const.GREASE[0])
        add("grease", grease, low=0.0, high=np.inf if s.grease else 0.0)
        add("damping", v.K @ m.slope(v.z))
        near = v.near_rest(s.bristle(v))
        for (kind, _, share), column in zip(const.NEAR_REST, near.T, strict=True):
            if NEAR[kind] not in s.absent:
                add("~", column, sd=share * self.level)

    def _background(self) -> None:
        """Every drive has a little of an offset, warming, unbalance: BACKGROUND of friction."""
        v, m, add, terms = self.view, self.view.motion, self.add, self.state.terms
        here = {t.name for t in terms}
        rows = [] if OFFSET in here else [("offset", np.ones(len(m)))]
        if not any(drifts(t.block) for t in terms):  # a drift is a warming itself
            rows.append(("~", v.z * (m.elapsed / m.duration - 0.5) * np.sqrt(12.0)))
        if v.model.motion == "linear" or np.ptp(m.theta) < 2:
            rows.append(("~", m.theta - m.theta.mean()))
        elif WEIGHT not in here:
            weight = columns(members("effect")[WEIGHT], {}, v.along()).wide
            rows += [("~", x) for x in np.asarray(weight).T]
        for name, x in rows:
            x = v.K @ x
            little = const.BACKGROUND * self.level / (rms(x) + TINY)
            if name == "offset" and self.constant:
                little = np.inf
            most = little if self.state.bare else np.inf  # thousands of rows outvote a prior
            add(name, x, sd=little, low=-most, high=most)
        for offset in v.offsets(self.level):
            add(*offset)

    @property
    def constant(self) -> bool:
        """Whether a constant torque is a term, and no other is one, as friction one way is."""
        v, other = self.view, {t.name for t in self.state.terms} & CONSTANT
        one = v.motion.one_way and "Fc" not in v.model.held()
        return self.state.constant and not (other or one)

    def _effect(self, i: int, term: Term) -> None:
        """Linear columns, and of each other value the slope of the torque over it."""
        v, add, block = self.view, self.add, term.block
        held = v.model.held()
        keys = [k for k in nonlinear(block, v.model.motion)
                if k in term.q and f"{term.key}.{k}" not in held]  # fmt: skip
        along = v.along(u=v.motion.held(v.u))
        if linear(block):
            made = columns(block, term.q, along)
            C = v.in_rows(made)
            for k in range(C.shape[1]):
                add((i, k), C[:, k], low=made.low[k], high=made.high[k])
            values = {**term.q, **to_values(block, term.b, term.q, along)}
        else:
            along, values = v.along(u=self.inputs.get(i, v.u)), term.q
        if not keys:
            return
        step = {k: step_of(block, k, term.q[k], along) for k in keys}
        # those that count per unit of strength move by so much more
        per = {k: term.b[0] if k in (scaled(block) or ()) else 1.0 for k in keys}
        steps = {k: step[k] * (per[k] or 1.0) for k in keys}
        made = slopes(block, values, along, steps)
        if i in self.inputs and made.wide is not None:
            made = replace(made, wide=v.motion.held(made.wide))
        S = v.in_rows(made)
        for j, key in enumerate(keys):
            far = 2 * const.CLIP * step[key]
            # how far it may lie from where a search found it
            sd = far if block.own[key].low < 0.0 else max(const.PART * abs(term.q[key]), step[key])
            most = far if block.states else sd
            add((i, key), S[:, j] * per[key], sd=sd, low=-most, high=most)

    def _stated(self) -> Iterator[tuple[int, Stated, float | None]]:
        """Places of coefficients, what the model states of them, and their declared values."""
        model, names = self.view.model, self.names
        stated, values = model.stated, model.values()
        for key in ("J", "Fc", "Fv"):
            if key in stated:
                yield names.index(key), stated[key], values[key]
        if {"Fc", "Fs"} <= model.held():
            dip = (values["Fs"] or 0.0) - (values["Fc"] or 0.0)
            yield names.index("dip"), stated["Fs"], dip
        for i, term in enumerate(self.state.terms):
            gain = f"{term.key}.{term.block.gain}"
            if gain not in stated or (i, 0) not in names:
                continue
            one, value, known = stated[gain], values[gain], linear(term.block)
            if len(known) == 1:
                neutral = term.block.own[term.block.gain].neutral or 0.0
                low, high = (None if x is None else x - neutral for x in (one.low, one.high))
                value = None if value is None else value - neutral
                yield names.index((i, 0)), replace(one, low=low, high=high), value
            elif one.fixed and value is not None:  # the phase stays where it was found
                phase, way = values.get(f"{term.key}.{known[1]}"), term.b
                if phase is not None and term.block.own[known[1]].angle:
                    way = np.array([np.cos(phase), np.sin(phase)])
                way = way / (float(np.hypot(*way)) or 1.0)
                for k in (0, 1):
                    yield names.index((i, k)), one, float(value * way[k])


def drifts(block: Block) -> bool:
    """Whether an effect is itself a slow change of friction."""
    return block.timed and "Fc" in block.acts and not any(p.instant for p in block.own.values())


class LastFit:
    """A fit at a state, repeated ``turns`` times at what it says, or until a delay stays.
    ``values`` has all that is reported."""

    def __init__(self, view: View, state: State, scale: float, turns: int = 3) -> None:
        self.view, self.scale, w = view, scale, None
        for turn in range(const.MOST_TURNS):
            d = self.design = Design(view, state)
            self.fit = robust(d.X, d.y, d.prior, self.scale, view.noise, w, 4 if turn == 0 else 2)
            w, self.state = self.fit.w, state
            self.scale = max(scale, spread(self.fit.r) * self.scale)
            off = abs(self.fit.b[d.names.index("late")]) if state.delayed(view) else 0.0
            if turn >= turns - 1 and off < const.STAYS:
                break
            state = state.updated(d.names, self.fit.b, view)
        self.values = quantities(d, self.fit.b)

    @cached_property
    def left(self) -> np.ndarray:
        """What the fit leaves in the rows (m,), N m."""
        return self.design.y - self.design.X @ self.fit.b

    def part(self, *names: str) -> np.ndarray:
        """The torque (m,) of columns with these names."""
        at = [j for j, n in enumerate(self.design.names) if n in names]
        return self.design.X[:, at] @ self.fit.b[at]

    @cached_property
    def friction(self) -> np.ndarray:
        """The friction torque (m,) in the rows."""
        return self.part("Fc", "dip", "Fv", "grease", "damping")

    @cached_property
    def torque(self) -> dict[int, np.ndarray]:
        """The torque (m,) of each effect in the rows."""
        d, v, made = self.design, self.view, {}
        for i in range(len(self.state.terms)):
            at = places(d, i)
            made[i] = v.torque(self.along(i)) if i in d.inputs else d.X[:, at] @ self.fit.b[at]
        return made

    def along(self, i: int) -> np.ndarray:
        """The torque (n,) of an effect along the log."""
        d, v, term = self.design, self.view, self.state.terms[i]
        if i in d.inputs:
            return d.inputs[i] - changed_input(term.block, term.q, v.along(u=d.inputs[i]))
        b = self.fit.b[places(d, i)]
        return v.columns(term.block, term.q).torque @ b if len(b) else np.zeros(len(v.motion))

    def left_by_declared(self, view: View) -> np.ndarray | None:
        """What declared values leave in the rows (m,) of a view; None where one is missing."""
        known, block = view.declared, view.model.friction.block
        law = {k for k, p in block.own.items() if p.fitted}
        if None in view.model.values().values() or not law <= LAW | {"sigma0", "sigma1"}:
            return None
        k = {"J": known["J"], "Fc": known.get("Fc", 0.0), "Fv": known.get("Fv", 0.0)}
        k["dip"] = known.get("Fs", k["Fc"]) - k["Fc"]
        terms = [t.copy() for t in view.terms if t.declared]
        vs = known.get("vs", self.state.vs)
        design = Design(view, State(k, terms, vs, known.get("delta", 2.0)))
        b = np.array([k.get(n, 0.0) if isinstance(n, str) else
                      terms[n[0]].b[n[1]] if isinstance(n[1], int) else 0.0
                      for n in design.names])  # fmt: skip
        return design.y - design.X @ b

    def bend(self) -> float:
        """RMS torque of the grease beside Fc, the Stribeck dip and Fv, as a share of friction."""
        return self._beside(self.part("grease"), {"J", "Fc", "dip", "Fv", "run", "offset"})

    def share(self, i: int) -> float:
        """RMS torque of effect i beside what law and declared effects imitate, over friction."""
        law = {"J", "Fc", "dip", "Fv", "damping", "run"}
        return self._beside(self.torque[i], law)

    def _beside(self, tau: np.ndarray, law: set[str]) -> float:
        d = self.design
        known = [j for j, t in enumerate(self.state.terms) if t.declared]
        at = [j for j, n in enumerate(d.names)
              if n in law or isinstance(n, tuple) and n[0] in known]  # fmt: skip
        X = d.X[:, at]
        tau = tau - X @ np.linalg.lstsq(X, tau, rcond=None)[0]
        return rms(tau) / self.view.size


def places(design: Design, i: int) -> list[int]:
    """The places of the linear coefficients of effect i."""
    return [j for j, n in enumerate(design.names)
            if isinstance(n, tuple) and n[0] == i and isinstance(n[1], int)]  # fmt: skip


def quantities(design: Design, b: np.ndarray) -> dict[str, float]:
    """Everything that is reported, from the coefficients."""
    state, v = design.state, design.view
    at, w, m = dict(zip(design.names, b, strict=True)), v.typical, v.motion
    held = at.get("offset", 0.0) * np.sign(np.mean(m.w)) if m.one_way else 0.0
    made = {k: float(at[k]) for k in ("J", "Fc", "Fv", "grease")}
    made |= {"Fs": at["Fc"] + at["dip"], "offset": at.get("offset", 0.0), "late": at["late"]}
    made["late"] += (state.late - v.logged_late) / v.longest_hold
    made["Fc + constant"] = at["Fc"] + held
    made["sum"] = (
        at["Fc"] + at["dip"] * float(state.fall(np.array(w))) + at["Fv"] * w + held
        + at["grease"] * w ** (state.grease or const.GREASE[0])
    )  # fmt: skip
    along = v.along()
    for i, term in enumerate(state.terms):
        q = {k: x + at.get((i, k), 0.0) for k, x in term.q.items()}
        own = np.array([at[i, k] for k in range(len(linear(term.block)))])
        c = own * _of_fitted(term.block, state, at)
        values = to_values(term.block, c, q, along)
        made |= {f"{term.key}.{k}": float(x) for k, x in values.items()}
    return made


def _of_fitted(block: Block, state: State, at: dict[Name, float]) -> float:
    """Shares of a quantity were taken of the state's; they count of the fitted one."""
    acts = {a for a in block.acts if not a.startswith("+")}
    if acts & {"J", "sensor"}:
        key = "J"
    elif acts & {"Fc", "Fs"}:
        key = "Fc"
    elif "Fv" in acts and not state.grease:
        key = "Fv"
    else:
        return 1.0
    return state.k[key] / at[key] if at[key] else 1.0


def state_of(table: Table) -> State:
    """The last fit begins where the table ended."""
    v = table.view
    b = dict(zip(v.names, table.fit.b, strict=False))
    Fc, Fv = b["Fc"] + 0.5 * (b["short_tail"] + b["long_tail"]), b["Fv"]
    k = {
        "J": table.J,
        "Fc": Fc if Fc > 0 else 0.3 * v.size,
        "dip": b["bump"] + 0.5 * b["short_tail"],
        "Fv": Fv if Fv > 0 else 0.01 * v.size / max(v.motion.top, 1e-12),
    }
    terms = [t.copy() for t in v.terms]
    for term in terms:
        if (term.key, 0) in b:
            term.b = np.array([b[term.key, i] for i in range(len(linear(term.block)))])
    for c in table.chosen:
        terms += c.terms([t.name for t in terms])
    return State(k, terms, v.vs)


def with_stated(prior: Prior, j: int, one: Stated, value: float | None) -> Prior:
    """The prior with what is stated of coefficient j, whose declared value is given."""
    if one.fixed and value is not None:
        sd = const.EXACT * max(abs(value), 1e-12)
        low, high = sorted((value * (1 - const.EXACT), value * (1 + const.EXACT)))
        return prior.but(j, precision=1 / sd**2, centre=value, low=low - sd, high=high + sd)
    if one.std is not None and value is not None:
        prior = prior.but(j, precision=1 / one.std**2, centre=value)
    low = prior.low[j] if one.low is None else max(prior.low[j], one.low)
    high = prior.high[j] if one.high is None else min(prior.high[j], one.high)
    return prior.but(j, low=low, high=max(high, low))


WITHOUT_SCALE = ("phase", "harmonic", "side")

Value = tuple[float, float, float]


class Law(NamedTuple):
    """A friction law beside the fitted one."""

    likelihood: float  # less the price of its parameters
    b: np.ndarray
    vs: float
    exponent: float  # of the Stribeck curve
    grease: float  # exponent, 0: none


class Interval:
    """Covariance of what a last fit reports, and the friction laws beside its own."""

    def __init__(self, last: LastFit) -> None:
        self.last, self.names = last, tuple(last.values)

    @cached_property
    def blocks(self) -> list[np.ndarray]:
        fit, apart = self.last.fit, self.last.view.apart
        if apart is not None:
            return [apart]
        return memory_blocks(fit.r * fit.w**0.5, const.FEWEST_LEFT_OUT)

    @property
    def stretches(self) -> int:
        """How many stretches of the motion are independent."""
        return int(self.blocks[0][-1]) + 1

    @cached_property
    def kappa(self) -> float:
        """Rows that tell as much as one that knows nothing of its neighbours."""
        memory = 4 if self.last.view.apart is None else 1  # blocks are so many memories long
        return max(const.SEVERAL, len(self.last.fit.r) / (memory * self.stretches))

    @property
    def likelihood(self) -> float:
        own = const.ONE_MORE * self.kappa if self.last.state.grease else 0.0
        return float(np.sum(log_density(self.last.fit.r))) - own

    @cached_property
    def laws(self) -> list[Law]:
        """Other Stribeck speeds and exponents, then with and without grease."""
        last, state = self.last, self.last.state
        v, d = last.view, last.design
        m, fine = v.motion, v.deflection(state.bristle(v))[0]
        shapes = [
            (min(share * v.vs, v.longest_fall), e)
            for share in const.OTHER_SPEEDS
            for e in const.EXPONENTS
        ]
        falls = [state.copy(vs=vs, exponent=e).fall(m.fine_w) for vs, e in shapes]
        dips = v.K @ m.coarse(np.column_stack([fine * fall for fall in falls]))
        dip, grease = d.names.index("dip"), d.names.index("grease")
        made, X = [], d.X.copy()

        def fit(j: int, exponent: float, turns: int = 2) -> None:
            X[:, dip] = dips[:, j]
            if exponent and exponent != state.grease:
                X[:, grease] = v.grease_rows(exponent)
            prior = d.prior.but(grease, high=np.inf if exponent else 0.0)
            f = robust(X, d.y, prior, last.scale, v.noise, last.fit.w, turns)
            price = const.ONE_MORE * self.kappa if exponent else 0.0
            score = float(np.sum(log_density(f.r))) - price
            made.append(Law(score, f.b, *shapes[j], exponent))

        for j in range(len(shapes)):
            fit(j, state.grease)
        best = max(range(len(shapes)), key=lambda j: made[j].likelihood)
        if "sublinear_viscous" not in {t.name for t in state.terms}:
            for exponent in (0.0, *const.GREASE):
                if exponent != state.grease:
                    fit(best, exponent, 3)
        return made

    @cached_property
    def coefficients(self) -> np.ndarray:
        """Covariance (k, k) of the coefficients: blocks left out, and laws by likelihood."""
        last, d = self.last, self.last.design
        v, b = last.view, last.fit.b
        size = np.mean(d.X**2, axis=0) * len(d.y)
        at = {n: j for j, n in enumerate(d.names) if isinstance(n, str)}
        told = last.fit.free | np.isin(np.arange(len(b)), [at[k] for k in ("J", "Fc", "Fv")])
        precision = np.where(told, d.prior.precision, 1e9 * size / last.scale**2)
        if v.J_range and not v.sure:  # a declared J that is held is known that well
            precision[0] = 16 / max(float(np.ptp(v.J_range)), const.SCALE * v.J_range[1]) ** 2
        prior = d.prior.but(slice(None), precision=precision)
        noise = v.noise if last.fit.free[0] else 0.0  # it takes nothing from a J that is held
        V = left_out_covariance(d.X, d.y, last.fit, prior, last.scale, noise, self.blocks)
        laws = self.laws
        score = np.array([law.likelihood for law in laws] + [self.likelihood]) / self.kappa
        share = np.exp(score - score.max())
        share /= share.sum()
        apart = np.array([law.b for law in laws] + [b]) - b
        return const.WHOLE**2 * V + (share[:, None] * apart).T @ apart + np.diag(self._little**2)

    @cached_property
    def _little(self) -> np.ndarray:
        """Of each coefficient (k,), the standard deviation by what every drive has a little of."""
        last, d, b = self.last, self.last.design, self.last.fit.b
        at = {n: j for j, n in enumerate(d.names) if isinstance(n, str)}
        level = max(abs(float(b[at["Fc"]])), 0.1 * rms(d.y))
        share = np.zeros(len(b))
        share[
            [j for j, n in enumerate(d.names) if isinstance(n, tuple) and isinstance(n[1], int)]
        ] = 1
        share[[at["Fc"], at["Fv"], *([at["offset"]] if d.constant else [])]] = 1
        share[at["J"]] = const.ALONG * last.fit.free[at["J"]]
        return share * const.BACKGROUND * level / np.sqrt(np.mean(d.X**2, axis=0) + TINY)

    @cached_property
    def _slopes(self) -> np.ndarray:
        """Derivatives (values, k) of what is reported by the coefficients."""
        d, b = self.last.design, self.last.fit.b
        sd = np.sqrt(np.maximum(np.diag(self.coefficients), 0.0)) + TINY
        made = np.zeros((len(self.names), len(b)))
        for j in range(len(b)):
            step = np.zeros(len(b))
            step[j] = const.PART * sd[j]
            up, down = quantities(d, b + step), quantities(d, b - step)
            made[:, j] = [wrapped(up[k] - down[k], k) / (2 * step[j]) for k in self.names]
        return made

    def covariance(self) -> np.ndarray:
        """Covariance (values, values) of ``names`` by this description of the log alone."""
        V = self._slopes @ self.coefficients @ self._slopes.T
        own = self.last.values
        for i, k in enumerate(self.names):
            if k.rpartition(".")[2].split("_")[0] not in WITHOUT_SCALE:
                V[i, i] += (const.SCALE * own[k]) ** 2
        for term in self.last.state.terms:  # no clock of two channels is better
            if is_lateness(term.block):
                i = self.names.index(f"{term.key}.{term.block.gain}")
                V[i, i] += (const.NEAR * self.last.view.motion.dt) ** 2
        return V

    def between(self, others: Sequence[Mapping[str, float]]) -> np.ndarray:
        """What other descriptions add to it, by how far (some of) the values are from these."""
        apart = [[wrapped(one.get(k, 0.0), k) for k in self.names] for one in others]
        A = np.array(apart).reshape(-1, len(self.names))
        return A.T @ A / max(len(others), 1)

    def values(self, V: np.ndarray | None = None) -> dict[str, Value]:
        """(value, low, high) of each; by this description alone where no covariance is given."""
        V = self.covariance() if V is None else V
        half = Z95 * np.sqrt(np.maximum(np.diag(V), 0.0))
        own = self.last.values
        return {k: (own[k], own[k] - h, own[k] + h)
                for k, h in zip(self.names, half.tolist(), strict=True)}  # fmt: skip


def tells(x: Value) -> bool:
    """Whether the interval of an inertia is narrow enough for it to be an answer."""
    return x[0] > 0 and x[2] - x[1] < 2 * const.MOSTLY * x[0]


def wrapped(x: float, key: str) -> float:
    """A difference of phases lies between -pi and pi."""
    is_phase = key.rpartition(".")[2].startswith("phase")
    return (x + np.pi) % (2 * np.pi) - np.pi if is_phase else x


def best_law(view: View, state: State, scale: float, straight: bool = False) -> LastFit:
    """The fit at its best friction law; ``straight``: without grease."""
    last = LastFit(view, state, scale)
    interval = Interval(last)
    laws = [law for law in interval.laws if not (straight and law.grease)]
    best = max(laws, key=lambda law: law.likelihood)
    if best.likelihood <= interval.likelihood + 1:
        return last
    moved = last.state.updated(last.design.names, best.b, view)
    moved = moved.copy(vs=best.vs, exponent=best.exponent, grease=best.grease)
    return LastFit(view, moved, scale, turns=2)


def apart(other: LastFit, last: LastFit) -> dict[str, float]:
    """How far the values of another fit are from those of the last one."""
    return {k: other.values[k] - x for k, x in last.values.items() if k in other.values}


def other_views(last: LastFit, widest: float = np.inf) -> list[dict[str, float]]:
    """How far the values are by other motions, in windows up to ``widest`` times as wide."""
    made, view = [], last.view
    for stiffer, wider in const.VIEWS:
        try:
            motion = view.motion.varied(stiffer)
            rows = Rows(motion, max(1.0, min(wider, widest)) * view.rows.h)
            other = view.by(motion, rows)
            other.settle_as(view)
            made.append(apart(LastFit(other, last.state.copy(), last.scale, turns=2), last))
        except (Refused, np.linalg.LinAlgError):
            continue
    return made
