"""The answer of the torque balance: decision and last fit, until the fit holds what is named."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ..blocks.block import members
from ..blocks.model import Model
from ..core.errors import Refused
from ..record.stretches import Stretch
from .columns import columns, linear, nonlinear, to_coefficients
from .constants import (
    BENT,
    CLEAR,
    FLOOR,
    MOSTLY,
    SURE,
    Z95,
    Z_LOWER,
)
from .decision import Decision
from .friction import Term, View, declared_terms
from .interval import Interval, Value, best_law, other_views
from .last_fit import LastFit, State
from .motion import Motion
from .rows import Rows
from .samples import sampled
from .width import Declared, Width, fine_wave


@dataclass
class Answer:
    """What the torque balance says of a log.

    ``values`` are (value, low, high) by name with their ``covariance``, all from ``last``.
    """

    verdict: str
    decision: Decision
    last: LastFit
    interval: Interval
    values: dict[str, Value]
    covariance: np.ndarray
    alternatives: list[str] = field(default_factory=list)
    depends_on: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    errors: dict[str, float] = field(default_factory=dict)

    @property
    def named(self) -> list[Term]:
        return [t for t in self.last.state.terms if not t.declared]


def first_view(stretches: Sequence[Stretch], model: Model) -> tuple[View, Width]:
    """The log as the table sees it."""
    motion = Motion.of(sampled(stretches))
    known = model.known()
    turns = motion.span > 2 and model.motion != "linear"
    if turns:
        place = columns(members("effect")["gravity"], {}, _places(motion)).wide
    else:
        place = (motion.theta - motion.theta.mean())[:, None]
    width = Width(motion, Declared(known.get("J"), known.get("Fc"), place, turns))
    J = known.get("J")
    if motion.steady:  # one speed: nothing is learnt of the inertia, nor of lateness
        width.sure, width.impossible = False, False
        width.range = (J / 1.1, 1.1 * J) if J else width.range
    wave = fine_wave(motion, width.h) if model.motion != "linear" else 0.0
    if wave:  # at windows this narrow noise would take the inertia
        narrow = 4 / (wave * float(np.median(np.abs(motion.w))))
        width.h = min(width.h, max(narrow, 3 * motion.dt, 0.004))
        width.range = (J / 1.4, 1.4 * J) if J and width.sure else width.range
    terms = declared_terms(model, _places(motion))
    view = View(motion, Rows(motion, width.h), model, width.range, terms)
    view.sure = width.sure
    return view, width


def _places(motion: Motion):
    from .columns import Along

    z = np.zeros(len(motion))
    return Along(t=motion.t, theta=motion.theta, w=motion.w, acceleration=z, path=motion.path,
                 pieces=motion.pieces, u=motion.u, z=z, follows=z, coulomb=z, level=z, viscous=z,
                 load=z, J=0.0, values={})  # fmt: skip


def answer(stretches: Sequence[Stretch], model: Model) -> Answer:
    """Verdict, names and values; Refused where nothing can be learnt."""
    view, width = first_view(stretches, model)
    if np.ptp(view.u) == 0:
        raise Refused("u is the same in every row: the torque channel is dead.")
    if width.impossible and not model.known().get("J"):
        raise Refused("inertia negative and no friction: u follows the motion, or has the wrong sign.")
    decision = Decision(view, width)
    return settled(decision)


def first_state(decision: Decision) -> State:
    """The last fit begins where the table ended."""
    table, v = decision.table, decision.view
    b = dict(zip(v.names, table.fit.b, strict=False))
    k = {
        "J": table.J,
        "Fc": b["Fc"] + 0.5 * (b["short_tail"] + b["long_tail"]),
        "dip": b["bump"] + 0.5 * b["short_tail"],
        "Fv": b["Fv"],
    }
    k["Fc"] = k["Fc"] if k["Fc"] > 0 else 0.3 * v.size
    k["Fv"] = k["Fv"] if k["Fv"] > 0 else 0.01 * v.size / max(v.motion.top, 1e-12)
    terms = [t.copy() for t in v.terms]
    for term in terms:
        if (term.key, 0) in b:
            term.b = np.array([b[term.key, i] for i in range(len(linear(term.block)))])
    used = [t.name for t in terms]
    for c in table.chosen:
        many = len(linear(c.block)) if c.C is not None else 0
        for i, q in enumerate(c.each):
            used.append(c.name)
            n = used.count(c.name)
            key = c.name if n == 1 else f"{c.name}_{n}"
            terms.append(Term(c.block, key, dict(q), np.array(c.b[i * many : (i + 1) * many])))
    return State(k, terms, v.vs)


def settled(d: Decision) -> Answer:
    """The last fit; a name that it does not hold is struck and the verdict decided again."""
    struck: set[str] = set()
    candidates: list[tuple[float, str]] = []
    notes: list[str] = []
    while True:
        last = best_law(d.view, first_state(d), d.table.scale)
        a = _with_intervals(d, last, struck)
        terms = last.state.terms
        lost = [i for i, t in enumerate(terms) if not t.declared
                and not (holds(a, i) and (_first(a, i) or stands(a, i)))]  # fmt: skip
        if not lost or len(struck) > 8:
            break
        i = lost[-1]
        name = terms[i].name
        notes.append(f"{name} is not held by the last fit")
        if last.share(i) > 2 * FLOOR:
            candidates.append((-last.share(i), name))
        struck.add(name)
        if any(t.name == name for t in d.joined):
            d = Decision(d.view, d.width, never={*d.never, name})
            d.view.terms = [t for t in d.view.terms if t.name != name]
            d = Decision(d.view, d.width, never={*d.never, name})
            continue
        d.decide(struck)
    if last.state.grease and not bent(a):
        last = LastFit(d.view, last.state.copy(grease=0.0), d.table.scale)
        a = _with_intervals(d, last, struck)
    a.notes = notes
    if a.verdict == "unexplained":
        a.alternatives = list(dict.fromkeys([*a.alternatives, *(n for _, n in sorted(candidates))]))
    return a


def _with_intervals(d: Decision, last: LastFit, struck: set[str]) -> Answer:
    interval = Interval(last)
    orders = [t.q[k] for t in last.state.terms for k in t.q if t.block.own[k].whole]
    widest = np.inf
    if orders:
        widest = 5 / (max(orders) * float(np.quantile(d.view.rows.w, 0.2)) + 1e-9) / d.width.h
    V = interval.covariance([*other_views(last, widest), *rivals(d, last)])
    return Answer(d.verdict, d, last, interval, interval.values(V), V, list(d.alternatives), list(d.depends_on))


def rivals(d: Decision, last: LastFit) -> list[LastFit]:
    """The drive with an alternative in place of the named effect."""
    own = [t for t in last.state.terms if not t.declared]
    if len(own) != 1:
        return []
    made = []
    for c in d.named:
        if c.name not in d.alternatives or c.name == own[0].name or c.block is None:
            continue
        many = len(linear(c.block)) if c.C is not None else 0
        terms = [t for t in last.state.terms if t.declared]
        terms += [Term(c.block, f"rival.{c.name}", dict(q), np.array(c.b[i * many:(i + 1) * many]))
                  for i, q in enumerate(c.each)]
        other = LastFit(d.view, last.state.copy(terms=[t.copy() for t in terms]), last.scale, 2)
        other.values = {k: other.values[k] for k in ("J", "Fc", "Fv")}
        made.append(other)
    last.state.apply(d.view)
    return made


def _first(a: Answer, i: int) -> bool:
    return next(j for j, t in enumerate(a.last.state.terms) if not t.declared) == i


def stands(a: Answer, i: int) -> bool:
    """A further effect explains more torque than all that stays."""
    return a.last.share(i) > check(a.last).stays / a.decision.view.size


def holds(a: Answer, i: int) -> bool:
    """Its interval excludes no effect, its torque matters."""
    term, x = a.last.state.terms[i], a.values
    own, key = term.block.own, f"{term.key}.{term.block.gain}"
    mine = {k: v for k, v in x.items() if k.startswith(f"{term.key}.")}
    gain = mine[key]
    if own[term.block.gain].unit == "kg m2" and (x["J"][1] <= 0 or gain[2] - gain[1] > abs(gain[0])):
        return False  # which inertia is whose?
    if not all(np.isfinite(v).all() for k, v in mine.items()):
        return False
    for k, v in mine.items():
        p = own[k.removeprefix(f"{term.key}.")]
        if p.unit == "s" and p.low < 0 and v[2] - v[1] > 0.5 * a.decision.view.motion.duration:
            return False
    neutral = own[term.block.gain].neutral
    if neutral is not None and np.isfinite(neutral) and gain[1] <= neutral <= gain[2]:
        return False
    high = own[term.block.gain].high
    if np.isfinite(high) and own[term.block.gain].unit == "1" and gain[0] > 0.99 * high:
        return False
    c = next((c for c in a.decision.table.chosen if c.name == term.name), None)
    return c is None or a.last.share(i) > 0.7 * a.decision.floor(c)


def bent(a: Answer) -> float:
    """The bend of the friction curve where it is worth a name; else 0."""
    last, x = a.last, a.values["grease"]
    if not last.state.grease or a.decision.view.motion.one_way or x[1] <= 0:
        return 0.0
    bend = last.bend()
    sure = x[0] > 4 * (x[0] - x[1]) / Z95
    least = max(FLOOR / 3, check(last).stays / a.decision.view.size)
    return bend if bend > BENT or sure and bend > least else 0.0


@dataclass
class Check:
    unseen: np.ndarray
    error: float
    stays: float


def check(last: LastFit) -> Check:
    """Residual on the half that it has not seen, and what of it is torque."""
    made = getattr(last, "_check", None)
    if made is None:
        from .held_out import size, structured, unseen

        rows = last.view.rows
        r = unseen(last)
        made = Check(r, size(r), structured(r, rows.t, rows.step, rows.h))
        last._check = made
    return made
