"""Basis functions of the signals (linear splines, play operators) for an unknown torque."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import BSpline

from ..blocks.table import TURN
from .data import Log

MANY, SOME, FEW = 40, 24, 16  # pieces of a function
AROUND = 64  # the same for a function of the angle within a turn
NARROW = 240  # the same for a function of position with narrow bumps
TURNING = 1.25  # turns of travel, from which functions of the angle within a turn are used
DEAD = 0.02  # of the largest speed, below which the drive has no direction
PULSE = 0.05  # s, width of a pulse in time
SLOW, PARTS = 1.0, (10, 200)  # s per piece of a slow function; least and most number of pieces
REACHES = np.geomspace(0.002, 0.4, 12)  # of the range of a signal: half-widths of the plays
PLAYED = 5e-3  # s, step of the samples passed through the plays
NEAR = 0.002  # of the travel: distance from a reversal that is resolved most finely


@dataclass(frozen=True)
class Shape:
    """Basis ``B`` (samples, pieces) of a torque that is any function of some signals.

    ``timed``: it depends on time, which does not repeat. ``answers``: feedback correlates these
    signals with any disturbance (endogeneity), so a dependence on them is weak evidence.
    """

    signals: tuple[str, ...]
    B: np.ndarray
    timed: bool = False
    answers: bool = False


def shapes(log: Log, rows: np.ndarray, at: np.ndarray, a: np.ndarray) -> list[Shape]:
    """The functions that are tested, those of fewer signals first.

    Parameters
    ----------
    log : Log
        Of the whole record.
    rows : int array
        Samples at which they are evaluated.
    at : int array
        Those of ``rows`` whose range the functions cover.
    a : (rows,) array
        The acceleration that the model predicts from the torque: the measured one contains what
        the model fails to predict.
    """
    theta, w, u, t = (getattr(log, k)[rows] for k in ("theta", "w", "u", "t"))
    since, forth = _since_reversal(log)[rows], w > 0.0
    place, time = _spanned(theta, _even(theta[at], MANY)), _spanned(t, _even(t[at], SOME))
    made = [
        Shape(("theta",), place),
        Shape(("w",), _spanned(w, _full(w[at], MANY))),
        Shape(("u",), _spanned(u, _full(u[at], SOME))),
        Shape(("a",), _spanned(a, _full(a[at], SOME)), answers=True),
        Shape(("t",), time, timed=True),
        Shape(("theta", "w"), _by(forth, place)),
        Shape(("theta", "w"), _spanned(since, _full(since[at], MANY))),
        Shape(("t", "w"), _by(forth, time), timed=True),
    ]
    if wraps(theta[at], log.motion):
        angle, coarse = (around(theta, turn(count)) for count in (AROUND, SOME))
        made += [Shape(("theta",), angle), Shape(("theta", "w"), _by(forth, angle))]
    else:
        coarse = _spanned(theta, _even(theta[at], FEW))
    made.append(Shape(("theta", "w"), coarse * w[:, None]))
    made.append(Shape(("theta", "a"), coarse * a[:, None], answers=True))
    speed = _spanned(w, _full(w[at], FEW))
    made.append(Shape(("u", "w"), speed * u[:, None], answers=True))
    made.append(Shape(("w", "a"), speed * a[:, None], answers=True))
    return sorted(made, key=lambda shape: len(shape.signals))


def bumps(log: Log, rows: np.ndarray) -> Shape:
    """A function of position, or of the angle within a turn, with pieces as narrow as a bump."""
    theta = log.theta[rows]
    if wraps(theta, log.motion):
        return Shape(("theta",), around(theta, turn(NARROW)))
    return Shape(("theta",), _spanned(theta, _even(theta, NARROW)))


def hystereses(log: Log, rows: np.ndarray) -> list[Shape]:
    """Rate-independent hysteresis of the torque, and of the position."""
    u, theta = (_taken_up(log, x)[rows] for x in (log.u, log.theta))
    return [Shape(("u",), u, answers=True), Shape(("theta", "w"), theta)]


def fading(log: Log, rows: np.ndarray) -> list[Shape]:
    """Slow changes in time of a torque, of Coulomb friction, and of the torque constant."""
    t, w, u = (x[rows] for x in (log.t, log.w, log.u))
    time = _spanned(t, _even(t, int(np.clip(np.ptp(t) / SLOW, *PARTS))))
    strengths = (("t",), np.ones_like(w)), (("t", "w"), np.sign(w)), (("t", "u"), u)
    return [Shape(signals, time * x[:, None], timed=True) for signals, x in strengths]


def pulses(length: int, dt: float) -> np.ndarray:
    """Triangles in time over a window, (length, pieces)."""
    x = np.arange(float(length))
    return hats(x, _even(x, max(4, int(length * dt / PULSE))))


def wraps(theta: np.ndarray, motion: str) -> bool:
    """True if the drive turns far enough for functions of the angle within a turn."""
    return motion == "rotary" and bool(np.ptp(theta) > TURNING * TURN)


def turn(count: int) -> np.ndarray:
    """Points around one turn, rad."""
    return np.linspace(-np.pi, np.pi, count, endpoint=False)


def hats(x: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Hat functions (linear splines) of these points at x, (len(x), points)."""
    knots = np.r_[points[0], points, points[-1]]
    return BSpline.design_matrix(x, knots, 1).toarray()


def around(x: np.ndarray, points: np.ndarray) -> np.ndarray:
    """The same, periodic over one turn."""
    closed = np.r_[points, points[0] + TURN]
    A = hats(np.clip(np.mod(x - points[0], TURN) + points[0], closed[0], closed[-1]), closed)
    A[:, 0] += A[:, -1]
    return A[:, :-1]


def _spanned(x: np.ndarray, points: np.ndarray) -> np.ndarray:
    """As :func:`hats`, constant beyond the points."""
    return hats(np.clip(x, points[0], points[-1]), points)


def _even(x: np.ndarray, count: int) -> np.ndarray:
    low, high = float(x.min()), float(x.max())
    return np.linspace(low, max(high, low + 1e-12), count + 1)


def _full(x: np.ndarray, count: int) -> np.ndarray:
    """Knots with equally many samples between them."""
    knots = np.unique(np.quantile(x, np.linspace(0.0, 1.0, count + 1)))
    return knots if len(knots) > 1 else _even(x, 1)


def _by(forth: np.ndarray, B: np.ndarray) -> np.ndarray:
    """One function for each direction."""
    return np.concatenate([B * forth[:, None], B * ~forth[:, None]], axis=1)


def _since_reversal(log: Log) -> np.ndarray:
    """Signed logarithm of the distance from the last reversal, on which a hysteresis depends.

    The logarithm resolves short and long distances equally well.
    """
    made = np.zeros(len(log.t))
    for a, b in log.runs:
        w, theta = log.w[a:b], log.theta[a:b]
        going = np.where(np.abs(w) > DEAD * log.fastest, np.sign(w), 0.0)
        latest = np.maximum.accumulate(np.where(going != 0.0, np.arange(b - a), 0))
        way = going[latest]
        turned = np.append(True, way[1:] != way[:-1])
        from_here = theta[np.maximum.accumulate(np.where(turned, np.arange(b - a), 0))]
        gone = np.maximum((theta - from_here) * way, 0.0)
        made[a:b] = way * (1.0 + np.log1p(gone / (NEAR * np.ptp(log.theta) + 1e-12)))
    return made


def _taken_up(log: Log, x: np.ndarray) -> np.ndarray:
    """Deflection of plays of several widths that follow a signal, (samples, widths).

    Their weighted sums are the rate-independent hystereses of Prandtl and Ishlinskii.
    """
    made = np.zeros((len(x), len(REACHES)))
    reach, every = REACHES * float(np.ptp(x)), max(1, int(PLAYED / log.dt + 1e-9))
    for a, b in log.runs:
        behind, now = np.full(len(reach), x[a]), []
        for value in x[a:b:every]:
            behind = np.minimum(np.maximum(behind, value - reach), value + reach)
            now.append(value - behind)
        made[a:b] = np.repeat(now, every, axis=0)[: b - a]
    return made
