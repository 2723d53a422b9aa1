"""What the options say of records and of the model."""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import lugrectl as lg

from ..blocks import AUTO
from ..core.errors import InputError

if TYPE_CHECKING:
    from ..blocks.model import Model
    from ..record import Log


def given(a: Namespace, names: str) -> dict[str, Any]:
    """The options of these names that were given."""
    values = {k: getattr(a, k, None) for k in names.split()}
    return {k: v for k, v in values.items() if v is not None and v is not False}


def searched(a: Namespace) -> dict[str, Any]:
    options = {"holdout": a.holdout, "horizon": a.horizon, "seed": a.seed}
    return options | given(a, "time_limit least alpha")


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


def logs(a: Namespace, motion: str | None = None) -> list[Log]:
    from ..record import read_log

    return [read_log(name, **reading(a), motion=motion) for name in a.records]


def with_holdout(a: Namespace, model: Model) -> tuple[list[Log], Any]:
    """The logs, and the value of ``holdout``: "last", None, or a log that is none of them."""
    names = [Path(name).resolve() for name in a.records]
    twice = next((n for n in names if names.count(n) > 1), None)
    if twice is not None:
        raise InputError(f"{twice.name} is given twice; name each record once.")
    if a.holdout in (None, "last"):
        return logs(a, model.motion), a.holdout
    if Path(a.holdout).resolve() in names:
        raise InputError(
            f"--holdout {a.holdout} is a training record too; give another file, or --holdout last."
        )
    apart = Namespace(**vars(a) | {"records": [a.holdout]})
    return logs(a, model.motion), logs(apart, model.motion)[0]


def declared(a: Namespace) -> Model:
    """The model of --model; InputError where it and a log were swapped."""
    from ..diagnosis.asked import refuse_swapped

    refuse_swapped(a.records, a.model)
    return lg.read_model(a.model)


def fixed(model: Model, a: Namespace) -> Model:
    """The model with the law of --law, and the values of --fix held."""
    from ..blocks.model import changed

    law, file = getattr(a, "law", None), model.file
    law = None if law == AUTO else law
    model = model if law is None else changed(model, {"friction": law}, "--law")
    names = [n.strip() for given in getattr(a, "fix", None) or [] for n in given.split(",")]
    model = model.fix(*filter(None, names), what="--fix") if names else model
    object.__setattr__(model, "file", file)  # the command says what was changed beside it
    return model


def spare(out: str, sources: Sequence[str], targets: Sequence[Path]) -> None:
    """Raise InputError if an output would overwrite an input."""
    read = {Path(name).resolve() for name in sources}
    for target in targets:
        if target.resolve() in read:
            raise InputError(
                f"--out {out} would overwrite {target}, which is an input; choose another folder."
            )
