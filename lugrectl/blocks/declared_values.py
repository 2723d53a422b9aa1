"""What a model states of a value besides the value: held, bounded, known with an uncertainty."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any

from ..core.errors import InputError
from ..core.validation import flag, positive, within
from .aliases import meant
from .block import P

KEYS = ("value", "fixed", "min", "max", "std")


@dataclass(frozen=True)
class Stated:
    """``fixed``: the value is held. ``low`` and ``high``: the fit stays between them. ``std``:
    the value is the mean of a Gaussian prior with this standard deviation. None: not stated."""

    fixed: bool = False
    low: float | None = None
    high: float | None = None
    std: float | None = None

    def clipped(self, value: float) -> float:
        """The value, or the bound beyond which it lies."""
        value = value if self.low is None else max(value, self.low)
        return value if self.high is None else min(value, self.high)

    @property
    def bounded(self) -> bool:
        return self.low is not None or self.high is not None

    def table(self) -> dict[str, Any]:
        given = {"fixed": self.fixed or None, "min": self.low, "max": self.high, "std": self.std}
        return {k: v for k, v in given.items() if v is not None}

    def words(self) -> str:
        """For a row of a table: "held", "0.1 to 0.5, prior +-0.02"."""
        if self.fixed:
            return "held"
        ends = [f"{x:g}" if x is not None else "" for x in (self.low, self.high)]
        text = f"{ends[0]} to {ends[1]}" if all(ends) else f"at least {ends[0]}"
        text = text if ends[0] else f"at most {ends[1]}"
        prior = f"prior +-{self.std:g}" if self.std is not None else ""
        return ", ".join(filter(None, [text if self.bounded else "", prior]))


NOTHING = Stated()


def declared(given: Any, p: P, where: str) -> tuple[float | None, Stated]:
    """A value of a model, None for one to be identified, and what its table states of it:
    ``{value = 0.285, fixed = true}``."""
    if not isinstance(given, Mapping):
        return None if given is None else within(given, where, p), NOTHING
    check_keys(given, KEYS, where)

    def one(key: str, at: str) -> float | None:
        found = given.get(key)
        if found is None or key != "value" and found == 0:  # a bound of a value above 0, too
            return found
        return within(found, at, p)

    value, low, high = one("value", where), one("min", f"{where}: min"), one("max", f"{where}: max")
    fixed, std = given.get("fixed", False), given.get("std")
    std = None if std is None else positive(std, f"{where}: std")
    made = Stated(flag(fixed, f"{where}: fixed"), low, high, std)
    if value is None and (fixed or std is not None):
        raise InputError(f"{where}: {'fixed' if fixed else 'std'} needs a value beside it.")
    if low is not None and high is not None and low >= high:
        raise InputError(f"{where}: min = {low:g} must be below max = {high:g}.")
    if value is not None and made.clipped(value) != value:
        bounds = Stated(low=low, high=high).words()
        raise InputError(f"{where}: value = {value:g} lies outside its own bounds, {bounds}.")
    return value, made


def check_keys(table: Mapping[str, Any], known: Iterable[str], where: str) -> None:
    for key in table:
        if key not in known:
            raise InputError(f"{where}: unknown key '{key}'; {meant(key, known)}")


def holding(
    values: Mapping[str, float | None],
    before: Mapping[str, Stated],
    names: Iterable[Any],
    where: str,
) -> dict[str, Stated]:
    """The statements with these values held; the name of an effect holds all of its values."""
    made = dict(before)
    for name in names:
        keys = [k for k in values if k == name or k.startswith(f"{name}.")]
        if not keys:
            raise InputError(f"{where}: no value of the model is '{name}'; {meant(name, values)}")
        for key in keys:
            if values[key] is None:
                raise InputError(f"{where}: {key} has no declared value to hold: give it one.")
            made[key] = replace(made.get(key, Stated()), fixed=True)
    return made


def refuse_crossed(
    values: Mapping[str, float | None], said: Mapping[str, Stated], where: str
) -> None:
    """Raise InputError if no Fs that is allowed lies above an Fc that is allowed."""
    ends = []
    for key, side, none in (("Fs", "high", math.inf), ("Fc", "low", -math.inf)):
        one, value = said.get(key, Stated()), values.get(key)
        far = value if one.fixed and value is not None else getattr(one, side)
        ends.append(none if far is None else far)
    if ends[0] < ends[1]:
        raise InputError(
            f"{where}: Fs is at most {ends[0]:g} and Fc at least {ends[1]:g}, but stiction cannot "
            "be less than Coulomb friction: hold one of them at most, or give other bounds."
        )
