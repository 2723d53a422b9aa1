"""An answer of its own to each bench test: what the record determines, whoever asks.

Motion is fitted in the weak form: the torque balance times a bump that vanishes with its slope at
both ends, integrated over a window, so that theta alone is needed and never differentiated. The
fits may know what the bench did (which harmonics, when a level stood), and vs.
"""

from __future__ import annotations

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy.optimize import curve_fit, minimize_scalar

G = 9.81


def own_fit(drawn) -> dict[str, float]:
    """The asked values, by name."""
    return FITS[drawn.kind](drawn)


def speed(run: dict, m: int) -> np.ndarray:
    """By central differences over 2 m samples."""
    theta, dt = run["theta"], run["t"][1]
    padded = np.concatenate([np.full(m, theta[0]), theta, np.full(m, theta[-1])])
    return (padded[2 * m :] - padded[: -2 * m]) / (2 * m * dt)


class Windows:
    """The integrals of a run over windows of n samples in which all is ``ok``."""

    def __init__(self, ok: np.ndarray, n: int, dt: float):
        inside = np.concatenate([[0], np.cumsum(ok)])
        starts = np.arange(0, len(ok) - n, max(n // 4, 1))
        self.n, self.dt = n, dt
        self.starts = starts[inside[starts + n + 1] - inside[starts] == n + 1]

    def integral(self, signal: np.ndarray, weights: np.ndarray) -> np.ndarray:
        windows = sliding_window_view(signal, self.n + 1)[self.starts]
        return windows @ weights * self.dt

    def bump(self, order: int = 0, late: float = 0.0) -> np.ndarray:
        """The bump (1 - x^2)^3 or a derivative by time, at the samples or later by a share."""
        x = (np.arange(self.n + 1) + late) / self.n * 2 - 1
        p = np.polynomial.Polynomial([1, 0, -3, 0, 3, 0, -1]).deriv(order)
        return p(x) * (2 / self.n / self.dt) ** order * (np.abs(x) <= 1)

    def derivative(self, order: int) -> np.ndarray:
        """Weights that take a derivative off theta: exact for polynomials up to this order."""
        tau = (np.arange(self.n + 1) - self.n / 2) * self.dt
        bump, weights = self.bump(), self.bump(order)
        lower = tau[:, None] ** np.arange(order)
        moments = lower.T @ (bump[:, None] * lower)
        weights = weights - bump * (lower @ np.linalg.solve(moments, lower.T @ weights))
        return weights * (order * bump.sum() / (weights @ tau**order))

    def plain(self, signal: np.ndarray) -> np.ndarray:
        return self.integral(signal, self.bump())

    def held(self, u: np.ndarray) -> np.ndarray:
        return self.integral(u, self.bump(late=0.5))

    def velocity(self, theta: np.ndarray) -> np.ndarray:
        return self.integral(theta, self.derivative(1))

    def acceleration(self, theta: np.ndarray) -> np.ndarray:
        return self.integral(theta, self.derivative(2))


def solved(columns: list[np.ndarray], target: np.ndarray) -> np.ndarray:
    """Least squares; nan where there is too little."""
    if len(target) < len(columns):
        return np.full(len(columns), np.nan)
    A = np.stack(columns, 1)
    scale = np.abs(A).max(0)
    return np.linalg.lstsq(A / scale, target, rcond=None)[0] / scale


def breakaway_ramps(drawn) -> dict[str, float]:
    """u when theta leaves its rest on a ramp, less what it grew while the first count filled."""
    run, J = drawn.columns, drawn.machine.J
    u, rate, count = run["u"], drawn.sensors.rate, 2 * np.pi / drawn.sensors.counts
    moved = np.flatnonzero(np.diff(run["theta"])) + 1
    first = moved[np.diff(moved, prepend=0) > 0.5 * rate]
    n = round(0.3 * rate)
    found: dict[int, list] = {1: [], -1: []}
    for k in first:
        slope, now = np.polyfit(np.arange(-n, 1) / rate, u[k - n : k + 1], 1)
        if abs(np.mean(u[k - n : k - n // 2])) > 0.7 * abs(now):  # not a push
            filling = (6 * J * count / 2 / abs(slope)) ** (1 / 3)  # J dw/dt = slope t
            found[1 if now > 0 else -1].append(abs(now) - abs(slope) * filling)
    F, B = np.array(found[1]), np.array(found[-1])
    about = np.sum((F - F.mean()) ** 2) + np.sum((B - B.mean()) ** 2)
    scatter = np.sqrt(about / (len(F) + len(B) - 2))
    return {"Fs_forward": F.mean(), "Fs_backward": B.mean(), "Fs_scatter": scatter}


def slow_scan(drawn) -> dict[str, float]:
    run, J = drawn.columns, drawn.machine.J
    reference, dt, theta = drawn.hints["reference"], run["t"][1], run["theta"]
    settled = round(0.3 / dt)
    steady = np.convolve(np.diff(reference, prepend=0) != 0, np.ones(settled))[: len(reference)]
    win = Windows((reference != 0) & (steady == 0), round(0.1 / dt), dt)
    numbers = [n for n, _, _ in drawn.machine.waves]
    waves = [win.plain(f(n * theta)) for n in numbers for f in (np.sin, np.cos)]
    target = win.held(run["u"]) - J * win.acceleration(theta)
    x = solved([win.plain(np.sign(reference)), win.plain(np.ones(len(theta))), *waves], target)
    amplitudes = np.hypot(x[2::2], x[3::2])
    return {"Fc": x[0]} | {f"cogging.{n:g}": a for n, a in zip(numbers, amplitudes, strict=True)}


def coast_down(drawn) -> dict[str, float]:
    """theta = a + b exp(-k t) - s (Fc/Fv) t on each coast, with k = Fv/J for all of them."""
    parts = [part for run in drawn.runs for part in coasts(run, drawn.machine.vs)]
    theta = np.concatenate([part[1] for part in parts])

    def solve(k: float):
        columns = np.zeros((len(theta), 2 * len(parts) + 1))
        at = 0
        for i, (t, _, s) in enumerate(parts):
            rows = slice(at, at + len(t))
            columns[rows, 2 * i], columns[rows, 2 * i + 1] = 1, np.expm1(-k * t)
            columns[rows, -1] = -s * (t + np.expm1(-k * t) / k)
            at += len(t)
        x, *_ = np.linalg.lstsq(columns, theta, rcond=None)
        return x[-1], np.sum((columns @ x - theta) ** 2)

    longest = max(part[0][-1] for part in parts)
    grid = np.geomspace(0.02, 20, 40) / longest
    k0 = grid[np.argmin([solve(k)[1] for k in grid])]
    k = minimize_scalar(lambda k: solve(k)[1], bounds=(k0 / 1.3, k0 * 1.3), method="bounded").x
    c, J = solve(k)[0] * k, drawn.machine.J
    return {"Fc/J": c, "Fv/J": k, "Fc": c * J, "Fv": k * J}


def coasts(run: dict, vs: float) -> list[tuple[np.ndarray, np.ndarray, float]]:
    """(t, theta, direction) of each stretch without torque, faster than Stribeck's fall."""
    t, u = run["t"], np.abs(run["u"])
    w = speed(run, max(round(0.01 / t[1]), 2))
    off = u <= 0.1 * u.max()
    moving = (np.abs(w) > 4 * vs) & off & np.concatenate([[True], off[:-1]])
    edges = np.flatnonzero(np.diff(moving, prepend=False, append=False)).reshape(-1, 2)
    spans = [(a, b) for a, b in edges if b - a > 0.1 / t[1]]
    return [(t[a:b] - t[a], run["theta"][a:b], np.sign(w[a + 1])) for a, b in spans]


def free_swing(drawn) -> dict[str, float]:
    pace = np.sqrt(drawn.machine.waves[0][1] / drawn.machine.J)
    rows = [swinging(run, pace) for run in drawn.runs]
    columns = [np.concatenate(parts) for parts in zip(*rows, strict=True)]
    x = solved(columns[1:], columns[0])
    return {"Fc/J": x[0], "Fv/J": x[1], "length": G / np.hypot(x[2], x[3])}


def swinging(run: dict, pace: float) -> tuple[np.ndarray, ...]:
    dt, theta = run["t"][1], run["theta"]
    away = np.abs(theta - theta[-1])
    wide = np.flatnonzero(away > 0.12 * away[0])
    w = speed(run, max(round(0.03 / pace / dt), 1))
    ok = np.zeros(len(theta), bool)
    ok[np.flatnonzero(np.diff(theta))[0] + 1 : wide[-1]] = True
    win = Windows(ok, round(1.5 / pace / dt), dt)
    turning = [win.plain(np.sign(w)), win.velocity(theta)]
    gravity = [win.plain(np.sin(theta)), win.plain(np.cos(theta))]
    return -win.acceleration(theta), *turning, *gravity


def steps_and_pulses(drawn) -> dict[str, float]:
    run, vs = drawn.columns, drawn.machine.vs
    dt, theta = run["t"][1], run["theta"]
    w = speed(run, max(round(0.005 / dt), 1))
    moving = np.abs(w) > max(4 * vs, 0.03 * np.abs(w).max())
    n = min(max(round(0.1 / dt), 8), max(np.count_nonzero(moving) // 40, 8))
    win = Windows(moving, n, dt)
    terms = [win.acceleration(theta), win.plain(np.sign(w)), win.velocity(theta)]
    return dict(zip(("J", "Fc", "Fv"), solved(terms, win.held(run["u"])), strict=True))


def staircase(drawn) -> dict[str, float]:
    run, J = drawn.columns, drawn.machine.J
    points = [level(run, J, a + (b - a) // 2, b) for a, b in drawn.hints["spans"]]
    w, F = np.abs(np.array(points)).T

    def curve(w, Fc, more, Fv, vs):
        return Fc + more * np.exp(-((w / vs) ** 2)) + Fv * w

    guess = [np.min(F), np.ptp(F) / 2, np.ptp(F) / np.max(w) / 2, np.quantile(w, 0.3)]
    try:
        x, _ = curve_fit(curve, w, F, guess, maxfev=5000)
    except RuntimeError:
        x = np.full(4, np.nan)
    return {"Fc": x[0], "Fs": x[0] + x[1], "Fv": x[2], "vs": abs(x[3])}


def level(run: dict, J: float, a: int, b: int) -> tuple[float, float]:
    """Mean speed and friction of a stand: the bump weighs the middle."""
    win = Windows(np.ones(b - a + 1, bool), b - a, run["t"][1])
    win.starts = np.array([0])
    part = slice(a, b + 1)
    area = win.plain(np.ones(b - a + 1))[0]
    theta, u = run["theta"][part], run["u"][part]
    torque = win.held(u)[0] - J * win.acceleration(theta)[0]
    return win.velocity(theta)[0] / area, torque / area


FITS = {
    "breakaway_ramps": breakaway_ramps,
    "slow_scan": slow_scan,
    "coast_down": coast_down,
    "free_swing": free_swing,
    "steps_and_pulses": steps_and_pulses,
    "staircase": staircase,
}
