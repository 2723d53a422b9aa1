"""``lugrectl.limit_cycles``: whether a position loop hunts, rests, or stays undecided.

Around a rigid drive by the map from stick to stick; all else by simulation from many starts: what
persists, and the smallest that does not come to rest.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from time import monotonic
from typing import Any, NamedTuple

import control as ct
import numpy as np
from scipy.integrate import solve_ivp

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
from ..core.validation import number, positive, whole
from ..core.views import view
from ..simulation.encoder import Sensing, encoder, rounded
from ..simulation.response import simulate
from ..simulation.sampled_block import sampled
from ..simulation.sampled_response import simulate_sampled
from .loop import (
    HIGH,
    LOW,
    NEVER,
    STICKS,
    Lanes,
    Loop,
    Turn,
    critical,
    edge,
    excess,
    excess_on,
    half_turn,
    kept,
    proven,
    ranges,
    slip,
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


POINTS = 140  # of the grid of errors
DIP = 1.5  # |D| of an extremum between grid points that may reach zero
PARTS, CUTS = 16, 6  # into which a bracket is cut at a time, and how often
CLOSE = 1e-4  # |D| at both ends of a bracket that is no longer cut
ENOUGH = 2  # cuts for a border of rest or growth, which has no root
JUMP = 1e-3  # |D| at the end of the cuts: not a root
AWAY = 1e-4  # relative distance at which a multiplier is measured
STARTS, AGAIN = 3, 30  # from which T itself is iterated, and how often
BEYOND = 10.0  # times the largest start: a swing that grows without bound
SWINGS, SEEDS = 300, 4  # that are followed, and errors from which no stick followed, at most
ONE = 1e-3  # relative difference of two amplitudes that are one


def rigid_cycles(loop: Loop) -> LimitCycles:
    proof = proven(loop)
    if proof:
        return LimitCycles((), None, proof, False, {})
    diverges = not loop.is_stable()
    high = HIGH if diverges else max(HIGH, loop.largest[1])
    lanes = replace(loop.lanes(1), large=BEYOND * high)
    grid = np.geomspace(LOW, high, round(POINTS * np.log(high / LOW) / np.log(HIGH / LOW)))
    D = excess_on(lanes.many(len(grid)), grid)[0]
    rests = np.cumprod(D <= -NEVER).sum()  # sticks up to here come to rest at once
    lanes = replace(lanes, calm=float(grid[rests - 1]) if rests else 0.0)
    x, D = _closer(lanes, grid, D)
    roots, jumps = _roots(x, D)
    cycles = [*_described(loop, lanes, roots), *_swinging(loop, lanes, x[D >= NEVER])]
    if not any(c.stable for c in cycles) and np.any(D > 0.0) and not diverges:
        cycles += _persisting(loop, lanes, x, D)
    said = ("large motions grow without bound: kd kp > ki J does not hold",) * diverges
    hunts = diverges or any(c.stable for c in cycles)
    basin = _border(x, D, [*roots, *jumps]) if hunts else None
    cycles = tuple(sorted(cycles, key=lambda c: c.amplitude))
    curve = (x * loop.unit, D)
    return LimitCycles(cycles, basin and basin * loop.unit, None, diverges, {}, said, curve=curve)


def _turns(D: np.ndarray) -> np.ndarray:
    return (D[:-1] > 0.0) != (D[1:] > 0.0)


def _closer(lanes: Lanes, x: np.ndarray, D: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The grid with more points where D changes its sign, and about an extremum that comes so near
    to zero that it may cross it between two points."""
    D, about = D.copy(), np.flatnonzero(_turns(D))
    about = np.union1d(about, about + 1)
    if len(about):  # an interpolated end may have the wrong sign
        D[about] = excess(lanes.many(len(about)), x[about])
    for k in range(CUTS):
        size, one = np.abs(D), np.abs(np.diff(np.sign(D[:-1]))) + np.abs(np.diff(np.sign(D[1:])))
        wide = np.maximum(size[:-1], size[1:])
        cut = _turns(D) & (wide > CLOSE) & ((wide < NEVER) | (k < ENOUGH))
        drop = np.maximum(size[:-2], size[2:]) - size[1:-1]
        dips = (one == 0) & (size[1:-1] < size[:-2]) & (size[1:-1] <= size[2:])
        dips &= (size[1:-1] < drop) | ((k == 0) & (size[1:-1] < DIP))
        cut[:-1] |= dips
        cut[1:] |= dips
        if not cut.any():
            break
        new = np.linspace(np.log(x[:-1][cut]), np.log(x[1:][cut]), PARTS + 1)[1:-1].ravel()
        x, D = np.r_[x, np.exp(new)], np.r_[D, excess(lanes.many(len(new)), np.exp(new))]
        order = np.argsort(x)
        x, D = x[order], D[order]
    return x, D


def _roots(x: np.ndarray, D: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The roots of D, and where it jumps over zero."""
    at, place = np.flatnonzero(_turns(D)), np.log(x)
    Da, Db = D[at], D[at + 1]
    roots = np.exp(place[at] + (place[at + 1] - place[at]) * Da / (Da - Db))
    jumps = np.maximum(np.abs(Da), np.abs(Db)) > JUMP
    return roots[~jumps], roots[jumps]


def _described(loop: Loop, lanes: Lanes, x: np.ndarray) -> list[Cycle]:
    """The symmetric cycle of each root, two half turns, with its multiplier."""
    e = np.array([x * (1.0 - AWAY), x, x * (1.0 + AWAY)])
    made = half_turn(lanes.many(e.size), e.ravel())
    T, sticks, high, low, t, stops = (
        row.reshape(3, -1)
        for row in (made.x, made.fate == STICKS, made.high, made.low, made.t, made.stops)
    )
    first, last = np.where(sticks[0], 0, 1), np.where(sticks[2], 2, 1)  # beside a border one does
    k = np.arange(len(x))
    slope = (T[last, k] - T[first, k]) / np.maximum(e[last, k] - e[first, k], AWAY * x)
    size, period = np.maximum(high, low)[1] * loop.unit, 2.0 * t[1] / loop.wn
    return [
        Cycle(float(a), float(T), mu**2 < 1.0, (mu**2,), 2 * int(n))
        for a, T, mu, n, stays in zip(
            size, period, slope.tolist(), stops[1], sticks[1], strict=True
        )
        if stays
    ]


def _border(x: np.ndarray, D: np.ndarray, places: Sequence[float]) -> float | None:
    """The smallest error at which D becomes positive; 0 where it is from the first on."""
    up = np.flatnonzero(D > 0.0)
    if not len(up) or up[0] == 0:
        return 0.0 if len(up) else None
    low, high = x[up[0] - 1], x[up[0]]
    return next((float(r) for r in places if low <= r <= high), float(high))


def _persisting(loop: Loop, lanes: Lanes, x: np.ndarray, D: np.ndarray) -> list[Cycle]:
    """Hunting that repeats after more than two half turns, or never: T iterated from what its
    interpolation keeps."""
    at = kept(x, D)
    at = np.quantile(at, np.linspace(0.0, 1.0, STARTS)) if len(at) else at
    made = Turn.begun(at)
    for _ in range(AGAIN):
        made = half_turn(lanes.many(len(made.x)), made.x)
        stays = (made.fate == STICKS) & (made.x > LOW)
        if not stays.any():
            return []
        made = Turn(*(row[stays] for row in vars(made).values()))
    size = float(np.maximum(made.high, made.low).max())
    return [Cycle(size * loop.unit, float(2.0 * made.t.mean()) / loop.wn, True)]


def _swinging(loop: Loop, lanes: Lanes, x: np.ndarray) -> list[Cycle]:
    """Swings that never stick and do not grow: at each w = 0 the torque is above Fs. They are
    followed from some of the errors x from which no stick followed."""
    x = x[np.unique(np.linspace(0, len(x) - 1, min(SEEDS, len(x))).astype(int))]
    state, t = np.array([x, 0.0 * x]), 0.0 * x
    for _ in range(SWINGS if len(x) else 0):
        end = slip(lanes.many(len(t)), *state)
        state, t = np.array([-end.x, -2.0 - end.y]), end.t
        goes = ~end.rests & np.all(state > 0.0, axis=0) & (state[0] < lanes.large)
        state, t = state[:, goes], t[goes]
        if not len(t):
            break
    made: list[Cycle] = []
    for k in np.argsort(state[0]):
        size, period = float(state[0, k]) * loop.unit, 2.0 * float(t[k]) / loop.wn
        if not made or abs(size / made[-1].amplitude - 1.0) > ONE:
            made.append(Cycle(size, period, True, (), 0))
    return made


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
    own = e - 0.5 * (e.max() + e.min())
    far = np.abs(own) > 0.25 * own.max()  # a stop near the middle is no turn
    sign, at = np.sign(own[far]), np.flatnonzero(far)
    turned = at[1:][sign[1:] != sign[:-1]]
    parts = zip(turned[:-1], turned[1:], strict=True)
    return np.array([np.abs(own[a:b]).max() for a, b in parts]), t[turned]


def cycles_of(seen: Iterable[Seen]) -> tuple[Cycle, ...]:
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
        ends = where.format(*map(shown, (self.starts[0], self.starts[-1])))
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
TIMES, MOST = 40_000, 640_000  # of a run in continuous time, and of a longer one
LOAD = "theta_load"


def errors(loop: Loop) -> np.ndarray:
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
        delayed(sensing.delay, sensing.dt, inputs=["u"], outputs=["u_late"]),
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
    return (loop.kp * e - loop.curve.Fs) / loop.ki if loop.ki else 0.0


def _at_breakaway(loop: Loop, body: Any, e: float) -> list[float]:
    """The states of a plant that is about to slip from e > 0 towards zero: bristles are bent."""
    first = {"theta": e, "z": -loop.curve.Fs / body.params.get("plant.sigma0", np.inf)}
    return [first.get(label, 0.0) for label in body.state_labels]


def continuous_run(model: Model, loop: Loop, seconds: float, limit: float | None) -> Run:
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


NUDGE = 1e-4  # of a state, by which a slope is measured
NEWTON, REPEATS_TO = 15, 1e-6  # of Newton, and the relative distance of a half turn that repeats
RTOL = 1e-9  # of a half turn
SETTLES = 6  # half turns towards a cycle that attracts
LONGEST = 400.0  # times kp/ki: the longest half turn


class Bristles:
    """The loop around a law of w with bristles. At e = 0, w < 0 its state is x = (w, I, z, ...):
    speed, torque of the integral, and the friction's states. The half turn to the next e = 0, with
    all signs changed, is a map of x; its fixed points are the symmetric cycles, and the eigenvalues
    of its slope their multipliers of half a turn."""

    def __init__(self, model: Model, loop: Loop) -> None:
        self.loop, self.law = loop, model.friction.block
        self.values: dict[str, Any] = self.law.defaults() | dict(model.friction.values)
        self.bends = np.full(len(self.law.states), loop.curve.Fs / float(self.values["sigma0"]))
        self.scale = np.r_[loop.speed, loop.curve.Fs, self.bends]

    def rates(self, t: float, state: np.ndarray) -> np.ndarray:
        F, *dz = self.law(state[1], *state[3:], **self.values)
        de, dw, dq = self.loop.matrix @ state[:3]
        return np.array([de, dw - F / self.loop.J, dq, *dz])

    def crossing(self, state: np.ndarray) -> tuple[np.ndarray, float, float] | None:
        """From a state to x at the next e = 0, with the time and the largest error."""
        side = np.sign(state[0]) or np.sign(state[1])

        def crossed(t: float, s: np.ndarray) -> float:
            return s[0] + (side * 1e-9 * self.loop.unit if t == 0.0 else 0.0)

        crossed.terminal, crossed.direction = True, -side  # type: ignore[attr-defined]
        span = LONGEST * self.loop.kp / self.loop.ki
        atol = 1e-9 * np.r_[self.loop.unit, self.scale]
        options: Any = {"events": crossed, "rtol": RTOL, "atol": atol}
        done = solve_ivp(self.rates, (0.0, span), state, "LSODA", **options)
        if not len(done.t_events[0]):
            return None
        return done.y_events[0][0][1:], float(done.t_events[0][0]), float(np.abs(done.y[0]).max())

    def half(self, x: np.ndarray) -> tuple[np.ndarray, float, float] | None:
        made = self.crossing(np.r_[0.0, x]) if x[0] < 0.0 else None
        return None if made is None else (-made[0], *made[1:])

    def from_breakaway(self, e: float, turns: int) -> np.ndarray | None:
        """The state x so many half turns after the first crossing from breakaway at e > 0."""
        start = np.r_[e, 0.0, self.loop.kp * e - self.loop.curve.Fs, -self.bends]
        made = self.crossing(start)
        for _ in range(turns):
            made = None if made is None else self.half(made[0])
        return None if made is None else made[0]

    def cycle(self, x: np.ndarray) -> Cycle | None:
        """The cycle near x, by Newton."""
        for _ in range(NEWTON):
            steps = NUDGE * np.maximum(np.abs(x), 1e-3 * self.scale)
            made = [one for one in map(self.half, [x, *(x + np.diag(steps))]) if one is not None]
            if len(made) <= len(x):
                return None
            ends, (_, t, size) = np.array([end for end, *_ in made]), made[0]
            A, missed = (ends[1:] - ends[0]).T / steps, ends[0] - x
            if np.abs(missed / self.scale).max() < REPEATS_TO * abs(x[0]) / self.scale[0]:
                turn = np.linalg.eigvals(A) ** 2
                turn = turn[np.argsort(-np.abs(turn))]
                return Cycle(size, 2.0 * t, bool(abs(turn[0]) < 1.0), tuple(turn.real.tolist()))
            step = np.linalg.solve(A - np.eye(len(x)), -missed)
            x = x + step * min(1.0, 0.5 * abs(x[0]) / (abs(step[0]) + 1e-300))
        return None


def bristle_cycles(
    model: Model, loop: Loop, rigid: Iterable[Cycle], waited: tuple[Cycle, ...]
) -> tuple[Cycle, ...]:
    """Find the cycles that Newton reaches from those of the sliding curve, and from those found by
    waiting after some half turns; else the latter as they are."""
    law = model.friction.block
    bristles = bool(law.states) and law.reads == ("w",) and "sigma0" in model.friction.values
    if not (loop.ki and bristles) or model.effects:
        return waited
    own, found = Bristles(model, loop), list[Cycle]()
    for start, turns in [*((c, 0) for c in rigid), *((c, SETTLES) for c in waited)]:
        x = own.from_breakaway(start.amplitude, turns)
        reached = None if x is None else own.cycle(x)
        cycle = start if turns and reached is None else reached
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
ALONE = "with the sliding curve alone, without bristles, the loop would hunt: +-{:.3g}"
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
    that bound times the L1 norm of the linear loop from torque to error. Its extrema and sign
    changes are located, so that unstable cycles are found too. T is then iterated: a loop whose
    only cycles are unstable, and from which every motion comes to rest, rests. That is every
    symmetric cycle that sticks, of a drive without states but theta and w, in continuous time;
    those with unequal halves, and those that never stick, are found where they attract.

    Absence is proven for Coulomb and viscous friction if (kd + Fv) kp > ki J (Bisoffi, Da Lio,
    Teel and Zaccarian, Global Asymptotic Stability of a PID Control System With Coulomb Friction,
    IEEE Trans. Automatic Control 63(8), 2018). Friction with bristles, effects, sampling, a limit
    and loops of blocks are simulated from many starts, each for longer and longer until it rests,
    repeats or grows: what persists is a cycle, and nothing is proven. A swing rests, too, once it
    is below a tenth of the smallest start, or at the end of the budget where it still shrinks and
    is below starts that rest. The border is bisected to 5 %. With bristles, Newton on the state at
    e = 0 then gives multipliers, and unstable cycles where it reaches them from those of the
    sliding curve. Counts are shaken by a hundredth, so that a swing that locks to a place within
    one is no hunting; a swing that scatters may come to rest by chance, and is seen for 300 half
    turns or the whole budget.

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
    budget = Budget(monotonic() + end, reporter(progress))
    if hasattr(loop, "input_labels"):
        given = (kp, ki, kd, kv, rate, counts, limit, vary)
        if dead_time or any(v is not None for v in given):
            raise InputError(
                "a loop of blocks has its own gains, rate, dead time and limit: give none."
            )
        found = Search(loop_run(loop, HORIZON), STEPS, budget).answer(STEPPED)
        return replace(found, loop={"name": getattr(loop, "name", "")})
    model, gains = as_model(loop), varied(kp, ki, kd, kv)
    most = None if limit is None else positive(limit, "limit", "N m")
    sensing = _sensing(rate, dead_time, counts, model.motion)
    ends = None if vary is None else ranges(vary, "vary")
    found = _searched(model, gains(), sensing, most, budget)
    if ends is None:
        return found
    more = critical(
        lambda **x: _searched(model, gains(**x), sensing, most, budget).hunts, ends, "hunting"
    )
    none = tuple(NOT_GIVEN.format(name) for name in ends if not gains().get(name))
    said = (*more["messages"], *none, *found.messages)
    return replace(found, critical=more["critical"], messages=said)


def _sensing(rate: Any, dead_time: Any, counts: Any, motion: str) -> Sensing | None:
    late = number(dead_time, "dead_time")
    if late < 0.0:
        raise InputError(f"dead_time = {late:g} is negative.")
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
    budget: Budget,
) -> LimitCycles:
    loop, law = Loop.of(model, gains), model.friction.block
    dry, about = loop.curve.Fs > 0.0, {}
    found = rigid = rigid_cycles(loop) if dry else LimitCycles((), None, None, False, {})
    sizes, where = [c.amplitude for c in rigid.cycles], f"{FROM} {unit_for('rad', model.motion)}"
    if sensing is not None:
        starts = sampled_starts(loop, sensing, sizes)
        found = Search(sampled_run(model, loop, sensing, limit), starts, budget).answer(where)
        about = {"rate": 1.0 / sensing.dt, "dead_time": sensing.delay}
        about |= {"resolution": sensing.resolution}
    elif not dry or law.states or model.effects or limit is not None:
        seconds = max([PERIODS * c.period for c in rigid.cycles], default=0.0)
        seconds += (WAITS * loop.kp / loop.ki if loop.ki else 0.0) + WAITS / loop.wn
        run, starts = continuous_run(model, loop, seconds, limit), np.r_[sizes, errors(loop)]
        found = Search(run, starts, budget).answer(where)
        if limit is None:
            cycles = bristle_cycles(model, loop, rigid.cycles, found.cycles)
            found = replace(found, cycles=cycles)
        stable = [c.amplitude for c in rigid.cycles if c.stable]
        if rigid.diverges and limit is None:
            found = replace(found, diverges=True, messages=found.messages + rigid.messages)
        elif stable and not any(c.stable for c in found.cycles):
            found = replace(found, messages=(*found.messages, ALONE.format(max(stable))))
    if limit is not None:
        about = {"limit": limit, **about}
    about = {**gains, "J": loop.J, "law": law.name, "model": model.name, **about}
    said = (*_below(limit, loop), *found.messages, *_of_effects(model))
    return replace(found, loop=about, motion=model.motion, messages=said)


def _below(limit: float | None, loop: Loop) -> list[str]:
    Fs = loop.curve.Fs
    return [] if limit is None or limit > Fs else [BELOW.format(shown(Fs))]


def _of_effects(model: Model) -> list[str]:
    sensors = [p.key for p in model.effects if "sensor" in p.block.acts]
    inside = [p.key for p in model.effects if p.key not in sensors]
    parts = ((INCLUDED, inside), (LEFT_OUT, sensors))
    return [text.format(", ".join(keys)) for text, keys in parts if keys]
