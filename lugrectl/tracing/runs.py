"""What differs from run to run though the drive is the same: the torque's offset, the friction,
and where theta is zero."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ..model import Model
from ..spec import Block, P, unit_for
from .data import Data

OFFSET = P(0.0, "N m", neutral=0.0)  # of the recorded torque, against the first run
FRICTION = P(0.0, "1", -0.5, 1.0, neutral=0.0)  # more than the first run's, as a part of it
PHASE = P(0.0, "rad", -np.pi, np.pi, angle=True, neutral=0.0)  # of what repeats with theta
WARMED = ("Fc", "Fs", "Fv")
MOST_RUNS = 8  # runs, above which they are taken to be alike


def differences(data: Data) -> dict[str, P]:
    """The declarations of what the runs but the first may have for themselves."""
    known = {"offset": OFFSET, "friction": FRICTION} | ({"phase": PHASE} if data.zeros else {})
    return {f"run{run + 1}.{name}": p for run in data.differing for name, p in known.items()}


def repeats(block: Block) -> bool:
    """Whether an effect repeats itself with theta, wherever that is zero."""
    return "theta" in block.inputs and any(p.angle for p in block.parameters.values())


def alike(data: Data) -> dict[str, float]:
    """Their values where the runs do not differ."""
    return {key: p.value for key, p in differences(data).items()}


def along(data: Data, values: Mapping[str, float], name: str) -> np.ndarray:
    """One of them along the log, (N,); 0 where a run has none."""
    made = np.zeros(len(data.t))
    for run in data.differing:
        made[data.run == run] = values[f"run{run + 1}.{name}"]
    return made


def knows_places(model: Model) -> bool:
    """Whether it has an effect that hangs on theta: then theta is what it says in every run."""
    return any("theta" in part.block.inputs for part in model.effects)


def repeating(model: Model) -> bool:
    """Whether it has an effect that repeats itself with theta."""
    return any(repeats(part.block) for part in model.effects)


def orders(model: Model, values: Mapping[str, float]) -> list[float]:
    """How often each of its effects with a phase repeats itself per 2 pi of theta."""
    keys = [part.key for part in model.effects if repeats(part.block)]
    return [values.get(f"{key}.harmonic", 1.0) for key in keys]


def displaced(model: Model, data: Data, values: Mapping[str, float]) -> np.ndarray | None:
    """By how much theta is to be moved beyond ``data.zeros``, (N,); None where runs agree or
    nothing repeats itself."""
    if not (data.zeros and data.differing and repeating(model)):
        return None
    return along(data, values, "phase") / data.order


def told(data: Data, values: Mapping[str, float], places: bool) -> tuple[str, ...]:
    """A sentence for each run that differs; ``places``: where theta is zero is told, too."""
    unit, of_theta = unit_for("N m", data.motion), unit_for("rad", data.motion)

    def sentence(run: int) -> str:
        offset, friction = (values[f"run{run + 1}.{name}"] for name in ("offset", "friction"))
        place = []
        if places and data.zeros:
            moved = data.zeros[run] + values[f"run{run + 1}.phase"] / data.order
            place = [f"theta moved by {moved:.4g} {of_theta} to agree"] if moved else []
        differs = f"torque offset {offset:.3g} {unit}, friction {100.0 * friction:+.1f} %"
        same = place and offset == friction == 0.0
        return f"run {run + 1} against run 1: {', '.join(([] if same else [differs]) + place)}."

    return tuple(sentence(run) for run in data.differing)
