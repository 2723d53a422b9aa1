"""The compensation on a drive like the recorded one, which is not exactly the model.

The controller is sampled at the record's rate and believes the estimate. The drive has parameters
that are drawn from the estimate's joint covariance, and the noise and encoder steps of the record.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import control as ct
import numpy as np

from ..blocks import controllers
from ..blocks.model import Model
from ..blocks.plant import plant, sensor
from ..core.display import Row, Shown
from ..core.errors import Diverged
from ..core.numeric import rms
from ..core.progress import Progress
from ..estimates.covariance import Joint
from ..record import Record
from ..record.signal_noise import sensor_noise
from ..simulation.encoder import Sensing, encoder
from ..simulation.recorded_sensing import sensing_of
from ..simulation.sampled_response import COARSE, simulate_sampled
from ..simulation.stepped_block import at_samples
from .loop import Task, control
from .reference import Course

DRAWS = 20
LONGEST, MOST = 6.0, 40_000  # s of a run, and its samples
ENDS = 10.0, 90.0  # percentiles of the spread


@dataclass(frozen=True, repr=False, eq=False)
class Spread(Shown):
    """RMS tracking error on drawn drives: the values of each loop, infinite where it diverged.

    ``rate`` in Hz; ``noise`` of position (rad), speed (rad/s, nan where the drive takes the
    difference of two positions) and torque (N m), and the encoder's ``resolution`` (rad).
    ``drawn``: the parameters that differ from draw to draw.
    """

    rate: float
    noise: Mapping[str, float]
    resolution: float
    drawn: tuple[str, ...]
    seed: int
    errors: Mapping[str, np.ndarray] = field(default_factory=dict)

    def of(self, key: str) -> tuple[float, float, float]:
        """Median and 10 and 90 % of a loop's error."""
        values = np.sort(self.errors[key])
        places = (len(values) - 1) * np.array([50.0, *ENDS]) / 100.0
        with np.errstate(invalid="ignore"):
            found = [between(values, place) for place in places]
        return found[0], found[1], found[2]

    @property
    def best(self) -> str:
        """The loop of the least median; without compensation where none is smaller."""
        return min(self.errors, key=lambda key: self.of(key)[0])

    def summary(self) -> dict[str, Any]:
        """Plain Python, as under "compensation" "drive" in the JSON document."""
        loops = {
            key: {**dict(zip(("median", "low", "high"), self.of(key), strict=True)),
                  "diverged": int(np.count_nonzero(~np.isfinite(values)))}
            for key, values in self.errors.items()
        }  # fmt: skip
        return {
            "rate": self.rate,
            "resolution": self.resolution,
            "noise": dict(self.noise),
            "drawn": list(self.drawn),
            "draws": len(next(iter(self.errors.values()))),
            "seed": self.seed,
            **loops,
            "recommended": self.best,
        }

    def rows(self, unit: str) -> list[Row]:
        """Median and spread of each loop, for display."""
        made = []
        for key in self.errors:
            middle, low, high = self.of(key)
            made.append(Row(f"on a drive, {key}", f"{middle:.3g} ({low:.3g} to {high:.3g}) {unit}"))
        return made

    def advice(self, unit: str) -> list[str]:
        """One sentence where a compensation makes tracking worse than none."""
        (none, *_), (after, *_) = self.of("none"), self.of("after")
        if after <= none:
            return []
        worse = f"{after:.3g} {unit}" if math.isfinite(after) else "unstable"
        return [
            "On a drive like the recorded one the compensation makes tracking worse: median error "
            f"{worse} with it, {none:.3g} {unit} without; leave it off."
        ]


def between(values: np.ndarray, place: float) -> float:
    """A quantile; infinite beside an infinite value."""
    low, high = values[math.floor(place)], values[math.ceil(place)]
    if not math.isfinite(high):
        return math.inf if place > math.floor(place) else float(low)
    return float(low + (place - math.floor(place)) * (high - low))


@dataclass(frozen=True, eq=False)
class Recorded:
    """What a record shows of its drive."""

    sensing: Sensing
    torque: float

    @classmethod
    def of(cls, record: Record) -> Recorded:
        return cls(sensing_of(record), sensor_noise(record.u, record.resolution.get("u", 0.0)))

    def noise(self) -> dict[str, float]:
        speed = self.sensing.speed_noise
        return {
            "theta": self.sensing.noise,
            "w": math.nan if speed is None else speed,
            "u": self.torque,
        }


def spread(
    task: Task,
    believed: Mapping[str, Model | None],
    watcher: str | None,
    gains: Mapping[str, Mapping[str, Any]],
    way: Course,
    record: Record,
    copies: Sequence[str],
    joint: Joint | None,
    draws: int,
    seed: int,
    report: Progress,
) -> Spread:
    """The tracking error of each loop on ``draws`` drives; one where no covariance is known."""
    drive = Recorded.of(record)
    models = drawn(task.model, joint, draws if joint is not None else 1, seed)
    made = {
        key: _Loop(task, one, watcher, gains[key], drive, way, copies)
        for key, one in believed.items()
    }
    errors: dict[str, list[float]] = {key: [] for key in made}
    for i, model in enumerate(models):
        report(i / len(models), "simulating drives like the recorded one")
        for key, loop in made.items():  # the same noise for each loop
            errors[key].append(loop.error(model, seed + i))
    names = joint.names if joint is not None else ()
    known = task.model.values()
    return Spread(
        1.0 / drive.sensing.dt,
        drive.noise(),
        drive.sensing.resolution,
        tuple(name for name in names if name in known),
        seed,
        {key: np.array(values) for key, values in errors.items()},
    )


def drawn(model: Model, joint: Joint | None, number: int, seed: int) -> list[Model]:
    """Models with parameters from the joint distribution, each inside its bounds."""
    if joint is None or not joint.names:
        return [model] * number
    known, limits = model.known(), model.declarations()
    columns = {k: v for k, v in joint.sample(number, seed).items() if k in known}
    columns = {
        k: np.clip(np.where(np.isfinite(v), v, known[k]), limits[k].low, limits[k].high)
        for k, v in columns.items()
        if not limits[k].whole
    }
    return [model.with_values({k: float(v[i]) for k, v in columns.items()}) for i in range(number)]


class _Loop:
    """A sampled loop whose controller is built once and whose drive changes."""

    def __init__(
        self,
        task: Task,
        believed: Model | None,
        watcher: str | None,
        gains: Mapping[str, Any],
        drive: Recorded,
        way: Course,
        copies: Sequence[str],
    ) -> None:
        self.task, self.drive = task, drive
        dt = drive.sensing.dt
        samples = min(math.floor(min(way.t[-1], LONGEST) / dt), MOST)
        self.t = dt * np.arange(max(2, samples) + 1)
        rows = way.inputs(task.kind)
        names = ("r", "dr") if task.kind == "velocity" else ("r", "dr", "ddr")
        self.rows = {k: np.interp(self.t, way.t, x) for k, x in zip(names, rows, strict=True)}
        self.start = float(way.theta[0])
        blocks = control(task, believed, watcher if believed is not None else None, gains)
        points = usual_points(task.model, float(np.max(np.abs(way.w))))
        self.blocks = [
            encoder(drive.sensing, ("theta_s", "w_s")),
            *(at_samples(block, dt, points) for block in blocks),
        ]
        self.placed = [
            self.start if f"{block.name}_{state}" in ("encoder_last", *copies) else 0.0
            for block in self.blocks
            for state in (block.state_labels if block.nstates else ())
        ]

    def error(self, model: Model, seed: int) -> float:
        """The RMS tracking error on a drive; infinite where the loop diverges."""
        given = dict(self.rows) | self.drive.sensing.errors(len(self.t), seed)
        random = np.random.default_rng((seed, 1))
        given["n_u"] = random.normal(0.0, self.drive.torque, len(self.t))
        body = body_of(replace(self.task, model=model))
        read = {k for block in (body, *self.blocks) for k in block.input_labels}
        given = {k: x for k, x in given.items() if k in read}
        x0 = np.zeros(body.nstates)
        x0[body.state_labels.index("plant_theta")] = self.start
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # a loop that does not work is a result here
                done = simulate_sampled(
                    body, self.blocks, self.t, given, x0, drive_x0=self.placed, rtol=COARSE
                )
        except Diverged:
            return math.inf
        labels = list(done.output_labels or ())
        y = np.asarray(done.outputs)[labels.index(controllers.MEASURED[self.task.kind])]
        return rms(y - self.rows["r"])


def usual_points(model: Model, fastest: float) -> list[dict[str, float]]:
    """Usual inputs and states of an observer by name, at rest and in motion."""
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


def body_of(task: Task, command: str = "u") -> ct.NonlinearIOSystem:
    """The drive from the command and its noise n_u to the motion and what its sensors see."""
    model = task.model
    parts = [
        plant(model, inputs=["u_act", "d"]),
        sensor(model, outputs=["w_s", "theta_s"]),
        controllers.compensation(name="command", inputs=[command], outputs=["u_act"]),
        controllers.compensation(name="torque_noise", inputs=["n_u"], outputs=["u_act"]),
    ]
    parts += [task.table.block()] if task.table is not None else []
    return ct.interconnect(
        parts,
        inputs=[command, "n_u"],
        outputs=["theta", "w", "theta_s", "w_s"],
        params={},
        check_unused=False,
        name="drive_body",
    )
