"""Antiresonances, resonances, inertia and delay of a measured response.

    P = 1/(J s + B)  prod (s^2/wa^2 + 2 za s/wa + 1)/(s^2/wr^2 + 2 zr s/wr + 1)
        exp(-s delay)/(1 + s lag)  (1 - exp(-s dt))/(s dt)

The last factor is the hold. At the motor every antiresonance wa comes before its resonance wr.
Least squares of the complex logarithm, with a loss that an outlier hardly moves; the number of
pairs by BIC, counted in independent points. Errors are of two kinds. Noise: its part of the
intervals is the jackknife, neighbouring points left out together, as they share data (Efron 1982,
ch. 3), with Student's t of as many degrees of freedom as points speak (Satterthwaite). What is left
of friction: a share k of all that friction changed, in one unknown phase; k is
the share of that which the points show in the errors of the fit. It adds k |change| to the errors
of the points, and to the covariance k^2/2 times the squares of what the change in phase, and a
quarter turn from it, does to the parameters.

Where the axis stands, no law says what friction is: rest is missing data. There the torque is what
the mechanics needs for the measured motion, and friction counts as part of it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.optimize import least_squares
from scipy.stats import t as t_distribution

from ..core.numeric import Z95
from ..core.result import picked
from .runs import Response, Run, Shape, hold

PAIRS = 3
LEAST_DEVIATION = 0.01  # of P, of a point: what the model of the mechanics leaves out
NEIGHBOURS = 4  # points that share data: windows overlap by half
FIXED = 4  # parameters besides those of the pairs: log J, log B, delay, log lag
SEEN = 0.5  # coherence below which a point says nothing of the mechanics
FEWEST = 12  # points
SMOOTH = 0.12  # of the sampling rate: what the motion of a resting axis needs is slow
EDGE = 0.95  # of the highest frequency: beyond it a pair stands for something else


@dataclass(frozen=True)
class Mode:
    """An antiresonance or a resonance: frequency in rad/s, damping ratio, 95 % intervals."""

    kind: str
    frequency: float
    damping: float
    ci95: tuple[float, float]
    damping_ci95: tuple[float, float]

    def summary(self) -> dict[str, object]:
        return picked(self, "kind frequency damping ci95 damping_ci95")


@dataclass(frozen=True, eq=False)
class Mechanics:
    """The fitted parameters ``x`` (m,), and the points they fit."""

    x: np.ndarray
    fit: _Fit

    @cached_property
    def _errors(self) -> tuple[np.ndarray, np.ndarray]:
        """What noise (k, m) and what is left of friction (2, m) do to the parameters: the sums of
        the squares are variances."""
        e, G, weight = self.fit.linear(self.x)
        left = [_step(one, G, weight) for one in self.fit.phases()]
        return _jackknife(e, G, weight), np.sqrt(0.5) * self.fit.share * np.array(left)

    @property
    def top(self) -> float:
        return float(self.fit.w[-1])

    @property
    def inertia(self) -> tuple[float, tuple[float, float]]:
        """The inertia of the whole axis, and its 95 % interval."""
        return self._value(self.x[0], np.eye(len(self.x))[0])

    def _value(self, log: float, rate: np.ndarray) -> tuple[float, tuple[float, float]]:
        """A value from its logarithm, with the rates of that by the parameters."""
        noise, left = (np.square(part @ rate) for part in self._errors)
        free = max(noise.sum() ** 2 / max(np.square(noise).sum(), 1e-300), 1.0)
        t = float(t_distribution.ppf(0.975, free))
        width = float(np.sqrt(t**2 * noise.sum() + Z95**2 * left.sum()))
        with np.errstate(over="ignore"):  # not known at all: up to inf
            low, value, high = np.exp([log - width, log, log + width])
        return float(value), (float(low), float(high))

    @property
    def pairs(self) -> np.ndarray:
        """log wa, log za, log(wr/wa - 1), log zr in rows, ascending."""
        made = self.x[FIXED:].reshape(-1, 4)
        return made[np.argsort(made[:, 0])]

    def advance(self, w: np.ndarray) -> np.ndarray:
        """The inverse of delay and lag of the torque: (1 + jw lag) exp(jw delay)."""
        return (1.0 + 1j * w * np.exp(self.x[3])) * np.exp(1j * w * self.x[2])

    def shape(self, w: np.ndarray) -> Shape:
        num, den = np.ones((2, len(w)), complex)
        for a, za, r, zr in np.exp(self.pairs).tolist():
            num *= quadratic(1j * w, a, za)
            den *= quadratic(1j * w, a * (1.0 + r), zr)
        return Shape(num, den)

    def response(self, w: np.ndarray) -> np.ndarray:
        return np.exp(_log_response(self.x, w, self.fit.dt)[0])

    def filled(self, run: Run, U: np.ndarray) -> np.ndarray:
        """The spectrum U of a command with the needed torque where the axis stands."""
        if not run.stands.any():
            return U
        w = run.w[1:]
        force = np.append(1.0, self.advance(w))  # over it: torques in force, each at its own time
        needed = np.zeros(len(U), complex)
        slow = np.exp(-((w * run.dt / (2.0 * np.pi * SMOOTH)) ** 2))
        needed[1:] = run.W[1:] * slow / (self.response(w) * force[1:])
        torque = np.where(run.stands, run.signal(needed), run.signal(U / force))
        return run.spectrum(torque) * force

    def radius(self, w: np.ndarray) -> np.ndarray:
        """Of the 95 % disc of the response, as a share of it."""
        made = np.concatenate(self._errors) @ _log_response(self.x, w, self.fit.dt)[1].T
        return np.sqrt(-np.log(0.05) * np.sum(np.abs(made) ** 2, axis=0))

    def modes(self) -> tuple[Mode, ...]:
        """Every antiresonance and resonance within the measured frequencies, with intervals."""
        made = []
        for i in range((len(self.x) - FIXED) // 4):
            k = FIXED + 4 * i
            a, r = np.exp(self.x[k]), np.exp(self.x[k + 2])
            rate = np.zeros(len(self.x))
            rate[k] = 1.0
            made.append(self._mode("antiresonance", a, rate, k + 1))
            rate[k + 2] = r / (1.0 + r)
            made.append(self._mode("resonance", a * (1.0 + r), rate, k + 3))
        inside = (m for m in made if m.frequency < EDGE * self.top)
        return tuple(sorted(inside, key=lambda m: m.frequency))

    def _mode(self, kind: str, at: float, rate: np.ndarray, damped: int) -> Mode:
        frequency, ci95 = self._value(np.log(at), rate)
        damping, damping_ci95 = self._value(self.x[damped], np.eye(len(self.x))[damped])
        return Mode(kind, frequency, damping, ci95, damping_ci95)


def quadratic(s: np.ndarray, w: float, zeta: float) -> np.ndarray:
    return (s / w) ** 2 + 2.0 * zeta * s / w + 1.0


def _log_response(x: np.ndarray, w: np.ndarray, dt: float) -> tuple[np.ndarray, np.ndarray]:
    """log P (n,) and its derivatives by the parameters (n, m)."""
    s = 1j * w
    J, B, delay, lag = np.exp(x[0]), np.exp(x[1]), x[2], np.exp(x[3])
    body = J * s + B
    made = -np.log(body) - s * delay - np.log1p(s * lag) + np.log(hold(w, dt))
    rates = [-J * s / body, -B / body, -s, -s * lag / (1.0 + s * lag)]
    for a, za, r, zr in np.exp(x[FIXED:]).reshape(-1, 4).tolist():
        wr = a * (1.0 + r)
        N, D = quadratic(s, a, za), quadratic(s, wr, zr)
        made = made + np.log(N) - np.log(D)
        on_a = (-2.0 * (s / a) ** 2 - 2.0 * za * s / a) / N
        on_r = (2.0 * (s / wr) ** 2 + 2.0 * zr * s / wr) / D
        rates += [
            on_a + on_r,
            2.0 * za * s / a / N,
            on_r * r / (1.0 + r),
            -2.0 * zr * s / wr / D,
        ]
    return made, np.array(rates).T


@dataclass(frozen=True, eq=False)
class _Fit:
    """The points to fit, and how; ``change`` (n,) is what friction changed log P by, and ``share``
    how much of that may be left."""

    w: np.ndarray
    log_P: np.ndarray
    deviation: np.ndarray
    change: np.ndarray
    dt: float
    J: float
    share: float = 0.0

    def stacked(self, z: np.ndarray) -> np.ndarray:
        """Errors of log P (n,), over their deviations, as real numbers (2n,)."""
        return np.concatenate([np.real(z), np.imag(z)]) / np.tile(self.deviation, 2)

    def error(self, x: np.ndarray) -> np.ndarray:
        e = _log_response(x, self.w, self.dt)[0] - self.log_P
        return self.stacked(np.real(e) + 1j * (np.mod(np.imag(e) + np.pi, 2.0 * np.pi) - np.pi))

    def rates(self, x: np.ndarray) -> np.ndarray:
        g = _log_response(x, self.w, self.dt)[1] / self.deviation[:, None]
        return np.concatenate([np.real(g), np.imag(g)])

    def bounds(self, pairs: int) -> tuple[np.ndarray, np.ndarray]:
        low, high, J, dt = self.w[0], self.w[-1], np.log(self.J), self.dt
        light = np.log(self.J * low)
        below = [J - 1.5, light - 6.0, -dt, np.log(1e-3 * dt)]
        above = [J + 1.5, light + 2.0, 20.0 * dt, np.log(10.0 * dt)]
        below += [np.log(1.5 * low), np.log(1e-3), np.log(0.03), np.log(1e-3)] * pairs
        above += [np.log(high), np.log(0.5), np.log(6.0), np.log(0.5)] * pairs
        return np.array(below), np.array(above)

    def solved(self, start: Sequence[float]) -> tuple[float, np.ndarray]:
        below, above = self.bounds((len(start) - FIXED) // 4)
        x = np.clip(start, below + 1e-6, above - 1e-6)
        options = {"jac": self.rates, "bounds": (below, above), "loss": "soft_l1"}
        found = least_squares(self.error, x, max_nfev=60, x_scale="jac", **options)
        return float(found.cost), found.x

    def with_friction(self, x: np.ndarray) -> _Fit:
        """The same with what is left of friction as a part of the deviations."""
        e, G, weight = self.linear(x)
        hidden = [one + G @ _step(one, G, weight) for one in self.phases()]
        seen = 0.5 * sum(float(weight @ one**2) for one in hidden)
        share = min(np.sqrt(float(weight @ e**2) / seen), 1.0) if seen > 0.0 else 0.0
        deviation = np.hypot(self.deviation, share * np.abs(self.change))
        return replace(self, deviation=deviation, share=share)

    def phases(self) -> list[np.ndarray]:
        """What friction changed, and the same turned by a quarter, as errors (2n,)."""
        return [self.stacked(self.change), self.stacked(1j * self.change)]

    def linear(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Errors (2n,), their rates (2n, m), and the weights of the robust loss (2n,)."""
        e = self.error(x)
        return e, self.rates(x), 1.0 / np.sqrt(1.0 + e**2)

    def starts(self, x: np.ndarray) -> list[list[float]]:
        """The best fit with one pair more, at each of the deepest dips that it leaves."""
        left = np.real(self.log_P - _log_response(x, self.w, self.dt)[0])
        near = np.lib.stride_tricks.sliding_window_view(np.pad(left, 4, mode="edge"), 9)
        inside = (left == near.min(axis=1)) & (self.w > 2.0 * self.w[0])
        dips = sorted(np.flatnonzero(inside), key=lambda k: left[k])[:3]
        pair = np.log(0.02)
        return [
            [*x, np.log(self.w[k]), pair, np.log(r), pair] for k in dips for r in (0.1, 0.4, 1.2)
        ]


def fit_mechanics(found: Response, raw: Response, dt: float) -> Mechanics | None:
    """The model with the number of pairs that BIC prefers; None where too little is seen. ``raw``
    is the response with friction."""
    at = (found.coherence >= SEEN) & np.isfinite(found.P) & (found.P != 0)
    if at.sum() < FEWEST:
        return None
    w, P = found.w[at], found.P[at]
    deviation = np.maximum(found.sd[at] / np.abs(P), LEAST_DEVIATION)
    low = w <= max(4.0 * w[0], w[min(5, len(w) - 1)])
    J = float(np.median(1.0 / (w[low] * np.abs(P[low]))))
    fit = _Fit(w, np.log(P), deviation, np.log(raw.P[at] / P), dt, J)
    best = fit.solved([np.log(J), np.log(0.1 * J * w[0]), dt, np.log(0.2 * dt)])
    chosen, score = best, _bic(best, len(w))
    for _ in range(PAIRS):
        starts = fit.starts(best[1])
        if not starts:
            break
        best = min((fit.solved(start) for start in starts), key=lambda one: one[0])
        if _bic(best, len(w)) < score:
            chosen, score = best, _bic(best, len(w))
    fit = fit.with_friction(chosen[1])
    return Mechanics(fit.solved(chosen[1].tolist())[1], fit)


def _bic(found: tuple[float, np.ndarray], points: int) -> float:
    return points * np.log(found[0] / points) + len(found[1]) * np.log(points)


def _step(e: np.ndarray, G: np.ndarray, weight: np.ndarray) -> np.ndarray:
    GW = (G * weight[:, None]).T
    return -np.linalg.pinv(GW @ G) @ GW @ e


def _jackknife(e: np.ndarray, G: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """The steps (k, m) that leaving out neighbouring points makes; their squares add up to the
    variances."""
    size = np.linalg.norm(G, axis=0) + 1e-300
    G, n = (G / size).reshape(2, -1, len(size)), len(e) // 2
    GW, e = G * weight.reshape(2, n, 1), e.reshape(2, n)
    whole, steps = np.einsum("inp,inq->pq", GW, G), []
    for part in np.array_split(np.arange(n), max(n // NEIGHBOURS, 2)):
        left = whole - np.einsum("inp,inq->pq", GW[:, part], G[:, part])
        score = np.einsum("inp,in->p", GW[:, part], e[:, part])
        steps.append(np.linalg.pinv(left, rcond=1e-10) @ score / size)
    return np.sqrt(1.0 - 1.0 / len(steps)) * np.array(steps)
