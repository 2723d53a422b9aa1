"""A torque given as a table over a signal, as a block: piecewise linear, without physics."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from ..core.errors import InputError
from ..core.validation import array, shown
from .block import Block, P
from .friction import EPS

if TYPE_CHECKING:
    import control as ct

TURN = 2.0 * np.pi
SIGNALS = ("theta", "w", "t", "u")
SCALE = P(1.0, "1")
ROUND = 0.02  # width over which a corner is rounded, as a share of the distance between points


Corners = tuple[tuple[float, float, float], ...]  # place x_i, change of slope c_i, half-width


def _line(x: np.ndarray, y: np.ndarray) -> tuple[float, Corners]:
    """The level and the corners of straight lines through points, constant outside them."""
    gap = np.diff(x)
    change = np.diff(np.r_[0.0, np.diff(y) / gap, 0.0])
    width = np.minimum(np.r_[gap[0], gap], np.r_[gap, gap[-1]])
    return 0.5 * float(y[0] + y[-1]), _corners(x, change, width)


def _ring(x: np.ndarray, y: np.ndarray) -> tuple[float, Corners]:
    """The mean and the corners of straight lines through points of one turn, closed."""
    gap = np.diff(np.r_[x, x[0] + TURN])
    slope = np.diff(np.r_[y, y[0]]) / gap
    mean = float(np.sum(gap * (y + np.roll(y, -1)))) / (2.0 * TURN)
    return mean, _corners(x, slope - np.roll(slope, 1), np.minimum(gap, np.roll(gap, 1)))


def _corners(*of: np.ndarray) -> Corners:
    x, change, width = of
    return tuple(zip(x.tolist(), change.tolist(), (ROUND * width).tolist(), strict=True))


@dataclass(frozen=True)
class _Lines:
    """The function of :func:`tabulated`: a line for each direction of w, or for both.

    A line is level + sum_i c_i |x - x_i| / 2, where |x - x_i| is written
    sqrt((x - x_i)^2 + delta_i^2), delta_i one fiftieth of the distance between the points: without
    kinks a solver need not stop at each point. Closed, it is mean + sum_i c_i g(theta - x_i): g''
    is one impulse less its mean over the turn, so with d = theta - x_i in (-pi, pi]
    g = |d|/2 - d^2/(4 pi) = pi/4 - a^2/pi, where a = (pi - |d|)/2 = arctan2(cos(d/2), |sin(d/2)|).
    The c_i sum to zero, so the constant pi/4 drops.
    """

    signal: str
    periodic: bool
    lines: tuple[tuple[float, Corners], ...]

    def __call__(self, *given: Any, scale: Any, eps: Any = EPS.value) -> Any:
        of = self._closed if self.periodic else self._open
        first, *others = (of(given[0], *line) for line in self.lines)
        if not others:
            return scale * first
        way = np.tanh(given[1] / eps)
        return scale * (0.5 * (first + others[0]) + 0.5 * (first - others[0]) * way)

    def _open(self, x: Any, level: float, corners: Corners) -> Any:
        total = level + 0.0 * x
        for place, change, width in corners:
            total = total + 0.5 * change * np.sqrt((x - place) * (x - place) + width * width)
        return total

    def _closed(self, x: Any, mean: float, corners: Corners) -> Any:
        total, sine, cosine = mean + 0.0 * x, np.sin(0.5 * x), np.cos(0.5 * x)
        for place, change, width in corners:
            s, c = np.sin(0.5 * place), np.cos(0.5 * place)
            away = sine * c - cosine * s
            a = np.arctan2(cosine * c + sine * s, np.sqrt(away * away + 0.25 * width * width))
            total = total - change / np.pi * a * a
        return total

    def block(self) -> Block:
        two, timed = len(self.lines) == 2, self.signal == "t"
        inputs = (*(() if timed else (self.signal,)), *(("w",) if two else ()))
        parameters = {"scale": SCALE} | ({"eps": EPS} if two else {})
        return Block("table", "effect", self, inputs, ("d",), (), parameters, timed=timed)


def tabulated(
    signal: str,
    points: ArrayLike,
    values: ArrayLike,
    *,
    periodic: bool = False,
    name: str = "table",
    inputs: Sequence[str] | None = None,
    outputs: Sequence[str] | None = None,
) -> ct.NonlinearIOSystem:
    """A torque as a table over one signal: input the signal, output d (N m).

    d = scale f(signal), f linear between the points and constant outside them. With two rows of
    values, one for w > 0 and one for w < 0, w is a second input and
    d = scale ((f_1 + f_2)/2 + (f_1 - f_2)/2 tanh(w/eps)).

    Parameters
    ----------
    signal : str
        "theta" (rad), "w" (rad/s), "t" (s; the block then has no input for it) or "u" (N m).
    points : (n,) array_like
        Increasing, at least two.
    values : (n,) or (2, n) array_like
        Torque in N m that resists positive w; two rows for the two directions of w.
    periodic : bool
        For theta: f repeats every 2 pi, and the points lie within one turn.
    name, inputs, outputs : str, list of str
        Block name and, in order, other names for the signals.

    Returns
    -------
    control.NonlinearIOSystem
        Without states; parameters ``table.scale`` (1) and, for two rows, ``table.eps`` (1e-6
        rad/s, as in the ``coulomb`` law).

    Raises
    ------
    InputError
        For another signal, points that do not increase, shapes that do not fit, or NaN.

    Notes
    -----
    Corners are rounded over one fiftieth of the distance between points, which changes f there
    by at most one hundredth of its second difference. A periodic table and all its derivatives
    repeat every 2 pi.

    Examples
    --------
    A cogging torque that was measured at four angles of a turn:

    >>> angles = [0.0, 1.5708, 3.1416, 4.7124]
    >>> cogging = lg.tabulated("theta", angles, [0.0, 0.05, 0.0, -0.05], periodic=True)
    >>> np.round(cogging.output(0.0, [], [0.7854]), 4)  # half way, in N m
    array([0.025])
    """
    if signal not in SIGNALS:
        raise InputError(f"{name}: no table over {shown(signal)}; known: {', '.join(SIGNALS)}.")
    x, rows = array(points, f"{name}: points"), np.atleast_2d(array(values, f"{name}: values"))
    if x.ndim != 1 or len(x) < 2 or not np.all(np.isfinite(x)) or np.any(np.diff(x) <= 0.0):
        raise InputError(f"{name}: points must be at least two increasing numbers.")
    if rows.ndim != 2 or len(rows) not in (1, 2) or rows.shape[1] != len(x):
        raise InputError(
            f"{name}: values have the shape {rows.shape}; give one for each of the "
            f"{len(x)} points, or two rows of them for the two directions of w."
        )
    if not np.all(np.isfinite(rows)):
        raise InputError(f"{name}: values must be finite numbers.")
    if rows.shape[0] == 2 and signal == "w":
        raise InputError(f"{name}: a table over w covers both directions; give one row of values.")
    if periodic:
        if signal != "theta" or x[-1] - x[0] >= TURN:
            raise InputError(
                f"{name}: a periodic table must be over theta, with points within one turn."
            )
    line = _ring if periodic else _line
    made = _Lines(signal, bool(periodic), tuple(line(x, y) for y in rows)).block()
    return made.system(name=name, inputs=inputs, outputs=outputs)
