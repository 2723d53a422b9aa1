"""What the channels of the motion are worth: their noise, and how late w is against theta."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy import ndimage

from ..core.errors import Refused
from ..core.regression import NU
from .constants import AT_REST, FAR_W, MOSTLY, SCALE, VERY_LATE
from .numerics import local_noise, slope
from .samples import Samples, joined

KERNEL = 0.03  # half-width (s) of the kernel on which theta and w are compared
FILTER = 0.03  # s: a filter makes a w no later than this
WHOLE = 1e-9  # of a sample
LEAST_LATE = 2e-4  # s: a w that is later is corrected
LEAST_NOISE, ALIKE = 100, 0.5  # samples; correlation of noise from which w is a difference of theta


class Sensors:
    """theta and w of some runs with their noise, a late w corrected.

    ``theta_variance`` and ``w_variance`` are those of white noise, inf where not recorded.
    ``w`` (n,) is the speed that is used: None where there is none, where it only repeats the
    encoder, late, where it is too late to say more, and where it is ``foreign``: no speed of theta.
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

    def only(self, samples: Samples, at: Sequence[slice]) -> Sensors:
        """The same channels in parts of the log."""
        made = copy(self)
        made.samples, made.theta = samples, samples.theta
        made.w = None if self.w is None else joined(self.w, at)
        return made

    def _differenced(self) -> bool:
        """Whether the noise of w is that of differences of theta: then w measures nothing."""
        assert self.theta is not None and self.w is not None
        alike = 0.0
        for at in self.samples.pieces:
            x, y = np.diff(self.w[at], 2)[1:-1], np.diff(self.theta[at], 3)
            if len(y) > LEAST_NOISE:
                alike = max(alike, *(_alike(x, y[k : k + len(x)]) for k in (0, 1)))
        return alike > ALIKE

    @property
    def late(self) -> bool:
        return abs(self.lag) > max(LEAST_LATE, 4 * self.lag_error)

    @property
    def scaled(self) -> bool:
        """Whether w is another multiple of the speed than sensors are uncertain by."""
        return abs(self.gain - 1) > SCALE + 4 * self.gain_error

    def _compare(self) -> None:
        """The lag of w, and whether w says more than theta does."""
        self._reconcile()
        self.filtered = self.late
        # a filtered difference of an encoder tells nothing that the encoder does not
        if self.late and self.count > 0 or self.foreign or abs(self.lag) > FAR_W:
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
        if not T:
            return self.w
        steps = -T / self.samples.dt
        if abs(steps - round(steps)) < WHOLE:
            return self.samples.each(lambda x: moved(x, round(steps)), self.w)
        return self.samples.each(lambda x: ndimage.shift(x, steps, order=3, mode="nearest"), self.w)

    def _reconcile(self) -> None:
        """Fit dtheta/dt = gain w(t + lag) + offset; a w that lags is un-filtered, as shifting would
        leave an error of second order. Beyond three samples it is shifted first."""
        dt = self.samples.dt
        half = max(4, int(KERNEL / dt))
        phi = (1 - (np.arange(-half, half + 1) / half) ** 2) ** 3
        phi /= phi.sum()
        dphi = np.gradient(phi) / dt
        assert self.theta is not None
        turned = self._windows(self.theta, dphi)
        moves = np.abs(turned) > AT_REST * np.max(np.abs(turned), initial=0.0)
        if moves.sum() < 8:
            return
        shift = self._far(turned, phi)
        for _ in range(3):
            w = self._moved(shift)
            columns = [self._windows(w, phi), self._windows(w, dphi), np.ones(len(turned))]
            b, weights, scale = _robust_line(np.column_stack(columns), turned, moves)
            rest = b[1] / b[0] if shift else b[1]
            self.gain, self.lag = float(b[0]), shift + float(np.clip(rest, -FILTER, FILTER))
            if abs(self.lag) < min(3 * dt, 8e-3):
                break
            shift = float(np.clip(self.lag, -0.05, VERY_LATE))
        X = np.column_stack(columns)
        left = np.mean((turned - X @ b)[moves] ** 2)
        self.foreign = bool(left > MOSTLY**2 * np.mean(turned[moves] ** 2))
        if self.foreign:
            self.gain, self.lag = 1.0, 0.0
            return
        inverse = np.linalg.pinv(X * np.sqrt(weights)[:, None])
        error = np.sqrt(2 * (inverse**2).sum(axis=1)) * scale
        self.gain_error, self.lag_error, self.offset_error = error.tolist()
        self.offset = -float(b[2]) if abs(b[2]) > 4 * error[2] else 0.0
        if abs(self.lag) > FAR_W:  # so late is no filter of one kind
            self.lag_error = max(self.lag_error, 0.03 * abs(self.lag))
        self._correct(shift, scale * np.sqrt(0.5 * half) * 0.6)

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

    def _far(self, turned: np.ndarray, phi: np.ndarray) -> float:
        """How late w is (s) beyond what a filter does, by a grid; 0 where no delay fits clearly."""
        if len(turned) < 40:
            return 0.0
        grid = np.arange(0.0, VERY_LATE + 0.005, 0.01)
        misfit = []
        for T in grid:
            X = np.column_stack([self._windows(self._moved(T), phi), np.ones(len(turned))])
            r = turned - X @ np.linalg.lstsq(X, turned, rcond=None)[0]
            misfit.append(float(np.mean(r**2)))
        best = int(np.argmin(misfit))
        return float(grid[best]) if grid[best] >= FAR_W and misfit[best] < 0.5 * misfit[0] else 0.0


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
        scale = 1.5 * float(np.median(np.abs(r[moves]))) + 1e-15
        weights = 1 / (1 + (r / scale) ** 2 / NU)
    return b, weights, scale
