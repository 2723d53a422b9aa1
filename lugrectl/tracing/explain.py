"""Effects added one after another, as long as the gain is proven on the training windows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from ..block import members
from ..model import Model
from ..results import Candidate
from .evaluate import missing_torque
from .fit import Fitted, fit, free_keys
from .job import Progress
from .predictor import Predictor
from .search import Contest, Trial, contest
from .structure import Dependence, dependences

GATE = 20.0  # least gain in log-likelihood, also without the best window
LEAST_SHARE = 0.04  # of the residual torque's power that an effect must remove
LEAST_SIZE = 0.015  # of the RMS friction torque, below which an effect is not worth a name
LEFT_SHARE = 0.05  # of the first residual's power that may still hang on a signal
LEFT_SIZE = 0.003  # of the torque's standard deviation, below which nothing is worth a word
MOST_EFFECTS = 3
TRIED = 4  # candidates fitted in full at each step


@dataclass(frozen=True)
class Step:
    """One effect accepted, and what explains the training windows equally well."""

    trial: Trial
    fitted: Fitted
    tied: tuple[Candidate, ...]


@dataclass(frozen=True)
class Explanation:
    """Accepted effects, the final model with them inside, and what is left.

    ``left`` is the dependence that still stands out, None where nothing does.
    """

    steps: tuple[Step, ...]
    final: Fitted
    ranking: tuple[Candidate, ...]
    left: Dependence | None


def explain(base: Fitted, report: Progress) -> Explanation:
    """Add the best effect, refit everything, look again, until nothing proven is left."""
    steps: list[Step] = []
    ranking: list[Candidate] = []
    current = base
    for turn in range(MOST_EFFECTS):
        at = 0.15 + 0.7 * turn / MOST_EFFECTS
        report(at, f"trying the catalogue, round {turn + 1}")
        names = _names(current.predictor.model)
        tried = contest(current, names, 0.5 * GATE, TRIED, partial(report, at))
        if turn == 0:
            ranking = _ranking(current, tried)
        proven = [(t, f) for t, f in tried.fits if _proven(current, f, t.key)]
        if not proven:
            break
        trial, best = max(proven, key=lambda pair: pair[1].total)
        steps.append(Step(trial, best, _ties(current, best, tried.fits)))
        current = _inside(best)
    return Explanation(tuple(steps), current, tuple(ranking), _left_over(base, current))


def _names(model: Model) -> list[str]:
    """Effects worth trying: a second of a kind only where it can differ (another harmonic)."""
    used = {part.block.name for part in model.effects}
    return [
        name
        for name, made in members("effect").items()
        if name not in used or any(p.grid and p.unit != "s" for p in made.parameters.values())
    ]


def _proven(before: Fitted, after: Fitted, key: str) -> bool:
    gain = after.loglik - before.loglik
    certain = gain.sum() - max(gain.max(), 0.0) > GATE
    return certain and _share(before, after) > LEAST_SHARE and size(after, key) > LEAST_SIZE


def size(fitted: Fitted, key: str) -> float:
    """RMS torque that an effect makes along the training windows, over that of friction."""
    predictor, at = fitted.predictor, fitted.where.counted.ravel()
    model = predictor.model
    part = next(p for p in model.effects if p.key == key)
    off = {f"{key}.{part.block.gain}": part.block.parameters[part.block.gain].neutral}
    change = predictor.torque(fitted.values) - predictor.torque(fitted.values | off)
    friction = predictor.friction(fitted.values)
    return float(np.std(change[at]) + abs(np.mean(change[at]))) / float(
        np.sqrt(np.mean(friction[at] ** 2))
    )


def _share(before: Fitted, after: Fitted) -> float:
    """Part of the residual torque's power that is gone."""
    return 1.0 - (after.torque_noise / before.torque_noise) ** 2


def _ranking(base: Fitted, tried: Contest) -> list[Candidate]:
    full = {t.name: f for t, f in tried.fits}
    made = []
    for t in tried.trials:
        f = full.get(t.name)
        values = f.values if f else t.values
        own = {k.split(".", 1)[1]: v for k, v in values.items() if k.startswith(t.key + ".")}
        score = f.total - base.total if f else t.promise
        made.append(Candidate(t.name, score, _share(base, f) if f else 0.0, own))
    return sorted(made, key=lambda c: -c.score)


def _ties(
    before: Fitted, best: Fitted, fits: Sequence[tuple[Trial, Fitted]]
) -> tuple[Candidate, ...]:
    """Others that explain the training windows as well within two standard errors."""
    tied = []
    for trial, fitted in fits:
        lead = best.loglik - fitted.loglik
        error = float(np.std(lead, ddof=1)) * np.sqrt(len(lead))
        even = lead.sum() < max(3.0, 2.0 * error)
        if fitted is not best and even and _proven(before, fitted, trial.key):
            score = fitted.total - before.total
            tied.append(Candidate(trial.name, score, _share(before, fitted)))
    return tuple(tied)


def _inside(found: Fitted) -> Fitted:
    """The same model with its effects inside the plant, fitted once more."""
    predictor = Predictor(found.predictor.model, found.predictor.data)
    free = free_keys(predictor)
    return fit(predictor, found.values, free, found.where, found.noise, anchor=found.anchor)


def _left_over(base: Fitted, final: Fitted) -> Dependence | None:
    """What the residual torque still hangs on, if that is more than a trifle."""
    data = base.predictor.data
    before = missing_torque(base.predictor, base.values, base.where, base.noise)
    after = missing_torque(final.predictor, final.values, final.where, base.noise)
    now = dependences(after, data.log, final.where.counted)[0]
    share = now.share * float(np.mean(after**2) / np.mean(before**2))
    size = LEFT_SIZE * float(np.std(data.u))
    return now if now.t > 3.0 and share > LEFT_SHARE and now.rms > size else None
