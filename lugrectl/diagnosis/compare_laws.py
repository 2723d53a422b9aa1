"""Friction laws compared on a log: which one predicts best what no fit has seen."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from statistics import NormalDist
from typing import Any

import numpy as np

from ..blocks import AUTO
from ..blocks.block import members, unit_for
from ..blocks.declaration import block_named, listed
from ..blocks.model import Model, as_model, changed
from ..core.blas_threads import one_blas_thread
from ..core.deadline import within
from ..core.display import Grid, grid_html, grid_text, number
from ..core.errors import InputError, Refused
from ..core.progress import Progress, Wanted, reporter, shows_progress
from ..core.regression import paired
from ..core.result import ComparedRows, Fields, library, picked, plain
from ..core.validation import shown
from ..engine.backend import each_beside
from ..torque_balance.constants import ALPHA, SCALE
from ..torque_balance.values import alone, completed, model_values
from .asked import Asked, settings
from .simulation import Prepared, as_it_acts, errors, fitted, loglik, polished, ready_of

OF_MAP = "Runs at steady speeds show no bristle: record motion that reverses to compare laws."
LIMIT = 90.0  # s that the fit of one law may take
SHARED = ("holdout", "horizon", "progress", "columns", "units", "scale", "rate")
CHOSEN = "The friction law {0} was chosen: {1}"
ALONE = "it predicts held-out samples best."
AMONG = "it has the fewest parameters of those that this record cannot distinguish (beside it {0})."


@dataclass(frozen=True)
class ComparedLaw(Fields):
    """One friction law, fitted to the training samples.

    ``elpd`` is the natural logarithm of how much more probable it makes the held-out samples than
    the chosen law does, ``se`` the standard error of that. ``torque`` is the RMS of the held-out
    residual torque in ``unit``, ``error`` that of the simulated motion. ``parameters`` counts the
    free ones. All are None, and ``reason`` says why, where the law could not be fitted.
    """

    name: str
    elpd: float | None = None
    se: float | None = None
    torque: float | None = None
    error: float | None = None
    parameters: int | None = None
    reason: str | None = None


class LawComparison(ComparedRows[ComparedLaw]):
    """The answer of :func:`compare_laws`: rows by place or by name, the best first.

    Parameters
    ----------
    rows : list of ComparedLaw
        One for each law.
    chosen : str
        The simplest law that no other predicts better than.
    alike : list of str
        The laws that this record cannot distinguish from it.
    model : Model
        The declared model with that law and the values that both have.

    Attributes
    ----------
    unit : str
        That of ``torque``.

    Examples
    --------
    What a comparison of two laws looks like:

    >>> rows = [
    ...     lg.results.ComparedLaw("stribeck", elpd=0.0, se=0.0, torque=0.002, parameters=5),
    ...     lg.results.ComparedLaw("viscous", elpd=-800.0, se=25.0, torque=0.2, parameters=2),
    ... ]
    >>> laws = lg.results.LawComparison(rows, "stribeck", [], lg.Model.of(friction="stribeck"))
    >>> laws["viscous"].torque, laws.unit
    (0.2, 'N m')
    >>> laws.sentence
    'The friction law stribeck was chosen: it predicts held-out samples best.'
    """

    def __init__(
        self, rows: Iterable[ComparedLaw], chosen: str, alike: Sequence[str], model: Model
    ) -> None:
        self._rows = tuple(rows)
        self.chosen, self.alike, self.model = chosen, tuple(alike), model
        self.unit = unit_for("N m", model.motion)

    @property
    def sentence(self) -> str:
        """Which law was chosen, and why."""
        others = ", ".join(self.alike)
        return CHOSEN.format(self.chosen, AMONG.format(others) if others else ALONE)

    def summary(self) -> dict[str, Any]:
        """Plain Python: the chosen law, those as good, a dictionary for each law."""
        return picked(self, "chosen alike unit") | {"laws": plain(self._rows)}

    def to_frame(self) -> Any:
        """A DataFrame with the names as index; InputError without pandas."""
        return library("pandas").DataFrame(plain(self._rows)).set_index("name")

    def grid(self) -> Grid:
        """The table as it is shown."""
        head = ("law", "predicts better by", "+-", f"torque [{self.unit}]", "parameters")
        return Grid(head, "lrrrr", tuple(map(self._cells, self)))

    def _cells(self, row: ComparedLaw) -> tuple[str, ...]:
        if row.elpd is None:
            return (row.name, "not fitted", "", "", "")
        gain = ("0", "") if row.name == self.chosen else (f"{row.elpd:,.1f}", f"{row.se:,.1f}")
        return (row.name, *gain, number(row.torque, 3), str(row.parameters))

    def __repr__(self) -> str:
        return "\n".join([self.sentence, *grid_text(self.grid())])

    def _repr_html_(self) -> str:
        return f"<p>{self.sentence}</p>{grid_html(self.grid())}"


Fit = tuple[ComparedLaw, np.ndarray]  # of one law, and how well it predicts each held-out window


@shows_progress
@one_blas_thread()
def compare_laws(
    record: Any,
    model: Any,
    laws: Sequence[str] | str | None = None,
    *,
    holdout: Any = None,
    horizon: float = 1.0,
    alpha: float = ALPHA,
    time_limit: float = LIMIT,
    columns: Mapping[str, str] | str | None = None,
    units: Mapping[str, str] | str | None = None,
    scale: Mapping[str, float] | str | None = None,
    rate: float | None = None,
    progress: Wanted = None,
) -> LawComparison:
    """Fit a drive with each friction law, and choose the simplest that predicts as well as any.

        elpd = sum over held-out windows of log p(window | law) - log p(window | chosen law)

    p is the density of the one-step predictions (innovations) of the fitted law. A law is left
    out of the choice if another is better by more than the standard error over the windows allows
    (one-sided, ``alpha``), unless its torque error is below 0.3 % of u: no sensor is better. Of
    those that stay, the one with the fewest free parameters is chosen.
    An effect that is missing from the model is missing beside every law; a law that imitates it
    may be chosen for that. ``diagnose(..., law="auto")`` therefore finds the effects first.

    Parameters
    ----------
    record, model, holdout, horizon
        As for :func:`lugrectl.diagnose`. Values of the declared law are kept in laws that have
        them; all others are fitted.
    laws : names, a name or None
        Those to compare, as :func:`lugrectl.laws` lists them; None: all.
    alpha : float
        Chance that a law is left out although it predicts as well as the best.
    time_limit : float
        Seconds that the fit of one law may take; one that takes longer is left out.
    columns, units, scale, rate : optional
        How to read logs and holdout, as for :func:`lugrectl.read_record`.
    progress : callable, True, False or None
        As for :func:`lugrectl.diagnose`.

    Returns
    -------
    LawComparison
        A row for each law; ``print`` shows a table, ``to_frame`` gives a DataFrame.

    Raises
    ------
    InputError
        When an argument cannot be meant, or a file cannot be read or understood.
    Refused
        When no law can be fitted to this record.

    Examples
    --------
    A made-up log of a drive with Coulomb and viscous friction:

    >>> t = 4e-3 * np.arange(3000)
    >>> w = np.sin(np.pi * t) + 0.5 * np.sin(8.0 * t)
    >>> noise = 0.002 * np.random.default_rng(0).standard_normal(3000)
    >>> u = 0.002 * np.gradient(w, t) + 0.3 * np.tanh(w / 1e-3) + 0.02 * w + noise
    >>> laws = lg.compare_laws({"t": t, "u": u, "w": w}, {"J": 0.002}, ["coulomb", "viscous"])
    >>> laws.chosen
    'coulomb'
    """
    horizon, _, alpha, limit = settings(horizon, alpha=alpha, time_limit=time_limit)
    names, bar = law_names(laws), NormalDist().inv_cdf(1.0 - alpha)
    reading = {"columns": columns, "units": units, "scale": scale, "rate": rate}
    asked = Asked.of(record, model, holdout, **reading)
    report = reporter(progress)
    report(0.0, "torque balance")
    asked.records()
    asked.refuse_open_time()
    ready, no = ready_of(asked, horizon)
    if ready is None:
        raise no or Refused(OF_MAP)
    least = SCALE * max(float(np.std(run.u)) for run in ready.runs)
    return _chosen(_fitted(ready, asked, names, limit, report), asked.model, bar, least)


def under_law(work: Callable[..., Any], record: Any, model: Any, law: Any, **options: Any) -> Any:
    """The answer of ``work`` under another friction law; for "auto" the best one beside the effects
    that are found under the declared law: a law must not imitate an effect that is missing."""
    if law != AUTO:
        return work(record, changed(model, {"friction": law}, "law"), **options)
    first, declared = work(record, model, **options), as_model(model)
    beside = declared
    for finding in first.effects if first.verdict == "found" else ():
        values = {k: e.value for k, e in finding.parameters.items()}
        beside = beside.with_effect(finding.name, values)
    shared = {k: v for k, v in options.items() if k in SHARED}
    shared["time_limit"] = min(options.get("time_limit", LIMIT), LIMIT)
    try:
        laws = compare_laws(record, beside, **shared)
    except Refused:  # then the first answer says why
        return first
    if laws.chosen != declared.friction.block.name:
        first = work(record, changed(declared, {"friction": laws.chosen}, "law"), **options)
    return replace(first, laws=laws)


def law_names(given: Any) -> list[str]:
    """The names of laws: of all where None is given; InputError for one that does not exist."""
    names = list(members("friction")) if given is None else listed("friction", given)
    if not (isinstance(names, Iterable) and names):
        raise InputError(f"laws must be names of friction laws, not {shown(given)}.")
    of = {"where": "laws", "what": "friction law"}
    return list(dict.fromkeys(block_named("friction", name, **of).name for name in names))


def _fitted(
    ready: Prepared, asked: Asked, names: Sequence[str], limit: float, report: Progress
) -> list[Fit]:
    """The fits of the laws, side by side; of one that cannot be fitted the reason."""

    def one(name: str) -> Fit:
        try:
            with within(limit):
                return _fit(ready, asked, name)
        except (Refused, InputError) as no:
            return ComparedLaw(name, reason=str(no)), np.zeros(0)

    fits: list[Fit] = []
    for fit in each_beside(one, names):
        fits.append(fit)
        report(0.1 + 0.9 * len(fits) / len(names), f"friction laws, {len(fits)} of {len(names)}")
    return fits


def _fit(ready: Prepared, asked: Asked, name: str) -> Fit:
    """A law at its likeliest values by training samples, and what it predicts of the others."""
    model = changed(asked.model, {"friction": name}, "laws")
    made = alone(asked.stretches, model, ready.held_out)
    ready = as_it_acts(replace(ready, model=model, memory={}), made)
    trained = completed(made.trained, model, made.sure)
    values = polished(ready, trained, model_values(made, model))[0]
    own, held = model.declarations(), model.held()
    free = [k for k in values.known() if own[k].fitted and not own[k].usual and k not in held]
    fit = fitted(ready, values)
    windows = loglik(ready, fit.drive, [fit.values], [fit.jump], "test")[0]
    judged = errors(ready, {"refitted": values})
    torque, error = judged.torque_error["refitted"], judged.error["refitted"]
    row = ComparedLaw(name, torque=torque, error=error, parameters=len(free))
    return row, np.nan_to_num(windows, nan=-1e300)


def _chosen(made: Sequence[Fit], model: Model, bar: float, least: float) -> LawComparison:
    """The simplest of the laws that predict as well, or leave less than any sensor can tell."""
    refused = [row for row, _ in made if row.reason]
    fits = sorted((one for one in made if not one[0].reason), key=lambda one: -one[1].sum())
    if not fits:
        raise Refused(refused[0].reason or "")
    gains = [paired(fits[0][1], windows) for _, windows in fits]
    able = [one for one, (gain, se) in zip(fits, gains, strict=True)
            if gain <= bar * se or (one[0].torque or np.inf) < least]  # fmt: skip
    simplest, windows = min(able, key=lambda one: one[0].parameters or 0)
    n, rows = len(windows) ** 0.5, list[ComparedLaw]()
    for row, own in fits:  # with what each window gains over the chosen law
        gain = own - windows
        error = float(n * np.std(gain, ddof=1)) if gain.any() else 0.0
        rows.append(replace(row, elpd=float(gain.sum()), se=error))
    alike = [row.name for row, _ in able if row is not simplest]
    chosen = changed(model, {"friction": simplest.name}, "laws")
    return LawComparison([*rows, *refused], simplest.name, alike, chosen)
