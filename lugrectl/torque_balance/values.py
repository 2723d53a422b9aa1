"""The values of a last fit: the plain answer (what is certain of the drive, each value once), the
values of a model with their joint distribution, and the declared model without a search.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import least_squares

from ..blocks.block import Block, is_ours, members, unit_for
from ..blocks.model import Model
from ..core.errors import Refused
from ..core.numeric import Z95, rms
from ..core.regression import TINY
from ..estimates.findings import Balance, Combination, CurvePoint, Estimate, Joint, Residual
from ..record import Stretch
from . import constants as const
from .columns import torque
from .friction import View
from .last_fit import (
    WITHOUT_SCALE,
    Interval,
    LastFit,
    Value,
    best_law,
    other_views,
    state_of,
    tells,
)
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
    v, level = last.view, abs(values["sum"][0]) + TINY
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
    v, r, made = last.view, last.left, []
    w, torque = v.motion.w[v.rows.at], last.friction + r
    if v.apart is not None:
        parts = [np.flatnonzero(v.apart == i) for i in range(int(v.apart.max()) + 1)]
    else:
        order = np.argsort(np.abs(w))
        ways = [order[side * w[order] > 0] for side in (-1.0, 1.0)]
        parts = [part for own in ways if len(own) >= 2 * const.BINS
                 for part in np.array_split(own, const.BINS)]  # fmt: skip
    means = np.array([np.mean(r[part]) for part in parts])  # beside Fc, Fs, vs and Fv
    shared = float(np.linalg.norm(means)) / np.sqrt(max(len(means) - 4, 1))
    for part in parts:
        x = float(np.mean(torque[part]))
        error = float(np.hypot(np.std(r[part]) / np.sqrt(max(len(part) / 4, 1.0)), shared))
        ends = x - Z95 * error, x + Z95 * error
        made.append(CurvePoint(float(np.mean(w[part])), x, ends, len(part)))
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
    view, _, width = seen(stretches, model)
    if view.backward:
        made = base_row([replace(s, u=-s.u) for s in stretches], model)
        return replace(made, notes=(TURNED, *made.notes))
    if not np.any(view.motion.u) and model.J is None and not view.is_map:
        return _per_inertia(stretches, model)
    refuse_dead(view, width)
    if view.motion.one_way and "Fc" in view.declared:  # as a J that the log does not tell
        view.model = model.fix("Fc")
    last = settled(view)
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


def settled(view: View) -> LastFit:
    """The declared model at its best friction law."""
    table = Table(view)
    return best_law(view, state_of(table).copy(constant=True), table.scale, straight=True)


def alone(
    stretches: Sequence[Stretch], model: Model, held_out: Sequence[tuple[int, float, float]] = ()
) -> Answer:
    """The values of the declared structure by all rows, its errors on held-out ones; Refused where
    nothing can be learnt. Friction's shape is settled on training rows."""
    view, _, width = seen(stretches, model)
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


SLIDING, BRISTLE = {"Fc", "Fs", "Fv", "vs"}, {"sigma0", "sigma1"}


@dataclass(frozen=True, eq=False)
class ModelValues:
    """A model with all of its values, what the last fit knows of them, and how surely."""

    model: Model
    estimates: dict[str, Estimate]
    joint: Joint

    def beside(self, plain: Balance) -> ModelValues:
        """The same without intervals of what the plain answer does not give alone."""
        made = dict(self.estimates)
        wide = {k: "" for k in plain.uncertain if k in made and (ends := made[k].ci95)
                and not tells((made[k].value, *ends))}  # fmt: skip
        for one in reversed(plain.combinations):  # of several the first counts
            wide |= dict.fromkeys(one.parts, one.text)
        for key, text in wide.items():
            if key in made and not made[key].held:
                made[key] = replace(made[key], ci95=None, together=text)
        kept = [i for i, k in enumerate(self.joint.names) if made[k].ci95 is not None]
        names, j = tuple(self.joint.names[i] for i in kept), self.joint
        joint = Joint(names, j.values[kept], j.matrix[np.ix_(kept, kept)], j.positive[kept])
        return replace(self, estimates=made, joint=joint)

    def told(self, declared: Model) -> ModelValues:
        """The same without values that neither the log nor a declaration gives."""
        known = declared.known()
        gone = [k for k, e in self.estimates.items() if e.ci95 is None and k not in known]
        model = self.model.with_values(dict.fromkeys(gone))
        estimates = {k: e for k, e in self.estimates.items() if k not in gone}
        return replace(self, model=model, estimates=estimates)


def completed(last: LastFit, model: Model, sure: bool, parts: Collection[str] = ()) -> Model:
    """The declared model, the effects of a last fit and ``parts`` of friction that the law has not,
    at its values; a declared J stays unless the log is ``sure`` of another one."""
    made = model
    for term in last.state.named:
        values = {k: last.values.get(f"{term.key}.{k}") for k in term.block.own}
        made = made.with_effect(term.block, {k: x for k, x in values.items() if x is not None})
    for name in parts:  # as far as the fit has its values
        known = _plant(last, made.known(), sure)
        own = members("effect")[name].own
        made = made.with_effect(name, {k: known[k] for k in own if k in known})
    made = _at(made, _values(last, made, sure))
    return made if means_the_same(made.friction.block) else _at(made, law_values(last, made))


def lifted(model: Model, declared: Model) -> Model:
    """The model with an Fs above Fc, from which a fit can find both ways; a declared one stays."""
    known = model.known()
    if declared.known().get("Fs") is not None or not {"Fc", "Fs"} <= known.keys():
        return model
    return model.with_values({"Fs": max(known["Fs"], const.BEYOND * known["Fc"])})


def _plant(last: LastFit, known: Mapping[str, float], sure: bool) -> dict[str, float]:
    """Inertia and friction as the fit has them, with what is declared of the bristles."""
    v, own, s = last.view, last.values, last.state
    J = own["J"] if sure else known.get("J", own["J"])
    level = max(own["Fc"], const.SLIGHT * v.force)
    static = known["Fs"] / known["Fc"] if known.get("Fs") and known.get("Fc") else None
    Fs = max(own["Fs"], level) if static is None else max(static, 1.0) * level
    made = {
        "J": J, "Fc": level, "Fv": max(own["Fv"], 0.0), "Fs": Fs, "vs": known.get("vs", s.vs),
        "delta": known.get("delta", s.exponent), "sigma0": known.get("sigma0") or level / v.x0,
    }  # fmt: skip
    critical = float(np.sqrt(made["sigma0"] * abs(J)))
    return made | {"sigma1": known.get("sigma1", const.DAMPING * critical)}


def _values(last: LastFit, model: Model, sure: bool) -> dict[str, float]:
    """A value for each parameter of the model."""
    known = model.known()
    plant = _plant(last, known, sure)
    own = {k: x for k, x in last.values.items() if "." in k} | plant
    usual = {k: float(p.value or 0.0) for k, p in model.declarations().items()}
    return {k: float(own.get(k, known.get(k, x))) for k, x in usual.items()}


def _at(model: Model, values: Mapping[str, float]) -> Model:
    """The model at these values, inside their bounds; held ones stay."""
    own = model.declarations()
    inside = {k: float(np.clip(x, own[k].low, own[k].high)) for k, x in values.items()}
    return model.with_values(model.kept(inside))


def model_values(answer: Answer, model: Model) -> ModelValues:
    """The model of the last fit of an answer with intervals and covariance."""
    made = completed(answer.last, model, answer.sure, answer.parts)
    told, values, names = _told(answer, made), answer.values, answer.interval.names
    held, own = made.held(), made.declarations()
    estimates: dict[str, Estimate] = {}
    for key, value in made.known().items():
        if not own[key].fitted:
            continue
        ends = values[told[key]][1:] if key in told else None
        whole_turn = ends is not None and own[key].angle and ends[1] - ends[0] >= 2 * np.pi
        ends = (
            None if ends is None or whole_turn or key in held else _within(made, key, value, ends)
        )
        if own[key].whole and made.motion == "rotary" and key in told:
            ends = value, value
        estimates[key] = Estimate(value, made.unit(key), ends, held=key in held)
    certain = [k for k, e in estimates.items() if e.ci95 is not None and e.ci95[1] > e.ci95[0]]
    at = [names.index(told[k]) for k in certain]
    found = np.array([estimates[k].value for k in certain])
    positive = np.array([own[k].low >= 0.0 for k in certain], bool) & (found > 0.0)
    joint = Joint(tuple(certain), found, answer.covariance[np.ix_(at, at)], positive)
    return ModelValues(made, estimates, joint)


def _told(answer: Answer, model: Model) -> dict[str, str]:
    """The keys of the model that the last fit tells, and its own names for them."""
    plant = {"J"} if answer.sure else set()
    plant |= {"Fc", "Fv"} if means_the_same(model.friction.block) else set()
    if answer.view.motion.one_way:
        plant -= {"Fc"}
    made = {k: k for k in model.declarations() if k in plant}
    made |= {k: k for k in model.declarations() if "." in k and k in answer.values}
    return made


def with_scale(joint: Joint) -> Joint:
    """The same with the errors of sensors: none is better than SCALE of a value."""
    own = [const.SCALE * x * (k.rpartition(".")[2].split("_")[0] not in WITHOUT_SCALE)
           for k, x in zip(joint.names, joint.values, strict=True)]  # fmt: skip
    return replace(joint, matrix=joint.matrix + np.diag(np.square(own)))


def as_estimates(joint: Joint, model: Model) -> dict[str, Estimate]:
    """Values of a joint distribution with their intervals."""
    both = zip(joint.names, joint.values.tolist(), joint.interval().tolist(), strict=True)
    return {k: Estimate(x, model.unit(k), _within(model, k, x, ends)) for k, x, ends in both}


def _within(model: Model, key: str, value: float, ends: Sequence[float]) -> tuple[float, float]:
    """The interval of a value inside its bounds."""
    low, high = model.bounds(key)
    return min(max(ends[0], low), value), max(min(ends[1], high), value)


def means_the_same(law: Block) -> bool:
    """Whether Fc and Fv of the law are those of the balance: alone, they are "coulomb"."""
    if is_ours(law.home):
        return True
    if law.states or law.inputs != ("w",):
        return False
    own, usual = law.defaults(), members("friction")["coulomb"]
    zero = dict.fromkeys({"Fc", "Fv"} & own.keys(), 0.0)
    none = dict.fromkeys(("Fc", "Fv"), 0.0)
    return all(_alike(law, own | zero | {k: 1.0}, usual, none | {k: 1.0}) for k in zero)


def _alike(
    law: Block, values: Mapping[str, float], usual: Block, theirs: Mapping[str, float]
) -> bool:
    try:
        made = [float(law(w, **values)[0]) for w in const.TRY_SPEEDS]
    except Exception:  # whatever a function of the user raises
        return False
    return bool(
        np.allclose(made, [usual(w, **theirs)[0] for w in const.TRY_SPEEDS], rtol=const.SAME)
    )


def told_by_balance(model: Model) -> bool:
    """Whether a balance says what the law's values are, or where they cannot be far from."""
    law = model.friction.block
    own = {k for k, p in law.own.items() if p.fitted and not p.usual}
    known = own <= SLIDING or BRISTLE <= own <= SLIDING | BRISTLE
    return known and means_the_same(law)


def misfit(last: LastFit, model: Model) -> float:
    """How far a model's law is from the friction of a last fit: RMS in rows, over friction."""
    made = torque(model.friction.block, model.friction.values, last.view.along()).wide
    if made is None:
        return 0.0
    off = last.view.K @ made[:, 0] - last.friction
    return rms(np.nan_to_num(off, nan=1e6)) / last.view.size


def law_values(last: LastFit, model: Model) -> dict[str, float]:
    """The values of an own law with which it comes nearest to a last fit; held ones stay."""
    law, v, own = model.friction.block, last.view, model.friction.block.own
    known, target = {k: model.known()[k] for k in own}, last.friction + last.left
    keys = [k for k, p in own.items() if p.fitted and not (p.choices or k in model.held())]
    if not keys:
        return {}
    along = v.along()
    start = np.array([known[k] or own[k].value or 1e-3 for k in keys])
    ends = np.array([(own[k].low, own[k].high) for k in keys]).T

    def values(x: np.ndarray) -> dict[str, float]:
        found = np.clip(start * np.exp(x), *ends).tolist()
        return {**known, **dict(zip(keys, found, strict=True))}

    def off(x: np.ndarray) -> np.ndarray:
        wide = torque(law, values(x), along).wide
        assert wide is not None  # a law of friction acts along the log
        return np.nan_to_num((v.K @ wide[:, 0] - target) / last.scale, nan=1e6)

    bounds = (-const.FURTHEST_LOG, const.FURTHEST_LOG)
    made = least_squares(off, np.zeros(len(keys)), bounds=bounds, loss="soft_l1",
                         diff_step=const.SLIGHT, max_nfev=const.MOST_EVALUATIONS)  # fmt: skip
    return values(made.x)
