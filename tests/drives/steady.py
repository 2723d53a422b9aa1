"""Runs at steady speed of a drawn machine, with or without a hidden effect: plain formulas.

Shares nothing with the package. The drive is held at each speed by a loop; what is recorded is
its speed, and the torque that friction takes there, with a swing over the turn, a slow wander,
noise, and a scatter from run to run.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import pi

import numpy as np

from ..scores.question import LAW, Question

EFFECTS = (
    "constant_torque",
    "coulomb_asymmetry",
    "viscous_asymmetry",
    "quadratic_drag",
    "sublinear_viscous",
    "stribeck",
)
STRANGERS = ("resonance", "knee")
SWINGS = ("gravity", "torque_ripple", "position_dependent_friction")
DECLARED = {"coulomb": ("Fc", "Fv"), "stribeck": ("Fc", "Fs", "Fv", "vs"),
            "lugre": ("sigma0", "sigma1", "Fc", "Fs", "Fv", "vs")}  # fmt: skip


@dataclass(frozen=True)
class Map:
    """Columns of every run, the declared model as a nested dictionary, and what is hidden."""

    runs: list[dict[str, np.ndarray]]
    model: dict
    name: str
    values: dict[str, float]
    swing: float


def draw(seed: int, kind: str) -> Question:
    """The friction map of a seed: ``effect``, ``unknown`` or ``none``."""
    names = {"effect": EFFECTS, "unknown": STRANGERS, "none": ("none",)}[kind]
    name = names[seed % len(names)]
    made = friction_map(name, seed)
    first, *more = made.runs
    # of a swing over the turn a map says all that it can, whatever its name is
    swings = frozenset(SWINGS) if made.swing else frozenset()
    return Question(
        seed,
        kind,
        first,
        made.model,
        name,
        {f"{name}.{k}": v for k, v in made.values.items()},
        (frozenset({"w"}), frozenset({"w", "theta"})),
        swings | LAW,
        alike=swings,
        about=f"{len(made.runs)} runs",
        more=tuple(more),
    )


def friction_map(name: str, seed: int, strength: float = 0.2, swing: bool | None = None) -> Map:
    """A machine with the effect ``name`` ("none" for none) of ``strength`` times its friction."""
    chance = np.random.default_rng([seed, *name.encode()])
    level = 10 ** chance.uniform(-3.0, 0.7)
    top = 10 ** chance.uniform(0.5, 2.3)
    machine = {
        "Fc": level,
        "Fs": level * chance.uniform(1.15, 1.6),
        "Fv": level * chance.uniform(0.3, 1.5) / top,
        "vs": top * 10 ** chance.uniform(-1.6, -0.8),
    }
    law = str(chance.choice(["stribeck", "lugre"]))
    if name == "stribeck":
        law = "coulomb"
    size = strength * level
    hidden, values = _hidden(name, size, machine, top, chance)
    swings = bool(chance.random() < 0.5) if swing is None else swing
    amplitude = level * chance.uniform(0.03, 0.1) * swings
    count = int(chance.integers(9, 17))
    spaced = np.geomspace if chance.random() < 0.5 else np.linspace
    speeds = spaced(top * chance.uniform(0.01, 0.03), top, count)
    scatter = level * 10 ** chance.uniform(-2.7, -2.0)
    order = int(chance.integers(1, 4))
    runs = []
    for w in [*speeds, *-speeds]:
        torque = float(_friction(w, machine)) + hidden(w) + scatter * chance.standard_normal()
        runs.append(_run(w, torque, amplitude, order, level, chance))
    known = chance.random() < 0.6
    friction: dict = {"model": law}
    for key in DECLARED[law]:
        if known and key in machine:
            friction[key] = machine[key] * chance.uniform(0.9, 1.1)
    if {"Fs", "Fc"} <= friction.keys():
        friction["Fs"] = max(friction["Fs"], 1.02 * friction["Fc"])
    return Map(runs, {"name": "held", "friction": friction}, name, values, amplitude)


def _friction(w: float, m: dict[str, float]) -> float:
    stribeck = (m["Fs"] - m["Fc"]) * np.exp(-((w / m["vs"]) ** 2))
    return np.sign(w) * (m["Fc"] + stribeck) + m["Fv"] * w


def _hidden(name: str, size: float, m: dict[str, float], top: float, chance):
    """The torque of the effect over speed, and its values; of about ``size``."""
    side = float(chance.choice([-1.0, 1.0]))
    if name == "constant_torque":
        return (lambda w: side * size), {"torque": side * size}
    if name == "coulomb_asymmetry":  # the whole level of friction, its Stribeck part too
        ratio = side * size / m["Fc"]
        still = dict(m, Fv=0.0)
        return (lambda w: ratio * np.sign(w) * _friction(w, still)), {"ratio": ratio}
    if name == "viscous_asymmetry":
        ratio = side * min(2.0 * size / (m["Fv"] * top), 0.9)
        return (lambda w: ratio * m["Fv"] * abs(w)), {"ratio": ratio}
    if name == "quadratic_drag":
        c = 2.0 * size / top**2
        return (lambda w: c * w * abs(w)), {"coefficient": c}
    if name == "sublinear_viscous":
        n = chance.uniform(0.3, 0.6)
        c = 2.0 * size / top**n
        m["Fv"] = 1e-3 * m["Fv"]
        return (lambda w: c * abs(w) ** n * np.sign(w)), {"coefficient": c, "exponent": n}
    if name == "stribeck":
        m["Fs"] = m["Fc"] + max(2.0 * size, 0.15 * m["Fc"])
        return (lambda w: 0.0), {"Fs": m["Fs"], "vs": m["vs"]}
    if name == "resonance":  # a structure that takes power around one speed
        at, width = top * chance.uniform(0.35, 0.65), top * chance.uniform(0.07, 0.12)
        return (lambda w: 2.0 * size * np.sign(w) * np.exp(-(((abs(w) - at) / width) ** 2))), {}
    if name == "knee":  # a clutch that drags above a speed only
        at = top * chance.uniform(0.4, 0.6)
        return (lambda w: 2.0 * size * np.sign(w) * (abs(w) > at)), {}
    return (lambda w: 0.0), {}


def _run(w: float, torque: float, amplitude: float, order: int, level: float, chance) -> dict:
    """Some turns at one speed, 500 samples or so, from any angle on."""
    n = int(chance.integers(300, 700))
    seconds = max(chance.uniform(4.0, 12.0) * 2.0 * pi / abs(w), 1.2)
    t = np.arange(n) * seconds / n
    theta = chance.uniform(0.0, 2.0 * pi) + w * t
    wander = np.cumsum(chance.standard_normal(n)) / np.sqrt(n)
    u = torque + amplitude * np.sin(order * theta)
    u = u + 0.01 * level * (wander - wander.mean()) + 0.02 * level * chance.standard_normal(n)
    return {"t": t, "w": w * (1.0 + 0.01 * chance.standard_normal(n)), "u": u}
