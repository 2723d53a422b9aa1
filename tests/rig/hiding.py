"""How an effect is hidden: what is drawn, and which number carries the strength.

A recipe looks at a context (machine, an effect-free run of the same record) and returns a
`Size`: the parameters as a function of one number, its first guess, its bounds, and the power
with which the effect torque grows with it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from .machines import GRAVITY_LOAD, Machine

TURN = 2.0 * np.pi
MOVING = ("rich", "moves", "multisine", "torque")
ALL = ("rich", "sparse", "stopgo", "moves", "multisine", "torque")


@dataclass(frozen=True)
class Context:
    """The effect-free run: its signals, the RMS of its friction, and what is wanted."""

    machine: Machine
    t: np.ndarray
    u: np.ndarray
    theta: np.ndarray
    w: np.ndarray
    friction: float
    target: float
    rate: float
    fine: float  # s, step of the simulation

    @property
    def aim(self) -> float:
        """Wanted RMS of the effect torque."""
        return self.target * self.friction

    def scaled(self, shape: np.ndarray) -> float:
        """Factor that gives this shape the wanted RMS."""
        return self.aim / max(float(np.sqrt(np.mean(shape**2))), 1e-12)

    @property
    def acceleration(self) -> np.ndarray:
        return np.gradient(self.w, self.t)


@dataclass(frozen=True)
class Size:
    build: Callable[[float], tuple[float, ...]]
    start: float
    low: float = 0.0
    high: float = np.inf
    power: float = 1.0
    friction: Callable[[Machine, float], Machine] | None = None  # truth has other friction


@dataclass(frozen=True)
class Effect:
    name: str
    parameters: tuple[str, ...]
    depends_on: tuple[str, ...]
    recipe: Callable[[Context, np.random.Generator], Size]
    excitations: tuple[str, ...] = MOVING
    only: str = ""  # "rotary", "load" (needs a gravity load), "tacho"
    declared: str = "lugre"  # friction model of the model file
    late: bool = False  # adds phase lag to the loop: tune gently
    text: str = ""  # strangers: what it is


CATALOGUE: dict[str, Effect] = {}
STRANGERS: dict[str, Effect] = {}


def effect(name: str, parameters: str, depends_on: str, **options):
    def enter(recipe):
        home = STRANGERS if options.get("text") else CATALOGUE
        home[name] = Effect(
            name, tuple(parameters.split()), tuple(depends_on.split()), recipe, **options
        )
        return recipe

    return enter


def phase(rng) -> float:
    return float(rng.uniform(-np.pi, np.pi))


def either(rng) -> float:
    return float(rng.choice([-1.0, 1.0]))


def harmonic(c: Context, rng, low: int = 2, high: int = 24) -> float:
    """Per turn, or per metre on a linear axis; slow enough to be seen at the record's rate."""
    if not c.machine.rotary:
        return TURN / float(rng.choice([0.01, 0.02, 0.04, 0.05, 0.06]))
    fastest = 0.3 * np.pi * c.rate / float(np.max(np.abs(c.w)))
    return float(rng.integers(low, max(low + 1, min(high, int(fastest)) + 1)))


def moment(c: Context, rng) -> float:
    return float(rng.uniform(0.35, 0.65)) * float(c.t[-1])


def needs_gravity(names: list[str]) -> bool:
    return any(CATALOGUE[n].only == "load" for n in names if n in CATALOGUE)


def suits(name: str, machine: Machine, position_only: bool) -> bool:
    only = find(name).only
    if only == "load" and machine.load[0] != GRAVITY_LOAD:
        return False
    return not (only == "rotary" and not machine.rotary or only == "tacho" and position_only)


def find(name: str) -> Effect:
    """The effect of this name, or a sentence that lists the names."""
    for home in (CATALOGUE, STRANGERS):
        if name in home:
            return home[name]
    raise ValueError(f"unknown effect {name!r}: one of {', '.join([*CATALOGUE, *STRANGERS])}")
