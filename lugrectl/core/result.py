"""The forms in which results are handed out: dict, JSON, pandas, a table, files, a picture."""

from __future__ import annotations

import json
import math
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic, NamedTuple, TypeVar, overload

import numpy as np

from .display import Grid, Row, Shown, brief, grid_html, grid_text, number, with_interval
from .errors import InputError

if TYPE_CHECKING:
    from ..blocks.model import Model
    from ..record import Record
    from ..results.covariance import Joint, Residuals
    from ..results.diagnosis_result import Estimate


def plain(value: Any) -> Any:
    """The value as JSON has it: arrays as lists, NaN and infinity as None."""
    if isinstance(value, Mapping):
        return {str(k): plain(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(v) for v in value]
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def library(name: str) -> Any:
    """An optional package; raises InputError where it is not installed."""
    try:
        return import_module(name)
    except ImportError:
        raise InputError(f"{name} is not installed; python -m pip install {name}.") from None


T = TypeVar("T")


class NamedRows(Sequence[T], Generic[T]):
    """Rows with an attribute ``name``, in order; a name is contained as its row is."""

    _rows: tuple[Any, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """The names, in order; those of an effect's parameters are ``effect.parameter``."""
        return tuple(row.name for row in self._rows)

    def __len__(self) -> int:
        return len(self._rows)

    def __iter__(self) -> Iterator[T]:
        return iter(self._rows)

    def __contains__(self, item: object) -> bool:
        return item in self._rows or item in self.names


class ComparedRows(NamedRows[T], ABC):
    """Rows of a comparison, by place or by name, handed out as plain data."""

    def __getitem__(self, which: Any) -> Any:
        if not isinstance(which, str):
            return self._rows[which]
        if which not in self.names:
            raise InputError(f"{which!r} was not compared; there is {', '.join(self.names)}.")
        return self._rows[self.names.index(which)]

    @abstractmethod
    def summary(self) -> dict[str, Any]:
        """Plain Python."""

    def to_dict(self) -> dict[str, Any]:
        """The same as :meth:`summary`."""
        return self.summary()

    def to_json(self) -> str:
        """One JSON document; NaN and infinity become null."""
        return json.dumps(self.summary(), indent=2, allow_nan=False)


class Result(Shown, ABC):
    """Base of results: plain data in several forms, and a short ``repr``."""

    @abstractmethod
    def summary(self) -> dict[str, Any]:
        """Plain Python."""

    def to_dict(self) -> dict[str, Any]:
        """The same as :meth:`summary`."""
        return self.summary()

    def to_json(self) -> str:
        """One JSON document; NaN and infinity become null."""
        return json.dumps(plain(self.summary()), indent=2, allow_nan=False)


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

    def __init__(self, estimates: Mapping[str, Estimate], declared: Model | None = None) -> None:
        before = declared.values() if declared is not None else {}
        self._estimates = dict(estimates)
        self._rows = tuple(
            Parameter(name, e.value, *(e.ci95 or (None, None)), e.unit, before.get(name))
            for name, e in estimates.items()
        )

    @overload
    def __getitem__(self, which: int | str) -> Parameter: ...
    @overload
    def __getitem__(self, which: slice) -> tuple[Parameter, ...]: ...  # type: ignore[override]
    def __getitem__(self, which: int | str | slice) -> Any:
        if not isinstance(which, str):
            return self._rows[which]
        if which not in self.names:
            known = ", ".join(self.names) or "none"
            raise InputError(f"there is no fitted parameter '{which}'; there is {known}.")
        return self._rows[self.names.index(which)]

    def to_dict(self) -> dict[str, dict[str, Any]]:
        """Plain Python: name -> value, low, high, unit, declared."""
        return plain({row.name: {k: v for k, v in row._asdict().items() if k != "name"}
                      for row in self})  # fmt: skip

    def to_frame(self) -> Any:
        """A DataFrame with the names as index; InputError where pandas is not installed."""
        pandas = library("pandas")
        frame = pandas.DataFrame(list(self), columns=list(Parameter._fields))
        numbers = {k: float for k in ("value", "low", "high", "declared")}
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


class Fitted(Result):
    """What a diagnosis and an identification have in common."""

    estimates: Mapping[str, Estimate]
    declared: Model | None
    error: Mapping[str, Any] | None
    record: Record | None
    records: tuple[Record, ...]
    messages: tuple[str, ...]
    joint: Joint | None
    residuals: Residuals | None

    @property
    def covariance(self) -> Joint:
        """The joint covariance of the fitted parameters: ``.matrix``, ``.names``, ``.to_frame()``.

        Raises InputError where nothing was fitted.
        """
        if self.joint is None:
            raise InputError("this result has no fit, and so no covariance of its parameters.")
        return self.joint

    def sample(self, n: int, seed: int | None = None) -> dict[str, np.ndarray]:
        """n random sets of the fitted parameters, drawn together: name -> (n,)."""
        return self.covariance.sample(n, seed)

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
        from ..report import write

        return write(self, folder)

    def plot(self, ax: Any = None) -> Any:
        """Draw what there is: motion, error, residual, budget, in a figure that shows itself.

        Returns an array of Axes, one for each panel; a single one where there is one panel. Into
        a given ``ax`` the first panel is drawn, measured and simulated motion where there is any,
        and ``ax`` is returned. Raises InputError where there is nothing to draw.
        """
        from ..report.diagnosis_plots import overview

        return overview(self, ax)

    def _records(self) -> list[dict[str, Any]]:
        """All records with their names, as under "records" in the JSON document."""
        every = self.records or ((self.record,) if self.record is not None else ())
        return [{"name": r.source, **r.summary()} for r in every]

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
        return rows + ([Row("messages", len(self.messages))] if self.messages else [])

    def __str__(self) -> str:
        from ..report import text

        return text(self)

    def _repr_html_(self) -> str:
        from ..report import fragment

        return fragment(self)
