"""``lugrectl.limit_cycles``: whether a position loop hunts, rests, or stays undecided.

Around a rigid drive by the map from stick to stick; all else by simulation from many starts: what
persists, and the smallest that does not come to rest.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from time import monotonic
from typing import Any, NamedTuple

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import root

from ..blocks import controllers
from ..blocks.controllers import dead_time as delayed
from ..blocks.controllers import limiter
from ..blocks.model import Model, as_model
from ..blocks.plant import plant
from ..core.display import Row, Shown, noticed
from ..core.display import number as shown
from ..core.errors import Diverged, InputError
from ..core.progress import Wanted, reporter, shows_progress
from ..core.result import Result, picked
from ..core.unit_names import unit_for
from ..core.validation import not_negative, positive, whole
from ..core.views import view
from ..simulation.response import simulate
from ..simulation.sampled_block import Sensing, encoder, rounded, sampled
from .loop import (
    HIGH,
    LOW,
    NEVER,
    STICKS,
    Lanes,
    Loop,
    critical,
    edge,
    excess,
    excess_on,
    half_turn,
    proven,
    ranges,
    varied,
)

SCATTERS = 0.02  # of the amplitude: a swing that does not repeat


@dataclass(frozen=True, repr=False)
class Cycle(Shown):
    """A limit cycle of a position loop.

    ``amplitude`` is half the peak to peak of theta, ``period`` in s. ``multipliers`` of one turn
    of the cycle: a small distance from it grows by them; stable where all are below 1 in size. They
    are empty where a cycle was found by waiting. ``stops`` in a period; None: not counted.
    ``scatter``, of the size of half turns about the amplitude, which is then their mean: counts and
    gaps make hunting irregular. ``amplitude`` is of the side that is controlled; where a gap or a
    spring is between motor and load, ``amplitude_motor`` and ``amplitude_load`` stand beside it.
    """

    amplitude: float
    period: float
    stable: bool
    multipliers: tuple[float, ...] = ()
    stops: int | None = None
    scatter: float = 0.0
    amplitude_motor: float | None = None
    amplitude_load: float | None = None
    _units = {"amplitude": "rad", "period": "s", "scatter": "rad"}

    @property
    def sides(self) -> dict[str, float]:
        """Amplitudes of motor and load, where they differ."""
        both = {k: getattr(self, f"amplitude_{k}") for k in ("motor", "load")}
        return {k: v for k, v in both.items() if v is not None}

    def summary(self) -> dict[str, Any]:
        """Plain Python."""
        own = picked(self, "amplitude period stable stops scatter multipliers")
        return own | {f"amplitude_{k}": v for k, v in self.sides.items()}


@dataclass(frozen=True, repr=False)
class LimitCycles(Result):
    """The limit cycles of a position loop; truthy if every start comes to rest.

    Attributes
    ----------
    outcome : "hunts", "rests" or "undecided"
        hunts: a start keeps on swinging, or grows without bound. rests: every start comes to rest,
        maybe past an unstable cycle. undecided: none is known to swing, and some neither came to
        rest nor repeated within the budget.
    cycles : tuple of Cycle
        By amplitude; ``amplitude`` in rad (m on a linear drive), ``period`` in s, ``stable``,
        ``multipliers``, ``stops``.
    basin : float or None
        The smallest start that does not come to rest: the error at breakaway in rad, or the step of
        r of a loop of blocks; 0: from the smallest that was searched; None: none is known.
    proof : str or None
        Why there can be no cycle; None where absence is searched, not proven.
    diverges : bool
        Whether the loop grows without bound, from large errors at least.
    loop : dict
        What was searched: gains, J, law, rate, dead time, counts.
    messages : tuple of str
        What the answer does not cover.
    critical : dict
        With ``vary``: by gain the values at which hunting begins or ends; two ends (low, high)
        where it is undecided between them.
    curve : tuple of two arrays, or None
        Errors at breakaway in rad and log(T(e)/e), how much they grow to the next stick on the
        other side; 50 and -50 stand for growth without a stick and for rest.
    motion : "rotary" or "linear"
        Of the drive.
    undecided : int
        Starts of a search by simulation that neither came to rest nor repeated.
    stick_slip : StickSlip or None
        With ``lugrectl hunt --speed``: the speeds of :func:`stick_slip_speed`.

    Examples
    --------
    >>> drive = lg.Model.of(friction="stribeck", J=1.0, Fc=1.0, Fs=1.5, vs=1e-3, Fv=0.4)
    >>> lg.limit_cycles(drive, kp=3.0, ki=4.0, kd=6.0)
    the loop hunts
      cycle  +-0.06692 rad, period 23.73 s, stable, 2 stops
      border  the smallest start that was searched does not come to rest
    """

    cycles: tuple[Cycle, ...]
    basin: float | None
    proof: str | None
    diverges: bool
    loop: dict[str, Any]
    messages: tuple[str, ...] = ()
    critical: Mapping[str, tuple[Any, ...]] = field(default_factory=dict)
    curve: tuple[np.ndarray, np.ndarray] | None = None
    motion: str = "rotary"
    undecided: int = 0
    stick_slip: Any = None

    def __bool__(self) -> bool:
        return self.outcome == "rests"

    @property
    def outcome(self) -> str:
        """hunts, rests or undecided."""
        if self.diverges or any(c.stable for c in self.cycles):
            return "hunts"
        return "undecided" if self.undecided else "rests"

    @property
    def hunts(self) -> bool | None:
        """Whether some start keeps on swinging or grows; None: undecided."""
        return None if self.outcome == "undecided" else not self

    def summary(self) -> dict[str, Any]:
        """Plain Python, as ``lugrectl hunt --json`` prints it."""
        names = "outcome hunts cycles basin proof diverges loop undecided stick_slip"
        return {"schema": 1, **picked(self, f"{names} critical messages")}

    def plot(self, ax: Any = None) -> Any:
        """Draw the growth of the error from stick to stick with the cycles; returns the Axes."""
        return view("loop_plots.growth")(self, ax)

    def _title(self) -> str:
        rest = f"no limit cycle: {'proven' if self.proof else 'none found'}"
        if self.outcome == "undecided":
            rest = "undecided: some starts neither came to rest nor repeated"
        elif self.outcome == "hunts":
            swings = any(c.stable for c in self.cycles)
            rest = "the loop hunts" if swings else "the loop diverges"
        elif self.cycles:
            rest = "every start comes to rest, past an unstable cycle"
        return f"{self.stick_slip._title()}; at rest {rest}" if self.stick_slip else rest

    def _rows(self) -> Iterable[Row]:
        unit = unit_for("rad", self.motion)
        for c in self.cycles:
            kind = "stable" if c.stable else "unstable"
            stops = "" if c.stops is None else f", {c.stops} stops"
            said = f"+-{shown(c.amplitude)} {unit}, period {shown(c.period)} s, {kind}{stops}"
            if c.scatter > SCATTERS * c.amplitude:
                said += f", half turns scatter by {shown(c.scatter)} {unit}"
            sides = ", ".join(f"{k} +-{shown(v)} {unit}" for k, v in c.sides.items())
            yield Row("cycle", said + (f" ({sides})" if sides else ""))
        if self.basin is not None:
            said = f"{shown(self.basin)} {unit}: the smallest start that does not come to rest"
            none = "the smallest start that was searched does not come to rest"
            yield Row("border", said if self.basin else none)
        if self.proof:
            yield Row("proof", self.proof)
        if self.stick_slip:
            yield from self.stick_slip._rows()
        yield from noticed(self.messages, "messages")


POINTS = 300  # of the grid of errors
DIP = 0.3  # |D| of an extremum between grid points that may reach zero
PARTS, CUTS = 16, 5  # into which a bracket is cut at a time, and how often
JUMP = 1e-3  # |D| at the end of the cuts: not a root
AWAY = 1e-4  # relative distance at which a multiplier is measured
BEYOND = 10.0  # times the largest start: a swing that grows without bound


def rigid_cycles(loop: Loop) -> LimitCycles:
    proof = proven(loop)
    if proof:
        return LimitCycles((), None, proof, False, {})
    diverges = not loop.is_stable()
    high = HIGH if diverges else max(HIGH, loop.largest[1])
    lanes = replace(loop.lanes(1), large=BEYOND * high)
    x = np.geomspace(LOW, high, round(POINTS * np.log(high / LOW) / np.log(HIGH / LOW)))
    D = excess_on(lanes.many(len(x)), x)[0]
    x, D = _closer(lanes, x, D)
    rests = np.cumprod(D <= -NEVER).sum()  # sticks up to here come to rest at once
    lanes = replace(lanes, calm=float(x[rests - 1]) if rests else 0.0)
    turns, is_root = _turns(lanes, x, D)
    cycles = tuple(_described(loop, lanes, turns[is_root]))
    border = None
    if diverges or any(c.stable for c in cycles):
        border = 0.0 if D[0] > 0.0 or not len(turns) else float(turns[0]) * loop.unit
    said = ("large motions grow without bound: kd kp > ki J does not hold",) * diverges
    return LimitCycles(cycles, border, None, diverges, {}, said, curve=(x * loop.unit, D))


def _closer(lanes: Lanes, x: np.ndarray, D: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The grid with more points where |D| is so small that it may reach zero between two."""
    for _ in range(2):
        size = np.abs(D)
        dips = (size[1:-1] < np.minimum(size[:-2], DIP)) & (size[1:-1] <= size[2:])
        at = np.flatnonzero(dips)
        more = np.geomspace(x[at], x[at + 2], 2 * PARTS + 1)[1:-1].ravel()
        if not len(at):
            break
        x, first = np.unique(np.r_[x, more], return_index=True)
        D = np.r_[D, excess(lanes.many(len(more)), more)][first]
    return x, D


def _turns(lanes: Lanes, x: np.ndarray, D: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Where D changes its sign, and whether by a root or by a jump. D is made exact in place beside
    these."""

    def changes(D: np.ndarray) -> np.ndarray:
        return (D[:-1] > 0.0) != (D[1:] > 0.0)

    for _ in range(2):  # an interpolated end may have the wrong sign
        at = np.flatnonzero(changes(D))
        at = np.union1d(at, at + 1)
        D[at] = excess(lanes.many(len(at)), x[at]) if len(at) else D[at]
    at = np.flatnonzero(changes(D))
    ends, sizes, k = x[[at, at + 1]], D[[at, at + 1]], np.arange(len(at))
    for _ in range(CUTS if len(at) else 0):
        cut = np.geomspace(ends[0], ends[1], PARTS + 1)
        seen = excess(lanes.many(cut.size), cut.ravel()).reshape(cut.shape)
        first = np.argmax(changes(seen), axis=0)
        ends, sizes = (row[[first, first + 1], k] for row in (cut, seen))
    place = ends[0] * (ends[1] / ends[0]) ** (sizes[0] / (sizes[0] - sizes[1]))
    return place, np.abs(sizes).max(axis=0) <= JUMP


def _described(loop: Loop, lanes: Lanes, x: np.ndarray) -> list[Cycle]:
    """The symmetric cycle of each root, two half turns, with its multiplier."""
    e = x * np.array([1.0 - AWAY, 1.0, 1.0 + AWAY])[:, None]
    made = half_turn(lanes.many(e.size), e.ravel())
    T, sticks = made.x.reshape(e.shape), made.fate.reshape(e.shape) == STICKS
    first, last = np.where(sticks[0], 0, 1), np.where(sticks[2], 2, 1)  # beside a border one does
    k, own = np.arange(len(x)), np.arange(len(x), 2 * len(x))
    slope = (T[last, k] - T[first, k]) / np.maximum(e[last, k] - e[first, k], AWAY * x)
    size, period = made.size[own] * loop.unit, 2.0 * made.t[own] / loop.wn
    rows = zip(size, period, slope.tolist(), made.stops[own], sticks[1], strict=True)
    return [
        Cycle(float(a), float(T), mu**2 < 1.0, (mu**2,), 2 * int(n))
        for a, T, mu, n, stays in rows
        if stays
    ]


def _is_open(rigid: LimitCycles) -> bool:
    """Whether the map alone does not say what becomes of all starts."""
    if rigid.curve is None or rigid.diverges:
        return False
    D, settles = rigid.curve[1], any(c.stable for c in rigid.cycles)
    return bool(np.any(~(D < NEVER)) or (np.any(D > 0.0) and not settles))


RESTS, HUNTS, GROWS, OPEN = "rests", "hunts", "grows", "open"
AWAKE = (HUNTS, GROWS)
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
    cycle: Cycle | None = None
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
    return Seen(GROWS if last > max(large, earlier) else OPEN, None, last, last / earlier)


def _repeating(m: Motion, before: slice, now: slice) -> Seen | None:
    size, was = np.ptp(m.e[now]), np.ptp(m.e[before])
    peaks, times = _half_turns(m.t[now], m.e[now])
    if len(peaks) < TURNS or abs(size - was) > STEADY * was:
        return None
    size, scatter = float(peaks.mean()), float(peaks.std())
    drift = abs(size / _half_turns(m.t[before], m.e[before])[0].mean() - 1.0)
    if drift > max(REPEATS, 4.0 * scatter / size / np.sqrt(len(peaks))):
        return None
    sides = [float(_half_turns(m.t[now], y[now])[0].mean()) for y in m.sides.values()]
    sure = scatter <= REPEATS * size or len(peaks) >= MANY
    cycle = Cycle(size, 2.0 * float(np.diff(times).mean()), True, (), None, scatter, *sides)
    return Seen(HUNTS, cycle, size, sure=sure)


def _half_turns(t: np.ndarray, e: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    own = e - 0.5 * (e.max() + e.min())
    far = np.abs(own) > 0.25 * own.max()  # a stop near the middle is no turn
    sign, at = np.sign(own[far]), np.flatnonzero(far)
    turned = at[1:][sign[1:] != sign[:-1]]
    parts = zip(turned[:-1], turned[1:], strict=True)
    return np.array([np.abs(own[a:b]).max() for a, b in parts]), t[turned]


def cycles_of(seen: Iterable[Seen]) -> tuple[Cycle, ...]:
    """Return the middle one of those that are as large, within their scatter."""
    made: list[list[Cycle]] = []
    for one in sorted((s.cycle for s in seen if s.cycle), key=lambda c: c.amplitude):
        last = made[-1][-1] if made else Cycle(-np.inf, 0.0, True)
        far = one.amplitude - last.amplitude > max(SAME * last.amplitude, 2.0 * last.scatter)
        made += [[]] if far else []
        made[-1].append(one)
    return tuple(group[len(group) // 2] for group in made)


class Search:
    """Runs from several starts, each as long as it needs within a budget of simulated time; what is
    not known at the time ``end`` stays open."""

    def __init__(
        self, run: Run, starts: Iterable[float], end: float, report: Callable[[float, str], None]
    ) -> None:
        self.run, self.starts = run, sorted(map(float, starts))
        self.is_over, self.report = lambda: monotonic() > end, report
        self.small, self.large = SMALLER * self.starts[0], LARGER * self.starts[-1]
        self.passed: list[tuple[float, float]] = []
        self.sure: list[Cycle] = []

    def answer(self, where: str) -> LimitCycles:
        """Cycles and border; ``where`` it starts, with {} for the smallest and the largest."""
        count, falling = len(self.starts), []
        for k, start in enumerate(reversed(self.starts)):
            self.report(k / count, f"start {k + 1} of {count}")
            falling.append(self._fate(start))
        seen = self._settled(falling[::-1])
        ends = where.format(*map(shown, (self.starts[0], self.starts[-1])))
        fates = [s.fate for s in seen]
        every = ", ".join(f"{fates.count(k)} {verb}" for k, verb in VERBS.items() if k in fates)
        said = f"searched by simulation from {count} starts, {ends}, not proven: {every}"
        return LimitCycles(
            cycles_of(seen), self._border(seen), None, GROWS in fates, {}, (said,),
            undecided=fates.count(OPEN),
        )  # fmt: skip

    def _fate(self, start: float) -> Seen:
        one = Seen(OPEN)
        for length in LENGTHS:
            if self.is_over():
                return Seen(OPEN)
            try:
                one = judged(self.run(start, length), self.small, self.large)
            except Diverged:
                one = Seen(GROWS)
            # where another goes on so does this one, if it changes: it is near no cycle of its own
            near = any(a <= one.size <= b for a, b in self.passed)
            if one.fate == OPEN and near and abs(one.ratio - 1.0) > STEADY:
                one = one._replace(fate=HUNTS)
            # one that scatters as it does has been seen for long
            seen = any(abs(one.size - c.amplitude) <= 2.0 * c.scatter for c in self.sure)
            if one.fate != OPEN and (one.sure or seen):
                break
        if one.fate in AWAKE:
            self.passed.append((min(start, one.size), max(start, one.size)))
            self.sure += [one.cycle] if one.cycle else []
        return one

    def _settled(self, seen: list[Seen]) -> list[Seen]:
        """What still shrinks at the end of the budget, below starts that all rest, rests too."""
        for k, one in enumerate(seen):
            resting = self.starts[k - 1] if k and all(s.fate == RESTS for s in seen[:k]) else 0.0
            if one.fate == OPEN and one.ratio < 1.0 and one.size < resting:
                seen[k] = Seen(RESTS)
        return seen

    def _border(self, seen: Sequence[Seen]) -> float | None:
        """The smallest start that does not come to rest; 0 where it is the first."""
        first = next((k for k, s in enumerate(seen) if s.fate in AWAKE), None)
        if not first:
            return first
        low, high = self.starts[first - 1 : first + 1]

        def sleeps(start: float) -> bool:
            return self._fate(start).fate not in AWAKE

        return edge(sleeps, low, high, BORDER, self.is_over)[1]


SMALLEST, LARGEST, COUNT = 0.05, 30.0, 14  # units: errors at breakaway from which it starts
CELLS = np.linspace(0.55, 3.0, 12)  # counts
SHAKEN = 0.01  # counts
SAMPLES = 20_000  # of a run
TIMES, MOST = 40_000, 640_000  # of a run in continuous time, and of a longer one
LOAD = "theta_load"


def starts_of(loop: Loop, sensing: Sensing | None, cycles: list[float]) -> np.ndarray:
    """Return errors at breakaway, rad, those of cycles too. An error within half a count is rest,
    and over the first counts what becomes of it depends on its place within one."""
    reach, step = loop.largest[1], 0.0 if sensing is None else sensing.resolution
    largest = max(LARGEST, reach) if np.isfinite(reach) else LARGEST
    cells = CELLS * step
    every = loop.unit * np.geomspace(SMALLEST, largest, COUNT)
    every = np.r_[every, cells[cells > SMALLEST * loop.unit], cycles]
    return np.sort(every[every >= 0.5 * step])


def model_run(
    model: Model, loop: Loop, sensing: Sensing | None, limit: float | None, seconds: float
) -> Run:
    """Return a run of a PID from breakaway at an error towards zero: bristles are bent."""
    speed, gains = "w" if sensing is None else "w_m", (loop.kp, loop.ki, loop.kd)
    control = [controllers.pid(*gains, inputs=["e", speed])]
    if limit is not None:
        back, seen = controllers.tracking_time(*gains[:2], None, "limit_cycles"), ["e", speed]
        control = [
            controllers.pid(*gains, tracking=back, inputs=[*seen, "excess"], outputs=["u_cmd"]),
            limiter(limit, inputs=["u_cmd"], outputs=["u", "excess"]),
        ]
    if sensing is None:
        blocks = [plant(model), controllers.error("position"), *control]
    else:
        blocks = [
            plant(model, inputs=["u_late", "d"]),
            encoder(sensing),
            controllers.error("position", inputs=["r", "theta_m"]),
            sampled(control[0], sensing.dt),
            *control[1:],
            delayed(sensing.delay, sensing.dt, inputs=["u"], outputs=["u_late"]),
        ]
    labels = [label for block in blocks for label in block.state_labels or ()]
    bend = loop.curve.Fs / blocks[0].params.get("plant.sigma0", np.inf)

    def run(e: float, times: int) -> Motion:
        seen = e if sensing is None else float(rounded(e, sensing.resolution))
        held = (loop.kp * seen - loop.curve.Fs) / loop.ki if loop.ki else 0.0
        start = {"theta": e, "z": -bend, "last": seen, "last_e": seen, "q": held}
        t, inputs = _times(times, seconds), dict[str, Any](r=0.0)
        if sensing is not None:
            # a swing that locks to a place within a count and ends when it is shaken is no hunting
            t, random = sensing.dt * np.arange(SAMPLES * times), np.random.default_rng(0)
            inputs["n_theta"] = random.uniform(-SHAKEN, SHAKEN, len(t)) * sensing.resolution
        return _motion(quietly(simulate, blocks, t, inputs, [start.get(k, 0.0) for k in labels]))

    return run


def loop_run(system: Any, seconds: float) -> Run:
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
    return np.linspace(0.0, times * seconds, min(TIMES * times, MOST))


def quietly(simulated: Any, *given: Any) -> Any:
    """Return a response without its warnings: a drive that chatters at rest is looked for."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return simulated(*given)


def _motion(done: Any, r: float = 0.0) -> Motion:
    """A response as a motion; the side that is controlled is the one that e = theta - r follows."""
    labels = list(done.output_labels)
    rows = dict(zip(labels, np.asarray(done.outputs).reshape(len(labels), -1), strict=True))
    motor, load = rows["theta"] - r, rows.get(LOAD)
    if load is None:
        return Motion(done.time, motor, rows["u"])
    sides, e = {"motor": motor, "load": load - r}, rows.get("e", motor)
    return Motion(done.time, min(sides.values(), key=lambda y: np.ptp(e - y)), rows["u"], sides)


NUDGE, NEAR = 1e-4, 1e-6  # of a state: by which a slope is measured, and of a turn that repeats
RTOL = 1e-9  # of a half turn
SETTLES = 6  # half turns towards a cycle that attracts
LONGEST = 400.0  # times kp/ki: the longest half turn
ONE = 1e-3  # relative difference of two amplitudes that are one


class Bristles:
    """The loop around a law of w with bristles. At e = 0 its state is x = (w, I, z, ...) in units:
    speed, torque of the integral, and the friction's states. The half turn from w < 0 to the next
    e = 0, with all signs changed, is a map of x; its fixed points are the symmetric cycles, and the
    eigenvalues of its slope their multipliers of half a turn."""

    def __init__(self, model: Model, loop: Loop) -> None:
        self.loop, self.law = loop, model.friction.block
        self.values: dict[str, Any] = {**self.law.defaults(), **model.friction.values}
        bends = np.full(len(self.law.states), loop.curve.Fs / float(self.values["sigma0"]))
        self.scale = np.r_[loop.unit, loop.speed, loop.curve.Fs, bends]

    def rates(self, t: float, state: np.ndarray) -> np.ndarray:
        F, *dz = self.law(state[1], *state[3:], **self.values)
        de, dw, dq = self.loop.matrix @ state[:3]
        return np.array([de, dw - F / self.loop.J, dq, *dz])

    def half(self, x: np.ndarray, e: float = 0.0) -> tuple[np.ndarray, float, float]:
        """From an error and x to x of the next e = 0, with the time and the largest error; nan
        where there is none."""
        side, span = (1.0 if e else -1.0), LONGEST * self.loop.kp / self.loop.ki
        none = np.full(len(x), np.nan), np.nan, np.nan
        if not np.isfinite(x).all() or (x[0] >= 0.0 and not e):
            return none

        def crossed(t: float, s: np.ndarray) -> float:
            return s[0] + (side * 1e-9 * self.loop.unit if t == 0.0 else 0.0)

        crossed.terminal, crossed.direction = True, -side  # type: ignore[attr-defined]
        options: Any = {"events": crossed, "rtol": RTOL, "atol": 1e-9 * self.scale}
        start = self.scale * np.r_[e / self.loop.unit, x]
        done = solve_ivp(self.rates, (0.0, span), start, "LSODA", **options)
        if not len(done.t_events[0]):
            return none
        end = side * done.y_events[0][0][1:] / self.scale[1:]
        return end, float(done.t_events[0][0]), float(np.abs(done.y[0]).max())

    def cycle(self, e: float, turns: int) -> Cycle | None:
        """The cycle so many half turns after breakaway at e."""
        held = self.loop.kp * e / self.loop.curve.Fs - 1.0
        x = self.half(np.r_[0.0, held, -np.ones(len(self.law.states))], e)[0]
        for _ in range(turns):
            x = self.half(x)[0]
        found = root(lambda x: self.half(x)[0] - x, x, options={"eps": NUDGE, "xtol": NEAR})
        end, t, size = self.half(found.x)
        steps = np.diag(NUDGE * np.maximum(np.abs(found.x), 1e-3))
        slope = np.array([(self.half(found.x + step)[0] - end) / step.sum() for step in steps])
        if not found.success or not np.isfinite(slope).all():
            return None
        turn = np.linalg.eigvals(slope.T) ** 2
        turn = turn[np.argsort(-np.abs(turn))]
        return Cycle(size, 2.0 * t, bool(abs(turn[0]) < 1.0), tuple(turn.real.tolist()))


def bristle_cycles(
    model: Model, loop: Loop, rigid: Iterable[Cycle], waited: tuple[Cycle, ...]
) -> tuple[Cycle, ...]:
    """Find the cycles near those of the sliding curve, and near those found by waiting; else the
    latter as they are."""
    law, found = model.friction.block, list[Cycle]()
    bristles = bool(law.states) and law.reads == ("w",) and "sigma0" in model.friction.values
    if not (loop.ki and bristles) or model.effects:
        return waited
    for start, turns in [*((c, 0) for c in rigid), *((c, SETTLES) for c in waited)]:
        cycle = Bristles(model, loop).cycle(start.amplitude, turns)
        near = cycle and cycle.stable and abs(cycle.amplitude / start.amplitude - 1.0) < SAME
        cycle = start if turns and not near else cycle  # what was seen to swing stays
        if cycle and all(abs(cycle.amplitude / c.amplitude - 1.0) > ONE for c in found):
            found.append(cycle)
    return tuple(sorted(found, key=lambda c: c.amplitude))


HORIZON = 15.0  # s, of the first run of a loop of blocks
STEPS = np.geomspace(1e-3, 10.0, 9)  # rad, of the reference of a loop of blocks
WAITS = 40.0  # kp/ki: a stick at 1/20 of the error at which kp alone breaks away
PERIODS = 12.0  # of a cycle of the sliding curve, that are simulated with all of a model
BELOW = "the limit is not above the torque {} at which friction breaks away: it never moves"
FROM = "from errors at breakaway of {} to {}"
INCLUDED = "at rest, with the effects of the model: {}"
LEFT_OUT = "at rest, without the effects of the sensors: {}"
NOT_GIVEN = "what is said of the loop itself is of {} = 0, which is not given"
STEPPED = "from steps of r of {} to {} rad"


@shows_progress
def limit_cycles(
    loop: Any,
    *,
    kp: float | None = None,
    ki: float | None = None,
    kd: float | None = None,
    kv: float | None = None,
    rate: float | None = None,
    dead_time: float = 0.0,
    counts: int | None = None,
    limit: float | None = None,
    vary: Mapping[str, tuple[float, float]] | None = None,
    time_limit: float | None = None,
    progress: Wanted = None,
) -> LimitCycles:
    """The friction limit cycles of a position loop at rest, or their absence.

    J dw/dt = u - F, u = -(kp e + ki int e + kd w), e = theta - r, r constant. With ``rate`` the
    controller is sampled and its torque held.

    Parameters
    ----------
    loop : Model, Parameters, path, or control.NonlinearIOSystem
        A drive, around which the controller is closed; or a whole position loop with the input r
        and the outputs theta and u, such as :func:`position_loop` and :func:`cascade_loop`, which
        takes none of the options below.
    kp, ki, kd : float, optional
        N m/rad, N m/(rad s), N m s/rad. The source paper's 15, 1.55, 0 if none is given, else 0
        for those left out.
    kv : float, optional
        In 1/s: a cascade u = (kp + ki/s)(-kv e - w), kp in N m s/rad and ki in N m/rad, which is
        the PID with kp kv + ki, ki kv and kp.
    rate : float, optional
        Samples of the controller in Hz; none: continuous time. The speed is then the difference
        of two positions.
    dead_time : float
        Between measurement and torque in s, with ``rate``.
    counts : int, optional
        Of the encoder in a turn (in a metre), with ``rate``; none: exact.
    limit : float, optional
        Largest torque of the controller, N m; the integral is held back as in :func:`pid`.
    vary : dict, optional
        ``{"ki": (1, 50)}``: also the values of a gain at which hunting begins or ends.
    time_limit : float, optional
        Seconds after which a search by simulation leaves undecided what it does not know; none:
        until its budget of simulated time is used.
    progress : callable, True, False or None
        ``progress(fraction, what)``, or whether to show a bar. None: in Jupyter only.

    Returns
    -------
    LimitCycles
        Truthy if every start comes to rest; ``.outcome``: "hunts", "rests" or "undecided".
        ``.cycles``, each with ``.amplitude`` (half the peak to peak of theta, rad), ``.period``
        (s), ``.stable``, ``.multipliers``, ``.stops``; ``.basin``, ``.proof``, ``.critical``,
        ``.messages``, ``.plot()``.

    Raises
    ------
    InputError
        For a value of the model that is not known, or a gain out of its range.

    Notes
    -----
    In a stick the error is constant and u changes by -ki e, so that breakaway is towards zero at
    |u| = Fs: the state there is e alone. Let T(e) be the error of the first stick on the other
    side. T(e) = e is a symmetric cycle, T(T(e)) = e one with unequal halves; its slope is the
    multiplier of half a turn. D(e) = log(T(e)/e) is followed from 1/1000 of Fs/kp to the largest
    error that friction can keep up (at least 30 Fs/kp): |F - Fv w| is bounded, and so is e, by
    that bound times the L1 norm of the linear loop from torque to error. Its sign changes are
    located, so that unstable cycles are found too. That is every symmetric cycle that sticks, of a
    drive without states but theta and w, in continuous time. Where no stable one is found though D
    is positive somewhere, or an error grows without a stick, the loop is simulated: cycles with
    unequal halves, and those that never stick, are found where they attract, and a loop from which
    every motion comes to rest rests.

    Absence is proven for Coulomb and viscous friction if (kd + Fv) kp > ki J (Bisoffi, Da Lio,
    Teel and Zaccarian, Global Asymptotic Stability of a PID Control System With Coulomb Friction,
    IEEE Trans. Automatic Control 63(8), 2018). Friction with bristles, effects, sampling, a limit
    and loops of blocks are simulated from many starts, each for longer and longer until it rests,
    repeats or grows: what persists is a cycle, and nothing is proven. A swing rests, too, once it
    is below a tenth of the smallest start, or at the end of the budget where it still shrinks and
    is below starts that rest. The border is bisected to 5 %. With bristles, the state at e = 0 that
    half a turn repeats then gives multipliers, and unstable cycles where the search for it reaches
    them from those of the sliding curve. Counts are shaken by a hundredth, so that a swing that
    locks to a place within one is no hunting; a swing that scatters may come to rest by chance, and
    is seen for 300 half turns or the whole budget.

    Hunting by Stribeck friction: Olsson and Astrom, Friction Generated Limit Cycles, IEEE Trans.
    Control Systems Technology 9(4), 2001; Hensen, van de Molengraft and Steinbuch, Friction
    Induced Hunting Limit Cycles, Automatica 39(12), 2003.

    Examples
    --------
    The loop of Canudas de Wit, Olsson, Astrom and Lischinsky (1995) without bristles:

    >>> drive = lg.Model.of(friction="stribeck", J=1.0, Fc=1.0, Fs=1.5, vs=1e-3, Fv=0.4)
    >>> found = lg.limit_cycles(drive, kp=3.0, ki=4.0, kd=6.0)
    >>> bool(found), round(found.cycles[0].amplitude, 4), round(found.cycles[0].period, 2)
    (False, 0.0669, 23.73)

    Without stiction nothing hunts, and that is proven:

    >>> smooth = lg.Model.of(friction="coulomb", J=1.0, Fc=1.0, Fv=0.4)
    >>> found = lg.limit_cycles(smooth, kp=3.0, ki=4.0, kd=6.0)
    >>> bool(found), found.proof[:28]
    (True, 'Coulomb and viscous friction')
    """
    end = np.inf if time_limit is None else positive(time_limit, "time_limit", "seconds")
    search = partial(Search, end=monotonic() + end, report=reporter(progress))
    if hasattr(loop, "input_labels"):
        given = (kp, ki, kd, kv, rate, counts, limit, vary)
        if dead_time or any(v is not None for v in given):
            raise InputError(
                "a loop of blocks has its own gains, rate, dead time and limit: give none."
            )
        found = search(loop_run(loop, HORIZON), STEPS).answer(STEPPED)
        return replace(found, loop={"name": getattr(loop, "name", "")})
    model, gains = as_model(loop), varied(kp, ki, kd, kv)
    most = None if limit is None else positive(limit, "limit", "N m")
    sensing = _sensing(rate, dead_time, counts, model.motion)
    ends = None if vary is None else ranges(vary, "vary")
    found = _searched(model, gains(), sensing, most, search)
    if ends is None:
        return found
    more = critical(
        lambda **x: _searched(model, gains(**x), sensing, most, search).hunts, ends, "hunting"
    )
    own = gains() | {"kv": kv}
    none = tuple(NOT_GIVEN.format(name) for name in ends if not own[name])
    said = (*more["messages"], *none, *found.messages)
    return replace(found, critical=more["critical"], messages=said)


def _sensing(rate: Any, dead_time: Any, counts: Any, motion: str) -> Sensing | None:
    late = not_negative(dead_time, "dead_time")
    if rate is None:
        if late or counts is not None:
            raise InputError("dead_time and counts belong to a sampled loop: give rate in Hz too.")
        return None
    turn = 2.0 * np.pi if motion == "rotary" else 1.0
    step = 0.0 if counts is None else turn / whole(counts, "counts", 1)
    return Sensing(1.0 / positive(rate, "rate", "Hz"), resolution=step, delay=late)


def _searched(
    model: Model,
    gains: Mapping[str, float],
    sensing: Sensing | None,
    limit: float | None,
    search: Callable[..., Search],
) -> LimitCycles:
    loop, law, about = Loop.of(model, gains), model.friction.block, {}
    dry, where = loop.curve.Fs > 0.0, f"{FROM} {unit_for('rad', model.motion)}"
    found = rigid = rigid_cycles(loop) if dry else LimitCycles((), None, None, False, {})
    if sensing is not None:
        about = {"rate": 1.0 / sensing.dt, "dead_time": sensing.delay}
        about |= {"resolution": sensing.resolution}
    own = dry and not law.states and not model.effects and sensing is None and limit is None
    if not own or _is_open(rigid):
        seconds = max([PERIODS * c.period for c in rigid.cycles], default=0.0)
        seconds += (WAITS * loop.kp / loop.ki if loop.ki else 0.0) + WAITS / loop.wn
        starts = starts_of(loop, sensing, [c.amplitude for c in rigid.cycles])
        run = model_run(model, loop, sensing, limit, seconds)
        found = search(run, starts).answer(where)
        if own:
            known = (c for c in rigid.cycles if not (c.stable and found.cycles))
            cycles = sorted((*known, *found.cycles), key=lambda c: c.amplitude)
            found = replace(found, cycles=tuple(cycles), curve=rigid.curve)
        elif sensing is None and limit is None:
            cycles = bristle_cycles(model, loop, rigid.cycles, found.cycles)
            found = replace(found, cycles=cycles)
        if rigid.diverges and sensing is None and limit is None:
            found = replace(found, diverges=True, messages=found.messages + rigid.messages)
    if limit is not None:
        about = {"limit": limit, **about}
    about = {**gains, "J": loop.J, "law": law.name, "model": model.name, **about}
    said = (*found.messages, *_of_model(model, loop, limit))
    return replace(found, loop=about, motion=model.motion, messages=said)


def _of_model(model: Model, loop: Loop, limit: float | None) -> list[str]:
    """What the answer covers."""
    sensors = [p.key for p in model.effects if "sensor" in p.block.acts]
    inside = [p.key for p in model.effects if p.key not in sensors]
    below = [BELOW.format(shown(loop.curve.Fs))] * (limit is not None and limit <= loop.curve.Fs)
    parts = ((INCLUDED, inside), (LEFT_OUT, sensors))
    return below + [text.format(", ".join(keys)) for text, keys in parts if keys]
