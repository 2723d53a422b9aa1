"""A quadratic Lyapunov function of the proposed observer's errors, and the decay it guarantees.

With a = sigma0 |w|/h(w) >= 0 the errors e_z = z - zhat, e_w = w - what follow

    d/dt (e_z, e_w) = (M0 + a M1) (e_z, e_w)

(eq. err_z_dot_new, err_w_dot_new). The torque u cancels; the observer's parameters and J must
be those of the drive, and d = 0.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import asdict, dataclass, replace
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..blocks.friction import level
from ..blocks.model import values_of
from ..core.display import Row
from ..core.errors import InputError
from ..core.result import Result
from ..core.validation import array, number, positive

NAMES = ("J", "sigma0", "sigma1", "Fc", "Fs", "vs")


def drive(p: Any) -> SimpleNamespace:
    return SimpleNamespace(**checked(p, NAMES, {"sigma1"}, "the observer's error system"))


def checked(p: Any, names: Iterable[str], free: Iterable[str], who: str) -> dict[str, float]:
    """Values of a drive that ``who`` needs, all above 0, those that are ``free`` also 0."""
    have = values_of(p)
    given = {k: getattr(have, k, None) for k in names}
    if missing := [k for k, v in given.items() if v is None]:
        law = ": give a LuGre model" * ("sigma0" in given)
        raise InputError(f"{who} needs {', '.join(missing)} of the drive{law}.")
    found = {k: number(v, k) for k, v in given.items()}
    for k, value in found.items():
        if value < 0.0 or (value == 0.0 and k not in free):
            raise InputError(f"{k} = {value:g}: {who} needs {k} > 0.")
    return found


def bristle_errors(m: Any, slope: float = 0.0, Fv: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Build M0 and M1 for a copy of the bristles that nothing corrects; ``slope`` is that of dz/dt
    over e_w where it does not know w, ``Fv`` the viscous friction that it then gets wrong."""
    at_rest = [[0.0, slope], [-m.sigma0 / m.J, -(m.sigma1 * slope + Fv) / m.J]]
    return np.array(at_rest), np.array([[-1.0, 0.0], [m.sigma1 / m.J, 0.0]])


def error_matrices(p: Any, K1: float, K2: float) -> tuple[np.ndarray, np.ndarray]:
    """M0 and M1 of d/dt (e_z, e_w) = (M0 + a M1)(e_z, e_w), a = sigma0 |w|/h(w) in 1/s."""
    m = drive(p)
    K3 = (K2 - m.sigma1 * K1) / m.J
    at_rest, sliding = bristle_errors(m)
    return at_rest - [[0.0, K1], [0.0, K3]], sliding


def slowest_pole(p: Any, K1: float, K2: float) -> float:
    """Largest real part in 1/s of the error system's poles at w = 0, s^2 + K3 s - K1 sigma0/J: no
    rate that holds for every w(t) can be faster than this."""
    m = drive(p)
    half = (K2 - m.sigma1 * K1) / m.J / 2.0
    product = -K1 * m.sigma0 / m.J
    root = half * half - product
    if root < 0.0 or half <= 0.0:
        return -half + math.sqrt(max(root, 0.0))
    return -product / (half + math.sqrt(root))


MATCHED = "the observer's parameters and J are those of the drive, and no load torque d acts"
ANY_MOTION = "valid for every w(t), bounded or not, and every torque u"
LOSS = 1e-3  # share of the rate given up if the best V would be singular


@dataclass(frozen=True, repr=False, eq=False)
class Certificate(Result):
    """V = A e_z^2 + B e_z e_w + C e_w^2 with -dV/dt >= e'(Q0 + a Q1) e, a = sigma0 |w|/h(w).

    Truthy if it holds. It is the ``certificate`` of a design, or the answer of
    :func:`lugrectl.certify`.

    Attributes
    ----------
    holds : bool
        V is positive definite and never grows.
    lemma : str
        The lemma of the source paper, or the rule, behind it.
    conditions : tuple of str
        What it depends on, or why there is none.
    pole_at_rest : float
        Real part in 1/s of the slowest pole at w = 0, which no rate can exceed.
    rate : float or None
        Guaranteed decay of the errors in 1/s, V(t) <= V(0) exp(-2 rate t) for every motion; None
        if no rate is guaranteed without conditions on w.
    A, B, C : float or None
        The constants of V.
    alpha, alpha_unit, beta : float, str, float or None
        The source paper's constants of the lemma, alpha in ``alpha_unit``.
    P, Q0, Q1 : (2, 2) ndarray or None
        Symmetric matrices in (e_z, e_w).
    valid : str or None
        For which motions the certificate holds, where ``conditions`` does not say it.

    Notes
    -----
    A, B, C, alpha, beta and the matrices are None if no V of this form exists. They are None as
    well for observers other than the proposed one, whose V is of another form (see the docstring
    of the observer).

    Examples
    --------
    The largest errors that can follow a start 0.1 mrad wrong in the deflection, in mrad and
    mrad/s:

    >>> certificate = lg.certify(lg.table1(), K1=-10.24, K2=22.0)
    >>> certificate.holds, round(certificate.rate, 1)
    (True, 95.3)
    >>> [round(1e3 * bound, 2) for bound in certificate.bound(1e-4)]
    [0.11, 65.21]
    """

    holds: bool
    lemma: str
    conditions: tuple[str, ...]
    pole_at_rest: float
    rate: float | None = None
    A: float | None = None
    B: float | None = None
    C: float | None = None
    alpha: float | None = None
    alpha_unit: str | None = None
    beta: float | None = None
    P: np.ndarray | None = None
    Q0: np.ndarray | None = None
    Q1: np.ndarray | None = None
    valid: str | None = None

    def __bool__(self) -> bool:
        return self.holds

    def V(self, ez: ArrayLike, ew: ArrayLike) -> Any:
        """V(e_z, e_w), elementwise; e_z in rad, e_w in rad/s."""
        P = self._matrix(self.P)
        x, y = np.asarray(ez, dtype=float), np.asarray(ew, dtype=float)
        return P[0, 0] * x * x + 2.0 * P[0, 1] * x * y + P[1, 1] * y * y

    def rate_at(self, a: ArrayLike) -> Any:
        """Guaranteed decay of the errors in 1/s while sigma0 |w|/h(w) = a, elementwise.

        The largest r with -dV/dt >= 2 r V. Over a motion, V(t) <= V(0) exp(-2 int rate_at(a)).
        """
        P, Q, Q1 = map(self._matrix, (self.P, self.Q0, self.Q1))
        a = np.asarray(a, dtype=float)
        q = [[Q[i, j] + a * Q1[i, j] for j in (0, 1)] for i in (0, 1)]
        det = np.maximum(q[0][0] * q[1][1] - q[0][1] ** 2, 0.0)
        trace = q[0][0] * P[1, 1] + q[1][1] * P[0, 0] - 2.0 * q[0][1] * P[0, 1]
        size = P[0, 0] * P[1, 1] - P[0, 1] ** 2
        root = np.sqrt(np.maximum(trace * trace - 4.0 * size * det, 0.0))
        return np.where(trace > 0.0, det / np.where(trace > 0.0, trace + root, 1.0), 0.0)

    def bound(self, ez: float, ew: float = 0.0) -> tuple[float, float]:
        """Upper bounds of |e_z| (rad) and |e_w| (rad/s) for these initial errors.

        If there is a rate, both bounds decay by exp(-rate t).
        """
        inverse = np.linalg.inv(self._matrix(self.P))
        start = float(self.V(ez, ew))
        return math.sqrt(start * inverse[0, 0]), math.sqrt(start * inverse[1, 1])

    def summary(self) -> dict[str, Any]:
        """Plain Python; the matrices as lists."""
        own = {k: getattr(self, k) for k in self.__dataclass_fields__}
        own["conditions"] = list(self.conditions)
        return {k: v.tolist() if isinstance(v, np.ndarray) else v for k, v in own.items()}

    def _title(self) -> str:
        rate = "none" if self.rate is None else f"{self.rate:.6g} 1/s"
        held = "holds" if self.holds else "no certificate"
        valid = f", {self.valid}" if self.valid else ""
        return f"Certificate {self.lemma}: {held}{valid}, rate {rate}"

    def _rows(self) -> Iterable[Row]:
        constants = [Row(k, getattr(self, k)) for k in ("A", "B", "C", "beta")]
        constants.append(Row("alpha", self.alpha, self.alpha_unit or ""))
        return [
            Row("pole at rest", self.pole_at_rest, "1/s"),
            *(row for row in constants if row.value is not None),
            *(Row("condition", sentence) for sentence in self.conditions),
        ]

    def __str__(self) -> str:
        return "\n".join([self._title(), *(f"  {sentence}" for sentence in self.conditions)])

    def _matrix(self, matrix: np.ndarray | None) -> np.ndarray:
        if matrix is None:
            reason = "there is no certificate for these gains, so there is no V."
            if self.holds:
                reason = f"the V of the rule {self.lemma} is not a function of e_z and e_w alone."
            raise InputError(reason)
        return matrix


def constant_certificate(
    p: Any,
    gains: tuple[float, float],
    C: float,
    beta: float,
    lemma: str,
    conditions: tuple[str, ...],
) -> Certificate:
    """The certificate of constant gains with the V given by C and beta.

    A and B of eq. AB give the only V that is valid for every a >= 0, up to C and beta: as a grows
    without bound -dV/dt >= 0 needs -(P M1 + M1'P) >= 0. M1 has rank one, so its cross term must
    vanish, which is eq. ineq3: B = 2 C sigma1/J; and beta = 2 A - B sigma1/J.
    """
    m, (K1, K2) = drive(p), gains
    B = 2.0 * C * m.sigma1 / m.J
    A = B * m.sigma1 / (2.0 * m.J) + beta / 2.0
    P = np.array([[A, B / 2.0], [B / 2.0, C]])
    Q0, Q1 = (-(P @ M + M.T @ P) for M in error_matrices(m, K1, K2))
    Q1[0, 1] = Q1[1, 0] = 0.0  # exactly, by the choice of B
    made = Certificate(
        holds=True,
        lemma=lemma,
        conditions=conditions,
        pole_at_rest=slowest_pole(m, K1, K2),
        A=A,
        B=B,
        C=C,
        alpha=K2 / m.J,
        alpha_unit="1/s",
        beta=beta,
        P=P,
        Q0=Q0,
        Q1=Q1,
    )
    rate = float(made.rate_at(0.0))
    return replace(made, rate=rate) if K1 < 0.0 < K2 and m.sigma1 > 0.0 and rate > 0.0 else made


def certify(p: Any, K1: float, K2: float) -> Certificate:
    """The best V = A e_z^2 + B e_z e_w + C e_w^2 of constant gains that is valid at every speed.

    Parameters
    ----------
    p : Parameters or Model
        With LuGre friction; J, sigma0, Fc, Fs > 0.
    K1 : float
        Without unit.
    K2 : float
        In N m s/rad.

    Returns
    -------
    Certificate
        Truthy if a V exists that is positive definite and grows for no motion; its ``rate`` is
        the largest that any such V guarantees (see the Notes for an exception). C = 1.

    Raises
    ------
    InputError
        For a gain that is not a finite number (for functions of w see :func:`design_gains`).

    Notes
    -----
    With x = e_z and y = e_w + (sigma1/J) e_z the error system of the source paper (eq.
    err_z_dot_new, err_w_dot_new) is dx/dt = -(a - K1 sigma1/J) x - K1 y,
    dy/dt = g x - (K2/J) y, g = (K2 sigma1/J - sigma0)/J. The V valid for every a >= 0 are
    V = C (y^2 + (beta/2C) x^2). With sigma1 > 0 one of them decays exponentially if and only if
    K1 < 0 < K2; this covers more gains than lemma6. The best rate is that of the slowest pole at
    w = 0 if g > 0, and min(-K1 sigma1/J, K2/J) if g < 0, with beta/2C = |g|/|K1|. If that ratio
    is so small that P is nearly singular, a larger one is used, which costs less than 0.5 % of
    the rate. Gains for which no such V exists may still be stable for bounded |w|.

    Examples
    --------
    The gains of the source paper:

    >>> certificate = lg.certify(lg.table1(), K1=-10.24, K2=22.0)
    >>> bool(certificate), round(certificate.rate, 1)
    (True, 95.3)

    With the other sign of K1 there is no such V:

    >>> bool(lg.certify(lg.table1(), K1=10.24, K2=22.0))
    False
    """
    m = drive(p)
    K1, K2 = number(K1, "K1"), number(K2, "K2")
    g, pole = (K2 * m.sigma1 / m.J - m.sigma0) / m.J, slowest_pole(m, K1, K2)
    reason = ""
    if K1 > 0.0:
        reason = f"K1 = {K1:g} > 0: at w = 0 the error has the unstable pole {pole:+.4g} 1/s"
    elif K2 < 0.0:
        reason = (
            f"K2 = {K2:g} < 0: at a constant speed with |w|/h(w) above {abs(K1 / K2):.4g} "
            "rad/(N m s) the error has an unstable pole"
        )
    elif K1 == 0.0 and g != 0.0:
        reason = "K1 = 0: at w = 0 nothing corrects e_z, which drives e_w: no V of this form exists"
    if reason:
        return Certificate(False, "certify", (reason, MATCHED), pole)
    first = "K1 < 0 < K2 and sigma1 > 0"
    if not (K1 < 0.0 < K2 and m.sigma1 > 0.0):
        first = "no rate: K1, K2 or sigma1 is 0, and no V of this form decays at every speed"
    weight = (m.sigma1 / m.J) ** 2 or 1.0  # beta/(2 C) of the best V
    if K1:
        d1, d2 = -K1 * m.sigma1 / m.J, K2 / m.J
        loss = LOSS * min(d1, d2)
        least = (2.0 * math.sqrt(loss * (abs(d1 - d2) + loss)) / K1) ** 2
        weight = max(abs(g) / -K1, least)
    sentences = (first, MATCHED, ANY_MOTION)
    return constant_certificate(m, (K1, K2), 1.0, 2.0 * weight, "certify", sentences)


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
        C1, C2 = sorted((m.Fc, m.Fs))
        steady, mean = m.sigma0 * self.slowest / C2, m.sigma0 * self.beta / C2 / self.T
        if alpha is None:
            return max(steady, mean)
        limit = positive(alpha, "alpha") / m.J
        top = m.sigma0 * self.fastest / C1
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
