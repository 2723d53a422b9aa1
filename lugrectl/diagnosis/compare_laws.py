"""Friction laws compared on a log: which one predicts best what no fit has seen."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from statistics import NormalDist
from typing import Any

import numpy as np

from ..blocks import AUTO
from ..blocks.aliases import listed
from ..blocks.block import members
from ..blocks.model import Model, as_model, changed
from ..core.deadline import within
from ..core.errors import InputError, Refused
from ..core.progress import Progress, Wanted, reporter, shows_progress
from ..core.regression import paired
from ..core.validation import positive, share, shown
from ..engine.runtime.threads import each_beside
from ..parallel.blas_threads import one_blas_thread
from ..torque_balance.base import alone
from ..torque_balance.constants import ALPHA
from .asked import Asked, judged_by
from .balanced import as_it_acts, polished_values, ready_of
from .law_comparison import ComparedLaw, LawComparison
from .simulation import Prepared, errors
from .simulation.drive import fitted, loglik

OF_MAP = (
    "Runs at a steady speed each show no bristle: friction laws cannot be compared on them.",
    "Record motion that reverses.",
)
LIMIT = 90.0  # s that the fit of one law may take
SHARED = ("holdout", "horizon", "progress", "columns", "units", "scale", "rate")


@dataclass(frozen=True)
class _Fit:
    """A law's fit and how well it predicts each held-out window."""

    name: str
    windows: np.ndarray
    torque: float
    error: float
    parameters: int


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
    (one-sided, ``alpha``); of those that stay, the one with the fewest free parameters is chosen.
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
    horizon, _ = judged_by(horizon, 0)
    names, bar = law_names(laws), NormalDist().inv_cdf(1.0 - share(alpha, "alpha"))
    limit = positive(time_limit, "time_limit", "seconds")
    reading = {"columns": columns, "units": units, "scale": scale, "rate": rate}
    asked = Asked.of(record, model, holdout, **reading)
    report = reporter(progress)
    report(0.0, "torque balance")
    asked.records()
    asked.refuse_open_time()
    ready, no = ready_of(asked, horizon)
    if ready is None:
        raise no or Refused(*OF_MAP)
    fits, refused = _fitted(ready, asked, names, limit, report)
    return _chosen(fits, refused, asked.model, bar)


def under_law(work: Callable[..., Any], record: Any, model: Any, law: Any, **options: Any) -> Any:
    """The answer of ``work`` under another friction law; under the best one for "auto".

    Laws are compared beside the effects that are found under the declared one: a law must not
    imitate an effect that is missing.
    """
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
    known = list(members("friction"))
    if given is None:
        return known
    names = listed("friction", given)
    if not (isinstance(names, Iterable) and names):
        raise InputError(f"laws must be names of friction laws, not {shown(given)}.")
    for name in names:
        if name not in known:
            raise InputError(f"unknown friction law {shown(name)}; known: {', '.join(known)}.")
    return list(dict.fromkeys(names))


def _fitted(
    ready: Prepared, asked: Asked, names: Sequence[str], limit: float, report: Progress
) -> tuple[list[_Fit], dict[str, str]]:
    """The fits of the laws, side by side, and why others could not be fitted."""

    def one(name: str) -> _Fit | str:
        try:
            with within(limit):
                return _fit(ready, asked, name)
        except (Refused, InputError) as no:
            return str(no)

    fits, refused = [], {}
    report(0.1, f"friction law {names[0]}")
    for i, (name, found) in enumerate(zip(names, each_beside(one, names), strict=True), 1):
        if isinstance(found, str):
            refused[name] = found
        else:
            fits.append(found)
        report(0.1 + 0.9 * i / len(names), f"friction law {names[min(i, len(names) - 1)]}")
    if not fits:
        raise Refused(next(iter(refused.values())))
    return fits, refused


def _fit(ready: Prepared, asked: Asked, name: str) -> _Fit:
    """A law at its likeliest values by training samples, and what it predicts of the others."""
    model = changed(asked.model, {"friction": name}, "laws")
    made = alone(asked.stretches, model, ready.held_out)
    ready = as_it_acts(replace(ready, model=model, memory={}), made)
    values = polished_values(ready, made)
    own = model.declarations()
    free = [
        k for k in values.known() if own[k].fitted and not own[k].usual and k not in model.held()
    ]
    fit = fitted(ready, values)
    each = loglik(ready, fit.drive, [fit.values], [fit.jump], ready.test)[0]
    judged = errors(ready, {"refitted": values})
    torque, error = judged.torque_error["refitted"], judged.error["refitted"]
    return _Fit(name, np.nan_to_num(each, nan=-1e300), torque, error, len(free))


def _chosen(
    fits: Sequence[_Fit], refused: Mapping[str, str], model: Model, bar: float
) -> LawComparison:
    best = max(fits, key=lambda f: f.windows.sum())
    able = [f for f in fits if f is best or not beaten(best.windows, f.windows, bar)]
    simplest = min(able, key=lambda f: (f.parameters, -f.windows.sum()))
    rows = [_row(f, simplest) for f in sorted(fits, key=lambda f: -f.windows.sum())]
    rows += [ComparedLaw(name, reason=why) for name, why in refused.items()]
    alike = [f.name for f in able if f is not simplest]
    made = changed(model, {"friction": simplest.name}, "laws")
    return LawComparison(rows, simplest.name, alike, made)


def beaten(best: np.ndarray, other: np.ndarray, bar: float) -> bool:
    """Whether windows are predicted better by more than chance allows."""
    gain, se = paired(best, other)
    return gain > bar * se


def _row(f: _Fit, chosen: _Fit) -> ComparedLaw:
    d = f.windows - chosen.windows
    se = float(np.sqrt(len(d)) * np.std(d, ddof=1)) if f is not chosen else 0.0
    return ComparedLaw(f.name, float(d.sum()), se, f.torque, f.error, f.parameters)
