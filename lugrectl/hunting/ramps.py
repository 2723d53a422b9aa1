"""Stick-slip under the reference r = v t: at which speeds it persists, and its state there.

By the map from breakaway to breakaway, or by simulation where friction has states.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import control as ct
import numpy as np

from ..blocks import controllers
from ..blocks.model import Model
from ..blocks.plant import plant
from ..simulation.response import simulate
from .loop import Lanes, Loop
from .simulated import quietly
from .stick_map import STICKS, next_stick

SMALLEST = 0.03  # units, of the errors at breakaway from which a search starts
ERRORS, STARTS = 16, 8  # so many of them for the map, and for a simulation
ALIKE = 1e-4  # relative change from breakaway to breakaway of what repeats
FOLLOWED = 4  # images of the errors at breakaway of a speed
SLOW, STRIDE = 0.2, 0.3  # shares of the way to where it repeats: of a slow breakaway, of a stride
SLOWEST = 3e-4  # the least such share that is known
ROUNDS, BRIEF = 60, 12  # slips, after which what still sticks persists, or may do so
PERIODS, STICK, WAITS = 20.0, 15.0, 3.0  # 2 pi/wn, Fs/(kp v) and kp/ki that a part of a run lasts
PARTS, POINTS = 8, 3000  # parts of a run, at most, and points of a part
STEADY = 0.99  # relative size of the error's swing in a part and the one before: it persists
STILL, FAST = 0.1, 0.5  # of v: a drive that is slower sticks; one that is always faster slides
SHARE = 0.9  # of the torque at breakaway: a stick in which a run begins


def _errors(loop: Loop, error: float, count: int) -> np.ndarray:
    """Errors x at breakaway up to ``error``, units; without ki all breakaways are one, at 1."""
    x = np.geomspace(SMALLEST, max(error, 1.0), count // 2)
    return np.r_[-x, x] if loop.ki else np.ones(1)


class RampMap:
    """Stick-slip of a rigid drive; its state is the error at breakaway, units."""

    def __init__(self, loop: Loop) -> None:
        self.loop = loop

    def candidates(self, v: np.ndarray, error: float) -> Iterator[tuple[float, float]]:
        """Speeds at which stick-slip goes on for a while, and its state; highest first."""
        starts = np.tile(_errors(self.loop, error, ERRORS), (len(v), 1))
        found = persisting(self.loop, v, starts, BRIEF)
        for k in np.flatnonzero(np.isfinite(found))[::-1]:
            yield float(v[k]), float(found[k])

    def followed(self, v: np.ndarray, x: float) -> list[float | None]:
        """Where stick-slip from a state persists: the state then."""
        found = persisting(self.loop, v, np.full((len(v), 1), x), ROUNDS)
        return [float(x) if np.isfinite(x) else None for x in found]


class RampRuns:
    """Stick-slip of a drive whose friction has states; its state is that of the loop.

    The loop is that of e = theta - v t, so that nothing in it grows but theta.
    """

    def __init__(self, model: Model, loop: Loop) -> None:
        frame = ct.nlsys(
            lambda t, x, u, p: [u[0] - u[1]], lambda t, x, u, p: x, inputs=["w", "v"],
            outputs=["e"], states=["e"], name="frame",
        )  # fmt: skip
        parts = [plant(model), frame, controllers.pid(loop.kp, loop.ki, loop.kd)]
        self.system = ct.interconnect(
            parts, inputs=["v"], outputs=["w", "e"], check_unused=False, name="loop"
        )
        self.model, self.loop = model, loop

    def run(self, v: float, state: Any) -> Any:
        """The state after a stick-slip that persists at v; None: it slides on."""
        loop = self.loop
        span = PERIODS * 2.0 * np.pi / loop.wn + STICK * loop.curve.Fs / (loop.kp * v)
        span = max(span, WAITS * loop.kp / loop.ki if loop.ki else 0.0)
        t, swing, slowest = np.linspace(0.0, span, POINTS), np.inf, 0.0
        for _ in range(PARTS):
            done = quietly(simulate, self.system, t, {"v": v}, state)
            w, e = np.asarray(done.outputs)[:, POINTS // 5 :]
            was, swing, slowest = swing, float(np.ptp(e)), float(w.min())
            if slowest > FAST * v:
                return None
            state = np.asarray(done.states)[:, -1]
            state[0] = 0.0  # theta, which nothing reads
            if slowest < STILL * v and STEADY * was < swing < was / STEADY:
                return state
        return state if slowest < STILL * v else None

    def candidates(self, v: np.ndarray, error: float) -> Iterator[tuple[float, Any]]:
        """Speeds at which stick-slip persists, and its state; highest first."""
        starts = [self._stuck(-x * self.loop.unit) for x in _errors(self.loop, error, STARTS)]
        for speed in map(float, v[::-1]):
            found = (self.run(speed, start) for start in starts)
            state = next((s for s in found if s is not None), None)
            if state is not None:
                yield speed, state

    def followed(self, v: np.ndarray, state: Any) -> list[Any]:
        """Where stick-slip from a state persists, from speed to speed: the state then."""
        made = []
        for speed in v:
            state = self.run(float(speed), state)
            made.append(state)
            if state is None:
                break
        return made

    def _stuck(self, e: float) -> list[float]:
        """A stick at the error e, or without ki at the torque's, before it breaks away."""
        loop, friction = self.loop, self.model.friction
        u = SHARE * loop.curve.Fs
        bends = [u / float(friction.values["sigma0"] or np.inf)]
        bends += [0.0] * (len(friction.block.states) - 1)
        own = [e, (u + loop.kp * e) / loop.ki] if loop.ki else [-u / loop.kp, 0.0]
        return [0.0, 0.0, *bends, *own]


def next_breakaway(lanes: Lanes, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the error x of the next breakaway under a reference, and whether there is one.

    A stick begins at an excess -2 <= y <= 0 and ends at 0, or backward at -2.
    """
    stop, v = next_stick(lanes, x), np.asarray(lanes.drift)
    rate, bend = v + lanes.rho * stop.x, lanes.rho * v
    with np.errstate(all="ignore"):
        back, ahead = rate**2 - 2.0 * bend * (stop.y + 2.0), np.sqrt(rate**2 - 2.0 * bend * stop.y)
        forward = np.where(rate > 0.0, -2.0 * stop.y / (rate + ahead), (ahead - rate) / bend)
        backward = 2.0 * (stop.y + 2.0) / (np.sqrt(np.maximum(back, 0.0)) - rate)
        new = stop.x + v * np.where((rate < 0.0) & (back >= 0.0), backward, forward)
    return new, stop.fate == STICKS


def persisting(loop: Loop, v: np.ndarray, x: np.ndarray, rounds: int) -> np.ndarray:
    """Return an error at breakaway that follows so many others, units, at each speed; nan: none.

    ``x`` (n, count) are the first errors of each speed v in rad/s. Where a slow integral lets the
    error change alike from breakaway to breakaway, many of them are taken in one stride.
    """
    place, made = np.repeat(np.arange(len(v)), x.shape[1]), np.full(len(v), np.nan)
    lanes, x = loop.lanes(len(place), v[place]), x.ravel()
    was, stride = np.full(len(x), np.nan), np.ones(len(x))
    for k in range(rounds):
        new, sticks = next_breakaway(lanes, x)
        change = new - x
        nearing = np.clip(np.nan_to_num((1.0 - change / was) / stride, nan=1.0), -1.0, 1.0)
        close = ALIKE * (np.abs(x) + np.asarray(lanes.drift)) * np.clip(nearing, SLOWEST, 1.0)
        repeats = sticks & (np.abs(change) <= close)
        made[place[repeats]] = new[repeats]
        goes = sticks & np.isnan(made[place])
        if k == 0:
            goes &= _some(place, new, goes)
        slow = np.abs(nearing) < SLOW
        stride = np.where(slow, STRIDE / np.maximum(np.abs(nearing), SLOWEST), 1.0)[goes]
        was = change[goes]
        lanes, place, x = lanes[goes], place[goes], x[goes] + stride * was
        if not len(x):
            break
    made[place] = x
    return made


def _some(place: np.ndarray, x: np.ndarray, among: np.ndarray) -> np.ndarray:
    """A few of the lanes at each speed, from the smallest error to the largest."""
    chosen = np.zeros(len(x), bool)
    for one in np.unique(place[among]):
        own = np.flatnonzero(among & (place == one))
        own = own[np.argsort(x[own])]
        chosen[own[np.linspace(0, len(own) - 1, FOLLOWED).astype(int)]] = True
    return chosen
