"""What a generator of records hands over, and what a judge answers."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

Estimate = tuple[float, float | None, float | None]  # value, 95 % interval where there is one
EFFECTS = (  # the twenty that a drive's log can show
    "constant_torque",
    "gravity",
    "torque_ripple",
    "position_dependent_friction",
    "coulomb_asymmetry",
    "viscous_asymmetry",
    "quadratic_drag",
    "thermal_drift",
    "load_dependent_friction",
    "input_delay",
    "actuator_lag",
    "actuator_dead_zone",
    "return_spring",
    "hard_stop",
    "elastic_coupling",
    "backlash",
    "inertia_step",
    "friction_step",
    "periodic_disturbance",
    "torque_constant_ripple",
)


@dataclass(frozen=True)
class Question:
    """One record with what is true of it.

    ``record``: ``t`` and ``u`` with ``theta``, ``w`` or both, equally long, s, N m, rad, rad/s.
    ``model``: the declared model as the tables of a model file; its values may be 10 or 20 % off.
    ``effect``: the one to be named, ``none``, or a name outside the catalogue.
    ``signals``: for an effect outside the catalogue, sets of signals that are right answers.
    ``background``: names that may stand beside it and are not wrong.
    ``values``: true parameters by name (``J``, ``Fc``, ``Fv``, ``effect.parameter``).
    ``hidden``, ``friction``: RMS torque of the effect (0 where it is none) and of friction, N m.
    ``alike``: other names that explain this record as well, found with the generator's own physics.
    """

    seed: int
    kind: str
    record: dict[str, np.ndarray]
    model: dict[str, Any]
    effect: str
    values: dict[str, float]
    signals: tuple[frozenset[str], ...] = ()
    background: frozenset[str] = frozenset()
    hidden: float = 0.0
    friction: float = 0.0
    alike: frozenset[str] = frozenset()
    about: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Answer:
    """What a judge says of a log.

    ``verdict``: as in the package, or "crash" or "timeout". ``effects`` are names, the likeliest
    first; ``alternatives`` explain as well. ``parameters``: name -> (value, low, high).
    ``left``: share of RMS torque that remains. ``seconds`` and ``cpu``: after all imports.
    ``reason``: of a refusal, or of there being no answer.
    """

    verdict: str
    effects: tuple[str, ...] = ()
    alternatives: tuple[str, ...] = ()
    depends_on: tuple[str, ...] = ()
    parameters: dict[str, Estimate] = field(default_factory=dict)
    left: float | None = None
    seconds: float = float("nan")
    cpu: float = float("nan")
    reason: str = ""
