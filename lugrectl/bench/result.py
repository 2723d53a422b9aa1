"""The result of a compensation: tracking errors, the loops, effects not compensated."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import control as ct
import numpy as np

from ..blocks.controllers import MEASURED
from ..core.display import Row, Shown, noticed
from ..core.result import Result, library, plain
from ..core.views import view
from ..design import Certificate
from .drive import Spread

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
