"""The answers of the torque balance and of the bench tests."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..core.display import Row, Shown, between, estimated, noticed, with_interval
from ..core.result import Fields, Result, library, picked
from ..core.views import view
from ..record import Stretch
from .findings import Estimate

LEVELS = ("J", "Fc", "Fv")  # inertia and friction: terms of every drive
NEEDS = {"J": "faster changes of speed", "Fc": "both directions, or rests", "Fv": "other speeds"}
ONE_WAY = " + constant_torque"  # what a friction torque holds beside itself in one direction
ALONE = " In one direction Fc holds a constant torque, too."


@dataclass(frozen=True)
class Combination:
    """A sum of parameters that is certain where its parts are not."""

    text: str
    value: float
    unit: str
    ci95: tuple[float, float] | None  # None where nothing is left to tell its error
    to_separate: str
    parts: Mapping[str, float] = field(default_factory=dict, hash=False)  # factors by name

    def summary(self) -> dict[str, Any]:
        return picked(self, "text value unit ci95 to_separate")


@dataclass(frozen=True)
class CurvePoint(Fields):
    """Mean friction torque in a bin of speeds, or of a run at steady speed."""

    w: float
    torque: float
    ci95: tuple[float, float] | None  # None where nothing is left to tell its error
    samples: int


@dataclass(frozen=True, eq=False)
class Residual:
    """What remains of u in each window in motion: time, run, torque."""

    t: np.ndarray
    run: np.ndarray
    value: np.ndarray

    def along(self, one: Stretch) -> dict[str, np.ndarray]:
        """theta, w and what is left in the windows of a stretch."""
        at = (self.run == one.run) & (self.t >= one.t[0]) & (self.t <= one.t[-1])
        theta: Any = np.full(len(one.t), np.nan) if one.theta is None else one.theta
        w = np.gradient(theta, one.t) if one.w is None else one.w
        made = {"theta": theta, "w": w}
        made = {k: np.interp(self.t[at], one.t, x) for k, x in made.items()}
        return made | {"left": self.value[at]}


@dataclass(frozen=True, repr=False)
class BenchTable(Fields, Shown):
    """``columns`` are names with units; a row holds numbers or words, None where unknown."""

    columns: tuple[str, ...]
    rows: tuple[tuple[Any, ...], ...]


@dataclass(frozen=True, repr=False)
class BenchTest(Shown):
    """A bench test that was recognised in the logs."""

    kind: str  # breakaway_ramps, slow_scan, coast_down, free_swing, steps_and_pulses, staircase
    text: str  # the answer in one sentence
    values: Mapping[str, Estimate] = field(default_factory=dict)  # what the test is done for
    table: BenchTable | None = None

    def summary(self) -> dict[str, Any]:
        return picked(self, "kind text values" + " table" * (self.table is not None))


def in_words(values: Mapping[str, Estimate]) -> str:
    """Values with their intervals: "Fc 0.120 N m (0.118 to 0.122), ..."."""
    shown = {name: with_interval(e) for name, e in values.items()}
    parts = [f"{k} {value} {values[k].unit} ({ends})" for k, (value, ends) in shown.items()]
    return ", ".join(parts)


@dataclass(frozen=True, eq=False, repr=False)
class Balance(Result):
    """The plain answer of a torque balance.

    Attributes
    ----------
    parameters, uncertain : dict of Estimate
        The certain parameters, and those whose interval is too wide to be an answer.
    combinations : tuple of Combination
        Sums that are certain where their parts are not.
    curve : tuple of CurvePoint
        Friction torque over speed, in both directions.
    left : float or None
        RMS of the residual as a share of the RMS torque.
    notes, reading : tuple of str
        What the balance noticed, and how the logs were read, in sentences.
    names, covariance : tuple of str, ndarray
        All parameters, certain or not, and their joint covariance.
    is_map : bool
        True if the runs keep one speed each.
    stretches : tuple of Stretch
        The samples that it was computed from.
    refused : str
        Why nothing can be learnt of the drive; empty where something can.
    unlike : tuple of str
        A sentence for each run in another unit or sign than the others. These runs are left out.
    against : tuple of str
        A sentence for each held or bounded value of the model that the log contradicts by far.
    hopeless : bool
        With these values nothing can be answered.
    bench_tests : tuple of BenchTest
        The standard tests that the logs hold, each with its answer.
    """

    parameters: Mapping[str, Estimate] = field(default_factory=dict)
    uncertain: Mapping[str, Estimate] = field(default_factory=dict)
    combinations: tuple[Combination, ...] = ()
    curve: tuple[CurvePoint, ...] = ()
    left: float | None = None
    seconds: float = 0.0
    notes: tuple[str, ...] = ()
    names: tuple[str, ...] = ()
    covariance: np.ndarray = field(default_factory=lambda: np.zeros((0, 0)))
    is_map: bool = False
    half_width: float | None = None
    residual: Residual | None = None
    stretches: tuple[Stretch, ...] = ()
    motion: str = "rotary"
    reading: tuple[str, ...] = ()
    unlike: tuple[str, ...] = ()
    refused: str = ""
    against: tuple[str, ...] = ()
    hopeless: bool = False
    bench_tests: tuple[BenchTest, ...] = ()

    @property
    def said(self) -> tuple[str, ...]:
        """All sentences: what makes the log impossible, how it was read, what was noticed."""
        return (*self.against, *self.reading, *self.notes)

    @property
    def why_not(self) -> tuple[str, ...]:
        """Why the log does not give an inertia or a friction that stands in no sum, either."""
        in_sums = {k for c in self.combinations for k in c.parts}
        return tuple(
            f"{k} is not certain, {between(e.ci95)} {e.unit}: that needs {how}."
            for k, how in NEEDS.items()
            if k not in in_sums and (e := self.uncertain.get(k)) and e.ci95
        )

    def values(self) -> dict[str, float]:
        """The best value of every parameter, certain or not: start values for a finer fit."""
        both = {**self.uncertain, **self.parameters}
        return {k: both[k].value for k in self.names if k in both}

    def summary(self) -> dict[str, Any]:
        """The answer as plain Python values, as under "plain" in the JSON document."""
        known = {k: picked(e, "value unit ci95") for k, e in self.parameters.items()}
        rest = "combinations curve left seconds" + " bench_tests" * bool(self.bench_tests)
        return {"parameters": known, **picked(self, rest)}

    def to_frame(self) -> Any:
        """A DataFrame of the certain parameters: value, low, high, unit."""
        rows = {
            k: {"value": e.value, "low": ends[0], "high": ends[1], "unit": e.unit}
            for k, e in self.parameters.items()
            if (ends := e.ci95 or (None, None))
        }
        return library("pandas").DataFrame.from_dict(rows, orient="index")

    def plot(self) -> Any:
        """Draw the log as it was read, the friction curve and the fit; returns the Axes."""
        return view("diagnosis_plots.plot")(self)

    def _title(self) -> str:
        return "Plain torque balance"

    def _rows(self) -> Iterable[Row]:
        rows = [Row(test.kind, test.text) for test in self.bench_tests]
        rows += [estimated(k, e) for k, e in self.parameters.items()]
        rows += [estimated(one.text, one) for one in self.combinations]
        if self.left is not None:
            rows.append(Row("left", f"{100.0 * self.left:.2g} %", "", "of the RMS torque"))
        return [*rows, *noticed((*self.against, *self.why_not, *self.notes, *self.reading), "said")]


def friction(balance: Balance, w: np.ndarray, side: np.ndarray | float) -> np.ndarray:
    """The friction torque of the plain fit at speeds w in the direction ``side``."""
    values = balance.values()
    return values.get("Fc", 0.0) * side + values.get("Fv", 0.0) * w
