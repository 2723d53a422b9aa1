"""Cycles of a loop whose friction has states (bristles), unstable ones too: Newton on a section.

At e = 0, w < 0 the state is x = (w, I, z, ...): speed, torque of the integral, and the friction's
states. The half turn to the next e = 0, with all signs changed, is a map of x; its fixed points are
the symmetric cycles, and the eigenvalues of its slope their multipliers of half a turn.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from scipy.integrate import solve_ivp

from ..blocks.model import Model
from .lanes import Loop
from .result import Cycle

STEPS = 12  # of Newton
CLOSE = 1e-6  # relative distance of a half turn from its start that is a cycle
NUDGE = 1e-4  # of a state, by which a slope is measured
RTOL = 1e-9  # of a half turn
SETTLES = 6  # half turns towards a cycle that attracts
SAME = 1e-3  # relative difference of two amplitudes that are one
WAIT = 400.0  # times kp/ki: the longest half turn


def known(model: Model) -> bool:
    """Whether the drive is a mass and a law of w with bristles of stiffness sigma0, no more."""
    law = model.friction.block
    own = bool(law.states) and law.reads == ("w",) and "sigma0" in model.friction.values
    return own and not model.effects


class Half(NamedTuple):
    """A half turn: the state at its end with signs changed, its time, the largest error."""

    x: np.ndarray
    t: float
    size: float


class Bristles:
    """The loop J dw/dt = u - F with a friction law that has states."""

    def __init__(self, model: Model, loop: Loop) -> None:
        self.loop, self.law = loop, model.friction.block
        self.values = self.law.defaults() | dict(model.friction.values)
        self.bend = loop.curve.Fs / float(self.values["sigma0"] or 0.0)
        self.scale = np.array([loop.unit * loop.wn, loop.curve.Fs, *[self.bend] * self.count])

    @property
    def count(self) -> int:
        return len(self.law.states)

    def rates(self, t: float, state: np.ndarray) -> np.ndarray:
        F, *dz = self.law(state[1], *state[3:], **self.values)
        de, dw, dq = self.loop.matrix @ state[:3]
        return np.array([de, dw - F / self.loop.J, dq, *dz])

    def crossing(self, state: np.ndarray) -> tuple[np.ndarray, float, float] | None:
        """From a state to the next e = 0: the state there, the time, the largest error."""
        side = np.sign(state[0]) or np.sign(state[1])

        def crossed(t: float, s: np.ndarray) -> float:
            return s[0] + (side * 1e-9 * self.loop.unit if t == 0.0 else 0.0)

        crossed.terminal, crossed.direction = True, -side  # type: ignore[attr-defined]
        span = WAIT * self.loop.kp / self.loop.ki
        atol = 1e-9 * np.r_[self.loop.unit, self.scale]
        done = solve_ivp(
            self.rates, (0.0, span), state, "LSODA", events=crossed, rtol=RTOL, atol=atol
        )
        if not len(done.t_events[0]):
            return None
        return done.y_events[0][0], float(done.t_events[0][0]), float(np.abs(done.y[0]).max())

    def from_breakaway(self, e: float) -> np.ndarray | None:
        """The state x of the first crossing after breakaway at e > 0."""
        bent = [-self.bend] * self.count
        made = self.crossing(np.array([e, 0.0, self.loop.kp * e - self.loop.curve.Fs, *bent]))
        return None if made is None else made[0][1:]

    def half(self, x: np.ndarray) -> Half | None:
        if x[0] >= 0.0:
            return None
        made = self.crossing(np.r_[0.0, x])
        return None if made is None else Half(-made[0][1:], *made[1:])

    def newton(self, x: np.ndarray) -> Cycle | None:
        """The cycle near x."""
        for _ in range(STEPS):
            now = self.half(x)
            if now is None:
                return None
            steps = NUDGE * np.maximum(np.abs(x), 1e-3 * self.scale)
            nudged = [self.half(x + d) for d in np.diag(steps)]
            slope = [(h.x - now.x) / d for h, d in zip(nudged, steps, strict=True) if h]
            if len(slope) < len(x):
                return None
            A, missed = np.array(slope).T, now.x - x
            if np.abs(missed / self.scale).max() < CLOSE * abs(x[0]) / self.scale[0]:
                turn = np.linalg.eigvals(A) ** 2
                order = np.argsort(-np.abs(turn))
                real = tuple(float(m.real) for m in turn[order])
                return Cycle(now.size, 2.0 * now.t, bool(np.abs(turn).max() < 1.0), real)
            step = np.linalg.solve(A - np.eye(len(x)), -missed)
            x = x + step * min(1.0, 0.5 * abs(x[0]) / (abs(step[0]) + 1e-300))
        return None


def bristle_cycles(
    model: Model, loop: Loop, rigid: Iterable[Cycle], waited: Iterable[Cycle]
) -> list[Cycle]:
    """The cycles that Newton reaches from those of the sliding curve, from breakaway there, and
    from those that were found by waiting, after some half turns; else the latter as they are.
    """
    own, found = Bristles(model, loop), []
    for start, turns in [*((c, 0) for c in rigid), *((c, SETTLES) for c in waited)]:
        x = own.from_breakaway(start.amplitude)
        for _ in range(turns):
            ahead = None if x is None else own.half(x)
            x = None if ahead is None else ahead.x
        reached = None if x is None else own.newton(x)
        cycle = start if turns and reached is None else reached
        if cycle and all(abs(cycle.amplitude / c.amplitude - 1.0) > SAME for c in found):
            found.append(cycle)
    return sorted(found, key=lambda c: c.amplitude)
