"""The motion, smoothed once: as far as the noise of its channels asks.

Of each rate, theta and w are fitted by penalised least squares,

    sum (theta - x)^2 / V_theta + sum (w - dx/dt)^2 / V_w + stiffness sum (d3 x)^2 / V_theta

with the largest stiffness whose residual is the noise. What this smoothing does to any other
signal is known: its impulse response, through which the torque is sent too.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import copy
from functools import cached_property

import numpy as np
from scipy import ndimage
from scipy.linalg import solveh_banded

from .constants import ENOUGH, FINE, FREE_LATE, NOISE_FIT, SOFT
from .numerics import bend, cubic, half_response, slope
from .samples import Samples, in_turn, joined
from .sensors import Sensors

THIRD = np.array([-1.0, 3, -3, 1])  # third difference: what the smoothing holds small
SLOPE = np.array([1.0, -8, 0, 8, -1])  # 12 dt times the slope of fourth order
DRIFT = 50.0  # samples of noise of w that a position summed from it has
FAR = 25.0  # a residual counts for no more than five sigma


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
            self.variance = sensors.w_variance * self.dt**2 * DRIFT + 1e-300
        self.of_w = 0.0 if self.w is None else 1 / (sensors.w_variance * 144 * self.dt**2)
        self._systems: dict[int, tuple[np.ndarray, np.ndarray]] = {}

    def only(self, samples: Samples, at: Sequence[slice]) -> Smoother:
        """The same for parts of the log."""
        made = copy(self)
        made.sensors, made.theta = self.sensors.only(samples, at), joined(self.theta, at)
        made.w, made._systems = made.sensors.w, {}
        return made

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
        return solveh_banded(data + penalty * stiffness / self.variance, right)

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
            misfit = np.mean(np.minimum((self.theta - x) ** 2 / self.variance, FAR))
            if self.w is not None:
                w = self.sensors.samples.each(lambda y: slope(y, self.dt), x)
                of_w = (self.w - w) ** 2 / self.sensors.w_variance
                misfit = max(misfit, np.mean(np.minimum(of_w, FAR)))
            if misfit < NOISE_FIT:
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
            self.theta = smoother(stiffness * SOFT, smoother.theta, smoother.w)
        self.w = self.slope(self.theta)
        self.acceleration = self.bend(stiff)
        self.path = stiff[0] + np.r_[0, np.cumsum(self._joined(np.diff(stiff)))]
        self.pulse = smoother.pulse(stiffness)
        self.spread = 1 / max(1e-9, abs(half_response(self.pulse)))
        self.shake = self._shaken()
        self.between = int(np.clip(round(self.dt / FINE), 1, 10))
        self.fine_steps, self.fine_w = self._between_samples()

    @classmethod
    def of(cls, samples: Samples) -> SmoothRuns:
        """The motion as smooth as the noise asks, judged on parts of a long log."""
        smoother = Smoother(Sensors(samples))
        few = samples.some(ENOUGH)
        judge = smoother if few is samples else Smoother(Sensors(few))
        return cls(smoother, judge.stiffness())

    def only(self, at: Sequence[slice]) -> SmoothRuns:
        """Parts of the log, as smooth as it is."""
        made, k = copy(self), self.between
        made.samples = self.samples.only(at)
        made.smoother = self.smoother.only(made.samples, at)
        made.sensors = made.smoother.sensors
        for key in ("theta", "w", "acceleration", "path", "shake"):
            setattr(made, key, joined(getattr(self, key), at))
        fine = [slice(k * one.start, k * one.stop) for one in at]
        made.fine_w = joined(self.fine_w, fine)
        made.fine_steps = made._joined(joined(np.r_[self.fine_steps, 0.0], fine)[:-1], k)
        return made

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
        white = np.random.default_rng(1).standard_normal((2, min(n, ENOUGH)))
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
        late = [0.5 * r.dt + FREE_LATE for r in self.runs]
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

    def _each(self, function: Callable[[SmoothRuns, np.ndarray], np.ndarray], x: np.ndarray):
        if len(self.runs) == 1:
            return function(self.main, x)
        pairs = zip(self.runs, self.at, strict=True)
        return np.concatenate([function(r, x[at]) for r, at in pairs])

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
        return self._each(lambda r, y: r.slope(y), x)

    def bend(self, x: np.ndarray) -> np.ndarray:
        """Second derivative of x (n,), piece by piece."""
        return self._each(lambda r, y: r.bend(y), x)

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
        straight = np.all((off < 0.05 * way) & (off < 0.4))
        return bool(straight and np.ptp(np.abs(w)) < 0.3 * np.mean(np.abs(w)))

    @cached_property
    def count(self) -> float:
        """The coarsest step of an encoder, rad."""
        return max(r.sensors.count for r in self.runs)
