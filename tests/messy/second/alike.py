"""Which other effects put the same torque along the same true motion?

``y`` is the true torque of the effect. What the declared structure can absorb (``J a``, the sign,
``w``, the Stribeck bump) is projected out of it; then each other effect has its best fit.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import uniform_filter1d
from scipy.signal import lfilter

from ..case import EFFECTS
from . import kernel as k
from .effects import rms
from .machine import Machine

SAMPLES = 6000


@dataclass
class Scene:
    """True signals, at every tick (``full``) and on the rows that are compared."""

    m: Machine
    full: np.ndarray
    step: int
    t: np.ndarray
    x: np.ndarray
    theta: np.ndarray
    base: np.ndarray
    y: np.ndarray

    def free(self, c: np.ndarray) -> np.ndarray:
        """Columns without what the declared structure absorbs."""
        return c - self.base @ (self.base.T @ c)


def scene(m: Machine, out: np.ndarray) -> Scene:
    """Signals along the true motion and the projection."""
    step = max(1, len(out) // SAMPLES)
    x = out[::step]
    t = (np.arange(len(x)) * step + 0.5 / m.nsub) / m.fs
    theta = x[:, k.TH] + x[:, k.W] * 0.5 / (m.fs * m.nsub)
    w, p = x[:, k.W], m.P
    columns = [
        x[:, k.ACC],
        x[:, k.FB],
        w,
        np.tanh(w / (0.1 * p["vs"])) * np.exp(-((w / p["vs"]) ** 2)),
    ]
    if p["power"] != 1.0:
        columns.append(x[:, k.F0] - x[:, k.FB])
    if p["grav"]:
        columns += [np.sin(theta), np.cos(theta)]
    b = np.stack(columns, axis=1)
    base, _, _ = np.linalg.svd(b / np.linalg.norm(b, axis=0), full_matrices=False)
    s = Scene(m, out, step, t, x, theta, base, x[:, k.RE])
    s.y = s.free(s.y)
    return s


def left(s: Scene, families: np.ndarray, positive: bool = False) -> float:
    """RMS of what the best of ``families`` (n, m, 1 or 2) leaves; coefficients free or positive."""
    n, m, size = families.shape
    c = s.free(families.reshape(n, m * size)).reshape(n, m, size)
    g = np.einsum("nmi,n->mi", c, s.y)
    a = np.einsum("nmi,nmj->mij", c, c)
    raw = np.einsum("nmi,nmi->m", families, families)
    a = a + 1e-9 * raw[:, None, None] * np.eye(size) + 1e-300 * np.eye(size)
    g = np.maximum(g, 0.0) if positive else g
    gain = np.einsum("mi,mi->m", g, np.linalg.solve(a, g[..., None])[..., 0])
    return float(np.sqrt(max(0.0, s.y @ s.y - gain.max()) / n))


def _held(s: Scene, torques: np.ndarray) -> float:
    """The same for torques (n, m) that have no free size."""
    rest = s.y[:, None] - s.free(torques)
    return float(np.sqrt(np.mean(rest**2, axis=0).min()))


def _rounds(s: Scene, factor: np.ndarray, first: int) -> np.ndarray:
    """sin and cos of 1..120 cycles per turn, times a factor (n,)."""
    angle = np.arange(first, 121) * s.theta[:, None]
    return np.stack([np.sin(angle), np.cos(angle)], axis=-1) * factor[:, None, None]


def _periods(s: Scene) -> np.ndarray:
    """sin and cos of time at the peaks of the spectrum."""
    dt, n = s.step / s.m.fs, s.y.size
    size = np.abs(np.fft.rfft(s.y * np.hanning(n), 4 * n))
    f = np.fft.rfftfreq(4 * n, dt)
    size[f < 1.0 / (n * dt)] = 0.0  # a full period, else it is an offset or a drift
    peaks = []
    for _ in range(5):
        i = int(np.argmax(size))
        peaks.append(f[i])
        size[max(0, i - 8) : i + 9] = 0.0
    f = np.add.outer(peaks, np.linspace(-0.5, 0.5, 11) / (n * dt)).ravel()
    f = np.maximum(f, 1.0 / (n * dt))
    angle = 2 * np.pi * f * s.t[:, None]
    return np.stack([np.sin(angle), np.cos(angle)], axis=-1)


def _late(s: Scene, lag: bool) -> np.ndarray:
    """u minus the delayed (lagged) u for a grid of times, (n, m)."""
    u, fs = s.full[:, k.UCMD], s.m.fs
    ticks = np.arange(u.size) / fs
    columns = []
    for tau in np.geomspace(3e-4, 0.03, 50):
        if lag:
            a = np.exp(-1 / (fs * tau))
            columns.append((u - lfilter([0, 1 - a], [1, -a], u))[:: s.step])
        else:
            columns.append(s.x[:, k.UCMD] - np.interp(s.t - tau - 0.5 / fs, ticks, u))
    return np.stack(columns, axis=1)


def _elastic(s: Scene) -> np.ndarray:
    """Acceleration of a load behind a spring, for a grid of springs, (n, m, 1)."""
    h = 1 / s.m.fs
    acc = np.gradient(s.full[:, k.W]) / h
    columns = []
    for w0 in 2 * np.pi * np.geomspace(2, 80, 24):
        for zeta in (0.03, 0.08, 0.18, 0.4):
            p = 2 / h
            num = np.array([w0**2 + 2 * zeta * w0 * p, 2 * w0**2, w0**2 - 2 * zeta * w0 * p])
            den = num + p * p * np.array([1.0, -2.0, 1.0])
            columns.append(lfilter(num / den[0], den / den[0], acc)[:: s.step])
    return np.stack(columns, axis=1)[..., None]


@k.njit(cache=True)
def _gap(th, w, h, gap, stiff, damp, start):
    """Torque of a load of inertia 1 behind a gap, driven by a known motion."""
    r = np.zeros(th.size)
    e = np.array([1.0, gap, stiff, damp])
    x, v = th[0] + start, w[0]
    for i in range(th.size):
        x += 0.5 * h * v
        r[i] = k._contact(15, e, th[i] + 0.5 * h * w[i] - x, w[i] - v)
        v += h * r[i]
        x += 0.5 * h * v
    return r


def _backlash(s: Scene) -> np.ndarray:
    """Torques of a load behind a grid of gaps, (n, m, 1)."""
    th, w, h = s.full[:, k.TH].copy(), s.full[:, k.W].copy(), 1 / s.m.fs
    columns = []
    for gap in np.concatenate([[0.0], np.geomspace(0.002, 0.15, 10)]) * np.ptp(th):
        for w0 in 2 * np.pi * np.geomspace(4, 60, 12):
            for zeta in (0.06, 0.2):
                columns.append(_gap(th, w, h, gap, w0**2, 2 * zeta * w0, 0.0)[:: s.step])
    return np.stack(columns, axis=1)[..., None]


def _one(*columns: np.ndarray) -> np.ndarray:
    return np.stack(columns, axis=-1)[:, None, :]


def _steps(s: Scene, x: np.ndarray) -> np.ndarray:
    edges = np.linspace(0.03, 0.97, 95) * s.t[-1]
    return (x[:, None] * (s.t[:, None] >= edges))[..., None]


def _stops(s: Scene) -> np.ndarray:
    lo, hi = s.theta.min(), s.theta.max()
    at = lo + (hi - lo) * np.linspace(0.02, 0.98, 49)
    up = np.maximum(0.0, s.theta[:, None] - at)
    down = np.minimum(0.0, s.theta[:, None] - at)
    return np.concatenate([up, down], axis=1)[..., None]


def _springs(s: Scene) -> np.ndarray:
    """Springs at rest within the travel or half of it beyond: farther ones are constant torques."""
    lo, hi = s.theta.min(), s.theta.max()
    return (s.theta[:, None] - (lo + (hi - lo) * np.linspace(-0.5, 1.5, 61)))[..., None]


POSITIVE = ("quadratic_drag", "return_spring", "hard_stop", "elastic_coupling", "backlash",
            "load_dependent_friction")  # fmt: skip


def remaining(s: Scene, name: str) -> float:
    """RMS torque that the best fit of one effect leaves, N m."""
    th, w, fb, u = s.theta, s.x[:, k.W], s.x[:, k.FB], s.x[:, k.UCMD]
    one = np.ones_like(th)
    if name in ("input_delay", "actuator_lag"):
        return _held(s, _late(s, name == "actuator_lag"))
    if name == "actuator_dead_zone":
        h = np.geomspace(0.01, 0.6, 60) * rms(s.x[:, k.F0])  # wider: it would stand for friction
        return _held(s, np.clip(u[:, None], -h, h))
    if name == "load_dependent_friction":
        load = np.abs(s.m.P["grav"] * np.sin(th + s.m.P["grav_phase"]))
        return left(s, _one(fb * load), True) if s.m.P["grav"] else rms(s.y)
    if name == "thermal_drift":
        grown = 1 - np.exp(-s.t[:, None] / np.geomspace(0.3, 300, 40))
        return left(s, (s.x[:, k.F0][:, None] * grown)[..., None])
    families = {
        "constant_torque": lambda: _one(one),
        "gravity": lambda: _one(np.sin(th), np.cos(th)),
        "torque_ripple": lambda: _rounds(s, one, 2),
        "position_dependent_friction": lambda: _rounds(s, fb, 1),
        "coulomb_asymmetry": lambda: _one(fb * np.sign(w)),
        "viscous_asymmetry": lambda: _one((s.x[:, k.F0] - fb) * np.sign(w)),
        "quadratic_drag": lambda: _one(w * np.abs(w)),
        "return_spring": lambda: _springs(s),
        "hard_stop": lambda: _stops(s),
        "elastic_coupling": lambda: _elastic(s),
        "backlash": lambda: _backlash(s),
        "inertia_step": lambda: _steps(s, s.x[:, k.ACC]),
        "friction_step": lambda: _steps(s, fb),
        "periodic_disturbance": lambda: _periods(s),
        "torque_constant_ripple": lambda: _rounds(s, u, 1),
    }
    return left(s, families[name](), name in POSITIVE)


def noise_floor(m: Machine, f_log: float, sigma: float, seconds: float) -> float:
    """Torque that the sensors' noise hides over the whole record, N m.

    Position and current are fitted over windows of 20 ms; windows are independent.
    """
    window = 0.02
    n = max(4.0, window * f_log)
    acc = 2 * np.pi / m.counts / np.sqrt(12) * np.sqrt(720 / n) / window**2
    return float(np.hypot(m.P["J"] * acc, sigma / np.sqrt(n)) * np.sqrt(12 * window / seconds))


def hold_error(s: Scene, log: dict[str, np.ndarray]) -> float:
    """RMS torque by which the logged u, held from row to row, misses the true one, N m.

    Averaged over 20 ms and without a constant shift in time, which a log may well have.
    """
    row = np.clip(np.searchsorted(log["t"], s.t, side="right") - 1, 0, None)
    true = s.x[:, k.UCMD]
    d = log["u"][row] - true
    d = np.clip(d, *np.quantile(d, [0.005, 0.995]))  # outliers are no hold error
    d = uniform_filter1d(d, max(1, int(0.02 * s.m.fs / s.step)))
    rate = np.gradient(uniform_filter1d(true, 5))
    return rms(s.free(d - rate * (rate @ d) / (rate @ rate)))


def alike(
    s: Scene, truth: str, noise: float, hold: float
) -> tuple[frozenset[str], dict[str, float]]:
    """Effects that leave no more than half of the background or the noise, and what each leaves."""
    whole, background = rms(s.y), np.hypot(rms(s.free(s.x[:, k.BG])), hold)
    least = min(max(0.5 * background, noise), 0.5 * whole)
    skip = {truth} | (set() if truth == "elastic_coupling" else {"backlash"})
    rest = {x: remaining(s, x) for x in EFFECTS if x not in skip}
    return frozenset(x for x, r in rest.items() if r <= least), rest
