"""Blocks by the names that the field uses for them."""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import Any

from ..core.errors import InputError
from ..core.option_names import option
from ..core.validation import nearest, shown
from .block import Block, is_ours, members

# Only names with one meaning: "dead band" may be a backlash or a dead zone, so it is not here.
_COMMON = {
    "constant_torque": "torque_offset offset_torque",
    "gravity": "unbalance imbalance",
    "torque_ripple": "cogging cogging_torque detent detent_torque",
    "hard_stop": "end_stop endstop mechanical_stop",
    "thermal_drift": "warm_up warmup",
    "quadratic_drag": "windage air_drag aerodynamic_drag",
    "sublinear_viscous": "shear_thinning",
    "dwell_stiction": "stiction_growth aging frictional_aging",
    "stribeck": "stribeck_effect",
    "presliding": "pre_sliding",
    "input_delay": "dead_time transport_delay time_delay",
    "actuator_lag": "motor_lag current_loop_lag",
    "actuator_saturation": "saturation torque_limit current_limit",
    "actuator_dead_zone": "dead_zone deadzone",
    "torque_constant_ripple": "kt_ripple",
    "elastic_coupling": "joint_flexibility flexible_joint compliance two_mass",
    "backlash": "play lost_motion free_play gear_play clearance",
    "inertia_step": "payload_change",
    "pose_dependent_inertia": "variable_inertia",
    "velocity_sensor_lag": "velocity_filter speed_filter",
    "encoder_eccentricity": "eccentric_encoder encoder_runout",
}
COMMON = {common: name for name, many in _COMMON.items() for common in many.split()}


def name_of(kind: str, given: Any) -> Any:
    """The name of a block that stands in its place; anything else but a system as it is."""
    if isinstance(given, Block):
        if given.kind != kind:
            raise InputError(
                f"{given.name} is declared as {_word(given.kind)}, not as {_word(kind)}."
            )
        return given.name
    if hasattr(given, "ninputs") and hasattr(given, "noutputs"):
        raise InputError(
            f"{given.name} is a python-control system: give the name of the {_word(kind)} in its "
            "place and the values beside it, or write its equations as a function below "
            f'@lg.block("{kind}", ...); or wire the system by lg.simulate([...], t).'
        )
    factory = callable(given) and is_ours(getattr(given, "__module__", None) or "")
    return given.__name__ if factory and given.__name__ in members(kind) else given


def _word(kind: str) -> str:
    return "friction law" if kind == "friction" else kind


def listed(kind: str, given: Any) -> Any:
    """One name or block, or several, as a list of names; anything else as it is."""
    one = isinstance(given, str) or callable(given) or hasattr(given, "ninputs")
    several = [given] if one else given
    return [name_of(kind, g) for g in several] if isinstance(several, (list, tuple)) else several


def block_named(kind: str, name: Any, *, where: str = "", what: str = "") -> Block:
    """The registered block that a name means; an effect may be called by a common name, an
    observer without ``_observer``.

    A registered name goes first, so a user's own effect ``cogging`` is not ``torque_ripple``. The
    sentence of the error starts with ``where`` and calls the kind ``what``.
    """
    known, name = members(kind), name_of(kind, name)
    if isinstance(name, str) and name in known:
        return known[name]
    names = COMMON | {_spelling(k): k for k in known} if kind == "effect" else {}
    names = names or {_spelling(k.removesuffix(f"_{kind}")): k for k in known}
    typed = _spelling(name).removesuffix(f"_{kind}")
    if names.get(typed) in known:
        return known[names[typed]]
    short = [k.removesuffix(f"_{kind}") for k in known if k != "no_observer"]
    hint = meant(typed, names, ", ".join(short))
    start = f"{where}: " if where else ""
    raise InputError(
        f"{start}there is no {what or _word(kind)} named {shown(name)}; {hint} One of your own: "
        f"{option('blocks', 'FILE.py')}."
    )


def meant(name: Any, known: Iterable[str], all_of: str = "") -> str:
    """What a sentence says of a mistyped name: the nearest known one, or all."""
    spelt = {_spelling(k): k for k in known}
    near = nearest(_spelling(name), spelt)
    all_of = all_of or ", ".join(spelt.values()) or "none"
    return f"did you mean '{spelt[near]}'?" if near else f"known: {all_of}."


def also_called(kind: str, name: str) -> tuple[str, ...]:
    """The common names of an effect, without those that a registered block has."""
    known = members(kind) if kind == "effect" else COMMON
    return tuple(c for c, meant in COMMON.items() if meant == name and c not in known)


def _spelling(name: Any) -> str:
    return re.sub(r"[\s_-]+", "_", str(name).strip().lower())
