"""Run effects (nuisance parameters): torque offset, friction level and zero of theta of each run.

The drive is the same in all runs, but these may differ.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ...blocks.block import Block, P, unit_for
from ...blocks.model import Model
from .dataset import Data

OFFSET = P(0.0, "N m", neutral=0.0)  # of the recorded torque, relative to the first run
FRICTION = P(0.0, "1", -0.5, 1.0, neutral=0.0)  # relative change against the first run
PHASE = P(0.0, "rad", -np.pi, np.pi, angle=True, neutral=0.0)  # of effects periodic in theta
WARMED = ("Fc", "Fs", "Fv")
MOST_RUNS = 8  # with more runs than this, they are taken to be alike


def differences(data: Data) -> dict[str, P]:
    """Declarations of the parameters that each run but the first has for itself."""
    known = {"offset": OFFSET, "friction": FRICTION} | ({"phase": PHASE} if data.zeros else {})
    return {f"run{run + 1}.{name}": p for run in data.differing for name, p in known.items()}


def repeats(block: Block) -> bool:
    """True if an effect is periodic in theta, with a free phase."""
    return "theta" in block.inputs and any(p.angle for p in block.parameters.values())


def alike(data: Data) -> dict[str, float]:
    """Values of these parameters if the runs do not differ."""
    return {key: p.value for key, p in differences(data).items()}


def along(data: Data, values: Mapping[str, float], name: str) -> np.ndarray:
    """One of these parameters along the log, (N,); 0 in runs without it."""
    made = np.zeros(len(data.t))
    for run in data.differing:
        made[data.run == run] = values[f"run{run + 1}.{name}"]
    return made


def knows_places(model: Model) -> bool:
    """True if an effect of the model depends on theta: its zero is then the same in all runs."""
    return any("theta" in part.block.inputs for part in model.effects)


def repeating(model: Model) -> bool:
    """True if an effect of the model is periodic in theta."""
    return any(repeats(part.block) for part in model.effects)


def orders(model: Model, values: Mapping[str, float]) -> list[float]:
    """Periods per 2 pi of theta, for each effect of the model that has a phase."""
    keys = [part.key for part in model.effects if repeats(part.block)]
    return [values.get(f"{key}.harmonic", 1.0) for key in keys]


def displaced(model: Model, data: Data, values: Mapping[str, float]) -> np.ndarray | None:
    """Shift of theta in addition to ``data.zeros``, (N,); None if runs agree or no effect is
    periodic."""
    if not (data.zeros and data.differing and repeating(model)):
        return None
    return along(data, values, "phase") / data.order


def statements(data: Data, values: Mapping[str, float], places: bool) -> tuple[str, ...]:
    """A sentence for each run that differs; with ``places`` also the shift of theta."""
    unit, of_theta = unit_for("N m", data.motion), unit_for("rad", data.motion)

    def sentence(run: int) -> str:
        offset, friction = (values[f"run{run + 1}.{name}"] for name in ("offset", "friction"))
        place = []
        if places and data.zeros:
            moved = data.zeros.get(run, 0.0) + values[f"run{run + 1}.phase"] / data.order
            place = [f"theta shifted by {moved:.4g} {of_theta} to match"] if moved else []
        differs = f"torque offset {offset:.3g} {unit}, friction {100.0 * friction:+.1f} %"
        same = place and offset == friction == 0.0
        return (
            f"Fitted differences between run {run + 1} and run 1: "
            f"{', '.join(([] if same else [differs]) + place)}."
        )

    return tuple(sentence(run) for run in data.differing)
