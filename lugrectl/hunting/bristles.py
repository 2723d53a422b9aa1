"""A loop whose friction has states (bristles): its cycles, and steady sliding.

At e = 0, w < 0 the state is x = (w, I, z, ...): speed, torque of the integral, and the friction's
states. The half turn to the next e = 0, with all signs changed, is a map of x; its fixed points are
the symmetric cycles, unstable ones too, and the eigenvalues of its slope their multipliers of half
a turn.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, root

from ..blocks.model import Model
from ..core.errors import Refused
from .loop import Loop
from .result import Cycle
from .rigid import Half, repeated

NUDGE = 1e-4  # of a state, by which a slope is measured
RTOL = 1e-9  # of a half turn
SETTLES = 6  # half turns towards a cycle that attracts
SAME = 1e-3  # relative difference of two amplitudes that are one
WAIT = 400.0  # times kp/ki: the longest half turn
NEAR = 1e-6  # relative step of a difference about steady sliding
SPEEDS = np.geomspace(1e4, 1e-8, 400)  # rad/s, at which sliding is looked at
ROUNDING = 1e-6  # of wn: elements that slip together have an eigenvalue of 0
BENDS = 100.0  # times its bend that a bristle is dragged


def known(model: Model) -> bool:
    """Whether the drive is a mass and a law of w with bristles of stiffness sigma0, no more."""
    law = model.friction.block
    own = bool(law.states) and law.reads == ("w",) and "sigma0" in model.friction.values
    return own and not model.effects


class Bristles:
    """The loop J dw/dt = u - F with a friction law that may have states."""

    def __init__(self, model: Model, loop: Loop) -> None:
        self.loop, self.law = loop, model.friction.block
        self.values = self.law.defaults() | dict(model.friction.values)
        self.count, self.bend, self.z = len(self.law.states), 0.0, np.zeros(0)
        if self.count:
            if not known(model):
                raise Refused(f"{self.law.name} is no law of w with sigma0: stick-slip is unknown.")
            self.bend = loop.curve.Fs / float(self.values["sigma0"] or 0.0)
        self.scale = np.array([loop.speed, loop.curve.Fs, *[self.bend] * self.count])

    def friction(self, w: float, z: np.ndarray) -> np.ndarray:
        """F and dz/dt."""
        if not self.count:
            return np.array([float(self.loop.curve.torque(np.array([w]))[0])])
        return np.array(self.law(w, *z, **self.values), float)

    def rates(self, t: float, state: np.ndarray) -> np.ndarray:
        F, *dz = self.law(state[1], *state[3:], **self.values)
        de, dw, dq = self.loop.matrix @ state[:3]
        return np.array([de, dw - F / self.loop.J, dq, *dz])

    def crossing(self, state: np.ndarray) -> tuple[np.ndarray, float, float] | None:
        """From a state to x at the next e = 0, with the time and the largest error."""
        side = np.sign(state[0]) or np.sign(state[1])

        def crossed(t: float, s: np.ndarray) -> float:
            return s[0] + (side * 1e-9 * self.loop.unit if t == 0.0 else 0.0)

        crossed.terminal, crossed.direction = True, -side  # type: ignore[attr-defined]
        span = WAIT * self.loop.kp / self.loop.ki
        atol = 1e-9 * np.r_[self.loop.unit, self.scale]
        options: Any = {"events": crossed, "rtol": RTOL, "atol": atol}
        done = solve_ivp(self.rates, (0.0, span), state, "LSODA", **options)
        if not len(done.t_events[0]):
            return None
        return done.y_events[0][0][1:], float(done.t_events[0][0]), float(np.abs(done.y[0]).max())

    def from_breakaway(self, e: float, turns: int) -> np.ndarray | None:
        """The state x so many half turns after the first crossing from breakaway at e > 0."""
        bent = [-self.bend] * self.count
        made = self.crossing(np.array([e, 0.0, self.loop.kp * e - self.loop.curve.Fs, *bent]))
        x = None if made is None else made[0]
        for _ in range(turns):
            if x is None or (ahead := self.half(x[:, None])) is None:
                return None
            x = ahead.x[:, 0]
        return x

    def half(self, states: np.ndarray) -> Half | None:
        """Half a turn from each state (n, k)."""
        made = []
        for x in states.T:
            one = self.crossing(np.r_[0.0, x]) if x[0] < 0.0 else None
            if one is None:
                return None
            made.append(one)
        x, t, size = zip(*made, strict=True)
        return Half(-np.array(x).T, np.array(t), np.array(size))

    def cycle(self, x: np.ndarray) -> Cycle | None:
        """The cycle near x."""
        made = repeated(
            self.half, x, lambda x: NUDGE * np.maximum(np.abs(x), 1e-3 * self.scale), self.scale
        )
        if made is None:
            return None
        size, period, turn = made
        return Cycle(size, period, bool(np.abs(turn[0]) < 1.0), tuple(np.real(turn).tolist()))

    def bent(self, v: float) -> np.ndarray:
        """z in steady sliding, found from that of the speed before."""
        if self.count and not len(self.z):
            span, z = (0.0, BENDS * self.bend / v), np.zeros(self.count)
            self.z = solve_ivp(lambda t, z: self.friction(v, z)[1:], span, z, "LSODA").y[:, -1]
        if self.count:
            done = root(lambda z: self.friction(v, z * self.bend)[1:], self.z / self.bend)
            self.z = done.x * self.bend
        return self.z

    def growth(self, v: float) -> float:
        """The largest real part of an eigenvalue of the loop linearized about w = v, 1/s; a
        rounding error counts as decay."""
        at = np.r_[v, self.bent(v)]
        steps = NEAR * np.r_[v, np.full(self.count, self.bend)]
        ends = [[self.friction(x[0], x[1:]) for x in (at + d, at - d)] for d in np.diag(steps)]
        slope = np.array([(a - b) / (2.0 * d) for (a, b), d in zip(ends, steps, strict=True)]).T
        A = np.zeros((3 + self.count, 3 + self.count))
        A[:3, :3], moved = self.loop.matrix, [1, *range(3, len(A))]
        A[1, moved] -= slope[0] / self.loop.J
        A[3:, moved] = slope[1:]
        if not self.loop.ki:
            A = np.delete(np.delete(A, 2, 0), 2, 1)
        return float(np.linalg.eigvals(A).real.max()) - ROUNDING * self.loop.wn

    def first_speed(self, v: np.ndarray, growth: np.ndarray) -> float:
        """The speed below which sliding is unstable; 0: at none."""
        unstable = np.flatnonzero(growth > 0.0)
        if not len(unstable) or not unstable[0]:
            return float(v[0]) if len(unstable) else 0.0
        return float(brentq(self.growth, v[unstable[0]], v[unstable[0] - 1]))  # type: ignore


def bristle_cycles(
    model: Model, loop: Loop, rigid: Iterable[Cycle], waited: Iterable[Cycle]
) -> tuple[Cycle, ...]:
    """Find the cycles that Newton reaches from those of the sliding curve, and from those found by
    waiting after some half turns; else the latter as they are."""
    own, found = Bristles(model, loop), []
    for start, turns in [*((c, 0) for c in rigid), *((c, SETTLES) for c in waited)]:
        x = own.from_breakaway(start.amplitude, turns)
        reached = None if x is None else own.cycle(x)
        cycle = start if turns and reached is None else reached
        if cycle and all(abs(cycle.amplitude / c.amplitude - 1.0) > SAME for c in found):
            found.append(cycle)
    return tuple(sorted(found, key=lambda c: c.amplitude))
