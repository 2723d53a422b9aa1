"""From a log and a declared model to the named missing effect."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from ..blocks.block import members, unit_for
from ..blocks.model import Model
from ..core.deadline import within
from ..core.errors import Refused
from ..core.progress import Progress
from ..estimates.findings import Candidate, Estimate, Finding, Table
from ..friction_maps.points import is_map
from ..identification.balance.result import Combination
from ..identification.candidates.applicable import signals_of
from ..identification.likelihood.initial_values import lifted
from ..identification.likelihood.maximise import Fitted
from ..identification.likelihood.simulation_error import missing_torque
from ..identification.selection import Comparison, Named, compare
from ..identification.unknown_torque.table import tabulate
from ..record import Record
from .duplicate_messages import with_plain
from .judged import judged
from .missed_motion import missed_motion
from .never_worse import borne
from .one_direction import next_way
from .other_law import judged_with_law
from .plain_answer import plainly
from .question import Asked, judged_by
from .record_length import longer, short
from .record_length import said as length_of
from .refusal import refusal
from .result import Diagnosis
from .rivals import rivals
from .steady_runs import diagnose_map
from .study import Job, Prepared, noted, prepared, residuals
from .winning_model import decided, winner

WORSE = (
    "On held-out samples the simulation with the added effect misses the motion by {0:.3g} {2}, "
    "without it by {1:.3g}: the comparison of torques stands, its simulation does not gain."
)
FREE_WORSE = (
    "Simulated without restarts, the {3} model misses {4} by {0:.3g} {2}, the declared one by "
    "{1:.3g} {2}. Without restarts a stop at another instant changes all motion after it: judge "
    "the models by the errors with restarts and of the torque."
)
NO_FIT = "Values are those of the balance of torques, without errors of a simulation: {}"
SAME_UNITS = "Give all runs in one unit and sign, or leave out the run that differs."


def answered(
    record: Any,
    model: Any,
    holdout: Any,
    horizon: Any,
    seed: Any,
    limits: tuple[float, float],
    limit: float,
    report: Progress,
    reading: Any,
) -> Diagnosis:
    asked = Asked.of(record, model, holdout, **reading)
    horizon, seed = judged_by(horizon, seed)
    report(0.0, "torque balance")
    unlike = asked.plain.unlike  # the plain answer first: it stands whatever follows
    try:
        if unlike:
            raise Refused(" ".join(unlike), SAME_UNITS)
        if asked.plain.hopeless:
            asked.records()  # to say what was read
            raise Refused(" ".join(asked.plain.against))
        found = _finer(asked, horizon, seed, limits, limit, report)
    except Refused as no:
        return refusal(no, asked.model, asked.seen, asked.plain)
    return with_plain(found, asked)


def _finer(
    asked: Asked,
    horizon: float,
    seed: int,
    limits: tuple[float, float],
    limit: float,
    report: Progress,
) -> Diagnosis:
    """The answer by comparison; Refused where the record cannot give it."""
    record, model = asked.records(), asked.model
    holdout = asked.holdout()
    if not isinstance(record, Record) and is_map(record):
        return diagnose_map(record, model, holdout=holdout, seed=seed, progress=report)
    asked.refuse_unfit()
    report(0.05, "comparing explanations")
    ready, no = _prepared(record, model, holdout, horizon)
    apart = None if ready is None else ready.held_out
    plain = asked.plain
    found = compare(plain.stretches, asked.completed, plain, *limits, held_out=apart)
    if found.verdict == "refused":
        raise Refused(" ".join(found.messages), _next(asked, found, None))
    if ready is not None:
        try:
            ready = ready.begun_from(asked.plain, asked.starts(found.alone), found.written_late)
            with within(limit):
                return _answered(ready, found, asked, seed, report)
        except Refused as later:
            no = later
    assert no is not None  # the comparison needs no simulation
    return _only_compared(asked, found, f"{no} {no.experiment or ''}".rstrip())


def _prepared(
    record: Record | Sequence[Record], model: Model, holdout: Any, horizon: float
) -> tuple[Prepared | None, Refused | None]:
    """The records split for simulations, or why they cannot be."""
    try:
        return prepared(record, model, holdout, horizon), None
    except Refused as no:
        return None, no


def _answered(
    ready: Prepared, found: Comparison, asked: Asked, seed: int, report: Progress
) -> Diagnosis:
    """The answer with values, intervals and errors of simulations."""
    report(0.4, "values of the model with what is missing")
    won, found = decided(ready, found, report)
    report(0.8, "errors on held-out samples")
    own = judged(won, asked)
    kept = borne(found, own.scored["error"])
    if kept is not found:
        won, found = winner(ready, kept, report), kept
        own = judged(won, asked)
    found = judged_with_law(found, asked.model, asked.plain, failed=bool(own.failed))
    scored, fitted = own.scored, own.estimates
    report(0.9, "what was noticed")
    worse = _worse(scored["error"], found)
    free = free_worse(scored["free_error"], found)
    missed = _missed(scored["error"], found, won.whole.values, asked.model)
    job = noted(own.job, *found.messages, *worse, *missed, *free, *_length(asked, found))
    tied = tuple(_candidate(found, a.name) for a in found.alternatives)
    named = () if found.only_inertia else found.effects
    effects = [
        Finding.of(key, e.name, fitted, tied if i == _first(found) else ())
        for i, (key, e) in enumerate(zip(won.keys, named, strict=True))
    ]
    effects = effects or [Finding(e.name, {}, tied) for e in found.effects]
    return Diagnosis(
        verdict=found.verdict,
        effects=tuple(effects),
        depends_on=_signals(found),
        experiment=_next(asked, found, next_experiment(found, effects), own.sums),
        error=scored["error"],
        free_error=scored["free_error"],
        torque_error=scored["torque_error"],
        model=won.whole.predictor.model.with_values(won.whole.values),
        declared=asked.model,
        estimates=fitted,
        record=job.records[0],
        messages=job.messages,
        ranking=_ranking(found),
        traces=own.traces,
        table=_table(own.final, job, found, seed),
        comparison=found,  # pyright: ignore[reportArgumentType]
        joint=won.joint,
        residuals=residuals(won.whole),
        rivals=rivals(won, found),
        torque_noise=won.whole.torque_noise,
    )


def _only_compared(asked: Asked, found: Comparison, reason: str) -> Diagnosis:
    """The answer without a fit of predictions: values of the balance and, of the effects, of the
    comparison; without errors."""
    noticed = (m for r in asked.seen for m in r.messages)
    found = judged_with_law(found, asked.model, asked.plain, failed=False)
    known, model = plainly(asked.plain, asked.model)
    if found.effects and not found.only_inertia:  # the plain values are biased by the effects
        known = {k: e for k, e in _beside(found, known).items() if not e.may_be(0.0)}
        model = lifted(asked.model.with_values({k: e.value for k, e in known.items()}))
    for e in () if found.only_inertia else found.effects:
        model = model.with_effect(e.name, e.values)
    tied = tuple(_candidate(found, a.name) for a in found.alternatives)
    effects = [
        Finding(e.name, _estimates(e, found), tied if i == _first(found) else ())
        for i, e in enumerate(found.effects)
    ]
    return Diagnosis(
        verdict=found.verdict,
        effects=tuple(effects),
        depends_on=_signals(found),
        experiment=_next(asked, found, next_experiment(found, effects)),
        model=model,
        declared=asked.model,
        estimates=known,
        record=asked.seen[0],
        messages=(*noticed, *found.messages, NO_FIT.format(reason), *_length(asked, found, True)),
        ranking=_ranking(found),
        comparison=found,  # pyright: ignore[reportArgumentType]
    )


def _beside(found: Comparison, known: Mapping[str, Estimate]) -> dict[str, Estimate]:
    """Values of the plant beside the effects, as the comparison has them, with its intervals."""
    assert found.valued is not None
    halves = {k: found.valued.half(k) for k in known if k in found.plant}
    return {
        k: replace(known[k], value=found.plant[k], ci95=(found.plant[k] - h, found.plant[k] + h))
        for k, h in halves.items()
        if h is not None
    }


def _estimates(effect: Named, found: Comparison) -> dict[str, Estimate]:
    """Values of the comparison; none of what only the inertia shows."""
    if found.only_inertia:
        return {}
    block = members("effect")[effect.name]
    return {k: Estimate(v, block.own[k].unit) for k, v in effect.values.items()}


def _first(found: Comparison) -> int:
    """The place of the effect that has alternatives: gravity that joined the base has none."""
    return len(found.effects) - 1 if found.alternatives else 0


def _signals(found: Comparison) -> tuple[str, ...]:
    if found.verdict == "unexplained":
        return found.depends_on
    return signals_of([e.name for e in found.effects])


def _candidate(found: Comparison, name: str) -> Candidate:
    return next((c for c in _ranking(found) if c.name == name), Candidate(name, 0.0, 0.0))


def _ranking(found: Comparison) -> tuple[Candidate, ...]:
    rows = [row for row in found.rows if row.model in members("effect")]
    return tuple(Candidate(row.model, row.elpd, row.torque) for row in rows)


def _worse(error: Mapping[str, Any], found: Comparison) -> list[str]:
    """A sentence where the held-out error is larger with the effects than without."""
    before, after = error["refitted"], error["augmented"]
    if not found.effects or before is None or after is None or after <= before:
        return []
    return [WORSE.format(after, before, error["unit"])]


def _missed(
    error: Mapping[str, Any], found: Comparison, values: Mapping[str, float], model: Model
) -> list[str]:
    """Why the motion is missed where no effect is."""
    left = next((s.rms for s in found.budget if s.term == "left"), None)
    if found.verdict != "adequate" or left is None:
        return []
    return missed_motion(error, left, unit_for("N m", model.motion), values)


def free_worse(error: Mapping[str, Any], found: Comparison) -> list[str]:
    """A sentence where the free run of the final model is worse than the declared one's."""
    before, after = error["declared"], error["augmented"]
    if before is None or after is None or not float(f"{after:.3g}") > float(f"{before:.3g}"):
        return []
    final = "augmented" if found.effects else "refitted"
    return [FREE_WORSE.format(after, before, error["unit"], final, error["signal"])]


def _table(final: Fitted, job: Job, found: Comparison, seed: int) -> Table | None:
    """The residual torque as a table over what it depends on; None if it predicts nothing."""
    if found.verdict != "unexplained":
        return None
    torque = missing_torque(final.predictor, final.values, final.where, job.base.noise)
    made = tabulate(torque, job.data.log, final.where.counted, found.depends_on, seed=seed)
    return made if made is not None and made.share95[0] > 0.0 else None


AGAIN = (
    "record the same motion again, twice. What returns at the same instants depends on the motion; "
    "what does not comes from outside, or from the logger"
)
SWINGING = (
    "switch off other machines nearby, or log their state, and record the same motion again at "
    "another speed, and the drive at rest with its torque on. A frequency that follows the speed "
    "comes from the drive; one that stays, also at rest, comes from outside or from the controller"
)
_ADVICE = {  # if the residual depends on several of these signals, the first one counts
    "t": "repeat the same run, cold and warm, and log temperature and load as well. What returns "
    "at the same times depends on the motion",
    "theta": "record slow moves over the same positions, in both directions and at two speeds",
    "a": "record the same move at two accelerations",
    "u": "record the same motion with a known added load, so that torque and motion differ",
    "w": "record constant speeds, from slow to fast, in both directions",
}


def _length(asked: Asked, found: Comparison, always: bool = False) -> tuple[str, ...]:
    """How long the records are and how much was compared, where that is little, or always."""
    many = found.stretches
    if many is None or not (always or short(many)):
        return ()
    return (length_of(asked.seen, many),)


def _next(
    asked: Asked,
    found: Comparison,
    then: str | None,
    sums: Mapping[str, Combination] | None = None,
) -> str | None:
    """What to record next: first a longer record, where little was compared, and at last the
    other direction, where the log has one only."""
    many = found.stretches
    then = next_way(asked.plain.together if sums is None else sums, then)
    return longer(asked.seen, many, then) if many is not None and short(many) else then


def next_experiment(found: Comparison, effects: Sequence[Finding]) -> str | None:
    """What tells the explanations apart, or leads to an unknown one; None where nothing is open."""
    if found.verdict == "ambiguous":
        said = next(finding for finding in effects if finding.alternatives).apart()
        return f"{said[0].upper()}{said[1:]}."
    if found.verdict == "unexplained":
        known = (said for k, said in _ADVICE.items() if k in found.depends_on)
        usual = SWINGING if found.swings else next(known, _ADVICE["a"])
        advice = AGAIN if found.events else usual
        return f"To identify the missing effect: {advice}."
    return None
