"""What the options say of records and of the model."""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from ..blocks import AUTO

if TYPE_CHECKING:
    from ..blocks.model import Model


def chosen(a: Namespace) -> dict[str, float]:
    """The options of the search that were given."""
    given = {k: getattr(a, k, None) for k in ("time_limit", "least", "alpha")}
    return {k: v for k, v in given.items() if v is not None}


def files(names: Sequence[str]) -> list[str]:
    """The named files, those of a folder, and those of a pattern that the shell did not expand."""
    from ..record.as_record import files_of

    return [str(path) for name in names for path in files_of(name)]


def reading(a: Namespace) -> dict[str, Any]:
    """The options that say how to read a record."""
    pairs = {
        k: ",".join(v) if (v := getattr(a, k)) else None for k in ("columns", "units", "scale")
    }
    return {**pairs, "rate": a.rate}


def declared(a: Namespace) -> Model:
    """The model of --model; InputError where it and a log were swapped."""
    from ..blocks.model import read_model
    from ..diagnosis.asked import refuse_swapped

    refuse_swapped(a.records, a.model)
    return read_model(a.model)


def fixed(model: Model, a: Namespace) -> Model:
    """The model with the law of --law, and the values of --fix held."""
    from ..blocks.model import changed

    law, file = getattr(a, "law", None), model.file
    law = None if law == AUTO else law
    model = model if law is None else changed(model, {"friction": law}, "--law")
    names = [n.strip() for given in getattr(a, "fix", None) or [] for n in given.split(",")]
    made = model.fix(*filter(None, names), what="--fix") if names else model
    object.__setattr__(made, "file", file)  # the command says what was changed beside it
    return made
