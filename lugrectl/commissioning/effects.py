"""What a model knows besides friction and inertia, along the measured motion, to be taken out.

Torques of position, speed and time go off the torque; what acts on the torque itself is applied to
it; what changes the level of friction scales its terms, and a change of Fv is a torque. A delay or
lag of the torque and the lag of a sensor are linear: they stay in the response. So does the load
behind a gap: taken out is what its torque differs by from that of a load without the gap.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..blocks.model import Model, Part
from ..blocks.plant import STAGES, stage
from ..core.errors import InputError
from ..torque_balance.driven_states import driven
from .runs import Run

LINEAR = ("input_delay", "actuator_lag", "velocity_sensor_lag", "elastic_coupling")
GAP = "backlash"
TIGHT = {"gap": 0.0, "load_friction": 0.0}
LEFT = "{} is not taken out: {}."
ACTS = {"torque", "input", "Fc", "Fs", "Fv", "+Fc", "+Fs"}


@dataclass(frozen=True, eq=False)
class Known:
    """The runs with the torque that acts, and for each run the known torque (n,) on the resisting
    side and the level of friction (n,) as a share; ``said`` of what stays in the response."""

    runs: tuple[Run, ...]
    resisting: tuple[np.ndarray, ...]
    scales: tuple[np.ndarray, ...]
    said: tuple[str, ...]


def known_effects(runs: Sequence[Run], model: Model) -> Known:
    """Take the effects of a model along the runs; InputError for a value that it leaves open."""
    parts, said, friction = [], [], model.friction.values
    for part in model.effects:
        why = _why_left(part, friction)
        if why:
            said.append(LEFT.format(part.key, why))
        elif why is None:
            if missing := [k for k, v in part.values.items() if v is None]:
                raise InputError(
                    f"{part.key}: {', '.join(missing)} must be known to take it out: identify it, "
                    "and give the model with its value."
                )
            parts.append(part)
    parts.sort(key=lambda part: STAGES.index(stage(part.block)))
    made = [_along(run, parts, friction) for run in runs]
    driven_runs, resisting, scales = zip(*made, strict=True)
    return Known(driven_runs, resisting, scales, tuple(said))


def _why_left(part: Part, friction: Mapping[str, float | None]) -> str | None:
    """Why an effect stays; "" where it is a part of the response, None where it is taken out."""
    block = part.block
    if block.name in LINEAR:
        return ""
    if block.states and block.name != GAP:
        return "it remembers the motion"
    if any(p.shared for p in block.parameters.values()):
        return "it depends on other values of the drive"
    if not {*block.acts} <= ACTS:
        return f"it changes {', '.join(block.acts)}"
    needed = [k for act, k in (("+Fc", "Fc"), ("Fv", "Fv")) if act in block.acts]
    open_ = [k for k in needed if friction.get(k, 0.0) is None]
    return f"{open_[0]} is not declared" if open_ else None


def _along(
    run: Run, parts: Sequence[Part], friction: Mapping[str, float | None]
) -> tuple[Run, np.ndarray, np.ndarray]:
    middle = np.append(0.5 * (run.theta[1:] + run.theta[:-1]), run.theta[-1])
    signals = {"t": run.t + 0.5 * run.dt, "theta": middle, "w": run.speed, "u": run.u}
    signals["load"], resisting, level = run.load, run.load.copy(), np.ones(len(run.u))
    for part in parts:
        acts = _acts(part, signals, run)
        if "input" in acts:
            signals["u"] = np.broadcast_to(acts["input"], run.u.shape)
        torque, viscous = acts.get("torque", 0.0), friction.get("Fv") or 0.0
        resisting = resisting + torque + acts.get("Fv", 0.0) * viscous * run.speed
        if part.block.load:
            signals["load"] = signals["load"] + torque
        level = level + acts.get("Fc", 0.0) + acts.get("+Fc", 0.0) / (friction.get("Fc") or np.inf)
    return replace(run, u=signals["u"]), resisting, level


def _acts(part: Part, signals: Mapping[str, np.ndarray], run: Run) -> dict[str, np.ndarray]:
    block = part.block
    if block.name == GAP:
        known = block.defaults() | dict(part.values)
        motion = {k: signals[k] for k in ("theta", "w")}
        sets: list = [known, known | TIGHT]
        (made,) = driven(block, sets, motion, [(slice(0, len(run.u)), run.dt)])
        return {"torque": made[:, 0] - made[:, 1]}
    given = [signals[name] for name in block.reads]
    return dict(block.deeds(block(*given, **part.values)))
