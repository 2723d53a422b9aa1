"""What a standard bench test answers: a sentence, values with intervals, a table."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

from ..core.display import Row, Shown, estimated, with_interval
from ..core.result import Fields, picked
from .findings import Estimate

ONE_WAY = " + constant_torque"  # what a friction torque holds beside itself in one direction
ALONE = " In one direction Fc holds a constant torque, too."


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
        values = {k: picked(e, "value unit") | {"ci95": list(e.ci95 or ())}
                  for k, e in self.values.items()}  # fmt: skip
        made = picked(self, "kind text") | {"values": values}
        return made if self.table is None else made | {"table": self.table.summary()}

    def _title(self) -> str:
        return f"Bench test: {self.kind}"

    def _rows(self) -> Iterable[Row]:
        return [estimated(k, e) for k, e in self.values.items()]


def in_words(values: Mapping[str, Estimate]) -> str:
    """Values with their intervals: "Fc 0.120 N m (0.118 to 0.122), ..."."""
    shown = {name: with_interval(e) for name, e in values.items()}
    parts = [f"{k} {value} {values[k].unit} ({ends})" for k, (value, ends) in shown.items()]
    return ", ".join(parts)
