"""Gains of the controller and of the observer for a model."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

from ..blocks.model import Model, values_of
from ..blocks.observers import Gain, observer_block
from ..core.errors import InputError
from ..core.validation import number, positive, shown
from ..design import Certificate, certify, design_gains
from ..design.gains import RULES
from ..loops.parts import all_at
from ..simulation.encoder import Sensing

LIGHT = 0.1  # of critical damping; with less damping by sigma1 design_gains is not used
LAG = 0.4  # rad that sampling and dead time take at the crossover
LUGRE = ("J", "sigma0", "sigma1", "Fc", "Fs", "Fv", "vs")
K = 0.35  # of an observer that the tracking error corrects, where no bristles say how much


def controller(
    given: Mapping[str, float | None], kind: str, rate: float, J: float
) -> dict[str, float]:
    """Return the given gains; if none is given, those with every pole at -rate."""
    names = ("kp", "ki") if kind == "velocity" else ("kp", "ki", "kd")
    if any(v is not None for v in given.values()):
        return {k: 0.0 if given[k] is None else number(given[k], k) for k in names}
    return all_at(kind, J, positive(rate, "bandwidth", "1/s"))


def fastest(sensing: Sensing) -> float:
    """Return the crossover in rad/s that sampling and dead time allow."""
    return LAG / (0.5 * sensing.dt * (1.0 + (sensing.speed_noise is None)) + sensing.delay)


def correction(known: Mapping[str, Any], bandwidth: float) -> float:
    """Return k that adds as much integral as the PI of this crossover has."""
    if not known.get("sigma0"):
        return K
    k = known["J"] * bandwidth**2 / 20.0 / known["sigma0"]
    damping = known.get("sigma1") or 0.0
    return float(min(k, 0.5 * known["J"] * bandwidth / damping) if damping else k)


def lacking(name: str, model: Model) -> list[str]:
    """Return the parameters that an observer must know and a model does not give."""
    needs, have = observer_block(name).parameters, model.values()
    return [k for k in LUGRE if k in needs and have.get(k) is None]


def unknown(name: str, model: Model) -> str | None:
    """Return why an observer cannot be given its parameters; None if it can."""
    if not (missing := lacking(name, model)):
        return None
    law = model.friction.block.name
    return f"it must know {', '.join(missing)}, which the model with {law} friction does not have."


def given_gains(gains: Any) -> dict[str, dict[str, Any]]:
    """Return gains by the full name of an observer, checked."""
    if gains is None:
        return {}
    if not isinstance(gains, Mapping) or not all(isinstance(v, Mapping) for v in gains.values()):
        raise InputError(f"gains must be a dict of dicts by observer, not {shown(gains)}.")
    checked = {observer_block(name).name: dict(own) for name, own in gains.items()}
    for name, own in checked.items():
        observer_block(name).check(own)
    return checked


def designed(
    model: Model, name: str, dt: float, speed: float, **more: float
) -> tuple[dict[str, Any], Certificate]:
    """Return gains of an observer by its rule, at a sample time and a speed of the drive."""
    usual = {"dt": dt, "M": 1.5 * speed, "speed": speed, "w0": 0.2 * speed} | more
    choices = RULES[name].choices if name in RULES else {}
    own: dict[str, Any] = {k: v for k, v in usual.items() if k in choices}
    design = design_gains(values_of(model), observer=name, **own)
    return dict(design.gains), design.certificate


class Chosen(NamedTuple):
    """Gains of an observer, the same as plain values, and the certificate."""

    gains: dict[str, Any]
    plain: dict[str, Any]
    certificate: Certificate | None


def observer_gains(
    believed: Model, name: str | None, K1: Gain | None, K2: Gain | None, gains: Any
) -> Chosen:
    """Return the gains of an observer; K1 and K2 that are left out by design."""
    if not (gains is None or isinstance(gains, Mapping)):
        raise InputError(f"gains must be a dict of numbers by name, not {shown(gains)}.")
    own = dict(gains or {})
    if name is None or observer_block(name).name != "proposed_observer":
        own |= {k: K for k, K in (("K1", K1), ("K2", K2)) if K is not None}
        return Chosen(own, _plain(own), None)
    if (K1 is None) != (K2 is None):
        raise InputError("give both K1 and K2, or neither.")
    numbers = not (callable(K1) or callable(K2))
    if numbers and "sigma1" not in believed.friction.values:
        raise InputError(
            f"the {name} observer copies LuGre friction, but {believed.name} has "
            f"'{believed.friction.block.name}' friction; choose observer='disturbance' or None."
        )
    known = believed.known()
    critical = 2.0 * math.sqrt(known.get("J", 0.0) * known.get("sigma0", 0.0))
    if K1 is not None:
        own |= {"K1": K1, "K2": K2}
    elif known.get("sigma1", math.inf) < LIGHT * critical:
        # with sigma1 = 0 the errors at rest have the polynomial s^2 + (K2/J) s - K1 sigma0/J:
        # this puts both poles at -sqrt(sigma0/J)
        own |= {"K1": -1.0, "K2": critical}
    else:
        own |= design_gains(believed).gains
    plain = _plain(own)
    return Chosen(own, plain, certify(believed, own["K1"], own["K2"]) if numbers else None)


def _plain(gains: Mapping[str, Any]) -> dict[str, Any]:
    return {k: "a function of w" if callable(v) else number(v, k) for k, v in gains.items()}
