"""Friction laws of more than one form: a free exponent, a number of elements.

What an entry of a model file gives decides which form a law has. A form is a block under the
law's own name; without such a key the law is the registered block.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from .block import Block, P


def _nothing(made: Block) -> dict[str, Any]:
    return {}


@dataclass(frozen=True)
class Form:
    """The keys that an entry may give besides the parameters of the registered block.

    Parameters
    ----------
    keys : dict
        Declarations by key.
    build : callable
        ``build(entry, where)`` returns the block and the entry with its parameters alone;
        InputError, starting with ``where``, for what cannot be meant.
    written : callable
        ``written(block)``: the entry's keys that are no parameters of the block.
    """

    keys: Mapping[str, P]
    build: Callable[[Mapping[str, Any], str], tuple[Block, Mapping[str, Any]]]
    written: Callable[[Block], dict[str, Any]] = _nothing


FORMS: dict[str, Form] = {}


def form_keys(made: Block) -> Mapping[str, P]:
    """The keys of a law's form; none for other blocks."""
    form = FORMS.get(made.name) if made.kind == "friction" else None
    return form.keys if form else {}


def usual_values(made: Block, entry: Mapping[str, Any]) -> dict[str, float]:
    """The usual values of a block that an entry does not give: they are held."""
    return {k: p.value for k, p in made.own.items() if p.usual and entry.get(k) is None}


def with_usual(made: Block, entry: Mapping[str, Any]) -> Mapping[str, Any]:
    """The entry of a law or effect with each usual value that it does not give: held."""
    usual = usual_values(made, entry)
    return {**entry, **{k: {"value": value, "fixed": True} for k, value in usual.items()}}


def formed(made: Block, entry: Mapping[str, Any], where: str) -> tuple[Block, Mapping[str, Any]]:
    """The block that an entry means, and the entry with the block's parameters alone."""
    given = {k for k in form_keys(made) if entry.get(k) is not None}
    return FORMS[made.name].build(entry, where) if given else (made, entry)


def written_form(made: Block) -> dict[str, Any]:
    """The law's name, and what an entry must give besides the parameters to mean this block."""
    more = FORMS[made.name].written(made) if form_keys(made) else {}
    return {"model": made.name, **more}
