"""What a model states of a value besides the value: held, bounded, known with an uncertainty."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from ..core.errors import InputError
from ..core.validation import nearest, number, positive

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
        """As in a model file, without the value."""
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


def stated(
    given: Mapping[str, Any], value: float | None, check: Callable[..., Any], where: str
) -> Stated:
    """What the table of a value states, ``{value = 0.285, fixed = true}``."""
    check_keys(given, KEYS, where)
    fixed, std = given.get("fixed", False), given.get("std")
    if not isinstance(fixed, bool):
        raise InputError(f"{where}: fixed must be true or false, not {fixed!r}.")

    def bound(end: str) -> float | None:
        if given.get(end) is None:
            return None
        made = number(given[end], f"{where}: {end}")
        return made and check(made, where=f"{where}: {end}")  # 0 is a bound of a value above 0

    low, high = bound("min"), bound("max")
    std = None if std is None else positive(std, f"{where}: std")
    if value is None and (fixed or std is not None):
        raise InputError(f"{where}: {'fixed' if fixed else 'std'} needs a value beside it.")
    if low is not None and high is not None and low >= high:
        raise InputError(f"{where}: min = {low:g} must be below max = {high:g}.")
    made = Stated(fixed, low, high, std)
    if value is not None and made.clipped(value) != value:
        raise InputError(
            f"{where}: value = {value:g} lies outside its own bounds, "
            f"{Stated(low=low, high=high).words()}."
        )
    return made


def check_keys(table: Mapping[str, Any], known: Iterable[str], where: str) -> None:
    """Raise InputError for a key that is not known, with the nearest one that is."""
    for key in table:
        if key not in known:
            raise InputError(
                f"{where}: unknown key '{key}'; known: {', '.join(known)}.{_hint(key, known)}"
            )


def _hint(name: Any, known: Iterable[str]) -> str:
    near = nearest(str(name), known)
    return f" Did you mean '{near}'?" if near else ""


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
            raise InputError(
                f"{where}: the model has no value named '{name}'; it has {', '.join(values)}."
                f"{_hint(name, values)}"
            )
        for key in keys:
            if values[key] is None:
                raise InputError(f"{where}: {key} has no declared value to hold: give it one.")
            old = made.get(key, Stated())
            made[key] = Stated(True, old.low, old.high, old.std)
    return made


def refuse_crossed(
    values: Mapping[str, float | None], said: Mapping[str, Stated], where: str
) -> None:
    """Raise InputError if no Fs that is allowed lies above an Fc that is allowed."""

    def end(key: str, side: str, none: float) -> float:
        """The farthest value that a parameter may have; infinite if nothing limits it."""
        one, value = said.get(key, Stated()), values.get(key)
        far = value if one.fixed and value is not None else getattr(one, side)
        return none if far is None else far

    most, least = end("Fs", "high", math.inf), end("Fc", "low", -math.inf)
    if most < least:
        raise InputError(
            f"{where}: Fs is at most {most:g} and Fc at least {least:g}, but stiction cannot be "
            "less than Coulomb friction: hold one of them at most, or give other bounds."
        )
