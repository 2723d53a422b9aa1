"""Data set for estimation: runs laid end to end, sensor noise, smoothed motion, weights."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from ...blocks.effects.actuator import held_late
from ...core.errors import InputError, Refused
from ...record import Record
from ...record.record import smallest_step
from ...record.signal_noise import repeating, sensor_noise
from .kalman import Noise, smooth

STEPPED = 3.0  # times the acceleration over 20 ms: above, it is due to an encoder's steps


@dataclass(frozen=True)
class Log:
    """The signals that an effect reads, in the middle of each sample interval.

    ``t`` s, ``theta`` rad, ``w`` rad/s, ``a`` rad/s2; ``u`` N m and ``load`` N m (0 if not
    recorded) are held over the interval. ``dt``, ``motion`` and ``runs`` describe the log.
    """

    t: np.ndarray
    theta: np.ndarray
    w: np.ndarray
    a: np.ndarray
    u: np.ndarray
    load: np.ndarray
    dt: float
    motion: str
    runs: tuple[tuple[int, int], ...]

    @property
    def signals(self) -> dict[str, np.ndarray]:
        """The signals that an effect may read, by name."""
        return {k: getattr(self, k) for k in ("t", "theta", "w", "a", "u", "load")}

    def first(self, samples: int) -> Log:
        """The first samples only."""
        runs = tuple((a, min(b, samples)) for a, b in self.runs if a < samples)
        return replace(self, **{k: x[:samples] for k, x in self.signals.items()}, runs=runs)

    @cached_property
    def fastest(self) -> float:
        """Largest speed, rad/s."""
        return float(np.max(np.abs(self.w)))


@dataclass(frozen=True)
class Data:
    """One or several runs laid end to end.

    ``d`` is the recorded load torque, 0 if there is none; ``y`` (N, 2) the measured theta and w,
    nan where not recorded; ``runs`` the index ranges without a gap; ``log`` the smoothed motion.
    ``noise`` holds the noise of the sensors, larger than their ``own`` where samples repeat each
    other, and as its jump the typical dw/dt. ``counts`` are the smallest steps of the sensors;
    their values change after ``repeats`` samples. ``run`` (N,) numbers the records from 0; those in
    ``differing`` may differ a little from the first. ``w`` is a recorded speed that is not fitted,
    only used to compute errors.
    ``zeros`` are the shifts of theta by run with which effects that repeat ``order`` times per 2 pi
    of it (rotary: once) agree; empty if theta is as recorded. ``plain`` are the values of the
    plain torque balance, from which fits start.
    """

    t: np.ndarray
    u: np.ndarray
    d: np.ndarray
    y: np.ndarray
    dt: float
    motion: str
    runs: tuple[tuple[int, int], ...]
    noise: Noise
    log: Log = field(repr=False)
    run: np.ndarray = field(repr=False)
    own: tuple[float, ...] = (np.nan, np.nan)
    counts: tuple[float, ...] = (0.0, 0.0)
    repeats: tuple[float, ...] = (1.0, 1.0)
    differing: tuple[int, ...] = ()
    w: np.ndarray | None = field(default=None, repr=False)
    zeros: Mapping[int, float] = field(default_factory=dict)
    order: float = 1.0
    plain: Mapping[str, float] = field(default_factory=dict, repr=False)

    def earlier(self, by: float) -> Data:
        """The same motion with the torque ``by`` s earlier: it was logged so late."""
        u = self.u.copy()
        for a, b in self.runs:  # a delay, in reversed time
            u[a:b] = held_late(self.u[a:b][::-1], self.dt, by)[::-1]
        return self._under(u)

    def lowered(self, offset: float) -> Data:
        """The same with a speed, logged alone, that was so much too high, rad/s."""
        y = self.y - [0.0, offset]
        log = _log(self.t, self.u, self.d, y, self.dt, self.motion, self.runs, self.noise)
        return replace(self, y=y, log=log)

    def aligned(self, zeros: Mapping[int, float], order: float) -> Data:
        """The same with theta of these runs shifted (rad, linear: m), for effects that repeat
        ``order`` times per 2 pi of it.

        A rotary drive passes the same positions every turn, so its phases count per 2 pi of theta
        itself.
        """
        shift = np.zeros(len(self.t))
        for run, zero in zeros.items():
            shift[self.run == run] = zero
        y = self.y + shift[:, None] * [1.0, 0.0]
        log = replace(self.log, theta=self.log.theta + shift)
        period = 1.0 if self.motion == "rotary" else order
        return replace(self, y=y, log=log, zeros=dict(zeros), order=period)

    def _under(self, u: np.ndarray) -> Data:
        return replace(self, u=u, log=replace(self.log, u=u))

    @cached_property
    def weight(self) -> np.ndarray:
        """Weight of each sample of theta and w, (N, 2).

        It is 1, and less where an encoder stays on one count for longer than its noise accounts
        for: such samples are not independent.
        """
        each = [_lengths(c, count) for c, count in zip(self.y.T, self.counts, strict=True)]
        return np.minimum(1.0, np.array(self.repeats) / np.column_stack(each))

    @cached_property
    def rounding(self) -> tuple[np.ndarray, np.ndarray] | None:
        """For samples that repeat a count: the part of a correction by them to leave out, (N, 2),
        and half a count of each sensor, (2,): up to there it may be one and the same rounding.

        A larger deviation is real. None if no sample repeats a count.
        """
        dull = 1.0 - self.weight
        return (dull, 0.5 * np.array(self.counts)) if dull.any() else None

    @property
    def signal(self) -> str:
        """The channel on which errors are computed: w, or theta if only that was recorded."""
        return "w" if self.w is not None or np.isfinite(self.noise.w) else "theta"

    @property
    def channel(self) -> int:
        return 1 if self.signal == "w" else 0

    @property
    def measured(self) -> np.ndarray:
        """That channel as recorded (N,)."""
        return self.y[:, self.channel] if self.w is None else self.w

    @property
    def floor(self) -> float:
        """The sensor noise of that channel."""
        if self.w is not None:
            return sensor_noise(self.w)
        return self.own[self.channel]

    @property
    def unit(self) -> str:
        names = {"rotary": ("rad", "rad/s"), "linear": ("m", "m/s")}
        return names[self.motion][self.channel]


def prepare(records: Sequence[Record]) -> Data:
    """Lay records of one sampling rate end to end.

    Raises
    ------
    InputError
        When the records differ in rate, in kind of motion or in what was recorded.
    """
    _alike(records)
    first = records[0]
    y = np.concatenate([_measured(r) for r in records])
    runs, base = [], 0
    for r in records:
        runs += [(base + s.start, base + s.stop) for s in r.segments()]
        base += r.samples
    t = np.concatenate([r.t for r in records])
    u = np.concatenate([r.u for r in records])
    d = np.concatenate([np.zeros(r.samples) if r.d is None else r.d for r in records])
    steps = [max(r.resolution.get(role, 0.0) for r in records) for role in ("theta", "w")]
    own = tuple(_own(c, step) for c, step in zip(y.T, steps, strict=True))
    repeats = tuple(repeating(c, step) for c, step in zip(y.T, steps, strict=True))
    noise = _noise(y, first.dt, runs, own, repeats)
    log = _log(t, u, d, y, first.dt, first.motion, tuple(runs), noise)
    run = np.repeat(np.arange(len(records), dtype=np.int16), [r.samples for r in records])
    return Data(
        t, u, d, y, first.dt, first.motion, tuple(runs), noise, log, run, own,
        tuple(max(step, smallest_step(c)) for c, step in zip(y.T, steps, strict=True)), repeats,
    )  # fmt: skip


def thinned(data: Data, every: int) -> Data:
    """Keep one of ``every`` samples; the torque is their mean, which moves the drive.

    Sensor values are not averaged, so their noise stays the same.
    """
    at = [np.arange(a, b - every + 1, every) for a, b in data.runs]
    ends = np.cumsum([0, *map(len, at)]).tolist()
    index = np.concatenate(at)
    cells = index[:, None] + np.arange(every)
    u, d, dt = data.u[cells].mean(1), data.d[cells].mean(1), data.dt * every
    runs = tuple(zip(ends, ends[1:], strict=False))
    mean = {k: getattr(data.log, k)[cells].mean(1) for k in ("t", "theta", "w", "a")}
    log = replace(data.log, **mean, u=u, load=d, dt=dt, runs=runs)
    t, y, run = data.t[index], data.y[index], data.run[index]
    w = None if data.w is None else data.w[index]
    return replace(data, t=t, u=u, d=d, y=y, dt=dt, runs=runs, log=log, run=run, w=w)


def picked(data: Data, index: np.ndarray) -> Data:
    """Single samples, independent of each other: there are no runs."""
    log = data.log
    alone = {k: signal[index] for k, signal in log.signals.items()}
    return replace(
        data, t=data.t[index], u=data.u[index], d=data.d[index], y=data.y[index], runs=(),
        run=data.run[index], log=replace(log, **alone, runs=()),
        w=None if data.w is None else data.w[index],
    )  # fmt: skip


def _alike(records: Sequence[Record]) -> None:
    first = records[0]
    for r in records[1:]:
        if abs(r.dt / first.dt - 1.0) > 1e-3:
            raise Refused(
                f"{r.source} has {r.rate:g} samples per second but {first.source} has "
                f"{first.rate:g}: they are not simulated together."
            )
        same = (r.w is None, r.theta is None) == (first.w is None, first.theta is None)
        if r.motion != first.motion or not same:
            raise InputError(
                f"{r.source} and {first.source} do not hold the same channels; give runs that do."
            )


def _measured(r: Record) -> np.ndarray:
    empty = np.full(r.samples, np.nan)
    return np.column_stack([empty if c is None else c for c in (r.theta, r.w)])


def _own(x: np.ndarray, step: float) -> float:
    return sensor_noise(x, step) if np.isfinite(x).any() else np.nan


def _lengths(x: np.ndarray, count: float) -> np.ndarray:
    """For each sample, how many in a row stay on the same count."""
    steps = np.round((x - x[np.isfinite(x)][:1].sum()) / count) if count > 0.0 else x
    first = np.flatnonzero(np.diff(steps, prepend=np.nan) != 0.0)
    lengths = np.diff(first, append=len(x))
    return np.repeat(lengths, lengths)


def _noise(
    y: np.ndarray,
    dt: float,
    runs: Sequence[tuple[int, int]],
    own: Sequence[float],
    repeats: Sequence[float],
) -> Noise:
    """Noise with which samples can be treated as independent: larger where counts repeat."""
    theta, w = (size * np.sqrt(times) for size, times in zip(own, repeats, strict=True))
    return Noise(max(_jump(y[a:b], dt, theta, w) for a, b in runs), theta, w)


def _log(t, u, d, y, dt, motion, runs, noise) -> Log:
    state = np.empty_like(y)
    for a, b in runs:
        state[a:b] = smooth(y[a:b], dt, noise)
    theta, w = state.T
    middle = theta + 0.5 * dt * w
    ahead = np.append(w[1:], w[-1])
    last = [b - 1 for _, b in runs]
    ahead[last] = w[last]
    return Log(t + 0.5 * dt, middle, 0.5 * (w + ahead), (ahead - w) / dt, u, d, dt, motion, runs)


def _jump(y: np.ndarray, dt: float, theta_noise: float, w_noise: float) -> float:
    """Typical size of dw/dt, over a smoothing window that is long enough to show it."""
    seen, n = np.isfinite(w_noise), max(5, int(round(0.02 / dt)))
    n = min(n, len(y) // 3)  # a short piece between gaps
    w = y[:, 1] if seen else np.gradient(y[:, 0], dt)
    rough = w_noise if seen else theta_noise / dt
    usual = max(float(np.std(_slope(w, n, dt))), rough / (n * dt))
    if seen:
        return usual
    # a coarse encoder shows no speed between two counts
    long = max(
        float(np.std(_slope(_slope(y[:, 0], n, dt), n, dt))), 2.0 * theta_noise / (n * dt) ** 2
    )
    return usual if usual < STEPPED * long else long


def _slope(x: np.ndarray, n: int, dt: float) -> np.ndarray:
    return (x[n:] - x[:-n]) / (n * dt)
