"""What a diagnosis and an identification have in common: fitted parameters and their forms."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

from ..blocks.model import Model
from ..core.display import Grid, Row, brief, grid_html, grid_text, noticed, number, with_interval
from ..core.errors import InputError
from ..core.provenance import Provenance
from ..core.result import ComparedRows, NamedRows, Result, library, picked, plain
from ..core.views import view
from ..record import Record
from .balance import Balance
from .covariance import Joint, Residuals
from .findings import Estimate, FrictionMap, Traces
from .members import Belief, Members


class Parameter(NamedTuple):
    """A fitted value and its 95 % interval (None if it cannot be determined) in ``unit``;
    ``declared`` is the value in the model file, None if it gives none."""

    name: str
    value: float
    low: float | None
    high: float | None
    unit: str
    declared: float | None


class ParameterTable(NamedRows[Parameter]):
    """Fitted parameters, a row for each: ``table[0]``, ``table["J"].value``, ``"J" in table``."""

    _unknown = "there is no fitted parameter {0!r}; there is {1}."

    def __init__(self, estimates: Mapping[str, Estimate], declared: Model | None = None) -> None:
        before = declared.values() if declared is not None else {}
        self._estimates = dict(estimates)
        self._rows = tuple(
            Parameter(name, e.value, *(e.ci95 or (None, None)), e.unit, before.get(name))
            for name, e in estimates.items()
        )

    def to_dict(self) -> dict[str, dict[str, Any]]:
        """Plain Python: name -> value, low, high, unit, declared."""
        return {name: plain(dict(zip(Parameter._fields[1:], row, strict=True)))
                for name, *row in self}  # fmt: skip

    def to_frame(self) -> Any:
        """A DataFrame with the names as index; InputError where pandas is not installed."""
        frame = library("pandas").DataFrame(list(self), columns=list(Parameter._fields))
        numbers = dict.fromkeys(("value", "low", "high", "declared"), float)
        return frame.astype(numbers).set_index("name")

    def _grid(self) -> Grid:
        rows = []
        for row in self:
            value, interval = with_interval(self._estimates[row.name])
            rows.append((row.name, number(row.declared), value, interval, row.unit))
        head = ("parameter", "declared", "fitted", "95 % interval", "unit")
        return Grid(head, "lrrrl", tuple(rows))

    def __repr__(self) -> str:
        return "\n".join(grid_text(self._grid())) if self else "no fitted parameters"

    def _repr_html_(self) -> str:
        return grid_html(self._grid()) if self else "<p>no fitted parameters</p>"


@dataclass(frozen=True, repr=False, kw_only=True)
class Fitted(Result):
    """What a diagnosis and an identification have in common; its fields stand with a diagnosis."""

    estimates: Mapping[str, Estimate] = field(default_factory=dict)
    error: Mapping[str, Any] | None = None
    model: Model | None
    declared: Model | None = None
    record: Record | None = None
    records: tuple[Record, ...] = ()
    messages: tuple[str, ...] = ()
    traces: Traces | None = None
    map: FrictionMap | None = None
    plain: Balance | None = None
    joint: Joint | None = None
    residuals: Residuals | None = None
    laws: ComparedRows | None = None
    rivals: tuple[Belief, ...] = ()
    torque_noise: float | None = None
    provenance: Provenance | None = None

    @property
    def covariance(self) -> Joint:
        """The joint covariance of the fitted parameters: ``.matrix``, ``.names``, ``.to_frame()``.

        Raises InputError where nothing was fitted.
        """
        if self.joint is None:
            raise InputError("this result has no fit, and so no covariance of its parameters.")
        return self.joint

    def sample(self, n: int = 1000, seed: int | None = 0) -> Members:
        """n drives as they may be, :class:`Members`: models with values drawn from their joint
        covariance, inside their bounds.

        Where several models explain the record each is drawn by its weight: those weights with
        which their mixture predicts left-out blocks best (Yao, Vehtari, Simpson and Gelman, Using
        Stacking to Average Bayesian Predictive Distributions, Bayesian Analysis 13(3), 2018). Of a
        value that the log does not determine the declared std counts; without one the members have
        no value of it, and each is refused with a sentence that names it. Values with an interval
        but no covariance are drawn independently.
        """
        return Members(self.beliefs(), n, seed)

    def beliefs(self) -> tuple[Belief, ...]:
        """The model with the distribution of its values, and those that explain the record too."""
        if self.model is None:
            raise InputError("this result has no model, and so nothing to draw from.")
        left = 1.0 - sum(one.weight for one in self.rivals)
        own = Belief.of(self.model, self.joint, self.estimates, left)
        return tuple(one.moved_by(self.records) for one in (own, *self.rivals))

    def _document(self, **more: Any) -> dict[str, Any]:
        """The JSON document: what both results have, and ``more``; never NaN or Infinity."""
        model, every = self.model, self.records or ([self.record] if self.record else [])
        nested = model.to_dict() if model else {"plant": {}, "friction": {}, "effects": []}
        seen = view("assure.seen_in", "bench")(self.record, self.torque_noise)
        made = {
            "model": {k: nested[k] for k in ("plant", "friction", "effects")}
            | {"stated": model.statements() if model else {}},
            "parameters": self.estimates,
            "records": [{"name": r.source, **r.summary()} for r in every],
            "covariance": self.joint,
            "members": self.beliefs() if model else None,
            "drive": seen or None,
        }
        same = picked(self, "error record messages plain residuals laws provenance")
        return {"schema": 1, **more, **plain(made), **same}

    @property
    def parameters(self) -> ParameterTable:
        """Fitted parameters: name, value, low and high of the 95 % interval, unit, declared."""
        return ParameterTable(self.estimates, self.declared)

    def to_frame(self) -> Any:
        """The fitted parameters as a DataFrame; InputError where pandas is not installed."""
        return self.parameters.to_frame()

    def save(self, folder: str | Path) -> list[Path]:
        """Write report.html, report.json and model.toml into a folder, all or none.

        The folder is made when it is missing. A refusal has no model, so no model.toml. Returns
        the paths. Raises InputError where nothing can be written.
        """
        return view("write")(self, folder)

    def plot(self, ax: Any = None) -> Any:
        """Draw what there is: motion, error, residual, budget, in a figure that shows itself.

        Returns an array of Axes, one for each panel; a single one where there is one panel. Into
        a given ``ax`` the first panel is drawn, measured and simulated motion where there is any,
        and ``ax`` is returned. Raises InputError where there is nothing to draw.
        """
        return view("diagnosis_plots.overview")(self, ax)

    def _error_rows(self, names: tuple[str, str]) -> list[Row]:
        """The error of two models, one after the other."""
        if not self.error:
            return []
        values = [number(self.error.get(name), 3) for name in names]
        name = f"error of {self.error['signal']}"
        return [Row(name, " -> ".join(values), self.error["unit"], f"({' -> '.join(names)})")]

    def _last_rows(self) -> list[Row]:
        rows = []
        if len(self.records) > 1:
            length = f"{sum(r.samples for r in self.records)} samples"
            rows.append(Row("records", f"{brief([r.source for r in self.records])}: {length}"))
        elif self.record is not None:
            source, facts = self.record.source, self.record.summary()
            length = f"{facts['samples']} samples at {facts['rate']:g} Hz"
            rows.append(Row("record", f"{source}, {length}"))
        return rows + noticed(self.messages, "messages")

    def __str__(self) -> str:
        return view("text")(self)

    def _repr_html_(self) -> str:
        return view("fragment")(self)
