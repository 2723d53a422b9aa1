"""The motion as smooth as its noise asks, and what that smoothing does to a signal.

x minimises  sum (theta - x)^2 / v_theta + sum (w - dx/dt)^2 / v_w + lam / v_theta sum (D^3 x)^2,

with third differences D^3 and lam the largest at which the residual is still the noise. Torque and
terms are sent through the same filter S, so that both sides of the balance lose the same.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np
from scipy.linalg import solveh_banded

from ..balance.channel_noise import quantum
from ..balance.motion import Sensors
from ..balance.track import Track
from .numbers import SOFTER

THIRD = np.array([-1.0, 3.0, -3.0, 1.0])
SLOPE = np.array([1.0, -8.0, 0.0, 8.0, -1.0]) / 12.0
STIFFNESSES = 10.0 ** np.arange(8.0, -3.0, -0.5)
AS_NOISE = 1.15  # mean square of the residual over the noise, at which it is the noise
UNEVEN = 0.02  # RMS jitter of stamps, in steps, from which they are not even
OUTLIER = 25.0  # squares beyond this count as this
FINE = 1e-3  # s between the instants at which friction is computed
MOST_FINE = 10
SHORTEST = 9  # samples of a piece
PARTS = 20  # pieces of a long motion
FADED = 4e-3  # of the largest value: where an impulse response ends
EDGE = 12  # samples beyond the ends of a stretch that a spline through it knows


@dataclass(frozen=True, eq=False)
class Motion:
    """All stretches of a record one after the other, n samples of one step ``dt``.

    ``t`` runs on from stretch to stretch, ``stamp`` is the time in the log. ``theta``, ``w`` are
    smooth, for friction and effects;
    ``path`` is the stiffer position from which the acceleration comes, without jumps between the
    stretches. ``pulse`` is the impulse response of the smoothing, ``shake`` a draw of the noise
    that it leaves in the acceleration. ``measured`` are theta and w as measured, w corrected for
    lag, gain and offset, None where not recorded or of no use. ``variance`` is their noise, ``d``
    the measured load torque, 0 where there is none.
    """

    dt: float
    pieces: tuple[slice, ...]
    run: np.ndarray
    t: np.ndarray
    stamp: np.ndarray
    ok: np.ndarray
    u: np.ndarray
    theta: np.ndarray
    w: np.ndarray
    path: np.ndarray
    pulse: np.ndarray
    shake: np.ndarray
    measured: tuple[np.ndarray | None, np.ndarray | None]
    variance: tuple[float, float]
    filtered: bool
    count: float
    motion: str
    d: np.ndarray

    def __len__(self) -> int:
        return len(self.u)

    @property
    def duration(self) -> float:
        return len(self) * self.dt

    @property
    def runs(self) -> tuple[tuple[int, int], ...]:
        return tuple((p.start, p.stop) for p in self.pieces)

    @cached_property
    def a(self) -> np.ndarray:
        """Acceleration of the smooth motion, rad/s2."""
        return self.slope(self.w)

    @cached_property
    def span(self) -> float:
        """Travel within a stretch, rad."""
        return max(float(np.ptp(self.theta[p])) for p in self.pieces)

    @cached_property
    def top(self) -> float:
        """The speed that 1 % of the samples exceed, rad/s."""
        return float(np.quantile(np.abs(self.w), 0.99))

    def slope(self, x: np.ndarray) -> np.ndarray:
        """dx/dt (n, ...), stretch by stretch."""
        return np.concatenate([slope(x[p], self.dt) for p in self.pieces])

    def part(self, share: float) -> Motion:
        """That share of the motion, in PARTS pieces over all its duration; times stay."""
        if share >= 1.0:
            return self
        kept = []
        for p in self.pieces:
            many = int(np.ceil(PARTS * (p.stop - p.start) / len(self)))
            edges = np.linspace(p.start, p.stop, many + 1).astype(int).tolist()
            each = [(a, b) for a, b in pairwise(edges) if b - a > SHORTEST]
            kept += [np.arange(a, a + max(SHORTEST, int(share * (b - a)))) for a, b in each]
        at, ends = np.concatenate(kept), np.cumsum([0, *(len(k) for k in kept)]).tolist()
        pieces = tuple(slice(a, b) for a, b in pairwise(ends))
        each = ("run", "t", "stamp", "ok", "u", "d", "theta", "w", "shake")
        own = {k: getattr(self, k)[at] for k in each}
        measured = tuple(None if x is None else x[at] for x in self.measured)
        path = _joined([self.path[k] for k in kept])
        return replace(self, pieces=pieces, measured=measured, path=path, **own)

    def bend(self, x: np.ndarray) -> np.ndarray:
        """d2x/dt2 (n,), stretch by stretch."""
        return np.concatenate([bend(x[p], self.dt) for p in self.pieces])

    @cached_property
    def stiff(self) -> np.ndarray:
        """Acceleration of the stiffer position, that of the windows, rad/s2."""
        return self.bend(self.path)

    @cached_property
    def fine(self) -> Fine:
        """The motion between the samples: a reversal does not wait for the next sample."""
        return Fine.of(self)

    @cached_property
    def one_way(self) -> bool:
        """Whether nearly all motion goes in one direction."""
        up, down = np.mean(self.w > 0.02 * self.top), np.mean(self.w < -0.02 * self.top)
        return bool(max(up, down) > 50 * min(up, down))


@dataclass(frozen=True, eq=False)
class Fine:
    """Position steps and speed at ``sub`` instants in each sample."""

    sub: int
    dx: np.ndarray
    w: np.ndarray

    @classmethod
    def of(cls, m: Motion) -> Fine:
        sub = int(np.clip(round(m.dt / FINE), 1, MOST_FINE))
        if sub == 1:
            dx = np.diff(m.theta, prepend=m.theta[0])
            dx[[p.start for p in m.pieces]] = 0.0
            return cls(1, dx, m.w)
        x = [_between(m.theta[p], m.w[p] * m.dt, sub) for p in m.pieces]
        w = np.concatenate([np.gradient(part, m.dt / sub) for part in x])
        dx = np.concatenate([np.diff(part, prepend=part[0]) for part in x])
        return cls(sub, dx, w)

    def coarse(self, X: np.ndarray) -> np.ndarray:
        """Values (n sub, ...) as means with triangular weights around the samples (n, ...)."""
        if self.sub == 1:
            return X
        from scipy.ndimage import convolve1d  # slow to import

        up = np.arange(1, self.sub + 1)
        k = np.concatenate([up, up[-2::-1]]) / self.sub**2
        return np.ascontiguousarray(convolve1d(X, k, axis=0, mode="nearest")[:: self.sub])


def _between(x: np.ndarray, v: np.ndarray, sub: int) -> np.ndarray:
    """Cubic through positions x with slopes v per sample, at ``sub`` instants a sample."""
    q = np.arange(sub) / sub
    h00, h10 = 1 - 3 * q**2 + 2 * q**3, q - 2 * q**2 + q**3
    h01, h11 = 3 * q**2 - 2 * q**3, q**3 - q**2
    inside = np.outer(x[:-1], h00) + np.outer(v[:-1], h10)
    inside += np.outer(x[1:], h01) + np.outer(v[1:], h11)
    return np.append(inside.ravel(), np.full(sub, x[-1]))


def slope(x: np.ndarray, dt: float) -> np.ndarray:
    """Central difference of fourth order: the plain one loses 3 % of 10 Hz at 200 Hz."""
    d = np.gradient(x, dt, axis=0)
    if len(x) > 8:
        d[2:-2] = (8 * (x[3:-1] - x[1:-3]) - x[4:] + x[:-4]) / (12 * dt)
    return d


def bend(x: np.ndarray, dt: float) -> np.ndarray:
    """Second derivative, of fourth order."""
    d = np.gradient(np.gradient(x, dt), dt)
    if len(x) > 8:
        d[2:-2] = (16 * (x[3:-1] + x[1:-3]) - 30 * x[2:-2] - x[4:] - x[:-4]) / (12 * dt**2)
    return d


def motion_of(tracks: Sequence[Track], sensors: Sensors, kind: str) -> Motion:
    """The smooth motion of the stretches of a record."""
    dt = float(np.median(np.concatenate([np.full(len(p), p.dt) for p in tracks])))
    tracks = [_on(p, dt) for p in tracks]
    ends = np.cumsum([0, *(len(p) for p in tracks)])
    pieces = tuple(slice(int(a), int(b)) for a, b in pairwise(ends))
    joined = {k: np.concatenate([getattr(p, k) for p in tracks]) for k in ("t", "u", "ok")}
    run = np.concatenate([np.full(len(p), p.run) for p in tracks])
    theta, w, filtered = _measured(tracks, sensors)
    v_theta, v_w = sensors.noise.get("theta", 0.0) ** 2, np.inf
    if w is not None:
        size = float(np.ptp(w))
        v_w = max(sensors.noise["w"] / abs(sensors.gain), 1e-7 * size) ** 2
        v_w *= 1.0 + (0.5 * min((sensors.lag / dt) ** 2, 50.0) if filtered else 0.0)
    count = 0.0 if theta is None else quantum(theta)
    theta_or = theta
    if theta_or is None:
        assert w is not None
        theta_or = np.concatenate([np.cumsum(w[p]) * dt - 0.5 * w[p] * dt for p in pieces])
        v_theta = 50.0 * v_w * dt**2
    v_theta = max(v_theta, (1e-9 * float(np.ptp(theta_or))) ** 2)
    smoothing = _Smoothing(dt, pieces, joined["ok"], v_theta, v_w)
    lam, stiff = smoothing.as_noise_asks(theta_or, w)
    soft = smoothing.solve(theta_or, w, lam * SOFTER) if lam > SOFTER else stiff
    return Motion(
        dt=dt,
        pieces=pieces,
        run=run,
        t=np.arange(ends[-1]) * dt,
        stamp=joined["t"],
        ok=joined["ok"],
        u=joined["u"],
        theta=soft,
        w=np.concatenate([slope(soft[p], dt) for p in pieces]),
        path=_joined([stiff[p] for p in pieces]),
        pulse=smoothing.pulse(lam),
        shake=smoothing.shake(lam, w is not None),
        measured=(theta, w),
        variance=(v_theta if theta is not None else np.inf, v_w),
        filtered=filtered,
        count=count,
        motion=kind,
        d=np.concatenate([np.zeros(len(p)) if p.d is None else p.d for p in tracks]),
    )


def _joined(paths: Sequence[np.ndarray]) -> np.ndarray:
    """One path, each piece of it from where the last one ended."""
    made = [paths[0]]
    for x in paths[1:]:
        made.append(x - x[0] + made[-1][-1])
    return np.concatenate(made)


def _on(track: Track, dt: float) -> Track:
    """The stretch on steps of ``dt``, where its own step differs."""
    if abs(track.dt / dt - 1.0) < 1e-3:
        return track
    own = np.arange(len(track)) * track.dt
    at = np.arange(0.0, own[-1], dt)
    moved = {k: np.interp(at, own, getattr(track, k)) for k in ("u", "age")}
    both = {k: getattr(track, k) for k in ("theta", "w", "d")}
    moved |= {k: None if x is None else np.interp(at, own, x) for k, x in both.items()}
    ok = np.interp(at, own, track.ok.astype(float)) > 0.999
    return replace(track, dt=dt, t=track.t[0] + at, ok=ok, **moved)


def _measured(
    tracks: Sequence[Track], sensors: Sensors
) -> tuple[np.ndarray | None, np.ndarray | None, bool]:
    """theta, and w as dtheta/dt: without lag, gain and offset. None where it says nothing new."""
    theta, w = (
        None if getattr(tracks[0], k) is None else np.concatenate([getattr(p, k) for p in tracks])
        for k in ("theta", "w")
    )
    if theta is None and w is not None:
        return None, w - sensors.offset, False
    if theta is None or w is None or not sensors.use_w:
        return theta, None, False
    late = abs(sensors.lag) > 2e-4
    if sensors.one_source and not _jittered(tracks):
        return theta, None, False  # a difference of the encoder says nothing that it does not
    if late and quantum(theta) > 0 and not _jittered(tracks):
        return theta, None, False
    parts = []
    for p in tracks:
        assert p.w is not None
        v = p.w / sensors.gain - sensors.offset
        parts.append(v + sensors.lag * slope(v, p.dt) if late else v)
    return theta, np.concatenate(parts), late


def _jittered(tracks: Sequence[Track]) -> bool:
    """Whether the stamps were uneven: then the device's own clock made w better than theta."""
    return any(p.jitter > UNEVEN for p in tracks)


@dataclass(frozen=True, eq=False)
class _Smoothing:
    """Penalised least squares on both signals, stretch by stretch."""

    dt: float
    pieces: tuple[slice, ...]
    ok: np.ndarray
    v_theta: float
    v_w: float

    def as_noise_asks(self, theta: np.ndarray, w: np.ndarray | None) -> tuple[float, np.ndarray]:
        """From stiff to soft, until the residual is the noise."""
        x, lam = theta, STIFFNESSES[-1]
        for lam in STIFFNESSES:
            x = self.solve(theta, w, lam)
            e = _size((theta - x)[self.ok], self.v_theta)
            if w is not None:
                v = np.concatenate([slope(x[p], self.dt) for p in self.pieces])
                e = max(e, _size((w - v)[self.ok], self.v_w))
            if e < AS_NOISE:
                break
        return float(lam), x

    def solve(self, theta: np.ndarray, w: np.ndarray | None, lam: float) -> np.ndarray:
        made = np.empty_like(theta)
        for p in self.pieces:
            made[p] = self._one(theta[p], None if w is None else w[p], lam, self.ok[p])
        return made

    def _one(
        self, theta: np.ndarray, w: np.ndarray | None, lam: float, ok: np.ndarray
    ) -> np.ndarray:
        band = self._band(len(theta), lam, w is not None, ok)
        return solveh_banded(band, self._right(theta, w, ok))

    def _band(self, n: int, lam: float, with_w: bool, ok: np.ndarray) -> np.ndarray:
        """Upper bands of the normal equations (5, n)."""
        band = np.zeros((5, n))
        band[4] = np.where(ok, 1.0, 1e-6) / self.v_theta
        _add(band, THIRD, np.full(n - 3, lam / self.v_theta))
        if with_w:
            _add(band, SLOPE / self.dt, ok[2:-2] / self.v_w)
        return band

    def _right(self, theta: np.ndarray, w: np.ndarray | None, ok: np.ndarray) -> np.ndarray:
        right = np.where(ok, 1.0, 1e-6) / self.v_theta * theta
        if w is not None:
            for i, c in enumerate(SLOPE / self.dt):
                right[i : len(theta) - 4 + i] += c * w[2:-2] * ok[2:-2] / self.v_w
        return right

    def pulse(self, lam: float) -> np.ndarray:
        """What a unit impulse that theta and w both follow becomes."""
        longest = max(p.stop - p.start for p in self.pieces) // 6
        m = int(min(max(40, 12 * lam ** (1 / 6)), 4000, max(longest, 5)))
        ok = np.ones(2 * m + 1, bool)
        with_w = bool(np.isfinite(self.v_w))
        own = self._band(2 * m + 1, 0.0, with_w, ok)
        one = np.zeros(2 * m + 1)
        for i in range(min(5, m)):
            one[m - i] = one[m + i] = own[4 - i, m + i]
        made = solveh_banded(self._band(2 * m + 1, lam, with_w, ok), one)
        far = np.flatnonzero(np.abs(made) > FADED * np.abs(made).max())
        reach = max(m - far[0], far[-1] - m)
        made = made[m - reach : m + reach + 1]
        return made / made.sum()

    def shake(self, lam: float, with_w: bool) -> np.ndarray:
        """Second derivative of smoothed white noise of both sensors."""
        rng, made = np.random.default_rng(1), np.zeros(len(self.ok))
        for p in self.pieces:
            n = p.stop - p.start
            theta = rng.standard_normal(n) * self.v_theta**0.5
            w = rng.standard_normal(n) * self.v_w**0.5 if with_w else None
            made[p] = bend(self._one(theta, w, lam, np.ones(n, bool)), self.dt)
        return made


def _add(band: np.ndarray, stencil: np.ndarray, weight: np.ndarray) -> None:
    """Add sum of weight (stencil x)^2 to the upper bands."""
    n = band.shape[1]
    for i in range(len(stencil)):
        for j in range(i, len(stencil)):
            band[4 - (j - i), j : n - len(stencil) + 1 + j] += stencil[i] * stencil[j] * weight


def _size(e: np.ndarray, variance: float) -> float:
    return float(np.mean(np.minimum(e**2 / variance, OUTLIER)))


def spline(x: np.ndarray) -> np.ndarray:
    """Coefficients of the cubic spline through x, with EDGE more on each side."""
    from scipy.ndimage import spline_filter1d  # slow to import

    return spline_filter1d(np.pad(x, EDGE, mode="edge"), 3, mode="nearest")


def shifted(c: np.ndarray, by: float) -> np.ndarray:
    """The spline ``by`` samples later, the first and last value held."""
    n, whole = len(c) - 2 * EDGE, int(np.floor(by))
    s = 1.0 - (by - whole)  # after the earlier of the samples in the middle
    weights = ((1 - s) ** 3, 4 - 6 * s**2 + 3 * s**3, 1 + 3 * s + 3 * s**2 - 3 * s**3, s**3)
    held = np.pad(c, abs(whole) + 2, mode="edge")
    first = EDGE + abs(whole) - whole
    parts = [k / 6 * held[first + i : first + i + n] for i, k in enumerate(weights)]
    return parts[0] + parts[1] + parts[2] + parts[3]
