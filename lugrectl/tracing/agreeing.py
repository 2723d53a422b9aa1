"""Runs whose theta starts anywhere, as an incremental encoder's does: moved until they agree."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..spec import members
from .data import Data
from .fit import Fitted, again, tuned
from .predictor import Windows
from .proof import GATE
from .runs import MOST_RUNS, alike, knows_places, repeats
from .screening import Trial, lightened, placed_at, screen
from .search import refine

TRIED = 6  # effects with places that are fitted
STEPS = 15  # of such a fit


@dataclass(frozen=True)
class _Way:
    """Theta of the runs moved to where an effect, so often per 2 pi, is at the same places."""

    name: str
    order: float
    zeros: dict[int, float]
    periods: float  # per 2 pi of theta, of what a run's phase counts in


def agreeing(base: Fitted, test: Windows) -> Data | None:
    """The data with theta of each run but the first moved so that what repeats itself with theta
    does so at the same places; None where that makes nothing likelier.

    Effects are tried on each run alone, those that promise most on all of them with the phases
    that they had there. Where the declared model knows of places already theta is left alone.
    ``test`` are the held-out windows: those of a run that is held out as a whole tell where its
    theta is zero.
    """
    data = base.predictor.data
    runs = np.unique(data.run).tolist()
    if not 1 < len(runs) <= MOST_RUNS or knows_places(base.predictor.model):
        return None
    fitted = set(data.run[base.where.start].tolist())
    if not set(runs) <= fitted | set(data.run[test.start].tolist()):
        return None  # one is too short to tell
    alone = [_only(base, base.where if run in fitted else test, run) for run in runs]
    seen = [part for part, run in zip(alone, runs, strict=True) if run in fitted]
    ways = [_way(alone, runs, *found) for found in _clearest(seen)]
    tried = [
        (_gained(base, moved, way), _gained(base, data, way), moved)
        for way in ways
        if way is not None and (moved := data.aligned(way.zeros, way.periods))
    ]
    if not tried:
        return None
    best, _, moved = max(tried, key=lambda one: one[0])
    return moved if best > max(as_recorded for _, as_recorded, _ in tried) + GATE else None


def settled_on(base: Fitted, data: Data) -> Fitted:
    """The model without effects on moved data: nothing declared hangs on theta."""
    values, anchor = (alike(data) | known for known in (base.values, base.anchor))
    return replace(base, predictor=base.predictor.on(data), values=values, anchor=anchor)


def _only(base: Fitted, where: Windows, run: int) -> Fitted:
    """The model fitted to one run's windows."""
    chosen = base.predictor.data.run[where.start] == run
    part = lightened(tuned(replace(base, where=replace(where, start=where.start[chosen]))))
    return again(part, most=10, rough=True)


def _clearest(alone: Sequence[Fitted]) -> list[tuple[str, float]]:
    """Names and orders of what promises most in all runs together, each at its best in one."""
    names = [name for name, made in members("effect").items() if repeats(made)]
    found = {(t.name, _order(t)) for part in alone for t in screen(part, names)}

    def promised(one: tuple[str, float]) -> float:
        return sum(t.promise for t in (placed_at(part, *one) for part in alone) if t)

    return sorted(found, key=promised, reverse=True)[:TRIED]


def _way(alone: Sequence[Fitted], runs: Sequence[int], name: str, order: float) -> _Way | None:
    """How the runs are to be moved for an effect; None where one of them has none of it."""
    trials = [placed_at(part, name, order) for part in alone]
    phases = np.array([t.values[f"{t.key}.phase"] for t in trials if t])
    if len(phases) < len(trials):
        return None
    turns = np.angle(np.exp(1j * (phases - phases[0]))) / order
    rotary = alone[0].predictor.data.motion == "rotary"
    zeros = dict(zip(runs[1:], turns[1:].tolist(), strict=True))
    return _Way(name, order, zeros, 1.0 if rotary else order)


def _gained(base: Fitted, data: Data, way: _Way) -> float:
    """Log-likelihood with an effect, fitted to all runs on such data."""
    trial = placed_at(lightened(settled_on(base, data)), way.name, way.order)
    return refine(trial, most=STEPS, rough=True).total if trial else -np.inf


def _order(trial: Trial) -> float:
    """How often it repeats itself per 2 pi of theta."""
    return trial.values.get(f"{trial.key}.harmonic", 1.0)
