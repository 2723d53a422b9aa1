"""What the user says of the columns of a log: names, units and factors by role."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ...core.errors import InputError
from ...core.option_names import option
from ...core.validation import shown
from .column_names import usual_names
from .units import ROLES, did_you_mean


def parse_pairs(text: str, what: str) -> dict[str, str]:
    """Read 't=time,u=torque' into a dict of role to value.

    A value may contain a comma, unless a role and '=' follow it; of "columns" it may be empty, for
    a role that no column is. ``what`` names the option
    ("columns", "units", "scale") in the InputError that is raised for any other text.
    """
    pairs: dict[str, str] = {}
    for part in re.split(r",\s*(?=\w+\s*=)", text.strip()):
        role, equals, value = (piece.strip() for piece in part.partition("="))
        if not equals or not (value or what == "columns"):
            raise InputError(
                f"{option(what)}: '{part.strip()}' is not of the form role=value; "
                f"roles are {', '.join(ROLES)}."
            )
        if role in pairs:
            raise InputError(f"{option(what)}: {role} is given twice.")
        pairs[role] = value
    _known_roles(pairs, what)
    return pairs


def texts(given: Mapping[str, str] | str | None, what: str) -> dict[str, str]:
    """An option that gives a text by role, as a dict; InputError names ``what``."""
    if isinstance(given, str):
        return parse_pairs(given, what)
    _is_mapping(given, what)
    pairs = {str(role): str(value) for role, value in (given or {}).items()}
    _known_roles(pairs, what)
    return pairs


def factors(given: Mapping[str, float] | str | None) -> dict[str, float]:
    """The option ``scale``, a number other than 0 by role, as a dict."""
    _is_mapping(given, "scale")
    pairs: dict[str, Any] = (
        parse_pairs(given, "scale")
        if isinstance(given, str)
        else {str(role): factor for role, factor in (given or {}).items()}
    )
    _known_roles(pairs, "scale")
    found = {}
    for role, text in pairs.items():
        found[role] = _quotient(text)
        if not np.isfinite(found[role]) or found[role] == 0:
            raise InputError(
                f"{option('scale')}: '{text}' for {role} is not a number other than 0."
            )
    return found


def _quotient(text: Any) -> float:
    """The number in a text such as 0.35, 2pi/16384 or 1/7; NaN for any other."""
    value = 1.0
    try:
        for k, part in enumerate(str(text).replace(" ", "").lower().split("/")):
            for factor in re.sub(r"(?<=[\d.])pi", "*pi", part).split("*"):
                number = np.pi if factor == "pi" else float(factor)
                value = value / number if k else value * number
    except (ValueError, ZeroDivisionError):
        return np.nan
    return value


def check_used(source: str, present: Sequence[str], **options: Mapping[str, object]) -> None:
    """Raise InputError for an option about a role that the log does not have."""
    for what, given in options.items():
        for role in given:
            if role not in present:
                raise InputError(f"{option(what)} names {role}, but {source} has no column for it.")


def _known_roles(given: Mapping[str, object], what: str) -> None:
    for role in given:
        if role not in ROLES:
            raise InputError(
                f"{option(what)}: there is no role '{role}'{_meant(role)}; roles are "
                f"{', '.join(ROLES)}."
            )


def _meant(role: str) -> str:
    """A hint at the role: of a usual name such as torque, or of a word that is misspelt."""
    own = next((r for r in ROLES if role.lower() in usual_names(r)), None)
    return f" ({role} is '{own}')" if own else did_you_mean(role, ROLES)


def _is_mapping(given: Any, what: str) -> None:
    if not (given is None or isinstance(given, (str, Mapping))):
        raise InputError(
            f"{what} must be a dict by role, such as {{'u': ...}}, or a text, u=..., "
            f"not {shown(given)}."
        )
