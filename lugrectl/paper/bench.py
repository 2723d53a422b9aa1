"""Runs the cases: each loop is built once, and only values change between runs."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..blocks.model import Parameters
from ..core.display import Shown
from ..core.errors import Diverged
from ..loops.friction_loops import position_loop, velocity_loop
from ..simulation.response import simulate
from .setting import Case, Compensation, Measure, Study

Tick = Callable[[str], None]
Signals = dict[str, np.ndarray]


@dataclass(frozen=True, repr=False)
class Trace(Shown):
    """One signal of one compensation over time, for a figure."""

    name: str
    t: np.ndarray
    y: np.ndarray


@dataclass(frozen=True)
class Row:
    """RMS values of one measure, one for each compensation; inf if the loop diverged."""

    label: str
    measure: Measure
    rms: tuple[float, ...]
    x: float | None = None


@dataclass(frozen=True, repr=False)
class Outcome(Shown):
    """The result of a study: rows of RMS values, and the traces of its figure."""

    study: Study
    rows: tuple[Row, ...]
    traces: tuple[Trace, ...] = ()

    def value(self, row: int, short: str) -> float:
        """The RMS value of a row under a compensation's short name."""
        names = [c.short for c in self.study.compensations]
        return self.rows[row].rms[names.index(short)]

    def summary(self) -> dict[str, Any]:
        names = [c.short for c in self.study.compensations]
        rows = [
            {
                "case": row.label,
                "signal": row.measure.signal,
                "unit": row.measure.unit,
                "window": list(row.measure.window),
                "rms": dict(zip(names, row.rms, strict=True)),
            }
            for row in self.rows
        ]
        return self.study.summary() | {"rows": rows}


@dataclass
class Bench:
    """The loops of one drive, built when first needed."""

    p: Parameters
    _loops: dict[tuple[str, str | None], Any] = field(default_factory=dict)

    def respond(
        self, loop: str, controller: Mapping[str, float], c: Compensation, case: Case
    ) -> tuple[np.ndarray, Signals]:
        """Times and signals of one run (outputs of the loop, and F - Fhat).

        Raises
        ------
        Diverged
            When the loop diverges.
        """
        system = self._loop(loop, c.observer)
        t = np.arange(round(case.duration / case.dt) + 1) * case.dt
        start = [case.start.get(label, 0.0) for label in system.state_labels]
        r = case.reference.inputs(t, loop, case.feedforward)
        values = self._values(loop, controller, c, case)
        made = simulate(system, t, r, start, params=values)
        y = dict(zip(system.output_labels, np.asarray(made.outputs), strict=True))
        return t, y | {"F - Fhat": y["F"] - y["Fhat"]}

    def _loop(self, loop: str, observer: str | None) -> Any:
        make = velocity_loop if loop == "velocity" else position_loop
        if (loop, observer) not in self._loops:
            self._loops[loop, observer] = make(self.p, observer, feedforward=True)
        return self._loops[loop, observer]

    def _values(
        self, loop: str, controller: Mapping[str, float], c: Compensation, case: Case
    ) -> dict[str, float]:
        """Every value that differs between cases, so that one compilation is used for all."""
        block = "pi" if loop == "velocity" else "pid"
        own = {k: v for k, v in c.gains.items() if k in controller}
        values = {f"{block}.{k}": float(v) for k, v in {**controller, **own}.items()}
        if c.observer is None:
            return values
        believed = {k: v * case.scale.get(k, 1.0) for k, v in self.p.friction().items()}
        believed |= {k: v for k, v in c.gains.items() if k not in controller}
        return values | {f"{c.observer}_observer.{k}": float(v) for k, v in believed.items()}


def rms(t: np.ndarray, y: np.ndarray, window: tuple[float, float]) -> float:
    """Root of the mean square of the samples in a window (s), ends included."""
    slack = 1e-9 * max(window[1], 1.0)
    inside = (t >= window[0] - slack) & (t <= window[1] + slack)
    return float(np.sqrt(np.mean(np.square(y[inside]))))


def run(bench: Bench, study: Study, tick: Tick) -> Outcome:
    """All cases of a study under all its compensations."""
    rows: list[Row] = []
    traces: list[Trace] = []
    for number, case in enumerate(study.cases):
        columns = []
        for c in study.compensations:
            columns.append(_one(bench, study, c, case))
            if columns[-1] and study.drawn and number == study.drawn.case:
                traces += _trace(study, c, *columns[-1])
            tick(f"{study.title}: {c.short}")
        rows += _rows(case, columns)
    return Outcome(study, tuple(rows), tuple(traces))


def _one(bench: Bench, study: Study, c: Compensation, case: Case) -> Any:
    try:
        return bench.respond(study.loop, study.controller, c, case)
    except Diverged:
        return None


def _rows(case: Case, columns: list[Any]) -> Iterator[Row]:
    for m in case.measures:
        values = [
            np.inf if one is None else rms(one[0], one[1][m.signal], m.window) for one in columns
        ]
        yield Row(case.label, m, tuple(values), case.x)


def _trace(study: Study, c: Compensation, t: np.ndarray, y: Signals) -> Iterator[Trace]:
    drawn = study.drawn
    if drawn is None or (drawn.columns and c.short not in drawn.columns):
        return
    inside = (t >= drawn.span[0]) & (t <= drawn.span[1])
    yield Trace(c.short, t[inside], y[drawn.signal][inside])
