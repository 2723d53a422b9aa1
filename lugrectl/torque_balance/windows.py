"""Rows of the weak form: smooth windows over the log, as narrow as the noise allows.

Every signal x(t) becomes means K x over windows; those of the torque are also sent through what
the smoothing did to the motion. Errors in the acceleration take inertia away, and less so in wider
windows. Where no inertia is declared, windows are as narrow as those that agree on it with wider
ones.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass

import numpy as np
from scipy import ndimage
from scipy.sparse import block_diag, csr_matrix

from ..core.errors import Refused
from ..core.numeric import rms
from ..core.regression import Prior, normal_equations
from . import constants as const
from .motion import Motion, SmoothRuns, bump, by_own_scale, slope

LONGER = "Record a longer run in which the drive moves."


def centres(pieces: Sequence[slice], reach: int, step: int) -> np.ndarray:
    """Centres of windows that never cross two pieces."""
    return np.concatenate(
        [np.arange(p.start + reach + 2, p.stop - reach - 2, step) for p in pieces]
    ).astype(int)


def averages(kernel: np.ndarray, at: np.ndarray, n: int) -> csr_matrix:
    """Sparse matrix (len(at), n) whose rows are the kernel around the centres."""
    reach = len(kernel) // 2
    columns = (at[:, None] + np.arange(-reach, reach + 1)).ravel()
    ends = np.arange(len(at) + 1) * len(kernel)
    return csr_matrix((np.tile(kernel, len(at)), columns, ends), (len(at), n))


def half_samples(h: float, dt: float) -> int:
    return max(2, int(round(h / dt)))


class _Windows:
    def __init__(self, runs: SmoothRuns, h: float, top: float, sparser: int = 1) -> None:
        samples, n, half = runs.samples, len(runs.samples), half_samples(h, runs.dt)
        phi, soft = bump(half), len(runs.pulse) > 3
        kernel = np.convolve(phi, runs.pulse) if soft else phi
        width = max(half, 0.8 * 3.53 * runs.spread) if soft else half
        step = max(1, int(const.OVERLAP * width)) * sparser
        at = centres(samples.pieces, len(kernel) // 2, step)
        if len(at) <= const.LEAST_ROWS + 10 and soft:  # too short for all of the pulse
            kernel, step = phi, max(1, int(const.OVERLAP * half))
            at = centres(samples.pieces, half, step)
        if len(at) < const.FEW_WINDOWS:
            step = max(1, step // 2)
            at = centres(samples.pieces, len(kernel) // 2, step)
        K, s = averages(kernel, at, n), runs.sensors
        variance = min(s.theta_variance * 2 / h**2, np.inf if s.w is None else s.w_variance)
        noise = float(np.sqrt(variance / half))  # of the speed in a window
        slow = max(
            const.AT_REST * top, 3 * noise, 0.5 * s.count / h
        )  # at rest friction is anything
        keep = (K @ np.abs(runs.w) > slow) & (
            K @ (np.abs(runs.w) < const.AT_REST * top) < const.STILL
        )
        if not samples.ok.all():
            keep &= K @ (~samples.ok).astype(float) < 1e-9
        self.at, self.K, self.step = at[keep], K[keep], step * runs.dt
        self.reach = len(kernel) // 2 * runs.dt
        self.narrow = averages(phi, self.at, n)
        self.smear = np.full(n * runs.between, 3 * noise + 1e-12)


class Rows:
    """The rows that are used, of windows of half-width ``h`` (s).

    ``K`` (m, n) averages a signal as the motion was averaged, ``narrow`` (m, n) what is linear in
    the smooth motion. ``t`` (m,) are times from the start, ``w`` the speeds, ``a`` the
    accelerations, ``shake`` their noise; ``smear`` (between samples) is the speed near which a
    reversal is blurred, ``reach`` (s) how far a window looks to each side.
    """

    def __init__(self, motion: Motion, h: float) -> None:
        sparser = -(
            -round(sum(len(r.w) * r.dt for r in motion.runs) / (const.OVERLAP * h))
            // const.MOST_ROWS
        )
        self.h = h = h * max(1.0, sparser / const.SPARSEST)
        parts = [_Windows(r, h, motion.top, min(sparser, const.SPARSEST)) for r in motion.runs]
        first = [at.start for at in motion.at]
        self.at = np.concatenate([p.at + a for p, a in zip(parts, first, strict=True)])
        if len(self.at) < const.LEAST_ROWS:
            raise Refused(
                f"the drive moves in {len(self.at)} windows of {2e3 * h:.3g} ms; "
                f"{const.LEAST_ROWS} are needed.",
                LONGER,
            )
        one = len(parts) == 1
        self.K = parts[0].K if one else block_diag([p.K for p in parts], "csr")
        self.narrow = parts[0].narrow if one else block_diag([p.narrow for p in parts], "csr")
        self.step, self.reach = min(p.step for p in parts), max(p.reach for p in parts)
        self.smear = np.concatenate([p.smear for p in parts])
        self.t, self.w = motion.elapsed[self.at], np.abs(motion.w[self.at])
        self.a, self.shake = self.narrow @ motion.acceleration, self.narrow @ motion.shake

    def __len__(self) -> int:
        return len(self.at)

    @property
    def passed(self) -> float:
        """The way that half a window passes, rad."""
        return float(np.median(self.w)) * self.h

    def only(self, mask: np.ndarray) -> Rows:
        made = copy(self)
        for key in ("at", "K", "narrow", "t", "w", "a", "shake"):
            setattr(made, key, getattr(self, key)[mask])
        return made


@dataclass(frozen=True, eq=False)
class Declared:
    """What is declared of the drive, and what every plain balance has beside friction."""

    J: float | None
    Fc: float | None
    place: np.ndarray  # columns (n, k) of gravity, or of a spring
    weight: bool  # it is gravity


class Probe:
    """A quick robust balance in windows of half-width ``h`` (s): what it says of the inertia.

    ``J`` with its standard ``error``, ``lost`` the share of it that noise takes away, ``noisy`` the
    noise of J a over what is small enough, ``left`` the residual over all torque, ``drag`` the
    share of the torque by which friction opposes the motion, ``r`` (m,) the residuals at ``t`` (s).
    """

    def __init__(self, motion: Motion, h: float, declared: Declared) -> None:
        self.h, self.declared, m = h, declared, motion
        direction, one = np.tanh(m.w / max(0.01 * m.top, 1e-12)), np.ones(len(m))
        plain = np.column_stack([direction, m.w, one, m.slope(m.u), declared.place])
        signals = np.column_stack([plain, m.u, np.abs(m.w), m.elapsed])
        rows = [_accelerations(r, h, signals[at]) for r, at in zip(m.runs, m.at, strict=True)]
        # what the acceleration itself shows where it is calm, in every other window
        bends = np.abs(np.diff(np.concatenate([x[::2, 0] for x in rows]), 2))
        self.calm = float(np.quantile(bends, 0.15)) / 0.189 / 2.45 if len(bends) else 0.0
        every = np.concatenate(rows)
        every = every[every[:, -2] > 0.01 * m.top]
        X, (noise, y, _, self.t) = every[:, :-4], every[:, -4:].T
        self.enough = len(X) >= 3 * X.shape[1]
        if self.enough:
            self._fit(X, y, noise)
            self._judge(m, float(noise.mean()))

    def _fit(self, X: np.ndarray, y: np.ndarray, noise: np.ndarray) -> None:
        size = np.sqrt(np.mean(X**2, axis=0)) + 1e-300
        X, prior = X / size, Prior.free(len(size))
        b, r, k, scale = by_own_scale(X, y)
        self._X, self._b, self.r, self._size = X, b, r, size
        power = float(np.mean(r * r)) + 1e-300
        alike = [float(np.mean(r[j:] * r[:-j])) / power for j in range(1, 8)]
        memory = 1 + 2 * sum(max(0.0, one) for one in alike)  # rows that tell as much as one
        inverse = np.linalg.inv(normal_equations(X, y, k, prior, scale, 0.0)[0])
        told, place = inverse[0, 0] / size[0] ** 2, b[5:]
        self._V = inverse * (scale**2 * memory + 1e-300)
        self.J, self.error = float(b[0] / size[0]), float(self._V[0, 0] ** 0.5 / size[0])
        self.lost = float(noise.mean() * k.sum() * told)
        self.residual, self.rms = rms(r), rms(y) + 1e-300
        self.left = self.residual / self.rms
        # gravity that is certain beside everything that is linear
        self.heavy = bool(place @ np.linalg.solve(self._V[5:, 5:], place) > 50)

    def _judge(self, motion: Motion, variance: float) -> None:
        b, size, w, known = self._b, self._size, np.abs(motion.w), self.declared
        friction = rms(self._X[:, 1:3] @ b[1:3]) + 1e-12 * self.rms
        work = b[1] / size[1] * np.mean(w) + b[2] / size[2] * np.mean(motion.w**2)
        self.drag = float(work / (self.rms * np.mean(w) + 1e-300))
        self.heavy &= known.weight and rms(self._X[:, 5:] @ b[5:]) > const.HEAVY * friction
        J = max(self.J, 0.0) if known.J is None else known.J
        if known.J is not None and np.ptp(motion.u) == 0:  # coasting: friction is what J a is
            friction = J * size[0]
        small = const.NOISY * (known.Fc or max(friction, 0.1 * np.std(motion.u)))
        small = max(small, 0.3 * self.residual * (known.J is None), 1e-100)
        shown = 0.5 * self.calm * (known.J is not None)
        self.noisy = float(J * max(np.sqrt(variance), shown) / small)


def _accelerations(runs: SmoothRuns, h: float, signals: np.ndarray) -> np.ndarray:
    """In windows of the runs of one rate: the acceleration without smoothing, the means of signals
    (n, k), of which the last three stand behind the variance of the acceleration's noise."""
    samples, s, dt = runs.samples, runs.sensors, runs.dt
    half = half_samples(h, dt)
    phi = bump(half)
    of_theta = s.theta_variance * float(np.sum((np.convolve(phi, [1, -2, 1]) / dt**2) ** 2))
    of_w = s.w_variance * float(np.sum((np.convolve(phi, [0.5, 0, -0.5]) / dt) ** 2))
    of_w = np.inf if s.w is None else of_w
    if s.filtered:  # a filtered difference of theta tells little more than theta
        of_w = max(of_w, 0.25 * of_theta)
    variance = 1 / (1 / of_theta + 1 / of_w)
    at = centres(samples.pieces, half, max(1, int(const.OVERLAP * half)))
    K = averages(phi, at, len(samples))
    a = np.zeros(len(at))
    if s.theta is not None:
        a += variance / of_theta * (K @ np.r_[0, np.diff(s.theta, 2), 0]) / dt**2
    if s.w is not None:
        a += variance / of_w * (K @ runs.each(slope, s.w))
    means = K @ signals
    return np.column_stack([a, means[:, :-3], np.full(len(a), variance), means[:, -3:]])


class Width:
    """The narrowest windows that will do: ``h`` (s), with the residuals ``r`` (m,) of a plain
    balance at ``t`` (s).

    ``sure`` says that the log determines the inertia, ``range`` is what it must lie in, None where
    it is free. ``impossible``: the torque follows the motion, or has the wrong sign; ``against``:
    nothing of the declared inertia is in it. ``heavy``: gravity that is large.
    """

    def __init__(self, motion: Motion, declared: Declared) -> None:
        self.motion, self.declared, J = motion, declared, declared.J
        longest = max((at.stop - at.start) * dt for at, dt in motion.pieces)
        few = 3 * max(r.dt for r in motion.runs)
        grid = sorted({max(h, few) for h in const.WIDTHS if 8 * max(h, few) < longest}) or [few]
        self.sure, self.range = True, None
        self.tried: list[Probe] = []
        self._try(grid, J is not None)
        if not self.tried:
            raise Refused("too few windows in which something moves.", LONGER)
        good = [p for p in self.tried if self._calm(p) and p.lost < const.LOST]
        good = self._undeclared(good) if J is None else self._declared(J, grid, good)
        last = self.tried[-5:]
        self.impossible = all(p.J < -3 * p.error for p in last) and last[-1].drag < 0.05
        # a balance that explains all else excludes the declared inertia, and finds none
        self.against = all(
            p.left < const.LOST and p.J < 3 * p.error and p.J + 3 * p.error < const.LOST * (J or 0)
            for p in self.tried
        )
        p = good[0] if good else min(self.tried, key=lambda p: max(p.noisy, p.lost / const.LOST))
        if not self.sure:  # waves over the angle want narrow windows
            p = next((q for q in self.tried if q.noisy < 3), p)
        self.h, self.heavy, self.t, self.r = p.h, p.heavy, p.t, p.r

    def _try(self, grid: list[float], stop: bool) -> None:
        for p in (Probe(self.motion, h, self.declared) for h in grid):
            if not p.enough:
                continue
            self.tried.append(p)
            if stop and p.lost < const.LOST and self._calm(p):
                break

    def _calm(self, p: Probe) -> bool:
        return p.noisy < 1 or self.declared.J is not None and p.h > const.WIDE

    def _declared(self, J: float, grid: list[float], good: list[Probe]) -> list[Probe]:
        """A declared inertia is held where the log does not tell it; where narrow windows lose it
        to noise, wider ones are asked as if it was not declared."""
        p = good[0] if good else self.tried[-1]
        if p.J + 3 * p.error < 0.7 * J or not any(q.error < 0.3 * J for q in self.tried):
            self._try([h for h in grid if h > self.tried[-1].h], False)
            wide = self._undeclared(self.tried)
            if self.sure:
                return wide
            self.range = J / 1.4, 1.4 * J
        return good

    def _undeclared(self, good: list[Probe]) -> list[Probe]:
        """Those that agree on an inertia with wider ones."""
        known = [p for p in self.tried if p.J > 0 and p.error < 0.3 * p.J]
        told = [p for p in known if p.error < 0.15 * p.J]

        def near(p: Probe, probes: list[Probe]) -> list[Probe]:
            return [q for q in probes if p.h <= q.h < const.SEVERAL * p.h]

        def loses(p: Probe) -> bool:
            best = max((q.J - q.error for q in near(p, told)), default=0.0)
            return best > 0 and p.J <= (1 - const.LOST) * best

        good = [p for p in good if p in known and not loses(p)]
        self.sure = bool(good and told) and known[-1].J - 2 * known[-1].error < 1.2 * good[0].J
        if self.sure:
            first = good[0]
            spread = float(np.ptp([p.J for p in near(first, known)]))
            half = max(3 * first.error, spread, 0.05 * first.J)
            if half < 0.3 * first.J:
                self.range = first.J - half, first.J + half
        return good


def fine_wave(motion: Motion, h: float) -> float:
    """Waves per radian of the strongest wave over the angle that windows of h would hide, of a
    drive that turns steadily; 0 where there is none."""
    steady = _steady_parts(motion) if motion.span >= 2 * np.pi else []
    if not steady:
        return 0.0
    wide = max(3, int(2 * h / motion.dt))
    fast, theta, w = [], [], []
    for at, on in steady:
        u = motion.u[at]
        fast.append((u - ndimage.uniform_filter1d(u, wide, mode="nearest"))[on])
        theta.append(motion.theta[at][on])
        w.append(motion.w[at][on])
    r, th = (np.concatenate(x)[: const.ENOUGH] for x in (fast, theta))
    speed = float(np.median(np.abs(np.concatenate(w))))
    n = np.arange(1, const.ORDERS + 1)
    n = n[(n * speed * motion.dt < 1.2) & (n * speed * h > 5)]
    if not len(n):
        return 0.0
    turn, r, power = np.exp(1j * th), r - r.mean(), np.var(r) + 1e-300
    wave, part = turn ** n[0], []
    for _ in n:
        part.append(2 * abs(np.mean(r * wave)) ** 2 / power)
        wave = wave * turn
    best = int(np.argmax(part))
    clear = part[best] > const.FINE_WAVE and part[best] > 20 * np.median(part)
    return float(n[best]) if clear else 0.0


def _steady_parts(motion: Motion) -> list[tuple[slice, np.ndarray]]:
    """The pieces that turn at about one speed, with the samples that do; none unless most do."""
    keep = []
    for at, _ in motion.pieces:
        w = np.median(motion.w[at])
        on = np.abs(motion.w[at] - w) < 0.5 * abs(w)
        if on.mean() > 0.6:
            keep.append((at, on))
    return keep if sum(on.sum() for _, on in keep) >= 0.6 * len(motion) else []
