"""Rows of the weak form: smooth windows over the log, as narrow as the noise allows.

Every signal x(t) becomes means K x over windows; the torque is also sent through what the smoothing
did to the motion. Errors in the acceleration take inertia away, less so in wider windows: where it
is not declared, windows are as narrow as those that agree on it with wider ones.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy import ndimage
from scipy.sparse import block_diag, csr_matrix

from ..core.errors import Refused
from ..core.numeric import rms
from ..core.regression import TINY, Prior, normal_equations, robust, weight
from . import constants as const
from .motion import Motion, SmoothRuns, bump


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


class _Windows:
    """The windows of the runs of one rate."""

    def __init__(self, runs: SmoothRuns, h: float, top: float, sparser: int = 1) -> None:
        samples, n, half = runs.samples, len(runs.samples), max(2, round(h / runs.dt))
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
            K @ (np.abs(runs.w) < const.AT_REST * top) < const.MUCH
        )
        if not samples.ok.all():
            keep &= K @ (~samples.ok).astype(float) < 1e-9
        self.at, self.K, self.step = at[keep], K[keep], step * runs.dt
        self.reach = len(kernel) // 2 * runs.dt
        self.narrow = averages(phi, self.at, n)
        self.smear = np.full(n * runs.between, 3 * noise + 1e-12)


class Rows:
    """The rows that are used, of windows of half-width ``h`` (s). ``K`` (m, n) averages a signal as
    the motion was averaged, ``narrow`` what is linear in the smooth motion. ``w``, ``a`` are speeds
    and accelerations at times ``t`` (m,), ``shake`` their noise; near the speed ``smear`` reversals
    are blurred; a window looks to each side as far as ``reach`` (s)."""

    def __init__(self, motion: Motion, h: float) -> None:
        self.h, total = h, sum(len(r.w) * r.dt for r in motion.runs)
        sparser = max(1, int(np.ceil(total / (const.OVERLAP * h * const.ENOUGH))))
        parts = [_Windows(r, h, motion.top, sparser) for r in motion.runs]
        first = [at.start for at in motion.at]
        self.at = np.concatenate([p.at + a for p, a in zip(parts, first, strict=True)])
        if len(self.at) < const.LEAST_ROWS:
            raise Refused(
                f"the drive moves in {len(self.at)} windows of {2e3 * h:.3g} ms; "
                f"{const.LEAST_ROWS} are needed.",
                "Record a longer run in which the drive moves.",
            )
        one = len(parts) == 1
        self.K: Any = parts[0].K if one else block_diag([p.K for p in parts], "csr")
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
        """The same without some rows."""
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
        self.h, self.declared = h, declared
        direction = np.tanh(motion.w / max(const.STANDS * motion.top, 1e-12))
        late, none = motion.slope(motion.u), np.ones(len(motion))
        signals = np.column_stack([direction, motion.w, none, late, declared.place])
        X, y, moves, variance, thin, t = [], [], [], [], [], []
        for run, at in zip(motion.runs, motion.at, strict=True):
            a, own, K, middle = self._windows(run)
            t.append(motion.elapsed[at][middle])
            X.append(np.column_stack([a, K @ signals[at]]))
            y.append(K @ motion.u[at])
            moves.append(K @ np.abs(motion.w[at]) > const.STANDS * motion.top)
            variance.append(np.full(len(a), own))
            thin.append(a[::2])  # windows that share no sample
        moving = np.concatenate(moves)
        self.enough = bool(moving.sum() >= 3 * signals.shape[1] + 3)
        if self.enough:
            noise, self.t = np.concatenate(variance)[moving], np.concatenate(t)[moving]
            self._robust(np.concatenate(X)[moving], np.concatenate(y)[moving], noise)
            self._judge(motion, float(noise.mean()), np.concatenate(thin))

    def _windows(self, runs: SmoothRuns) -> tuple:
        """Acceleration, its noise (variance), averages and centres of the windows of one rate."""
        samples, s, dt = runs.samples, runs.sensors, runs.dt
        half = max(2, round(self.h / dt))
        phi = bump(half)
        at = centres(samples.pieces, half, max(1, int(const.OVERLAP * half)))
        K = averages(phi, at, len(samples))
        of_theta = s.theta_variance * float(np.sum((np.convolve(phi, [1, -2, 1]) / dt**2) ** 2))
        of_w = np.inf
        if s.w is not None:  # a filtered difference of theta tells little more than theta
            of_w = s.w_variance * float(np.sum((np.convolve(phi, [0.5, 0, -0.5]) / dt) ** 2))
            of_w = max(of_w, 0.25 * of_theta) if s.filtered else of_w
        variance = 1 / (1 / of_theta + 1 / of_w)
        a = np.zeros(len(at))
        if s.theta is not None:
            a += variance / of_theta * (K @ np.r_[0, np.diff(s.theta, 2), 0]) / dt**2
        if s.w is not None:
            a += variance / of_w * (K @ runs.slope(s.w))
        return a, variance, K, at

    def _robust(self, X: np.ndarray, y: np.ndarray, noise: np.ndarray) -> None:
        k, size, scale = np.ones(len(y)), np.sqrt(np.mean(X**2, axis=0)) + TINY, 1.0
        X, prior = X / size, Prior.free(len(size))
        for _ in range(6):
            fit = robust(X, y, prior, scale, 0.0, k, 1)
            r = fit.r * scale
            scale = 1.5 * float(np.median(np.abs(r))) + TINY
            k = weight(r / scale)
        self._X, self._b, self.r, self._scale, self._size = X, fit.b, r, scale, size
        G, _ = normal_equations(X, y, k, prior, scale, 0.0)
        self._inverse = np.linalg.inv(G)
        self.rms = rms(y) + TINY
        told = self._inverse[0, 0] / size[0] ** 2
        self.J = float(self._b[0] / size[0])
        self.error = float(self._scale * np.sqrt(self._memory * told))
        self.lost = float(noise.mean() * k.sum() * told)
        self.residual = rms(self.r)
        self.left = self.residual / self.rms

    @cached_property
    def _memory(self) -> float:
        """Rows that tell as much as one that knows nothing of its neighbours."""
        r = self.r
        power = float(np.mean(r * r)) + TINY
        c = [float(np.mean(r[j:] * r[:-j])) / power for j in range(1, 8)]
        return 1 + 2 * sum(max(0.0, one) for one in c)

    def _judge(self, motion: Motion, variance: float, thin: np.ndarray) -> None:
        b, size, w = self._b, self._size, np.abs(motion.w)
        friction = rms(self._X[:, 1:3] @ b[1:3]) + 1e-12 * self.rms
        work = b[1] / size[1] * np.mean(w) + b[2] / size[2] * np.mean(motion.w**2)
        self.drag = float(work / (self.rms * np.mean(w) + TINY))
        place = b[5:]  # gravity that is large, and certain beside everything that is linear
        chi2 = place @ np.linalg.solve(self._inverse[5:, 5:], place)
        certain = chi2 / (self._scale**2 * self._memory + TINY) > 50
        large = rms(self._X[:, 5:] @ place) > const.PART * friction
        self.heavy = self.declared.weight and bool(certain and large)
        J, Fc = self.declared.J, self.declared.Fc
        if J is not None and np.ptp(motion.u) == 0:  # coasting: friction is what J a is
            friction = J * size[0]
        small = const.FAINT * (Fc or max(friction, 0.1 * np.std(motion.u)))
        if J is None:
            J, small = max(self.J, 0.0), max(small, const.PART * self.residual)
        noise = np.sqrt(variance)
        if self.declared.J is not None and len(thin) > 2:  # what is shown where it is calm
            calm = np.quantile(np.abs(np.diff(thin, 2)), 0.15) / 0.189 / 2.45
            noise = max(noise, 0.5 * calm)
        self.noisy = float(J * noise / max(small, TINY))


class Width:
    """The narrowest windows that will do: ``h`` (s), with the residuals ``r`` (m,) of a plain
    balance at ``t`` (s). ``sure``: the log determines the inertia; ``range``: what it must lie in,
    None where it is free; ``impossible``: the torque follows the motion, or has the wrong sign;
    ``against``: nothing of the declared inertia is in it; ``heavy``: gravity that is large.
    """

    def __init__(self, motion: Motion, declared: Declared) -> None:
        self.motion, self.declared, self.sure = motion, declared, True
        longest = max((at.stop - at.start) * dt for at, dt in motion.pieces)
        few = 3 * max(r.dt for r in motion.runs)
        grid = sorted({max(h, few) for h in const.WIDTHS if 8 * max(h, few) < longest}) or [few]
        self.range: tuple[float, float] | None = None
        self.tried: list[Probe] = []
        self._try(grid, declared.J is not None)
        if not self.tried:
            raise Refused(
                "too few windows in which something moves.",
                "Record a longer run in which the drive moves.",
            )
        good = [p for p in self.tried if self._calm(p) and p.lost < const.LITTLE]
        good = self._undeclared(good) if declared.J is None else self._declared(grid, good)
        last = self.tried[-5:]
        self.impossible = all(p.J < -3 * p.error for p in last) and last[-1].drag < const.LITTLE
        # a balance that explains all else excludes the declared inertia, and finds none
        least = const.LITTLE * (declared.J or 0.0)
        self.against = all(
            p.left < const.LITTLE and p.J < 3 * p.error and p.J + 3 * p.error < least
            for p in self.tried
        )
        p = good[0] if good else min(self.tried, key=self._cost)
        if not self.sure:  # waves over the angle want narrow windows
            p = next((q for q in self.tried if q.noisy < 3), p)
        self.h, self.heavy, self.t, self.r = p.h, p.heavy, p.t, p.r

    def _try(self, grid: list[float], stop: bool) -> None:
        for h in grid:
            p = Probe(self.motion, h, self.declared)
            if not p.enough:
                continue
            self.tried.append(p)
            if stop and p.lost < const.LITTLE and self._calm(p):
                break

    def _calm(self, p: Probe) -> bool:
        return p.noisy < 1 or self.declared.J is not None and p.h > const.SLOW

    def _cost(self, p: Probe) -> float:
        return max(p.noisy, p.lost / const.LITTLE, 1.0 - 0.5 * (p.h < 0.1))

    def _declared(self, grid: list[float], good: list[Probe]) -> list[Probe]:
        """A declared inertia is held where the log does not tell it; where narrow windows lose it
        to noise, wider ones are asked as if it was not declared."""
        J, p = self.declared.J, good[0] if good else self.tried[-1]
        assert J is not None
        lost = p.J + 3 * p.error < 0.7 * J
        if lost or not any(q.error < const.PART * J for q in self.tried):
            self._try([h for h in grid if h > self.tried[-1].h], False)
            wide = self._undeclared(self.tried)
            if self.sure:
                return wide
            self.range = J / const.GROWN, const.GROWN * J
        return good

    def _undeclared(self, good: list[Probe]) -> list[Probe]:
        known = [p for p in self.tried if p.J > 0 and p.error < const.PART * p.J]
        told = [p for p in known if p.error < 0.15 * p.J]

        def lost(p: Probe) -> float:
            """What wider windows say that this one loses, as a share of J."""
            best = max(
                (q.J - q.error for q in told if p.h <= q.h < const.SEVERAL * p.h), default=0.0
            )
            return 1 - p.J / best if best > 0 else 0.0

        good = [p for p in good if p in known and lost(p) < const.LITTLE]
        self.sure = bool(good and told) and known[-1].J - 2 * known[-1].error < 1.2 * good[0].J
        if self.sure:
            first = good[0]
            near = [p.J for p in known if first.h <= p.h < const.SEVERAL * first.h]
            half = max(3 * first.error, float(np.ptp(near)), const.LITTLE * first.J)
            if half < const.PART * first.J:
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
    n = np.arange(1, const.FINEST_ORDER + 1)
    n = n[(n * speed * motion.dt < 1.2) & (n * speed * h > 5)]
    if not len(n):
        return 0.0
    turn, r, power = np.exp(1j * th), r - r.mean(), np.var(r) + TINY
    wave, part = turn ** n[0], []
    for _ in n:
        part.append(2 * abs(np.mean(r * wave)) ** 2 / power)
        wave = wave * turn
    best = int(np.argmax(part))
    clear = part[best] > const.MUCH and part[best] > 20 * np.median(part)
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
