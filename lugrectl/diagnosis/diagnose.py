"""From a log and a declared model to the named missing effect, or to the fitted model alone."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from time import perf_counter
from typing import Any, ClassVar

import numpy as np
from scipy import signal, stats

from ..blocks.block import members, unit_for
from ..blocks.model import Model
from ..core.blas_threads import one_blas_thread
from ..core.deadline import within
from ..core.display import Row, estimated
from ..core.errors import InputError, Refused
from ..core.progress import Progress, Wanted, reporter, shows_progress
from ..core.provenance import stamped
from ..estimates.findings import Candidate, Estimate, Finding, FrictionMap
from ..estimates.fitted import Belief, Fitted
from ..record import Stretch, stretches
from ..torque_balance.budget import comparison, refuse_unjudged, signals, tabulated
from ..torque_balance.constants import ALPHA, FLOOR, SEVERAL
from ..torque_balance.last_fit import Design, LastFit
from ..torque_balance.maps import MapView, Nodes, Run, is_map
from ..torque_balance.values import alone, completed, model_values, plain_balance
from ..torque_balance.verdict import LAG_NAME, WHOLE_INERTIA, Answer, answer
from .asked import LIMIT, Asked, contradicted, settings, unfit_law
from .compare_laws import under_law
from .result import INERTIA, Diagnosis, moved, next_experiment, noted, refusal, short
from .simulation import Judged, Span, ready_of, residuals, simulated

NO_MOTION = "The errors of a simulation are left out: {} {}"
NO_INERTIA = "The log does not determine the inertia, and none is declared: nothing is simulated."


class Work:
    """From a log and a model to values and errors; Refused where the log cannot answer."""

    def __init__(self, asked: Asked, horizon: float) -> None:
        self.asked, self.start = asked, perf_counter()
        asked.records()
        asked.refuse_open_time()
        self.doubts: Sequence[str] = asked.doubts()
        self.ready, self.why_not = ready_of(asked, horizon)
        self.parts, self.held_out = judged_on(asked, self.ready.held_out if self.ready else ())

    def end(self, made: Answer, least: float) -> Work:
        """The values and errors of what the balance answers."""
        self.made, asked, model = made, self.asked, self.asked.model
        values, found = model_values(made, model), (made.last, made.interval, made.values)
        plain = plain_balance(*found, made.covariance, made.sure, asked.stretches)
        self.sure = "J" in plain.parameters or model.known().get("J") is not None
        self.judged: Judged | None = None
        self.noise: float | None = None
        if self.ready is not None and self.sure:
            done = simulated(self.ready, made, values, least)
            self.judged, values, self.noise, self.why_not = done
        finer = {k: e for k, e in values.estimates.items() if e.ci95 is not None}
        known = {k: finer.get(k, e) for k, e in plain.parameters.items()}
        plain = replace(plain, parameters=known)  # one quantity has one value
        self.plain = asked.completed(plain, perf_counter() - self.start)
        values = values.beside(self.plain)
        self.values = values if self.sure else values.told(model)
        self.law = unfit_law(made, self.values.model, least)
        self.doubts = self.doubts or asked.doubts(self.plain)
        if made.verdict not in ("found", "ambiguous"):  # else what is missing contradicts them
            self.doubts = self.doubts or contradicted(asked.stretches, model)
        return self

    def fields(self, said: Sequence[str] = ()) -> dict[str, Any]:
        """What both kinds of answers have, ``said`` among their messages."""
        made, asked, judged, values = self.made, self.asked, self.judged, self.values
        notes = [*filter(None, [self.law]), *self.doubts, *made.notes]
        if names := ", ".join(dict.fromkeys(made.candidates)):
            notes.append(f"Candidates that are not certain: {names}.")
        if no := self.why_not:
            notes.append(NO_MOTION.format(no, no.experiment or "").rstrip())
        elif not (self.sure or made.view.is_map):
            notes.append(NO_INERTIA)
        notes += [*(judged.messages if judged else ()), *self.plain.notes]
        ready = self.ready if judged else None
        return {
            "error": judged and judged.error,
            "traces": judged and judged.traces,
            "model": values.model,
            "declared": asked.model,
            "estimates": values.estimates,
            "joint": values.joint,
            "record": asked.seen[0],
            "records": tuple(asked.seen),
            "messages": noted(asked, [*notes, *moved(values.estimates, asked.model), *said]),
            "residuals": residuals(ready, values.model) if ready else None,
            "torque_noise": self.noise,
            "plain": self.plain,
        }


# ---- the missing effect


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
    horizon, least, alpha, limit = settings(horizon, seed, least, alpha, time_limit)
    asked = Asked.of(record, model, holdout, **reading)
    try:
        with within(limit):
            return diagnosed(asked, horizon, least, alpha, reporter(progress))
    except Refused as no:
        return refusal(no, asked.model, asked.seen, asked.plain)


def diagnosed(
    asked: Asked, horizon: float, least: float, alpha: float, report: Progress
) -> Diagnosis:
    """The answer; Refused where the record cannot give one."""
    report(0.0, "torque balance")
    work = Work(asked, horizon)
    report(0.1, "comparing explanations")
    made = answer(work.parts, asked.model, work.held_out, least, alpha)
    found = comparison(made, least, alpha)
    refuse_unjudged(found)
    report(0.6, "errors on held-out samples")
    work.end(made, least)
    rows = [row for row in found.rows[1:] if not row.model.startswith("unknown(")]
    ranking = tuple(Candidate(row.model, row.elpd, row.torque) for row in rows)
    effects = _findings(work, ranking)
    of = dict.fromkeys(s for term in made.named for s in signals(term.block))
    verdict, depends_on = made.verdict, tuple(of)
    if verdict == "unexplained":
        depends_on = tuple(made.depends_on)
    if work.law and verdict == "adequate":  # friction depends on w in another way
        verdict, depends_on = "unexplained", ("w",)
    stretches = None if made.view.is_map else found.stretches
    then = next_experiment(verdict, depends_on, effects, work.plain, work.sure)
    said, experiment = short(asked.seen, stretches, then)
    noise = float(np.sqrt(made.view.noise)) * abs(made.values["J"][0])
    answered = Diagnosis(
        verdict=verdict,
        effects=effects,
        depends_on=depends_on,
        experiment=experiment,
        free_error=work.judged.free_error if work.judged else None,
        torque_error=torque_errors(made) | {"noise_floor": min(noise, made.with_names.error)},
        ranking=ranking,
        table=tabulated(made.last, depends_on) if verdict == "unexplained" else None,
        comparison=found,
        rivals=_rivals(work),
        **work.fields(said),
    )
    return of_map(answered, made, asked) if made.view.is_map else answered


def _findings(work: Work, ranking: Sequence[Candidate]) -> tuple[Finding, ...]:
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


def _rivals(work: Work) -> tuple[Belief, ...]:
    """The models that explain the record as well as the first."""
    made, known = work.made, work.values.estimates
    models = [completed(last, made.view.model, made.sure) for last in made.rivals]
    return tuple(Belief.of(m, None, {k: e for k, e in known.items() if k in m.known()},
                           1.0 / (len(models) + 1)) for m in models)  # fmt: skip


# ---- the declared model alone


NOTHING = "no value of the model is certain from this record alone, nor its inertia."


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
        return [*rows, *self._last_rows("declared", "refitted")]


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
    try:
        return identified(asked, settings(horizon, seed)[0], reporter(progress))
    except Refused as no:  # the plain answer stands all the same
        no.plain = asked.plain
        raise


def identified(asked: Asked, horizon: float, report: Progress) -> Identification:
    """The values of the declared model; Refused where the record cannot give any."""
    report(0.0, "torque balance")
    work = Work(asked, horizon)
    made = alone(work.parts, asked.model, work.held_out)
    report(0.4, "errors on held-out samples")
    work.end(made, FLOOR)
    fields = work.fields()
    error = (fields.pop("error") or {}).items()
    error = {k: v for k, v in error if k != "augmented"} or None
    found = Identification(error=error, **fields)
    if not (found.estimates or made.view.is_map):
        raise Refused(NOTHING, INERTIA)
    return of_map(found, made, asked) if made.view.is_map else found


# ---- what a map of runs at steady speeds has beside any other answer: points, curves, ripples


FINE = 400  # speeds at which the curves are drawn
LEAST_TURNS = 2.0  # of a run, so that orders half an order apart are separated
HIGHEST = 8  # order of a turn that is examined
MAP = "{} runs at steady speeds were taken as one map of torque over speed; they do not tell {}."
SWINGS = (
    "The torque varies with the angle: {} of friction. Its phase in the runs is unknown, so it is "
    "not part of the model."
)
SLOWER = "Record runs slower than {:.3g} {}, too: there friction may fall over the speed."
NOT_STEADY = "{} is not at a steady speed like the other runs; hold out one that is, or none."
LOG_ANGLE = (
    "To distinguish {} from {}: log theta from one zero mark in every run, over slow turns in both "
    "directions."
)
Swing = tuple[int, Estimate]


def judged_on(asked: Asked, held_out: Sequence[Span]) -> tuple[list[Stretch], list[Span]]:
    """All stretches, and (run, start, end) in s that are held out: of a map every third run."""
    parts, other = list(asked.stretches), asked.holdout()
    if not is_map(parts) or other is None:
        return parts, list(held_out)
    if isinstance(other, str):
        ends = [[s.t[[0, -1]] for s in parts if s.run == run] for run in range(len(asked.logs))]
        return parts, [(i, float(np.mean([x[0][0], x[-1][1]])), np.inf) for i, x in enumerate(ends)]
    run, log = len(asked.logs), other.log
    assert log is not None
    added = [replace(s, run=run) for s in stretches([log])[0]]
    if not is_map([*parts, *added]):
        raise InputError(NOT_STEADY.format(other.source))
    return [*parts, *added], [(run, -np.inf, np.inf)]


def of_map(found: Any, made: Answer, asked: Asked) -> Any:
    """An answer, of a diagnosis or an identification, with what only a map has."""
    model, motion, view = asked.model, asked.model.motion, made.view
    assert isinstance(view, MapView) and found.model
    swing, error = swings(asked.stretches, unit_for("N m", motion)), torque_errors(made)
    known = {k: e for k, e in found.estimates.items() if e.ci95 is not None or e.held}
    silent = [k for k, p in model.declarations().items() if p.fitted and k not in known]
    values = {k: x for k, x in model.values().items() if k in silent}
    if Fs := values.get("Fs"):  # a declared one stays, but not below Fc
        values["Fs"] = max(Fs, found.model.known()["Fc"])
    fields: dict[str, Any] = {
        "error": error | _facts(view, made, error),
        "estimates": known,
        "map": friction_map(made, motion, swing),
        "model": found.model.with_values(values),
        "messages": (*found.messages, *_said(made, asked, silent, swing)),
    }
    if not isinstance(found, Diagnosis):
        del fields["error"]["augmented"]
        return replace(found, **fields)
    if "vs" in silent and found.experiment is None:
        slow = float(np.abs(view.motion.w).min())
        fields["experiment"] = SLOWER.format(slow, unit_for("rad/s", motion))
    fields["torque_error"] = error
    fields["free_error"] = error | {"signal": "u", "in_sample": False}
    fields["depends_on"] = tuple(s for s in found.depends_on if s != "t")
    return _swung(replace(found, **fields), made, swing)


def _said(
    made: Answer, asked: Asked, silent: Sequence[str], swing: Sequence[Swing]
) -> Iterator[str]:
    """What the map does not tell, and what varies with angle."""
    view = made.view
    hidden = [p.key for p in asked.model.effects if p not in view.model.effects]
    unknown = [k for k in silent if k.rpartition(".")[0] not in hidden] + hidden
    yield MAP.format(len(np.unique(view.motion.run)), ", ".join(unknown) or "J")
    if swing and not any("theta" in t.block.inputs for t in made.last.state.terms):
        share = 100.0 / view.size
        orders = [f"{n} times per turn by {share * e.value:.2g} %" for n, e in swing]
        yield SWINGS.format(", ".join(orders))


def torque_errors(made: Answer) -> dict[str, Any]:
    own = made.declared_error, made.without.error, made.with_names.error
    both = zip(("declared", "refitted", "augmented"), own, strict=True)
    return {"unit": unit_for("N m", made.view.model.motion), **dict(both)}


def _facts(view: MapView, made: Answer, error: Mapping[str, Any]) -> dict[str, Any]:
    """What else is said of errors of means over stretches of the held-out runs."""
    m, known = view.motion, [x for x in error.values() if isinstance(x, float)]
    test = np.isin(m.row, np.flatnonzero(made.split.test))
    return {
        "signal": "u",
        "samples": int(m.size[test].sum()),
        "horizon": float(np.median([np.ptp(m.stamp[m.run == run]) for run in np.unique(m.run)])),
        "noise_floor": min([view.scatter(made.last.left), *known]),
    }


def friction_map(made: Answer, motion: str, swing: Sequence[Swing] = ()) -> FrictionMap:
    """The mean torque of each run without what depends on the angle, and the fits' curves."""
    view, d = made.view, made.last.design
    assert isinstance(view, MapView)
    over_angle = ~_of_speed(d)
    y = d.y - d.X[:, over_angle] @ made.last.fit.b[over_angle]
    test = made.split.test
    part = np.unique(2 * view.apart + test, return_inverse=True)[1]  # of a run, held out or not
    many = np.bincount(part)
    u, square, w, held_out = (
        np.bincount(part, x) / many for x in (y, y**2, view.motion.w[view.rows.at], 1.0 * test)
    )
    error = np.sqrt(np.maximum(square - u**2, 0.0) / np.maximum(many - 1, 1))
    half = np.linspace(np.abs(w).min(), np.abs(w).max(), FINE // 2)
    at = np.concatenate([-half[::-1], half])
    fits = {"refitted": made.refitted, "augmented": made.trained}
    curves = {name: _curve(last, at) for name, last in fits.items()}
    return FrictionMap(w, u, error, held_out > 0.5, at, curves, motion, tuple(swing))


def _of_speed(design: Design) -> np.ndarray:
    """Which columns depend on the speed alone, or on nothing."""
    terms = design.state.terms
    return np.array([n != "~" if isinstance(n, str) else "theta" not in terms[n[0]].block.inputs
                     for n in design.names])  # fmt: skip


def _curve(last: LastFit, w: np.ndarray) -> np.ndarray:
    """Torque (n,) at other speeds (n,), without what depends on the angle."""
    view, one = last.view, np.ones(1)
    runs = [Run(i, float(x), 0.0, one, one, 0 * one, 0 * one, one, np.zeros(1, int))
            for i, x in enumerate(w)]  # fmt: skip
    other = MapView(Nodes(runs, True), view.model)
    other.x0, other.vs, other.force = view.x0, view.vs, view.force
    d, b = Design(other, last.state.copy()), dict(zip(last.design.names, last.fit.b, strict=True))
    return d.X @ np.where(_of_speed(d), [b.get(n, 0.0) for n in d.names], 0.0)


# The ripple over an angle of which each run has its own zero


def swings(parts: Sequence[Stretch], unit: str) -> list[Swing]:
    """The orders of a turn at which the torque swings, largest first, with amplitudes: those whose
    power exceeds that of half an order beside it on either side by more than chance allows,
    whatever the colour of the noise (F tests of the runs, joined as Fisher does)."""
    orders, power = np.arange(1.0, 2 * HIGHEST + 2) / 2.0, []
    for s in parts:
        theta = s.theta
        if theta is None:
            assert s.w is not None
            theta = np.cumsum(s.w) * s.dt
        if np.ptp(theta) >= 2 * np.pi * LEAST_TURNS:
            u = signal.detrend(s.u) * np.hanning(len(s.u)) * 2.0
            power.append(np.abs(2.0 * np.exp(-1j * np.outer(orders, theta)) @ u / len(u)) ** 2)
    many = len(power)
    if many < SEVERAL:
        return []
    every = np.array(power)  # (runs, half orders from 1/2 on)
    own, beside = every[:, 1::2], 0.5 * (every[:, :-1:2] + every[:, 2::2])
    chance = -4.0 * np.sum(np.log1p(-own / (own + 2.0 * beside)), axis=0)
    there = np.flatnonzero(stats.chi2.sf(chance, 2 * many) <= ALPHA / HIGHEST)
    excess = own - beside
    mean, half = excess.mean(axis=0), stats.sem(excess) * stats.t.ppf(0.975, many - 1)
    size = np.sqrt(np.maximum([mean, mean - half, mean + half], 0.0))[:, there].T.tolist()
    found = [
        (i + 1, Estimate(a, unit, (b, c)))
        for i, (a, b, c) in zip(there.tolist(), size, strict=True)
    ]
    return sorted(found, key=lambda one: -one[1].value)


def _swung(found: Diagnosis, made: Answer, swing: Sequence[Swing]) -> Diagnosis:
    """A ripple that is the largest part of what is missing is named by what can cause it: a map
    does not tell its causes apart, nor its phase."""
    shares = [made.last.share(i) for i, t in enumerate(made.last.state.terms) if not t.declared]
    size = swing[0][1].value / np.sqrt(2.0) / made.view.size if swing else 0.0
    known = {*found.depends_on}.union(*(t.block.inputs for t in made.view.terms))
    if found.verdict == "unexplained" or "theta" in known or size < max([FLOOR, *shares]):
        return found
    order, amplitude = swing[0]
    name = "gravity" if order == 1 else "torque_ripple"
    others = [n for n, b in members("effect").items() if not {"J", "torque"} & {*b.acts}
              and any(p.whole and p.low <= order <= p.high for p in b.own.values())]  # fmt: skip
    own = {"amplitude": amplitude}
    own |= {} if order == 1 else {"harmonic": Estimate(float(order), "1/rev")}
    finding = Finding(name, own, tuple(Candidate(n, 0.0, 0.0) for n in others))
    return replace(
        found,
        verdict="ambiguous",
        effects=(*found.effects, finding),
        experiment=LOG_ANGLE.format(name, " or ".join(others)),
        depends_on=(*found.depends_on, "theta"),
    )
