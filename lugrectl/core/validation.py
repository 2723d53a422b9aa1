"""Single values that a user gives: numbers, whole numbers, arrays, paths."""

from __future__ import annotations

import difflib
import math
import numbers
import os
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from types import BuiltinFunctionType, FunctionType
from typing import Any

import numpy as np

from .errors import InputError

TINY = 1e-6  # a least value below this stands for "above 0"
_LONG = 60  # characters of a value that a sentence repeats
_PLAIN = (str, bytes, int, float, complex, list, tuple, dict, set, type(None))


def nearest(word: str, known: Iterable[str], cutoff: float = 0.6) -> str | None:
    """The known word that a word resembles most, in any case; None if it resembles none."""
    by_lower = {name.lower(): name for name in known}
    near = difflib.get_close_matches(word.lower(), by_lower, n=1, cutoff=cutoff)
    return by_lower[near[0]] if near else None


def like_it(path: Path) -> str:
    """ " (did you mean run.csv?)" where a file of nearly this name is beside it, else ""."""
    try:
        near = nearest(path.name, [entry.name for entry in os.scandir(path.parent)], 0.75)
    except (OSError, ValueError):
        return ""
    return f" (did you mean {path.with_name(near)}?)" if near else ""


def shown(value: Any) -> str:
    """A value in a sentence: itself where it is short, else what it is."""
    value = value.item() if isinstance(value, np.generic) else value
    kind = type(value).__name__
    if isinstance(value, (FunctionType, BuiltinFunctionType, type)):
        return f"the {'class' if isinstance(value, type) else 'function'} {value.__name__}"
    if isinstance(value, np.ndarray) and value.size > 4:
        return f"an array of shape {value.shape}"
    if isinstance(value, (*_PLAIN, np.ndarray)):
        try:
            text = " ".join(repr(value).split())
        except ValueError:  # Python writes no whole number of more than 4300 digits
            return "a whole number of thousands of digits"
        return text if len(text) <= _LONG else f"{text[: _LONG - 4]} ..."
    return f"{'an' if kind[:1].lower() in 'aeiou' else 'a'} {kind}"


def real(value: Any) -> float | None:
    """A real number as a float, inf and nan too; None for all else and for what no float holds."""
    if isinstance(value, np.generic) or (isinstance(value, np.ndarray) and value.ndim == 0):
        value = value.item()
    if isinstance(value, bool) or not isinstance(value, numbers.Real):
        return None
    try:
        return float(value)
    except OverflowError:
        return None


def number(value: Any, name: str) -> float:
    """A finite float; InputError names the argument."""
    made = real(value)
    if made is None:
        raise InputError(f"{name} must be a number, not {shown(value)}.")
    if not math.isfinite(made):
        raise InputError(f"{name} must be finite, not {made}.")
    return made


def positive(value: Any, name: str, unit: str = "") -> float:
    """A finite float above 0; InputError names the argument."""
    made = real(value)
    if made is None or not (math.isfinite(made) and made > 0.0):
        of = f" of {unit}" if unit else ""
        raise InputError(f"{name} must be a positive number{of}, not {shown(value)}.")
    return made


def not_negative(value: Any, name: str) -> float:
    """A finite float from 0 on; InputError names the argument."""
    made = number(value, name)
    if made < 0.0:
        raise InputError(f"{name} = {made:g} is negative.")
    return made


def share(value: Any, name: str) -> float:
    """A number between 0 and 1, both excluded."""
    found = positive(value, name)
    if found >= 1.0:
        raise InputError(f"{name} is {found:g}; give a share below 1, such as 0.01.")
    return found


def whole(value: Any, name: str, least: int = 0) -> int:
    """A whole number from ``least`` on; InputError names the argument."""
    made = real(value)
    if made is None or not made.is_integer() or made < least:
        raise InputError(f"{name} must be a whole number from {least} on, not {shown(value)}.")
    return int(value)


def flag(value: Any, name: str) -> bool:
    """True or False; InputError names the argument."""
    if not isinstance(value, (bool, np.bool_)):
        raise InputError(f"{name} must be True or False, not {shown(value)}.")
    return bool(value)


def array(value: Any, name: str) -> np.ndarray:
    """A new float64 array, a masked sample nan; InputError for what holds no real numbers."""
    try:
        made = np.asarray(value)
    except ValueError:
        what = f"a list of unequal parts, {shown(value)}"
        raise InputError(f"{name} must be real numbers, not {what}.") from None
    try:
        if isinstance(value, np.ma.MaskedArray):
            return np.array(np.ma.filled(value.astype(float), np.nan))
        if made.dtype.kind == "O":  # float() takes text and complains of what is no number
            if any(isinstance(item, (str, bytes)) for item in made.flat):
                raise TypeError
        elif made.dtype.kind not in "biuf":
            raise TypeError
        return np.array(made, dtype=float)
    except (TypeError, ValueError, OverflowError):
        pass
    long = f"an array of {made.dtype}" if made.ndim and made.size > 4 else shown(value)
    raise InputError(
        f"{name} must be real numbers, not {'complex ones' if made.dtype.kind == 'c' else long}."
    )


def within(value: Any, name: str, p: Any) -> float:
    """A value that a parameter declared as p can have; infinite only where p is neutral there."""
    made = real(value)
    if made is None or math.isnan(made):
        raise InputError(f"{name} must be a number, not {shown(value)}.")
    if math.isinf(made) and made != p.neutral:
        raise InputError(f"{name} must be finite, not {made}.")
    if made < p.low and 0.0 < p.low < TINY:
        raise InputError(f"{name} = {made:g} must be above 0 {p.unit}.")
    if not p.low <= made <= p.high:
        raise InputError(f"{name} = {made:g} lies outside [{p.low:g}, {p.high:g}] {p.unit}.")
    if p.choices and made not in p.choices:
        known = " or ".join(f"{c:g}" for c in p.choices)
        raise InputError(f"{name} = {made:g} must be {known}.")
    return made


def one_name(value: Any) -> str:
    """The name of a block; python-control allows no dot in it."""
    if not isinstance(value, str) or not value or "." in value:
        raise InputError(f"name must be a text without dots, not {shown(value)}.")
    return value


def names(value: Any, what: str) -> list[str]:
    """A list of names, or one; InputError names the argument."""
    made = [value] if isinstance(value, str) else value
    if not isinstance(made, (list, tuple)) or not all(isinstance(name, str) for name in made):
        raise InputError(f"{what} must be a name or a list of names, not {shown(value)}.")
    return list(made)


def text(value: Any, name: str) -> str:
    """A text; InputError names the argument."""
    if not isinstance(value, str):
        raise InputError(f"{name} must be a text, not {shown(value)}.")
    return value


def as_path(value: Any, name: str) -> Path:
    """A path; InputError for what is no name of a file."""
    if not isinstance(value, (str, os.PathLike)) or "\0" in str(value):
        raise InputError(f"{name} must be the path of a file, not {shown(value)}.")
    return Path(value)


def renamed(block: str, what: str, own: Sequence[str], wanted: Sequence[str] | None) -> list[str]:
    """The names of a block's signals: its own, or as many others."""
    if wanted is None:
        return list(own)
    wanted = names(wanted, f"{block}: {what}")
    if len(wanted) != len(own):
        raise InputError(f"{block} has the {what} {', '.join(own)}: give {len(own)} names.")
    return wanted


def is_file(given: Any) -> bool:
    """Whether this is a path."""
    return isinstance(given, (str, os.PathLike))


def holds_samples(given: Mapping[Any, Any]) -> bool:
    """Whether a dict holds arrays or lists of numbers; the lists of a model stand in its tables."""
    return any(
        bool(x) and real(x[0]) is not None
        if isinstance(x, (list, tuple))
        else bool(getattr(x, "shape", ()))
        for x in given.values()
    )
