"""The answer of the torque balance."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np
from scipy.signal import savgol_filter

from ..core.display import Row, between, estimated, noticed
from ..core.result import Fields, Result, library, picked
from ..core.views import view
from ..record import Stretch
from .bench_test import BenchTest
from .findings import Estimate

LEVELS = ("J", "Fc", "Fv")  # inertia and friction: terms of every drive
SMOOTH = 0.03  # s over which the motion at the samples is differentiated
NEEDS = {"J": "faster changes of speed", "Fc": "both directions, or rests", "Fv": "other speeds"}


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
    """What remains of u in each window: time, run, torque. Windows at rest are left out: all of
    them are ``sliding``."""

    t: np.ndarray
    run: np.ndarray
    value: np.ndarray

    @property
    def sliding(self) -> np.ndarray:
        return np.ones(len(self.t), bool)


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


def at_samples(balance: Balance, one: Stretch) -> dict[str, np.ndarray]:
    """theta, w and what the fit leaves at the samples of a stretch; NaN near rest. The slow part is
    that of the fit's windows, which are wider than a wave over a few degrees; how a sample departs
    from its window is u minus inertia and friction there."""
    n, dt, windows = len(one.t), float(one.t[1] - one.t[0]), balance.residual
    width = 2 * min(max(round(SMOOTH / dt / 2), 2), (n - 1) // 2 - 1) + 1
    unknown = {k: np.full(n, np.nan) for k in ("theta", "w", "left")}
    if windows is None or width < 5:
        return unknown
    at = (windows.run == one.run) & (windows.t >= one.t[0]) & (windows.t <= one.t[-1])
    t, value = windows.t[at], windows.value[at]
    if len(t) < 3:
        return unknown
    known, order = (one.w, 0) if one.theta is None else (one.theta, 1)
    smooth: Any = partial(savgol_filter, known, width, 3, delta=dt)
    w, a = smooth(deriv=order), smooth(deriv=order + 1)
    fast = one.u - balance.values().get("J", 0.0) * a - friction(balance, w, np.sign(w))
    total, edges = np.r_[0.0, np.cumsum(fast) * dt], np.r_[one.t, one.t[-1] + dt]
    half = float(np.median(np.diff(t)))
    low, high = (np.clip(t + k * half, edges[0], edges[-1]) for k in (-1, 1))
    mean = np.diff(np.interp([low, high], edges, total), axis=0)[0] / (high - low)
    slides = (one.t >= t.min()) & (one.t <= t.max()) & one.ok
    left = np.where(slides, fast + np.interp(one.t, t, value - mean), np.nan)
    return {"theta": unknown["theta"] if one.theta is None else one.theta, "w": w, "left": left}
