"""Start values to search for an effect in a log: grids of one parameter, and complete sets.

A log has the motion as arrays (t, theta, w, a, u, load), the sample time dt and the kind of
motion; ``values`` are the plant's parameters, by name. The sets are starting points of a fit, so
they are a factor of two or three apart.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np

from ..friction import VS

SLIDES = 0.01  # of the largest speed; above this a drive certainly slides

Values = Mapping[str, float]
Sets = list[dict[str, float]]


def harmonics(log: Any) -> np.ndarray:
    """Orders 2 to 96 per turn; on a linear drive spaced by half a resolution cell of the travel."""
    if log.motion == "linear":
        return np.pi / np.ptp(log.theta) * np.arange(4.0, 400.0)
    return np.arange(2.0, 97.0)


def orders(log: Any) -> np.ndarray:
    """As :func:`harmonics`, from once per turn."""
    return harmonics(log) if log.motion == "linear" else np.arange(1.0, 97.0)


def low_orders(log: Any) -> np.ndarray:
    """Orders 1 to 6 per turn; on a linear drive up to six periods in the travel."""
    if log.motion == "linear":
        return np.pi / np.ptp(log.theta) * np.arange(1.0, 13.0)
    return np.arange(1.0, 7.0)


def frequencies(log: Any) -> np.ndarray:
    """From three periods in the log to a tenth of the rate, spaced by half a resolution cell."""
    length = log.t[-1] - log.t[0]
    return np.arange(3.0 / length, min(0.1 / log.dt, 65.0), 0.5 / length)


def instants(log: Any) -> np.ndarray:
    """Times from a tenth to nine tenths of the log."""
    return log.t[0] + (log.t[-1] - log.t[0]) * np.linspace(0.1, 0.9, 33)


def durations(log: Any) -> np.ndarray:
    """Time constants from a fiftieth of the log to three times its length."""
    return (log.t[-1] - log.t[0]) * np.geomspace(0.02, 3.0, 12)


def exponents(log: Any) -> np.ndarray:
    """Exponents of the speed between 0 and 1."""
    return np.array([0.15, 0.3, 0.5, 0.7, 0.85])


def _sets(**choices: Iterable[float]) -> Sets:
    """Every combination of the values."""
    made = product(*choices.values())
    return [{k: float(v) for k, v in zip(choices, one, strict=True)} for one in made]


def _times(log: Any, name: str) -> Sets:
    return _sets(**{name: log.dt * np.array([0.5, 1.0, 2.0, 4.0, 8.0, 16.0])})


def delays(log: Any, values: Values) -> Sets:
    """Half a sample to 16 samples."""
    return _times(log, "delay")


def lags(log: Any, values: Values) -> Sets:
    """Half a sample to 16 samples."""
    return _times(log, "time_constant")


def limits(log: Any, values: Values) -> Sets:
    """Torques that the log exceeds during 0.1 % to 20 % of the time."""
    size = np.abs(log.u)
    return _sets(limit=np.quantile(size[size > 0.0], [0.8, 0.9, 0.95, 0.98, 0.99, 0.995, 0.999]))


def half_widths(log: Any, values: Values) -> Sets:
    """Shares of the size of the torque; also with Fc reduced by the same amount."""
    sets = _sets(half_width=np.std(log.u) * np.array([0.02, 0.05, 0.1, 0.2, 0.4]))
    Fc = values.get("Fc")
    if Fc is None:
        return sets
    return sets + [s | {"Fc": max(Fc - s["half_width"], 0.2 * Fc)} for s in sets]


def stops(log: Any, values: Values) -> Sets:
    """Near either end of the travel; at the end the torque is 0.3 or 1 times the size of u."""
    low, high, size = np.min(log.theta), np.max(log.theta), np.std(log.u)
    sets = []
    for side, part, share in product((-1.0, 1.0), (0.02, 0.05, 0.1, 0.2, 0.35), (0.3, 1.0)):
        depth = part * (high - low)
        position = (high if side > 0 else low) - side * depth
        sets.append({"position": position, "stiffness": share * size / depth, "side": side})
    return sets


def couplings(log: Any, values: Values) -> Sets:
    """5 to 35 % of the inertia behind springs, tuned from slow to a quarter of the rate."""
    low = 3.0 / (log.t[-1] - log.t[0])
    tuned = np.geomspace(max(low, 2.0), max(min(0.25 / log.dt, 200.0), 4.0), 16)
    return [_behind(values["J"], *pair) for pair in product((0.05, 0.15, 0.35), tuned)]


def gaps(log: Any, values: Values) -> Sets:
    """As :func:`couplings`, with gaps of 0.05 % to 5 % of the travel."""
    tuned = np.geomspace(15.0, max(min(0.2 / log.dt, 80.0), 30.0), 3)
    widths = np.ptp(log.theta) * np.geomspace(0.0005, 0.05, 80)
    made = product(tuned, widths)
    return [_behind(values["J"], 0.15, f, 0.15) | {"gap": float(gap)} for f, gap in made]


@dataclass(frozen=True)
class Box:
    """The region of parameter sets to search, in logarithmic coordinates x.

    ``low``, ``high`` bound x; ``near`` is the largest distance of a start from a good fit.
    ``at(x)`` gives the set of values, ``into(values)`` its x. ``shape`` selects the coordinates
    that are not merely a strength.
    """

    low: np.ndarray
    high: np.ndarray
    near: np.ndarray
    at: Callable[[np.ndarray], dict[str, float]]
    into: Callable[[Values], np.ndarray]
    shape: slice


def gap_box(log: Any, values: Values) -> Box:
    """Total inertia, its share behind the gap, natural frequency of the load in Hz, damping, gap.

    The total may exceed the inertia of a rigid model, because the load is free in the gap for a
    part of the time.
    """
    known, travel = values["J"] + values.get("load_inertia", 0.0), float(np.ptp(log.theta))
    low = np.array([0.9 * known, 0.03, 4.0, 0.01, 5e-4 * travel])
    fastest = max(min(0.2 / log.dt, 300.0), 30.0)
    high = np.array([1.5 * known, 0.9, fastest, 1.0, 5e-2 * travel])

    def at(x: np.ndarray) -> dict[str, float]:
        whole, share, frequency, damping, gap = np.exp(x).tolist()
        return _behind(whole, share, frequency, damping) | {"gap": gap}

    def into(given: Values) -> np.ndarray:
        load = max(given["load_inertia"], low[1] * known)  # a fit may end at no load
        ringing = max(_ringing(given["stiffness"], load), 2.0 * np.pi * low[2])
        damping = given["damping"] / (2.0 * load * ringing)
        x = np.array([known, load / known, ringing / (2.0 * np.pi), damping, given["gap"]])
        return np.log(np.maximum(x, 0.1 * low))

    return Box(
        np.log(low), np.log(high), np.array([0.1, 0.2, 0.3, 0.3, 0.03]), at, into, slice(2, 5)
    )


def in_the_gap(values: Values) -> tuple[float, float]:
    """Largest deviation of the load: its twist (rad) to a little beyond either side of the gap,
    its speed relative to the motor (rad/s) that of an oscillation with this twist."""
    twist = 0.6 * values["gap"]
    return twist, twist * _ringing(values["stiffness"], values["load_inertia"])


def _ringing(stiffness: float, load: float) -> float:
    """Natural frequency of the load on the spring, with the motor fixed, rad/s."""
    return float(np.sqrt(stiffness / max(load, 1e-300)))


def _behind(J: float, share: float, frequency: float, damping: float = 0.1) -> dict[str, float]:
    """A share of J moved behind a spring; ``frequency`` is that of the load alone in Hz."""
    load, ringing = share * J, 2.0 * np.pi * frequency
    return {
        "load_inertia": float(load),
        "stiffness": float(load * ringing**2),
        "damping": float(2.0 * damping * load * ringing),
        "J": (1.0 - share) * J,
    }


def stictions(log: Any, values: Values) -> Sets:
    """Fs of 1.1 to 2 Fc, vs of 1 to 30 % of the largest speed.

    Also the least-squares fits of the torque to the sliding motion, with their plant parameters:
    without the effect the fitted Fc is biased, between the two levels or at the higher one.
    """
    Fc = values.get("Fc")
    if not Fc:
        return []
    speeds = np.max(np.abs(log.w)) * np.array([0.01, 0.03, 0.1, 0.3])
    above = _sets(Fs=Fc * np.array([1.1, 1.4, 2.0]), vs=speeds)
    return above + [found for vs in speeds for found in _sliding(log, float(vs))]


def _sliding(log: Any, vs: float) -> Sets:
    """The static map of the sliding samples for one vs, if it falls with speed."""
    slides = np.abs(log.w) > SLIDES * np.max(np.abs(log.w))
    w, a = log.w[slides], log.a[slides]
    columns = np.column_stack([a, w, np.sign(w), np.sign(w) * np.exp(-((w / vs) ** 2))])
    J, Fv, Fc, excess = np.linalg.lstsq(columns, (log.u - log.load)[slides], rcond=None)[0]
    if min(J, Fc, excess) <= 0.0:
        return []
    return [{"Fs": Fc + excess, "vs": vs, "J": J, "Fc": Fc, "Fv": max(Fv, 1e-3 * Fc / vs)}]


def bristles(log: Any, values: Values) -> Sets:
    """Break-away after 0.001 % to 1 % of the travel, with two dampings."""
    if not values.get("Fc"):
        return []
    bends = np.ptp(log.theta) * np.array([1e-5, 1e-4, 1e-3, 1e-2])
    return [
        {"sigma0": float(k), "sigma1": float(2.0 * part * np.sqrt(k * values["J"]))}
        for k in values["Fc"] / bends
        for part in (0.1, 0.5)
    ]


def dwells(log: Any, values: Values) -> Sets:
    """Time constants near the length of the rests in the log; empty if the drive hardly rests."""
    resting = np.abs(log.w) < 0.5 * values.get("vs", VS.value)
    edges = np.flatnonzero(np.diff(np.r_[False, resting, False].astype(int)))
    lengths = log.dt * (edges[1::2] - edges[::2])
    rests = lengths[lengths > 5.0 * log.dt]
    if not len(rests):
        return []
    typical = float(np.median(rests))
    return _sets(ratio=(0.2, 0.6), time_constant=typical * np.array([0.2, 0.5, 1.5, 5.0]))
