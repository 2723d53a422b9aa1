"""The values of a last fit as those of a model, with their joint distribution."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import least_squares
from scipy.sparse import csr_matrix

from ..blocks.block import Block, is_ours, members
from ..blocks.model import Model
from ..core.numeric import rms
from ..estimates.findings import Balance, Estimate, Joint
from . import constants as const
from .columns import torque
from .last_fit import WITHOUT_SCALE, LastFit, tells
from .verdict import Answer

LEVELS = frozenset(("Fc", "Fv"))
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
        return replace(self, estimates=made, joint=_only(self.joint, kept))

    def told(self, declared: Model) -> ModelValues:
        """The same without values that neither the log nor a declaration gives."""
        known = declared.known()
        gone = [k for k, e in self.estimates.items() if e.ci95 is None and k not in known]
        model = self.model.with_values(dict.fromkeys(gone))
        estimates = {k: e for k, e in self.estimates.items() if k not in gone}
        return replace(self, model=model, estimates=estimates)


def completed(last: LastFit, model: Model, sure: bool, parts: Collection[str] = ()) -> Model:
    """The declared model and the effects of a last fit, at its values; a declared J stays unless
    the log is ``sure`` of another one. ``parts`` are effects that the declared law of friction does
    not have."""
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
    return model.with_values({"Fs": max(known["Fs"], const.DIPPED * known["Fc"])})


def _plant(last: LastFit, known: Mapping[str, float], sure: bool) -> dict[str, float]:
    """Inertia and friction as the fit has them, with what is declared of the bristles."""
    v, own, s = last.view, last.values, last.state
    J = own["J"] if sure else known.get("J", own["J"])
    level = max(own["Fc"], const.LEAST_LEVEL * v.force)
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
    plant, law = _plant(last, known, sure), model.friction.block
    if {"Fs", "vs"} <= law.own.keys() - known.keys() and means_the_same(law):
        Fs, vs = static_values(last, plant["Fc"], plant["Fv"])
        if Fs > const.SEEN_STATIC * plant["Fc"]:  # else the rows do not show it
            plant["Fs"], plant["vs"] = Fs, vs
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


def _only(joint: Joint, at: Sequence[int]) -> Joint:
    """The distribution of some of the values."""
    names = tuple(joint.names[i] for i in at)
    return Joint(names, joint.values[at], joint.matrix[np.ix_(at, at)], joint.positive[at])


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
    zero = dict.fromkeys(LEVELS & own.keys(), 0.0)
    none = dict.fromkeys(LEVELS, 0.0)
    return all(_alike(law, own | zero | {k: 1.0}, usual, none | {k: 1.0}) for k in zero)


def _alike(
    law: Block, values: Mapping[str, float], usual: Block, theirs: Mapping[str, float]
) -> bool:
    try:
        made = [float(law(w, **values)[0]) for w in const.TRY_SPEEDS]
    except Exception:  # whatever a function of the user raises
        return False
    return bool(
        np.allclose(made, [usual(w, **theirs)[0] for w in const.TRY_SPEEDS], rtol=const.SAME_LAW)
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
    law, known = model.friction.block, model.known()
    keys = [k for k, p in law.own.items() if p.fitted and not (p.choices or k in model.held())]
    return _nearest(last, law, {k: known[k] for k in law.own}, keys) if keys else {}


def static_values(last: LastFit, Fc: float, Fv: float) -> tuple[float, float]:
    """Fs and vs with which the Stribeck curve comes nearest to the friction of a last fit."""
    law = members("friction")["stribeck"]
    known = law.defaults() | {"Fc": Fc, "Fv": Fv, "vs": last.state.vs}
    found = _nearest(last, law, known | {"Fs": const.DIPPED * Fc}, ("Fs", "vs"))
    return max(found["Fs"], Fc), found["vs"]


def _nearest(
    last: LastFit, law: Block, known: Mapping[str, float], keys: Sequence[str]
) -> dict[str, float]:
    """The values of a law; ``keys`` are free, and start at the known ones."""
    v, own, target = last.view, law.own, last.friction + last.left
    rows = np.arange(0, len(target), max(1, len(target) // const.ENOUGH_ROWS))
    K, alone = csr_matrix(v.K[rows]), not law.states and law.inputs == ("w",)
    if alone:  # samples at which no row looks do not matter
        used, places = np.unique(K.indices, return_inverse=True)
        K, w = csr_matrix((K.data, places, K.indptr)), v.motion.w[used]
    else:
        along = v.along()
    start = np.array([known[k] or own[k].value or 1e-3 for k in keys])
    ends = np.array([(own[k].low, own[k].high) for k in keys]).T

    def values(x: np.ndarray) -> dict[str, float]:
        found = np.clip(start * np.exp(x), *ends).tolist()
        return {**known, **dict(zip(keys, found, strict=True))}

    def off(x: np.ndarray) -> np.ndarray:
        if alone:
            made = law(w, **values(x))[0]
        else:
            wide = torque(law, values(x), along).wide
            assert wide is not None  # a law of friction acts along the log
            made = wide[:, 0]
        return np.nan_to_num((K @ made - target[rows]) / last.scale, nan=1e6)

    bounds = (-const.FURTHEST_LOG, const.FURTHEST_LOG)
    made = least_squares(off, np.zeros(len(keys)), bounds=bounds, loss="soft_l1",
                         diff_step=1e-3, max_nfev=const.MOST_EVALUATIONS)  # fmt: skip
    return values(made.x)
