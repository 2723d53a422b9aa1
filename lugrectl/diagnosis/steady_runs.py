"""Runs at steady speed: the map of torque over speed, and what is missing from its friction."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..blocks.block import unit_for
from ..blocks.model import Model, Part
from ..core.errors import InputError, Refused
from ..core.numeric import rms
from ..core.option_names import option
from ..estimates.findings import Estimate, Finding, FrictionMap
from ..friction_maps.curve import Curve
from ..friction_maps.fit import fit
from ..friction_maps.low_speed import as_shown, may_fall, slower, without_fall
from ..friction_maps.noise import noise_of
from ..friction_maps.points import Points, is_steady, points, refuse_narrow
from ..friction_maps.ripple import Swing, finding_of, sentence, swings
from ..friction_maps.select import Choice, choose, least_seen, left_over, shows, started
from ..identification.candidates.applicable import signals_of
from ..identification.likelihood.initial_values import lifted
from ..record import Record
from .parameter_changes import far_off
from .result import Diagnosis
from .study import Progress, unidentified

EVERY = 3  # one of three speeds is held out
FINE = 400  # speeds at which the curves are drawn
MAP = "{} runs at steady speed were taken as one map of torque over speed"
TOO_FEW = (
    "{0} runs at steady speed are {0} points, and {1} values are fitted to them: nothing can be "
    "tested. A missing torque as large as friction itself could be chance."
)
LOG_ANGLE = "log theta from one zero mark in every run, over slow turns in both directions"
MORE_SPEEDS = "record more speeds, from slow to fast, in both directions, at one temperature"
_FREE = ("signal", "unit", "declared", "refitted", "augmented")
_TORQUE = ("unit", "declared", "refitted", "augmented")


@dataclass(frozen=True)
class Fits:
    """A map, which of its points are held out, and the declared friction fitted to the others
    (``base``) and to all points (``everywhere``).

    ``aside`` are the declared effects that such runs do not identify; ``declared`` is without them.
    """

    records: tuple[Record, ...]
    whole: Points
    held_out: np.ndarray
    base: Curve
    everywhere: Curve
    declared: Model
    aside: tuple[Part, ...]


def diagnose_map(
    records: Sequence[Record],
    model: Model,
    *,
    holdout: str | Record | None,
    seed: int,
    progress: Progress,
) -> Diagnosis:
    """Find what is missing from the declared friction, by runs at steady speed.

    ``u - d = F(w) + r(w, theta)``: one point for each run, its mean torque over its mean speed,
    weighted by the error of the mean and by a scatter from run to run. Where runs recorded theta
    and passed less than two turns, an effect over the angle is averaged along each, and the
    differences of torque in each run count as well. An effect that depends on speed or the angle
    alone, or on nothing, is added if the misfit falls by more than chance allows (F test, 1 % for
    all candidates together) and if its torque is above the least size. The ripple of the torque
    over the angle is reported as well, and named where it is the largest part. Such runs do not
    identify inertia and presliding.

    Held out are one of three speeds in either direction, the last half of every run, or a run.
    All points decide what is missing; for ``error`` the others alone choose and fit. It
    is the RMS of measured minus modelled mean torque there, N m or N: there is no motion to
    simulate. Values given at the end come from all points.

    Parameters
    ----------
    records : list of Record
        Four or more runs at a steady speed each.
    model : Model
        The declared model; its friction is fitted, and those of its effects that such runs show.
    holdout : None, "last" or Record
        What is held out.
    seed : int
        For the permutations that test whether the residual depends on speed.
    progress : callable
        ``progress(fraction, what)``.

    Raises
    ------
    InputError
        When a run held out is not at a steady speed.
    Refused
        When the runs go in one direction or at one speed only, or are too few.
    """
    fits = begin_map(records, model, holdout, progress)
    choice = _chosen(fits.everywhere, fits.declared, lambda what: progress(0.2, what))
    whole, trained = choice.final, fits.base
    if choice.steps:  # what is held out must not choose the effects by which it is judged
        trained = _chosen(fits.base, fits.declared, lambda what: progress(0.5, what)).final
    progress(0.8, "ripple of the torque over the angle")
    swing = swings(fits.records)
    missing = left_over(whole, seed)
    errors = errors_of(fits, trained)
    values = estimates_of(whole)
    found = [Finding.of(step.key, step.name, values, step.tied) for step in choice.steps]
    largest = bool(swing) and _largest(swing[0], whole, [step.key for step in choice.steps])
    found += [finding_of(swing[0], whole)] if largest else []
    names = [step.name for step in choice.steps]
    signals = dict.fromkeys([*signals_of(names), *(["theta"] * largest), *(["w"] * missing)])
    verdict = _verdict(found, largest, missing)
    if verdict == "adequate" and least_seen(whole) > 1.0:
        raise Refused(
            TOO_FEW.format(len(fits.whole.w), len(whole.coords)), f"{_capital(MORE_SPEEDS)}."
        )
    return Diagnosis(
        verdict=verdict,
        effects=tuple(found),
        depends_on=tuple(s for s in signals if s != "t"),
        experiment=_experiment(verdict, found, largest, slower(whole, fits.declared)),
        error=errors,
        free_error={k: errors[k] for k in _FREE} | {"in_sample": False},
        torque_error={k: errors[k] for k in _TORQUE},
        model=final_model(fits, whole),
        declared=model,
        estimates=values,
        record=fits.records[0],
        messages=messages_of(fits, whole) + ((sentence(swing, whole),) if swing else ()),
        ranking=choice.ranking,
        map=map_of(fits, whole, {"refitted": fits.base, "augmented": trained}, swing),
    )


def begin_map(
    records: Sequence[Record], model: Model, holdout: str | Record | None, progress: Progress
) -> Fits:
    """The points of a map, and the declared friction fitted to the training points."""
    progress(0.05, "mean torque over mean speed")
    whole, held_out = _laid_out(records, holdout)
    at = whole.only(~held_out)
    aside = tuple(part for part in model.effects if not shows(part.block, whole))
    model = replace(model, effects=tuple(p for p in model.effects if p not in aside))
    where = f"{len(records)} runs at steady speed"
    refuse_narrow(at, model.motion, "Fc" in model.friction.values, where)
    if not held_out.any():
        raise Refused(
            f"{where}: they are too few to fit some and judge on others.",
            f"Record at least three speeds in each direction, or give a run with "
            f"{option('holdout')}.",
        )
    progress(0.1, "fitting the declared friction")
    begun = lifted(model)
    starts = started(begun, at)
    full = model.with_values(starts[0])
    fixed = {k: v for k, v in full.known().items() if not full.declarations()[k].fitted}
    begin, anchor = [start | fixed for start in starts], begun.known() | fixed
    base, everywhere = (fit(full, on, begin, anchor) for on in (at, whole))
    apart = (holdout,) if isinstance(holdout, Record) else ()
    return Fits((*records, *apart), whole, held_out, base, everywhere, model, aside)


def _chosen(base: Curve, declared: Model, say: Callable[[str], None]) -> Choice:
    """The effects that a map shows; a fall of friction at low speed may imitate one."""
    flat = without_fall(base, declared) if may_fall(base, declared) else None
    made = choose(base, say, flat)
    known = flat if made.final is base else None
    return replace(made, final=as_shown(made.final, declared, known))


def _laid_out(records: Sequence[Record], holdout: str | Record | None) -> tuple[Points, np.ndarray]:
    """All points, and which of them are held out."""
    if holdout == "last":
        early = points([r.slice(0, r.samples // 2) for r in records])
        late = points([r.slice(r.samples // 2, r.samples) for r in records])
        return early.beside(late), np.repeat([False, True], len(records))
    if isinstance(holdout, Record):
        if not is_steady(holdout):
            raise InputError(
                f"{holdout.source} is not at a steady speed like the other runs; hold out one "
                "that is, or none."
            )
        return points([*records, holdout]), np.arange(len(records) + 1) == len(records)
    whole = points(records)
    held_out = np.zeros(len(records), dtype=bool)
    for side in (-1.0, 1.0):
        way = np.flatnonzero(whole.w * side > 0.0)
        slow_to_fast = way[np.argsort(np.abs(whole.w[way]))]
        held_out[slow_to_fast[1:-1:EVERY]] = True
    return whole, held_out


def errors_of(fits: Fits, final: Curve) -> dict[str, Any]:
    """The error of the JSON format: of mean torque, on the points held out."""
    test = fits.whole.only(fits.held_out)
    base = fits.base
    shown = {c.key for c in base.coords} | fits.declared.held()
    given = {k: fits.declared.values()[k] for k in shown}
    declared = None
    if None not in given.values():
        values = base.values | {k: v for k, v in given.items() if v is not None}
        declared = rms(replace(base, values=values).on(test).residual)
    refitted, augmented = rms(base.on(test).residual), rms(final.on(test).residual)
    return {
        "signal": "u",
        "unit": unit_for("N m", fits.declared.motion),
        "samples": int(test.samples.sum()),
        "horizon": float(np.median(test.seconds)),
        "declared": declared,
        "refitted": refitted,
        "augmented": augmented,
        "noise_floor": _noise(fits, final, min(refitted, augmented)),
    }


def _noise(fits: Fits, final: Curve, most: float) -> float:
    """The noise of the mean torque of a run: what differs within runs, and how runs scatter.

    Where the curve bends between its points, the scatter is no more than what a model leaves.
    """
    within = rms(final.on(fits.whole.only(fits.held_out)).error)
    scatter = noise_of(fits.whole.w, final.on(fits.whole).without_angle) or 0.0
    return max(within, min(scatter, most))


def estimates_of(whole: Curve) -> dict[str, Estimate]:
    """Every value that the map identifies, with its unit and interval."""
    intervals, model = whole.intervals(), whole.model
    held = {k: whole.values[k] for k in model.held() if model.declarations()[k].fitted}
    fitted = {
        c.key: Estimate(whole.values[c.key], model.unit(c.key), intervals.get(c.key))
        for c in whole.coords
    }
    return fitted | {k: Estimate(v, model.unit(k), held=True) for k, v in held.items()}


def final_model(fits: Fits, whole: Curve) -> Model:
    """The fitted model; a value neither declared nor identified by the map stays open."""
    fitted = {c.key for c in whole.coords}
    silent = {k: v for k, v in fits.declared.values().items() if k not in fitted}
    model = whole.model.with_values(whole.values | silent)
    return replace(model, effects=(*fits.aside, *model.effects))


def messages_of(fits: Fits, whole: Curve) -> tuple[str, ...]:
    """What was noticed about the model and the runs."""
    noticed = [m for r in fits.records for m in r.messages]
    declared = fits.declared.declarations()
    fitted = {c.key for c in whole.coords} | fits.declared.held()
    silent = [k for k, p in declared.items() if p.fitted and k not in fitted]
    silent += [part.key for part in fits.aside]
    said = MAP.format(len(fits.records))
    said += f"; they do not identify {', '.join(silent)}." if silent else "."
    ends = [f"{k} lies at the limit of the range in which it is searched." for k in whole.ends()]
    ends += far_off(estimates_of(whole), fits.declared)
    flat = unidentified(whole.flat(), "these runs")
    return tuple(dict.fromkeys([*fits.declared.remarks(), *noticed, said, *ends, *flat]))


def _largest(swing: Swing, whole: Curve, keys: Sequence[str]) -> bool:
    """Whether the ripple is the largest part of what is missing: names are of that part.

    A smaller one is reported with its size; its phase, and with that its name, is not known.
    """
    ripple = swing.amplitude / np.sqrt(2.0) / rms(whole.friction)
    return bool(ripple > max((whole.size(key) for key in keys), default=0.0))


def _verdict(found: Sequence[Finding], swinging: bool, missing: bool) -> str:
    if missing:
        return "unexplained"
    if swinging or any(finding.alternatives for finding in found):
        return "ambiguous"
    return "found" if found else "adequate"


def _experiment(
    verdict: str, found: Sequence[Finding], swinging: bool, slow: str | None
) -> str | None:
    if verdict == "unexplained":
        return f"To see what it is: {MORE_SPEEDS}."
    told = _telling(found, swinging)
    return " ".join(filter(None, (told, slow))) or None


def _telling(found: Sequence[Finding], swinging: bool) -> str | None:
    """What tells the found effects from their alternatives."""
    said = [finding.apart() for finding in found[: len(found) - swinging]]
    said += [found[-1].apart(LOG_ANGLE)] if swinging else []
    whole = "; ".join(filter(None, said))
    return f"{_capital(whole)}." if whole else None


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]


def map_of(
    fits: Fits, whole: Curve, models: Mapping[str, Curve], swing: Sequence[Swing] = ()
) -> FrictionMap:
    """The points of the runs without what depends on the angle, and the curves of fitted models
    by name."""
    at, unit = whole.at, unit_for("N m", fits.declared.motion)
    slow, fast = float(np.min(np.abs(at.w))), float(np.max(np.abs(at.w)))
    half = np.linspace(slow, fast, FINE // 2)
    over = np.concatenate([-half[::-1], half])
    curves = {name: model.torque(over) for name, model in models.items()}
    named = tuple((s.order, Estimate(s.amplitude, unit, (s.low, s.high))) for s in swing)
    u, motion = whole.without_angle, fits.declared.motion
    return FrictionMap(at.w, u, whole.error, fits.held_out, over, curves, motion, named)
