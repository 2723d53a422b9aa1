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
    """Read 't=time,u=torque' into a dict of role to value; ``what`` names the option. A value may
    hold a comma if no role and '=' follow; of "columns" it may be empty, for a role without
    column."""
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
    return _known_roles(pairs, what)


def texts(given: Any, what: str) -> dict[str, str]:
    """An option that gives a text by role, as a dict; InputError names ``what``."""
    return {role: str(value) for role, value in _by_role(given, what).items()}


def factors(given: Any) -> dict[str, float]:
    """The option ``scale``, a number other than 0 by role, as a dict."""
    found = {}
    for role, text in _by_role(given, "scale").items():
        found[role] = _quotient(text)
        if not np.isfinite(found[role]) or found[role] == 0:
            raise InputError(
                f"{option('scale')}: '{text}' for {role} is not a number other than 0."
            )
    return found


def _by_role(given: Any, what: str) -> dict[str, Any]:
    if isinstance(given, str):
        return parse_pairs(given, what)
    if not (given is None or isinstance(given, Mapping)):
        raise InputError(
            f"{what} must be a dict by role, such as {{'u': ...}}, or a text, u=..., "
            f"not {shown(given)}."
        )
    return _known_roles({str(role): value for role, value in (given or {}).items()}, what)


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


def _known_roles(given: dict[str, Any], what: str) -> dict[str, Any]:
    """The same; InputError for a role that does not exist, with the one that may be meant."""
    for role in given:
        if role not in ROLES:
            known = next((r for r in ROLES if role.lower() in usual_names(r)), None)
            meant = f" ({role} is '{known}')" if known else did_you_mean(role, ROLES)
            raise InputError(
                f"{option(what)}: there is no role '{role}'{meant}; roles are {', '.join(ROLES)}."
            )
    return given
