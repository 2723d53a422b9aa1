"""Runs of a loop that is simulated: sampled ones, bristles and effects, any control system."""

from __future__ import annotations

import warnings
from typing import Any

import control as ct
import numpy as np

from ..blocks import controllers
from ..blocks.drive import dead_time, limiter
from ..blocks.model import Model
from ..blocks.plant import plant
from ..core.errors import InputError
from ..simulation.encoder import Sensing, encoder, rounded
from ..simulation.response import simulate
from ..simulation.sampled_block import sampled
from ..simulation.sampled_response import simulate_sampled
from .loop import Loop
from .search import Motion, Run

SMALLEST, LARGEST, COUNT = 0.05, 30.0, 14  # units: errors at breakaway from which it starts
CELLS = np.linspace(0.55, 3.0, 12)  # counts
SHAKEN = 0.01  # counts
SAMPLES = 20_000  # of a run
POINTS, MOST = 40_000, 640_000  # of a run in continuous time, and of a longer one
LOAD = "theta_load"


def errors(loop: Loop) -> np.ndarray:
    """Return errors at breakaway, rad, up to the largest that friction can keep up."""
    reach = loop.reach if np.isfinite(loop.reach) else 0.0
    return loop.unit * np.geomspace(SMALLEST, max(LARGEST, reach), COUNT)


def sampled_starts(loop: Loop, sensing: Sensing, cycles: list[float]) -> np.ndarray:
    """Return errors at breakaway, rad, those of cycles too: an error within half a count is rest,
    and over the first counts what becomes of it depends on its place within one."""
    cells = CELLS * sensing.resolution
    every = np.r_[errors(loop), cells[cells > SMALLEST * loop.unit], cycles]
    return np.sort(every[every > 0.5 * sensing.resolution])


def sampled_run(model: Model, loop: Loop, sensing: Sensing, limit: float | None) -> Run:
    """Return a run of a sampled PID: from breakaway at an error, for so many times its samples.

    Exact from sample to sample: the encoder's counts, the difference that is its speed, the
    torque that is held, and its dead time. Counts are shaken by a hundredth: a swing that locks to
    a place within a count and ends when it is shaken is no hunting.
    """
    body = plant(model, inputs=["u_late", "d"])
    pid, *limited = _controller(loop, limit, "w_m")
    drive = [
        encoder(sensing),
        controllers.error("position", inputs=["r", "theta_m"]),
        *(sampled(pid, sensing.dt), *limited),
        dead_time(sensing.delay, sensing.dt, inputs=["u"], outputs=["u_late"]),
    ]
    names = [label for block in drive for label in block.state_labels]

    def run(e: float, times: int) -> Motion:
        length = SAMPLES * times
        seen = float(rounded(e, sensing.resolution))
        own = {"last": seen, "q": _integral(loop, seen), "last_e": seen}
        start = [next((v for k, v in own.items() if n.endswith(k)), 0.0) for n in names]
        shaken = np.random.default_rng(0).uniform(-SHAKEN, SHAKEN, length) * sensing.resolution
        t, inputs = sensing.dt * np.arange(length), {"r": 0.0, "n_theta": shaken}
        x = _at_breakaway(loop, body, e)
        return _motion(quietly(simulate_sampled, body, drive, t, inputs, x, drive_x0=start))

    return run


def _controller(loop: Loop, limit: float | None, speed: str) -> list[ct.NonlinearIOSystem]:
    """A PID from e and a speed to u; a limit holds its integral back."""
    gains = (loop.kp, loop.ki, loop.kd)
    if limit is None:
        return [controllers.pid(*gains, inputs=["e", speed])]
    time = controllers.tracking_time(loop.kp, loop.ki, None, "limit_cycles")
    seen = ["e", speed, "excess"]
    return [
        controllers.pid(*gains, tracking=time, inputs=seen, outputs=["u_cmd"]),
        limiter(limit, inputs=["u_cmd"], outputs=["u", "excess"]),
    ]


def _integral(loop: Loop, e: float) -> float:
    """The integrator's state at which the torque reaches breakaway; none without integral gain."""
    return (loop.kp * e - loop.curve.Fs) / loop.ki if loop.ki else 0.0


def _at_breakaway(loop: Loop, body: Any, e: float) -> list[float]:
    """The states of a plant that is about to slip from e > 0 towards zero: bristles are bent."""
    first = {"theta": e, "z": -loop.curve.Fs / body.params.get("plant.sigma0", np.inf)}
    return [first.get(label, 0.0) for label in body.state_labels]


def continuous_run(model: Model, loop: Loop, seconds: float, limit: float | None) -> Run:
    """Return a run of the PID loop in continuous time with all of a model."""
    body = plant(model)
    seen = ["theta", "u", *(k for k in body.output_labels if k == LOAD)]
    system = ct.interconnect(
        [body, controllers.error("position"), *_controller(loop, limit, "w")],
        inputs=["r"], outputs=seen, params={}, check_unused=False, name="loop",
    )  # fmt: skip

    def run(e: float, times: int) -> Motion:
        start = [*_at_breakaway(loop, body, e), _integral(loop, e)]
        return _motion(quietly(simulate, system, _times(times, seconds), {"r": 0.0}, start))

    return run


def loop_run(system: Any, seconds: float) -> Run:
    """Return a run of any loop with the input r and the outputs theta and u: a step from rest."""
    missing = [k for k in ("theta", "u") if k not in (getattr(system, "output_labels", None) or ())]
    if missing or "r" not in system.input_labels:
        raise InputError(
            "limit_cycles needs a model with gains, or a position loop with the input r and the "
            f"outputs theta and u; {getattr(system, 'name', 'this')} has none of that kind."
        )

    def run(step: float, times: int) -> Motion:
        return _motion(quietly(simulate, system, _times(times, seconds), {"r": step}), step)

    return run


def _times(times: int, seconds: float) -> np.ndarray:
    return np.linspace(0.0, times * seconds, min(POINTS * times, MOST))


def quietly(simulated: Any, *given: Any, **more: Any) -> Any:
    """Return a response without its warnings: a drive that chatters at rest is looked for."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return simulated(*given, **more)


def _motion(done: Any, r: float = 0.0) -> Motion:
    """A response as a motion; the side that is controlled is the one that e = theta - r follows."""
    labels = list(done.output_labels)
    rows = dict(zip(labels, np.asarray(done.outputs).reshape(len(labels), -1), strict=True))
    motor, load = rows["theta"] - r, rows.get(LOAD)
    if load is None:
        return Motion(done.time, motor, rows["u"])
    sides, e = {"motor": motor, "load": load - r}, rows.get("e", motor)
    return Motion(done.time, min(sides.values(), key=lambda y: np.ptp(e - y)), rows["u"], sides)
