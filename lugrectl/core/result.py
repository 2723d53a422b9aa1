"""The forms in which results are handed out: plain data as a dict or as JSON, rows by name."""

from __future__ import annotations

import json
import math
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from importlib import import_module
from typing import Any, ClassVar, Generic, TypeVar

import numpy as np

from .display import Shown
from .errors import InputError

T = TypeVar("T")


def plain(value: Any) -> Any:
    """The value as JSON has it: results by their summary, arrays as lists, no NaN or infinity."""
    if hasattr(value, "summary"):
        return plain(value.summary())
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


def picked(x: Any, names: str) -> dict[str, Any]:
    """Some attributes as plain data by name: ``picked(point, "w torque")``."""
    return {name: plain(getattr(x, name)) for name in names.split()}


def library(name: str) -> Any:
    """An optional package; raises InputError where it is not installed."""
    try:
        return import_module(name)
    except ImportError:
        raise InputError(f"{name} is not installed; python -m pip install {name}.") from None


class Fields:
    """An entry of a result: a dataclass whose fields are its part of the JSON document."""

    def summary(self) -> dict[str, Any]:
        """Plain Python."""
        return plain(asdict(self))  # type: ignore[call-overload]


class Forms(ABC):
    """Plain data in several forms."""

    @abstractmethod
    def summary(self) -> dict[str, Any]:
        """Plain Python."""

    def to_dict(self) -> dict[str, Any]:
        """The same as :meth:`summary`."""
        return self.summary()

    def to_json(self) -> str:
        """One JSON document; NaN and infinity become null."""
        return json.dumps(plain(self), indent=2, allow_nan=False)


class NamedRows(Sequence[T], Generic[T]):
    """Rows with an attribute ``name``, in order, by place or by name."""

    _rows: tuple[Any, ...]
    _unknown: ClassVar = "{0!r} was not compared; there is {1}."

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

    def __getitem__(self, which: Any) -> Any:
        if not isinstance(which, str):
            return self._rows[which]
        if which not in self.names:
            raise InputError(self._unknown.format(which, ", ".join(self.names) or "none"))
        return self._rows[self.names.index(which)]


class ComparedRows(NamedRows[T], Forms):
    """Rows of a comparison, handed out as plain data."""


class Result(Shown, Forms):
    """Base of results: plain data in several forms, and a short ``repr``."""
