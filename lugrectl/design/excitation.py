"""The excitation of the bristles by a motion, and the error decay that follows from it."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..blocks.friction import level
from ..core.errors import InputError
from ..core.result import Result
from ..core.validation import array, positive
from .certificate import drive

CELLS = 2000  # resolution of the search for a window
CLOSE = 1e-3  # a shorter window is preferred at this relative cost
NODES, WEIGHTS = np.polynomial.legendre.leggauss(8)


@dataclass(frozen=True, repr=False)
class Excitation(Result):
    """In every window of T seconds inside the log the integral of |w| is at least beta.

    T in s, beta in rad (eq. lemma2_eq); ``slowest`` and ``fastest``: extremes of |w| in rad/s;
    ``duration`` in s. Truthy when beta > 0.
    """

    T: float
    beta: float
    slowest: float
    fastest: float
    duration: float
    _units = {"T": "s", "beta": "rad", "slowest": "rad/s", "fastest": "rad/s", "duration": "s"}

    def __bool__(self) -> bool:
        return self.beta > 0.0

    def rate(self, p: Any, alpha: float | None = None) -> float:
        """Decay in 1/s that the excitation guarantees if it continues as in the log.

        Without alpha: that of the natural observer, sigma0 beta/(C2 T) with C2 = max(Fc, Fs):
        |e_z(t)| <= exp(sigma0 beta/C2) exp(-rate t) |e_z(0)| (lemma1, lemma2, corrected eq.
        proof2_eq2). With alpha in N m s/rad: that of the "time-varying" gains (lemma4):
        V(t) <= exp(2 rate T) exp(-2 rate t) V(0), which also needs |w| <= ``fastest``.
        """
        m = drive(p)
        steady = m.sigma0 * self.slowest / m.high
        mean = m.sigma0 * self.beta / m.high / self.T
        if alpha is None:
            return max(steady, mean)
        limit = positive(alpha, "alpha") / m.J
        top = m.sigma0 * self.fastest / m.low
        return max(min(steady, limit), mean * min(1.0, limit / top) if top > 0.0 else 0.0)

    def summary(self) -> dict[str, Any]:
        """Plain Python, with ``persistent``."""
        return {"persistent": bool(self)} | asdict(self)


def excitation(w: ArrayLike, t: ArrayLike, T: float | None = None) -> Excitation:
    """T and beta of lemma2 for a logged or simulated velocity.

    Parameters
    ----------
    w : (N,) array_like
        Velocity in rad/s, taken as linear between samples.
    t : (N,) array_like
        Increasing times in s.
    T : float, optional
        Window in s, at most the log's duration. Default: the shortest window, of at most half the
        log, whose beta/T is within 0.1 % of the largest (half a period for a sine).

    Returns
    -------
    Excitation
        beta is the smallest integral of |w| over a window of length T inside the log. It is
        exact for the given w and T; T is searched on a grid of 2000 cells.

    Raises
    ------
    InputError
        For fewer than two samples, values that are not finite, times that do not increase, or a
        T outside (0, duration].

    Notes
    -----
    Source paper, eq. lemma2_eq. A log shows the excitation for its own duration only: that it
    continues for all t, as lemma2 requires, remains an assumption. Noise counts as motion: for a
    drive at rest beta measures the noise.

    Examples
    --------
    A sine of 0.1 rad/s and 1 Hz: in each half period the drive moves 31.8 mrad.

    >>> t = np.linspace(0.0, 5.0, 2001)
    >>> found = lg.excitation(0.1 * np.sin(2 * np.pi * t), t)
    >>> round(found.T, 2), round(found.beta, 4)
    (0.5, 0.0318)

    The decay of the natural observer's error that this guarantees, in 1/s:

    >>> round(found.rate(lg.table1()), 1)
    49.4
    """
    t, w = _with_crossings(*_series(t, w))
    duration = float(t[-1] - t[0])
    path = np.concatenate([[0.0], np.cumsum(np.diff(t) * (np.abs(w[1:]) + np.abs(w[:-1])) / 2)])
    if T is None:
        T = _window(t, w, path)
    T = positive(T, "T")
    if T > duration * (1.0 + 1e-12):
        raise InputError(f"T = {T:g} s is longer than the log of {duration:g} s.")
    beta = _least(t, w, path, min(T, duration))
    speed = np.abs(w)
    return Excitation(T, beta, float(speed.min()), float(speed.max()), duration)


def natural_decay(p: Any, w: ArrayLike, t: ArrayLike) -> np.ndarray:
    """Error of the natural observer relative to its start, exp(-int_0^t sigma0 |w|/h(w)).

    Parameters
    ----------
    p : Parameters or Model
        With LuGre friction.
    w : (N,) array_like
        Velocity in rad/s, taken as linear between samples.
    t : (N,) array_like
        Increasing times in s.

    Returns
    -------
    (N,) array
        e_z(t)/e_z(t[0]), without unit. It is 1 at rest; for an integrable w its limit is at least
        exp(-sigma0/C1 int |w|) with C1 = min(Fc, Fs), so above 0.

    Raises
    ------
    InputError
        As :func:`excitation`.

    Notes
    -----
    Source paper, eq. proof2_eq. The integral is computed by Gauss quadrature with 8 nodes between
    samples and zero crossings: accurate if w changes by at most about 10 vs between samples.

    Examples
    --------
    After 50 ms at 0.1 rad/s about 1 % of the start error is left; at rest all of it stays.

    >>> t = np.linspace(0.0, 0.05, 101)
    >>> left = lg.natural_decay(lg.table1(), np.full(101, 0.1), t)
    >>> round(float(left[-1]), 3)
    0.01
    >>> float(lg.natural_decay(lg.table1(), np.zeros(101), t)[-1])
    1.0
    """
    m = drive(p)
    asked, w = _series(t, w)
    t, w = _with_crossings(asked, w)
    middle, half = (w[1:] + w[:-1]) / 2.0, np.diff(w) / 2.0
    inner = middle[:, None] + half[:, None] * NODES
    slip = np.abs(inner) / level(inner, m.Fc, m.Fs, m.vs)
    parts = m.sigma0 * np.diff(t) * (slip @ WEIGHTS) / 2.0
    total = np.concatenate([[0.0], np.cumsum(parts)])
    return np.exp(-total[np.searchsorted(t, asked)])


def _series(t: ArrayLike, w: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
    t, w = array(t, "t"), array(w, "w")
    if t.ndim != 1 or t.shape != w.shape or len(t) < 2:
        raise InputError(f"w and t must be two lists of one length, not {w.shape} and {t.shape}.")
    if not (np.all(np.isfinite(t)) and np.all(np.isfinite(w))):
        raise InputError("w and t must be finite: take a stretch without gaps.")
    if np.any(np.diff(t) <= 0.0):
        k = int(np.argmax(np.diff(t) <= 0.0))
        raise InputError(f"t must increase; after {t[k]:g} s comes {t[k + 1]:g} s.")
    return t, w


def _with_crossings(t: np.ndarray, w: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The series with its zero crossings added, so that |w| is linear between samples, too."""
    k = np.flatnonzero(w[1:] * w[:-1] < 0.0)
    when = t[k] + (t[k + 1] - t[k]) * w[k] / (w[k] - w[k + 1])
    inside = (when > t[k]) & (when < t[k + 1])
    k, when = k[inside], when[inside]
    return np.insert(t, k + 1, when), np.insert(w, k + 1, 0.0)


def _path(at: np.ndarray, t: np.ndarray, w: np.ndarray, path: np.ndarray) -> np.ndarray:
    """int |w| from t[0], exact for a piecewise linear |w|."""
    k = np.clip(np.searchsorted(t, at, side="right") - 1, 0, len(t) - 2)
    past = np.clip(at - t[k], 0.0, t[k + 1] - t[k])
    speed = np.abs(w)
    slope = (speed[k + 1] - speed[k]) / (t[k + 1] - t[k])
    return path[k] + past * (speed[k] + slope * past / 2.0)


def _window(t: np.ndarray, w: np.ndarray, path: np.ndarray) -> float:
    """The shortest window, of at most half the log, with nearly the largest beta/T."""
    grid = np.linspace(t[0], t[-1], CELLS + 1)
    travelled = _path(grid, t, w, path)
    sizes = np.arange(1, CELLS // 2 + 1)
    mean = np.array([np.min(travelled[n:] - travelled[:-n]) / n for n in sizes])
    chosen = int(np.argmax(mean >= (1.0 - CLOSE) * mean.max()))
    return float(sizes[chosen] * (t[-1] - t[0]) / CELLS)


def _least(t: np.ndarray, w: np.ndarray, path: np.ndarray, T: float) -> float:
    """min over windows inside the log of int |w|: it occurs at a breakpoint, or where |w| is the
    same at both ends of the window."""
    last = t[-1] - T
    starts = np.unique(np.clip(np.concatenate([t, t - T]), t[0], last))
    here, there = (np.interp(starts + shift, t, np.abs(w)) for shift in (0.0, T))
    change = there - here
    k = np.flatnonzero((change[:-1] < 0.0) & (change[1:] > 0.0))
    part = change[k] / (change[k] - change[k + 1])
    starts = np.concatenate([starts, starts[k] + part * (starts[k + 1] - starts[k])])
    return float(np.min(_path(starts + T, t, w, path) - _path(starts, t, w, path)).clip(min=0.0))
