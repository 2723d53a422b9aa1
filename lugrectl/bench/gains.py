"""Gains of the controller and of the observer for a model."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from ..blocks.model import Model
from ..blocks.observers import Gain, observer_block
from ..core.errors import InputError
from ..core.validation import number, positive, shown
from ..design import Certificate, certify, design_gains

LIGHT = 0.1  # of critical damping; with less damping by sigma1 design_gains is not used


def controller(
    given: Mapping[str, float | None], kind: str, p: float, J: float
) -> dict[str, float]:
    """The given gains; if none is given, those that put every pole of J s^2 + kp s + ki, or of
    J s^3 + kd s^2 + kp s + ki, at -p."""
    names = ("kp", "ki") if kind == "velocity" else ("kp", "ki", "kd")
    if any(v is not None for v in given.values()):
        return {k: 0.0 if given[k] is None else number(given[k], k) for k in names}
    p = positive(p, "bandwidth", "1/s")
    if kind == "velocity":
        return {"kp": 2.0 * J * p, "ki": J * p**2}
    return {"kp": 3.0 * J * p**2, "ki": J * p**3, "kd": 3.0 * J * p}


def observer_gains(
    believed: Model,
    name: str | None,
    K1: Gain | None,
    K2: Gain | None,
    gains: Mapping[str, Any] | None,
) -> tuple[dict[str, Any], dict[str, Any], Certificate | None]:
    """Gains of the observer, the same as plain values, and the certificate."""
    if not (gains is None or isinstance(gains, Mapping)):
        raise InputError(f"gains must be a dict of numbers by name, not {shown(gains)}.")
    own = dict(gains or {})
    if name is None or observer_block(name).name != "proposed_observer":
        own |= {k: K for k, K in (("K1", K1), ("K2", K2)) if K is not None}
        return own, _plain_gains(own), None
    if (K1 is None) != (K2 is None):
        raise InputError("give both K1 and K2, or neither.")
    if K1 is None or K2 is None:
        _lugre(believed, name)
        K1, K2 = _designed(believed)
    own |= {"K1": K1, "K2": K2}
    plain = _plain_gains(own)
    if K1 is None or K2 is None or callable(K1) or callable(K2):
        return own, plain, None
    _lugre(believed, name)
    return own, plain, certify(believed, K1, K2)


def _designed(model: Model) -> tuple[Any, Any]:
    """K1, K2 of ``design_gains``; with a small sigma1 those that place both poles at rest.

    With sigma1 = 0 the errors at rest have the characteristic polynomial
    s^2 + (K2/J) s - K1 sigma0/J: K1 = -1, K2 = 2 sqrt(J sigma0) put both poles at -sqrt(sigma0/J).
    """
    known = model.known()
    critical = 2.0 * math.sqrt(known.get("J", 0.0) * known.get("sigma0", 0.0))
    if known.get("sigma1", math.inf) < LIGHT * critical:
        return -1.0, critical
    made = design_gains(model)
    return made.K1, made.K2


def _lugre(model: Model, name: str) -> None:
    if "sigma1" not in model.friction.values:
        raise InputError(
            f"the {name} observer copies LuGre friction, but {model.name} has "
            f"'{model.friction.block.name}' friction; choose observer='disturbance' or None."
        )


def _plain_gains(gains: Mapping[str, Any]) -> dict[str, Any]:
    return {k: "a function of w" if callable(v) else number(v, k) for k, v in gains.items()}
