"""From a log and a declared model to the named missing effect, or to the fitted model alone."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from ..blocks.model import Model
from ..core.blas_threads import one_blas_thread
from ..core.deadline import within
from ..core.display import Row, estimated
from ..core.errors import Refused
from ..core.progress import Progress, Wanted, reporter, shows_progress
from ..core.provenance import stamped
from ..core.validation import positive, share
from ..estimates.comparison import Comparison
from ..estimates.findings import Candidate, Estimate, Finding
from ..estimates.fitted import Fitted
from ..estimates.members import Belief
from ..torque_balance.budget import comparison, refuse_unjudged, signals, tabulated
from ..torque_balance.constants import ALPHA, FLOOR
from ..torque_balance.values import alone, completed
from ..torque_balance.verdict import LAG_NAME, WHOLE_INERTIA, Answer, answer
from .asked import Asked, judged_by
from .balanced import Begun, Ended
from .compare_laws import under_law
from .mapped import of_map, torque_errors
from .result import INERTIA, Diagnosis, longer, next_experiment, refusal, short

NO_MOTION = "The errors of a simulation are left out: {} {}"
WORSE = (
    "On held-out samples the simulation with the added effect misses the motion by {0:.3g} {2}, "
    "without it by {1:.3g}: the torque error falls, the motion error does not."
)
LIMIT = 270.0  # s that the answer may take


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
    least: float = FLOOR,
    alpha: float = ALPHA,
    time_limit: float = LIMIT,
    law: str | None = None,
    columns: Mapping[str, str] | str | None = None,
    units: Mapping[str, str] | str | None = None,
    scale: Mapping[str, float] | str | None = None,
    rate: float | None = None,
    progress: Wanted = None,
) -> Diagnosis:
    """Find the physical effect that is missing from a declared model, from a log.

    Whatever may be missing is a row of one table: each effect of the catalogue, and an unknown
    torque over some signals, beside the declared model with free values. A row counts by how well
    it predicts parts of the log that its fit has not seen. What is named must hold in a last fit
    to all samples, which gives the values, and lower the torque error of held-out samples. On a
    clean log a fit by one-step predictions refines the values: where the torque that it does not
    predict is below ``least``. Errors are those of simulations from the recorded torque alone, on
    held-out samples; they decide nothing, and their fit has not used these samples.

    Parameters
    ----------
    record : path, DataFrame, dict of arrays or Record, or a list of them
        One run, or several; a folder stands for the runs in it. Runs may differ in their rates,
        and in the offset of the torque, which is fitted relative to the first run. Four or more
        runs at a steady speed each are one friction map: friction, and what depends on speed and
        angle, from their mean torques.
    model : Model, Parameters, dict or path
        The declared model; missing values are identified. Files are read with its motion.
    holdout : None, "last", or a record as above
        What is held out: every other block (None), the last half, or another run.
    horizon : float
        Time between restarts of the simulation, s.
    seed : int
        Without effect: nothing in an answer is drawn at random.
    least : float
        The smallest torque that matters, as a share of RMS friction torque.
    alpha : float
        Chance that a gain in likelihood, of blocks that a fit has not seen, is called proven and
        is none.
    time_limit : float
        Seconds after which the fit stops itself; the comparison and the plain answer stand.
    law : str or None
        Friction law in place of the model's, a name of :func:`lugrectl.laws`; values that both have
        are kept. "auto": the one that :func:`lugrectl.compare_laws` chooses beside the effects.
    columns, units, scale, rate : optional
        How to read logs and holdout, as for :func:`lugrectl.read_record`.
    progress : callable, True, False or None
        ``progress(fraction, what)``, or whether to show a bar. None: in Jupyter only.

    Returns
    -------
    Diagnosis
        With the verdict "refused" where the record cannot say what is missing; its ``plain`` then
        holds what is certain all the same.

    Raises
    ------
    InputError
        When an argument cannot be meant, or a file cannot be read or understood.

    Examples
    --------
    Ten runs at steady speeds of a made-up fan drive, of which the declared model contains only
    Coulomb and viscous friction:

    >>> noise = 0.002 * np.random.default_rng(0).standard_normal((10, 200))
    >>> speeds = [-3.0, -2.0, -1.0, -0.5, 0.5, 1.0, 2.0, 3.0, 4.0, 5.0]
    >>> runs = [
    ...     {"t": 5e-3 * np.arange(200), "w": w + 0.5 * e,
    ...      "u": 0.3 * np.sign(w) + 0.02 * w + 0.004 * w * abs(w) + e}
    ...     for w, e in zip(speeds, noise)
    ... ]
    >>> model = lg.Model.of(J=0.0022, friction="coulomb", Fc=0.3, Fv=0.02)
    >>> found = lg.diagnose(runs, model)
    >>> found.verdict, found.effects[0].name
    ('found', 'quadratic_drag')
    >>> round(found.effects[0].parameters["coefficient"].value, 3)  # N m s2/rad2
    0.004

    A log of one motion, in a file beside a model file:

    >>> print(lg.diagnose("axis.csv", "axis.toml"))  # doctest: +SKIP
    """
    reading = {"columns": columns, "units": units, "scale": scale, "rate": rate}
    if law is not None:
        options = {"least": least, "alpha": alpha, "time_limit": time_limit, "progress": progress}
        options |= {"holdout": holdout, "horizon": horizon, "seed": seed, **reading}
        return under_law(diagnose, record, model, law, **options)
    limits = share(least, "least"), share(alpha, "alpha")
    limit, report = positive(time_limit, "time_limit", "seconds"), reporter(progress)
    asked = Asked.of(record, model, holdout, **reading)
    horizon, _ = judged_by(horizon, seed)
    try:
        with within(limit):
            return diagnosed(asked, horizon, *limits, report)
    except Refused as no:
        return refusal(no, asked.model, asked.seen, asked.plain)


def diagnosed(
    asked: Asked, horizon: float, least: float, alpha: float, report: Progress
) -> Diagnosis:
    """The answer; Refused where the record cannot give one."""
    report(0.0, "torque balance")
    begun = Begun.of(asked, horizon)
    report(0.1, "comparing explanations")
    made = answer(begun.parts, asked.model, begun.held_out, least, alpha)
    found = comparison(made, least, alpha)
    refuse_unjudged(found)
    report(0.6, "errors on held-out samples")
    work = begun.ended(made, least)
    ranking = _ranking(found)
    effects = _findings(work, ranking)
    verdict, depends_on = made.verdict, _signals(made)
    if work.law and verdict == "adequate":  # friction depends on w in another way
        verdict, depends_on = "unexplained", ("w",)
    stretches = None if made.view.is_map else found.stretches
    then = next_experiment(verdict, depends_on, effects, work.plain, work.sure)
    notes = [*work.notes(NO_MOTION), *_worse(work), *work.plain.notes, *work.changes()]
    fields = work.fields([*notes, *short(asked.seen, stretches)])
    noise = float(np.sqrt(made.view.noise)) * abs(made.values["J"][0])
    answered = Diagnosis(
        verdict=verdict,
        effects=effects,
        depends_on=depends_on,
        experiment=longer(asked.seen, stretches, then),
        free_error=work.judged and work.judged.free_error,
        torque_error=torque_errors(made) | {"noise_floor": min(noise, made.with_names.error)},
        ranking=ranking,
        table=tabulated(made.last, depends_on) if verdict == "unexplained" else None,
        comparison=found,
        rivals=_rivals(work),
        **fields,
    )
    return of_map(answered, made, asked) if made.view.is_map else answered


def _findings(work: Ended, ranking: Sequence[Candidate]) -> tuple[Finding, ...]:
    """The effects with their values and the alternatives to each."""
    made, known = work.made, work.values.estimates
    tried = {c.name: c for c in reversed(ranking)}

    def finding(name: str, key: str, own: Mapping[str, Estimate]) -> Finding:
        others = made.alternatives.get(key, ())
        return Finding(name, own, tuple(tried.get(n, Candidate(n, 0.0, 0.0)) for n in others))

    effects = [finding(WHOLE_INERTIA, WHOLE_INERTIA, {})] if made.only_inertia else []
    if made.lag is not None:
        lag = Estimate(made.lag[0], "s", made.lag[1:])
        effects.append(Finding(LAG_NAME, {"time_constant": lag}))
    declared = {p.key for p in work.asked.model.effects}  # a map shows some of them only
    for part in work.values.model.effects:
        if part.key not in declared:
            own = {k: e for k in part.block.own if (e := known.get(f"{part.key}.{k}")) is not None}
            effects.append(finding(part.block.name, part.key, own))
    return tuple(effects)


def _ranking(found: Comparison) -> tuple[Candidate, ...]:
    rows = [row for row in found.rows[1:] if not row.model.startswith("unknown(")]
    return tuple(Candidate(row.model, row.elpd, row.torque) for row in rows)


def _signals(made: Answer) -> tuple[str, ...]:
    if made.verdict == "unexplained":
        return tuple(made.depends_on)
    return tuple(dict.fromkeys(s for t in made.named for s in signals(t.block)))


def _rivals(work: Ended) -> tuple[Belief, ...]:
    """The models that explain the record as well as the first."""
    made, known = work.made, work.values.estimates
    models = [completed(last, made.view.model, made.sure) for last in made.rivals]
    return tuple(Belief.of(m, None, {k: e for k, e in known.items() if k in m.known()},
                           1.0 / (len(models) + 1)) for m in models)  # fmt: skip


def _worse(work: Ended) -> list[str]:
    """A sentence where what is named raises the error of the simulated motion."""
    error = work.judged.error if work.judged and (work.made.named or work.made.parts) else {}
    before, after = error.get("refitted"), error.get("augmented")
    if before is None or after is None or after <= before:
        return []
    return [WORSE.format(after, before, error["unit"])]


# ---- the declared model alone


NOTHING = "no value of the model is certain from this record alone, nor its inertia."
ONLY_PLAIN = "The values are those of the torque balance alone, without errors of a simulation: {}"


@dataclass(frozen=True, repr=False, kw_only=True)
class Identification(Fitted):
    """Fitted parameters of the declared structure, with the errors before and after.

    Where only the torque balance can answer, ``error`` is None and ``estimates`` holds what it
    is certain of; ``plain`` is that balance in any case.
    """

    model: Model
    verdict: ClassVar[str] = "identified"  # for reports and plots: nothing was added
    effects: ClassVar[tuple[()]] = ()
    depends_on: ClassVar[tuple[()]] = ()

    def summary(self) -> dict[str, Any]:
        """Plain Python; never NaN or Infinity."""
        return self._document()

    def _title(self) -> str:
        return f"Identification: {self.model.name}"

    def _rows(self) -> Iterable[Row]:
        rows = [estimated(k, e) for k, e in self.estimates.items()]
        return [*rows, *self._error_rows(("declared", "refitted")), *self._last_rows()]


@shows_progress
@one_blas_thread()
@stamped("lugrectl.identify")
def identify(
    record: Any,
    model: Any,
    *,
    holdout: Any = None,
    horizon: float = 1.0,
    seed: int = 0,
    law: str | None = None,
    columns: Mapping[str, str] | str | None = None,
    units: Mapping[str, str] | str | None = None,
    scale: Mapping[str, float] | str | None = None,
    rate: float | None = None,
    progress: Wanted = None,
) -> Identification:
    """Fit the parameters of a declared model, without looking for missing effects.

    The values are those of the balances that :func:`lugrectl.diagnose` compares or, where the log
    is clean, of a fit by one-step predictions. An effect that is missing biases them.

    Parameters
    ----------
    record, model, holdout, horizon, seed, law, columns, units, scale, rate, progress
        As for :func:`lugrectl.diagnose`; missing values of the model are identified.

    Returns
    -------
    Identification
        Fitted values with 95 % intervals, the errors before and after, the model with these values.

    Raises
    ------
    InputError
        When an argument cannot be meant, or a file cannot be read or understood.
    Refused
        When nothing is certain from this record; ``plain`` of the error says why.

    Examples
    --------
    A made-up log of a drive of which only J is known:

    >>> t = 1e-2 * np.arange(400)
    >>> w = np.sin(np.pi * t) + 0.5 * np.sin(8.0 * t)
    >>> u = 0.002 * np.gradient(w, t) + 0.3 * np.tanh(w / 1e-3) + 0.02 * w
    >>> model = lg.Model.of(J=0.002, friction="coulomb")
    >>> fit = lg.identify({"t": t, "u": u, "w": w}, model)
    >>> round(fit.model.friction.values["Fc"], 2)
    0.3
    """
    reading = {"columns": columns, "units": units, "scale": scale, "rate": rate}
    if law is not None:
        options = {"holdout": holdout, "horizon": horizon, "seed": seed, "progress": progress}
        return under_law(identify, record, model, law, **options, **reading)
    asked = Asked.of(record, model, holdout, **reading)
    horizon, _ = judged_by(horizon, seed)
    try:
        return identified(asked, horizon, reporter(progress))
    except Refused as no:  # the plain answer stands all the same
        no.plain = asked.plain
        raise


def identified(asked: Asked, horizon: float, report: Progress) -> Identification:
    """The values of the declared model; Refused where the record cannot give any."""
    report(0.0, "torque balance")
    begun = Begun.of(asked, horizon)
    made = alone(begun.parts, asked.model, begun.held_out)
    report(0.4, "errors on held-out samples")
    work = begun.ended(made, FLOOR)
    notes = work.notes(ONLY_PLAIN)
    fields = work.fields([*notes, *work.changes(), *work.plain.notes])
    error = (fields.pop("error") or {}).items()
    error = {k: v for k, v in error if k != "augmented"} or None
    found = Identification(error=error, **fields)
    if not (found.estimates or made.view.is_map):
        raise Refused(NOTHING, INERTIA)
    return of_map(found, made, asked) if made.view.is_map else found
