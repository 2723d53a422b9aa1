"""Logs of this simulator as questions, in the words of the catalogue; for reports only.

``effect`` and ``unknown``: one clear effect beside small things. ``none``: small things only.
``sound`` and ``dip``: not even those.
"""

from __future__ import annotations

import numpy as np

from ..scores.points import LAW
from ..scores.question import Question
from .drawing import draw as draw_log
from .drawing import draw_effect

NAMES = {  # name here: name in the catalogue, and its parameters as they are called here
    "torque ripple": ("torque_ripple", {"amplitude": "rip_a", "harmonic": "rip_n"}),
    "gravity": ("gravity", {"amplitude": "grav", "phase": "grav_ph"}),
    "constant torque": ("constant_torque", {"torque": "const"}),
    "direction-dependent Coulomb": ("coulomb_asymmetry", {"ratio": "asym_c"}),
    "direction-dependent viscous": ("viscous_asymmetry", {"ratio": "asym_v"}),
    "quadratic drag": ("quadratic_drag", {"coefficient": "quad"}),
    "position-dependent friction": ("position_dependent_friction", {"ratio": "pos_a"}),
    "warming": ("thermal_drift", {"time_constant": "warm_tau"}),
    "input delay": ("input_delay", {}),
    "actuator lag": ("actuator_lag", {}),
    "saturation": ("actuator_saturation", {"limit": "sat"}),
    "dead zone": ("actuator_dead_zone", {"half_width": "dead"}),
    "spring": ("return_spring", {"stiffness": "spring_k"}),
    "hard stop": ("hard_stop", {"position": "stop_hi"}),
    "elastic coupling": ("elastic_coupling", {"load_inertia": "JL", "stiffness": "kc"}),
    "backlash": ("backlash", {"load_inertia": "JL"}),
    "inertia step": ("inertia_step", {"ratio": "step_J", "time": "step_t"}),
    "friction step": ("friction_step", {"ratio": "step_F", "time": "step_t"}),
    "sinusoidal disturbance": (
        "periodic_disturbance",
        {"amplitude": "sin_a", "frequency": "sin_f"},
    ),
    "velocity sensor lag": ("velocity_sensor_lag", {}),
    "encoder eccentricity": ("encoder_eccentricity", {}),
}
SMALL = {"cogging": "torque_ripple", "belt ripple": "torque_ripple", "unbalance": "gravity"}
SMALL |= {"load-dependent friction": "torque_proportional_friction"}
OUTSIDE = {  # sets of signals that are a right answer
    "torque bumps": (frozenset({"theta"}),),
    "hysteresis cable": (frozenset({"theta", "w"}), frozenset({"w"}), frozenset({"theta"})),
    "random load": (frozenset({"t"}),),
    "constant torque step": (frozenset({"t"}),),
}
ALIKE = (  # what no log of such a drive tells apart
    {"constant_torque", "coulomb_asymmetry"},
    {"input_delay", "actuator_lag", "velocity_sensor_lag"},
    {"elastic_coupling", "backlash"},
)


def draw(seed: int, kind: str) -> Question:
    """The question of a seed; the same one each time."""
    if kind in ("effect", "unknown"):
        names = list(NAMES if kind == "effect" else OUTSIDE)
        log, truth = draw_effect(seed, names[seed % len(names)])
    else:
        log, truth = draw_log(seed, "real" if kind == "none" else "plain")
    effect = truth.get("effect", {"name": "none", "values": {}, "share": 0.0})
    name, keys = NAMES.get(effect["name"], (effect["name"], {}))
    values = {k: truth[k] for k in ("J", "Fc", "Fv")}
    if kind not in ("effect", "unknown"):
        values["constant_torque"] = truth["const"] + truth["u_offset"]
        size, phase = truth["gravity"]
        if size > 0.1 * truth["Fc"]:
            values |= {"gravity.amplitude": size, "gravity.phase": phase}
    values |= {f"{name}.{k}": effect["values"][v] for k, v in keys.items() if v in effect["values"]}
    small = {SMALL.get(n) or NAMES.get(n, (n,))[0] for n in truth["hidden"]}
    return Question(
        seed,
        kind,
        log,
        declared(np.random.default_rng([seed, 73]), truth, name),
        name,
        values,
        OUTSIDE.get(name, ()),
        frozenset(small) | LAW,
        effect["share"] * truth["level"],
        truth["level"],
        frozenset().union(*(group for group in ALIKE if name in group)) - {name},
        {"machine": f"{truth['machine']} {truth['friction']} {truth['motion']} {truth['fs']} Hz"},
    )


def declared(rng, truth: dict, name: str) -> dict:
    """The right structure, values 10 to 20 % off."""

    def off(value: float) -> float:
        return float(value * (1 + rng.choice([-1, 1]) * rng.uniform(0.1, 0.2)))

    law = "stribeck" if truth["Fs"] > truth["Fc"] else "coulomb"
    keys = ("Fc", "Fs", "Fv", "vs") if law == "stribeck" else ("Fc", "Fv")
    friction = {key: off(truth[key]) for key in keys}
    if law == "stribeck":
        friction["Fs"] = max(friction["Fs"], 1.02 * friction["Fc"])
    loads, (size, phase) = [], truth["gravity"]
    if size and name != "gravity":
        loads.append({"name": "gravity", "amplitude": off(size), "phase": phase})
    if truth["const"] and name != "constant_torque":
        loads.append({"name": "constant_torque", "torque": off(truth["const"])})
    model = {"name": "held out", "motion": "rotary", "plant": {"J": off(truth["J"])}}
    return model | {"friction": {"model": law, **friction}} | ({"effects": loads} if loads else {})
