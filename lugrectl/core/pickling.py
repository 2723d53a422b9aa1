"""What pickles, and one sentence about what does not."""

from __future__ import annotations

import pickle
import sys
from typing import Any

from .errors import InputError

BY_VALUE = ("cloudpickle", "dill")  # picklers that carry functions themselves, not their names


class NotPicklable(InputError, pickle.PicklingError):
    """A system holds something that cannot be pickled; the sentence names the block."""


def carried(what: str, value: Any, cure: str = "") -> None:
    """NotPicklable where a value does not pickle, unless it is copied or carried by value."""
    try:
        pickle.dumps(value)
    except NotPicklable:
        raise
    except Exception:
        frame: Any = sys._getframe()
        while frame is not None:
            home = str(frame.f_globals.get("__name__", "")).split(".")
            if home[0] == "copy" or any(name in home for name in BY_VALUE):
                return
            frame = frame.f_back
        is_what, usual = _described(value)
        said = f"{what} is {is_what}, which cannot be pickled: {cure or usual}."
        raise NotPicklable(said) from None


def _described(value: Any) -> tuple[str, str]:
    """What it is, and what to do about it."""
    where = "at the top level of a module or of a notebook cell"
    name = str(getattr(value, "__qualname__", ""))
    if str(getattr(value, "__module__", "")).startswith("control."):
        return "a function that python-control made", "give the block a function of your own"
    if "<lambda>" in name:
        return "a lambda", f"write it with def {where}"
    if name:
        return f"the function {name.split('.')[-1]}", f"define it {where}, under this name"
    return f"an object of the class {type(value).__name__}", f"define what it holds {where}"


def rebuilt(function: Any) -> Any:
    """The block of a function that knows how to build it."""
    return function.block()


def from_fields(cls: type, state: dict[str, Any]) -> Any:
    made: Any = object.__new__(cls)
    made.__dict__.update(state)
    return made
