"""Drives that a log leaves possible, and a sampled loop on each: its error, and its rest."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..blocks import controllers
from ..blocks.model import Model
from ..core.errors import Diverged, InputError, Refused
from ..core.jobs import JobError, run_jobs
from ..core.progress import Progress
from ..estimates.fitted import Fitted
from ..estimates.members import Belief, refuse_unknown
from ..record import Record
from ..simulation.encoder import Sensing
from .loop import FASTEST, PERIODS, SETTLED, SampledLoop, Task, samples, sensing_of, sine, speed_of


def believed(p: Any) -> tuple[tuple[Belief, ...], Mapping[str, Any]]:
    """The models with their distributions, and the drive as recorded, of a result or its report."""
    what = "p"
    if isinstance(p, (str, Path)):
        what = str(p)
        try:
            p = json.loads(Path(p).read_text(encoding="utf-8"))
        except OSError as error:
            raise InputError(f"{p}: cannot be read ({error.strerror or error}).") from None
        except ValueError as error:
            raise InputError(f"{p}: not a JSON document ({error}).") from None
    if isinstance(p, Fitted):
        beliefs = () if p.model is None else p.beliefs()
        seen = seen_in(p.record, p.torque_noise) if beliefs else {}
    elif isinstance(p, Mapping) and "members" in p and p.get("schema", 1) == 1:
        beliefs, seen = tuple(Belief.read(one) for one in p["members"]), p.get("drive") or {}
    else:
        raise InputError(
            f"{what} must be a result or the report.json of one, by this version of lugrectl."
        )
    if not beliefs:
        raise Refused("the record was refused, so that there is no model to compensate with.")
    for belief in beliefs:
        refuse_unknown(belief)
    return beliefs, seen


def seen_in(record: Record | None, torque: float | None) -> dict[str, Any]:
    """A drive as it was recorded, as under "drive" in the JSON document, SI.

    A noise of theta below that of its rounding is none: a log does not tell the two apart, and
    noise that is not there would hide what rounding does to a loop.
    """
    if record is None:
        return {}
    made = sensing_of(record)
    return {
        "rate": 1.0 / made.dt,
        "resolution": made.resolution,
        "noise": made.noise if made.noise > made.resolution / np.sqrt(12.0) else 0.0,
        "speed_noise": made.speed_noise,
        "torque": torque,
        "speed": speed_of(record),
    }


RESTS, UNDECIDED, HUNTS = 0.0, 1.0, 2.0
CONSTANT = 1e-6  # of its range, by which the torque of a drive at rest still moves
SHRINKS = 0.9  # of its size a third before: a swing that does not persist
SETTLES = 0.5  # the same of a torque that approaches its end: what is left is less than this moved
BLOCKS = 8  # means of the torque
LINE = 4.0  # times their distance from it; eight random means reach that once in 600 times
SLOW = 1e-3  # of the range of the torque: so slow it takes a thousand such runs to break away
WAITS = (40, 320)  # kp/ki of the controller: a run at rest, longer where it is undecided
SHORTEST, LONGEST = 1_000, 100_000  # samples of it
NOISE, GREW = 1e-6, 100.0  # of a motion at its start: it has decayed, or it grows
STEP, SMALL = 0.1, 1e-3  # of the amplitude of the sine: a step, and a swing that is none
CHUNK = 16  # members in a job


class Rest(NamedTuple):
    """The fate of a run, the worst last in order, and the swing at its end, peak to peak."""

    fate: float
    swing: float


def at_rest(theta: np.ndarray, u: np.ndarray, range_u: float, still: float, last: bool) -> Rest:
    """What the last thirds of a run say of a swing above ``still``; ``last``: no longer one comes.

    A constant torque rests. In a stick with an error the integrator moves the torque one way until
    the drive breaks away: then nothing is decided, also where it has not moved for long.
    """
    third = len(theta) // 3
    before, now = slice(-2 * third, -third), slice(-third, None)
    size, was = float(np.ptp(theta[now])), float(np.ptp(theta[before]))
    moved = float(np.ptp(u[now]))
    if moved <= CONSTANT * range_u:
        return Rest(RESTS, size)
    if min(size, was) > still and (last or size >= SHRINKS * was):
        return Rest(HUNTS, size)
    # a torque moves one way along a line, by more than it lies about it, and not too slowly
    means = np.array([np.mean(part) for part in np.array_split(u[-2 * third :], BLOCKS)])
    place = np.arange(BLOCKS)
    line = np.polyval(np.polyfit(place, means, 1), place)
    least = max(LINE * np.max(np.abs(means - line)), SLOW * range_u)
    stays = abs(line[-1] - line[0]) <= least or moved <= SETTLES * np.ptp(u[before])
    if max(size, was) <= still and stays:
        return Rest(RESTS, size)
    return Rest(UNDECIDED, max(size, was))


@dataclass(frozen=True)
class Choice:
    """A compensation: the observer, its gains, and the share of its estimate that is added."""

    observer: str | None = None
    gains: Mapping[str, Any] = field(default_factory=dict)
    scale: float = 0.0


@dataclass(frozen=True, eq=False)
class Setting:
    """What is equal for all members: controller, belief, sensor, a sine of the speed from rest."""

    task: Task
    sensing: Sensing
    torque: float
    speed: float
    frequency: float

    def samples(self, periods: float) -> int:
        return samples(periods, self.frequency, 1.0 / self.sensing.dt)

    def rows(self, periods: float) -> dict[str, np.ndarray]:
        """Return the reference and its derivatives by name."""
        t = self.sensing.dt * np.arange(self.samples(periods))
        return sine(t, self.speed, self.frequency).rows(self.task.kind)

    @property
    def travel(self) -> float:
        """Return the amplitude of the position in rad."""
        return self.speed / (2.0 * np.pi * self.frequency)

    def usual_still(self) -> float:
        """Return the swing at rest that is no hunting: two counts, or a little of the travel."""
        return 2.0 * self.sensing.resolution or SMALL * self.travel

    def stopped(self, length: int) -> dict[str, np.ndarray]:
        """Return a period of the sine, then so many samples at its start."""
        return {k: np.r_[x, np.zeros(length)] for k, x in self.rows(1.0).items()}

    def stepped(self, length: int) -> dict[str, np.ndarray]:
        """Return the same after a step: of the position, or of the speed to 0."""
        first = self.samples(1.0)
        made = {k: np.zeros(first + length) for k in self.rows(0.0)}
        if self.task.kind == "velocity":
            made["r"][:first] = STEP * self.speed
        else:
            made["r"][1:] = STEP * self.travel
        return made

    def waits(self) -> list[int]:
        """Return the samples of the runs at rest."""
        kp, ki = (self.task.controller[k] for k in ("kp", "ki"))
        unit = kp / ki if ki > 0.0 < kp else 0.25 / self.frequency
        most = min(LONGEST, math.ceil(WAITS[-1] * unit / self.sensing.dt))
        every = [max(SHORTEST, math.ceil(k * unit / self.sensing.dt)) for k in WAITS]
        return sorted({min(n, most) for n in every})

    def loop(self, choice: Choice) -> SampledLoop:
        """Return the loop of a choice, built once for all its shares."""
        return _built(self, choice.observer, tuple(choice.gains.items()))


@lru_cache(maxsize=8)
def _built(
    setting: Setting, observer: str | None, gains: tuple[tuple[str, Any], ...]
) -> SampledLoop:
    task = setting.task
    control = task.control(None if observer is None else task.model, observer, dict(gains))
    return SampledLoop(task, setting.sensing, control, FASTEST * setting.speed)


def grows(setting: Setting) -> bool:
    """Return whether the loop without dry friction swings ever more after a step."""
    known = setting.task.model.known()
    free = Model.of(friction="viscous", J=known["J"], Fv=known.get("Fv", 0.0))
    task, quiet = replace(setting.task, model=free), setting.sensing.quiet()
    loop = replace(setting, task=task, sensing=quiet).loop(Choice())
    first, before, now = 0.0, 0.0, 0.0
    for length in setting.waits():
        try:
            y = loop.run(setting.stepped(length))[controllers.MEASURED[task.kind]]
        except Diverged:
            return True
        first, before, now = (float(np.ptp(part)) for part in np.array_split(y[-length:], 3))
        if now > GREW * first or max(before, now) <= NOISE * first:
            break
    return now > before and now > NOISE * first


Pairs = Sequence[tuple[Model, int]]  # drives, each with the seed of its noise


def tracking(setting: Setting, choices: Sequence[Choice], members: Pairs) -> np.ndarray:
    """Return the RMS errors (members, choices) of members with several compensations."""
    rows, counted, columns = setting.rows(PERIODS), slice(setting.samples(SETTLED), None), []
    for choice in choices:
        loop = setting.loop(choice)
        own: dict[str, Any] = {"torque": setting.torque, "compensation.scale": choice.scale}
        columns.append([loop.error(rows, m, counted, seed=seed, **own) for m, seed in members])
    return np.array(columns).T


def waiting(setting: Setting, choice: Choice, still: float, members: Pairs) -> np.ndarray:
    """Return a :class:`Rest` of each, without noise: the worse after a stop and after a step."""
    loop, sensing, lengths = setting.loop(choice), setting.sensing.still(), setting.waits()
    scale: Any = {"compensation.scale": choice.scale}

    def rest(model: Model, start: Any) -> Rest:
        seen = Rest(UNDECIDED, math.inf)
        for length in lengths:
            try:
                done = loop.run(start(length), model, sensing, **scale)
            except Diverged:
                return Rest(HUNTS, math.inf)
            theta, u, last = done["theta"][-length:], done["u_fb"], length == lengths[-1]
            seen = at_rest(theta, u[-length:], float(np.ptp(u)), still, last)
            if seen.fate != UNDECIDED:
                break
        return seen

    starts = setting.stopped, setting.stepped
    return np.array([max(rest(model, start) for start in starts) for model, _ in members])


@dataclass(frozen=True)
class Jobs:
    """Where members are simulated."""

    executor: Executor | None
    number: int

    def __call__(self, work: Any, report: Progress, pairs: Pairs) -> np.ndarray:
        """Return what comes of all members, in order, done in chunks."""
        chunks = [pairs[i : i + CHUNK] for i in range(0, len(pairs), CHUNK)]
        found: dict[int, np.ndarray] = {}
        for i, rows in run_jobs(work, chunks, executor=self.executor, jobs=self.number):
            if isinstance(rows, JobError):
                raise Refused(f"members {i * CHUNK} and on: {rows.sentence}")
            found[i] = rows
            report(len(found) / len(chunks), "simulating drives")
        return np.vstack([found[i] for i in range(len(chunks))])
