"""The log as the table sees it: motion, windows, declared effects with all of their values; of a
long log parts that are enough.

What the channels have that is none of the drive is a row of the table beside the base; a proven one
is undone before anything is asked: u that was logged late (where its slope reaches the bound of the
base, the column is tried earlier), a w without theta that is not 0 at rest, where friction jumps.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from itertools import pairwise

import numpy as np

from ..blocks.block import members, unit_for
from ..blocks.friction import free_level
from ..blocks.model import Model, Stated
from ..core.errors import Refused
from ..core.option_names import option
from ..core.regression import Prior, log_density, paired, robust
from ..record import Stretch
from . import constants as const
from .columns import Along, columns, linear, searched
from .friction import Term, View, declared_terms
from .maps import Still, is_map, map_of
from .motion import Motion, sampled
from .search import Search, golden
from .table import Contender, Table, Unknown, proven
from .windows import Declared, Rows, Width, fine_wave


def logged_late(view: View, table: Table) -> float:
    """How late (s) u was logged; 0 where no such row of the table is the likeliest."""
    if not view.sure or table.fit.free[1] or table.fit.b[1] > 0:
        return 0.0
    m, grid = view.motion, np.arange(0.0, const.VERY_LATE, const.LATE_STEP)

    def row(T: float) -> Contender:
        made = Contender("late", {}, u=m.later(-T), cost=float(np.log(len(grid))))
        made.lateness = True
        return table.enter(made)

    def gain(T: float) -> float:
        made = row(T)  # of a u that is moved away from all motion nothing is left, nor of J
        return made.gain if made.J > const.MOSTLY * table.J else -np.inf

    best = float(grid[int(np.argmax([gain(T) for T in grid]))])
    best = golden(gain, max(best - const.LATE_STEP, 0.0), best + const.LATE_STEP)
    late = row(best)
    if best <= 0 or not proven(*paired(late.e, table.e)):
        return 0.0
    # a torque that is lost, or depends on the place, makes the rest late
    strange = Unknown(table, view.model.motion == "linear", True).rows()
    others = [c.gain for c in Search(table, True, (), {}).rows()]
    others += [table.enter(c).gain for c in strange if c.depends_on == {"theta"}]
    return best if late.gain > max(others, default=0.0) else 0.0


def speed_offset(view: View, table: Table) -> tuple[float, float]:
    """How much (rad/s) a w without theta is above the speed, with its standard error; 0 where no
    such row is proven."""
    m, v = view.motion, view
    if any(r.sensors.theta is not None for r in m.runs):
        return 0.0, 0.0
    X = np.column_stack([v.rows.a, v.late, v.K @ np.column_stack([m.w, np.ones(len(m))])])
    blurred = max(const.AT_REST * m.top, m.sensors.w_variance**0.5)

    @lru_cache
    def promise(offset: float) -> float:
        w = m.w - offset
        way = np.tanh(w / blurred)
        law = np.column_stack([way, way * free_level(w, 0.0, 1.0, const.CURVE * m.top, 1.0)])
        both = np.column_stack([X, v.K @ law])
        r = robust(both, v.y, Prior.free(both.shape[1]), table.scale).r
        return float(np.sum(log_density(r)))

    grid = np.r_[-const.OFFSETS[::-1], 0.0, const.OFFSETS] * m.top
    i = int(np.argmax([promise(x) for x in grid]))
    best = golden(promise, grid[max(i - 1, 0)], grid[min(i + 1, len(grid) - 1)])
    if promise(best) - promise(0.0) < const.SCREEN:
        return 0.0, 0.0

    @lru_cache
    def scores(offset: float) -> np.ndarray:
        return Table(view.lowered(offset), table.scale).e

    def total(offset: float) -> float:
        return float(scores(offset).sum())

    best = golden(total, 0.5 * best, 1.5 * best, 11)
    e = scores(best) - np.log(len(grid)) / len(table.e)
    if not proven(*paired(e, table.e)):
        return 0.0, 0.0
    step = const.NEAR * abs(best)
    up, down = scores(best + step), scores(best - step)
    bend = float(np.sum(2 * scores(best) - up - down)) / step**2
    error = (
        const.WHOLE * np.linalg.norm(up - down) / (2 * step * bend)
    )  # by what the blocks say alone
    error = float(error) if bend > 0 else abs(best)
    return best, float(np.hypot(error, blurred / np.sqrt(12.0)))  # slower is rest


def as_acted(stretches: Sequence[Stretch], late: float, above: float) -> list[Stretch]:
    """The stretches with each torque ``late`` (s) before it was logged, speeds less ``above``."""
    made = []
    for s in stretches:
        u, ok = np.interp(s.t + late, s.t, s.u), s.ok & (s.t + late <= s.t[-1])
        made.append(replace(s, u=u, ok=ok, w=None if s.w is None else s.w - above))
    return made


COASTS = (
    "u is constant in every row: the torque channel is dead, or the drive coasts.",
    "Record the torque; of a drive that coasts, declare J.",
)
ONE_TORQUE = "u has one value in each direction ({}): with that, any inertia explains the motion."
TWO = "Record two or more torques in one direction, or declare J."
OPPOSED = "the torque opposes the motion that it should sustain, at every speed."
TURN = "Check the sign of u; {} reverses it."
AGAINST = "the log contradicts the declared inertia, of which u has nothing"
NEGATIVE = "the inertia comes out negative and there is no friction"
UNTRUE = "{}: u follows the motion, or has the wrong sign: give {}."
COMMANDED = "Log the commanded torque, positive where it speeds up positive motion."
Range = tuple[float, float] | None


def seen(stretches: Sequence[Stretch], model: Model) -> tuple[View, View, Width | Still]:
    """The log with motion, windows and declared effects with a value of everything; rows of it that
    are enough for a search (itself where it is short); what it tells of the inertia. Or a map."""
    if is_map(stretches):
        view = map_of(stretches, model)
        return view, view, Still()
    motion = Motion.of(sampled(stretches))
    here, width = Along.of(motion), wide_enough(motion, model)
    view = View(motion, Rows(motion, width.h), model, width.range, declared_terms(model, here))
    view.sure = width.sure
    few = enough(view, width, stretches)
    find_open(few, width.sure)
    view.terms = few.terms
    if np.ptp(motion.u) == 0:
        return view, few, width
    table = Table(few)
    late, (above, error) = logged_late(few, table), speed_offset(few, table)
    if not (late or above):
        return view, few, width
    made = seen(as_acted(stretches, late, above), model)
    for one in {id(v): v for v in made[:2]}.values():
        one.logged_late += late
        one.w_above = one.w_above[0] + above, max(one.w_above[1], error)
    return made


def wide_enough(motion: Motion, model: Model) -> Width:
    """The windows of a log, and what it tells of the inertia."""
    known, here = model.known(), Along.of(motion)
    turns = motion.span > 2 and model.motion != "linear"
    weight = columns(members("effect")["gravity"], {}, here).wide
    level = motion.theta - motion.theta.mean()
    place = weight if turns and weight is not None else level[:, None]
    width = Width(motion, Declared(known.get("J"), known.get("Fc"), place, turns))
    J = known.get("J")
    if motion.steady:  # one speed: nothing is learnt of the inertia, nor of lateness
        width.sure, width.impossible = False, False
        width.range = (J / 1.1, 1.1 * J) if J else width.range
    if J and np.ptp(motion.u) == 0:  # all torques are known up to one factor: J is declared
        width.sure, width.impossible, width.range = False, False, (J, J)
    wave = fine_wave(motion, width.h) if model.motion != "linear" else 0.0
    if wave:  # at windows this narrow noise would take the inertia
        narrow = 4 / (wave * float(np.median(np.abs(motion.w))))
        width.h = min(width.h, max(narrow, 3 * motion.dt, 0.004))
        width.range = (J / const.GROWN, const.GROWN * J) if J and width.sure else width.range
    width.range = inertia_range(width.range, model)
    return width


def refuse_dead(view: View, width: Width | Still) -> None:
    """Refused where the torque has nothing to do with the motion."""
    coasts = np.ptp(view.motion.u) == 0 and not view.is_map
    # friction must explain a motion without changes of torque
    if coasts and (
        not view.declared.get("J") or Table(view).left * view.size > const.MOSTLY * view.force
    ):
        raise Refused(*COASTS)
    if view.several and not (view.is_map or view.declared.get("J")) and one_torque(view):
        m, at, unit = view.motion, view.rows.at, unit_for("N m", view.model.motion)
        ways = [m.u[at[side * m.w[at] > 0]] for side in (1, -1)]
        values = [f"{np.median(u):.3g} {unit}" for u in ways if len(u)]
        raise Refused(ONE_TORQUE.format(", ".join(values)), TWO)
    if view.backward:
        raise Refused(OPPOSED, TURN.format(option("scale", "u=-1")))
    untrue = AGAINST if width.against and not coasts else ""
    untrue = NEGATIVE if width.impossible and not view.declared.get("J") else untrue
    if untrue:
        raise Refused(UNTRUE.format(untrue, option("scale", "u=-1")), COMMANDED)


def one_torque(view: View) -> bool:
    """Whether the direction alone tells the torque: J = Fv = 0 would be any drive's best fit."""
    w, y = view.motion.w, view.torque(view.motion.u)
    X = view.K @ np.column_stack([w > 0, w < 0])
    r = y - X @ np.linalg.lstsq(X, y, rcond=None)[0]
    return bool(np.mean(r**2) < const.FLOOR**2 * np.mean(y**2))


def inertia_range(found: Range, model: Model) -> Range:
    """Where J lies: where it was found, moved into what is stated."""
    one, J = model.stated.get("J", Stated()), model.J
    if one.fixed and J is not None:
        return J, J
    if not one.bounded:
        return found
    end = np.inf if one.high is None else one.high
    low, high = np.clip((0.0, np.inf) if found is None else found, one.low or 0.0, end).tolist()
    return low, high


def find_open(view: View, sure: bool) -> None:
    """Give each declared effect of a view a value of everything: where the best contender of its
    name lies beside the rest of the model, or the usual one. ``sure``: the log determines J."""
    opened = [t for t in view.terms if _missing(t)]
    view.terms = [t for t in view.terms if not _missing(t)]
    for term in opened:
        rows = Search(Table(view), sure, (), {}, only={term.name}).rows()
        found = rows[0].q if rows else {}
        own, middle = term.block.own, np.median(view.motion.t)  # at an end an event is none
        usual = {k: float(middle if own[k].instant else own[k].value or 0.0)
                 for k in _missing(term)}  # fmt: skip
        term.q = usual | {k: x for k, x in found.items() if k in usual} | term.q
        if rows and rows[0].C is not None and not term.b.any():
            term.b = rows[0].b[: len(linear(term.block))].copy()
        view.terms = [*view.terms, term]


def _missing(term: Term) -> list[str]:
    return [k for k in searched(term.block) if k not in term.q]


def enough(view: View, width: Width, stretches: Sequence[Stretch]) -> View:
    """The view of PARTS of a long log: evenly spread ones, and the STRANGE of which a plain balance
    leaves most, wherever something happens once. Itself where the log is short."""
    m = view.motion
    seconds = max(const.ENOUGH * m.dt, const.SHORT)
    if m.duration < 2 * seconds:
        return view
    length = seconds / const.PARTS
    chosen = np.zeros(int(m.duration / length) + 1, bool)
    i = np.arange(const.PARTS - const.STRANGE)  # one in each of equal periods, at all distances
    chosen[((i + const.GOLDEN * i % 1.0) * len(chosen) / len(i)).astype(int)] = True
    left = np.bincount((width.t / length).astype(int), width.r**2, len(chosen))
    chosen[np.argsort(np.where(chosen, -1.0, left))[-const.STRANGE :]] = True
    runs, first = np.unique(m.run, return_index=True)
    shifts = dict(zip(runs.tolist(), (m.t - m.stamp)[first].tolist(), strict=True))
    parts = []
    for s in stretches:
        if s.run in shifts:
            place = (s.t + (shifts[s.run] - m.t.min())) / length
            here = chosen[np.clip(place.astype(int), 0, len(chosen) - 1)]
            ends = np.r_[0, np.flatnonzero(np.diff(here)) + 1, len(here)].tolist()
            parts += [_part(s, slice(a, b)) for a, b in pairwise(ends) if here[a]]
    few = Motion.of(sampled(parts, shifts))
    return view.by(few, Rows(few, view.rows.h))


def _part(s: Stretch, at: slice) -> Stretch:
    own = {k: getattr(s, k) for k in ("t", "u", "theta", "w", "ok", "d")}
    return replace(s, **{k: x[at] for k, x in own.items() if x is not None})
