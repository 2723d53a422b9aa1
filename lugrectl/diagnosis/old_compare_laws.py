"""Friction laws compared on a log: which one predicts best what no fit has seen."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..blocks.model import Model, changed
from ..core.deadline import within
from ..core.errors import Refused
from ..core.progress import Progress, reporter
from ..engine.runtime.threads import each_beside
from ..friction_maps.points import is_map
from ..identification.dataset.windows import Windows
from ..identification.likelihood.held_out_run import adapted
from ..identification.likelihood.maximise import Fitted, seen_on
from ..identification.likelihood.parameters import free_keys
from ..identification.likelihood.simulation_error import judge
from ..identification.selection import alone, paired, standard_error
from ..record import Record
from .law_comparison import ComparedLaw, LawComparison
from .question import Asked
from .study import Prepared, begin, prepared

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


def compared(
    record: Any,
    model: Any,
    holdout: Any,
    reading: Any,
    horizon: float,
    names: Any,
    bar: float,
    limit: float,
    progress: Any,
) -> LawComparison:
    asked = Asked.of(record, model, holdout, **reading)
    report = reporter(progress)
    report(0.0, "torque balance")
    ready = _ready(asked, horizon)
    fits, refused = _fitted(ready, asked.model, names, limit, report)
    return _chosen(fits, refused, asked.model, bar)


def _ready(asked: Asked, horizon: float) -> Prepared:
    """The records, split, with the values from which every law starts."""
    record, holdout = asked.records(), asked.holdout()
    if not isinstance(record, Record) and is_map(record):
        raise Refused(*OF_MAP)
    asked.refuse_unfit()
    ready = prepared(record, asked.model, holdout, horizon)
    found = alone(asked.plain.stretches, asked.model, asked.plain)
    return ready.begun_from(asked.plain, asked.starts(found.alone), found.written_late)


def _fitted(
    ready: Prepared, model: Model, names: Sequence[str], limit: float, report: Progress
) -> tuple[list[_Fit], dict[str, str]]:
    """The fits of the laws, side by side, and why others could not be fitted."""

    def one(name: str) -> _Fit | str:
        try:
            with within(limit):
                return _fit(ready, name, changed(model, {"friction": name}, "laws"))
        except Refused as no:
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


def _fit(ready: Prepared, name: str, model: Model) -> _Fit:
    job = begin(replace(ready, model=model), lambda *_: None)
    test = job.parts.test
    found = adapted(job.base, test, job.declared)
    judged = judge(found.predictor, found.values, found.noise, test, found.noise)
    count = len(free_keys(found.predictor))
    return _Fit(name, predicted(found, test), judged.torque, judged.error, count)


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


def predicted(found: Fitted, test: Windows) -> np.ndarray:
    """The log density of each held-out window."""
    return np.nan_to_num(seen_on(found, test).loglik, nan=-1e300)


def beaten(best: np.ndarray, other: np.ndarray, bar: float) -> bool:
    """Whether windows are predicted better by more than chance allows."""
    gain, se = paired(best, other)
    return gain > bar * se


def _row(f: _Fit, chosen: _Fit) -> ComparedLaw:
    d = f.windows - chosen.windows
    se = standard_error(d) if f is not chosen else 0.0
    return ComparedLaw(f.name, float(d.sum()), se, f.torque, f.error, f.parameters)
