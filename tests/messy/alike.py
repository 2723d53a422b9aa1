"""Which other effects explain a record as well, by inverse dynamics along the true motion.

The true torque of the effect is fitted with what the declared structure may absorb and with each
other effect. What that leaves is compared with the background and with what the effect shows.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from scipy.signal import bilinear, lfilter

from .effects import held, hidden
from .machine import Machine
from .plant import RATE, njit

POINTS = 3000
LIKE = 0.35  # of the background, and of what the effect shows
ON_FRICTION = {
    "position_dependent_friction",
    "coulomb_asymmetry",
    "load_dependent_friction",
    "friction_step",
    "rough_patch",
    "thermal_drift",
}


def alike(
    drawn: Any, run: dict[str, np.ndarray], torque: np.ndarray, dull: float = 0.0
) -> tuple[float, frozenset[str]]:
    """RMS torque that the declared structure cannot absorb, and the names that fit as well.

    Below ``dull`` N m no names are searched for.
    """
    m = drawn.machine
    seen_by = _Fit(drawn, run, torque)
    seen = _rms(seen_by.target)
    if seen < dull:
        return seen, frozenset()
    limit = LIKE * min(seen_by.level, seen)
    least: dict[str, float] = {}
    for name, columns in _candidates(drawn, m, seen_by):
        least[name] = min(least.get(name, np.inf), seen_by.left(columns))
    return seen, frozenset(n for n, left in least.items() if left < limit and n != drawn.name)


class _Fit:
    """The effect's torque, the base, and the signals at some thousand instants."""

    def __init__(self, drawn: Any, run: dict[str, np.ndarray], torque: np.ndarray) -> None:
        m, name = drawn.machine, drawn.name
        self.run = run
        moving = np.flatnonzero(np.abs(run["w"]) > m.vs)  # at rest friction may be anything
        self.kept = moving[:: max(len(moving) // POINTS, 1)]
        self.theta, self.w, self.a, self.t = (self.cut(run[k]) for k in ("theta", "w", "a", "t"))
        bristle, viscous = run["bristle"], run["viscous"]
        if name == "thermal_drift":
            ratio = torque / np.where(bristle + viscous == 0, 1, bristle + viscous)
            bristle, viscous = bristle * (1 - ratio), viscous * (1 - ratio)
        elif name in ON_FRICTION:
            bristle = bristle - torque
        self.s = self.cut(bristle) / m.Fc
        self.viscous = self.cut(viscous)
        still = np.tanh(self.w / m.vs)
        near = np.exp(-((np.abs(self.w) / m.vs) ** m.delta))
        base = [self.a, self.s, self.w, self.viscous, still, still * near]
        if m.gravity > 0:
            base += [np.sin(self.theta), np.cos(self.theta)]
        self.base = _basis(base)
        self.target = self.free(self.cut(torque))
        self.level = self._level(drawn)

    def cut(self, x: np.ndarray) -> np.ndarray:
        """A signal at the instants of the fit."""
        return x[self.kept]

    def free(self, x: np.ndarray) -> np.ndarray:
        """What the base does not absorb."""
        return x - self.base @ (self.base.T @ x)

    def left(self, columns: list[np.ndarray]) -> float:
        """RMS torque that the base and ``columns`` leave of the effect."""
        basis = _basis([self.free(c) for c in columns])
        return _rms(self.target - basis @ (basis.T @ self.target))

    def _level(self, drawn: Any) -> float:
        """RMS torque of the background and of the sensors' noise near 10 Hz, N m."""
        m, run = drawn.machine, self.run
        names = [n for n in drawn.quiet if n != "encoder"]
        parts = [self.free(self.cut(hidden(n, drawn.quiet[n], m, run))) for n in names]
        size, order, _ = drawn.quiet.get("encoder", (0.0, 1, 0.0))
        parts.append(m.J * size * (order * self.w) ** 2 / 1.41)
        parts.append(drawn.warm[0] * (1 - np.exp(-self.t / drawn.warm[1])) * self.s * m.Fc / 2)
        noise = m.J * 2 * np.pi / m.counts * 0.3 * (2 * np.pi * 10) ** 2
        noise += m.current[0] * 0.2 if m.u == "current" else 0.0
        return float(np.sqrt(sum(_rms(p) ** 2 for p in parts) + noise**2))


def _basis(columns: list[np.ndarray]) -> np.ndarray:
    """Orthonormal columns; what is almost dependent is dropped."""
    x = np.stack([c / max(_rms(c), 1e-300) for c in columns], 1)
    u, s, _ = np.linalg.svd(x, full_matrices=False)
    return u[:, s > 1e-6 * s[0]]


def _candidates(drawn: Any, m: Machine, f: _Fit) -> Iterator[tuple[str, list[np.ndarray]]]:
    """Every effect on a grid of what enters it other than linearly."""
    theta, w, s = f.theta, f.w, f.s
    moving = s * np.tanh(w / m.vs)
    yield "constant_torque", [np.ones_like(theta)]
    yield "coulomb_asymmetry", [moving]
    yield "viscous_asymmetry", [np.abs(w)]
    yield "quadratic_drag", [w * np.abs(w)]
    for rest in np.linspace(*np.quantile(theta, [0, 1]), 9):  # farther off it is a constant
        yield "return_spring", [theta - rest]
    if m.gravity > 0:
        yield "load_dependent_friction", [np.abs(np.sin(theta)) * s]
    u = f.cut(f.run["acting"])
    for order in range(1, 61):
        waves = [np.sin(order * theta), np.cos(order * theta)]
        yield "gravity" if order == 1 else "torque_ripple", waves
        yield "position_dependent_friction", [s * x for x in waves]
        yield "torque_constant_ripple", [u * x for x in waves]
    yield from _in_time(f)
    yield from _in_command(m, f)
    for q in np.linspace(0.4, 0.98, 25):  # touched all the time it is a spring
        yield "hard_stop", [np.maximum(theta - np.quantile(theta, q), 0)]
        yield "hard_stop", [np.minimum(theta - np.quantile(theta, 1 - q), 0)]
    yield from _two_mass(drawn, m, f)


def _in_time(f: _Fit) -> Iterator[tuple[str, list[np.ndarray]]]:
    t, end = f.t, f.t[-1]
    for tau in end * np.array([0.1, 0.2, 0.35, 0.5, 0.8]):
        grown = 1 - np.exp(-t / tau)
        yield "thermal_drift", [grown * f.s, grown * f.viscous]
    for t0 in np.linspace(0.1, 0.9, 33) * end:
        yield "friction_step", [f.s * (t >= t0)]
        yield "inertia_step", [f.a * (t >= t0)]
    hertz = np.arange(2, 200, 0.5) / end  # two periods at least
    power = np.abs(np.exp(-2j * np.pi * hertz[:, None] * t[::3]) @ f.target[::3])
    for i in np.argsort(power)[-8:]:
        phase = 2 * np.pi * hertz[i] * t
        yield "periodic_disturbance", [np.sin(phase), np.cos(phase)]


def _in_command(m: Machine, f: _Fit) -> Iterator[tuple[str, list[np.ndarray]]]:
    u = f.run["command"]
    logged = held(m, u)
    for beyond in (1e-3, 2e-3, 3e-3, 4e-3, 5e-3, 6e-3, 8e-3, 10e-3):
        late = beyond + 0.5 * m.every / RATE
        n = int(late * RATE)
        yield "input_delay", [f.cut(logged - np.concatenate([np.full(n, u[0]), u[:-n]]))]
        keep = np.exp(-1 / (RATE * late))
        yield "actuator_lag", [f.cut(logged - lfilter([1 - keep], [1, -keep], u))]
    for width in np.geomspace(0.02, 0.5, 8) * np.quantile(np.abs(u), 0.9):
        yield "actuator_dead_zone", [f.cut(np.clip(u, -width, width))]


def _two_mass(drawn: Any, m: Machine, f: _Fit) -> Iterator[tuple[str, list[np.ndarray]]]:
    """A load behind a spring; behind a gap as well where the truth is one of the two."""
    p = drawn.parameters
    own = [2 * np.pi * hz for hz in (3, 5, 8, 12, 20, 32)]
    if "load_inertia" in p:
        true = np.sqrt(p["stiffness"] / p["load_inertia"])
        own += [true * k for k in (0.4, 0.55, 0.7, 0.8, 0.9, 1.0, 1.1)]
    for omega in own:
        for zeta in (0.03, 0.1, 0.3):
            b, a = bilinear([2 * zeta * omega, omega**2], [1, 2 * zeta * omega, omega**2], RATE)
            yield "elastic_coupling", [f.cut(lfilter(b, a, f.run["a"]))]
    if drawn.name == "elastic_coupling":
        twist = _rms(f.run["shaft"]) / p["stiffness"]
        for gap in (0.3 * twist, twist, 3 * twist):
            for k in (0.9, 1.0, 1.15, 1.4):
                parts = (p["load_inertia"], k * p["stiffness"], p["damping"], gap)
                yield "backlash", [f.cut(_shaft(f.run["theta"], f.run["w"], *parts))]


@njit(cache=True)
def _shaft(theta, w, load, stiffness, damping, gap):
    """Torque of a load behind a gap that follows a given motion."""
    h = 0.25 / RATE
    angle, speed = theta[0], w[0]
    out = np.zeros(len(theta))
    for k in range(len(theta)):
        for i in range(4):
            twist = theta[k] + i * h * w[k] - angle
            open_ = max(abs(twist) - 0.5 * gap, 0.0) * np.sign(twist)
            shaft = 0.0
            if open_ != 0.0:
                shaft = stiffness * open_ + damping * (w[k] - speed)
                if shaft * open_ < 0:
                    shaft = 0.0
            speed += h * shaft / load
            angle += h * speed
            out[k] += 0.25 * shaft
    return out


def _rms(x: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.square(x))))
