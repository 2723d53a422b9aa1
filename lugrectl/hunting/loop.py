"""A PID position loop around a rigid drive: its sliding curve, its units, and its gains, with the
values of them at which something begins or ends.

J dw/dt = u - F(w), de/dt = w, u = -(kp e + ki int e + kd w). Units: e in Fs/kp, torque in Fs, time
in 1/wn = sqrt(J/kp). What is left of the gains is delta = kd/sqrt(kp J) and rho = ki/(kp wn); the
linear loop is stable iff delta > rho (Routh). Many loops and starts at once are lanes.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache, cached_property
from typing import Any

import numpy as np
from scipy.linalg import expm

from ..blocks.friction import free_level, level
from ..blocks.model import Model
from ..core.errors import InputError
from ..core.validation import number, positive, shown

REST = 1e-12  # rad/s, where a curve is read for a speed of 0: its limit, not the sign of 0
SHARP = 1e-15  # rad/s, the width of a smooth sign: far below REST
PROBED = np.geomspace(1e-6, 1e3, 200)  # speeds in rad/s at which a curve is compared with a line
STRAIGHT = 1e-9  # of Fs, by which a straight curve may differ from its line
STEP, PER_OCTAVE, ENOUGH = 0.05, 100, 1e-3  # of an L1 norm: units of time, steps, relative tail


@dataclass(frozen=True)
class Curve:
    """F(|w|) in N m between two sticks, its limit Fs at rest, and whether it is Fs + Fv |w|."""

    torque: Callable[[Any], Any]

    @cached_property
    def Fs(self) -> float:
        return float(self.torque(np.array([REST]))[0])

    def drop(self, speed: np.ndarray) -> np.ndarray:
        """(Fs - F)/Fs: what sliding takes off the friction."""
        return 1.0 - self.torque(np.maximum(speed, REST)) / self.Fs

    @property
    def viscous(self) -> float:
        """N m s/rad, the slope of F at high speed."""
        F = self.torque(PROBED[-2:])
        return float((F[1] - F[0]) / (PROBED[-1] - PROBED[-2]))

    @cached_property
    def most(self) -> float:
        """The largest |F - Fv w|, N m."""
        return max(self.Fs, float(np.abs(self.torque(PROBED) - self.viscous * PROBED).max()))

    def is_straight(self) -> bool:
        """Whether the law is Coulomb and viscous friction alone."""
        F = self.torque(PROBED)
        return bool(np.abs(F - self.Fs - self.viscous * PROBED).max() <= STRAIGHT * abs(F[-1]))

    def compensated(self, share: float, vd: float, scale: float) -> Curve:
        """Return ``scale`` times the curve with ``share`` of the curve added to the torque: in
        proportion to the speed below ``vd``, so that nothing is added at rest."""
        return Curve(lambda w: self.torque(w) * (scale - share * np.minimum(1.0, w / vd)))


def curve_of(model: Model) -> Curve:
    """Return the sliding curve of a model: of a law with states, its level h(w) + Fv w."""
    block, values = model.friction.block, dict(model.friction.values)
    unknown = [k for k, v in {"J": model.J, **values}.items() if v is None]
    if unknown:
        raise InputError(f"{model.name}: hunting needs {', '.join(unknown)}: give a value.")
    if block.states:
        if "Fc" not in values:
            raise InputError(
                f"the law {block.name} has states and no Fc: its sliding curve is not known."
            )
        Fc, delta, Fv = values["Fc"], values.get("delta"), values.get("Fv", 0.0)
        shape = Fc, values.get("Fs", Fc), values.get("vs", 1.0)
        if delta is None:
            return Curve(lambda w: level(w, *shape) + Fv * w)
        return Curve(lambda w: free_level(w, *shape, delta) + Fv * w)
    values |= {k: SHARP for k, p in block.parameters.items() if p.smooths}
    values = block.defaults() | values  # bound once: it is asked at each stage of each step
    return Curve(lambda w: block(w, **values)[0] + 0.0 * w)


@dataclass(frozen=True)
class Lanes:
    """delta, rho and the unit of speed in rad/s, each (n,); ``fall`` of a speed in rad/s. A stick
    at an error of at most ``calm`` (units) is known to come to rest; a swing beyond ``large`` grows
    without bound."""

    delta: np.ndarray
    rho: np.ndarray
    speed: np.ndarray
    fall: Callable[[np.ndarray], np.ndarray]
    calm: float = 0.0
    large: float = 300.0

    def __getitem__(self, which: np.ndarray) -> Lanes:
        own = (self.delta[which], self.rho[which], self.speed[which])
        return Lanes(*own, self.fall, self.calm, self.large)

    def many(self, count: int) -> Lanes:
        """Return so many lanes of the first loop."""
        return self[np.zeros(count, int)]

    def drop(self, a: np.ndarray) -> np.ndarray:
        """1 - F/Fs at the speed a."""
        return self.fall(a * self.speed)


@dataclass(frozen=True)
class Loop:
    """A PID position loop around a rigid drive."""

    curve: Curve
    J: float
    kp: float
    ki: float
    kd: float

    @classmethod
    def of(cls, model: Model, gains: Mapping[str, float]) -> Loop:
        return cls(curve_of(model), float(model.J or 0.0), **gains)

    @property
    def wn(self) -> float:
        """1/s, the frequency that is the unit of time."""
        return float(np.sqrt(self.kp / self.J))

    @property
    def unit(self) -> float:
        """rad, the error at which kp alone breaks away."""
        return self.curve.Fs / self.kp

    @property
    def speed(self) -> float:
        """rad/s, the unit of speed."""
        return self.unit * self.wn

    def lanes(self, count: int) -> Lanes:
        """Return so many lanes of this loop."""
        return together([self], count)

    def is_stable(self) -> bool:
        """Whether fast motion decays (Routh): (kd + Fv) kp > ki J with the slope Fv of F there."""
        return (self.kd + self.curve.viscous) * self.kp > self.ki * self.J

    @cached_property
    def matrix(self) -> np.ndarray:
        """The loop without friction: the rates of e, w and the integral's torque by these."""
        gains = [-self.kp / self.J, -self.kd / self.J, 1.0 / self.J]
        return np.array([[0.0, 1.0, 0.0], gains, [-self.ki, 0.0, 0.0]])

    @cached_property
    def largest(self) -> tuple[float, float]:
        """The largest speed, and error, that friction can keep up about a steady motion, in units;
        inf where fast motion grows."""
        if not self.is_stable():
            return np.inf, np.inf
        # |F - Fv w| is bounded: that bound times the L1 norm from torque to each of the linear
        # loop, a sum over steps that double as motion gets slower
        own = self.matrix.copy()
        own[1, 1] -= self.curve.viscous / self.J
        step = STEP / self.wn
        M, x, total = expm(step * own), np.array([0.0, 1.0 / self.J, 0.0]), np.zeros(2)
        last = total + np.inf
        while np.any(last > ENOUGH * total):
            last = np.zeros(2)
            for _ in range(PER_OCTAVE):
                x = M @ x
                last += step * np.abs(x[:2])
            total, M, step = total + last, M @ M, 2.0 * step
        error, speed = total * self.curve.most / self.unit
        return float(speed / self.wn), float(error)


def together(loops: list[Loop], count: int) -> Lanes:
    """Return ``count`` lanes of each loop, one loop after the other, all with one sliding curve."""
    rows = [(g.kd / np.sqrt(g.kp * g.J), g.ki / (g.kp * g.wn), g.speed) for g in loops]
    delta, rho, speed = np.repeat(np.array(rows), count, axis=0).T
    return Lanes(delta, rho, speed, loops[0].curve.drop)


GAINS = ("kp", "ki", "kd")
ALL = (*GAINS, "kv")
PAPER = {"kp": 15.0, "ki": 1.55, "kd": 0.0}  # the source paper's position loop
SCANNED = 9  # values of a gain between its ends
CLOSE = np.exp(1e-3)  # ratio of the two values between which a critical one lies

Hunts = Callable[..., bool | None]


def varied(*values: Any) -> Callable[..., dict[str, float]]:
    """Return kp, ki and kd of the PID by gains that are changed, from kp, ki, kd and kv."""
    own = {k: v for k, v in zip(ALL, values, strict=True) if v is not None}
    return lambda **changed: pid_gains(**(own or PAPER) | changed)


def pid_gains(kp: Any = None, ki: Any = None, kd: Any = None, kv: Any = None) -> dict[str, float]:
    """Return kp, ki and kd of the PID, 0 for those left out."""
    given = zip(GAINS, (kp, ki, kd), strict=True)
    gains = {k: number(0.0 if v is None else v, k) for k, v in given}
    if kv is not None:
        if kd is not None:
            raise InputError("with kv the loop is a cascade, which has no kd: give one of them.")
        kp, ki, kd = cascade_as_pid(number(kv, "kv"), gains["kp"], gains["ki"])
        gains = {"kp": kp, "ki": ki, "kd": kd}
    for k, v in gains.items():
        if v < 0.0 or (k == "kp" and v == 0.0):
            raise InputError(f"{k} = {v:g}: a position loop needs kp above 0, ki and kd from 0 on.")
    return gains


def cascade_as_pid(kv: Any, kp: Any, ki: Any, dt: float = 0.0) -> tuple[Any, Any, Any]:
    """Return kp, ki and kd of the PID that u = -(kp + ki int)(kv e + w) is."""
    # with a step dt w is a difference and the integral that of trapezoids: int w = e - w dt/2
    return kp * kv + ki, ki * kv, kp - 0.5 * dt * ki


def ranges(given: Any, what: str, names: tuple[str, ...] = ALL) -> dict[str, tuple[float, float]]:
    """Return gains and their ends; InputError names the argument."""
    if isinstance(given, Mapping) and (unknown := [k for k in given if k not in names]):
        raise InputError(
            f"{what}: there is no gain {shown(unknown[0])}; known: {', '.join(names)}."
        )
    if not isinstance(given, Mapping) or not given:
        example = '{"ki": (1, 50)}'
        raise InputError(f"{what} must be gains and their ends, {example}, not {shown(given)}.")
    made = {}
    for name, ends in given.items():
        if not isinstance(ends, (tuple, list)) or len(ends) != 2:
            raise InputError(f"{what}: {name} needs its two ends, not {shown(ends)}.")
        low, high = (positive(v, f"{what}: {name}") for v in ends)
        if low >= high:
            raise InputError(f"{what}: {name} goes from {low:g} to {high:g}; give them increasing.")
        made[name] = (low, high)
    return made


def edge(
    holds: Callable[[float], bool],
    a: float,
    b: float,
    ratio: float = CLOSE,
    ends: Callable[[], bool] = lambda: False,
) -> tuple[float, float]:
    """Bisect to the last value from a towards b at which it holds, and the next at which it does
    not, until they are as near as ``ratio``."""
    while abs(np.log(b / a)) > np.log(ratio) and not ends():
        middle = float(np.sqrt(a * b))
        a, b = (middle, b) if holds(middle) else (a, middle)
    return a, b


def critical(hunts: Hunts, vary: Mapping[str, tuple[float, float]], what: str) -> dict[str, Any]:
    """Find by gain where ``hunts(ki=...)`` changes, and say where ``what`` begins and ends."""
    values, said = {}, []
    for name, ends in vary.items():
        changes, first = _changes(cache(lambda v, name=name: hunts(**{name: v})), *ends)
        values[name] = tuple(value for value, _ in changes)
        where = {True: "every value", False: "no value", None: "no value that is decided"}[first]
        words = [
            f"{'begins' if begins else 'ends'} "
            + (f"at {v:.4g}" if np.isscalar(v) else "between {:.4g} and {:.4g}".format(*v))
            for v, begins in changes
        ] or ["neither begins nor ends: it is there at {} from {:g} to {:g}".format(where, *ends)]
        said.append(f"as {name} rises, {what} {', '.join(words)}")
    return {"critical": values, "messages": tuple(said)}


def _changes(
    at: Callable[[float], bool | None], low: float, high: float
) -> tuple[list[tuple[Any, bool]], bool | None]:
    """Scan in even ratios, then bisect to each change, and whether something begins there; and
    the first answer. Two ends where it is None, undecided, between them."""

    def change(a: float, b: float) -> Any:
        """Where the answer at a ends, and that at b begins if it is later."""
        a, middle = edge(lambda v: at(v) == at(a), a, b)
        if at(middle) == at(b):
            return float(np.sqrt(a * middle))
        return a, edge(lambda v: at(v) == at(b), b, middle)[0]

    sure = [v for v in map(float, np.geomspace(low, high, SCANNED)) if at(v) is not None]
    pairs = zip(sure, sure[1:], strict=False)
    changes = [(change(a, b), bool(at(b))) for a, b in pairs if at(a) != at(b)]
    return changes, at(sure[0]) if sure else None
