"""The runs of a log as spectra: torque, speed, reference; the motion that friction follows; and the
windows of frequency in which a smooth response and a transient are polynomials.

The torque u[k] is held from sample k to k + 1. The speed is the derivative of the recorded
position, jw Theta(jw), so that no difference quotient delays it; without a position it is the
recorded speed. Friction of the interval from k to k + 1 belongs to u[k]. Several runs share the
response; each has a transient of its own (the local polynomial method: Schoukens, Vandersteen,
Barbe, Pintelon 2009).

The response is P of W(k) = P(k) V(k) + T(k) within each window. Instruments are the spectrum of the
logged reference times the powers of the distance, so that noise in the loop does not bias P
(Pintelon and Schoukens 2012, ch. 7). P is estimated directly: the map from the reference to V is
not smooth while friction reverses. Without a reference: least squares of W on V and of V on W, and
their geometric mean.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from scipy.fft import irfft, prev_fast_len, rfft, rfftfreq
from scipy.stats import f as f_distribution

from ..blocks.friction import strokes
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
    the changes of the reference, if logged; ``load`` (n,) the known torque on the resisting side,
    ``scale`` that of the level of friction."""

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


class Spacing(NamedTuple):
    """Windows as wide to either side as so many bins of the longest run, or as a share of their
    centre frequency where that is wider, and so many half-widths from one to the next."""

    bins: int
    share: float
    step: float = 1.0


def windows(runs: Sequence[Run], low: float, high: float, by: Spacing) -> list[Window]:
    """Return the windows from ``low`` to ``high``, rad/s; a low of 0: from the first whole one."""
    least, made = by.bins * min(run.w[1] for run in runs), []
    centre = low or least
    while centre < high:
        half = max(least, by.share * centre)
        made.append(window(runs, centre, half))
        centre += by.step * half
    return made


NARROW = Spacing(12, 0.014)


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
    w = np.array([one.centre for one in windows])
    return Response(w, found[0] * scale, sd, radius, found[3].real)


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
        Z = without(at.transient, at.poly * at.rows(known)[:, None])
        P, sd, noise = _solve(W, wide_v, Z, free)
    else:
        P, sd, noise = _solve(W, wide_v, wide_v, free)
        back = 1.0 / _solve(V, wide_w, wide_w, free)[0]
        sd = max(sd, 0.5 * abs(back - P))
        P *= np.sqrt(abs(back / P)) * np.exp(0.5j * np.angle(back / P))
    power = float(np.sum(np.abs(W) ** 2)) / max(at.free, 1)
    radius = sd * float(np.sqrt(f_distribution.ppf(0.95, 2, 2 * free)))
    return P, sd, radius, max(1.0 - noise / power, 0.0) if power > 0 else 0.0


def _solve(y: np.ndarray, X: np.ndarray, Z: np.ndarray, free: int) -> tuple[complex, float, float]:
    """The response at the centre of y = X p with instruments Z, its deviation, and the noise."""
    size = np.linalg.norm(X, axis=0) + 1e-300
    Q = np.linalg.qr(Z)[0]
    inverse = np.linalg.pinv(Q.conj().T @ (X / size), rcond=1e-10) / size[:, None]
    p = inverse @ (Q.conj().T @ y)
    noise = float(np.sum(np.abs(y - X @ p) ** 2)) / free
    return p[0], float(np.sqrt(noise * np.sum(np.abs(inverse[0]) ** 2))), noise
