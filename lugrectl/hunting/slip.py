"""A slip of a rigid loop, from w = 0 to w = 0, in the units of ``loop``: many lanes at once.

A slip in the direction of -e has the state (x, a, y): the error, the speed a = -w >= 0, and the
excess y = -u - Fs of the torque without damping over breakaway,

    dx/dt = v - a,    da/dt = y - delta a + (Fs - F(a)),    dy/dt = rho x + v - a,

with the speed v of the reference. It begins at a = 0 and y >= 0 and ends at a = 0 with y <= 0; at
v = 0 x is monotone, so that the largest error stands at an end. The excess is a state because it
keeps its digits where e is small.
Dormand and Prince, order 5 with an error of order 4; each lane has its own step.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.integrate import RK45

from .loop import Lanes

RTOL, FLOOR = 1e-7, 1e-3  # error of a step, relative to a state or to this part of its unit
SMALL = 1e-6  # of the start or the unit: an error and speed below it have come to rest
STEPS = 4000  # of one slip; a longer one creeps
MOVING, ROUGH = 1000, 1e-5  # STEPS and RTOL under a moving reference: some 40 periods of sliding
LOOK = 40  # steps, after which it is looked for creeping
NEARLY = 0.02  # relative difference of a creeping speed from rho x
AROUND = 0.8  # of the speed v: how far from steady sliding a slip may stay about it
ASIDE = np.linspace(-1.0, 1.0, 7)  # parts of that distance at which it must be damped
SLOWER = np.array([1.0, 0.5, 0.25, 0.125])[:, None]  # speeds at which a creep must be damped
FIRST = 1e-3  # the first step
A = np.vstack([np.pad(RK45.A[1:], ((0, 0), (0, 1))), RK45.B])  # stages, the last the new state


class End(NamedTuple):
    """Where slips end: error, excess and duration; ``rests`` where a slip creeps to zero, or where
    it follows a moving reference, and ends no more."""

    x: np.ndarray
    y: np.ndarray
    t: np.ndarray
    rests: np.ndarray


def slip(lanes: Lanes, x: np.ndarray, y: np.ndarray) -> End:
    """From a = 0 to the next a = 0 of each lane."""
    state, h, t = np.array([x, 0.0 * x, y]), np.full(len(x), FIRST), np.zeros(len(x))
    small = SMALL * np.minimum(1.0, np.abs(x)) if lanes.drift is None else 0.0 * x
    settles, steps, rtol = _creeps, STEPS, RTOL
    if lanes.drift is not None:
        settles, steps, rtol = _follows, MOVING, ROUGH
    rests, active = np.zeros(len(x), bool), np.arange(len(x))
    last = np.full(len(x), FIRST)  # the step in which a lane stops
    own, now, step, slope = lanes, state.copy(), h.copy(), _rates(lanes, state)
    for k in range(1, steps + 1):
        new, slopes = _stepped(own, now, step, slope)
        worst = _worst(now, new, step, slopes) * (RTOL / rtol)
        good = worst <= 1.0
        stops = good & (new[1] <= 0.0)
        crept = good & (np.abs(new[0]) < small[active]) & (new[1] < small[active])
        if k % LOOK == 0:
            crept |= good & ~stops & settles(own, new, slopes[-1])
        goes = good & ~stops & ~crept
        t[active[goes]] += step[goes]
        last[active[stops]], state[:, active[stops]] = step[stops], now[:, stops]
        rests[active[crept]] = True
        now, slope = np.where(goes, new, now), np.where(goes, slopes[-1], slope)
        step = step * np.clip(0.9 * np.maximum(worst, 1e-10) ** -0.2, 0.2, 5.0)
        left = ~(stops | crept)
        if not left.all():
            active, own = active[left], own[left]
            now, slope, step = now[:, left], slope[:, left], step[left]
        if not len(active):
            break
    rests[active] = True
    ends, more = _stopped(lanes, state, last)
    return End(ends[0], np.minimum(ends[2], 0.0), t + more, rests)


def _rates(lanes: Lanes, state: np.ndarray) -> np.ndarray:
    x, a, y = state
    ahead = -a if lanes.drift is None else lanes.drift - a
    return np.array([ahead, y - lanes.delta * a + lanes.drop(a), lanes.rho * x + ahead])


def _stepped(
    lanes: Lanes, state: np.ndarray, h: np.ndarray, slope: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """The state after a step, and the slopes of all stages; the last is that of the new state."""
    slopes, new = np.empty((7, *state.shape)), state
    rows, slopes[0] = slopes.reshape(7, -1), slope
    for k, row in enumerate(A, 1):
        new = state + h * (row[:k] @ rows[:k]).reshape(state.shape)
        slopes[k] = _rates(lanes, new)
    return new, slopes


def _worst(now: np.ndarray, new: np.ndarray, h: np.ndarray, slopes: np.ndarray) -> np.ndarray:
    """The largest error of a step by what is allowed."""
    size = np.maximum(np.abs(now), np.abs(new)) + FLOOR
    missed = (RK45.E @ slopes.reshape(7, -1)).reshape(now.shape)
    return np.max(np.abs(h * missed) / (RTOL * size), axis=0)


def _creeps(lanes: Lanes, state: np.ndarray, slope: np.ndarray) -> np.ndarray:
    """Whether the torque follows friction that grows with the speed: x decays, without a stop.

    Then y and a hardly change, a = rho x, and the same holds at all lower speeds.
    """
    x, a, _ = state
    follows = (x > 0.0) & (np.abs(slope[2]) < NEARLY * lanes.rho * np.abs(x))
    follows &= np.abs(slope[1] + lanes.rho * a) < NEARLY * lanes.rho * a
    if not follows.any():
        return follows
    damped = SLOWER * lanes.delta * a - np.array([lanes.drop(s * a) for s in SLOWER[:, 0]])
    return follows & np.all(damped[:-1] > damped[1:], axis=0) & (damped[-1] > 0.0)


def _follows(lanes: Lanes, state: np.ndarray, slope: np.ndarray) -> np.ndarray:
    """Whether a slip stays about steady sliding, without a stop.

    (a - v)^2 + (y - y0)^2 falls while the slope of the friction and delta together damp, by more
    than the integral drives; its root, with the part of x, is what a may still differ from v by.
    """
    v = np.asarray(lanes.drift)
    x, a, y = state
    far = np.hypot(a - v, y - lanes.delta * v + lanes.drop(v)) + 2.0 * lanes.rho * np.abs(x)
    damped = [
        lanes.delta + lanes.steepness(np.maximum(v + far * s, FLOOR * np.abs(v))) for s in ASIDE
    ]
    return (far < AROUND * v) & (np.min(damped, axis=0) > 2.0 * lanes.rho)


def _stopped(lanes: Lanes, state: np.ndarray, h: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The end a = 0 within the last step, by the method of Illinois on its length."""
    slope, low, high = _rates(lanes, state), np.zeros_like(h), h.copy()
    at_low, new = state[1].copy(), _stepped(lanes, state, h, slope)[0]
    at_high = new[1].copy()
    for k in range(60):
        gap = at_low - at_high
        part = np.where((gap > 0.0) & (k % 4 < 3), at_low / np.where(gap > 0.0, gap, 1.0), 0.5)
        tried = low + (high - low) * np.where((part > 0.0) & (part < 1.0), part, 0.5)
        new = _stepped(lanes, state, tried, slope)[0]
        ahead = new[1] > 0.0
        at_high = np.where(ahead, 0.5 * at_high, new[1])
        at_low = np.where(ahead, new[1], 0.5 * at_low)
        low, high = np.where(ahead, tried, low), np.where(ahead, high, tried)
        if np.all((high - low <= 1e-13 * h) | (np.abs(new[1]) <= 1e-15)):
            break
    return new, tried
