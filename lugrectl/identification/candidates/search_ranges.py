"""Where an effect is searched for in a log: grids of one parameter, and complete sets of values.

An effect of the user says so itself, by ``P(..., grid=)`` and ``@block(..., tries=)``.

A log has the motion as arrays (t, theta, w, a, u, load), the sample time dt and the kind of
motion; ``values`` are the plant's parameters, by name. The sets are starting points of a fit, so
they are a factor of two or three apart.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from itertools import product
from typing import Any

import numpy as np

from ...blocks.block import Block
from ..dataset.windows import sliding

HEAT = 2.0  # s: no drive warms up with a shorter time constant

Values = Mapping[str, float]
Sets = list[dict[str, float]]
Grid = Callable[[Any], np.ndarray]


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
    """Time constants from a fiftieth of the log to three times its length, of those that heat has.

    A log in which no such time constant shows cannot be asked for it: none is left.
    """
    tried = (log.t[-1] - log.t[0]) * np.geomspace(0.02, 3.0, 12)
    return tried[tried >= HEAT]


def exponents(log: Any) -> np.ndarray:
    """Exponents of the speed between 0 and 1."""
    return np.array([0.15, 0.3, 0.5, 0.7, 0.85])


def _sets(**choices: Iterable[float]) -> Sets:
    """Every combination of the values."""
    made = product(*choices.values())
    return [{k: float(v) for k, v in zip(choices, one, strict=True)} for one in made]


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
    slides = sliding(log.w)
    w, a = log.w[slides], log.a[slides]
    columns = np.column_stack([a, w, np.sign(w), np.sign(w) * np.exp(-((w / vs) ** 2))])
    J, Fv, Fc, excess = np.linalg.lstsq(columns, (log.u - log.load)[slides], rcond=None)[0]
    if min(J, Fc, excess) <= 0.0:
        return []
    return [{"Fs": Fc + excess, "vs": vs, "J": J, "Fc": Fc, "Fv": max(Fv, 1e-3 * Fc / vs)}]


GRIDS: dict[str, dict[str, Grid]] = {
    "torque_constant_ripple": {"harmonic": orders},
    "sublinear_viscous": {"exponent": exponents},
    "position_dependent_friction": {"harmonic": orders},
    "thermal_drift": {"time_constant": durations},
    "friction_step": {"time": instants},
    "inertia_step": {"time": instants},
    "pose_dependent_inertia": {"harmonic": low_orders},
    "torque_ripple": {"harmonic": harmonics},
    "periodic_disturbance": {"frequency": frequencies},
}
SETS: dict[str, Callable[[Any, Values], Sets]] = {"stribeck": stictions}


def grid_of(block: Block, key: str) -> Grid | None:
    """The values of a parameter to try on a log; None where the effect is linear in it."""
    return block.own[key].grid or GRIDS.get(block.name, {}).get(key)


def sets_of(block: Block) -> Callable[[Any, Values], Sets] | None:
    """Complete sets of values to try on a friction map; None where grids are enough."""
    return block.tries or SETS.get(block.name)
