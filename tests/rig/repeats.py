"""Further runs of one machine: what differs from run to run though the machine is the same."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from .bench import Table
from .machines import GRAVITY_LOAD, Machine

NUISANCES = ("offset", "phase", "temperature")
ABSOLUTE = {  # effects whose position counts from a fixed place
    *("gravity", "return_spring", "hard_stop", "encoder_eccentricity"),
    *("pose_dependent_inertia", "torque_bumps"),
}


@dataclass(frozen=True)
class Nuisance:
    """Offset of the recorded torque, of the encoder's zero, factor on the friction."""

    offset: float = 0.0
    zero: float = 0.0
    friction: float = 1.0
    turn: float = 0.0  # of a disturbance in time, rad


def nuisance(m: Machine, table: Table, kinds: tuple[str, ...], rng) -> Nuisance:
    """What another run of this machine brings with it."""
    offset, zero = rng.normal(0.0, 0.03) * m.Fc, rng.uniform(-np.pi, np.pi)
    friction, turn = rng.uniform(0.95, 1.05), rng.uniform(-np.pi, np.pi)
    fixed = ABSOLUTE & set(table) or m.load[0] == GRAVITY_LOAD or not m.rotary
    return Nuisance(
        float(offset) if "offset" in kinds else 0.0,
        float(zero) if "phase" in kinds and not fixed else 0.0,
        float(friction) if "temperature" in kinds else 1.0,
        float(turn) if "phase" in kinds else 0.0,
    )


def warmed(m: Machine, factor: float) -> Machine:
    twin = m.Fs_twin * factor if m.Fs_twin >= 0.0 else m.Fs_twin
    return replace(m, Fc=m.Fc * factor, Fs=m.Fs * factor, Fv=m.Fv * factor, Fs_twin=twin)


def turned(table: Table, turn: float) -> Table:
    """Disturbances in time are at another phase in each run."""
    if "periodic_disturbance" not in table:
        return table
    amplitude, frequency, phase = table["periodic_disturbance"]
    phase = float(np.pi - (np.pi - phase - turn) % (2.0 * np.pi))
    return table | {"periodic_disturbance": (amplitude, frequency, phase)}
