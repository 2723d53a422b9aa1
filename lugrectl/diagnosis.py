"""From a log and a declared model to the named missing effect."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from .blas import one_blas_thread
from .friction_map import diagnose_map
from .model import Model
from .progress import Wanted, reporter, shows_progress
from .record import Record
from .results import Diagnosis, Finding, Table
from .steady.points import is_map
from .traces import traces
from .tracing.evaluate import missing_torque
from .tracing.explain import (
    Explanation,
    behind_a_filter,
    explain,
    likely,
    without_effects,
)
from .tracing.far import far_off
from .tracing.fit import Fitted
from .tracing.hanging import signals_of
from .tracing.held_out import adapted, with_its_own
from .tracing.job import (
    Job,
    Progress,
    another_torque,
    begin,
    compared,
    estimates,
    noted,
    on_everything,
    on_places,
    on_torque,
    score,
    untold,
)
from .tracing.late import halfway
from .tracing.rest import signals_of_the_rest
from .tracing.structure import colour
from .tracing.surprise import beyond_doubt, misled, openings, surprising, undated, when
from .tracing.tabulate import tabulate
from .tracing.witness import statements

TURNED = (
    "The blocks first held out show a torque, or the moment of a change, that the others do not: "
    "fitted and held-out blocks were exchanged."
)
MANY = (
    "A state that the motion does not show for a while makes many optima: the values found may be "
    "off by tens of per cent, so no intervals are given."
)
CARRIED = (
    "Driven by the measured motion the load takes {:.0f} % of the power that the balance of torque "
    "and motion lacks, {:.0f} % where nothing was fitted; a simulation from the torque alone soon "
    "loses where it is."
)
MISLED = "With {} the held-out samples were foretold worse than without: dropped."
CHANCE = (
    "Held-out samples at {} are foretold only by other values within the parameters' uncertainty: "
    "record more starts and reversals, which tell them."
)
NEW = "The held-out samples show a torque that the fitted ones do not: at {}."
AT_ODDS = 0.5  # least colour of the innovations of both theta and w
EARLY = 0.05  # s, lead-in where something happens in the first moments that is not seen later


@shows_progress
@one_blas_thread()
def diagnose(
    record: Record | Sequence[Record],
    model: Model,
    *,
    holdout: str | Record | None = None,
    horizon: float = 1.0,
    seed: int = 0,
    progress: Wanted = None,
) -> Diagnosis:
    """Find what physical effect a declared model lacks to explain a log.

    The declared model is refitted by the likelihood of its one-step predictions, so that a
    wrong parameter is not called a missing effect. Effects of the catalogue are tried jointly
    with a refit, and accepted when the gain holds over the training windows. Errors are those
    of simulations from the recorded torque alone, on samples that no fit has seen; what these
    contradict is not named, or called unexplained. Of a single
    record the parameters given at the end come from all samples, after the errors were taken.
    A speed that is only the position's difference is left out of the fit, a torque that was
    logged up to a sample late is moved, noise on it is taken out; each is said in ``messages``.

    Parameters
    ----------
    record : Record or list of Record
        One run, or several of one rate. Up to eight may differ in the torque's offset and, by a
        factor, in friction, and in where theta is zero, if nothing that is declared hangs on it:
        these are fitted against the first run, and said in ``messages``.
        Four or more runs at a steady speed each, of any rates, are one map of friction: see
        :func:`lugrectl.friction_map.diagnose_map`.
    model : Model
        The declared model; missing values are identified.
    holdout : None, "last" or Record
        Every other block, the last half, or another run is held out.
    horizon : float
        Time between restarts of the simulation, s.
    seed : int
        For what is drawn at random: the resampled error of the table of what is left.
    progress : callable, True, False or None
        ``progress(fraction, what)``, or whether to show a bar. None: in Jupyter only.

    Returns
    -------
    Diagnosis

    Raises
    ------
    Refused
        When the record cannot answer.
    """
    report = reporter(progress)
    if not isinstance(record, Record) and is_map(record):
        return diagnose_map(record, model, holdout=holdout, seed=seed, progress=report)
    answer = _answered(partial(begin, record, model, holdout, horizon, report), report)
    job, found, new = answer.job, answer.found, answer.unforeseen
    if len(new):
        hidden = signals_of_the_rest(found.final, found.base)
        found = replace(found, unexplained=True, hangs_on=hidden)
        job = noted(job, NEW.format(when(found.final, job.parts.test, new)))
    known = None if job.data.late else answer.known  # that has not the filter
    found = behind_a_filter(found)
    report(0.85, "judging on held-out samples")
    scored = score(job, found.final)
    report(0.92, "parameters and intervals")
    whole = found.final if len(new) else known or on_everything(found.final, job)
    job = compared(job, answer.own or whole)
    flat = untold(whole.flat(), "record tells")
    many = (MANY,) if whole.noise.uneven else ()
    carried = (CARRIED.format(*(100 * x for x in found.carried)),) if found.carried else ()
    job = noted(job, *flat, *many, *carried, *statements(whole), *openings(found.final))
    verdict, depends = _verdict(found)
    job = noted(job, *far_off(whole, model)) if verdict == "adequate" else job
    told = estimates(whole)
    effects = [Finding.of(s.trial.key, s.trial.name, told, s.tied) for s in found.steps]
    table = _table(found.final, job, depends, seed) if verdict == "unexplained" else None
    return Diagnosis(
        verdict=verdict,
        effects=tuple(effects),
        depends_on=depends,
        experiment=_experiment(verdict, effects, depends),
        error=scored["error"],
        free_error=scored["free_error"],
        torque_error=scored["torque_error"],
        model=whole.predictor.model.with_values(whole.values),
        declared=model,
        estimates=told,
        record=job.records[0],
        messages=job.messages,
        ranking=found.ranking,
        traces=traces(job, found.final, scored["judged"]),
        table=table,
    )


@dataclass(frozen=True)
class _Answer:
    """An explanation, and what held-out samples say to one that is taken to be whole.

    ``unforeseen`` are the windows that no values of it explain; ``undated`` says that only they
    tell when something changed. ``known`` has values from all samples, where they were asked
    for, ``own`` what held-out runs have for themselves, where they were wanted.
    """

    job: Job
    found: Explanation
    unforeseen: np.ndarray
    undated: bool
    known: Fitted | None = None
    own: Fitted | None = None


def _answered(start: Callable[..., Job], report: Progress) -> _Answer:
    """The explanation; of the position, if w turns out to be its difference, or if something is
    left of a w that had to be brought to an even step."""
    answer = _from_start(start, report)
    if halfway(answer.found.final, [step.trial.name for step in answer.found.steps]):
        summed = _from_start(partial(start, halfway=True), report)
        worse = summed.found.unexplained and not answer.found.unexplained
        return answer if worse else summed
    if answer.found.unexplained and _uneven(answer.job):
        alone = _from_start(partial(start, uneven=True), report)
        return answer if alone.found.unexplained else alone
    return answer


def _uneven(job: Job) -> bool:
    """Whether theta and w were interpolated, and the innovations of both foretell themselves: no
    torque does that to a model that may follow them, but two sensors at odds do."""
    interpolated = any(record.resolution for record in job.records)
    both = bool(np.all(job.data.noise.channels()))
    return interpolated and both and min(colour(job.base.quiet)) > AT_ODDS


def _from_start(start: Callable[..., Job], report: Progress) -> _Answer:
    """The explanation; by samples from nearly the start on if that is out of the ordinary.

    Unless these lose an effect that others prove: its own state, a dwell say, is not known there.
    """
    usual = _by_either(start, report)
    whole = not (usual.found.unexplained or len(usual.unforeseen))
    if not whole or not openings(usual.found.final):
        return usual
    early = _answer(start(lead=EARLY), report)
    had, has = ({step.trial.name for step in a.found.steps} for a in (usual, early))
    more = early.found.unexplained or len(has) > len(had)
    return early if more and had <= has else usual


def _by_either(start: Callable[..., Job], report: Progress) -> _Answer:
    """The explanation; with fitted and held-out blocks exchanged if the latter know more.

    Where they know a moment only, what changes then is known.
    """
    first = _answer(start(), report)
    new = len(first.unforeseen)
    if not (new or first.undated) or not first.job.parts.in_sample:
        return first
    job = noted(start(turned=True), TURNED)
    if new:
        return _answer(job, report)
    again = _answer(replace(job, only=likely(first.found)), report)
    if again.found.unexplained or len(again.unforeseen) or again.undated:
        return first
    return replace(again, found=replace(again.found, ranking=first.found.ranking))


def _answer(job: Job, report: Progress) -> _Answer:
    """The explanation by the fitted samples, and what the others say to it."""
    job, found, wrong = _first_whole(_ways(job, report), report)
    if wrong:
        names = " and ".join(dict.fromkeys(step.trial.name for step in found.steps))
        job, found = noted(job, MISLED.format(names)), without_effects(found)
    job, final, test = replace(job, base=found.base), found.final, job.parts.test
    if found.unexplained:
        return _Answer(job, found, np.array([], dtype=int), False)
    new, known, own = surprising(final, test), None, None
    if len(new):  # perhaps the fitted samples only do not tell the parameters well enough
        known = on_everything(final, job)
        new = surprising(final, test, known.values)
        # or a run that was held out is colder, its torque recorded with an offset
        own = with_its_own(final, test) if len(new) else None
        doubted = new if own is None else surprising(own, test)
        new = beyond_doubt(final, known, test, doubted)
        own = None if len(new) else own
        if len(doubted) and not len(new):
            job = noted(job, CHANCE.format(when(final, test, doubted)))
    return _Answer(job, found, new, undated(final, test), known, own)


def _first_whole(ways: Iterable[Job], report: Progress) -> tuple[Job, Explanation, bool]:
    """The first explanation that leaves nothing and that held-out windows do not speak against,
    else the first; and whether they do."""
    tried = []
    for way in ways:
        job, found = _explained(way, report)
        sure = not found.unexplained  # else they are a part at best
        wrong = bool(found.steps) and misled(found.base, found.final, job.parts.test, sure=sure)
        tried.append((job, found, wrong))
        if not (found.unexplained or wrong):
            return tried[-1]
    return tried[0]


def _ways(job: Job, report: Progress) -> Iterator[Job]:
    """A job with theta of its runs moved, then with theta and torque as recorded: what a missing
    effect does was perhaps taken for something to mend."""
    moved = on_places(job, report)
    if moved is not None:
        yield moved
    yield job
    if job.data.smoothed and job.recorded is not None:
        yield on_torque(job, job.recorded, report)


def _explained(job: Job, report: Progress) -> tuple[Job, Explanation]:
    """The explanation, with another torque where the first effect shows that it is wanted."""
    test = job.parts.test
    another = partial(another_torque, recorded=job.recorded)
    found = explain(job.base, report, test, another, job.only)
    if found.other is not None:
        job = on_torque(job, found.other, report)
        found = explain(job.base, report, test, only=job.only)
    final, base = (adapted(f, test, job.declared) for f in (found.final, found.base))
    return job, replace(found, final=final, base=base)


def _table(final: Fitted, job: Job, depends: Sequence[str], seed: int) -> Table | None:
    """What is left as a function of the signals that it hangs on; none that foretells nothing."""
    torque = missing_torque(final.predictor, final.values, final.where, job.base.noise)
    made = tabulate(torque, job.data.log, final.where.counted, depends, seed=seed)
    return made if made is not None and made.share95[1] > 0.0 else None


def _verdict(found: Explanation) -> tuple[str, tuple[str, ...]]:
    """The verdict, and the signals on which what was found or left hangs."""
    if found.unexplained:
        return "unexplained", found.hangs_on
    if not found.steps:
        return "adequate", ()
    tied = any(step.tied for step in found.steps)
    return "ambiguous" if tied else "found", signals_of([step.trial.name for step in found.steps])


_ADVICE = {  # of several signals by the first
    "t": "repeat the same run cold and warm, and log temperature and load beside it",
    "theta": "record slow moves over the same positions in both directions at two speeds",
    "a": "record the same move at two accelerations",
    "u": "record the same motion with a known added load, so that torque and motion differ",
    "w": "record constant speeds from slow to fast in both directions",
}


def _experiment(verdict: str, effects: Sequence[Finding], depends: Sequence[str]) -> str | None:
    if verdict == "ambiguous":
        said = next(finding for finding in effects if finding.alternatives).apart()
        return f"{said[0].upper()}{said[1:]}."
    if verdict == "unexplained":
        advice = next((said for k, said in _ADVICE.items() if k in depends), _ADVICE["a"])
        return f"To see what it is: {advice}."
    return None
