"""The closed loop: the simulated drive, and a compensation by another model of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import control as ct

from ..blocks import controllers
from ..blocks.model import Model
from ..blocks.observers import observer, observer_block
from ..blocks.plant import plant, sensor
from ..blocks.sliding_control import sliding_error
from ..estimates.findings import Table
from .feedforward import effects_torque

OUTPUTS = ("theta", "w", "F", "Fhat", "u", "e")
MEASURED = {"w": "w_m", "theta": "theta_m", "u": "u_fb"}


@dataclass(frozen=True)
class Task:
    """The parts common to the three loops: drive model, table, kind of loop, controller."""

    model: Model
    table: Table | None
    kind: str
    controller: Mapping[str, float]


def closed(
    task: Task, believed: Model | None, watcher: str | None, gains: Mapping[str, Any], name: str
) -> ct.InterconnectedSystem:
    """The loop around the drive, compensated by the model ``believed`` (None: by nothing)."""
    model = task.model
    parts = [plant(model), sensor(model), *control(task, believed, watcher, gains)]
    parts += [task.table.block()] if task.table is not None else []
    return ct.interconnect(
        parts,
        inputs=["r", "dr", *(["ddr"] if task.kind == "position" else [])],
        outputs=list(OUTPUTS),
        params={},  # else blocks with equal keys would share the values of the last one
        check_unused=False,
        name=name,
    )


def control(
    task: Task, believed: Model | None, watcher: str | None, gains: Mapping[str, Any]
) -> list[ct.NonlinearIOSystem]:
    """The blocks of the controller, from w_m, theta_m and the reference to u."""
    kind, model = task.kind, task.model
    measured = MEASURED[controllers.MEASURED[kind]]
    own: Any = {"outputs": ["u_fb"]}
    if kind == "velocity":
        feedback = [controllers.pi(**task.controller, **own)]
    else:  # D on the velocity error: on w alone it would act against the reference motion
        lag = controllers.error(name="error_w", inputs=["dr", "w_m"], outputs=["e_w"])
        feedback = [lag, controllers.pid(**task.controller, inputs=["e", "e_w"], **own)]
    made = observer_block("no_observer" if watcher is None else watcher)
    seen = [MEASURED.get(s, s) for s in made.inputs]
    parts = [
        controllers.error(kind, inputs=["r", measured]),
        *feedback,
        controllers.feedforward(believed or model, kind, **own),
        observer(made.name, believed or model, inputs=seen, **gains),
        controllers.compensation(1.0, **own),
        controllers.compensation(name="drive", inputs=["u_fb"]),
    ]
    if "s" in made.inputs:
        wanted = [*(["theta_m"] if kind == "position" else []), "w_m", "r", "dr"]
        wanted += ["ddr"] if kind == "position" else []
        parts.append(sliding_error(kind=kind, inputs=wanted))
    return parts + ([] if believed is None else _fed(task, believed))


def _fed(task: Task, believed: Model) -> list[ct.NonlinearIOSystem]:
    """The blocks that feed torques forward; the table only with the augmented model."""
    made = [effects_torque(believed)]
    if believed is task.model and task.table is not None and task.table.signals[0] != "u":
        signals = [MEASURED[s] for s in task.table.signals if s != "t"]
        made.append(task.table.block(name="table_effect", inputs=signals, outputs=["u"]))
    return [block for block in made if block is not None]
