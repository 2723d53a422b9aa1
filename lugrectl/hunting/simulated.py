"""Limit cycles by simulation from several starts: sampled loops, bristles, any control system."""

from __future__ import annotations

import warnings
from typing import Any

import control as ct
import numpy as np

from ..blocks import controllers
from ..blocks.drive import dead_time
from ..blocks.model import Model
from ..blocks.plant import plant
from ..core.errors import InputError
from ..simulation.encoder import Sensing, encoder, rounded
from ..simulation.response import simulate
from ..simulation.sampled_block import sampled
from ..simulation.sampled_response import simulate_sampled
from .lanes import Loop
from .waiting import Run

ERRORS = np.geomspace(0.05, 30.0, 10)  # units: errors at breakaway from which it starts
CELLS = np.linspace(0.55, 3.0, 12)  # counts
SHAKEN = 0.01  # counts
LENGTHS = (20_000, 80_000, 320_000)  # samples of a run, longer where it is open
POINTS = 40_000  # of a run in continuous time
STEPS = (1e-3, 1e-2, 0.1)  # rad, of the reference of a loop


def sampled_starts(loop: Loop, sensing: Sensing) -> np.ndarray:
    """Errors at breakaway, rad: an error within half a count is rest, and over the first counts
    what becomes of it depends on its place within one."""
    cells = CELLS * sensing.resolution
    every = np.r_[ERRORS * loop.unit, cells[cells > ERRORS[0] * loop.unit]]
    return np.sort(every[every > 0.5 * sensing.resolution])


def sampled_run(model: Model, loop: Loop, sensing: Sensing) -> Run:
    """A run of a sampled PID: from breakaway at an error, for so many samples.

    Exact from sample to sample: the encoder's counts, the difference that is its speed, the
    torque that is held, and its dead time. Counts are shaken by a hundredth: a swing that locks to
    a place within a count and ends when it is shaken is no hunting.
    """
    body = plant(model, inputs=["u_late", "d"])
    drive = [
        encoder(sensing),
        controllers.error("position", inputs=["r", "theta_m"]),
        sampled(controllers.pid(loop.kp, loop.ki, loop.kd, inputs=["e", "w_m"]), sensing.dt),
        dead_time(sensing.delay, sensing.dt, inputs=["u"], outputs=["u_late"]),
    ]

    def run(e: float, length: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        t, x = sensing.dt * np.arange(length), at_breakaway(loop, body, e)
        seen = float(rounded(e, sensing.resolution))
        own = {"last": seen, "q": _integral(loop, seen), "last_e": seen}
        names = [label for block in drive for label in block.state_labels]
        start = [next((v for k, v in own.items() if n.endswith(k)), 0.0) for n in names]
        shaken = np.random.default_rng(0).uniform(-SHAKEN, SHAKEN, length) * sensing.resolution
        inputs = {"r": 0.0, "n_theta": shaken}
        return t, *_motion(quietly(simulate_sampled, body, drive, t, inputs, x, drive_x0=start))

    return run


def _integral(loop: Loop, e: float) -> float:
    """The integrator's state at which the torque reaches breakaway; none without integral gain."""
    return (loop.kp * e - loop.curve.Fs) / loop.ki if loop.ki else 0.0


def at_breakaway(loop: Loop, body: Any, e: float) -> list[float]:
    """The states of a plant that is about to slip from e > 0 towards zero: bristles are bent."""
    bend = -loop.curve.Fs
    stiff = body.params.get("plant.sigma0", np.inf)
    first = {"theta": e, "z": bend / stiff}
    return [first.get(label, 0.0) for label in body.state_labels]


def continuous_run(model: Model, loop: Loop, seconds: float) -> Run:
    """A run of the PID loop with all of a model, bristles and effects, in continuous time."""
    parts = [
        plant(model),
        controllers.error("position"),
        controllers.pid(loop.kp, loop.ki, loop.kd),
    ]
    system = ct.interconnect(
        parts, inputs=["r"], outputs=["theta", "u"], params={}, check_unused=False, name="loop"
    )

    def run(e: float, times: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        t = np.linspace(0.0, times * seconds, POINTS)
        start = [*at_breakaway(loop, parts[0], e), _integral(loop, e)]
        return t, *_motion(quietly(simulate, system, t, {"r": 0.0}, start))

    return run


def loop_run(system: Any, seconds: float) -> Run:
    """A run of any loop with the input r and the outputs theta and u: a step from rest."""
    missing = [k for k in ("theta", "u") if k not in (getattr(system, "output_labels", None) or ())]
    if missing or "r" not in system.input_labels:
        raise InputError(
            "limit_cycles needs a model with gains, or a position loop with the input r and the "
            f"outputs theta and u; {getattr(system, 'name', 'this')} has none of that kind."
        )

    def run(step: float, times: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        t = np.linspace(0.0, times * seconds, POINTS)
        return t, *_motion(quietly(simulate, system, t, {"r": step}))

    return run


def quietly(simulated: Any, *given: Any, **more: Any) -> Any:
    """A response without its warnings: a drive that chatters at rest is what is looked for."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return simulated(*given, **more)


def _motion(done: Any) -> tuple[np.ndarray, np.ndarray]:
    """theta and u of a response."""
    labels = list(done.output_labels)
    rows = np.asarray(done.outputs).reshape(len(labels), -1)
    return rows[labels.index("theta")], rows[labels.index("u")]
