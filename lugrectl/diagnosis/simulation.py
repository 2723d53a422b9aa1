"""Errors by simulation: records split into training and held-out samples, a model along them, its
errors, and a last polish of its values.

The innovations of the right model are white, whether or not the drive was in closed loop
(prediction-error method, Ljung, System Identification, ch. 7).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache, partial
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.linalg import expm
from scipy.optimize import least_squares

from ..blocks.block import unit_for
from ..blocks.effects import held_late
from ..blocks.model import Model
from ..blocks.plant import Part as Placed
from ..blocks.plant import assemble
from ..core.deadline import check as check_time
from ..core.errors import InputError, Refused
from ..core.numeric import rms
from ..core.regression import TINY
from ..engine.backend import compiler
from ..engine.batch_run import Lanes
from ..estimates.findings import Joint, Residuals, Traces, residuals_of
from ..record import Record, consistent, long_enough_to_judge
from ..record.signal_noise import repeating, repeats, sensor_noise, share_noise, smallest_step
from ..torque_balance.constants import SLIGHT, STANDS
from ..torque_balance.maps import is_map
from ..torque_balance.values import (
    ModelValues,
    as_estimates,
    completed,
    lifted,
    told_by_balance,
    with_scale,
)
from ..torque_balance.verdict import Answer
from .asked import Asked

# ---- records as a simulation takes them: noise, training windows, and samples held out


BLOCK = 2.0  # s, least length of a held-out block
AS_FAST = 0.5  # of the top speed of held-out blocks: what the others must reach
WINDOWS = (0.25, 1.0)  # s, least and largest length of a training window
FEWEST = 25  # samples of such a window, at least
MOVES = 0.1  # of a window: what must be in motion
ENOUGH, LEAST = 10, 4  # windows: so many of all that is recorded; fewer are refused
MOST, SAMPLES = 100_000, 20_000  # that are judged, and by which a fit is found, evenly spread
GAP, LEAD = 0.25, 1.0  # s, between training and held-out samples; of an observer before a window
EXACT = 1e-11  # of a signal's range: noise of what has none
TOO_SHORT = "The records are too short, or lose too many samples, to fit the model and to judge it."
LONGER = "Record at least {:.3g} s of motion without loss at {:.0f} Hz or more, or hold out a run."
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
        return self.start[:, None] + np.arange(self.length)

    def at(self, which: Any) -> Windows:
        return Windows(self.start[which], self.length, self.lead[which])


NOWHERE = Windows(np.zeros(0, int), 1, np.zeros(0, int))


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
    train: Windows = NOWHERE  # to fit on
    test: Windows = NOWHERE  # that are judged, a horizon long
    everywhere: Windows = NOWHERE  # over all of it
    free: Sequence[Range] = ()  # simulated without a restart

    @cached_property
    def speed(self) -> np.ndarray:
        """The speed as recorded, or that of the next 10 ms of positions, (N,)."""
        if np.isfinite(self.own[1]):
            return self.recorded[:, 1]
        n = min(self.count(0.01), len(self.t) - 1)
        rise = (self.theta[n:] - self.theta[:-n]) / (n * self.dt)
        return np.append(rise, np.full(n, rise[-1]))

    @property
    def moves(self) -> np.ndarray:
        """Where it moves, (N,)."""
        return np.abs(self.speed) > STANDS * np.abs(self.speed).max()

    @cached_property
    def usual(self) -> float:
        """The usual size of dw/dt over 20 ms, rad/s2."""
        n = min(self.count(0.02), len(self.t) // 3)
        return max(float(np.std(self.speed[n:] - self.speed[:-n])) / (n * self.dt), 1e-12)

    def count(self, seconds: float, least: int = 1) -> int:
        return max(least, round(seconds / self.dt))

    @property
    def gap(self) -> int:
        return self.count(GAP, 2)

    def windows(
        self, ranges: Sequence[Range], length: int, of: Sequence[Range] | None = None
    ) -> Windows:
        """One after the other in each range, behind a gap; observers lead in the ranges ``of``."""
        each = [np.arange(a + self.gap, b - length + 1, length) for a, b in ranges]
        start = np.concatenate([*each, np.zeros(0, int)])
        begins = np.array([a for a, _ in (ranges if of is None else of)] or [0])
        since = start - begins[np.searchsorted(begins, start, "right") - 1]
        return Windows(start, length, np.minimum(since, self.count(LEAD)))


@dataclass(frozen=True, eq=False)
class Prepared:
    """Records prepared for judging and polishing."""

    model: Model
    runs: tuple[Run, ...]  # the training ones, then one held out as a whole
    in_sample: bool  # what is simulated without a restart holds training samples
    held_out: tuple[Span, ...]  # all that is set apart, whether judged or not
    horizon: float
    channel: int  # of the errors, which more held-out samples have: 1 for w, 0 for theta
    noise_floor: float  # its own noise, the largest of all runs
    memory: dict[Any, Any] = field(default_factory=dict, repr=False)  # what was computed

    def along(
        self, where: str, of: list[int], signals: Callable[[Run, Windows], Any]
    ) -> np.ndarray:
        """Columns ``of`` signals (windows, samples, .) along all runs in turn, else nan, (., N)."""
        made = [np.full((len(run.t), len(of)), np.nan) for run in self.runs]
        for run, own in zip(self.runs, made, strict=True):
            windows: Windows = getattr(run, where)
            if windows.start.size:
                own[windows.counted] = signals(run, windows)[..., of]
        return np.concatenate(made).T


def prepared(
    records: Sequence[Record],
    model: Model,
    holdout: str | Record | None,
    horizon: float,
    memory: float = 0.0,
) -> Prepared:
    """Records split into training and held-out windows: every other block, longer than ``horizon``
    and ``memory`` (s), the last half, or a Record. Refused where they are too short for both."""
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
    both = [*zip(runs, test, strict=True)]
    fitting, everywhere = _training(runs, train), [r.windows(r.pieces, r.count(1.0)) for r in runs]
    judging = [run.windows(own, run.count(horizon), run.pieces) for run, own in both]
    if sum(w.start.size for w in fitting) < LEAST or not any(w.start.size for w in judging):
        needed, rate = 2 * (max(BLOCK, horizon) + GAP), FEWEST / WINDOWS[0]
        raise Refused(TOO_SHORT, LONGER.format(needed, rate))
    ends = [(i, a + run.gap, b - 1) for i, (run, own) in enumerate(both) for a, b in own]
    held_out = tuple((i, *runs[i].t[[a, b]].tolist()) for i, a, b in ends if a < b)
    kept = spread(fitting, SAMPLES), spread(judging, MOST), spread(everywhere, MOST)
    free = test if whole else [run.pieces for run in runs]
    parts = zip(runs, *kept, free, strict=True)
    runs = tuple(replace(run, train=a, test=b, everywhere=c, free=d) for run, a, b, c, d in parts)
    known = np.array([run.own for run in runs])
    theta, w = [run.test.size for run in runs] @ np.isfinite(known)
    channel = int(w >= theta)
    own = not whole, held_out, horizon, channel, float(np.nanmax(known[:, channel]))
    return Prepared(model, runs, *own)


def spread(windows: Sequence[Windows], most: int) -> tuple[Windows, ...]:
    """Every so many windows of each run, so that they have so many samples at most."""
    every = max(1, -(-sum(w.size for w in windows) // most))
    return tuple(w.at(slice(None, None, every)) for w in windows)


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
    """Windows in motion; short ones where no compiler speeds up steps, as all take each at once."""
    moved = [r.moves * 1.0 for r in runs]
    total = sum((b - a) * r.dt for r, part in zip(runs, parts, strict=True) for a, b in part)
    seconds = float(np.clip(total / ENOUGH, *WINDOWS)) if compiler() else WINDOWS[0]
    made = []
    for run, part, slides in zip(runs, parts, moved, strict=True):
        every = run.windows(part, run.count(seconds, FEWEST))
        some = slides[every.counted].mean(axis=1) > MOVES
        made.append(every.at(some) if some.any() else every)
    return made


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


# ---- a model along a record: observed, simulated from the torque alone, and how likely it is


Values = Mapping[str, float]
Sets = Sequence[Values]
Array = np.ndarray
STEP = 2e-3  # s, longest integration step; the engine divides it where necessary
RESTING = 0.1  # of the largest speed: scale of the step errors of a drive at rest
DOUBLINGS, SMALL = 45, 1e-6  # of a Riccati equation; of what a jump moves in a sample
COARSE = np.linspace(-10.5, 3.0, 10)  # natural logarithms of factors on the usual dw/dt ...
FINE = np.array([-1.0, -0.5, 0.5, 1.0])  # ... and around the best of these
WORST = 1e30  # innovation of a model that diverges; its square can still be added up


class Drive:
    """One model structure, traced once, for any values; a delay acts on the recorded torque."""

    def __init__(self, model: Model) -> None:
        self.late = tuple(p for p in model.effects if p.block.exact is held_late)
        inside = tuple(p for p in model.effects if p not in self.late)
        self.system = assemble(replace(model, effects=inside), sensed=True).bare()
        self.lanes = Lanes(self.system, outputs=["theta_m", "w_m"])
        self.keys = [name.split(".", 1)[1] for name in self.lanes.parameters]
        place = self.lanes.states.index
        own = [(p.block, Placed(f"{p.key}.", p.block).states) for p in inside]
        begun = [both for one, names in own for both in zip(names, one.start, strict=True)]
        known = {"theta": "theta", "w": "speed", "u": "u"}  # other states begin at 0
        self.starts = {0: "theta", 1: "speed"}
        self.starts |= {place(k): known[s] for k, s in begun if s in known}
        self.sensors = [place(k) for one, names in own if "sensor" in one.acts for k in names]
        self.rests = "eps" in model.friction.block.parameters

    def series(self, run: Run, values: Values) -> np.ndarray:
        """Torque and load torque along a run, (N, 2), N m."""
        series = np.column_stack([run.u, run.d])
        delay = sum(values[f"{part.key}.{k}"] for part in self.late for k in part.block.own)
        for a, b in run.pieces if self.late else ():
            series[a:b, 0] = held_late(run.u[a:b], run.dt, delay)
        return series

    def gain(self, run: Run, values: Values, jump: float) -> tuple[np.ndarray, np.ndarray]:
        """Kalman gain (x, 2), of theta, w and the sensors' states, and innovation covariance."""
        sensing = self._sensing(values) if self.sensors else ((1.0, 0.0), (0.0, 1.0))
        K, S = observer_gain(run.dt, jump, run.noise, sensing)
        gain = np.zeros((len(self.lanes.states), 2))
        gain[[0, 1, *self.sensors]] = K
        return gain, S

    def _gains(self, run: Run, sets: Sets, jumps: Any, least: float = 0.0) -> Array:
        both = zip(sets, jumps, strict=True)
        return np.array([self.gain(run, v, max(jump, least))[0] for v, jump in both])

    def _sensing(self, values: Values) -> Any:
        """Rates of the sensors' states, theta_m and w_m over theta, w and these states, at rest."""
        params = {name: values[k] for name, k in zip(self.lanes.parameters, self.keys, strict=True)}
        rows = [self.system.output_labels.index(name) for name in self.lanes.outputs]
        u, columns = np.zeros(self.system.ninputs), []
        for x in np.eye(len(self.lanes.states))[[0, 1, *self.sensors]]:
            rates = self.system.updfcn(0.0, x, u, params)[self.sensors]
            columns.append(np.append(rates, self.system.outfcn(0.0, x, u, params)[rows]))
        return tuple(map(tuple, np.array(columns, float).T.tolist()))

    def observe(self, run: Run, sets: Sets, jumps: Any, where: Windows) -> tuple[Array, Array]:
        """One-step predictions of theta and w (S, n, length, 2) for S sets of values, each with its
        noise of dw/dt, in n windows, and the last states (S, n, x). In the first half of a lead the
        observer stays close to the measured motion."""
        gains, close = self._gains(run, sets, jumps), self._gains(run, sets, jumps, run.usual)
        y = np.empty((len(sets), len(where.start), where.length, 2))
        x = np.zeros((len(sets), len(where.start), len(self.lanes.states)))
        for lead in set(where.lead.tolist()):
            some = where.lead == lead
            start, half = where.start[some] - lead, lead // 2
            for i, signal in self.starts.items():
                x[:, some, i] = getattr(run, signal)[start]
            _, x0 = self._run(run, sets, x[:, some], start, half, close)
            rest = lead - half + where.length
            own, x[:, some] = self._run(run, sets, x0, start + half, rest, gains)
            y[:, some] = own[:, :, lead - half :]
        return y, x

    def simulate(self, values: Values, jump: float, run: Run, where: Windows) -> np.ndarray:
        """theta and w of each window from the torque alone, begun from an observer's state."""
        x = self.observe(run, [values], [jump], replace(where, length=0))[1]
        return self._run(run, [values], x, where.start, where.length, None)[0][0]

    def _run(self, run: Run, sets: Sets, x0: Array, start: Array, length: int, gains: Any) -> Any:
        check_time()
        many, n, start = len(sets), len(start), np.tile(start, len(sets))
        u = np.array([self.series(run, v) for v in (sets if self.late else sets[:1])])
        floor = np.zeros(len(self.lanes.states))  # at rest the speed sets no scale of step errors
        floor[1] = RESTING * np.abs(run.speed).max() if self.rests else 0.0
        y, x = self.lanes.run(
            x0.reshape(many * n, -1), start, length, u,
            np.repeat([[v[k] for k in self.keys] for v in sets], n, axis=0), dt=run.dt,
            substeps=max(1, int(np.ceil(run.dt / STEP - 1e-9))), t0=run.t[start] - start * run.dt,
            series=np.repeat(np.arange(many) * bool(self.late), n), floor=floor,
            y=None if gains is None else run.y, rounding=(run.dull, 0.5 * run.counts),
            gain=None if gains is None else np.repeat(gains, n, axis=0),
        )  # fmt: skip
        return y.reshape(many, n, length, 2), x.reshape(many, n, -1)


@dataclass(frozen=True, eq=False)
class Fit:
    """A model with the noise of dw/dt (rad/s2) that makes its predictions most likely."""

    drive: Drive
    values: dict[str, float]
    jump: float

    def observed(self, jump: float, run: Run, where: Windows) -> np.ndarray:
        """Torque missing (N m, resisting), theta, w of an observer, (windows, length, 3)."""
        y = self.drive.observe(run, [self.values], [jump], where)[0][0]
        K = self.drive.gain(run, self.values, jump)[0][1]
        missing = -self.values["J"] / run.dt * innovations(run.y[where.counted], y) @ K
        return np.concatenate([missing[..., None], y], axis=-1)


def fitted(ready: Prepared, model: Model) -> Fit:
    """The model with its noise, once for each in a study. InputError where a value is missing."""
    model, memory = model.with_defaults(), ready.memory
    values = model.known()
    if missing := [k for k in model.values() if k not in values]:
        raise InputError(f"{model.name}: {', '.join(missing)} has no value to simulate with.")
    parts = tuple((p.key, p.block.name) for p in (model.friction, *model.effects))
    if parts not in memory:
        memory[parts] = Drive(model)
    key = parts, *values.values()
    if key not in memory:
        memory[key] = Fit(memory[parts], values, tuned(ready, memory[parts], values))
    return memory[key]


def tuned(ready: Prepared, drive: Drive, values: Values) -> float:
    usual = max(run.usual for run in ready.runs)

    def totals(logs: np.ndarray) -> np.ndarray:
        made = loglik(ready, drive, [values] * len(logs), usual * np.exp(logs))
        return np.maximum(np.nan_to_num(made.sum(axis=1), nan=-np.inf), -(WORST**3))

    best = COARSE[np.argmax(totals(COARSE))]
    a, b, _ = np.polyfit(FINE, totals(best + FINE), 2)
    peak = np.clip(-0.5 * b / a, FINE[0], FINE[-1]) if a < 0 else 0.0
    return usual * float(np.exp(best + peak))


def loglik(ready: Prepared, drive: Drive, sets: Sets, jumps: Any, of: str = "train") -> Array:
    """The log-likelihood of each window, (sets, windows)."""
    both = [(run, getattr(run, of)) for run in ready.runs]
    made = [whitened(drive, *b, sets, jumps)[1] for b in both if b[1].size]
    return np.concatenate(made, axis=1)


def whitened(
    drive: Drive, run: Run, where: Windows, sets: Sets, jumps: Any
) -> tuple[np.ndarray, np.ndarray]:
    """Innovations of unit covariance (sets, windows, length, 2), and the log-likelihood of each
    window (sets, windows); samples that repeat one count weigh less."""
    y, _ = drive.observe(run, sets, jumps, where)
    e, size = innovations(run.y[where.counted], y), np.empty((len(sets), 2))
    weight = 1.0 - run.dull[where.counted]
    for i, (values, jump) in enumerate(zip(sets, jumps, strict=True)):
        root = np.linalg.cholesky(drive.gain(run, values, jump)[1])
        e[i] = e[i] @ np.linalg.inv(root).T * np.sqrt(weight)
        size[i] = np.diag(root)
    constant = np.log(size) @ weight.sum(axis=1).T
    return e, -0.5 * np.einsum("swnc,swnc->sw", e, e) - constant


def innovations(measured: np.ndarray, predicted: np.ndarray) -> np.ndarray:
    """Measured minus predicted: 0 where nothing was recorded, ``WORST`` if it is not a number."""
    e = np.clip(np.nan_to_num(measured - predicted, nan=WORST), -WORST, WORST)
    e[..., np.isnan(measured)] = 0.0
    return e


@lru_cache(maxsize=512)
def observer_gain(
    dt: float, jump: float, noise: tuple[float, ...], sensing: Any
) -> tuple[Array, Array]:
    """Kalman gain (n, 2) and innovation covariance (2, 2) of dtheta/dt = w, dw/dt = white noise of
    size ``jump``, and sensors; 0 and 1 where ``noise`` is nan, as nothing was recorded."""
    n, seen = len(sensing), np.flatnonzero(np.isfinite(noise))
    flow = np.zeros((n + 1, n + 1))  # the last state is the jump of dw/dt
    flow[0, 1] = flow[1, n] = 1.0
    flow[2:n, :n] = np.reshape(sensing[: n - 2], (n - 2, n))
    step, H = expm(flow * dt), np.array(sensing[n - 2 :])[seen]
    size = np.maximum(noise, SMALL * jump * step[:2, n])[seen]  # less noise is none
    kept = np.arange(0 if 0 in seen else 1, n)  # theta is unobservable if not recorded
    scale = np.full(n, size[0] / dt if 0 in seen else size[0])  # else it is ill-conditioned
    scale[0] *= dt
    a, push = step[:n, :n] * scale / scale[:, None], jump * step[:n, n] / scale
    P, both = np.zeros((n, n)), (kept[:, None], kept)
    P[both] = _riccati(a[both], (H * scale / size[:, None])[:, kept], np.outer(push, push)[both])
    P *= np.outer(scale, scale)
    S = H @ P @ H.T + np.diag(size**2)
    gain, covariance = np.zeros((n, 2)), np.eye(2)
    gain[:, seen], covariance[seen[:, None], seen] = P @ H.T @ np.linalg.inv(S), S
    return gain, covariance


def _riccati(A: Array, H: Array, Q: Array) -> Array:
    """P = A (P^-1 + H' H)^-1 A' + Q by the doubling of Chu, Fan and Lin (2004): scipy's solver
    finds none where an observer hardly corrects, or all but copies what is measured."""
    a: Any = A.T  # types of a loop's own values take the checker minutes
    G: Any = H.T @ H
    P: Any = Q
    for _ in range(DOUBLINGS):
        half = np.linalg.solve(np.eye(len(A)) + G @ P, np.hstack([a, G]))
        b, G_half = half[:, : len(A)], half[:, len(A) :]
        a, G, P = a @ b, G + a @ G_half @ a.T, P + a.T @ P @ b
    return 0.5 * (P + P.T)


# ---- errors on held-out samples, and what one-step predictions leave


DIVERGES = "The {} model diverges in simulation, so it has no {}."
DIVERGED = 1e15  # of an error


@dataclass(frozen=True, eq=False)
class Judged:
    """Errors of models on samples that nothing has seen, as in the JSON document: None where a
    value is missing or a simulation diverged, as ``messages`` say."""

    error: dict[str, Any]
    free_error: dict[str, Any]
    torque_error: dict[str, Any]
    traces: Traces
    messages: tuple[str, ...]


def errors(ready: Prepared, models: Mapping[str, Model | None]) -> Judged:
    """Simulate "declared" (None: values are missing), "refitted" and "augmented" from the recorded
    torque alone, restarted from an observer that has seen samples before only. The residual torque
    is what the observer of "refitted" adds to each model."""
    fits = {name: fitted(ready, model) for name, model in models.items() if model is not None}
    jump, channel = fits.get("refitted", [*fits.values()][-1]).jump, ready.channel
    measured = np.concatenate([run.recorded[:, channel] for run in ready.runs])
    free_run = {k: partial(f.drive.simulate, f.values, f.jump) for k, f in fits.items()}
    simulated = {k: ready.along("test", [channel], run)[0] for k, run in free_run.items()}
    observed = {k: partial(f.observed, jump) for k, f in fits.items()}
    missing = {k: ready.along("test", [0], one)[0] for k, one in observed.items()}
    residual = {k: ready.along("everywhere", [0], one)[0] for k, one in observed.items()}
    theta, w = ready.along("everywhere", [1, 2], [*observed.values()][-1])
    at = ready.along("test", [0], lambda _, where: where.counted[..., None])[0]
    held_out = np.isfinite(at + measured)
    said: list[str] = []

    def each(what: str, of: Callable[[str], float]) -> dict[str, float | None]:
        made = {k: of(k) for k in fits}
        finite = {k: x for k, x in made.items() if x < DIVERGED}
        said.extend(DIVERGES.format(k, what) for k in made if k not in finite)
        return {k: finite.get(k) for k in models}

    error = each("error", lambda k: rms((measured - simulated[k])[held_out]))
    free = each("error without restarts", lambda k: _free(ready, free_run[k]))
    torque = each("torque error", lambda k: rms(missing[k][held_out]))
    size = max(float(np.std(measured[held_out])), TINY)
    fit = {k: None if e is None else 100.0 * (1.0 - e / size) for k, e in error.items()}
    motion = ready.model.motion
    signal, unit = (("theta", "rad"), ("w", "rad/s"))[channel]
    of = {"signal": signal, "unit": unit_for(unit, motion)}
    counts = {"samples": int(held_out.sum()), "horizon": ready.horizon}
    t, u, dt = np.concatenate([(run.t, run.u, run.dt + 0.0 * run.t) for run in ready.runs], axis=1)
    signals = {"t": t, "theta": theta, "w": w, "u": u, "a": np.diff(w, append=np.nan) / dt}
    return Judged(
        {**of, **counts, **error, "noise_floor": ready.noise_floor, "fit": fit},
        {**of, "in_sample": ready.in_sample, **free},
        {"unit": unit_for("N m", motion), **torque},
        Traces(t, measured, held_out, simulated, residual, signals),
        tuple(said),
    )


def _free(ready: Prepared, simulate: Callable[[Run, Windows], np.ndarray]) -> float:
    missed = [np.zeros((0, 2))]
    for run in ready.runs:
        for a, b in run.free if np.isfinite(run.own[ready.channel]) else ():
            if b - a > run.gap:
                where = run.windows([(a, b)], b - a - run.gap, run.pieces)
                missed.append((run.recorded[where.counted] - simulate(run, where))[0])
    return rms(np.concatenate(missed)[:, ready.channel])


def residuals(ready: Prepared, model: Model) -> Residuals:
    """The tests of one-step predictions, over the training windows of the run with most of them."""
    fit, run = fitted(ready, model), max(ready.runs, key=lambda run: run.train.size)
    channel = int(np.isfinite(run.noise[1]))
    e = whitened(fit.drive, run, run.train, [fit.values], [fit.jump])[0][0, ..., channel]
    return residuals_of(("theta", "w")[channel], e, run.u[run.train.counted])


def torque_noise(ready: Prepared, model: Model) -> float:
    fit = fitted(ready, model)
    return fit.jump * fit.values["J"]


# ---- a last polish, by one-step predictions, of values that a torque balance hardly sees


WEAK = 1.5  # standard deviation of a coordinate about its start where nothing else is known
WIDE = 0.3  # the same from which a start is no more than a guess: factors on it are tried
FACTORS = (1.0, 0.03, 0.1, 0.3, 0.6, 1.7, 3.0, 10.0, 30.0)
ROUNDS, CLIMBS, GAINED = 2, 30, 1e-7  # fits, each at the noise before it; their evaluations
FLAT = 1e-4  # of Fc: the least that Fs is above it
FARTHEST = 0.7  # of a coordinate that a window moves


def _at_top(space: _Space, begun: Fit) -> tuple[Fit, Joint]:
    """The likeliest values, and those that are determined: their covariance is the larger of the
    likelihood's own and the jackknife's over windows."""
    tops = [space.up(one) for one in dict.fromkeys((begun, space.scanned()))]
    fit = max(tops, key=lambda one: space.totals([one.values], one.jump)[0])
    x = space.x(fit.values)
    A, e, at = space.slopes(x, fit.jump), space.off(x, fit.jump), space.starts()
    H, own = A.T @ A, np.linalg.inv(A.T @ A)
    windows = zip(*(np.split(part[: -len(x)], at[1:]) for part in (A, e)), strict=True)
    off = np.array([np.linalg.solve(H - a.T @ a, a.T @ b) for a, b in windows])  # each left out
    off *= np.minimum(1.0, FARTHEST / np.maximum(np.max(np.abs(off), axis=1), TINY))[:, None]
    scatter = (1.0 - 1.0 / len(off)) * np.sum(off**2, axis=0)
    wider = np.sqrt(np.maximum(scatter / np.diag(own), 1.0))
    C, prior = own * np.outer(wider, wider), np.diag(np.linalg.inv(space.weight))
    at = np.flatnonzero((np.diag(C) < 0.25 * prior) | (prior < WIDE**2))
    names, rates = tuple(space.keys[i] for i in at), space.rates(fit.values)
    if "Fs" in space.keys:  # what it is above Fc has a log-normal distribution, and its variance
        V = float(np.clip(C[-1, -1], 1e-12, 1.0))
        rates[-1, -1] *= np.sqrt(np.exp(V) * np.expm1(V) / V)
    found, matrix = np.array([fit.values[k] for k in names]), rates @ C @ rates.T
    return fit, Joint(names, found, matrix[at[:, None], at], space.log[at])


class _Space:
    """Coordinates of free values, the logarithm of each (of Fs that of Fs - Fc) or, where it may be
    0 or less, its part of ``size``; the innovations e of an observer with the gain for the noise of
    dw/dt, and a Gaussian prior (``middle``, ``weight``) by what is known beforehand, the std that
    the model states, or a factor of 4.5. Least are the sum of e' S^-1 e / 2 and the prior, at the
    noise of the values."""

    def __init__(
        self, ready: Prepared, begun: Fit, model: Model, free: Sequence[str], first: ModelValues
    ) -> None:
        start = first.joint
        own, values, rotary = model.declarations(), begun.values, model.motion == "rotary"
        self.ready, self.begun, self.model = ready, begun, model
        fixed = model.held() | {k for k, p in own.items() if p.choices or not p.fitted}
        fixed |= {k for k, p in own.items() if p.whole and rotary or p.unit == "s" and p.low < 0.0}
        keys = [k for k in free if k not in fixed and np.isfinite(values[k])]
        self.keys = keys = sorted(keys, key="Fs".__eq__)  # Fs last, as it stands on Fc
        found = np.array([values[k] for k in keys])
        self.log = (np.array([own[k].low for k in keys]) >= 0.0) & (found > 0.0)
        usual = [float(np.std(ready.runs[0].u)) if own[k].unit == "N m" else 0.1 for k in keys]
        self.size = np.maximum(np.abs(found), usual)
        std = {k: s.std for k, s in model.stated.items() if s.std and k in keys}
        known = np.diag([std.get(k, np.inf) ** -2.0 for k in keys])
        if before := [k for k in start.names if k in keys and k not in std]:
            here, at = [keys.index(k) for k in before], [start.names.index(k) for k in before]
            C = start.matrix[np.ix_(at, at)]
            size = np.maximum(np.diag(C), TINY) ** 0.5
            scaled = np.linalg.pinv(C / np.outer(size, size), hermitian=True)
            known[np.ix_(here, here)] = scaled / np.outer(size, size)
        rates = self.rates(values)
        self.weight = np.eye(len(keys)) / WEAK**2 + rates.T @ known @ rates
        self.root = np.linalg.cholesky(self.weight).T
        declared = {k: v for k, v in ready.model.known().items() if k in std}
        self.middle = self.x({**values, **declared})

    def amounts(self, values: Values) -> np.ndarray:
        """The values; of Fs how much it is above Fc."""
        Fc, Fs = values.get("Fc", 0.0), values.get("Fs", 0.0)
        return np.array([({**values, "Fs": max(Fs - Fc, FLAT * Fc)})[k] for k in self.keys])

    def rates(self, values: Values) -> np.ndarray:
        """Derivatives of the values by the coordinates, (n, n)."""
        made = np.diag(np.where(self.log, self.amounts(values), self.size))
        if {"Fc", "Fs"} <= {*self.keys}:
            made[-1, self.keys.index("Fc")] = values["Fc"]
        return made

    def x(self, values: Values) -> np.ndarray:
        v = self.amounts(values)
        return np.where(self.log, np.log(np.where(self.log, v, 1.0)), v / self.size)

    def values(self, x: np.ndarray) -> dict[str, float]:
        """All values inside their bounds; Fs does not fall below Fc."""
        v = np.where(self.log, np.exp(np.minimum(x, 700.0)), x * self.size)
        made = dict(self.begun.values)
        for k, value in zip(self.keys, v.tolist(), strict=True):
            low, high = self.model.bounds(k)
            above = made.get("Fc", 0.0) if k == "Fs" else 0.0
            made[k] = min(max(above + value, low), high)
        return made | {"Fs": max(made["Fs"], made["Fc"])} if {"Fc", "Fs"} <= made.keys() else made

    def totals(self, sets: Sets, jump: float) -> np.ndarray:
        off = np.array([self.x(values) for values in sets]) - self.middle
        each = loglik(self.ready, self.begun.drive, sets, [jump] * len(sets))
        made = each.sum(axis=1) - 0.5 * np.sum(off @ self.weight * off, axis=1)
        return np.nan_to_num(made, nan=-np.inf)

    def scanned(self) -> Fit:
        """The best of factors on each value that is no more than a guess, one after the other."""
        fit, std = self.begun, np.sqrt(np.diag(np.linalg.inv(self.weight)))
        for i in np.flatnonzero(self.log & (std > WIDE)):
            steps = np.log(FACTORS)[:, None] * (np.arange(len(std)) == i)
            sets = [self.values(self.x(fit.values) + step) for step in steps]
            best = int(np.argmax(self.totals(sets, fit.jump)))
            fit = replace(fit, values=sets[best]) if best else fit
        return fit if fit is self.begun else self._at(fit.values)

    def _at(self, values: dict[str, float]) -> Fit:
        return fitted(self.ready, self.model.with_values(values))

    def up(self, fit: Fit) -> Fit:
        """The likeliest values from these on."""
        for _ in range(ROUNDS):
            of: Any = {"jac": self.slopes, "ftol": GAINED, "max_nfev": CLIMBS}
            found = least_squares(self.off, self.x(fit.values), args=(fit.jump,), **of)
            fit = self._at(self.values(found.x))
        return fit

    def off(self, x: np.ndarray, jump: float) -> np.ndarray:
        """All innovations, and what the prior misses."""
        return np.r_[self._innovations([x], jump)[0], self.root @ (x - self.middle)]

    def slopes(self, x: np.ndarray, jump: float) -> np.ndarray:
        e = self._innovations([x, *(x + SLIGHT * np.eye(len(x)))], jump)
        return np.vstack([(e[1:] - e[0]).T / SLIGHT, self.root])

    def _innovations(self, at: Sequence[np.ndarray], jump: float) -> np.ndarray:
        sets, drive, made = [self.values(x) for x in at], self.begun.drive, []
        for run in (run for run in self.ready.runs if run.train.size):
            made.append(whitened(drive, run, run.train, sets, [jump] * len(sets))[0])
        return np.concatenate([e.reshape(len(sets), -1) for e in made], axis=1)

    def starts(self) -> np.ndarray:
        """The first row of each window among all innovations."""
        each = [np.full(run.train.start.size, 2 * run.train.length) for run in self.ready.runs]
        return np.r_[0, np.cumsum(np.concatenate(each))[:-1]]


# ---- the log of a question, and what the torque balance answers of it, by simulation


OTHER_PLACES = (
    "the drive passes most places once, so that few are both in training and in held-out samples. "
    "The torque errors are of shorter parts in turn."
)
PLACES = 36  # in a turn or travel
# s: lengths of blocks; those of 2 s, the least, may see one half of a periodic motion each
LENGTHS = (0.0, 2.7, 3.7, 5.3)


def ready_of(asked: Asked, horizon: float) -> tuple[Prepared | None, Refused | None]:
    """The records split so that both parts see the same motion, or why they cannot be."""
    if is_map(asked.stretches):  # nothing moves that could be simulated
        return None, None
    records, holdout = asked.records(), asked.holdout()
    for length in LENGTHS:
        try:
            ready = prepared(records, asked.model, holdout, horizon, length)
        except Refused as no:
            if not length:
                return None, no
            continue
        if holdout is not None or _same_motion(ready):
            return ready, None
    return None, Refused(OTHER_PLACES)


def _same_motion(ready: Prepared) -> bool:
    """Whether most held-out samples lie at angles that training samples pass the same way."""
    places, apart = [], []
    for i, run in enumerate(ready.runs):
        turn = 2 * np.pi if ready.model.motion == "rotary" else float(np.ptp(run.theta)) or 1.0
        way = np.sign(run.speed) * run.moves
        places.append(3 * (np.floor(run.theta / turn * PLACES) % PLACES) + way)
        own = [(run.t >= a) & (run.t <= b) for k, a, b in ready.held_out if k == i]
        apart.append(np.any([0 * run.t > 0, *own], axis=0))
    place, out = np.concatenate(places), np.concatenate(apart)
    return bool(np.mean(np.isin(np.unique(place[out]), place[~out])) > 0.5)


def simulated(
    ready: Prepared, made: Answer, values: ModelValues, least: float
) -> tuple[Judged | None, ModelValues, float | None, Refused | None]:
    """Errors before and after, values of a last polish (of a clean log, or of a law of whose values
    the balance knows nothing), the noise of the torque, and why there is no error."""
    model, ready = made.view.model, as_it_acts(ready, made)
    refitted = completed(made.refitted, model, made.sure)
    trained = completed(made.trained, model, made.sure, made.parts)
    clean = made.with_names.stays < 2 * least * made.view.size  # a finer fit may be valid
    try:
        own_law = not told_by_balance(model)
        if (clean or own_law) and not made.only_inertia:
            finer, own = polished(ready, trained, values)
            if own_law or torque_noise(ready, finer) < least * made.view.size:
                trained, values = finer, own
                named = made.named or made.parts
                refitted = polished(ready, refitted, own)[0] if named else trained
        full = None if None in model.values().values() else model
        models = {"declared": full, "refitted": refitted, "augmented": trained}
        return errors(ready, models), values, torque_noise(ready, values.model), None
    except (Refused, InputError) as no:  # all else is known
        why_not = no if isinstance(no, Refused) else Refused(str(no))
        return None, values, None, why_not


def as_it_acts(ready: Prepared, made: Answer) -> Prepared:
    """The same with the torque as it acted: without offsets of the columns of runs, later where no
    effect says so; and with a w that is not above the speed."""
    last, (x, low, high), above = made.last, made.values["late"], made.view.w_above[0]
    own = [b for n, b in zip(last.design.names, last.fit.b.tolist(), strict=True) if n == "run"]
    offsets = dict(zip(last.view.with_offset.tolist(), own, strict=True))
    every = last.values["offset"] if last.design.constant else 0.0
    late = x * made.view.longest_hold if low > 0 or high < 0 else 0.0
    late = late if abs(late) > 0.5 * made.view.motion.dt else 0.0
    turn, lower, runs = 1 if late >= 0 else -1, np.array([0.0, above]), []
    for i, run in enumerate(ready.runs):
        known = every + offsets.get(i, 0.0) if i in last.view.motion.run else 0.0
        u, theta = run.u - known, run.theta - above * (run.t - run.t[0])
        for a, b in run.pieces if late else ():  # earlier is later in reversed time
            u[a:b] = held_late(u[a:b][::turn], run.dt, abs(late))[::turn]
        runs.append(replace(run, u=u, recorded=run.recorded - lower, y=run.y - lower, theta=theta))
    return replace(ready, runs=tuple(runs), memory={})


def polished(ready: Prepared, trained: Model, values: ModelValues) -> tuple[Model, ModelValues]:
    """The values that make one-step predictions of training windows most likely, begun from those
    of the balance with their distribution. Those that the balance knows are free, too, or their
    errors move the others. Refused where a value is missing."""
    own, model = values.model.declarations(), lifted(trained, ready.model)
    free = own.keys() & trained.values().keys() - values.model.held()
    begun, found = fitted(ready, model), None
    space = _Space(ready, begun, model, [k for k in own if own[k].fitted and k in free], values)
    if space.keys and sum(run.train.start.size for run in ready.runs) > 1:
        with suppress(np.linalg.LinAlgError):  # the model diverges along this log
            found = _at_top(space, begun)
    if found is None:
        return trained, values
    known, joint = found[0].values, with_scale(found[1])
    finer, model = trained.with_values(known), values.model.with_values(known)
    estimates = {k: replace(e, value=known.get(k, e.value)) for k, e in values.estimates.items()}
    estimates |= as_estimates(joint, finer)
    return finer, replace(values, model=model, estimates=estimates, joint=joint)
