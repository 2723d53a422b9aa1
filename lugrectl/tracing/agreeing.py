"""Runs whose theta starts anywhere, as an incremental encoder's does: moved until they agree."""

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

TRIED = 6  # effects with places that are fitted
STEPS = 15  # of such a fit


@dataclass(frozen=True)
class _Way:
    """Theta of the runs moved to where an effect, so often per 2 pi, is at the same places."""

    name: str
    order: float
    zeros: dict[int, float]


def agreeing(base: Fitted, test: Windows) -> Data | None:
    """The data with theta of each run but the first moved so that what repeats itself with theta
    does so at the same places; None where that makes nothing likelier.

    Effects are tried on each run alone, those that promise most on all of them with the phases
    that they had there. Where the declared model knows of places already theta is left alone.
    ``test`` are the held-out windows: those of a run that is held out as a whole tell where its
    theta is zero.
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
    """The model without effects on moved data: nothing declared hangs on theta."""
    values, anchor = (alike(data) | known for known in (base.values, base.anchor))
    return replace(base, predictor=base.predictor.on(data), values=values, anchor=anchor)


def _may_differ(base: Fitted, test: Windows) -> bool:
    """Whether there are a few runs, each long enough to tell, and nothing declared of places."""
    run = base.predictor.data.run
    runs, told = np.unique(run), np.concatenate([run[base.where.start], run[test.start]])
    few = 1 < len(runs) <= MOST_RUNS
    return few and bool(np.all(np.isin(runs, told))) and not knows_places(base.predictor.model)


def _only(base: Fitted, where: Windows, run: int) -> Fitted:
    """The model fitted to one run's windows."""
    chosen = base.predictor.data.run[where.start] == run
    part = lightened(tuned(replace(base, where=replace(where, start=where.start[chosen]))))
    return again(part, most=10, rough=True)


def _clearest(alone: Sequence[Score]) -> list[tuple[str, float]]:
    """Names and orders of what promises most in all runs together, each at its best in one."""
    names = [name for name, made in members("effect").items() if repeats(made)]
    trials = [trial for score in alone for trial in screen(score, names)]
    found = {(t.name, orders(t.fitted.predictor.model, t.values)[0]) for t in trials}

    def promised(one: tuple[str, float]) -> float:
        return sum(t.promise for t in (placed_at(score, *one) for score in alone) if t)

    return sorted(found, key=promised, reverse=True)[:TRIED]


def _way(alone: Sequence[Score], runs: Sequence[int], name: str, order: float) -> _Way | None:
    """How the runs are to be moved for an effect; None where one of them has none of it."""
    trials = [placed_at(score, name, order) for score in alone]
    phases = np.array([t.values[f"{t.key}.phase"] for t in trials if t])
    if len(phases) < len(trials):
        return None
    turns = np.angle(np.exp(1j * (phases - phases[0]))) / order
    return _Way(name, order, dict(zip(runs[1:], turns[1:].tolist(), strict=True)))


def _moved(light: Fitted, way: _Way) -> Score:
    return Score(settled_on(light, light.predictor.data.aligned(way.zeros, way.order)))


def _gained(score: Score, way: _Way) -> float:
    """Log-likelihood with an effect, fitted to all runs as they are."""
    trial = placed_at(score, way.name, way.order)
    return refine(trial, most=STEPS, rough=True).total if trial else -np.inf
