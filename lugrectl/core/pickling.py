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
        name = str(getattr(value, "__qualname__", f"an object of the class {type(value).__name__}"))
        usual = "define what it is with def or class at the top level of a module or notebook cell"
        said = f"{what} is {name}, which cannot be pickled: {cure or usual}."
        raise NotPicklable(said) from None


def rebuilt(function: Any) -> Any:
    """The block of a function that knows how to build it."""
    return function.block()


def from_fields(cls: type, state: dict[str, Any]) -> Any:
    made: Any = object.__new__(cls)
    made.__dict__.update(state)
    return made
