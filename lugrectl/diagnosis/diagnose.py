"""From a log and a declared model to the named missing effect."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from ..blas import one_blas_thread
from ..checks import positive
from ..deadline import within
from ..door import judged_by
from ..errors import Refused
from ..friction_map import diagnose_map
from ..progress import Wanted, reporter, shows_progress
from ..provenance import stamped
from ..record import Record
from ..results import Diagnosis, Finding, Table
from ..steady.points import is_map
from ..traces import traces
from ..tracing.evaluate import missing_torque
from ..tracing.explain import (
    Explanation,
    behind_a_filter,
    explain,
    likely,
    without_effects,
)
from ..tracing.far import against_held, at_bounds, far_off
from ..tracing.fit import Fitted
from ..tracing.hanging import signals_of
from ..tracing.held_out import adapted, with_its_own
from ..tracing.job import (
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
    unidentified,
)
from ..tracing.late import halfway
from ..tracing.optima import other_optima
from ..tracing.rest import signals_of_the_rest
from ..tracing.structure import colour
from ..tracing.surprise import beyond_doubt, misled, openings, surprising, undated, when
from ..tracing.tabulate import tabulate
from ..tracing.witness import statements
from .asking import Asked
from .floor import failure
from .plain import refusal, with_plain

TURNED = (
    "The held-out blocks show a torque, or the time of a change, that the fitted blocks do not "
    "show. Fitted and held-out blocks were exchanged."
)
MANY = (
    "The likelihood has several local maxima, because the motion does not show one state of the "
    "model for a part of the record. The values may be off by tens of per cent, so no intervals "
    "are given."
)
CARRIED = (
    "Driven by the measured motion, the load explains {:.0f} % of the power of the residual in "
    "the balance of torque and motion, {:.0f} % on samples that were not fitted. A simulation "
    "from the torque alone soon loses the load's position."
)
MISLED = "Adding {} made the prediction of held-out samples worse: removed from the model."
CHANCE = (
    "The held-out samples at {} can be predicted only with other parameter values inside their "
    "confidence region. Record more starts and reversals, which determine these parameters."
)
NEW = "The held-out samples show a torque that the fitted samples do not show: at {}."
SAME_UNITS = "Give all runs in one unit and sign, or leave out the run that differs."
AT_ODDS = 0.5  # least autocorrelation of the innovations of both theta and w
LIMIT = 270.0  # s that the search for what is missing may take
EARLY = 0.05  # s, lead-in if something happens at the start of the record and never again


@shows_progress
@one_blas_thread()
@stamped("lugrectl.diagnose")
def diagnose(
    record: Any,
    model: Any,
    *,
    holdout: Any = None,
    horizon: float = 1.0,
    seed: int = 0,
    time_limit: float = LIMIT,
    progress: Wanted = None,
) -> Diagnosis:
    """Find the physical effect that is missing from a declared model, from a log.

    The declared model is refitted by the likelihood of its one-step predictions, so that a
    wrong parameter is not reported as a missing effect. Each effect of the catalogue is tried
    together with a refit, and accepted when the gain is significant over the training windows.
    Errors are those of simulations from the recorded torque alone, on samples that no fit has
    used. An effect that these samples contradict is not named, or the verdict is "unexplained".
    For a single record the final parameters are fitted to all samples, after the errors were
    computed. A speed that is only the difference of the position is not fitted. A torque that
    was logged up to one sample late is shifted, and noise on it is removed; ``messages`` reports
    each of these steps.

    Parameters
    ----------
    record : path, DataFrame, dict of arrays or Record, or a list of them
        One run, or several; a folder stands for the runs in it. Rates that differ by a little are
        brought together. Up to eight runs may differ in the offset
        of the torque, in friction (by a factor) and, if no declared effect depends on theta, in
        the zero of theta. These differences are fitted relative to the first run and reported
        in ``messages``. Four or more runs at a steady speed each, of any rates, are one friction
        map: see :func:`lugrectl.friction_map.diagnose_map`.
    model : Model, Parameters, dict or path
        The declared model; missing values are identified. Files are read with its motion.
    holdout : None, "last", or a record as above
        What is held out: every other block (None), the last half, or another run.
    horizon : float
        Time between restarts of the simulation, s.
    seed : int
        Seed of the random numbers, which only the error of the residual table uses.
    time_limit : float
        Seconds after which the search stops itself; the plain answer stands all the same.
    progress : callable, True, False or None
        ``progress(fraction, what)``, or whether to show a bar. None: in Jupyter only.

    Returns
    -------
    Diagnosis

    Returns a diagnosis with the verdict "refused" where the record cannot say what is missing;
    its ``plain`` then holds what is certain all the same.

    Raises
    ------
    InputError
        When an argument cannot be meant, or a file cannot be read or understood.
    """
    asked = Asked.of(record, model, holdout)
    horizon, seed = judged_by(horizon, seed)
    limit, report = positive(time_limit, "time_limit", "seconds"), reporter(progress)
    report(0.0, "torque balance")
    unlike = asked.plain.unlike  # the plain answer first: it stands whatever follows
    try:
        if unlike:
            raise Refused(" ".join(unlike), SAME_UNITS)
        with within(limit):
            found = _finer(asked, horizon, seed, report)
    except Refused as no:
        return refusal(no, asked.model, asked.seen, asked.plain)
    return with_plain(found, asked)


def _finer(asked: Asked, horizon: float, seed: int, report: Progress) -> Diagnosis:
    """The answer by the likelihood of predictions; Refused where the record cannot give it."""
    record, model = asked.records(), asked.model
    holdout = asked.holdout()
    if not isinstance(record, Record) and is_map(record):
        return diagnose_map(record, model, holdout=holdout, seed=seed, progress=report)
    start = partial(begin, record, model, holdout, horizon, report, plain=asked.plain.values())
    answer = _answered(start, report)
    job, found, new = answer.job, answer.found, answer.unforeseen
    if len(new):
        hidden = signals_of_the_rest(found.final, found.base)
        found = replace(found, unexplained=True, depends_on=hidden)
        job = noted(job, NEW.format(when(found.final, job.parts.test, new)))
    known = None if job.data.late else answer.known  # fitted before the filter was added
    found = behind_a_filter(found)
    report(0.85, "errors on held-out samples")
    scored = score(job, found.final)
    shown = traces(job, found.final, scored["judged"])
    failed = failure(job.data, shown, asked)
    if failed and not found.unexplained:
        raise Refused(failed)  # else what it says, that something is missing, stands all the same
    report(0.92, "parameters and intervals")
    whole = found.final if len(new) else known or on_everything(found.final, job)
    job = compared(job, answer.own or whole)
    flat = unidentified(whole.flat(), "this record")
    many = (MANY,) if whole.noise.uneven else (failed,) if failed else ()
    carried = (CARRIED.format(*(100 * x for x in found.carried)),) if found.carried else ()
    job = noted(job, *flat, *many, *carried, *statements(whole), *openings(found.final))
    verdict, depends = _verdict(found)
    job = noted(job, *at_bounds(whole), *far_off(whole, model))
    job = noted(job, *against_held(whole), *other_optima(whole))
    fitted = estimates(whole)
    if failed:  # curvature at a bad fit says nothing about its errors
        fitted = {k: replace(e, ci95=None) for k, e in fitted.items()}
    effects = [Finding.of(s.trial.key, s.trial.name, fitted, s.tied) for s in found.steps]
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
        estimates=fitted,
        record=job.records[0],
        messages=job.messages,
        ranking=found.ranking,
        traces=shown,
        table=table,
    )


@dataclass(frozen=True)
class _Answer:
    """An explanation, and its check on the held-out samples.

    ``unforeseen``: held-out windows that no values of the explanation predict. ``undated``: only
    the held-out samples show when something changed. ``known``: the fit to all samples, if it
    was needed. ``own``: the fit with offsets of the held-out runs' own, if it was needed.
    """

    job: Job
    found: Explanation
    unforeseen: np.ndarray
    undated: bool
    known: Fitted | None = None
    own: Fitted | None = None


def _answered(start: Callable[..., Job], report: Progress) -> _Answer:
    """The explanation. It is repeated on the position alone if w turns out to be its difference,
    or if a w that had to be resampled leaves something unexplained."""
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
    """Whether theta and w were interpolated and the innovations of both are autocorrelated. A
    missing torque does not cause both (the predictor follows the motion); sensors that
    contradict each other do."""
    interpolated = any(record.resolution for record in job.records)
    both = bool(np.all(job.data.noise.channels()))
    return interpolated and both and min(colour(job.base.quiet)) > AT_ODDS


def _from_start(start: Callable[..., Job], report: Progress) -> _Answer:
    """The explanation, repeated with a shorter lead-in if the first samples are anomalous.

    The repeated one is not used if it loses an effect that the first one found: near the start
    the effect's own state (of a dwell, for instance) is unknown.
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
    """The explanation, with fitted and held-out blocks exchanged if the latter show more.

    If they show only the time of a change, the effects of the first explanation are kept and
    only these are tried.
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
    """The explanation found on the fitted samples, checked on the held-out samples."""
    job, found, wrong = _first_whole(_ways(job, report), report)
    if wrong:
        names = " and ".join(dict.fromkeys(step.trial.name for step in found.steps))
        job, found = noted(job, MISLED.format(names)), without_effects(found)
    job, final, test = replace(job, base=found.base), found.final, job.parts.test
    if found.unexplained:
        return _Answer(job, found, np.array([], dtype=int), False)
    new, known, own = surprising(final, test), None, None
    if len(new):  # the fitted samples may not determine the parameters well enough
        known = on_everything(final, job)
        new = surprising(final, test, known.values)
        # or a held-out run was colder, or its torque has another offset
        own = with_its_own(final, test) if len(new) else None
        doubted = new if own is None else surprising(own, test)
        new = beyond_doubt(final, known, test, doubted)
        own = None if len(new) else own
        if len(doubted) and not len(new):
            job = noted(job, CHANCE.format(when(final, test, doubted)))
    return _Answer(job, found, new, undated(final, test), known, own)


def _first_whole(ways: Iterable[Job], report: Progress) -> tuple[Job, Explanation, bool]:
    """The first explanation that is complete and that held-out windows do not contradict, else
    the first one; and whether they contradict it."""
    tried = []
    for way in ways:
        job, found = _explained(way, report)
        sure = not found.unexplained  # else the effects are a part of the answer at best
        wrong = bool(found.steps) and misled(found.base, found.final, job.parts.test, sure=sure)
        tried.append((job, found, wrong))
        if not (found.unexplained or wrong):
            return tried[-1]
    return tried[0]


def _ways(job: Job, report: Progress) -> Iterator[Job]:
    """The job with the zero of theta of its runs aligned, then with theta, then torque as
    recorded: a missing effect may have been mistaken for a fault of the channel."""
    moved = on_places(job, report)
    if moved is not None:
        yield moved
    yield job
    if job.data.smoothed and job.recorded is not None:
        yield on_torque(job, job.recorded, report)


def _explained(job: Job, report: Progress) -> tuple[Job, Explanation]:
    """The explanation, repeated with another torque if the first effect calls for it."""
    test = job.parts.test
    another = partial(another_torque, recorded=job.recorded)
    found = explain(job.base, report, test, another, job.only)
    if found.other is not None:
        job = on_torque(job, found.other, report)
        found = explain(job.base, report, test, only=job.only)
    final, base = (adapted(f, test, job.declared) for f in (found.final, found.base))
    return job, replace(found, final=final, base=base)


def _table(final: Fitted, job: Job, depends: Sequence[str], seed: int) -> Table | None:
    """The residual torque as a table over what it depends on; None if it predicts nothing."""
    torque = missing_torque(final.predictor, final.values, final.where, job.base.noise)
    made = tabulate(torque, job.data.log, final.where.counted, depends, seed=seed)
    return made if made is not None and made.share95[1] > 0.0 else None


def _verdict(found: Explanation) -> tuple[str, tuple[str, ...]]:
    """The verdict, and the signals on which the effects found or the residual depend."""
    if found.unexplained:
        return "unexplained", found.depends_on
    if not found.steps:
        return "adequate", ()
    tied = any(step.tied for step in found.steps)
    return "ambiguous" if tied else "found", signals_of([step.trial.name for step in found.steps])


_ADVICE = {  # if the residual depends on several of these signals, the first one counts
    "t": "repeat the same run with a cold and a warm drive, and log temperature and load as well",
    "theta": "record slow moves over the same positions, in both directions and at two speeds",
    "a": "record the same move at two accelerations",
    "u": "record the same motion with a known added load, so that torque and motion differ",
    "w": "record constant speeds, from slow to fast, in both directions",
}


def _experiment(verdict: str, effects: Sequence[Finding], depends: Sequence[str]) -> str | None:
    if verdict == "ambiguous":
        said = next(finding for finding in effects if finding.alternatives).apart()
        return f"{said[0].upper()}{said[1:]}."
    if verdict == "unexplained":
        advice = next((said for k, said in _ADVICE.items() if k in depends), _ADVICE["a"])
        return f"To identify the missing effect: {advice}."
    return None
