"""The loops of the bench: a drive and the blocks that control it, continuous or sampled."""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import control as ct
import numpy as np

from ..blocks import controllers
from ..blocks.block import unit_for
from ..blocks.drive import dead_time
from ..blocks.model import Model
from ..blocks.plant import plant, sensor
from ..core.errors import Diverged, InputError
from ..core.numeric import rms
from ..core.validation import shown
from ..estimates.findings import Table
from ..loops.compensated import MEASURED, Control, read_of
from ..loops.parts import OUTPUTS, connected
from ..simulation.encoder import Sensing, encoder
from ..simulation.sampled_response import COARSE, simulate_sampled
from ..simulation.stepped_block import at_samples
from .feedforward import effects_torque

FASTEST = 1.5  # of the largest speed of the reference
TURNS = {"velocity": "rad/s", "position": "rad"}


@dataclass(frozen=True)
class Task:
    """The parts common to several loops: drive model, kind of loop, gains of the controller, a
    table that acts on the drive, and whether there is noise of the torque."""

    model: Model
    kind: str
    controller: Mapping[str, float]
    table: Table | None = None
    noisy: bool = True

    def control(
        self, believed: Model | None, observer: str | None = None, gains: Any = None
    ) -> list[Any]:
        """Return the blocks of the controller, which compensates by a model (None: nothing)."""
        if believed is None:
            return Control(self.kind, self.controller).blocks(self.model)
        made = Control(self.kind, self.controller, observer, gains or {})
        return made.blocks(believed) + self._fed(believed)

    def _fed(self, believed: Model) -> list[Any]:
        """Return the blocks that feed torques forward; the table only with the drive's model."""
        made, table = [effects_torque(believed)], self.table
        if believed is self.model and table is not None and table.signals[0] != "u":
            signals = [MEASURED[s] for s in table.signals if s != "t"]
            made.append(table.block(name="table_effect", inputs=signals, outputs=["u"]))
        return [block for block in made if block is not None]

    def closed(self, control: Sequence[Any], name: str) -> ct.InterconnectedSystem:
        """Return the loop in continuous time."""
        parts = [plant(self.model), sensor(self.model), *control, *self._acting()]
        return connected(parts, read_of(parts), OUTPUTS, name)

    def body(self, model: Model, command: str = "u") -> ct.InterconnectedSystem:
        """Return a drive, from the command and its noise n_u to what its sensors see."""
        entry = "u_act" if self.noisy else command
        parts = [plant(model, inputs=[entry, "d"]), sensor(model, outputs=["w_s", "theta_s"])]
        parts += [
            controllers.compensation(name=name, inputs=[signal], outputs=[entry])
            for name, signal in (("command", command), ("torque_noise", "n_u"))
            if self.noisy
        ]
        inputs = [command, *["n_u"] * self.noisy, "d"]
        outputs = ["theta", "w", "theta_s", "w_s"]
        return connected([*parts, *self._acting()], inputs, outputs, "drive_body")

    def _acting(self) -> list[Any]:
        return [] if self.table is None else [self.table.block()]


def kind_of(loop: Any) -> str:
    """Return the kind of loop that is meant."""
    if not isinstance(loop, str) or loop not in TURNS:
        raise InputError(f"unknown loop {shown(loop)}; known: {', '.join(TURNS)}.")
    return loop


def unit_of(kind: str, model: Model) -> str:
    """Return the unit of what a loop follows."""
    return unit_for(TURNS[kind], model.motion)


class SampledLoop:
    """A loop in a sampled drive: its controller is built once, for many drives.

    ``fastest``: the largest speed of the reference; ``start``: the states that are not 0 at first,
    by block and name; ``bodies``: drives that were built before.
    """

    def __init__(
        self,
        task: Task,
        sensing: Sensing,
        control: Sequence[Any],
        fastest: float,
        start: Mapping[str, float] | None = None,
        bodies: dict[Any, Any] | None = None,
    ) -> None:
        self.task, self.sensing, self.start = task, sensing, start or {}
        self.late, self.bodies = sensing.delay > 0.0, {} if bodies is None else bodies
        late = dead_time(sensing.delay, sensing.dt, inputs=["u"], outputs=["u_late"])
        points = usual_points(task.model, fastest)
        self.blocks = [
            encoder(sensing, ("theta_s", "w_s")),
            *(at_samples(block, sensing.dt, points) for block in (*control, *[late] * self.late)),
        ]
        states = [f"{b.name}_{x}" for b in self.blocks if b.nstates for x in b.state_labels]
        self.placed = [self.start.get(state, 0.0) for state in states]

    def run(
        self,
        rows: Mapping[str, np.ndarray],
        model: Model | None = None,
        sensing: Sensing | None = None,
        torque: float = 0.0,
        seed: int = 0,
        **params: float,
    ) -> dict[str, np.ndarray]:
        """Return the signals of a drive by name: ``rows`` has the reference and a load d,
        ``torque`` is the noise of u in N m. Raises Diverged."""
        model, sensing = model or self.task.model, sensing or self.sensing
        body, names = self._body(model)
        t = sensing.dt * np.arange(len(rows["r"]))
        noise = np.random.default_rng((seed, 1)).normal(0.0, torque, len(t))
        given = {**rows, **sensing.errors(len(t), seed), "n_u": noise}
        read = {k for block in (body, *self.blocks) for k in block.input_labels}
        known = {f"{part}.{k}": v for part in ("plant", "sensor") for k, v in model.known().items()}
        x0 = [self.start.get(state, 0.0) for state in body.state_labels]
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")  # a loop that does not work is a result here
            done = simulate_sampled(
                body,
                self.blocks,
                t,
                {k: x for k, x in given.items() if k in read},
                x0,
                drive_x0=self.placed,
                params={k: v for k, v in known.items() if k in names} | params,
                rtol=COARSE,
            )
        return dict(zip(done.output_labels or (), np.asarray(done.outputs), strict=True))

    def error(
        self, rows: Mapping[str, np.ndarray], model: Model, counted: Any = slice(None), **own: Any
    ) -> float:
        """Return the RMS tracking error of the motion itself; infinite where the loop diverges."""
        try:
            y = self.run(rows, model, **own)[controllers.MEASURED[self.task.kind]]
        except Diverged:
            return math.inf
        return rms((y - rows["r"])[counted])

    def _body(self, model: Model) -> tuple[Any, set[str]]:
        """Return the drive of a structure, and the parameters that it has."""
        key = (self.late, model.friction.block.name, *(p.key for p in model.effects))
        if key not in self.bodies:
            names = {*plant(model).params, *sensor(model).params}
            self.bodies[key] = self.task.body(model, "u_late" if self.late else "u"), names
        return self.bodies[key]


def usual_points(model: Model, fastest: float) -> list[dict[str, float]]:
    """Return usual inputs and states of an observer by name, at rest and in motion."""
    known = {k: v or 0.0 for k, v in model.values().items()}
    torque = max(known.get("Fs", 0.0), known.get("Fc", 0.0))
    z = torque / known["sigma0"] if known.get("sigma0") else 0.0
    sizes = dict.fromkeys(("u", "u_fb", "zeta", "f", "Fhat"), torque) | {"zhat": z, "z": z}
    return [
        sizes
        | dict.fromkeys(("w", "w_m", "what"), w)
        | {"xi": known["J"] * w + known.get("sigma1", 0.0) * z}
        for w in (0.0, 0.1 * fastest, fastest)
    ]
