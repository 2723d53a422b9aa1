"""The one model that won, with one set of values.

They are those of the comparison, which knows what noise, background and the shapes of friction do
to them. Its values are not the best for what it hardly sees, presliding and break-away, so where
the log is clean they are where a fit by simulation starts. It is valid where the torque that it
does not predict from sample to sample is below what matters, and where it determines the inertia
whatever smooth torque there may be; then its values and intervals stand.
On any other log it would move the values to where they imitate what no model has.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from statistics import NormalDist

import numpy as np

from ..blocks.block import REGISTRY
from ..blocks.model import Model
from ..estimates.covariance import Joint
from ..estimates.findings import Estimate
from ..identification.dataset.run_effects import alike
from ..identification.dataset.windows import spread
from ..identification.likelihood.initial_values import begun, completed, lifted, likeliest
from ..identification.likelihood.likelihood import tune
from ..identification.likelihood.maximise import Fitted, fit, seen_on, standing
from ..identification.likelihood.parameters import free_keys
from ..identification.likelihood.predictor import Predictor
from ..identification.likelihood.value_discrepancy import with_discrepancy
from ..identification.selection import ALPHA, Comparison, Named, Valued, place_of
from .never_worse import determines
from .old_compare_laws import beaten, predicted
from .other_law import means_the_same
from .study import Job, Prepared, Progress, estimates, joint, on_everything

TRIED, FEW = 8_000, 8  # samples and windows on which a fit is tried first
USUAL = 0.2  # of Fc: how much larger Fs is, to start a fit from
SEEN = {"J", "Fc", "Fs", "Fv", "vs", "sigma0", "sigma1"}  # what the comparison knows of the drive
OPEN = 12  # steps of a fit that is tried, and of one of what the comparison does not see


@dataclass(frozen=True)
class Winner:
    """The model with the named effects at its values.

    ``fit`` is judged on held-out samples; ``whole`` has the values that are shown. ``keys`` are the
    effects in the model, ``simulated`` says whether a fit by simulation gave the values.
    """

    job: Job
    fit: Fitted
    whole: Fitted
    keys: tuple[str, ...]
    estimates: dict[str, Estimate]
    joint: Joint
    simulated: bool


def decided(ready: Prepared, found: Comparison, report: Progress) -> tuple[Winner, Comparison]:
    """The model that won, and the comparison once more where a finer fit tells rivals apart or does
    not hold an effect: the interval of its strength holds the value that changes nothing."""
    won, found = _rivals(ready, found, report)
    named = zip(won.keys, found.effects, strict=True) if won.simulated and won.keys else ()
    gone = [e.name for key, e in named if _may_be_nothing(won, key, e.name)]
    if not gone:
        return won, found
    left = tuple(e for e in found.effects if e.name not in gone)
    named_only = found.verdict in ("found", "ambiguous")
    verdict = ("found" if left else "adequate") if named_only else found.verdict
    found = replace(found, effects=left, alternatives=(), verdict=verdict, valued=None)
    return winner(ready, found, report), found


def _may_be_nothing(won: Winner, key: str, name: str) -> bool:
    block = REGISTRY["effect", name]
    neutral, own = block.own[block.gain].neutral, won.estimates.get(f"{key}.{block.gain}")
    if own is None or neutral is None:
        return False
    return not own.held and (own.ci95 is None or own.may_be(neutral))


def _rivals(ready: Prepared, found: Comparison, report: Progress) -> tuple[Winner, Comparison]:
    """The same for rivals alone."""
    won, first = winner(ready, found, report), found
    for rival in found.alternatives if won.keys and not won.simulated else ():
        other = _led_by(first, rival)
        its = winner(ready, other, report)
        if its.simulated:
            won, found = its, other
            break
    if not (won.simulated and won.keys and found.alternatives):
        return won, found
    again = _between(won, found)
    same = again.effects == found.effects
    return won if same else winner(ready, again, report), again


def _led_by(found: Comparison, rival: Named) -> Comparison:
    """The comparison with a rival in the place of the best."""
    place, effects = place_of(found.effects), [*found.effects]
    others = (effects[place], *(a for a in found.alternatives if a is not rival))
    effects[place] = rival
    return replace(found, effects=tuple(effects), alternatives=others, valued=None)


def _between(won: Winner, found: Comparison) -> Comparison:
    """Rivals of the comparison by their fits: each that predicts the held-out windows as well as
    the best."""
    place = place_of(found.effects)
    before, rivals = found.effects[:place], [found.effects[place], *found.alternatives]
    rest, job = found.effects[place + 1 :], won.job
    fits = [_rival(won, (*before, rival, *rest)) for rival in rivals]
    each = [predicted(f, job.parts.test) for f in fits]
    best = int(np.argmax([one.sum() for one in each]))
    bar = NormalDist().inv_cdf(1.0 - ALPHA)
    kept = [r for i, r in enumerate(rivals) if i != best and not beaten(each[best], each[i], bar)]
    verdict = "ambiguous" if kept else "found"
    effects = (*before, rivals[best], *rest)
    valued = found.valued if best == 0 else None
    return replace(found, verdict=verdict, effects=effects, alternatives=tuple(kept), valued=valued)


def _rival(won: Winner, effects: Sequence[Named]) -> Fitted:
    """The fit of a model with other effects to the training samples."""
    base, data = won.job.base, won.job.data
    model, _, values = with_effects(base.predictor.model, effects)
    predictor = Predictor(model, data)
    start = base.values | {k: v for k, v in won.fit.values.items() if k in base.values} | values
    return fit(predictor, start, free_keys(predictor), base.where, won.fit.noise, anchor=start)


def winner(ready: Prepared, found: Comparison, report: Progress) -> Winner:
    """The declared model and the one with the named effects, each at its values."""
    named = () if found.only_inertia else found.effects
    ready = _aligned(ready, named)
    data, train = ready.data, ready.parts.train
    declared = lifted(completed(ready.model, replace(data, differing=()), train))
    model, keys, values = with_effects(declared, named)
    known, start = _known(found, declared, named, keys), declared.known() | alike(data)
    predictor, start_with = Predictor(model, data), start | values | _usable(found.plant, model)
    final = _at(predictor, start_with | _usable(known.trained, model), ready)
    alone = start | _usable(found.alone, declared)
    base = final if not keys else _at(Predictor(declared, data), alone, ready)
    job = Job(ready.records, ready.model, data, ready.parts, base, ready.doubts)
    own = not _comparable(ready.model) or found.verdict == "refused"
    least = found.least * found.friction
    report(0.5, "fitting the model with what is missing")
    tried = None if own else _tried(final, ready.model)
    if tried is None or tried.torque_noise < least:
        fitted = _fitted(final if tried is None else tried, final, ready.model, keys)
        if own or fitted.torque_noise < least:
            won = _by_simulation(job, fitted, keys, ready, report)
            if own or determines(won.estimates["J"]):
                return won
    whole = _at(predictor, start_with | _usable(known.values, model), ready)
    return Winner(job, final, whole, keys, _estimates(whole, known), _joint(whole, known), False)


def _by_simulation(
    job: Job, fitted: Fitted, keys: tuple[str, ...], ready: Prepared, report: Progress
) -> Winner:
    """The same by fits: of the declared model, and of both to all samples."""
    report(0.6, "refitting the declared model")
    base = begun(job.base.predictor, ready.parts.train, ready.model) if keys else fitted
    job = replace(job, base=base)
    whole = with_discrepancy(on_everything(fitted, job))
    return Winner(job, fitted, whole, keys, estimates(whole), joint(whole), True)


def _fitted(start: Fitted, final: Fitted, declared: Model, keys: Sequence[str]) -> Fitted:
    """The fit of the final model to the training samples."""
    predictor, where = final.predictor, final.where
    if not keys:
        return begun(predictor, where, declared)
    free = free_keys(predictor)
    return fit(predictor, start.values, free, where, start.noise, anchor=final.anchor)


def _tried(final: Fitted, declared: Model) -> Fitted:
    """A fit to a few windows, which shows whether one to all may be valid."""
    few = spread(final.where, TRIED, FEW)
    starts = [final.values, _falling(final.values, declared)]
    start = likeliest(final.predictor, few, final.noise, starts)
    free = free_keys(final.predictor)
    return fit(final.predictor, start.values, free, few, start.noise, most=OPEN, rough=True)


def _falling(values: Mapping[str, float], declared: Model) -> dict[str, float]:
    """The values with friction that falls with speed as it is declared to: the comparison hardly
    sees that, and without it a fit does not find it."""
    known, Fc = declared.known(), values.get("Fc", 0.0)
    if "Fs" not in values:
        return dict(values)
    excess = max(known.get("Fs", 0.0) / known.get("Fc", np.inf) - 1.0, USUAL)
    return {**values, "Fs": Fc * (1.0 + excess), "vs": known.get("vs") or values["vs"]}


def _comparable(model: Model) -> bool:
    """Whether the values of the comparison are those of the model: it knows no bounds and no law
    of one's own."""
    return means_the_same(model) and not model.statements()


def _at(predictor: Predictor, values: dict[str, float], ready: Prepared) -> Fitted:
    """A model at given values; what the comparison does not see is fitted, to a few windows."""
    data, where, model = ready.data, ready.parts.train, predictor.model
    values, few = model.kept(values), spread(where, TRIED, FEW)
    left = {k for k, v in ready.model.values().items() if v is None and k not in SEEN}
    opened = [k for k in free_keys(predictor) if k in left or k in alike(data)]
    noise, _ = tune(predictor, values, few, data.noise)
    if not opened:
        return standing(predictor, values, where, noise)
    made = fit(predictor, values, opened, few, noise, anchor=values, most=OPEN, rough=True)
    return seen_on(made, where)


def _usable(own: Mapping[str, float], model: Model) -> dict[str, float]:
    """The values within what they can be."""
    known = model.declarations()
    return {
        k: float(np.clip(v, known[k].low, known[k].high))
        for k, v in own.items()
        if k in known and ("." in k or v > 0)
    }


def _known(
    found: Comparison, declared: Model, named: Sequence[Named], keys: Sequence[str]
) -> Valued:
    """What the comparison knows, by the keys of the model: an effect may have been declared by the
    same name, too."""
    if found.valued is None:
        return Valued({}, np.zeros((0, 0)), frozenset())
    new = {e.name: key for e, key in zip(named, keys, strict=True)}
    return found.valued.by({p.block.name: p.key for p in declared.effects} | new)


def _estimates(final: Fitted, known: Valued) -> dict[str, Estimate]:
    """Every value with unit and 95 % interval, as the comparison has it."""
    model = final.predictor.model
    declared, held = model.declarations(), model.held()
    made = {}
    for key, value in final.values.items():
        if key not in declared or not declared[key].fitted:
            continue
        half = None if key in held else known.half(key)
        low, high = declared[key].low, declared[key].high
        whole_turn = declared[key].angle and (half or 0.0) >= np.pi
        ends = None if half is None else (max(value - half, low), min(value + half, high))
        ends = None if whole_turn else ends
        made[key] = Estimate(value, model.unit(key), ends, held=key in held)
    return made


def _joint(final: Fitted, known: Valued) -> Joint:
    """The joint distribution of the values that the comparison knows."""
    kept = [k for k in known.values if k in known.sure and k in final.values]
    rows = [list(known.values).index(k) for k in kept]
    values = np.array([final.values[k] for k in kept])
    positive = np.array(["." not in k for k in kept], bool) & (values > 0)
    return Joint(tuple(kept), values, known.matrix[np.ix_(rows, rows)], positive)


def _aligned(ready: Prepared, effects: Sequence[Named]) -> Prepared:
    """The same with theta of each run from where effects have one phase in all of them."""
    effect = next((e for e in effects if e.zeros), None)
    if effect is None:
        return ready
    return replace(ready, data=ready.data.aligned(effect.zeros, float(effect.values["harmonic"])))


def with_effects(
    model: Model, effects: Sequence[Named]
) -> tuple[Model, tuple[str, ...], dict[str, float]]:
    keys, values = [], {}
    for effect in effects:
        model = model.with_effect(effect.name, effect.values)
        part = model.effects[-1]
        keys.append(part.key)
        values |= {f"{part.key}.{k}": float(v) for k, v in part.values.items() if v is not None}
    return model, tuple(keys), values
