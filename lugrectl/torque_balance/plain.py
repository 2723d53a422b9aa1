"""The plain answer: what is certain of the drive, each value once, from the last fit; and the
declared model without a search.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from ..blocks.block import unit_for
from ..blocks.model import Model
from ..core.errors import Refused
from ..core.numeric import Z95, rms
from ..estimates.findings import Balance, Combination, CurvePoint, Estimate, Residual
from ..record import Stretch
from . import constants as const
from .friction import View
from .last_fit import Interval, LastFit, Value, best_law, other_views, state_of, tells
from .seen import COASTS, refuse_dead, seen
from .table import Table
from .verdict import Answer, Split, Unseen

UNITS = {"J": "kg m2", "Fc": "N m", "Fv": "N m s/rad", "Fs": "N m", "constant_torque": "N m",
         "u_delay": "s", "w_lag": "s", "w_offset": "rad/s", "w_gain": "1"}  # fmt: skip
OTHER_WAY = "record the other direction"
OTHER_SPEEDS = "record other speeds"
TAKEN = "{} is taken as declared, {:.6g} {}: this log does not determine it alone."
NO_J = "J is not determined by this log: that needs faster changes of speed."
ONE_WAY = "The drive moves in one direction: Fc and a constant torque are one number."
LATE = "u comes {:.2g} ms late: it acted that long before its rows."
SCALED = "w is {:.4g} times d theta/dt."
FOREIGN = "w does not follow d theta/dt: it is left out."
ABOVE = "w is {:.3g} {} too {}: the drive stands there."
BACKWARD = (
    "Friction would drive the motion ({:.3g} {} at {:.3g} {}): u has the wrong sign, or a load "
    "drives."
)
TURNED = "u has the wrong sign: it opposes the motion. These values are those of -u."
MISSING = (
    "Torque of {:.2g} % of friction stays that the declared model does not explain: values may be "
    "wrong by more than their intervals. A diagnosis says what is missing."
)


def plain_balance(
    last: LastFit,
    interval: Interval,
    values: Mapping[str, Value],
    V: np.ndarray,
    sure: bool,
    stretches: Sequence[Stretch],
) -> Balance:
    """The plain answer of a last fit with its intervals; ``sure``: the log determines J."""
    v, m, at = last.view, last.view.motion, last.view.rows.at
    order = np.lexsort((m.stamp[at], m.run[at]))
    known, names, C = _by_plain_names(last, interval, values, V)
    certain = _certain(last, known, values, sure)
    units = _units(last)
    made = {k: Estimate(float(x[0]), units[k], (float(x[1]), float(x[2])))
            for k, x in known.items()}  # fmt: skip
    own = {"J", "Fc", "Fv"}
    parameters = {k: made[k] for k in known if k in certain or k not in own}
    return Balance(
        parameters=parameters,
        uncertain={k: made[k] for k in known if k not in parameters},
        combinations=tuple(_sums(last, values, certain)),
        curve=tuple(friction_curve(last)),
        left=rms(last.left) / v.force,
        notes=tuple(_notes(last, values, certain, sure)),
        names=names,
        covariance=C,
        half_width=v.rows.h or None,
        is_map=v.is_map,
        residual=Residual(m.stamp[at][order], m.run[at][order], last.left[order]),
        stretches=tuple(stretches),
        motion=v.model.motion,
    )


def _by_plain_names(
    last: LastFit, interval: Interval, values: Mapping[str, Value], V: np.ndarray
) -> tuple[dict[str, Value], tuple[str, ...], np.ndarray]:
    """Values with their covariance under the names of the plain answer."""
    v = last.view
    has = {t.name: t.key for t in last.state.terms}
    scale = {"u_delay": v.longest_hold}
    names = {"Fc": "Fc", "Fv": "Fv"} | ({} if v.is_map else {"J": "J"})
    if "constant_torque" in has:
        names["constant_torque"] = f"{has['constant_torque']}.torque"
    elif last.design.constant or not v.motion.one_way and not last.state.constant:
        names["constant_torque"] = "offset"
    lateness = [t for t in last.state.terms if t.name == "input_delay"]
    if not (v.is_map or any(f"{t.key}.delay" in v.model.held() for t in lateness)):
        names["u_delay"] = f"{lateness[0].key}.delay" if lateness else "late"
        scale = {} if lateness else scale
    for term in last.state.terms:
        own = {f"{term.key}.{k}" for k in term.block.own}
        names |= {k: k for k in interval.names if k in own}
    at = [interval.names.index(k) for k in names.values()]
    size = np.array([scale.get(name, 1.0) for name in names])
    found = {}
    for (name, k), s in zip(names.items(), size, strict=True):
        found[name] = (s * values[k][0], s * values[k][1], s * values[k][2])
    return found | of_sensors(last), tuple(names), V[np.ix_(at, at)] * np.outer(size, size)


def of_sensors(last: LastFit) -> dict[str, Value]:
    """How late w is against theta, and how much it is above the speed, where the log tells."""
    if last.view.is_map:
        return {}
    s, (above, error) = last.view.motion.sensors, last.view.w_above
    made = {}
    if np.isfinite(s.lag_error):
        made["w_lag"] = (s.lag, s.lag_error)
    if above or s.offset:
        own = s.offset / s.gain, s.offset_error / s.gain
        made["w_offset"] = own if s.offset else (above, error)
    if s.scaled and abs(s.lag) <= const.FAR_W:  # a later one is only shifted
        made["w_gain"] = 1 / s.gain, np.hypot(s.gain_error, const.SCALE) / s.gain**2
    return {k: (x, x - Z95 * e, x + Z95 * e) for k, (x, e) in made.items()}


def _units(last: LastFit) -> dict[str, str]:
    """The unit of each value by the names of the plain answer."""
    motion = last.view.model.motion
    made = {name: unit_for(unit, motion) for name, unit in UNITS.items()}
    return made | {
        f"{term.key}.{k}": p.unit if p.angle else unit_for(p.unit, motion)
        for term in last.state.terms
        for k, p in term.block.own.items()
    }


def _certain(
    last: LastFit, known: Mapping[str, Value], values: Mapping[str, Value], sure: bool
) -> set[str]:
    """Which of J, Fc and Fv are an answer alone."""
    v, level = last.view, abs(values["sum"][0]) + 1e-300
    wide = {k: known[k][2] - known[k][1] for k in ("Fc", "Fv")}
    made = {"J"} if sure and "J" in known and tells(known["J"]) else set[str]()
    if v.several:  # at one speed only the sum is known
        made |= {"Fc"} if wide["Fc"] < level and not v.motion.one_way else set()
        made |= {"Fv"} if wide["Fv"] * v.typical < level else set()
    return made


def _sums(last: LastFit, values: Mapping[str, Value], certain: set[str]) -> list[Combination]:
    """What is certain together: in one direction Fc and a constant, at one speed all friction."""
    v, made = last.view, []
    unit = unit_for("N m", v.model.motion)
    if v.motion.one_way and "Fc" in v.model.held():
        return made
    if v.motion.one_way and "Fv" in certain:
        x = values["Fc + constant"]
        parts = {"Fc": 1.0, "constant_torque": 1.0}
        made.append(Combination("Fc + constant_torque", x[0], unit, (x[1], x[2]), OTHER_WAY, parts))
    elif not {"Fc", "Fv"} <= certain:
        x, w = values["sum"], v.typical
        text = f"Fc + {w:.3g} Fv" + " + constant_torque" * v.motion.one_way
        how = OTHER_WAY if v.motion.one_way else OTHER_SPEEDS
        parts = {"Fc": 1.0, "Fv": w}
        made.append(Combination(text, x[0], unit, (x[1], x[2]), how, parts))
    return made


def friction_curve(last: LastFit) -> list[CurvePoint]:
    """Mean friction torque in bins of speed, or of each run of a map: u without other terms."""
    v, friction, r = last.view, last.friction, last.left
    w, made = v.motion.w[v.rows.at], []
    if v.apart is not None:
        many = np.bincount(v.apart)
        left, speed, torque = (np.bincount(v.apart, x) / many for x in (r, w, friction + r))
        half = Z95 * float(np.sqrt(np.sum(left**2) / max(len(left) - const.PLAIN_VALUES, 1)))
        points = zip(speed.tolist(), torque.tolist(), many.tolist(), strict=True)
        return sorted([CurvePoint(x, y, (y - half, y + half), n) for x, y, n in points],
                      key=lambda p: p.w)  # fmt: skip
    for side in (-1.0, 1.0):
        own = np.flatnonzero(side * w > 0)
        if len(own) < 2 * const.BINS:
            continue
        own = own[np.argsort(np.abs(w[own]))]
        for part in np.array_split(own, const.BINS):
            torque = friction[part] + r[part]
            half = Z95 * float(np.std(r[part])) / np.sqrt(max(len(part) / 4, 1.0))
            x = float(np.mean(torque))
            made.append(CurvePoint(float(np.mean(w[part])), x, (x - half, x + half), len(part)))
    return sorted(made, key=lambda p: p.w)


def _notes(last: LastFit, values: Mapping[str, Value], certain: set[str], sure: bool) -> list[str]:
    v, made = last.view, []
    if v.logged_late:
        made.append(LATE.format(-1e3 * values["late"][0] * v.longest_hold))
    own = of_sensors(last)
    if above := own.get("w_offset", (0.0,))[0]:
        unit = unit_for("rad/s", v.model.motion)
        made.append(ABOVE.format(abs(above), unit, "high" if above > 0 else "low"))
    if "w_gain" in own:
        made.append(SCALED.format(own["w_gain"][0]))
    if any(r.sensors.foreign for r in v.motion.runs):
        made.append(FOREIGN)
    known, taken = v.declared, []
    if not sure or "J" not in certain:
        taken += ["J"] if known.get("J") and not (sure or v.is_map) else []
        made += [] if taken else [NO_J]
    if v.motion.one_way:
        taken += ["Fc"] if "Fc" in v.model.held() else []
        made += [] if "Fc" in taken else [ONE_WAY]
    made += [TAKEN.format(k, known[k], v.model.unit(k)) for k in taken]
    if values["sum"][2] < 0 and not v.motion.one_way:
        torque, speed = (unit_for(u, v.model.motion) for u in ("N m", "rad/s"))
        made.append(BACKWARD.format(values["sum"][0], torque, v.typical, speed))
    return made


def base_row(stretches: Sequence[Stretch], model: Model) -> Balance:
    """The plain answer: what the declared model leaves free, by one regression; Refused where
    nothing moves, or the torque has nothing to do with the motion."""
    view, _, width, table = seen(stretches, model)
    if view.backward:
        made = base_row([replace(s, u=-s.u) for s in stretches], model)
        return replace(made, notes=(TURNED, *made.notes))
    if not np.any(view.motion.u) and model.J is None and not view.is_map:
        return _per_inertia(stretches, model)
    refuse_dead(view, width)
    if view.motion.one_way and "Fc" in view.declared:  # as a J that the log does not tell
        view.model = model.fix("Fc")
    last = settled(view, table)
    interval = Interval(last)
    V = interval.covariance() + interval.between(other_views(last))
    made = plain_balance(last, interval, interval.values(V), V, width.sure, stretches)
    return replace(made, notes=(*made.notes, *_missing(last)))


def _missing(last: LastFit) -> list[str]:
    """A sentence where torque stays for longer than a window: no interval knows of its cause."""
    view = last.view
    stays = Unseen.left(last.left, view.rows).stays / view.size
    return [] if view.is_map or stays < 2 * const.FLOOR else [MISSING.format(100 * stays)]


def _per_inertia(stretches: Sequence[Stretch], model: Model) -> Balance:
    """What a drive that coasts tells without its inertia: friction over it."""
    made = base_row(stretches, replace(model, J=1.0))
    sums, parts = [], made.parameters
    for key, unit in (("Fc", "rad/s2"), ("Fv", "1/s")):
        if key in parts:
            e, unit = parts[key], unit_for(unit, model.motion)
            sums.append(Combination(f"{key} / J", e.value, unit, e.ci95, "declare J", {}))
    if not sums:
        raise Refused(*COASTS)
    return replace(made, parameters={}, uncertain={}, combinations=tuple(sums), curve=(), names=(),
                   covariance=np.zeros((0, 0)), notes=(" ".join(COASTS),))  # fmt: skip


def settled(view: View, table: Table | None = None) -> LastFit:
    """The declared model at its best friction law; ``table`` is one of this view."""
    table = table if table is not None and table.view is view else Table(view)
    assert table.scale is not None  # the table has been settled
    return best_law(view, state_of(table).copy(constant=True), table.scale, straight=True)


def alone(
    stretches: Sequence[Stretch], model: Model, held_out: Sequence[tuple[int, float, float]] = ()
) -> Answer:
    """The values of the declared structure by all rows, its errors on held-out ones; Refused where
    nothing can be learnt. Friction's shape is settled on training rows."""
    view, _, width, _ = seen(stretches, model)
    refuse_dead(view, width)
    split = Split.of(view, held_out)
    train, test = view.on(split.train), view.on(split.test)
    trained = settled(train)
    for other in (view, test):
        other.settle_as(train)
    last = LastFit(view, trained.state.copy(), trained.scale)
    interval = Interval(last)
    V = interval.covariance() + interval.between(other_views(last))
    last.state.apply(view)
    left = Unseen.of(trained, test)
    return Answer(
        "identified", None, view, split, last, interval, interval.values(V), V, left, left,
        trained, trained, notes=_missing(last),
    )  # fmt: skip
