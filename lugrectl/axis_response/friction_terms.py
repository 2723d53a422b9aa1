"""The terms of friction along the measured motion, as spectra of the command that they cost.

On the motor: the deflection z of a bristle of level 1 (Fc), z exp(-(w/vs)^2) (Fs - Fc), and dz/dt
(damping before breakaway). On the load: the first two along its motion, seen at the motor through
the spring. One law serves LuGre and Coulomb friction: at a short distance the bristle is a sign
that knows rest.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..blocks.bristle_laws import along
from ..blocks.friction import level
from .load_side import LoadMotion
from .runs import FINER, Run, means

Strokes = tuple[np.ndarray, np.ndarray, np.ndarray]

MOTOR, LOAD = ("Fc", "dF", "damping"), ("load Fc", "load dF")
STEEPEST, FALLS = 1.5, 0.9  # dF/Fc: Fs up to 2.5 Fc, friction that falls by up to 90 % at low speed


@dataclass(frozen=True, eq=False)
class Terms:
    """``advance`` (M,) of each run takes a torque in force to the command; ``scales`` (n,) are the
    known changes of the level of friction; ``loads`` the motion of the load, if it has friction."""

    runs: Sequence[Run]
    advance: Sequence[np.ndarray]
    scales: Sequence[np.ndarray]
    loads: Sequence[LoadMotion] = ()

    @property
    def names(self) -> tuple[str, ...]:
        return MOTOR + LOAD if self.loads else MOTOR

    def with_load(self, loads: Sequence[LoadMotion]) -> Terms:
        return replace(self, loads=loads)

    def spectra(self, i: int, distance: float, vs: float) -> np.ndarray:
        """The terms of a run (M, m); none acts where the axis stands."""
        run = self.runs[i]
        z, made = _levels(run.strokes, run.fine_speed, distance, vs)
        made = np.c_[made, np.diff(z[FINER - 1 :: FINER], prepend=0.0) / run.dt]
        if self.loads:
            load = self.loads[i]
            far = _levels(load.strokes, load.speed, distance, vs)[1]
            made = np.c_[made, run.signal(run.spectrum(far) * load.seen[:, None])]
        share = self.scales[i] * ~run.stands
        return run.spectrum(made * share[:, None]) * self.advance[i][:, None]


def _levels(
    strokes: Strokes, speed: np.ndarray, distance: float, vs: float
) -> tuple[np.ndarray, np.ndarray]:
    """The deflection at the end of each part of an interval, and the means (n, 2) of deflection
    and Stribeck term in each interval."""
    z = along(*strokes, distance)
    middle = 0.5 * (z + np.append(0.0, z[:-1]))
    return z, np.stack([means(middle), means(middle * level(speed, 0.0, 1.0, vs))], axis=1)


def impossible(names: Sequence[str], levels: Sequence[float], most: float = np.inf) -> str | None:
    """A term whose level no friction has, to be left out; of several, the least certain first.

    ``most`` is the largest torque: friction that the axis overcomes is no larger.
    """
    found = dict(zip(names, levels, strict=True))
    large = [k for k in ("load Fc", "Fc") if found.get(k, 0.0) > most]
    if large:
        return large[0]
    for key, change in (("load Fc", "load dF"), ("Fc", "dF")):
        whole = found.get(key, 0.0)
        if change in found and not -FALLS * whole <= found[change] <= STEEPEST * whole:
            return change
    if "damping" in found and not found.get("Fc", 0.0) > 0.0:  # of a bristle that is not there
        return "damping"
    return next((k for k in ("load Fc", "damping", "Fc") if found.get(k, 0.0) < 0.0), None)
