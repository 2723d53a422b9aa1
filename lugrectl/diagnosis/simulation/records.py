"""Records as a simulation takes them: noise, training windows, and samples held out."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np

from ...blocks.effects import held_late
from ...blocks.model import Model
from ...core.errors import InputError, Refused
from ...core.option_names import option
from ...engine.runtime.backend import compiler
from ...record import Record, consistent, long_enough_to_judge
from ...record.signal_noise import repeating, repeats, sensor_noise, share_noise, smallest_step

BLOCK = 2.0  # s, least length of a held-out block
AS_FAST = 0.5  # of the top speed of held-out blocks: what the others must reach
WINDOWS = (1.0, 0.5, 0.25)  # s, possible lengths of a training window
FEWEST = 25  # samples of such a window, at least
SLIDES, MOVES = 0.01, 0.1  # of the largest speed; of such a window
ENOUGH, LEAST = 8, 4  # windows: the longest length that gives as many is used; fewer are refused
MOST = 100_000  # samples that are judged, and as many to train on, in evenly spread windows
GAP, LEAD = 0.25, 1.0  # s, between training and held-out samples; of an observer before a window
EXACT = 1e-11  # of a signal's range: noise of what has none
Range = tuple[int, int]
Parts = list[list[Range]]
Span = tuple[int, float, float]  # a run and two times in s


@dataclass(frozen=True, eq=False)
class Windows:
    """Stretches of a run, ``length`` samples from ``start`` (n,); an observer leads by ``lead``."""

    start: np.ndarray
    length: int
    lead: np.ndarray

    @property
    def size(self) -> int:
        return self.start.size * self.length

    @property
    def counted(self) -> np.ndarray:
        """Their samples, (n, length)."""
        return self.start[:, None] + np.arange(self.length)

    def at(self, which: np.ndarray) -> Windows:
        """Some of them."""
        return Windows(self.start[which], self.length, self.lead[which])


@dataclass(frozen=True, eq=False)
class Run:
    """One record on its own even time; SI units, N samples."""

    t: np.ndarray
    u: np.ndarray  # torque, held from sample to sample, as the load torque d (0: not recorded)
    d: np.ndarray
    recorded: np.ndarray  # (N, 2): theta and w, nan where not recorded ...
    own: tuple[float, ...]  # ... and their sensors' noise
    y: np.ndarray  # (N, 2): the same as an observer corrects by it ...
    noise: tuple[float, ...]  # ... with noise, larger where samples usually repeat each other
    dull: np.ndarray  # (N, 2): the part of a sample that repeats others for longer; it corrects ...
    counts: np.ndarray  # ... only beyond half of the smallest steps (2,)
    theta: np.ndarray  # position, or the integral of w from 0
    dt: float
    pieces: tuple[Range, ...]  # ranges without a lost sample

    @cached_property
    def speed(self) -> np.ndarray:
        """The speed as recorded, or that of the next 10 ms of positions, (N,)."""
        if np.isfinite(self.own[1]):
            return self.recorded[:, 1]
        n = min(self.count(0.01), len(self.t) - 1)
        rise = (self.theta[n:] - self.theta[:-n]) / (n * self.dt)
        return np.append(rise, np.full(n, rise[-1]))

    @cached_property
    def inputs(self) -> np.ndarray:
        """Torque and load torque, (N, 2)."""
        return np.column_stack([self.u, self.d])

    @cached_property
    def usual(self) -> float:
        """The usual size of dw/dt over 20 ms, rad/s2."""
        n = min(self.count(0.02), len(self.t) // 3)
        return max(float(np.std(self.speed[n:] - self.speed[:-n])) / (n * self.dt), 1e-12)

    def count(self, seconds: float, least: int = 1) -> int:
        """A time in samples."""
        return max(least, round(seconds / self.dt))

    @property
    def gap(self) -> int:
        return self.count(GAP, 2)

    def windows(
        self, ranges: Sequence[Range], length: int, of: Sequence[Range] | None = None
    ) -> Windows:
        """Those that fit into ranges one after the other, behind a gap in each; observers may run
        over samples of the ranges ``of``, of their own by default."""
        each = [np.arange(a + self.gap, b - length + 1, length) for a, b in ranges]
        start = np.concatenate([*each, np.zeros(0, int)])
        begins = np.array([a for a, _ in (ranges if of is None else of)] or [0])
        since = start - begins[np.searchsorted(begins, start, "right") - 1]
        return Windows(start, length, np.minimum(since, self.count(LEAD)))


@dataclass(frozen=True, eq=False)
class Prepared:
    """Records prepared for judging and polishing; windows and ranges are by run."""

    model: Model
    runs: tuple[Run, ...]  # the training ones, then one held out as a whole
    train: tuple[Windows, ...]  # to fit on
    test: tuple[Windows, ...]  # that are judged, a horizon long
    free: Sequence[Sequence[Range]]  # simulated without a restart ...
    in_sample: bool  # ... which hold training samples
    held_out: tuple[Span, ...]  # all that is set apart, whether judged or not
    horizon: float
    everywhere: tuple[Windows, ...]  # over all of a run
    channel: int  # of the errors, which more held-out samples have: 1 for w, 0 for theta
    noise_floor: float  # its own noise, the largest of all runs
    memory: dict[Any, Any] = field(default_factory=dict, repr=False)  # what was computed

    def along(
        self, windows: Sequence[Windows], of: list[int], signals: Callable[[Run, Windows], Any]
    ) -> np.ndarray:
        """Columns ``of`` signals (windows, samples, .) along all runs in turn, else nan, (., N)."""
        made = [np.full((len(run.t), len(of)), np.nan) for run in self.runs]
        for run, where, own in zip(self.runs, windows, made, strict=True):
            if where.start.size:
                own[where.counted] = signals(run, where)[..., of]
        return np.concatenate(made).T

    def as_it_acts(
        self, run_offsets: Mapping[int, float], u_delay: float = 0.0, above: float = 0.0
    ) -> Prepared:
        """The same with the torque as it acted: an offset (N m) of the column of a run, by its
        number, is taken off; ``u_delay`` (s) moves all later, earlier where below 0. A speed that
        was recorded alone is lowered by ``above`` (rad/s)."""
        turn, low, runs = 1 if u_delay >= 0 else -1, np.array([0.0, above]), []
        for i, run in enumerate(self.runs):
            u, theta = run.u - run_offsets.get(i, 0.0), run.theta - above * (run.t - run.t[0])
            for a, b in run.pieces if u_delay else ():  # earlier is later in reversed time
                u[a:b] = held_late(u[a:b][::turn], run.dt, abs(u_delay))[::turn]
            runs.append(replace(run, u=u, recorded=run.recorded - low, y=run.y - low, theta=theta))
        return replace(self, runs=tuple(runs), memory={})


def prepared(
    records: Sequence[Record],
    model: Model,
    holdout: str | Record | None,
    horizon: float,
    memory: float = 0.0,
) -> Prepared:
    """Split records, whose rates and channels may differ, into training and held-out windows:
    ``holdout`` None sets every other block apart, "last" the last half of the recorded time, a
    Record itself. Blocks are longer than ``horizon`` and ``memory`` (s), over which the residual
    depends on itself. Refused where records are too short or too slow for both parts."""
    apart = [holdout] if isinstance(holdout, Record) else []
    every = [consistent(r) for r in (*records, *apart)]
    if len({r.motion for r in every}) > 1:
        raise InputError("rotary and linear records do not go together: give runs of one drive.")
    long_enough_to_judge(max(every, key=lambda r: r.duration))
    runs, whole = tuple(map(run_of, every)), bool(apart) or holdout == "last"
    if whole:
        seconds = sum(len(run.t) * run.dt for run in runs[: len(records)])
        train, test = _cut(runs, seconds if apart else 0.5 * seconds)
    else:
        train, test = _alternate(runs, horizon, memory)
    fitting = _training(runs, train)
    both = [*zip(runs, test, strict=True)]
    judging = [run.windows(own, run.count(horizon), run.pieces) for run, own in both]
    if sum(w.start.size for w in fitting) < LEAST or not any(w.start.size for w in judging):
        raise _too_short(horizon)
    kept = spread(judging, MOST)
    ends = [(i, a + run.gap, b - 1) for i, (run, own) in enumerate(both) for a, b in own]
    held_out = tuple((i, *runs[i].t[[a, b]].tolist()) for i, a, b in ends if a < b)
    known = np.array([run.own for run in runs])
    theta, w = [one.size for one in kept] @ np.isfinite(known)
    channel = int(w >= theta)
    everywhere = spread([run.windows(run.pieces, run.count(1.0)) for run in runs], MOST)
    free = test if whole else [run.pieces for run in runs]
    return Prepared(
        model, runs, spread(fitting, MOST), kept, free, not whole, held_out, horizon, everywhere,
        channel, float(np.nanmax(known[:, channel])),
    )  # fmt: skip


def spread(windows: Sequence[Windows], most: int) -> tuple[Windows, ...]:
    """As many windows of all runs as have so many samples, evenly spread, at least one of each."""
    share, made = most / max(sum(w.size for w in windows), 1), []
    for w in windows:
        kept = min(w.start.size, max(1, round(share * w.start.size)))
        made.append(w.at(np.linspace(0, w.start.size - 1, kept).round().astype(int)))
    return tuple(made)


def _cut(runs: Sequence[Run], left: float) -> tuple[Parts, Parts]:
    """What is recorded in so many seconds, and after them, by run."""
    parts: tuple[Parts, Parts] = [], []
    for run in runs:
        cut = int(np.clip(round(left / run.dt), 0, len(run.t)))
        left -= len(run.t) * run.dt
        parts[0].append([(a, min(b, cut)) for a, b in run.pieces if a < cut])
        parts[1].append([(max(a, cut), b) for a, b in run.pieces if b > cut])
    return parts


def _alternate(runs: Sequence[Run], horizon: float, memory: float) -> tuple[Parts, Parts]:
    """Alternating blocks of whole horizons behind a gap; the faster ones are to fit."""
    parts: tuple[Parts, Parts] = [[] for _ in runs], [[] for _ in runs]
    turn = 0
    for i, run in enumerate(runs):
        span = run.count(horizon)
        length = run.gap + span * max(1, -(-run.count(max(BLOCK, memory)) // span))
        for a, b in (ends for ends in run.pieces if ends[1] - ends[0] >= run.gap + span):
            for ends in pairwise([*range(a, max(b - length, a) + 1, length), b]):
                parts[turn][i].append(ends)
                turn = 1 - turn
    slow, fast = (max((np.abs(run.speed[a:b]).max() for run, own in zip(runs, part, strict=True)
                       for a, b in own), default=0.0) for part in parts)  # fmt: skip
    return parts if slow > AS_FAST * fast else (parts[1], parts[0])


def _training(runs: Sequence[Run], parts: Parts) -> list[Windows]:
    """Windows in motion, the longest that are enough: a rest says nothing of what moves it. Without
    a compiler short ones, as each step is slow and all windows take it at once."""
    made: list[Windows] = []
    for seconds in WINDOWS if compiler() else WINDOWS[-1:]:
        both = zip(runs, parts, strict=True)
        made = [run.windows(part, run.count(seconds, FEWEST)) for run, part in both]
        slide = [np.abs(run.speed) > SLIDES * np.abs(run.speed).max() for run in runs]
        moved = [x[w.counted].mean(axis=1) > MOVES for x, w in zip(slide, made, strict=True)]
        made = [w.at(m) if m.any() else w for w, m in zip(made, moved, strict=True)]
        if sum(w.start.size for w in made) >= ENOUGH:
            break
    return made


def _too_short(horizon: float) -> Refused:
    needed, rate = 2 * (max(BLOCK, horizon) + GAP), FEWEST / min(WINDOWS)
    shorter = f", shorten {option('horizon')}" if horizon > BLOCK else ""
    return Refused(
        "The records are too short, or lose too many samples, to fit the model and to check it on "
        "held-out samples.",
        f"Record at least {needed:.3g} s of motion without loss at {rate:.0f} Hz or more{shorter}, "
        f"or give a second run with {option('holdout')}.",
    )


def run_of(record: Record) -> Run:
    """The record with its sensors' noise; a w that repeats theta corrects no observer: its noise
    is that of theta, coloured by a filter, and would look like a torque."""
    recorded, dt = np.full((record.samples, 2), np.nan), record.dt
    dull, own, often, counts = np.zeros_like(recorded), np.full(2, np.nan), np.ones(2), np.zeros(2)
    for k, (role, x) in enumerate((("theta", record.theta), ("w", record.w))):
        if x is not None:
            recorded[:, k], step = x, record.resolution.get(role, 0.0)
            own[k] = max(sensor_noise(x, step), EXACT * np.ptp(x))
            often[k] = repeating(x, step)
            counts[k] = max(step, smallest_step(x))
            dull[:, k] = np.maximum(0.0, 1.0 - often[k] / repeats(x, counts[k]))
    pieces = tuple((s.start, s.stop) for s in record.segments())
    a, b = max(pieces, key=lambda ends: ends[1] - ends[0])
    repeated = bool(np.isfinite(own).all()) and share_noise(*recorded[a:b].T)
    left = np.array([1.0, np.nan if repeated else 1.0])
    noise = tuple((own * np.sqrt(often) * left).tolist())
    theta = np.cumsum(recorded[:, 1]) * dt if record.theta is None else record.theta
    d = np.zeros(record.samples) if record.d is None else record.d
    measured = recorded, tuple(own.tolist()), recorded * left, noise, dull, counts, theta
    return Run(record.t, record.u, d, *measured, dt, pieces)
