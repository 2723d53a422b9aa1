"""What a user passes in: a record or a model in any of the forms in which people have them.

A record is a path, a pandas DataFrame, a dict of arrays or a ``Record``; a model is the path of
a model file, a dict, ``Parameters`` or a ``Model``.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

from ..core.errors import InputError
from ..core.validation import positive, shown, whole
from .block import members
from .law_forms import form_keys
from .model import Model, Parameters, Part, check_values, model_from_dict, restated
from .model_file import read_model

if TYPE_CHECKING:
    from ..record import Log, Record

_MODEL = "a Model, Parameters, a dict or the path of a model file"
_FILE = ("name", "motion", "plant", "friction", "effects")


def as_model(given: Any, what: str = "model") -> Model:
    """The model that is meant; InputError names the argument ``what``."""
    if isinstance(given, Model):
        check_values(given, what)
        return given
    if isinstance(given, Parameters):
        values = {"model": "lugre", **given.friction()}
        return model_from_dict({"plant": {"J": given.J}, "friction": values}, "parameters")
    if is_file(given):
        return read_model(given)
    if isinstance(given, Mapping):
        return _from_dict(given, what)
    raise InputError(f"{what} must be {_MODEL}, not {shown(given)}.")


def _from_dict(given: Mapping[Any, Any], what: str) -> Model:
    """A dict nested like a model file, or one of values by name, ``{"J": 0.002}``."""
    if isinstance(given.get("stated"), Mapping):  # the model of a JSON document
        plain = _from_dict({k: v for k, v in given.items() if k != "stated"}, what)
        return restated(plain, given["stated"], what)
    flat = set(given) - {*_FILE}
    if "plant" in given or not (flat or isinstance(given.get("friction"), str)):
        return model_from_dict({**given, "effects": _effects(given.get("effects"))}, what)
    return changed({}, {str(k): v for k, v in given.items()}, what)


def changed(given: Any, changes: Mapping[str, Any], what: str) -> Model:
    """The model ``given``, {} for one of which nothing is known, with other values by name.

    ``J``, ``name``, ``motion``, ``friction`` (the law), ``effects`` (added to those that it has);
    anything else is a parameter of the law.
    """
    data = as_model(given).to_dict(stated=True)
    changes = {k: v for k, v in changes.items() if v is not None}
    data |= {k: changes.pop(k) for k in ("name", "motion") if k in changes}
    if "J" in changes:
        data["plant"] = {"J": changes.pop("J")}
    data["effects"] = [*data["effects"], *_effects(changes.pop("effects", None))]
    law = changes.pop("friction", None)
    law = dict(law) if isinstance(law, Mapping) else {} if law is None else {"model": law}
    data["friction"] = _law(data["friction"], law | changes)
    return model_from_dict(data, what)


def _law(before: Mapping[str, Any], given: Mapping[str, Any]) -> dict[str, Any]:
    """The friction table with what is given; another law keeps the values that it has, too."""
    name, laws = given.get("model", before["model"]), members("friction")
    made = laws.get(name) if isinstance(name, str) else None
    if made is None:
        return {**before, "model": name, **given}
    own, had = ({**m.own, **form_keys(m)} for m in (made, laws[before["model"]]))
    # n is another number in each law
    kept = {k for k, p in own.items() if not p.usual or p == had.get(k)}
    return {**{k: v for k, v in before.items() if k in kept}, "model": name, **given}


def _effects(given: Any) -> list[Any]:
    """Entries as in a model file from names, dicts or a list of both."""
    if given is None:
        return []
    if isinstance(given, (str, Mapping, Part)):
        given = [given]
    if not isinstance(given, Iterable):
        raise InputError(f"effects must be a list of names or dicts, not {shown(given)}.")
    return [_entry(one) for one in given]


def _entry(given: Any) -> Any:
    if isinstance(given, str):
        return {"name": given}
    if isinstance(given, Part):
        return {"name": given.block.name, **given.values}
    return given


def values_of(p: Any, what: str = "p") -> Any:
    """An object with the parameters as attributes: p itself, or the values of a model."""
    if isinstance(p, (Model, str, os.PathLike, Mapping)):
        return SimpleNamespace(**as_model(p, what).values())
    return p


def is_file(given: Any) -> bool:
    """Whether this is a path."""
    return isinstance(given, (str, os.PathLike))


def is_last(given: Any) -> bool:
    """Whether the last half is to be held out."""
    return isinstance(given, str) and given == "last"


def is_record(given: Any) -> bool:
    """Whether this is one record, in any form, rather than several."""
    from ..record import Log, Record
    from ..record.columns.arrays import is_table

    return is_file(given) or isinstance(given, (Log, Record)) or is_table(given)


def as_record(given: Any, motion: str | None = None, what: str = "record") -> Record:
    """The record that is meant, read for a drive of that motion; InputError names the argument."""
    from ..record import Record, read_record
    from ..record.columns.arrays import FORMS

    if isinstance(given, Record):
        return given
    if is_record(given):
        return read_record(given, motion=motion)
    raise InputError(f"{what} must be {FORMS}, not {shown(given)}.")


def as_log(given: Any, motion: str | None = None, what: str = "record") -> Log | Record:
    """The log that is meant, its rows as recorded; a Record is returned as it is."""
    from ..record import Log, Record, read_log
    from ..record.columns.arrays import FORMS

    if isinstance(given, (Log, Record)):
        return given
    if is_record(given):
        return read_log(given, motion=motion)
    raise InputError(f"{what} must be {FORMS}, not {shown(given)}.")


def as_logs(given: Any, motion: str | None = None) -> tuple[tuple[Log | Record, ...], bool]:
    """The logs that are meant, and whether a list of them was given."""
    if is_file(given) and os.path.isdir(given):  # a folder stands for the logs in it
        from ..parallel.workers import files_of

        given = files_of(given)
    if is_record(given) or not isinstance(given, Iterable):
        return (as_log(given, motion),), False
    found = tuple(as_log(one, motion, "each record") for one in given)
    if not found:
        raise InputError("record is an empty list: give at least one record.")
    return found, True


def as_holdout(
    given: Any, records: Record | Sequence[Record], motion: str | None = None
) -> str | Record | None:
    """None, "last" or a record of its own."""
    if given is None or is_last(given):
        return given
    if not is_record(given):
        from ..record.columns.arrays import FORMS

        raise InputError(f"holdout must be None, 'last', {FORMS}, not {shown(given)}.")
    made = as_record(given, motion, "holdout")
    every = records if isinstance(records, Sequence) else [records]
    if any(same_samples(made, record) for record in every):
        raise InputError(
            "holdout holds the same samples as a record to fit to: give a run of its own or 'last'."
        )
    return made


def same_samples(one: Record, other: Record) -> bool:
    """Whether two records have the same samples of torque and motion."""
    if one is other:
        return True
    mine, theirs = one.channels(), other.channels()
    return one.samples == other.samples and all(
        role in theirs and bool((mine[role] == theirs[role]).all())
        for role in ("u", "w", "theta")
        if role in mine
    )


def judged_by(horizon: Any, seed: Any) -> tuple[float, int]:
    """The time between restarts in s, and the seed."""
    return positive(horizon, "horizon", "seconds"), whole(seed, "seed")
