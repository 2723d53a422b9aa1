"""Rows of the weak form: smooth windows over the log, as narrow as the noise allows.

Every signal x(t) becomes means K x over windows; those of the torque are also sent through what
the smoothing did to the motion.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy

import numpy as np
from scipy.sparse import block_diag, csr_matrix

from ..core.errors import Refused
from .constants import AT_REST, LEAST_ROWS, MOST_ROWS, SPARSEST, STILL
from .motion import Motion, SmoothRuns

OVERLAP = 0.55  # of the half-width: distance of neighbouring windows
FEW = 80  # windows: fewer overlap more


def bump(half: int) -> np.ndarray:
    """Weights (2 half + 1,) of a window: smooth, positive, sum 1."""
    phi = (1 - (np.arange(-half, half + 1) / (half + 1)) ** 2) ** 3
    return phi / phi.sum()


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
    """Half-width in samples of a window of half-width h (s)."""
    return max(2, int(round(h / dt)))


class _Windows:
    """The windows of the runs of one rate."""

    def __init__(self, runs: SmoothRuns, h: float, top: float, sparser: int = 1) -> None:
        samples, n, half = runs.samples, len(runs.samples), half_samples(h, runs.dt)
        phi, soft = bump(half), len(runs.pulse) > 3
        kernel = np.convolve(phi, runs.pulse) if soft else phi
        width = max(half, 0.8 * 3.53 * runs.spread) if soft else half
        step = max(1, int(OVERLAP * width)) * sparser
        at = centres(samples.pieces, len(kernel) // 2, step)
        if len(at) <= LEAST_ROWS + 10 and soft:  # too short for all of the pulse
            kernel, step = phi, max(1, int(OVERLAP * half))
            at = centres(samples.pieces, half, step)
        if len(at) < FEW:
            step = max(1, step // 2)
            at = centres(samples.pieces, len(kernel) // 2, step)
        K = averages(kernel, at, n)
        noise, slow = self._slowest(runs, h, half, top)
        keep = (K @ np.abs(runs.w) > slow) & (K @ (np.abs(runs.w) < AT_REST * top) < STILL)
        if not samples.ok.all():
            keep &= K @ (~samples.ok).astype(float) < 1e-9
        self.at, self.K, self.step = at[keep], K[keep], step * runs.dt
        self.reach = len(kernel) // 2 * runs.dt
        self.narrow = averages(phi, self.at, n)
        self.smear = np.full(n * runs.between, 3 * noise + 1e-12)

    def _slowest(self, runs: SmoothRuns, h: float, half: int, top: float) -> tuple[float, float]:
        """Noise of the speed in a window, and the speed that a row must have: at rest friction is
        anything."""
        s = runs.sensors
        variance = s.w_variance if s.w is not None else np.inf
        noise = float(np.sqrt(min(s.theta_variance * 2 / h**2, variance) / half))
        return noise, max(AT_REST * top, 3 * noise, 0.5 * s.count / h)


class Rows:
    """The rows that are used, of windows of half-width ``h`` (s).

    ``K`` (m, n) averages a signal as the motion was averaged, ``narrow`` (m, n) what is linear in
    the smooth motion. ``t`` (m,) are times from the start, ``w`` the speeds, ``a`` the
    accelerations, ``shake`` their noise; ``smear`` (between samples) is the speed near which a
    reversal is blurred, ``reach`` (s) how far a window looks to each side.
    """

    def __init__(self, motion: Motion, h: float) -> None:
        sparser = -(-round(sum(len(r.w) * r.dt for r in motion.runs) / (OVERLAP * h)) // MOST_ROWS)
        self.h = h = h * max(1.0, sparser / SPARSEST)
        parts = [_Windows(r, h, motion.top, min(sparser, SPARSEST)) for r in motion.runs]
        first = [at.start for at in motion.at]
        self.at = np.concatenate([p.at + a for p, a in zip(parts, first, strict=True)])
        if len(self.at) < LEAST_ROWS:
            raise Refused(
                f"the drive moves in {len(self.at)} windows of {2e3 * h:.3g} ms; "
                f"{LEAST_ROWS} are needed.",
                "Record a longer run in which the drive moves.",
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
        """The same without some rows."""
        made = copy(self)
        for key in ("at", "K", "narrow", "t", "w", "a", "shake"):
            setattr(made, key, getattr(self, key)[mask])
        return made
