"""The result of a compensation: tracking errors, the loops, effects not compensated."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import control as ct
import numpy as np

from ..blocks.controllers import MEASURED
from ..core.display import Row, Shown
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

    ``none``, ``before``, ``after``: RMS of motion minus reference in ``unit`` without
    compensation, with that of the declared, and with that of the augmented model; infinite if
    the loop diverges, which ``messages`` then report. ``loop`` and ``runs`` hold the closed loops
    and their simulations under the same three names (no run for a loop that diverged).
    ``compensated``: effects whose torque is fed forward; ``left``: effects that are not, each
    with the reason. ``gains`` are those of the observer in the loops "before" and "after",
    ``certificate`` what they guarantee "after" (None if there is no design). ``drive``: the same
    errors on a drive like the recorded one, which is not exactly the model; None without a record.
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
        return [*rows, *([Row("messages", len(self.messages))] if self.messages else [])]

    def plot(self, ax: Any = None) -> Any:
        """Draw the tracking errors over time, into ``ax`` or a new figure; returns the Axes."""
        return view("loop_plots.tracking")(self, ax)
