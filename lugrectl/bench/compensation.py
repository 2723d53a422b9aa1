"""The result of a compensation: tracking errors, the loops, effects not compensated."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

import control as ct
import numpy as np

from ..blocks.controllers import MEASURED
from ..core.display import Row, Shown, noticed
from ..core.result import Result, library, plain
from ..core.views import view
from ..design import Certificate
from .chance import between

ENDS = 10.0, 90.0  # percentiles of the spread
LOOPS = {
    "none": "without compensation",
    "before": "with the compensation of the declared model",
    "after": "with the compensation of the augmented model",
}


@dataclass(frozen=True, repr=False, eq=False)
class Run(Shown):
    """One simulated loop: reference, motion (both rad/s or rad) and torque u (N m) over t (s)."""

    t: np.ndarray
    r: np.ndarray
    y: np.ndarray
    u: np.ndarray


@dataclass(frozen=True, repr=False, eq=False)
class Spread(Shown):
    """RMS tracking error on drawn drives: the values of each loop, infinite where it diverged.

    ``rate`` in Hz; ``noise`` of position (rad), speed (rad/s, nan where the drive takes the
    difference of two positions) and torque (N m), and the encoder's ``resolution`` (rad).
    ``drawn``: the parameters that differ from draw to draw.
    """

    rate: float
    noise: Mapping[str, float]
    resolution: float
    drawn: tuple[str, ...]
    seed: int
    errors: Mapping[str, np.ndarray] = field(default_factory=dict)

    def of(self, key: str) -> tuple[float, float, float]:
        """Median and 10 and 90 % of a loop's error."""
        values = np.sort(self.errors[key])
        places = (len(values) - 1) * np.array([50.0, *ENDS]) / 100.0
        with np.errstate(invalid="ignore"):
            found = [between(values, place) for place in places]
        return found[0], found[1], found[2]

    @property
    def best(self) -> str:
        """The loop of the least median; without compensation where none is smaller."""
        return min(self.errors, key=lambda key: self.of(key)[0])

    def summary(self) -> dict[str, Any]:
        """Plain Python, as under "compensation" "drive" in the JSON document."""
        loops = {
            key: {**dict(zip(("median", "low", "high"), self.of(key), strict=True)),
                  "diverged": int(np.count_nonzero(~np.isfinite(values)))}
            for key, values in self.errors.items()
        }  # fmt: skip
        return {
            "rate": self.rate,
            "resolution": self.resolution,
            "noise": dict(self.noise),
            "drawn": list(self.drawn),
            "draws": len(next(iter(self.errors.values()))),
            "seed": self.seed,
            **loops,
            "recommended": self.best,
        }

    def rows(self, unit: str) -> list[Row]:
        """Median and spread of each loop, for display."""
        made = []
        for key in self.errors:
            middle, low, high = self.of(key)
            made.append(Row(f"on a drive, {key}", f"{middle:.3g} ({low:.3g} to {high:.3g}) {unit}"))
        return made

    def advice(self, unit: str) -> list[str]:
        """One sentence where a compensation makes tracking worse than none."""
        (none, *_), (after, *_) = self.of("none"), self.of("after")
        if after <= none:
            return []
        worse = f"{after:.3g} {unit}" if math.isfinite(after) else "unstable"
        return [
            "On a drive like the recorded one the compensation makes tracking worse: median error "
            f"{worse} with it, {none:.3g} {unit} without; leave it off."
        ]


@dataclass(frozen=True, repr=False, eq=False)
class Compensation(Result):
    """The answer of :func:`lugrectl.compensate`.

    Attributes
    ----------
    kind : "velocity" or "position"
        The loop.
    observer : str or None
        The observer in it.
    none, before, after : float
        RMS of motion minus reference in ``unit`` without compensation, with that of the declared,
        and with that of the augmented model; infinite if the loop diverges, which ``messages``
        then report.
    unit : str
        Of these errors.
    controller : dict
        Gains of the controller by name.
    gains : dict
        Those of the observer in the loops "before" and "after".
    certificate : Certificate or None
        What the gains guarantee "after"; None if there is no design.
    compensated : tuple of str
        Effects whose torque is fed forward.
    left : tuple of (str, str)
        Effects that are not, each with the reason.
    reference : dict
        Speed, frequency and duration of the reference.
    messages : tuple of str
        What was noticed.
    loop, runs : dict
        The closed loops and their simulations under "none", "before", "after" (no run for a loop
        that diverged).
    drive : Spread or None
        The same errors on a drive like the recorded one, which is not exactly the model; None
        without a record.

    Examples
    --------
    The tracking errors over time of a drive whose declared model does not contain a load:

    >>> load = {"name": "constant_torque", "torque": 0.05}
    >>> drive = lg.Model.of(lg.table1(), effects=load)
    >>> lg.compensate(drive, declared=lg.table1()).plot()  # doctest: +SKIP
    """

    kind: str
    observer: str | None
    none: float
    before: float
    after: float
    unit: str
    controller: Mapping[str, float]
    gains: Mapping[str, Mapping[str, Any]]
    certificate: Certificate | None
    compensated: tuple[str, ...]
    left: tuple[tuple[str, str], ...]
    reference: Mapping[str, float]
    messages: tuple[str, ...]
    loop: Mapping[str, ct.InterconnectedSystem]
    runs: Mapping[str, Run]
    drive: Spread | None = None

    def summary(self) -> dict[str, Any]:
        """Plain Python, as under "compensation" in the JSON document."""
        return plain(
            {
                "loop": self.kind,
                "observer": self.observer,
                "signal": MEASURED[self.kind],
                "unit": self.unit,
                "none": self.none,
                "before": self.before,
                "after": self.after,
                "controller": self.controller,
                "observer_gains": self.gains,
                "certificate": self.certificate.summary() if self.certificate else None,
                "compensated": list(self.compensated),
                "not_compensated": [{"name": n, "reason": why} for n, why in self.left],
                "reference": self.reference,
                "messages": list(self.messages),
                "drive": self.drive.summary() if self.drive else None,
            }
        )

    def to_frame(self) -> Any:
        """A DataFrame of the simulated loops: a row for each loop and time t, columns r, y, u."""
        pandas = library("pandas")
        columns = {
            key: pandas.DataFrame({"r": run.r, "y": run.y, "u": run.u}, index=run.t)
            for key, run in self.runs.items()
        }
        if not columns:
            return pandas.DataFrame(columns=["r", "y", "u"])
        return pandas.concat(columns, names=["loop", "t"])

    def _title(self) -> str:
        watcher = f"{self.observer} observer" if self.observer else "no observer"
        return f"Compensation: {self.kind} loop, {watcher}"

    def _rows(self) -> Iterable[Row]:
        rate = self.certificate.rate if self.certificate else None
        left = ", ".join(name for name, _ in self.left)
        rows = [Row(f"RMS error, {k}", getattr(self, k), self.unit) for k in LOOPS]
        rows += [] if self.drive is None else self.drive.rows(self.unit)
        rows += [Row(k, v) for k, v in self.controller.items()]
        rows += [Row(k, v) for k, v in self.gains.get("after", {}).items()]
        rows += [Row("observer's rate", rate, "1/s")] if rate else []
        rows += [Row("fed forward", ", ".join(self.compensated))] if self.compensated else []
        rows += [Row("not compensated", left)] if left else []
        return [*rows, *noticed(self.messages, "messages")]

    def plot(self, ax: Any = None) -> Any:
        """Draw the tracking errors over time, into ``ax`` or a new figure; returns the Axes."""
        return view("loop_plots.tracking")(self, ax)
