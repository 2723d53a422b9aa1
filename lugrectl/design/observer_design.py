"""Gains of any observer by its design rule, in the same form as those of the proposed one."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

from ..blocks.aliases import meant
from ..blocks.model import values_of
from ..blocks.observers import observer_block
from ..core.display import Row
from ..core.errors import InputError
from ..core.result import Result
from ..core.validation import number, shown
from .certificate import Certificate
from .observer_rules import RULES, Rule

DAMPED = ("existing_observer", "lyapunov_observer", "temperature_observer", "normal_force_observer")


@dataclass(frozen=True, repr=False)
class ObserverDesign(Result):
    """Gains of an observer by its rule, and what they guarantee.

    ``gains`` holds them by name, for ``velocity_loop(p, design.observer, **design.gains)`` or
    ``gains=design.gains`` of any loop. ``choices``: what the rule was given.

    Attributes
    ----------
    observer : str
        Its name, without ``_observer``.
    gains : dict
        By name, for ``velocity_loop(p, design.observer, **design.gains)`` or ``gains=design.gains``
        of any loop.
    choices : dict
        What the rule was given.
    certificate : Certificate
        What the gains guarantee.

    Examples
    --------
    >>> p = lg.table1()
    >>> design = lg.design_gains(p, observer="extended_state", bandwidth=200.0)
    >>> design.gains
    {'bandwidth': 200.0}
    >>> loop = lg.velocity_loop(p, design.observer, **design.gains)
    """

    observer: str
    gains: Mapping[str, float]
    choices: Mapping[str, float]
    certificate: Certificate

    @property
    def method(self) -> str:
        """The name of the rule."""
        return self.certificate.lemma

    def _title(self) -> str:
        return f"Design: {self.observer} observer"

    def _rows(self) -> Iterable[Row]:
        declared = observer_block(self.observer).parameters
        units = {k: declared[k].unit for k in self.gains}
        gains = [Row(k, v, "" if units[k] == "1" else units[k]) for k, v in self.gains.items()]
        gains = gains or [Row("gains", "it has none")]
        return [*gains, Row("certificate", self.certificate), *self.certificate._rows()]

    def summary(self) -> dict[str, Any]:
        """Plain Python."""
        own = {"observer": self.observer, "gains": dict(self.gains), "choices": dict(self.choices)}
        return own | {"certificate": self.certificate.summary()}


def design_observer(p: Any, observer: str, choices: Mapping[str, Any]) -> ObserverDesign:
    """The gains of an observer other than the proposed one; see :func:`design_gains`."""
    made = observer_block(observer)
    short = made.name.removesuffix("_observer")
    rule = RULES.get(made.name)
    if rule is None:
        raise InputError(
            f"there is no design rule for {made.name}: choose its gains yourself and test them "
            "with lugrectl.compare_observers."
        )
    given = _chosen(short, rule, choices)
    gains, claim = rule.build(_values(p, made.name, rule), given)
    own = {k: v for k, v in given.items() if v is not None}
    return ObserverDesign(short, gains, own, claim.certificate(short))


def _chosen(short: str, rule: Rule, choices: Mapping[str, Any]) -> dict[str, Any]:
    """The choices of a rule with those given; each a number above 0, or 0 where that is usual."""
    made = dict(rule.choices)
    for key, value in choices.items():
        if key not in made:
            hint = meant(key, made) if made else "it has none."
            raise InputError(f"the design rule of {short} has no choice '{key}'; {hint}")
        least = number(value, key)
        if least < 0.0 or (least == 0.0 and rule.choices[key] != 0.0):
            raise InputError(f"{key} must be a positive number, not {shown(value)}.")
        made[key] = least
    return made


def _values(p: Any, name: str, rule: Rule) -> SimpleNamespace:
    """The values of the drive that a rule needs, checked."""
    have, needed = values_of(p), rule.needs.split()
    missing = [k for k in needed if getattr(have, k, None) is None]
    if missing:
        raise InputError(f"the design rule of {name} needs {', '.join(missing)} of the drive.")
    found = {k: number(getattr(have, k), k) for k in needed}
    for key, value in found.items():
        free = key == "Fv" or (key == "sigma1" and name not in DAMPED)
        if value < 0.0 or (value == 0.0 and not free):
            raise InputError(f"{key} = {value:g}: the design rule of {name} needs {key} > 0.")
    return SimpleNamespace(**found)
