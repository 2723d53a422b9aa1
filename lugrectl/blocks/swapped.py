"""A model behind what belongs behind it: a record, observers, a gain."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ..core.errors import InputError
from ..core.validation import holds_samples, is_file, shown
from .model import Model, Parameters

MODEL = ".toml"  # of a file


def model_first(p: Any, other: Any, what: str, name: str = "p") -> None:
    """InputError where ``other``, the argument ``what``, is a model, and ``p`` rather not one."""
    if _how_surely(other) > _how_surely(p):
        raise InputError(f"{name} is {_called(p)} and {what} is a model: swap them.")


def _called(p: Any) -> str:
    if is_file(p):
        return f"'{p}'"
    return "a log" if isinstance(p, Mapping) and holds_samples(p) else shown(p)


def _how_surely(given: Any) -> int:
    """2 for a model or a result that holds one, 1 for a dict that may be one, else 0."""
    if is_file(given):
        return 2 * (Path(given).suffix.lower() == MODEL)
    if isinstance(given, (Model, Parameters)) or isinstance(getattr(given, "model", None), Model):
        return 2
    return int(isinstance(given, Mapping) and not holds_samples(given))
