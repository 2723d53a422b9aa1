"""Rows that no step of a fit or a choice sees, and what models leave on them.

The answer of the torque balance: what is missing, and every value, from one last fit.

Names are chosen on training rows. They stand where the last fit holds them and where the torque
error of rows falls that no fit and no choice has seen; then all rows give the values.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..blocks.block import members
from ..blocks.model import Model
from ..core.errors import Refused
from ..core.numeric import Z95, rms
from ..core.regression import log_density, paired, spread
from ..record import Stretch
from . import constants as const
from .decision import Decision
from .friction import OFFSET, Term, View
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
from .motion import Sensors
from .search import Search
from .seen import refuse_dead, seen
from .table import Table, errors_of
from .windows import Rows

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
            max((rows.t[-1] - rows.t[0]) / const.ALTERNATE, const.LONGER_REACH * rows.reach),
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
    stretch = (without.t / max(const.BLOCK, duration / 60)).astype(int)
    there = np.bincount(stretch) > 0
    scale = spread(other.r) + 1e-300
    both = [np.bincount(stretch, log_density(one.r / scale))[there] for one in (other, without)]
    total, error = paired(*both)
    return total / error


def _far(r: np.ndarray) -> float:
    """From where on a row is far off, and counts no more."""
    return const.OUTLIER * spread(r) + 1e-300


def lasting(r: np.ndarray, rows: Rows) -> float:
    """RMS over all rows of those that are far off: for longer than the windows around one bad
    sample are (contacts, bursts), or again and again (an impact at each reversal). The largest
    stretch of them is left out: what is there once decides nothing."""
    off = np.flatnonzero(np.abs(r) > _far(r))
    t, size = rows.t[off], r[off] ** 2
    ends = [0, *(np.flatnonzero(np.diff(t) > 2 * rows.step) + 1).tolist(), len(off)]
    every = [slice(a, b) for a, b in zip(ends[:-1], ends[1:], strict=True) if b > a]
    if len(every) < const.AGAIN:
        every = [at for at in every if t[at.stop - 1] - t[at.start] > const.LASTS * rows.reach]
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
STAYS = "Torque of {:.2g} % of friction stays, and nothing explains it."
LATE_SPEED = "w is {:.3g} ms behind dtheta/dt."


@dataclass(eq=False)
class Answer:
    """What the torque balance says of a log.

    ``values`` are (value, low, high) by name, with their ``covariance`` over ``interval.names``;
    ``without`` and ``with_names`` are the errors of held-out rows, ``refitted`` and ``trained``
    the fits to training rows behind them.
    """

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
    view, few, width, _ = seen(stretches, model)
    refuse_dead(view, width)
    if not view.is_map and view.motion.duration < 2 * const.FEWEST_BLOCKS * view.rows.h:
        raise Refused(TOO_SHORT.format(const.FEWEST_BLOCKS, 2e3 * view.rows.h), LONGER)
    if view.is_map and view.values >= len(np.unique(view.motion.run)):
        raise Refused(UNTESTED, MORE_SPEEDS)
    split = Split.of(few, held_out)

    def judged(train: View, test: View) -> Answer:
        decision = Decision(train, width, (), least, alpha)
        return _Judge(few, train, test, split, decision, view).answer()

    made = judged(few.on(split.train), few.on(split.test))
    if not view.is_map:
        return made
    # a few runs fewer name less: all are chosen by, and a choice by a part says how it predicts
    other, made = made, judged(view.on(), view.on())
    for key in ("without", "with_names", "refitted", "trained", "declared_error"):
        setattr(made, key, getattr(other, key))
    if made.verdict != "unexplained" and view.follows_speed(made.last.left):
        made.verdict, made.depends_on = "unexplained", ["w"]
    return made


class _Judge:
    """The last fit and the errors of held-out rows, until both hold what is named.

    The table has seen training rows only. What it names is fitted to all rows, and struck where
    that fit does not hold it; the same names fitted to training rows are judged on the others.
    Of a long log, ``view`` are parts that are enough for this; ``every`` row gives the values.
    """

    def __init__(
        self, view: View, train: View, test: View, split: Split, decision: Decision, every: View
    ) -> None:
        self.view, self.train, self.test, self.split = view, train, test, split
        self.decision, self.all = decision, every
        self.struck: set[str] = set()
        self.candidates: list[tuple[float, str]] = []  # less their share of friction
        self.notes: list[str] = []
        self.absent: frozenset[str] = frozenset()  # parts of friction that are not named
        self.apart: tuple[LastFit, list[dict[str, float]]] | None = None

    def answer(self) -> Answer:
        last = self._held()
        trained = self._on_training_rows(last.state)
        without = self._without(trained.state)
        full, plain = Unseen.of(trained, self.test), Unseen.of(without, self.test)
        verdict, named = self._verdict(last, full, plain, without)
        if not named:  # the declared model is what is shown
            if self.absent or last.state.named:
                last = self._plain(last)
                trained = self._on_training_rows(last.state)
            without, plain = trained, Unseen.of(trained, self.test)
            full = plain
        few, last = last, self._of_all(last)
        V = last.interval.covariance() + last.interval.between(self._others(few))
        d, rivals = self.decision, self._rivals(few)
        other = [apart(rival, few) for rival in rivals]
        V = V + last.interval.between(
            [{k: x for k, x in one.items() if k in PLANT} for one in other]
        )
        left = few.left_by_declared(self.test)
        made = Answer(
            verdict, d, self.all, self.split, last, last.interval, last.interval.values(V), V,
            plain, full, without, trained, d.alternatives, depends_on=d.depends_on,
            notes=[*d.notes, *self.notes], rivals=rivals,
            # the largest first, but what the plain answer has
            candidates=[name for _, name in sorted(self.candidates)
                        if not (name == OFFSET and last.design.constant)],
            declared_error=None if left is None else Unseen.left(left, self.test.rows).error,
        )  # fmt: skip
        self._late_speed(made)
        self._whole_inertia(made)
        last.state.apply(last.view)
        return made

    # ---- what the last fit holds
    def _held(self) -> LastFit:
        """The last fit to all rows, with the names that it holds."""
        while True:
            self._share()
            last = best_law(self.view, self._found_again(self.view), self.decision.table.scale)
            last = self._bent(self._without_small_waves(last))
            lost = self._lost(last, last.interval.values())
            if not lost and last.state.named:
                V = last.interval.covariance() + last.interval.between(self._others(last))
                lost = self._lost(last, last.interval.values(V))
            if not lost:
                return last
            self._strike(last, lost[-1])

    def _found_again(self, view: View) -> State:
        """The chosen effects at their values on all rows: an order, an instant, a gap."""
        d, table = self.decision, Table(view, self.decision.table.scale)
        for c in d.table.chosen:
            search = Search(table, d.width.sure, d.never, only={c.name})
            rows = [row for row in search.rows() if row.order == c.order]
            rows.append(table.enter(search.again(c)))
            table.extend(max(rows, key=lambda row: row.gain))
        return state_of(table)

    def _without_small_waves(self, last: LastFit) -> LastFit:
        """Of several waves of one effect, those that the fit holds beside the first."""
        names = [t.name for t in last.state.terms]
        if len(names) == len(set(names)):
            return last
        values = last.interval.values()
        kept = [t for i, t in enumerate(last.state.terms)
                if t.declared or t.name not in names[:i] or holds(last, values, i)]  # fmt: skip
        return LastFit(self.view, last.state.copy(terms=[t.copy() for t in kept]), last.scale)

    def _stays(self, last: LastFit) -> float:
        """What lasts longer than a window of what a fit leaves, as a share of friction."""
        return Unseen.left(last.left, self.view.rows).stays / self.view.size

    def _lost(self, last: LastFit, values: dict[str, Value]) -> list[int]:
        """Effects that the fit does not hold; of further ones those explaining less than stays."""
        stays, terms = self._stays(last), last.state.terms
        own = [i for i, t in enumerate(terms) if not t.declared and t.name != GREASE_NAME]
        floors = {c.name: self.decision.floor(c) for c in reversed(self.decision.table.chosen)}
        first = {terms[i].name: i for i in reversed(own)}  # waves of one effect count once

        def kept(i: int) -> bool:
            share = last.share(i)
            large = share > const.HELD * floors.get(terms[i].name, 0.0)
            return holds(last, values, i) and large and (i == own[0] or share > stays)

        return [i for i in own if first[terms[i].name] == i and not kept(i)]

    def _strike(self, last: LastFit, i: int) -> None:
        name, d = last.state.terms[i].name, self.decision
        self.notes.append(f"{name} is not held by the last fit.")
        if last.share(i) > 2 * d.least:  # large, but not sure, or more stays
            self.candidates.append((-last.share(i), name))
        self.struck.add(name)
        if name in {t.name for t in d.joined}:
            for v in (self.view, self.train, self.test):
                v.terms = [t for t in v.terms if t.name != name]
            self.decision = Decision(self.train, d.width, {*d.never, name}, d.least, d.alpha)
        else:
            d.decide(self.struck)

    def _bent(self, last: LastFit) -> LastFit:
        """A bend of the friction curve that is worth a name is an effect; else it is dropped."""
        state = last.state
        if not state.grease:
            return last
        x, plain = last.interval.values()["grease"], state.copy(grease=0.0)
        sure = x[0] > const.SURE_BEND * (x[0] - x[1]) / Z95 and not self.view.motion.one_way
        if sure and last.bend() > max(self.decision.least, self._stays(last)):
            c = np.array([last.fit.b[last.design.names.index("grease")]])
            q = {"exponent": state.grease}
            plain.terms.append(Term(members("effect")[GREASE_NAME], GREASE_NAME, q, c))
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
        begun = state_of(self.decision.table)
        here = {t.key: t for t in begun.terms}
        begun.terms = [here.get(t.key, t.copy()) for t in state.terms]
        return best_law(self.train, begun, self.decision.table.scale, straight=True)

    def _without(self, state: State) -> LastFit:
        """The same without names, and with what every drive has held to its size."""
        absent = frozenset(p.name for p in self.decision.parts)
        bare = state.without_names(grease=0.0, bare=True, absent=absent)
        return best_law(self.train, bare, self.decision.table.scale, straight=True)

    def _verdict(
        self, last: LastFit, full: Unseen, plain: Unseen, without: LastFit
    ) -> tuple[str, bool]:
        d, v = self.decision, self.view
        named = [i for i, t in enumerate(last.state.terms) if not t.declared]
        if not named and not d.parts:
            return self._nothing(last, full), False
        if d.heavy and {t.name for t in d.joined} & {t.name for t in last.state.named}:
            d.alternatives |= d.heavy
        held = "ambiguous" if d.alternatives else "found"  # a bend, or a load in the base, too
        verdict = "unexplained" if d.verdict == "unexplained" else held
        shares = [*(last.share(i) for i in named), *(p.share for p in d.parts)]
        stays = full.stays / v.size
        explained = float(np.sqrt(np.sum(np.square(shares))))
        # of a map the runs are too few for a standard error
        sure = v.is_map or gain(plain, full, v.motion.duration) > errors_of(d.alpha)
        if not (sure and full.error < plain.error and explained > stays):
            return self._no_names(last, named, plain, without), False
        if full.error >= const.MOSTLY * v.force:
            return "unexplained", True
        if verdict == "unexplained" and min(shares) > const.CLEAR * stays and d.rest < const.MOSTLY:
            d.depends_on, verdict = [], held
        return verdict, True

    def _nothing(self, last: LastFit, full: Unseen) -> str:
        d = self.decision
        if d.rest > const.MOSTLY:
            self.notes.append("Most of the torque has nothing to do with the motion.")
            return "unexplained"
        if d.verdict == "unexplained":
            return "unexplained"
        if self.view.is_map or not self._left(last, self.view, full):
            return "adequate"
        d.depends_on = sorted(d.unknown[0].depends_on) if d.unknown else []
        return "unexplained"

    def _left(self, fit: LastFit, of: View, full: Unseen) -> bool:
        """Whether torque stays that matters, which is said."""
        rare = lasting(fit.left, of.rows) if of.sure else 0.0  # else J a is in it
        left = max(full.stays, rare) / self.view.size
        if left > 2 * self.decision.least:
            self.notes.append(STAYS.format(100 * left))
        return left > 2 * self.decision.least

    def _no_names(
        self, last: LastFit, named: Collection[int], plain: Unseen, without: LastFit
    ) -> str:
        """What could be named is no more than a candidate; without it little may stay."""
        d, state = self.decision, last.state
        self.candidates += [(-last.share(i), state.terms[i].name) for i in named]
        self.candidates += [(-p.share, p.name) for p in d.parts]
        small = d.verdict != "unexplained" and not d.parts and d.rest < 2 * d.least
        self.absent, d.parts = frozenset(p.name for p in d.parts), []
        d.alternatives = {}
        self.notes.append(NO_GAIN)
        if small and not self._left(without, self.train, plain):
            return "adequate"
        if d.unknown and not d.depends_on:
            d.depends_on = sorted(d.unknown[0].depends_on)
        return "unexplained"

    def _plain(self, last: LastFit) -> LastFit:
        state = last.state.without_names(absent=self.absent, constant=True)
        return best_law(self.view, state, last.scale, straight=True)

    # ---- all rows
    def _of_all(self, few: LastFit) -> LastFit:
        if self.all is self.view:
            return few
        self.all.terms = [t.copy() for t in self.view.terms]
        self.all.settle_as(self.train)
        return LastFit(self.all, few.state.copy(), few.scale)

    def _others(self, last: LastFit) -> list[dict[str, float]]:
        """How far the values by every other description are from those of a fit."""
        if self.apart is None or self.apart[0] is not last:
            orders = [t.q[k] for t in last.state.terms for k in t.q if t.block.own[k].whole]
            widest = np.inf  # a window that hides a wave tells nothing of it
            if orders and not self.view.is_map:
                slow = float(np.quantile(self.view.rows.w, 0.2)) + 1e-9
                widest = 5 / (max(orders) * slow) / self.view.rows.h
            self.apart = last, other_views(last, widest)
            last.state.apply(last.view)
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
        late = lag > max(const.LATE_W, 5 * error) and abs(sensors.gain - 1) < 0.1
        if not late or LAG_NAME in {t.name for t in self.view.terms}:
            return
        made.notes.append(LATE_SPEED.format(1e3 * lag))
        v, J = self.view, abs(made.values["J"][0])
        jerk = v.rows.narrow @ v.motion.slope(v.motion.acceleration)
        cost = J * lag * rms(jerk) / v.size  # what it would do to a torque
        odd = self.decision.odd and self.decision.odd[0].share > const.ODD_TORQUE
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
    alike = bool(own.all()) and np.ptp(own) < const.ALIKE_FACTORS * own.mean()
    return float(own.mean()) if alike else None


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
