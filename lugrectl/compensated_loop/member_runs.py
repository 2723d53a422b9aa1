"""A sampled loop on drives that are not exactly its model: the error of each, and what stays."""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..blocks import controllers
from ..blocks.drive import dead_time
from ..blocks.model import Model
from ..blocks.plant import plant, sensor
from ..core.errors import Diverged
from ..core.numeric import rms
from ..hunting.waiting import STILL
from ..simulation.encoder import Sensing, encoder
from ..simulation.sampled_response import COARSE, simulate_sampled
from ..simulation.stepped_block import at_samples
from .drive import body_of, usual_points
from .loop import Task, control

PERIODS, SETTLED = 1.25, 0.25  # of the reference: simulated, and left out of the error
FASTEST = 1.5  # of the largest speed of the reference
LENGTHS = (4_000, 20_000, 80_000)  # samples at rest, more where the torque still moves


@dataclass(frozen=True)
class Choice:
    """A compensation: the observer, its gains, and the share of its estimate that is added."""

    observer: str
    gains: Mapping[str, Any]
    scale: float = 1.0


@dataclass(frozen=True)
class Setting:
    """What is equal for all members: controller and believed model, sensor, noise of the torque in
    N m, and the reference, a sine of speed ``speed`` (rad/s) at ``frequency`` (Hz), from rest."""

    task: Task
    sensing: Sensing
    torque: float
    speed: float
    frequency: float

    def rows(self, samples: int) -> dict[str, np.ndarray]:
        """The reference and its derivatives by name."""
        turn = 2.0 * np.pi * self.frequency
        x = turn * self.sensing.dt * np.arange(samples)
        w, a = self.speed * np.sin(x), self.speed * turn * np.cos(x)
        if self.task.kind == "velocity":
            return {"r": w, "dr": a}
        return {"r": self.speed / turn * (1.0 - np.cos(x)), "dr": w, "ddr": a}

    def samples(self, periods: float) -> int:
        return round(periods / self.frequency / self.sensing.dt) + 1


class Loop:
    """The loop with one observer, or without compensation, built once for all members."""

    def __init__(self, setting: Setting, choice: Choice | None) -> None:
        task, sensing = setting.task, setting.sensing
        self.setting, self.late = setting, sensing.delay > 0.0
        watcher, gains = (None, {}) if choice is None else (choice.observer, choice.gains)
        blocks = control(task, None if choice is None else task.model, watcher, gains)
        if self.late:
            blocks.append(dead_time(sensing.delay, sensing.dt, inputs=["u"], outputs=["u_late"]))
        points = usual_points(task.model, FASTEST * setting.speed)
        self.blocks = [
            encoder(sensing, ("theta_s", "w_s")),
            *(at_samples(block, sensing.dt, points) for block in blocks),
        ]
        self.own = {} if choice is None else {"compensation.scale": choice.scale}
        self.bodies: dict[Any, tuple[Any, set[str]]] = {}

    def scaled(self, scale: float) -> Loop:
        """The same loop with another share of the estimate; the simulation is not built again."""
        self.own = {"compensation.scale": scale}
        return self

    def error(self, model: Model, seed: int) -> float:
        """The RMS tracking error on a drive; infinite where the loop diverges."""
        made = self.setting
        rows, first = made.rows(made.samples(PERIODS)), made.samples(SETTLED)
        try:
            done = self._run(model, rows, made.sensing, made.torque, seed)
        except Diverged:
            return math.inf
        y = done[controllers.MEASURED[made.task.kind]]
        return rms((y - rows["r"])[first:])

    def hunts(self, model: Model) -> bool:
        """Whether it still moves, by more than a step of the encoder, long after a period of the
        reference; without noise, so that the torque of a drive at rest stays as it is."""
        made, first = self.setting, self.setting.samples(1.0)
        for length in LENGTHS:
            held = {k: x[0] if k == "r" else 0.0 for k, x in made.rows(first).items()}
            rows = {k: np.r_[x, np.full(length, held[k])] for k, x in made.rows(first).items()}
            try:
                done = self._run(model, rows, made.sensing.still(), 0.0, 0)
            except Diverged:
                return True
            theta, u = done["theta"], done["u_fb"]
            last = slice(-length // 3, None)
            if np.ptp(u[last]) <= STILL * np.ptp(u):
                return False
        return bool(np.ptp(theta[last]) > max(made.sensing.resolution, STILL * np.ptp(theta)))

    def _run(
        self,
        model: Model,
        rows: Mapping[str, np.ndarray],
        sensing: Sensing,
        torque: float,
        seed: int,
    ) -> dict[str, np.ndarray]:
        """The signals of a drive by name."""
        body, names = self._body(model)
        t = sensing.dt * np.arange(len(rows["r"]))
        random = np.random.default_rng((seed, 1))
        given = {**rows, **sensing.errors(len(t), seed), "n_u": random.normal(0.0, torque, len(t))}
        read = {k for block in (body, *self.blocks) for k in block.input_labels}
        values = {k: v for k, v in _keyed(model).items() if k in names}
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")  # a loop that does not work is a result here
            done = simulate_sampled(
                body,
                self.blocks,
                t,
                {k: x for k, x in given.items() if k in read},
                params=values | self.own,
                rtol=COARSE,
            )
        return dict(zip(done.output_labels or (), np.asarray(done.outputs), strict=True))

    def _body(self, model: Model) -> tuple[Any, set[str]]:
        """The drive of a structure, and the parameters that it has."""
        key = (model.friction.block.name, *(p.key for p in model.effects))
        if key not in self.bodies:
            body = body_of(replace(self.setting.task, model=model), "u_late" if self.late else "u")
            names = {*plant(model).params, *sensor(model).params}
            self.bodies[key] = body, names
        return self.bodies[key]


def _keyed(model: Model) -> dict[str, float]:
    return {f"{block}.{k}": v for block in ("plant", "sensor") for k, v in model.known().items()}


@dataclass(frozen=True)
class Work:
    """The errors of members with several compensations: a function that can be sent."""

    setting: Setting
    choices: Sequence[Choice | None]
    rests: bool = False

    def __call__(self, members: Sequence[tuple[Model, int]]) -> np.ndarray:
        """RMS errors (members, choices); with ``rests`` a last column, whether the last hunts."""
        columns, loops = [], dict[Any, Loop]()
        for choice in self.choices:
            name = None if choice is None else choice.observer
            loop = loops[name] = loops.get(name) or Loop(self.setting, choice)
            loop = loop if choice is None else loop.scaled(choice.scale)
            columns.append([loop.error(model, seed) for model, seed in members])
            last = loop
        if self.rests:
            columns.append([float(last.hunts(model)) for model, _ in members])
        return np.array(columns).T
