"""Which records: effects, strengths, seeds."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from ..drives import CATALOGUE, STRANGERS
from ..drives.effects import Effect, find
from ..drives.sample import forms

STRENGTHS = {"normal": 0.20, "weak": 0.08}
ALIKE = (  # no record tells these from each other when both are there
    {"input_delay", "actuator_lag", "velocity_sensor_lag"},
    {"elastic_coupling", "backlash"},
    {"stribeck", "presliding"},
    {"constant_torque", "return_spring"},  # a spring with another rest
    {"gravity", "pose_dependent_inertia", "encoder_eccentricity"},
)


@dataclass(frozen=True)
class Task:
    """One record to draw and to diagnose."""

    kind: str  # "effect", "pair", "none" or "stranger"
    names: tuple[str, ...]
    strength: str
    seed: int
    hard: bool = False
    short: bool = False  # 20 s at 500 Hz, for a quick look
    form: str = ""  # as which export it holds theta, w and u; "" as the rig's sensors give them

    @property
    def key(self) -> str:
        words = (self.hard and "hard", self.short and "short", self.form)
        also = "".join(f" {word}" for word in words if word)
        return f"{'+'.join(self.names) or 'none'} {self.strength} {self.seed}{also}"


def tasks(
    effects: Sequence[str],
    strengths: Sequence[str],
    seeds: range,
    none: int,
    strangers: int,
    pairs: int,
    hard: float = 0.0,
    short: bool = False,
    exported: float = 0.0,
) -> list[Task]:
    """Every effect at every strength and seed, then the others; ``hard``, ``exported``: shares.

    Records with nothing missing, strangers and pairs take seeds from the first on, and the
    first strength.
    """
    made = [
        Task("effect" if name != "none" else "none", _names(name), strength, seed)
        for seed in seeds
        for strength in strengths
        for name in effects
    ]
    made += [Task("none", (), "normal", seeds.start + i) for i in range(none)]
    kinds = list(STRANGERS)
    for i in range(strangers):
        made.append(Task("stranger", (kinds[i % len(kinds)],), strengths[0], seeds.start + i))
    mixed = _pairs(seeds.start)
    made += [Task("pair", next(mixed), strengths[0], seeds.start + i) for i in range(pairs)]
    made = [_exported(replace(_hardened(task, hard), short=short), exported) for task in made]
    return list({task.key: task for task in made}.values())


def _names(name: str) -> tuple[str, ...]:
    return () if name == "none" else (find(name).name,)


def _hardened(task: Task, share: float) -> Task:
    chance = np.random.default_rng([task.seed, *task.key.encode()]).random()
    return replace(task, hard=bool(chance < share))


def _exported(task: Task, share: float) -> Task:
    rng = np.random.default_rng([task.seed, *b"export", *task.key.encode()])
    allowed = forms(task.names)
    if rng.random() >= share or not allowed:
        return task
    return replace(task, form=str(rng.choice(allowed)))


def _pairs(seed: int) -> Iterator[tuple[str, ...]]:
    """Two effects that one record can carry and tell apart, in an order of the seed's."""
    every = [pair for pair in combinations(CATALOGUE, 2) if together(*pair)]
    rng = np.random.default_rng(seed)
    while True:
        for i in rng.permutation(len(every)):
            yield every[int(i)]


def together(first: str, second: str) -> bool:
    """Whether the two can be hidden in one record."""
    if any({first, second} <= group for group in ALIKE):
        return False
    a, b = find(first), find(second)
    return bool(set(a.excitations) & set(b.excitations)) and not _clash(a, b)


def _clash(a: Effect, b: Effect) -> bool:
    """A load that is declared cannot be hidden in the same record."""
    loads = {"gravity", "constant_torque"}
    return (a.only == "load" and b.name in loads) or (b.only == "load" and a.name in loads)
