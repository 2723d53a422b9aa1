"""What differs from run to run though the drive is the same: the torque's offset, the friction."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ..spec import P
from .data import Data

OFFSET = P(0.0, "N m", neutral=0.0)  # of the recorded torque, against the first run
FRICTION = P(0.0, "1", -0.5, 1.0, neutral=0.0)  # more than the first run's, as a part of it
WARMED = ("Fc", "Fs", "Fv")
MOST_RUNS = 8  # runs, above which they are taken to be alike


def differences(data: Data) -> dict[str, P]:
    """The declarations of what the runs but the first may have for themselves."""
    return {
        f"run{run + 1}.{name}": p
        for run in data.differing
        for name, p in (("offset", OFFSET), ("friction", FRICTION))
    }


def alike(data: Data) -> dict[str, float]:
    """Their values where the runs do not differ."""
    return {key: p.value for key, p in differences(data).items()}


def along(data: Data, values: Mapping[str, float], name: str) -> np.ndarray:
    """One of them along the log, (N,); 0 where a run has none."""
    made = np.zeros(len(data.t))
    for run in data.differing:
        made[data.run == run] = values[f"run{run + 1}.{name}"]
    return made


def told(data: Data, values: Mapping[str, float], unit: str) -> tuple[str, ...]:
    """A sentence for each run that differs."""
    return tuple(
        f"run {run + 1} against run 1: torque offset {values[f'run{run + 1}.offset']:.3g} {unit}, "
        f"friction {100.0 * values[f'run{run + 1}.friction']:+.1f} %."
        for run in data.differing
    )
