"""Encoder zero of each run: theta is shifted until periodic effects agree between the runs.

An incremental encoder starts every run at an arbitrary zero.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..spec import members
from .data import Data
from .fit import Fitted, again, tuned
from .proof import GATE
from .runs import MOST_RUNS, alike, knows_places, orders, repeats
from .score import Score
from .screening import lightened, placed_at, screen
from .search import refine
from .windows import Windows

TRIED = 6  # periodic effects that are fitted
STEPS = 15  # iterations of such a fit


@dataclass(frozen=True)
class _Way:
    """Shifts of theta by run that align an effect which repeats ``order`` times per 2 pi."""

    name: str
    order: float
    zeros: dict[int, float]


def agreeing(base: Fitted, test: Windows) -> Data | None:
    """Data with theta of each run but the first shifted so that periodic effects agree.

    None if no shift makes the data clearly more likely. Effects are screened on each run alone.
    Those with the largest gain over all runs are tried on all of them, with the phases found in
    each. Theta stays as recorded if a declared effect already depends on it. ``test`` are the
    held-out windows; they give the zero of a run that is held out as a whole.
    """
    if not _may_differ(base, test):
        return None
    run = base.predictor.data.run
    runs, fitted = np.unique(run).tolist(), set(run[base.where.start].tolist())
    alone = [Score(_only(base, base.where if one in fitted else test, one)) for one in runs]
    seen = [score for score, one in zip(alone, runs, strict=True) if one in fitted]
    found = (_way(alone, runs, *named) for named in _clearest(seen))
    ways = [way for way in found if way is not None]
    if not ways:
        return None
    light = lightened(base)
    as_recorded = Score(light)
    least = max(_gained(as_recorded, way) for way in ways)
    gains = [_gained(_moved(light, way), way) for way in ways]
    if max(gains) <= least + GATE:
        return None
    best = ways[int(np.argmax(gains))]
    return base.predictor.data.aligned(best.zeros, best.order)


def settled_on(base: Fitted, data: Data) -> Fitted:
    """The base model on shifted data. No refit is needed: no declared effect depends on theta."""
    values, anchor = (alike(data) | known for known in (base.values, base.anchor))
    return replace(base, predictor=base.predictor.on(data), values=values, anchor=anchor)


def _may_differ(base: Fitted, test: Windows) -> bool:
    """True for a few runs that all have windows, if no declared effect depends on theta."""
    run = base.predictor.data.run
    runs, covered = np.unique(run), np.concatenate([run[base.where.start], run[test.start]])
    few = 1 < len(runs) <= MOST_RUNS
    return few and bool(np.all(np.isin(runs, covered))) and not knows_places(base.predictor.model)


def _only(base: Fitted, where: Windows, run: int) -> Fitted:
    """The model fitted to the windows of one run."""
    chosen = base.predictor.data.run[where.start] == run
    part = lightened(tuned(replace(base, where=replace(where, start=where.start[chosen]))))
    return again(part, most=10, rough=True)


def _clearest(alone: Sequence[Score]) -> list[tuple[str, float]]:
    """Names and orders of the periodic effects with the largest score-test gain over all runs;
    the order of each is the best one in some run."""
    names = [name for name, made in members("effect").items() if repeats(made)]
    trials = [trial for score in alone for trial in screen(score, names)]
    found = {(t.name, orders(t.fitted.predictor.model, t.values)[0]) for t in trials}

    def promised(one: tuple[str, float]) -> float:
        return sum(t.promise for t in (placed_at(score, *one) for score in alone) if t)

    return sorted(found, key=promised, reverse=True)[:TRIED]


def _way(alone: Sequence[Score], runs: Sequence[int], name: str, order: float) -> _Way | None:
    """The shifts that align an effect; None if a run does not show it."""
    trials = [placed_at(score, name, order) for score in alone]
    phases = np.array([t.values[f"{t.key}.phase"] for t in trials if t])
    if len(phases) < len(trials):
        return None
    turns = np.angle(np.exp(1j * (phases - phases[0]))) / order
    return _Way(name, order, dict(zip(runs[1:], turns[1:].tolist(), strict=True)))


def _moved(light: Fitted, way: _Way) -> Score:
    return Score(settled_on(light, light.predictor.data.aligned(way.zeros, way.order)))


def _gained(score: Score, way: _Way) -> float:
    """Log-likelihood with the effect fitted to all runs at their given theta."""
    trial = placed_at(score, way.name, way.order)
    return refine(trial, most=STEPS, rough=True).total if trial else -np.inf
