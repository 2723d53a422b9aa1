"""A model that was given in the place of a log, and a log in the place of the model."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ..blocks.model import Model, Parameters
from ..core.errors import InputError
from ..core.validation import holds_samples, is_file
from ..record.as_record import is_record
from ..record.files.readers import MODEL, SUFFIXES


def refuse_swapped(logs: Iterable[Any], model: Any) -> None:
    """InputError where the model is a log, and one of the logs a model."""
    if not _is_log(model):
        return
    for log in logs:
        if _is_model(log):
            first, second = _named(log, "record"), _named(model, "model")
            raise InputError(f"{first} is a model and {second} is a log: swap them.")


def _is_log(given: Any) -> bool:
    """A file by its name, samples by what holds them."""
    if is_file(given):
        return Path(given).suffix.lower() in SUFFIXES
    if isinstance(given, (list, tuple)):
        return bool(given) and all(map(_is_log, given))
    if isinstance(given, Mapping):
        return holds_samples(given)
    return isinstance(given, np.ndarray) or is_record(given)


def _is_model(given: Any) -> bool:
    if is_file(given):
        return Path(given).suffix.lower() == MODEL
    return isinstance(given, (Model, Parameters, Mapping)) and not _is_log(given)


def _named(given: Any, argument: str) -> str:
    return str(given) if is_file(given) else argument
