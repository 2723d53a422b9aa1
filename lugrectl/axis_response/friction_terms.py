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

from .load_side import LoadMotion
from .runs import Run

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
        z = run.bristle(distance)
        own = [z, z * np.exp(-((run.speed / vs) ** 2)), np.gradient(z, run.dt)]
        made = np.stack(own, axis=1)
        if self.loads:
            load = self.loads[i]
            z = load.bristle(distance)
            far = np.stack([z, z * np.exp(-((load.speed / vs) ** 2))], axis=1)
            made = np.c_[made, run.signal(run.spectrum(far) * load.seen[:, None])]
        share = self.scales[i] * ~run.stands
        return run.spectrum(made * share[:, None]) * self.advance[i][:, None]


def impossible(names: Sequence[str], levels: Sequence[float]) -> str | None:
    """A term whose level no friction has, to be left out; of several, the least certain first."""
    found = dict(zip(names, levels, strict=True))
    for level, change in (("load Fc", "load dF"), ("Fc", "dF")):
        whole = found.get(level, 0.0)
        if change in found and not -FALLS * whole <= found[change] <= STEEPEST * whole:
            return change
    return next((k for k in ("load Fc", "damping", "Fc") if found.get(k, 0.0) < 0.0), None)
