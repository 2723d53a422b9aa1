"""The runs of a log as spectra, and what is fitted to them: response, mechanics, friction.

The torque u[k] is held from sample k to k + 1; friction of that interval belongs to it. The speed
is the derivative of the recorded position, jw Theta(jw). The response is P of
W(k) = P(k) V(k) + T(k) within each window, each run with a transient T of its own (the local
polynomial method: Schoukens, Vandersteen, Barbe, Pintelon 2009). Instruments are the spectrum of
the logged reference times the powers of the distance (Pintelon and Schoukens 2012, ch. 7); without
a reference P is the geometric mean of least squares of W on V and of V on W.

The mechanics, whose last factor is the hold; each antiresonance wa comes before its resonance wr:

    P = 1/(J s + B)  prod (s^2/wa^2 + 2 za s/wa + 1)/(s^2/wr^2 + 2 zr s/wr + 1)
        exp(-s delay)/(1 + s lag)  (1 - exp(-s dt))/(s dt)

The number of pairs is by BIC. Noise: the jackknife of neighbouring points (Efron 1982, ch. 3), with
Student's t (Satterthwaite). What is left of friction: a share k of all that friction changed, in
one unknown phase, as the errors of the fit show it; it adds k |change| to the errors of the points.
Where the axis stands, rest is missing data: the torque is what the mechanics needs.

Friction and 1/P in one least squares, with Y = 1/P and T projected out of each window:

    U(k) = Y(k) W(k) + T(k) + a(k) (Fc Phi1(k) + dF Phi2(k) + c Phi3(k) + ...)

Fc, dF, c are common to all windows, Phi the spectra along the measured motion of the deflection z
of a bristle of level 1, z exp(-(w/vs)^2), and dz/dt; a = (1 + jw lag) exp(jw delay) takes friction
to the command. On the load the first two along its motion, J2 dw2/dt = K (theta - theta2) +
D (w - w2) - F2; F2 costs the motor H F2, H = (2 za wa s + wa^2)/(s^2 + 2 za wa s + wa^2).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from operator import attrgetter
from typing import Any

import numpy as np
from scipy.fft import irfft, prev_fast_len, rfft, rfftfreq
from scipy.optimize import least_squares
from scipy.stats import f as f_distribution
from scipy.stats import t as t_distribution

from ..blocks.friction import along, level, strokes
from ..core.numeric import Z95
from ..core.result import picked
from ..record import Record
from ..record.signal_noise import smallest_step

SMOOTH = 0.34  # of the sampling rate: where the motion that friction follows is down to 1/e
FINER = 4  # parts of an interval: the axis may reverse within it
REST_SAMPLES = 1  # before and after, within one count: the axis stands
ORDER = 2  # of the polynomials
POWERS = np.arange(ORDER + 1)


@dataclass(frozen=True, eq=False)
class Run:
    """One stretch without a gap; spectra (M,) at ``w`` (M,) in rad/s from n samples. ``steps``
    (FINER n,) is the smoothed motion of each part of an interval, rad or m; ``E`` the spectrum of
    the changes of the reference, if logged; ``load`` (n,) the known torque that resists; ``scale``
    that of the level of friction."""

    dt: float
    t: np.ndarray
    u: np.ndarray
    theta: np.ndarray
    count: float
    w: np.ndarray
    W: np.ndarray
    E: np.ndarray | None
    load: np.ndarray
    steps: np.ndarray
    scale: np.ndarray | float = 1.0

    @cached_property
    def U(self) -> np.ndarray:
        return self.spectrum(self.u)

    @cached_property
    def strokes(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        return strokes(self.steps)

    def spectrum(self, x: np.ndarray) -> np.ndarray:
        return np.asarray(rfft(x, axis=0))

    def signal(self, X: np.ndarray) -> np.ndarray:
        return np.asarray(irfft(X, len(self.u), axis=0))

    @cached_property
    def fine_speed(self) -> np.ndarray:
        return self.steps * (FINER / self.dt)

    @cached_property
    def speed(self) -> np.ndarray:
        return means(self.fine_speed)

    @cached_property
    def stands(self) -> np.ndarray:
        """Whether the axis stands in an interval (n,): friction is then what the torque leaves."""
        if not self.count:
            return np.zeros(len(self.u), bool)
        near = np.pad(self.theta, REST_SAMPLES, mode="edge")
        windows = np.lib.stride_tricks.sliding_window_view(near, 2 * REST_SAMPLES + 1)
        still = np.ptp(windows, axis=1) <= 1.01 * self.count
        return np.append(still[1:], still[-1])


def hold(w: np.ndarray, dt: float | None) -> np.ndarray:
    """Return what holding a value over a sample does to its spectrum; 1 in continuous time."""
    s = 1j * w
    return np.ones(len(w), complex) if dt is None else -np.expm1(-s * dt) / (s * dt)


def point(w: np.ndarray, dt: float | None) -> np.ndarray:
    """Return s or z at frequencies in rad/s."""
    return 1j * w if dt is None else np.exp(1j * w * dt)


def means(x: np.ndarray) -> np.ndarray:
    return x.reshape(-1, FINER).mean(axis=1)


def runs_of(records: Sequence[Record]) -> list[Run]:
    """Return every stretch of the records of at least a quarter of the longest."""
    pieces = [(r, part) for r in records for part in r.segments()]
    longest = max(part.stop - part.start for _, part in pieces)
    kept = [(r, part) for r, part in pieces if 4 * (part.stop - part.start) >= longest]
    logged = all(r.r is not None and np.ptp(r.r[part]) > 0 for r, part in kept)
    return [_run(r, part, logged) for r, part in kept]


def _run(record: Record, part: slice, logged: bool) -> Run:
    fast = prev_fast_len(part.stop - part.start, real=True) or 0  # zeros in its place would not do:
    part = slice(part.start, part.start + int(fast))  # the transients would not be smooth
    dt, u = record.dt, record.u[part]
    w = 2.0 * np.pi * np.asarray(rfftfreq(len(u), dt))
    if record.theta is not None:
        theta, count = record.theta[part], smallest_step(record.theta)
        W = np.asarray(rfft(np.diff(theta, prepend=theta[0]) / dt))
        W[1:] /= hold(w[1:], dt)  # from the difference quotient to the derivative
    else:
        speed: Any = record.w
        speed = speed[part]
        theta, count = dt * np.append(0.0, np.cumsum(0.5 * (speed[1:] + speed[:-1]))), 0.0
        W = np.asarray(rfft(speed))
    E, reference = None, record.r
    if logged and reference is not None:
        E = np.asarray(rfft(np.diff(reference[part], append=reference[part.stop - 1])))
    load = np.zeros(len(u)) if record.d is None else record.d[part]
    return Run(dt, record.t[part], u, theta, count, w, W, E, load, _motion(theta, count))


def _motion(theta: np.ndarray, count: float) -> np.ndarray:
    """The motion of each part of an interval, smoothed without a shift in time."""
    n = len(theta)
    line = np.linspace(theta[0], theta[-1], n)
    about = theta - line
    spectrum: Any = rfft(np.concatenate([about, -about[::-1]]))
    spectrum = spectrum * np.exp(-((np.asarray(rfftfreq(2 * n)) / SMOOTH) ** 2))
    smooth = FINER * np.asarray(irfft(spectrum, 2 * n * FINER))[: n * FINER]
    smooth += theta[0] + (theta[-1] - theta[0]) / (n - 1) * np.arange(n * FINER) / FINER
    moved, last, half = [], float(smooth[0]), 0.5 * count
    for x in smooth.tolist():  # half a count of play: a resting axis does not chatter
        last = x - half if x > last + half else x + half if x < last - half else last
        moved.append(last)
    steps = np.diff(moved, append=smooth[-1])
    steps[-FINER:] = 0.0  # beyond the last sample
    return steps


def without(Q: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Project an orthonormal basis Q out of rows."""
    return rows - Q @ (Q.conj().T @ rows)


@dataclass(frozen=True, eq=False)
class Window:
    """The bins of each run about ``centre`` in rad/s, the powers ``poly`` (n, 3) of the distance
    from it, and an orthonormal basis ``transient`` (n, m) of the transients of all runs."""

    centre: float
    parts: tuple[slice, ...]
    poly: np.ndarray
    transient: np.ndarray

    def rows(self, spectra: Sequence[np.ndarray]) -> np.ndarray:
        """Spectra of each run (M,) or (M, m), one below the other within the window."""
        return np.concatenate([X[part] for X, part in zip(spectra, self.parts, strict=True)])

    @property
    def free(self) -> int:
        return len(self.poly) - self.transient.shape[1]


def window(runs: Sequence[Run], centre: float, half: float) -> Window:
    parts, polys = [], []
    for run in runs:
        first, last = np.searchsorted(run.w, [centre - half, centre + half])
        part = slice(max(int(first), 1), int(last))
        parts.append(part)
        polys.append(((run.w[part] - centre) / half)[:, None] ** POWERS)
    rows = np.cumsum([0, *map(len, polys)])
    width = ORDER + 1
    basis = np.zeros((rows[-1], width * len(polys)))
    for i, poly in enumerate(polys):
        if len(poly) >= width:
            basis[rows[i] : rows[i + 1], width * i : width * (i + 1)] = np.linalg.qr(poly)[0]
        else:  # too few bins to tell a transient from the response: the run says nothing here
            poly[:] = 0.0
    return Window(centre, tuple(parts), np.concatenate(polys), basis)


def windows(
    runs: Sequence[Run], low: float, high: float, bins: int, share: float, step: float = 1.0
) -> list[Window]:
    """Return the windows from ``low`` to ``high``, rad/s (0: from the first whole one), as wide to
    either side as so many bins of the longest run, or a share of their centre frequency where that
    is wider, and so many half-widths apart."""
    least, made = bins * min(run.w[1] for run in runs), []
    centre = low or least
    while centre < high:
        half = max(least, share * centre)
        made.append(window(runs, centre, half))
        centre += step * half
    return made


NARROW = 12, 0.014  # of a window of the response
DELAYED = 3.0  # samples, the most from command to speed: of a drive and of its filters
STRONG = 10.0  # F statistic from which instruments are strong (Staiger and Stock 1997)


@dataclass(frozen=True, eq=False)
class Response:
    """P (n,) at ``w`` (n,) in rad/s, its standard deviation, the radius of its 95 % disc, and the
    coherence: the share of the speed's power in a window that P explains."""

    w: np.ndarray
    P: np.ndarray
    sd: np.ndarray
    radius: np.ndarray
    coherence: np.ndarray


@dataclass(frozen=True, eq=False)
class Shape:
    """A response known up to a smooth factor, num/den: in its windows only that factor is fitted,
    so that a resonance narrower than a window does no harm."""

    num: np.ndarray
    den: np.ndarray


def local_response(
    runs: Sequence[Run],
    windows: Sequence[Window],
    V: Sequence[np.ndarray],
    shapes: Sequence[Shape],
    at: Shape,
) -> Response:
    """P from the torques V of the runs to their speeds; ``at`` is the shape at the centres."""
    top = [shape.num * X for shape, X in zip(shapes, V, strict=True)]
    out = [shape.den * run.W for shape, run in zip(shapes, runs, strict=True)]
    E = [run.E for run in runs if run.E is not None]
    known = E if len(E) == len(runs) else None
    found = np.array([_estimate(one, out, top, known) for one in windows]).T
    scale = at.num / at.den
    sd, radius = found[1].real * abs(scale), found[2].real * abs(scale)
    w, P = np.array([one.centre for one in windows]), found[0] * scale
    sure = known is not None or is_passive(P, radius, w * runs[0].dt)
    return Response(w, P, sd, radius, np.where(sure, found[3].real, 0.0))


def is_passive(P: np.ndarray, radius: np.ndarray, turn: np.ndarray) -> np.ndarray:
    """Whether P within its disc can be an axis (n,): from torque to speed of one shaft the real
    part is positive, but for a delay of DELAYED samples, each of which turns the phase by ``turn``.
    Where nothing excites the axis, P = -1/C of the controller is found, which cannot be, until its
    own sample turns it into what can: from there on, what most of an octave below it are."""
    unsure = np.arcsin(np.minimum(radius / np.maximum(np.abs(P), 1e-300), 1.0))
    middle, half = -0.5 * DELAYED * turn, 0.5 * np.pi + 0.5 * DELAYED * turn + unsure
    passive = np.abs(np.angle(P * np.exp(-1j * middle))) <= half
    last = 0.5 * np.pi / (DELAYED + 1.0)
    below = passive[(turn > 0.5 * last) & (turn <= last)]
    return np.where(turn <= last, passive, not below.size or np.mean(below) > 0.5)


def _estimate(
    at: Window,
    out: Sequence[np.ndarray],
    top: Sequence[np.ndarray],
    known: Sequence[np.ndarray] | None,
) -> tuple[complex, float, float, float]:
    """P, its standard deviation, the radius of its 95 % disc, and the coherence."""
    W, V = (without(at.transient, at.rows(X)) for X in (out, top))
    wide_w, wide_v = (without(at.transient, at.poly * at.rows(X)[:, None]) for X in (out, top))
    free = max(at.free - ORDER - 1, 1)
    if known is not None:
        Q = np.linalg.qr(without(at.transient, at.poly * at.rows(known)[:, None]))[0]
        P, sd, noise = _solve(W, wide_v, Q, free)
        if _strength(V, Q, free) < STRONG:
            return P, np.inf, np.inf, 0.0
    else:
        P, sd, noise = _solve(W, wide_v, np.linalg.qr(wide_v)[0], free)
        back = 1.0 / _solve(V, wide_w, np.linalg.qr(wide_w)[0], free)[0]
        sd = max(sd, 0.5 * abs(back - P))
        P *= np.sqrt(abs(back / P)) * np.exp(0.5j * np.angle(back / P))
    power = float(np.sum(np.abs(W) ** 2)) / max(at.free, 1)
    radius = sd * float(np.sqrt(f_distribution.ppf(0.95, 2, 2 * free)))
    return P, sd, radius, max(1.0 - noise / power, 0.0) if power > 0 else 0.0


def _strength(v: np.ndarray, Q: np.ndarray, free: int) -> float:
    """The F statistic of the regression of v on the instruments Q: with weak ones, what friction
    and noise do through the controller is read as the axis, P = -1/C."""
    all_of, rest = (float(np.sum(np.abs(x) ** 2)) for x in (v, without(Q, v)))
    return (all_of - rest) / Q.shape[1] * free / max(rest, 1e-300)


def _solve(y: np.ndarray, X: np.ndarray, Q: np.ndarray, free: int) -> tuple[complex, float, float]:
    """The response at the centre of y = X p with an orthonormal basis Q of its instruments, its
    deviation, and the noise."""
    size = np.linalg.norm(X, axis=0) + 1e-300
    inverse = np.linalg.pinv(Q.conj().T @ (X / size), rcond=1e-10) / size[:, None]
    p = inverse @ (Q.conj().T @ y)
    noise = float(np.sum(np.abs(y - X @ p) ** 2)) / free
    return p[0], float(np.sqrt(noise * np.sum(np.abs(inverse[0]) ** 2))), noise


DISC = np.sqrt(-np.log(0.05))  # deviations to the radius of a 95 % disc
LOW = 4.0  # times the lowest frequency: where the axis is a free inertia
PAIRS = 3
LEAST_DEVIATION = 0.01  # of P, of a point: what the model of the mechanics leaves out
NEIGHBOURS = 4  # points that share data: windows overlap by half
FIXED = 4  # parameters besides those of the pairs: log J, log B, delay, log lag
SEEN = 0.5  # coherence below which a point says nothing of the mechanics
FEWEST = 12  # points
SLOW = 0.12  # of the sampling rate: what the motion of a resting axis needs is slow
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
    """The points to fit, and the fitted parameters ``x`` (m,); ``change`` (n,) is what friction
    changed log P by, and ``share`` how much of that may be left."""

    w: np.ndarray
    log_P: np.ndarray
    deviation: np.ndarray
    change: np.ndarray
    dt: float
    J: float
    share: float = 0.0
    x: np.ndarray = field(default_factory=lambda: np.zeros(FIXED))

    @classmethod
    def unknown(cls, dt: float) -> Mechanics:
        """Of no points: a torque is in force a sample after its command."""
        none = np.zeros(0)
        return cls(none, none, none, none, dt, 0.0, x=np.array([0.0, 0.0, dt, -np.inf]))

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

    def with_friction(self, x: np.ndarray) -> Mechanics:
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

    @cached_property
    def _errors(self) -> tuple[np.ndarray, np.ndarray]:
        """What noise (k, m) and what is left of friction (2, m) do to the parameters: the sums of
        the squares are variances."""
        e, G, weight = self.linear(self.x)
        left = [_step(one, G, weight) for one in self.phases()]
        return _jackknife(e, G, weight), np.sqrt(0.5) * self.share * np.array(left)

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
        return np.exp(_log_response(self.x, w, self.dt)[0])

    def filled(self, run: Run, U: np.ndarray) -> np.ndarray:
        """The spectrum U of a command with the needed torque where the axis stands."""
        if not run.stands.any() or not len(self.w):
            return U
        w = run.w[1:]
        force = np.append(1.0, self.advance(w))  # over it: torques in force, each at its own time
        needed = np.zeros(len(U), complex)
        slow = np.exp(-((w * run.dt / (2.0 * np.pi * SLOW)) ** 2))
        needed[1:] = run.W[1:] * slow / (self.response(w) * force[1:])
        torque = np.where(run.stands, run.signal(needed), run.signal(U / force))
        return run.spectrum(torque) * force

    def radius(self, w: np.ndarray) -> np.ndarray:
        """Of the 95 % disc of the response, as a share of it."""
        made = np.concatenate(self._errors) @ _log_response(self.x, w, self.dt)[1].T
        return DISC * np.sqrt(np.sum(np.abs(made) ** 2, axis=0))

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
        inside = (m for m in made if m.frequency < EDGE * self.w[-1])
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


def is_low(w: np.ndarray) -> np.ndarray:
    """Whether each of ascending frequencies shows a free inertia: the first six always do."""
    return w <= max(LOW * w[0], w[min(5, len(w) - 1)])


def fit_mechanics(found: Response, raw: Response, dt: float) -> Mechanics:
    """The model with the number of pairs that BIC prefers; unknown where too little is seen.
    ``raw`` is the response with friction."""
    at = (found.coherence >= SEEN) & np.isfinite(found.P) & (found.P != 0)
    if at.sum() < FEWEST:
        return Mechanics.unknown(dt)
    w, P = found.w[at], found.P[at]
    deviation = np.maximum(found.sd[at] / np.abs(P), LEAST_DEVIATION)
    low = is_low(w)
    J = float(np.median(1.0 / (w[low] * np.abs(P[low]))))
    fit = Mechanics(w, np.log(P), deviation, np.log(raw.P[at] / P), dt, J)
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
    return replace(fit, x=fit.solved(chosen[1].tolist())[1])


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


WIDE = 15, 0.035, 1.4  # of a window of friction
TOP, SHARE = 40.0, 0.2  # Hz, and of the rate: friction is fitted below both, above it is weak
PASSES = 4  # of weights
FLOOR = 1e-3  # of the largest residual: no window weighs more
STEPS = (0.25, 0.12, 0.06)  # of the search, decades and samples
EARLIEST = 0.6  # samples: a motion in counts shows a reversal late, and rests hide it
MOTOR, LOAD = ("Fc", "dF", "damping"), ("load Fc", "load dF")
STEEPEST, FALLS = 1.5, 0.9  # dF/Fc: Fs up to 2.5 Fc, friction that falls by up to 90 % at low speed
COST = attrgetter("cost")
STEP = 0.3  # rad of the load's fastest oscillation in a step, at most
SHORTEST = 1e-3  # of the distance between the load's reversals: a bristle stiffer than this


Strokes = tuple[np.ndarray, np.ndarray, np.ndarray]


@dataclass(frozen=True, eq=False)
class LoadMotion:
    """The load's path and speed (FINER n,) in the parts of intervals, and H (M,) at the bins."""

    path: Strokes
    speed: np.ndarray
    seen: np.ndarray


def load_motion(run: Run, mechanics: Mechanics, friction: float, distance: float) -> LoadMotion:
    """Compute the motion of the load, with about so much friction (N m or N) on it."""
    wa, za, ratio, _ = np.exp(mechanics.pairs[0]).tolist()
    share = 1.0 - 1.0 / (1.0 + ratio) ** 2  # of the inertia, on the load
    braking = friction / (share * mechanics.inertia[0])
    path, first, _ = run.strokes
    distance = max(distance, SHORTEST * path[-1] / max(len(first), 1))
    part = run.dt / FINER
    n_steps = math.ceil(part * max(wa, math.sqrt(braking / distance)) / STEP)
    h, k, d = part / n_steps, wa**2, 2.0 * za * wa
    x, v, z = float(run.theta[0]), 0.0, 0.0
    steps, speeds = [], []
    fine = np.arange(FINER * len(run.theta)) / FINER
    angles = np.interp(fine, np.arange(len(run.theta)), run.theta)
    for now, after in zip(angles[:-1].tolist(), angles[1:].tolist(), strict=True):
        begin, w = x, (after - now) / part
        for i in range(n_steps):
            end = math.copysign(1.0, v)
            z = end + (z - end) * math.exp(-abs(v) * h / distance)
            v += h * (k * (now + w * h * (i + 0.5) - x) + d * (w - v) - braking * z)
            x += h * v
        steps.append(x - begin)
        speeds.append(v)
    s, seen = 1j * run.w, np.array([*speeds, v])
    H = (2.0 * za * s / wa + 1.0) / quadratic(s, wa, za)
    return LoadMotion(strokes(np.array([*steps, 0.0])), seen, H)


def _terms(
    path: Strokes, speed: np.ndarray, distance: float, vs: float
) -> tuple[np.ndarray, np.ndarray]:
    """The deflection at the end of each part of an interval, and the means (n, 2) of deflection
    and Stribeck term in each interval."""
    z = along(*path, distance)
    middle = 0.5 * (z + np.append(0.0, z[:-1]))
    return z, np.stack([means(middle), means(middle * level(speed, 0.0, 1.0, vs))], axis=1)


def impossible(names: Sequence[str], levels: Sequence[float], most: float = np.inf) -> str | None:
    """Return a term to be left out, whose level no friction has: the least certain of several;
    ``most`` is the largest torque, and friction that the axis overcomes is no larger."""
    found = dict(zip(names, levels, strict=True))
    large = [k for k in ("load Fc", "Fc") if found.get(k, 0.0) > most]
    if large:
        return large[0]
    for key, change in (("load Fc", "load dF"), ("Fc", "dF")):
        whole = found.get(key, 0.0)
        if change in found and not -FALLS * whole <= found[change] <= STEEPEST * whole:
            return change
    if "damping" in found and not found.get("Fc", 0.0) > 0.0:  # of a bristle that is not there
        return "damping"
    return next((k for k in ("load Fc", "damping", "Fc") if found.get(k, 0.0) < 0.0), None)


@dataclass(frozen=True, eq=False)
class Friction:
    """The friction found: its spectrum for each run as a part of the command, N m or N.

    ``distance`` in rad or m, ``vs`` in rad/s or m/s, ``early`` in samples; ``levels`` by term, none
    where the log shows no friction; ``cost`` is the mean log residual.
    """

    spectra: tuple[np.ndarray, ...]
    levels: dict[str, float]
    distance: float
    vs: float
    early: float
    cost: float


@dataclass(frozen=True, eq=False)
class Problem:
    """What stays the same while the shapes are searched; ``advance`` (M,) of each run takes a
    torque in force to the command, ``loads`` is the motion of the load, if it has friction."""

    runs: Sequence[Run]
    advance: Sequence[np.ndarray]
    shapes: Sequence[Shape]
    windows: Sequence[Window]
    bases: Sequence[np.ndarray]
    left: Sequence[np.ndarray]
    loads: Sequence[LoadMotion] = ()

    @property
    def names(self) -> tuple[str, ...]:
        return MOTOR + LOAD if self.loads else MOTOR

    def spectra(self, i: int, distance: float, vs: float) -> np.ndarray:
        """The terms of a run (M, m); none acts where the axis stands."""
        run = self.runs[i]
        z, made = _terms(run.strokes, run.fine_speed, distance, vs)
        made = np.c_[made, np.diff(z[FINER - 1 :: FINER], prepend=0.0) / run.dt]
        if self.loads:
            load = self.loads[i]
            far = _terms(load.path, load.speed, distance, vs)[1]
            made = np.c_[made, run.signal(run.spectrum(far) * load.seen[:, None])]
        share = run.scale * ~run.stands
        return run.spectrum(made * share[:, None]) * self.advance[i][:, None]

    def without(self, found: Friction) -> Friction:
        """The same shapes with no friction."""
        none = [np.zeros((len(y), 0)) for y in self.left]
        spectra = tuple(np.zeros_like(F) for F in found.spectra)
        return replace(found, spectra=spectra, levels={}, cost=_levels(none, self.left)[1])

    def tried(self, distance: float, vs: float, early: float) -> Friction:
        """The best levels at these shapes."""
        made = [
            self.spectra(i, distance, vs) * np.exp(1j * run.w * run.dt * early)[:, None]
            for i, run in enumerate(self.runs)
        ]
        shaped = [s.num[:, None] * F for s, F in zip(self.shapes, made, strict=True)]
        both = zip(self.bases, self.windows, strict=True)
        X = [without(Q, one.rows(shaped)) for Q, one in both]
        most = max(float(np.abs(run.u).max()) for run in self.runs)
        levels, cost = _possible(X, self.left, self.names, most)
        spectra = tuple(F @ np.array([*levels.values()]) for F in made)
        return Friction(spectra, levels, distance, vs, early, cost)


def problem_of(
    runs: Sequence[Run],
    advance: Sequence[np.ndarray],
    shapes: Sequence[Shape],
    torques: Sequence[np.ndarray],
) -> Problem:
    """Pose the problem of the spectra of the commands ``torques``."""
    every = windows(runs, 0.0, 2.0 * np.pi * min(TOP, SHARE / runs[0].dt), *WIDE)
    moved = [shape.den * run.W for shape, run in zip(shapes, runs, strict=True)]
    driven = [shape.num * U for shape, U in zip(shapes, torques, strict=True)]
    bases = []
    for one in every:
        linear = one.poly * one.rows(moved)[:, None]
        linear = linear / (np.linalg.norm(linear, axis=0) + 1e-300)
        bases.append(np.linalg.qr(np.c_[linear, one.transient])[0])
    left = [without(Q, one.rows(driven)) for Q, one in zip(bases, every, strict=True)]
    return Problem(runs, advance, shapes, every, bases, left)


def fit_friction(problem: Problem, before: Friction | None = None) -> Friction:
    """The shapes with the smallest residual: from a grid, or near those before, then by steps."""
    low, high, slow, fast = _ranges(problem.runs)
    if before is None:
        distances = low * 10 ** np.arange(0.0, np.log10(high / low) + 0.01, 0.5)
        speeds = np.geomspace(slow, fast, 5)[1:-1]
        grid = [(x, v, 0.0) for x in distances.tolist() for v in speeds.tolist()]
    else:
        grid = [(before.distance, before.vs, before.early)]
    best = min((problem.tried(*shape) for shape in grid), key=COST)
    for step in STEPS if before is None else STEPS[1:]:
        for _ in range(2):
            for a, b, c in step * np.concatenate([np.eye(3), -np.eye(3)]):
                distance, vs = best.distance * 10**a, best.vs * 10**b
                early = best.early + c
                if low <= distance <= high and slow <= vs <= fast and abs(early) <= EARLIEST:
                    best = min(best, problem.tried(distance, vs, early), key=COST)
    return best


def _ranges(runs: Sequence[Run]) -> tuple[float, float, float, float]:
    """Bounds of the distance and of vs that the motion can show."""
    speed = float(np.sqrt(np.mean(np.concatenate([run.speed for run in runs]) ** 2)))
    path = max(run.strokes[0][-1] for run in runs)
    turns = max(len(run.strokes[1]) for run in runs)
    count, dt = runs[0].count, runs[0].dt
    low = max(0.7 * count, 1e-3 * speed * dt)
    return low, max(0.1 * path / max(turns, 1), 10.0 * low), 0.01 * speed, 0.5 * speed


def _possible(
    X: list[np.ndarray], y: Sequence[np.ndarray], names: Sequence[str], most: float
) -> tuple[dict[str, float], float]:
    """Levels that friction can have, and the cost; fewer terms where all together cannot."""
    kept = list(names)
    while True:
        at = [names.index(k) for k in kept]
        levels, cost = _levels([x[:, at] for x in X], y)
        wrong = impossible(kept, levels.tolist(), most)
        if wrong is None:
            return {k: 0.0 for k in names} | dict(zip(kept, levels.tolist(), strict=True)), cost
        kept.remove(wrong)


def _levels(X: list[np.ndarray], y: Sequence[np.ndarray]) -> tuple[np.ndarray, float]:
    """Real coefficients common to all windows, weighted by what each window leaves."""
    sizes = np.array([len(one) for one in y])
    A, b = np.concatenate(X), np.concatenate(y)
    A, b = (np.concatenate([np.real(x), np.imag(x)]) for x in (A, b))
    at = np.repeat(np.arange(len(sizes)), sizes)
    levels, left = np.zeros(A.shape[1]), np.ones(len(sizes))
    scale = left
    for _ in range(PASSES):
        weight = np.tile((1.0 / scale)[at], 2)
        if A.shape[1]:
            levels = np.linalg.lstsq(A * weight[:, None], b * weight, rcond=None)[0]
        square = (b - A @ levels) ** 2
        square = square[: len(at)] + square[len(at) :]
        left = np.sqrt(np.bincount(at, square) / sizes) + 1e-300
        scale = np.maximum(left, FLOOR * left.max())
    return levels, float(sizes @ np.log(left) / sizes.sum())
