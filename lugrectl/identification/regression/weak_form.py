"""Rows of the weak form: means of torque, acceleration and terms with one test function.

A row is the integral of phi(t - t_i) x(t) with phi = (1 - s^2)^3 over a half-width h. Torque and
terms have gone through the smoothing S as well, so their test function is phi * s.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_matrix

from ...core.numeric import rms
from .numbers import LOST, NOISE, STILL, WIDTHS
from .smooth_motion import Motion

APART = 0.55  # distance of two rows, in half-widths
AT_REST = 0.1  # share of rest in a row from which on it says nothing of friction
NARROW = 0.036  # s, the widest row while a declared J says what noise costs
FEWEST = 40  # rows


@dataclass(frozen=True, eq=False)
class Rows:
    """The windows of one half-width ``h``, m rows.

    ``K`` (m, n) takes samples to rows through the smoothing, ``narrow`` those that come from the
    smooth motion already. ``a`` is the acceleration, ``shake`` its noise in one draw, ``t`` the
    times; ``rough`` is the noise of the speed in a row, ``wide`` the half-width of K in s where it
    has half its height. Rows near rest are left out: there
    friction may be anything.
    """

    h: float
    K: csr_matrix
    narrow: csr_matrix
    at: np.ndarray
    step: float
    t: np.ndarray
    a: np.ndarray
    shake: np.ndarray
    rough: float
    wide: float

    def __len__(self) -> int:
        return len(self.at)


@dataclass(frozen=True)
class Width:
    """A quick balance in windows of one half-width ``h``.

    J with its standard error ``se``; ``lost``: the share of J that noise takes; ``noisy``: that
    noise over what is allowed; ``heavy``: gravity moves much of the torque; ``left`` of it.
    """

    h: float
    J: float
    se: float
    lost: float
    noisy: float
    left: float
    heavy: bool
    driven: float


def bump(half: int) -> np.ndarray:
    """The test function, of sum 1, over ``half`` samples on each side."""
    k = (1 - (np.arange(-half, half + 1) / (half + 1)) ** 2) ** 3
    return k / k.sum()


def operator(k: np.ndarray, at: np.ndarray, n: int) -> csr_matrix:
    """The matrix (len(at), n) that weighs the samples around ``at`` with k."""
    reach = len(k) // 2
    where = (at[:, None] + np.arange(-reach, reach + 1)).ravel()
    return csr_matrix((np.tile(k, len(at)), where, np.arange(len(at) + 1) * len(k)), (len(at), n))


def widths(m: Motion) -> list[float]:
    """The half-widths that the record allows, s."""
    longest = max(p.stop - p.start for p in m.pieces) * m.dt
    return [h for h in WIDTHS if h >= 3 * m.dt and 8 * h < longest] or [3 * m.dt]


def spacing(m: Motion, h: float) -> int:
    """Samples between two rows."""
    spread = 3.53 / _half_response(m.pulse) if len(m.pulse) > 3 else 0.0
    return max(1, int(APART * max(2, round(h / m.dt), 0.8 * spread)))


def rows_of(m: Motion, h: float) -> Rows:
    """The rows of half-width ``h``, through the smoothing."""
    half = max(2, round(h / m.dt))
    phi = bump(half)
    wide = np.convolve(phi, m.pulse) if len(m.pulse) > 3 else phi
    step = spacing(m, h)
    at = _centres(m, len(wide) // 2 + 2, step)
    if len(at) < FEWEST:  # a short record is not smoothed on both sides
        wide, step = phi, max(1, int(APART * half))
        at = _centres(m, half + 2, step)
    K, narrow = operator(wide, at, len(m)), operator(phi, at, len(m))
    theta, w = m.measured
    noise = np.sqrt(2 * m.variance[0]) / h if theta is not None else np.inf
    rough = min(noise, m.variance[1] ** 0.5) / np.sqrt(half)
    slow = np.abs(m.w)
    limit = max(STILL * m.top, 3 * rough, 0.5 * m.count / h)
    moving = (K @ slow > limit) & (K @ (slow < STILL * m.top).astype(float) < AT_REST)
    K, narrow, at = K[moving], narrow[moving], at[moving]
    half_height = 0.5 * m.dt * np.count_nonzero(wide > 0.5 * wide.max())
    return Rows(
        h,
        K,
        narrow,
        at,
        step * m.dt,
        m.t[at],
        narrow @ m.stiff,
        narrow @ m.shake,
        rough,
        half_height,
    )


def _centres(m: Motion, reach: int, step: int) -> np.ndarray:
    """Samples around which ``reach`` samples on each side are good and of one stretch."""
    at = [np.arange(p.start + reach, p.stop - reach, step) for p in m.pieces]
    found = np.concatenate(at) if at else np.zeros(0, int)
    bad = np.append(0, np.cumsum(~m.ok))
    return found[bad[found + reach] == bad[found - reach]] if len(found) else found


def _half_response(k: np.ndarray) -> float:
    """Frequency at which a kernel's response falls to one half, rad per sample."""
    H = np.abs(np.fft.rfft(k, 4096))
    low = np.flatnonzero(H < 0.5 * H[0])
    return float(np.pi * (low[0] if len(low) else 2048) / 2048)


def quick(m: Motion, h: float, J: float | None, Fc: float | None) -> Width | None:
    """A robust balance of inertia, friction, offset, gravity and lateness at one half-width."""
    half = max(2, round(h / m.dt))
    phi = bump(half)
    at = _centres(m, half + 2, max(1, int(APART * half)))
    if not len(at):
        return None
    K = operator(phi, at, len(m))
    a, v = _acceleration(m, K, phi)
    top = max(m.top, 1e-12)
    turns = m.span > 2 and m.motion != "linear"
    place = [np.sin(m.theta), np.cos(m.theta)] if turns else [m.theta - m.theta.mean()]
    terms = [np.tanh(m.w / (0.01 * top)), m.w, np.ones(len(m)), m.slope(m.u), *place]
    X, y = np.column_stack([a, K @ np.column_stack(terms)]), K @ (m.u - m.d)
    moving = K @ np.abs(m.w) > 0.01 * top
    if moving.sum() < 3 * X.shape[1]:
        return None
    return _quick(X[moving], y[moving], h, v, turns, J, Fc, m)


def _acceleration(m: Motion, K: csr_matrix, phi: np.ndarray) -> tuple[np.ndarray, float]:
    """Rows of the acceleration from both signals by inverse variance, and its variance."""
    theta, w = m.measured
    k2, k1 = np.convolve(phi, [1, -2, 1]) / m.dt**2, np.convolve(phi, [0.5, 0, -0.5]) / m.dt
    of_theta = m.variance[0] * float(k2 @ k2)
    of_w = m.variance[1] * float(k1 @ k1) if w is not None else np.inf
    of_w = max(of_w, 0.25 * of_theta) if m.filtered else of_w
    v, a = 1 / (1 / of_theta + 1 / of_w), np.zeros(K.get_shape()[0])
    if theta is not None:
        a += v / of_theta * (K @ np.concatenate([[0.0], np.diff(theta, 2), [0.0]])) / m.dt**2
    if w is not None:
        a += v / of_w * (K @ m.slope(w))
    return a, v


def _quick(
    X: np.ndarray,
    y: np.ndarray,
    h: float,
    v: float,
    turns: bool,
    J: float | None,
    Fc: float | None,
    m: Motion,
) -> Width:
    k, size = np.ones(len(y)), np.sqrt(np.mean(X**2, axis=0)) + 1e-300
    Z = X / size
    b = r = G = np.zeros(0)
    s = 1.0
    for _ in range(6):
        G = Z.T @ (Z * k[:, None]) + 1e-9 * k.sum() * np.eye(len(size))
        b = np.linalg.solve(G, Z.T @ (y * k))
        r = y - Z @ b
        s = 1.5 * float(np.median(np.abs(r))) + 1e-300
        k = 5 / (4 + (r / s) ** 2)
    inverse = np.linalg.inv(G)
    ac = [float(np.mean(r[j:] * r[:-j]) / np.mean(r * r)) for j in range(1, 8)]
    memory = 1 + 2 * sum(max(0.0, c) for c in ac)
    torque, friction = rms(y), rms(Z[:, 1:3] @ b[1:3])
    friction += 1e-12 * torque
    heavy = False
    if turns:
        sure = b[5:] @ np.linalg.solve(inverse[5:, 5:], b[5:]) > 50 * s**2 * memory
        heavy = bool(rms(Z[:, 5:] @ b[5:]) > 0.3 * friction and sure)
    found, level = float(b[0] / size[0]), Fc or max(friction, 0.1 * float(np.std(m.u)))
    allowed = NOISE * level
    if not J:
        allowed = max(NOISE * level, 0.3 * rms(r))
    noisy = (J or max(found, 0.0)) * float(np.sqrt(v)) / allowed
    p = b / size
    drag = p[1] * np.mean(np.abs(m.w)) + p[2] * np.mean(m.w**2)
    return Width(
        h=h,
        J=found,
        se=float(s * np.sqrt(memory * inverse[0, 0]) / size[0]),
        lost=float(v * k.sum() * inverse[0, 0] / size[0] ** 2),
        noisy=float(noisy),
        left=rms(r) / max(torque, 1e-300),
        heavy=heavy,
        driven=float(drag / (torque * np.mean(np.abs(m.w)) + 1e-300)),
    )


def usable(w: Width, declared: bool) -> bool:
    """Whether noise takes little off J and is small beside friction."""
    return w.lost < LOST and (w.noisy < 1 or (declared and w.h > NARROW - 1e-3))
