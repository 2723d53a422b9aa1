"""A search by simulation, for loops whose state in a stick is no number: what persists from many
starts, and the smallest that does not come to rest."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from time import monotonic
from typing import Any, NamedTuple

import control as ct
import numpy as np

from ..blocks import controllers
from ..blocks.drive import dead_time, limiter
from ..blocks.model import Model
from ..blocks.plant import plant
from ..core.display import number
from ..core.errors import Diverged, InputError
from ..simulation.encoder import Sensing, encoder, rounded
from ..simulation.response import simulate
from ..simulation.sampled_block import sampled
from ..simulation.sampled_response import simulate_sampled
from .loop import Loop, edge
from .result import Cycle, LimitCycles

RESTS, HUNTS, GROWS, OPEN = "rests", "hunts", "grows", "open"
JOINS = "joins"  # a motion that is known to go on
AWAKE = (HUNTS, GROWS, JOINS)
VERBS = {
    RESTS: "came to rest",
    HUNTS: "kept swinging",
    GROWS: "grew without bound",
    OPEN: "stayed undecided",
}
STILL = 1e-6  # of its largest value, by which the torque of a drive at rest still moves
TINY = 1e-6  # of its largest error, by which a drive at rest still creeps
STEADY = 0.05  # relative change of a size that persists
REPEATS = 1e-3  # the same of a mean of half turns, which repeats; or four errors of that mean
TURNS = 6  # half turns in the last third, at least
MANY = 300  # the same of a motion that scatters: it may come to rest by chance
SAME = 0.1  # relative difference of two amplitudes that are one, or twice their scatter
SMALLER = 0.1  # of the smallest start: an error that has come to rest
LARGER = 1e3  # times the largest start: an error that grows
BORDER = 1.05  # ratio of the two starts between which a border lies
LENGTHS = (1, 4, 16, 64)  # how many times its first length a run may take


class Motion(NamedTuple):
    """Times, the error of the side that is controlled, the torque; theta by side where there are
    a motor and a load."""

    t: np.ndarray
    e: np.ndarray
    u: np.ndarray
    sides: dict[str, np.ndarray] = {}


Run = Callable[[float, int], Motion]  # from a start, for so many times its first length


class Seen(NamedTuple):
    """What became of a start; ``size`` is the largest error in the last third of what was seen,
    ``ratio`` that to the third before; ``sure``: it repeats, or has scattered for many turns."""

    fate: str
    amplitude: float = 0.0
    scatter: float = 0.0
    period: float = np.inf
    sides: dict[str, float] = {}
    size: float = np.inf
    ratio: float = 1.0
    sure: bool = True


def judged(m: Motion, small: float, large: float) -> Seen:
    """Judge by the last thirds of a motion; an error below ``small`` rests, one beyond ``large``
    that rises grows."""
    third = len(m.t) // 3
    before, now = (slice(k * third, (k + 1) * third) for k in (1, 2))
    last, earlier = (float(np.abs(m.e[part]).max()) for part in (now, before))
    creeps, moves = TINY * np.abs(m.e).max(), STILL * np.abs(m.u).max()
    if np.ptp(m.e[now]) <= creeps and np.ptp(m.u[now]) <= moves:
        return Seen(RESTS)
    if (seen := _repeating(m, before, now)) is not None:
        return seen
    if last <= small:
        return Seen(RESTS)
    return Seen(GROWS if last > max(large, earlier) else OPEN, size=last, ratio=last / earlier)


def _repeating(m: Motion, before: slice, now: slice) -> Seen | None:
    size, was = np.ptp(m.e[now]), np.ptp(m.e[before])
    peaks, times = _half_turns(m.t[now], m.e[now])
    if len(peaks) < TURNS or abs(size - was) > STEADY * was:
        return None
    size, scatter = float(peaks.mean()), float(peaks.std())
    drift = abs(size / _half_turns(m.t[before], m.e[before])[0].mean() - 1.0)
    if drift > max(REPEATS, 4.0 * scatter / size / np.sqrt(len(peaks))):
        return None
    sides = {k: float(_half_turns(m.t[now], y[now])[0].mean()) for k, y in m.sides.items()}
    sure = scatter <= REPEATS * size or len(peaks) >= MANY
    period = 2.0 * float(np.diff(times).mean())
    return Seen(HUNTS, size, scatter, period, sides, size, sure=sure)


def _half_turns(t: np.ndarray, e: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The largest |e| between sign changes about the middle of the motion, and their times."""
    own = e - 0.5 * (e.max() + e.min())
    far = np.abs(own) > 0.25 * own.max()  # a stop near the middle is no turn
    sign, at = np.sign(own[far]), np.flatnonzero(far)
    turned = at[1:][sign[1:] != sign[:-1]]
    parts = zip(turned[:-1], turned[1:], strict=True)
    return np.array([np.abs(own[a:b]).max() for a, b in parts]), t[turned]


def cycles_of(seen: Iterable[Seen]) -> tuple[Cycle, ...]:
    """Return the different cycles among what persists, each the mean of its starts."""
    made: list[list[Seen]] = []
    for one in sorted((s for s in seen if s.fate == HUNTS), key=lambda s: s.amplitude):
        last = made[-1][-1] if made else one
        far = one.amplitude - last.amplitude > max(SAME * last.amplitude, 2.0 * last.scatter)
        made += [[]] if far or not made else []
        made[-1].append(one)
    cycles = []
    for group in made:
        rows = [(s.amplitude, s.period, s.scatter, *s.sides.values()) for s in group]
        size, period, scatter, *sides = np.mean(rows, axis=0).tolist()
        cycles.append(Cycle(size, period, True, (), None, scatter, *sides))
    return tuple(cycles)


@dataclass(frozen=True)
class Budget:
    """What is not known at the time ``end`` stays open."""

    end: float
    report: Callable[[float, str], None]

    def is_over(self) -> bool:
        return monotonic() > self.end


class Search:
    """Runs from several starts, each as long as it needs within a budget of simulated time."""

    def __init__(self, run: Run, starts: Iterable[float], budget: Budget) -> None:
        self.run, self.starts, self.budget = run, sorted(map(float, starts)), budget
        self.small, self.large = SMALLER * self.starts[0], LARGER * self.starts[-1]
        self.passed: list[tuple[float, float]] = []
        self.sure: list[Seen] = []

    def answer(self, where: str) -> LimitCycles:
        """Cycles and border; ``where`` it starts, with {} for the smallest and the largest."""
        count, falling = len(self.starts), []
        for k, start in enumerate(reversed(self.starts)):
            self.budget.report(k / count, f"start {k + 1} of {count}")
            falling.append(self._fate(start))
        seen = self._settled(falling[::-1])
        ends = where.format(*map(number, (self.starts[0], self.starts[-1])))
        grows, undecided = (sum(s.fate == fate for s in seen) for fate in (GROWS, OPEN))
        fates = [HUNTS if s.fate == JOINS else s.fate for s in seen]
        every = ", ".join(f"{fates.count(k)} {verb}" for k, verb in VERBS.items() if k in fates)
        said = f"searched by simulation from {count} starts, {ends}, not proven: {every}"
        return LimitCycles(
            cycles_of(seen), self._border(seen), None, bool(grows), {}, (said,), undecided=undecided
        )

    def _fate(self, start: float) -> Seen:
        one = Seen(OPEN)
        for length in LENGTHS:
            if self.budget.is_over():
                return Seen(OPEN)
            try:
                one = judged(self.run(start, length), self.small, self.large)
            except Diverged:
                one = Seen(GROWS)
            # where another goes on so does this one, if it changes: it is near no cycle of its own
            near = any(a <= one.size <= b for a, b in self.passed)
            if one.fate == OPEN and near and abs(one.ratio - 1.0) > STEADY:
                one = one._replace(fate=JOINS)
            # one that scatters as it does has been seen for long
            seen = any(abs(one.size - s.size) <= 2.0 * s.scatter for s in self.sure)
            if one.fate != OPEN and (one.sure or seen):
                break
        if one.fate in AWAKE:
            self.passed.append((min(start, one.size), max(start, one.size)))
            self.sure += [one] * (one.fate == HUNTS)
        return one

    def _settled(self, seen: Sequence[Seen]) -> list[Seen]:
        """What still shrinks at the end of the budget, below starts that all rest, rests too."""
        resting, all_rest, made = 0.0, True, []
        for start, one in zip(self.starts, seen, strict=True):
            if one.fate == OPEN and one.ratio < 1.0 and one.size < resting:
                one = Seen(RESTS)
            all_rest = all_rest and one.fate == RESTS
            resting = start if all_rest else resting
            made.append(one)
        return made

    def _border(self, seen: Sequence[Seen]) -> float | None:
        """The smallest start that does not come to rest; 0 where it is the first."""
        first = next((k for k, s in enumerate(seen) if s.fate in AWAKE), None)
        if not first:
            return first
        low, high = self.starts[first - 1 : first + 1]

        def sleeps(start: float) -> bool:
            return self._fate(start).fate not in AWAKE

        return edge(sleeps, low, high, BORDER, self.budget.is_over)[1]


SMALLEST, LARGEST, COUNT = 0.05, 30.0, 14  # units: errors at breakaway from which it starts
CELLS = np.linspace(0.55, 3.0, 12)  # counts
SHAKEN = 0.01  # counts
SAMPLES = 20_000  # of a run
POINTS, MOST = 40_000, 640_000  # of a run in continuous time, and of a longer one
LOAD = "theta_load"


def errors(loop: Loop) -> np.ndarray:
    """Return errors at breakaway, rad, up to the largest that friction can keep up."""
    reach = loop.largest[1]
    largest = max(LARGEST, reach) if np.isfinite(reach) else LARGEST
    return loop.unit * np.geomspace(SMALLEST, largest, COUNT)


def sampled_starts(loop: Loop, sensing: Sensing, cycles: list[float]) -> np.ndarray:
    """Return errors at breakaway, rad, those of cycles too: an error within half a count is rest,
    and over the first counts what becomes of it depends on its place within one."""
    cells = CELLS * sensing.resolution
    every = np.r_[errors(loop), cells[cells > SMALLEST * loop.unit], cycles]
    return np.sort(every[every > 0.5 * sensing.resolution])


def sampled_run(model: Model, loop: Loop, sensing: Sensing, limit: float | None) -> Run:
    """Return a run of a sampled PID: from breakaway at an error, for so many times its samples."""
    body = plant(model, inputs=["u_late", "d"])
    pid, *limited = _controller(loop, limit, "w_m")
    drive = [
        encoder(sensing),
        controllers.error("position", inputs=["r", "theta_m"]),
        *(sampled(pid, sensing.dt), *limited),
        dead_time(sensing.delay, sensing.dt, inputs=["u"], outputs=["u_late"]),
    ]
    names = [label for block in drive for label in block.state_labels]

    def run(e: float, times: int) -> Motion:
        length = SAMPLES * times
        seen = float(rounded(e, sensing.resolution))
        own = {"last": seen, "q": _integral(loop, seen), "last_e": seen}
        start = [next((v for k, v in own.items() if n.endswith(k)), 0.0) for n in names]
        # a swing that locks to a place within a count and ends when it is shaken is no hunting
        shaken = np.random.default_rng(0).uniform(-SHAKEN, SHAKEN, length) * sensing.resolution
        t, inputs = sensing.dt * np.arange(length), {"r": 0.0, "n_theta": shaken}
        x = _at_breakaway(loop, body, e)
        return _motion(quietly(simulate_sampled, body, drive, t, inputs, x, drive_x0=start))

    return run


def _controller(loop: Loop, limit: float | None, speed: str) -> list[ct.NonlinearIOSystem]:
    """A PID from e and a speed to u; a limit holds its integral back."""
    gains = (loop.kp, loop.ki, loop.kd)
    if limit is None:
        return [controllers.pid(*gains, inputs=["e", speed])]
    time = controllers.tracking_time(loop.kp, loop.ki, None, "limit_cycles")
    seen = ["e", speed, "excess"]
    return [
        controllers.pid(*gains, tracking=time, inputs=seen, outputs=["u_cmd"]),
        limiter(limit, inputs=["u_cmd"], outputs=["u", "excess"]),
    ]


def _integral(loop: Loop, e: float) -> float:
    """The integrator's state at which the torque reaches breakaway."""
    return (loop.kp * e - loop.curve.Fs) / loop.ki if loop.ki else 0.0


def _at_breakaway(loop: Loop, body: Any, e: float) -> list[float]:
    """The states of a plant that is about to slip from e > 0 towards zero: bristles are bent."""
    first = {"theta": e, "z": -loop.curve.Fs / body.params.get("plant.sigma0", np.inf)}
    return [first.get(label, 0.0) for label in body.state_labels]


def continuous_run(model: Model, loop: Loop, seconds: float, limit: float | None) -> Run:
    """Return a run of the PID loop in continuous time with all of a model."""
    body = plant(model)
    seen = ["theta", "u", *(k for k in body.output_labels if k == LOAD)]
    system = ct.interconnect(
        [body, controllers.error("position"), *_controller(loop, limit, "w")],
        inputs=["r"], outputs=seen, params={}, check_unused=False, name="loop",
    )  # fmt: skip

    def run(e: float, times: int) -> Motion:
        start = [*_at_breakaway(loop, body, e), _integral(loop, e)]
        return _motion(quietly(simulate, system, _times(times, seconds), {"r": 0.0}, start))

    return run


def loop_run(system: Any, seconds: float) -> Run:
    """Return a run of any loop with the input r and the outputs theta and u: a step from rest."""
    missing = [k for k in ("theta", "u") if k not in (getattr(system, "output_labels", None) or ())]
    if missing or "r" not in system.input_labels:
        raise InputError(
            "limit_cycles needs a model with gains, or a position loop with the input r and the "
            f"outputs theta and u; {getattr(system, 'name', 'this')} has none of that kind."
        )

    def run(step: float, times: int) -> Motion:
        return _motion(quietly(simulate, system, _times(times, seconds), {"r": step}), step)

    return run


def _times(times: int, seconds: float) -> np.ndarray:
    return np.linspace(0.0, times * seconds, min(POINTS * times, MOST))


def quietly(simulated: Any, *given: Any, **more: Any) -> Any:
    """Return a response without its warnings: a drive that chatters at rest is looked for."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return simulated(*given, **more)


def _motion(done: Any, r: float = 0.0) -> Motion:
    """A response as a motion; the side that is controlled is the one that e = theta - r follows."""
    labels = list(done.output_labels)
    rows = dict(zip(labels, np.asarray(done.outputs).reshape(len(labels), -1), strict=True))
    motor, load = rows["theta"] - r, rows.get(LOAD)
    if load is None:
        return Motion(done.time, motor, rows["u"])
    sides, e = {"motor": motor, "load": load - r}, rows.get("e", motor)
    return Motion(done.time, min(sides.values(), key=lambda y: np.ptp(e - y)), rows["u"], sides)
