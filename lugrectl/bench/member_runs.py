"""A sampled loop on drives that are not exactly its model: the error of each, and its rest."""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np

from ..blocks import controllers
from ..blocks.drive import dead_time
from ..blocks.model import Model
from ..blocks.plant import plant, sensor
from ..core.errors import Diverged
from ..core.numeric import rms
from ..simulation.encoder import Sensing, encoder
from ..simulation.sampled_response import COARSE, simulate_sampled
from ..simulation.stepped_block import at_samples
from .drive import body_of, usual_points
from .loop import Task, control
from .standstill import UNDECIDED, Rest, at_rest

PERIODS, SETTLED = 1.25, 0.25  # of the reference: simulated, and left out of the error
FASTEST = 1.5  # of the largest speed of the reference
WAITS = (40, 320)  # kp/ki of the controller: a run at rest, longer where it is undecided
SHORTEST, LONGEST = 1_000, 100_000  # samples of it
NOISE, GREW = 1e-6, 100.0  # of a motion at its start: it has decayed, or it grows
STEP, SMALL = 0.1, 1e-3  # of the amplitude of the sine: a step, and a swing that is none


@dataclass(frozen=True)
class Choice:
    """A compensation: the observer, its gains, and the share of its estimate that is added."""

    observer: str
    gains: Mapping[str, Any]
    scale: float = 1.0


@dataclass(frozen=True, eq=False)
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

    def usual_still(self) -> float:
        """The swing at rest that is no hunting: two counts, or a little of the reference."""
        return 2.0 * self.sensing.resolution or SMALL * self.speed / (2.0 * np.pi * self.frequency)

    def stopped(self, length: int) -> dict[str, np.ndarray]:
        """A period of the sine, then so many samples at its start."""
        first = self.samples(1.0)
        return {k: np.r_[x, np.zeros(length)] for k, x in self.rows(first).items()}

    def stepped(self, length: int) -> dict[str, np.ndarray]:
        """The same after a step: of the position, or of the speed to 0."""
        first, turn = self.samples(1.0), 2.0 * np.pi * self.frequency
        made = {k: np.zeros(first + length) for k in self.rows(1)}
        if self.task.kind == "velocity":
            made["r"][:first] = STEP * self.speed
        else:
            made["r"][1:] = STEP * self.speed / turn
        return made

    def waits(self) -> list[int]:
        """Samples of the runs at rest."""
        kp, ki = (self.task.controller[k] for k in ("kp", "ki"))
        unit = kp / ki if ki > 0.0 < kp else 0.25 / self.frequency
        most = min(LONGEST, math.ceil(WAITS[-1] * unit / self.sensing.dt))
        every = [max(SHORTEST, math.ceil(k * unit / self.sensing.dt)) for k in WAITS]
        return sorted({min(n, most) for n in every})

    def samples(self, periods: float) -> int:
        return round(periods / self.frequency / self.sensing.dt) + 1


class Loop:
    """The loop with one observer, or without compensation, built once for all members."""

    def __init__(self, setting: Setting, choice: Choice | None) -> None:
        task, sensing = setting.task, setting.sensing
        self.setting, self.late = setting, sensing.delay > 0.0
        self.compensates = choice is not None
        watcher, gains = (None, {}) if choice is None else (choice.observer, choice.gains)
        blocks = control(task, None if choice is None else task.model, watcher, gains)
        if self.late:
            blocks.append(dead_time(sensing.delay, sensing.dt, inputs=["u"], outputs=["u_late"]))
        points = usual_points(task.model, FASTEST * setting.speed)
        self.blocks = [
            encoder(sensing, ("theta_s", "w_s")),
            *(at_samples(block, sensing.dt, points) for block in blocks),
        ]
        self.bodies: dict[Any, tuple[Any, set[str]]] = {}

    def error(self, model: Model, seed: int, scale: float) -> float:
        """The RMS tracking error on a drive; infinite where the loop diverges."""
        made = self.setting
        rows, first = made.rows(made.samples(PERIODS)), made.samples(SETTLED)
        try:
            done = self.run(model, rows, made.sensing, scale, made.torque, seed)
        except Diverged:
            return math.inf
        y = done[controllers.MEASURED[made.task.kind]]
        return rms((y - rows["r"])[first:])

    def rest(self, model: Model, scale: float, still: float) -> Rest:
        """What becomes of it after a stop and after a step, the worse of the two; without noise,
        so that the torque of a drive at rest stays as it is."""
        return max(self._rest(model, scale, start, still) for start in ("stop", "step"))

    def _rest(self, model: Model, scale: float, start: str, still: float) -> Rest:
        made, seen = self.setting, Rest(UNDECIDED, math.inf)
        for length in (lengths := made.waits()):
            rows = made.stopped(length) if start == "stop" else made.stepped(length)
            try:
                done = self.run(model, rows, made.sensing.still(), scale)
            except Diverged:
                return Rest.diverged()
            theta, u = done["theta"][-length:], done["u_fb"]
            last = length == lengths[-1]
            seen = at_rest(theta, u[-length:], float(np.ptp(u)), still, last)
            if seen.fate != UNDECIDED:
                break
        return seen

    def run(
        self,
        model: Model,
        rows: Mapping[str, np.ndarray],
        sensing: Sensing,
        scale: float = 1.0,
        torque: float = 0.0,
        seed: int = 0,
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
                params=values | ({"compensation.scale": scale} if self.compensates else {}),
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


def grows(setting: Setting) -> bool:
    """Whether the loop without compensation and dry friction is unstable, by its own motion after a
    step: exponentials that grow are the largest at the end, and larger than before."""
    known = setting.task.model.known()
    free = Model.of(friction="viscous", J=known["J"], Fv=known.get("Fv", 0.0))
    exact = replace(
        setting, task=replace(setting.task, model=free), sensing=setting.sensing.quiet()
    )
    loop, first, before, now = Loop(exact, None), 0.0, 0.0, 0.0
    for length in exact.waits():
        try:
            done = loop.run(free, exact.stepped(length), exact.sensing)
        except Diverged:
            return True
        y = done[controllers.MEASURED[setting.task.kind]][-length:]
        first, before, now = (float(np.ptp(part)) for part in np.array_split(y, 3))
        if now > GREW * first or max(before, now) <= NOISE * first:
            break
    return now > before and now > NOISE * first


@dataclass(frozen=True)
class Work:
    """The errors of members with several compensations: a function that can be sent."""

    setting: Setting
    choices: Sequence[Choice | None]

    def __call__(self, members: Sequence[tuple[Model, int]]) -> np.ndarray:
        """RMS errors (members, choices)."""
        columns = []
        for choice in self.choices:
            loop, scale = _loop_of(self.setting, choice)
            columns.append([loop.error(model, seed, scale) for model, seed in members])
        return np.array(columns).T


@dataclass(frozen=True)
class Waiting:
    """What becomes of members at rest with a compensation: a function that can be sent."""

    setting: Setting
    choice: Choice | None
    still: float

    def __call__(self, members: Sequence[tuple[Model, int]]) -> np.ndarray:
        """A :class:`Rest` of each (members, 2)."""
        loop, scale = _loop_of(self.setting, self.choice)
        return np.array([loop.rest(model, scale, self.still) for model, _ in members])


def _loop_of(setting: Setting, choice: Choice | None) -> tuple[Loop, float]:
    """The loop of a choice, which is built once for all shares, and the share."""
    if choice is None:
        return _built(setting, None, ()), 0.0
    return _built(setting, choice.observer, tuple(choice.gains.items())), choice.scale


@lru_cache(maxsize=8)
def _built(setting: Setting, observer: str | None, gains: tuple[tuple[str, Any], ...]) -> Loop:
    return Loop(setting, None if observer is None else Choice(observer, dict(gains)))
