"""The motion of a log, smoothed once: as far as the noise of its channels asks.

Of each rate, theta and w are fitted by penalised least squares, by what the channels are worth,

    sum (theta - x)^2 / V_theta + sum (w - dx/dt)^2 / V_w + stiffness sum (d3 x)^2 / V_theta

with the largest stiffness whose residual is the noise. What this smoothing does to any other
signal is known: its impulse response, through which the torque is sent too.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy import ndimage
from scipy.linalg import solveh_banded

from ..core.errors import Refused
from ..core.numeric import rms
from ..core.regression import TINY, weight
from ..record import Stretch
from . import constants as const


def slope(x: np.ndarray, dt: float) -> np.ndarray:
    """dx/dt (n, ...) of fourth order: at 200 Hz plain differences take 3 % off 10 Hz."""
    if len(x) < 2:
        return np.zeros(x.shape)
    d = np.gradient(x, dt, axis=0)
    if len(x) > 8:
        d[2:-2] = (8 * (x[3:-1] - x[1:-3]) - x[4:] + x[:-4]) / (12 * dt)
    return d


def bend(x: np.ndarray, dt: float) -> np.ndarray:
    """d2x/dt2 (n, ...) of fourth order."""
    d = slope(slope(x, dt), dt)
    if len(x) > 8:
        d[2:-2] = (16 * (x[3:-1] + x[1:-3]) - 30 * x[2:-2] - x[4:] - x[:-4]) / (12 * dt**2)
    return d


def cubic(x: np.ndarray, v: np.ndarray, shares: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Positions and speeds (n, k) at these shares (k,) of the way to the next sample, by the cubic
    through positions x (n,) and speeds v (n,) a sample; beyond the end the speed stays."""
    rise, after = np.append(np.diff(x), v[-1]), np.append(v[1:], v[-1])
    second, third = 3 * rise - 2 * v - after, v + after - 2 * rise
    q, (x, v, second, third) = shares, (y[:, None] for y in (x, v, second, third))
    return x + q * (v + q * (second + q * third)), v + q * (2 * second + 3 * q * third)


def bump(half: int) -> np.ndarray:
    """Weights (2 half + 1,) of a window: smooth, positive, sum 1."""
    phi = (1 - (np.arange(-half, half + 1) / (half + 1)) ** 2) ** 3
    return phi / phi.sum()


def local_noise(x: np.ndarray, pieces: Sequence[slice], quantile: float) -> float:
    """A quantile, over short stretches, of the spread of third differences."""
    thirds = [np.diff(x[at], 3) for at in pieces]
    spread = [
        y[: len(y) // const.STRETCH * const.STRETCH].reshape(-1, const.STRETCH).std(axis=1)
        for y in thirds
    ]
    return float(np.quantile(np.concatenate(spread), quantile))


def half_response(kernel: np.ndarray) -> float:
    """Frequency (rad per sample) at which a kernel's response falls to one half."""
    H = np.abs(np.fft.rfft(kernel, 4096))
    low = np.flatnonzero(H < 0.5 * H[0])
    return np.pi * (int(low[0]) if len(low) else 2048) / 2048


Function = Callable[[np.ndarray], np.ndarray]


@dataclass(frozen=True, eq=False)
class Samples:
    """Channels of one rate, piece after piece, (n,) each in SI units."""

    dt: float
    t: np.ndarray  # with the runs one after the other
    stamp: np.ndarray  # times of each log
    u: np.ndarray
    theta: np.ndarray | None
    w: np.ndarray | None
    d: np.ndarray  # measured load torque
    ok: np.ndarray  # sound samples
    run: np.ndarray  # the log they come from
    pieces: tuple[slice, ...]  # of even time
    count: float  # rad: step of the encoder, 0 where theta lies on no lattice

    @classmethod
    def of(cls, stretches: Sequence[Stretch], times: Sequence[np.ndarray]) -> Samples:
        """The samples of stretches of one rate, at the given times."""
        sizes = [len(s.u) for s in stretches]
        loads = [np.zeros(len(s.u)) if s.d is None else s.d for s in stretches]
        recorded = [k for k in ("u", "ok", "theta", "w") if getattr(stretches[0], k) is not None]
        made: dict[str, Any] = {"theta": None, "w": None}
        made |= {k: np.concatenate([getattr(s, k) for s in stretches]) for k in recorded}
        return cls(
            dt=float(np.median([s.dt for s in stretches])),
            t=np.concatenate(times),
            stamp=np.concatenate([s.t for s in stretches]),
            d=np.concatenate(loads),
            run=np.repeat([s.run for s in stretches], sizes),
            pieces=in_turn(sizes),
            count=max(s.count for s in stretches),
            **made,
        )

    def __len__(self) -> int:
        return len(self.u)

    def each(self, function: Function, x: np.ndarray) -> np.ndarray:
        """A function of each piece of x (n,), put together: nothing looks across a cut."""
        return np.concatenate([function(x[at]) for at in self.pieces])

    @property
    def moves(self) -> bool:
        return any(np.ptp(x) > 0 for x in (self.theta, self.w) if x is not None)

    def some(self, most: int) -> Samples:
        """Evenly spread parts of a long log, ``most`` samples in all; itself where it is short."""
        if len(self) <= most:
            return self
        size = max(most // 12, 10 * const.SHORTEST)
        period = int(size * len(self) / most)
        at = [slice(a, min(a + size, p.stop)) for p in self.pieces
              for a in range(p.start, p.stop, period)]  # fmt: skip
        return self.only([one for one in at if one.stop - one.start >= const.SHORTEST])

    def only(self, at: Sequence[slice]) -> Samples:
        """Parts of the log as pieces of their own."""
        theta, w = (None if x is None else joined(x, at) for x in (self.theta, self.w))
        made = {k: joined(getattr(self, k), at) for k in ("t", "stamp", "u", "d", "ok", "run")}
        pieces = in_turn([one.stop - one.start for one in at])
        return replace(self, theta=theta, w=w, pieces=pieces, **made)


def joined(x: np.ndarray, at: Sequence[slice]) -> np.ndarray:
    """Parts of x (n, ...), one after the other."""
    return np.concatenate([x[one] for one in at])


def by_piece(
    function: Callable[[np.ndarray, float], np.ndarray],
    x: np.ndarray,
    pieces: Sequence[tuple[slice, float]],
) -> np.ndarray:
    """``function(x, dt)`` of each piece of x (n, ...): nothing looks across a cut."""
    made = np.zeros(x.shape)
    for at, dt in pieces:
        made[at] = function(x[at], dt)
    return made


def in_turn(sizes: Sequence[int]) -> tuple[slice, ...]:
    """The places of parts of these sizes, one after the other."""
    ends = np.cumsum([0, *sizes]).tolist()
    return tuple(map(slice, ends[:-1], ends[1:]))


def sampled(
    stretches: Sequence[Stretch], shifts: Mapping[int, float] | None = None
) -> list[Samples]:
    """The stretches of a log by rate and channels; runs follow one another in time, or begin so
    much later (s). Where others move, those that rest throughout say nothing. Refused where no
    stretch is long enough."""
    long = [s for s in stretches if len(s.u) >= const.SHORTEST and s.ok.any()]
    if not long:
        raise Refused(f"no {const.SHORTEST} sound samples stand in a row.", "Record a longer run.")
    shifts = shifts or _in_turn(long)
    groups: dict[tuple, list[Stretch]] = {}
    for s in long:
        own = s.theta is None, s.w is None
        alike = (k for k in groups if k[1:] == own and abs(s.dt / k[0] - 1.0) < const.SAME)
        groups.setdefault(next(alike, (s.dt, *own)), []).append(s)
    made = [Samples.of(g, [s.t + shifts[s.run] for s in g]) for g in groups.values()]
    return [one for one in made if one.moves] or made


def _in_turn(stretches: Sequence[Stretch]) -> dict[int, float]:
    """How much later each run begins, s: the first one as recorded, others behind it."""
    shifts, end = {stretches[0].run: 0.0}, 0.0
    for s in stretches:
        shifts.setdefault(s.run, end + s.dt - float(s.t[0]))
        end = float(s.t[-1]) + shifts[s.run]
    return shifts


class Sensors:
    """theta and w of some runs with their noise (variances, inf where not recorded), a late w
    corrected: None where it says no more than theta, or is ``foreign``: no speed of theta.
    ``lag`` (s), ``offset`` (rad/s) and ``gain``, with their standard errors, are those of

        dtheta/dt = gain w(t + lag) - offset
    """

    def __init__(self, samples: Samples) -> None:
        self.samples, self.theta, self.w = samples, samples.theta, samples.w
        self.lag, self.lag_error, self.gain = 0.0, np.inf, 1.0
        self.offset = self.offset_error = self.gain_error = 0.0
        if not samples.moves:
            raise Refused("nothing moves.", "Record a motion that starts, stops and reverses.")
        self.count = samples.count
        white = np.random.default_rng(0).standard_normal(len(samples))
        self.theta_variance = self.w_variance = np.inf
        if self.theta is not None:
            noise = self._noise(self.theta, white, 0.1)
            rounding = max(self.count**2 / 12, (1e-9 * np.ptp(self.theta)) ** 2)
            self.theta_variance = max(rounding, noise**2, 1e-60)
        if self.w is not None:
            noise = self._noise(self.w, white, 0.3)
            self.w_variance = max(noise**2, (1e-7 * np.ptp(self.w)) ** 2)
        self.filtered = self.differenced = self.foreign = False
        if self.theta is not None and self.w is not None:
            self.differenced = self._differenced()
            self._compare()

    def _noise(self, x: np.ndarray, white: np.ndarray, quantile: float) -> float:
        """Standard deviation of the noise of a channel where the motion is calm."""
        own, unit = (local_noise(y, self.samples.pieces, quantile) for y in (x, white))
        return own / unit

    def _differenced(self) -> bool:
        """Whether the noise of w is that of differences of theta: then w measures nothing."""
        assert self.theta is not None and self.w is not None
        alike = 0.0
        for at in self.samples.pieces:
            x, y = np.diff(self.w[at], 2)[1:-1], np.diff(self.theta[at], 3)
            if len(y) > const.LEAST_NOISE:
                alike = max(alike, *(_alike(x, y[k : k + len(x)]) for k in (0, 1)))
        return alike > const.MOSTLY

    @property
    def late(self) -> bool:
        return abs(self.lag) > max(const.LEAST_LATE, 4 * self.lag_error)

    @property
    def scaled(self) -> bool:
        """Whether w is another multiple of the speed than sensors are uncertain by."""
        return abs(self.gain - 1) > const.SCALE + 4 * self.gain_error

    def _compare(self) -> None:
        """The lag of w, and whether w says more than theta does."""
        self._reconcile()
        self.filtered = self.late
        # a filtered difference of an encoder tells nothing that the encoder does not
        if self.late and self.count > 0 or self.foreign or abs(self.lag) > const.FAR_W:
            self.w = None

    def _windows(self, x: np.ndarray, kernel: np.ndarray) -> np.ndarray:
        """x (n,) under a kernel, every quarter of its length."""
        size = len(kernel)
        parts = [
            sliding_window_view(x[at], size)[:: max(1, size // 4)] @ kernel[::-1]
            for at in self.samples.pieces
            if at.stop - at.start > size
        ]
        return np.concatenate(parts) if parts else np.zeros(0)

    def _moved(self, T: float) -> np.ndarray:
        """w(t + T)."""
        assert self.w is not None
        steps = -T / self.samples.dt
        if abs(steps - round(steps)) < const.EXACT:
            return self.samples.each(lambda x: moved(x, round(steps)), self.w)
        return self.samples.each(lambda x: ndimage.shift(x, steps, order=3, mode="nearest"), self.w)

    def _reconcile(self) -> None:
        """Fit dtheta/dt = gain w(t + lag) + offset; a w that lags is un-filtered, as shifting would
        leave an error of second order. Beyond three samples it is shifted first."""
        assert self.theta is not None
        dt = self.samples.dt
        half = max(4, int(const.SLOW / dt))
        phi = np.pad(bump(half - 1), 1)
        dphi = np.gradient(phi) / dt
        turned = self._windows(self.theta, dphi)
        moves = np.abs(turned) > const.AT_REST * np.max(np.abs(turned), initial=0.0)
        if moves.sum() < 8:
            return

        def columns(T: float) -> np.ndarray:
            w = self._moved(T)
            parts = [self._windows(w, phi), self._windows(w, dphi), np.ones(len(turned))]
            return np.column_stack(parts)

        shift, X, b = self._far(turned, columns), np.zeros((0, 3)), np.zeros(3)
        for _ in range(3):
            X = columns(shift)
            b, weights, scale = _robust_line(X, turned, moves)
            rest = float(np.clip(b[1] / b[0] if shift else b[1], -const.SLOW, const.SLOW))
            self.gain, self.lag = float(b[0]), shift + rest
            if abs(self.lag) < min(3 * dt, 8e-3):
                break
            shift = float(np.clip(self.lag, -const.FAR_W, const.VERY_LATE))
        left = np.mean((turned - X @ b)[moves] ** 2)
        self.foreign = bool(left > const.MOSTLY**2 * np.mean(turned[moves] ** 2))
        if self.foreign:
            self.gain, self.lag = 1.0, 0.0
            return
        inverse = np.linalg.pinv(X * np.sqrt(weights)[:, None])
        error = np.sqrt(2 * (inverse**2).sum(axis=1)) * scale
        self.gain_error, self.lag_error, self.offset_error = error.tolist()
        self.offset = -float(b[2]) if abs(b[2]) > 4 * error[2] else 0.0
        if abs(self.lag) > const.FAR_W:  # so late is no filter of one kind
            self.lag_error = max(self.lag_error, const.FAINT * abs(self.lag))
        self._correct(shift, scale * np.sqrt(0.5 * half) * 0.6)

    def _far(self, turned: np.ndarray, columns: Callable[[float], np.ndarray]) -> float:
        """How late w is (s) beyond what a filter does, by a grid; 0 where no delay fits clearly."""
        grid = np.arange(0.0, const.VERY_LATE + 0.5 * const.LATE_STEP, const.LATE_STEP).tolist()
        lines = [columns(T)[:, ::2] for T in grid if len(turned) >= const.SHORTEST] or [
            turned[:, None]
        ]
        left = [rms(turned - X @ np.linalg.lstsq(X, turned, rcond=None)[0]) for X in lines]
        best = int(np.argmin(left))
        clear = grid[best] >= const.FAR_W and left[best] ** 2 < const.MOSTLY * left[0] ** 2
        return grid[best] if clear else 0.0

    def _correct(self, shift: float, left: float) -> None:
        """w without its lag; ``left`` is the noise of a sample that the misfit means."""
        assert self.w is not None
        dt, late = self.samples.dt, self.late
        self.w = (self.gain if self.scaled else 1.0) * self.w - self.offset
        if shift:
            self.w = self._moved(shift)
        elif late:
            self.w = self.w + self.lag * self.samples.each(lambda x: slope(x, dt), self.w)
        if late:
            self.w_variance *= 1 + 0.5 * min((self.lag / dt) ** 2, 50.0)
        self.w_variance = max(self.w_variance, left**2)


def _alike(x: np.ndarray, y: np.ndarray) -> float:
    """The size of the correlation of two signals of any unit; 0 where one of them is constant."""
    sizes = np.ptp(x), np.ptp(y)
    return float(abs(np.corrcoef(x / sizes[0], y / sizes[1])[0, 1])) if all(sizes) else 0.0


def moved(x: np.ndarray, steps: int) -> np.ndarray:
    """x (n,) so many samples later; its ends are held."""
    return x[np.clip(np.arange(len(x)) - steps, 0, len(x) - 1)]


def _robust_line(
    X: np.ndarray, y: np.ndarray, moves: np.ndarray
) -> tuple[np.ndarray, np.ndarray, float]:
    """Coefficients, weights and scale of a robust line; rows that rest say nothing of scale."""
    weights = np.ones(len(y))
    for _ in range(6):
        root = weights[:, None] ** 0.5
        b = np.linalg.lstsq(X * root, y * root[:, 0], rcond=None)[0]
        r = y - X @ b
        scale = 1.5 * float(np.median(np.abs(r[moves]))) + TINY
        weights = weight(r / scale)
    return b, weights, scale


THIRD = np.array([-1.0, 3, -3, 1])  # third difference: what the smoothing holds small
SLOPE = np.array([1.0, -8, 0, 8, -1])  # 12 dt times the slope of fourth order


class Smoother:
    """Penalised least squares on theta and w, banded, piece by piece."""

    def __init__(self, sensors: Sensors) -> None:
        samples = sensors.samples
        self.sensors, self.dt, self.w = sensors, samples.dt, sensors.w
        self.variance = sensors.theta_variance
        if sensors.theta is not None:
            self.theta = sensors.theta
        else:
            assert sensors.w is not None
            self.theta = samples.each(
                lambda w: np.r_[0, np.cumsum(0.5 * (w[1:] + w[:-1])) * self.dt], sensors.w
            )
            self.variance = sensors.w_variance * self.dt**2 * const.DRIFT + TINY
        self.of_w = 0.0 if self.w is None else 1 / (sensors.w_variance * 144 * self.dt**2)
        self._systems: dict[int, tuple[np.ndarray, np.ndarray]] = {}

    def _system(self, n: int) -> tuple[np.ndarray, np.ndarray]:
        """Penalty and data matrices of n samples, upper banded (5, n)."""
        if n not in self._systems:
            penalty, data = np.zeros((5, n)), np.zeros((5, n))
            for i in range(4):
                for j in range(i, 4):
                    penalty[4 - (j - i), j : n - 3 + j] += THIRD[i] * THIRD[j]
            data[4] += 1 / self.variance
            for i in range(5):
                for j in range(i, 5):
                    data[4 - (j - i), j : n - 4 + j] += self.of_w * SLOPE[i] * SLOPE[j]
            self._systems[n] = penalty, data
        return self._systems[n]

    def _solved(self, stiffness: float, right: np.ndarray) -> np.ndarray:
        penalty, data = self._system(len(right))
        return np.asarray(solveh_banded(data + penalty * stiffness / self.variance, right))

    def __call__(self, stiffness: float, theta: np.ndarray, w: np.ndarray | None) -> np.ndarray:
        """theta (n,) smoothed."""
        out = np.zeros(len(theta))
        for at in self.sensors.samples.pieces:
            right = theta[at] / self.variance
            if w is not None:
                of_w = self.of_w * 12 * self.dt * w[at][2:-2]
                for j in range(5):
                    right[j : len(right) - 4 + j] += SLOPE[j] * of_w
            out[at] = self._solved(stiffness, right)
        return out

    def stiffness(self) -> float:
        """From smooth to rough in half decades, until the residual is the noise."""
        grid = 10.0 ** np.arange(8, -3, -0.5)
        for stiffness in grid:
            x = self(stiffness, self.theta, self.w)
            misfit = np.mean(np.minimum((self.theta - x) ** 2 / self.variance, const.CLIP**2))
            if self.w is not None:
                w = self.sensors.samples.each(lambda y: slope(y, self.dt), x)
                of_w = (self.w - w) ** 2 / self.sensors.w_variance
                misfit = max(misfit, np.mean(np.minimum(of_w, const.CLIP**2)))
            if misfit < const.NOISE_FIT:
                return float(stiffness)
        return float(grid[-1])

    def pulse(self, stiffness: float) -> np.ndarray:
        """Impulse response (2 m + 1,) of the smoothing, sum 1."""
        longest = max(at.stop - at.start for at in self.sensors.samples.pieces)
        m = int(min(max(40, 12 * stiffness ** (1 / 6)), 4000, longest // 6))
        data = self._system(2 * m + 1)[1]
        one = np.zeros(2 * m + 1)
        one[m] = data[4, m]
        for i in range(1, min(5, m + 1)):
            one[m + i] = one[m - i] = data[4 - i, m]
        p = self._solved(stiffness, one)
        far = np.flatnonzero(np.abs(p) > 4e-3 * np.abs(p).max())
        reach = max(m - int(far[0]), int(far[-1]) - m)
        p = p[m - reach : m + reach + 1]
        return p / p.sum()


class SmoothRuns:
    """The smooth motion of the runs of one rate: ``theta``, ``w`` (n,) soft, for friction and
    places; ``acceleration``, ``path`` (n,) stiff, for inertia; ``shake`` (n,) the acceleration
    that noise makes; ``pulse`` the smoothing's impulse response, ``spread`` samples wide."""

    def __init__(self, smoother: Smoother, stiffness: float) -> None:
        sensors = smoother.sensors
        samples = sensors.samples
        self.smoother, self.sensors, self.samples = smoother, sensors, samples
        self.stiffness, self.dt = stiffness, samples.dt
        stiff = smoother(stiffness, smoother.theta, smoother.w)
        self.theta = stiff
        if stiffness > 1e-2:  # a stiff motion turns back at the wrong time
            self.theta = smoother(stiffness * const.SOFT, smoother.theta, smoother.w)
        self.w = self.slope(self.theta)
        self.acceleration = self.bend(stiff)
        self.path = stiff[0] + np.r_[0, np.cumsum(self._joined(np.diff(stiff)))]
        self.pulse = smoother.pulse(stiffness)
        self.spread = 1 / max(1e-9, abs(half_response(self.pulse)))
        self.shake = self._shaken()
        self.between = int(np.clip(round(self.dt / const.FINE), 1, 10))
        self.fine_steps, self.fine_w = self._between_samples()

    @classmethod
    def of(cls, samples: Samples) -> SmoothRuns:
        """The motion as smooth as the noise asks, judged on parts of a long log."""
        smoother = Smoother(Sensors(samples))
        few = samples.some(const.ENOUGH)
        judge = smoother if few is samples else Smoother(Sensors(few))
        return cls(smoother, judge.stiffness())

    def slope(self, x: np.ndarray) -> np.ndarray:
        return self.samples.each(lambda y: slope(y, self.dt), x)

    def bend(self, x: np.ndarray) -> np.ndarray:
        return self.samples.each(lambda y: bend(y, self.dt), x)

    def _joined(self, steps: np.ndarray, per_sample: int = 1) -> np.ndarray:
        """Steps (n - 1,) without those from one piece to the next."""
        for at in self.samples.pieces[1:]:
            steps[at.start * per_sample - 1] = 0.0
        return steps

    def _shaken(self) -> np.ndarray:
        """White noise of the channels' size, sent through the same smoothing."""
        n = len(self.samples)  # a long log has the same noise again and again
        white = np.random.default_rng(1).standard_normal((2, min(n, const.ENOUGH)))
        theta = np.resize(white[0], n) * self.smoother.variance**0.5
        w = np.resize(white[1], n) * self.sensors.w_variance**0.5
        noise = self.smoother(self.stiffness, theta, None if self.smoother.w is None else w)
        return self.bend(noise)

    def _between_samples(self) -> tuple[np.ndarray, np.ndarray]:
        """Steps and speeds between the samples, by the cubic through position and speed."""
        k = self.between
        if k == 1:
            return self._joined(np.diff(self.theta)), self.w
        fine = []
        for at in self.samples.pieces:
            theta, _ = cubic(self.theta[at], self.w[at] * self.dt, np.arange(k) / k)
            theta[-1] = self.theta[at][-1]
            fine.append(theta.ravel())
        speeds = np.concatenate([np.gradient(f, self.dt / k) for f in fine])
        return self._joined(np.diff(np.concatenate(fine)), k), speeds

    def coarse(self, X: np.ndarray) -> np.ndarray:
        """Values between the samples (n * between, k) -> at the samples (n, k), by triangles."""
        k = self.between
        if k == 1:
            return X
        weights = np.r_[np.arange(1, k + 1), np.arange(k - 1, 0, -1)] / k**2
        return np.ascontiguousarray(ndimage.convolve1d(X, weights, axis=0, mode="nearest")[::k])


def one_way(w: np.ndarray, top: float) -> bool:
    """Whether speeds (n,) have one direction, but for a fiftieth of them."""
    forth, back = (np.mean(sign * w > 0.02 * top) for sign in (1, -1))
    return bool(max(forth, back) > 50 * min(forth, back))


class Motion:
    """The smooth motion of a whole log: runs of every rate one after the other, (n,) in all.
    ``hold`` (n,) is how late the torque may be for nothing: half a hold and a current loop."""

    def __init__(self, runs: Sequence[SmoothRuns]) -> None:
        self.runs = tuple(runs)
        self.main = max(self.runs, key=lambda r: len(r.samples))
        self.dt, self.sensors = self.main.dt, self.main.sensors
        self.t, self.stamp, self.u, self.d, self.ok, self.run = (
            np.concatenate([getattr(r.samples, k) for r in self.runs])
            for k in ("t", "stamp", "u", "d", "ok", "run")
        )
        self.theta, self.w, self.acceleration, self.path, self.shake = (
            np.concatenate([getattr(r, k) for r in self.runs])
            for k in ("theta", "w", "acceleration", "path", "shake")
        )
        self.fine_w = np.concatenate([r.fine_w for r in self.runs])
        ends = [np.r_[r.fine_steps, 0.0] for r in self.runs]
        self.fine_steps = np.concatenate(ends)[:-1]  # no step leads from one rate to the next
        self.at = in_turn([len(r.samples) for r in self.runs])
        self.pieces = tuple(
            (slice(at.start + p.start, at.start + p.stop), r.dt)
            for at, r in zip(self.at, self.runs, strict=True)
            for p in r.samples.pieces
        )
        self.elapsed = self.t - self.t.min()
        self.duration = float(self.elapsed.max())
        late = [0.5 * r.dt + const.FREE_LATE for r in self.runs]
        self.hold = np.repeat(late, [len(r.samples) for r in self.runs])

    @classmethod
    def of(cls, groups: Sequence[Samples]) -> Motion:
        return cls([SmoothRuns.of(samples) for samples in groups])

    def varied(self, stiffer: float) -> Motion:
        """The same log, smoothed with another stiffness."""
        return Motion([SmoothRuns(r.smoother, r.stiffness * stiffer) for r in self.runs])

    def lowered(self, above: float) -> Motion:
        """The same log with speeds that are lower by so much (rad/s)."""
        made = copy(self)
        made.w, made.fine_w = self.w - above, self.fine_w - above
        made.theta, made.path = (x - above * self.elapsed for x in (self.theta, self.path))
        steps = [np.full(len(r.fine_w), r.dt / r.between) for r in self.runs]
        made.fine_steps = self.fine_steps - above * np.concatenate(steps)[:-1]
        return made

    def __len__(self) -> int:
        return len(self.t)

    def held(self, u: np.ndarray) -> np.ndarray:
        """Mean (n,) or (n, k) around each sample of a torque held from each to the next."""
        made = u.copy()
        for at, _ in self.pieces:
            made[at][1:] = 0.5 * (u[at][1:] + u[at][:-1])
        return made

    def later(self, late: float) -> np.ndarray:
        """The torque (n,) as if it acted so much later (s)."""
        parts = [np.interp(self.t[at] - late, self.t[at], self.u[at]) for at, _ in self.pieces]
        return np.concatenate(parts)

    def slope(self, x: np.ndarray) -> np.ndarray:
        """dx/dt (n,), piece by piece."""
        return by_piece(slope, x, self.pieces)

    def coarse(self, X: np.ndarray) -> np.ndarray:
        """Values between the samples (k n,) or (k n, m) -> at the samples."""
        if X.ndim == 1:
            return self.coarse(X[:, None])[:, 0]
        if len(self.runs) == 1:
            return self.main.coarse(X)
        parts = zip(self.runs, in_turn([len(r.fine_w) for r in self.runs]), strict=True)
        return np.concatenate([r.coarse(X[at]) for r, at in parts])

    @cached_property
    def top(self) -> float:
        """Top speed, but for a hundredth of the samples."""
        return float(np.quantile(np.abs(self.w), 0.99))

    @cached_property
    def span(self) -> float:
        """The longest way from end to end in one piece, rad."""
        return max(float(np.ptp(self.theta[at])) for at, _ in self.pieces)

    @cached_property
    def one_way(self) -> bool:
        return one_way(self.w, self.top)

    @cached_property
    def steady(self) -> bool:
        """One speed: the angle grows with time, but for what the machine itself does to it."""
        lines = []
        for at, _ in self.pieces:
            t, x = self.t[at] - self.t[at].mean(), self.theta[at]
            w = float(t @ x / (t @ t))
            lines.append((w, np.std(x - x.mean() - w * t), np.ptp(x)))
        w, off, way = np.array(lines).T
        straight = np.all((off < const.LITTLE * way) & (off < 0.4))
        return bool(straight and np.ptp(np.abs(w)) < const.PART * np.mean(np.abs(w)))

    @cached_property
    def count(self) -> float:
        """The coarsest step of an encoder, rad."""
        return max(r.sensors.count for r in self.runs)
