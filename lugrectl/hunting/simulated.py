"""Limit cycles by simulation from several starts: sampled loops, bristles, any control system."""

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
from .lanes import Loop
from .waiting import Motion, Run

SMALLEST, LARGEST, COUNT = 0.05, 30.0, 14  # units: errors at breakaway from which it starts
CELLS = np.linspace(0.55, 3.0, 12)  # counts
SHAKEN = 0.01  # counts
SAMPLES = 20_000  # of a run
POINTS, MOST = 40_000, 640_000  # of a run in continuous time, and of a longer one
STEPS = np.geomspace(1e-3, 10.0, 9)  # rad, of the reference of a loop
LOAD = "theta_load"


def errors(loop: Loop) -> np.ndarray:
    """Errors at breakaway, rad, up to the largest that friction keeps up in a linear loop."""
    reach = loop.reach if np.isfinite(loop.reach) else 0.0
    return loop.unit * np.geomspace(SMALLEST, max(LARGEST, reach), COUNT)


def sampled_starts(loop: Loop, sensing: Sensing, cycles: list[float]) -> np.ndarray:
    """Errors at breakaway, rad, those of cycles too: an error within half a count is rest, and over
    the first counts what becomes of it depends on its place within one."""
    cells = CELLS * sensing.resolution
    every = np.r_[errors(loop), cells[cells > SMALLEST * loop.unit], cycles]
    return np.sort(every[every > 0.5 * sensing.resolution])


def sampled_run(model: Model, loop: Loop, sensing: Sensing, limit: float | None) -> Run:
    """A run of a sampled PID: from breakaway at an error, for so many times its first samples.

    Exact from sample to sample: the encoder's counts, the difference that is its speed, the
    torque that is held, and its dead time. Counts are shaken by a hundredth: a swing that locks to
    a place within a count and ends when it is shaken is no hunting.
    """
    body = plant(model, inputs=["u_late", "d"])
    drive = [
        encoder(sensing),
        controllers.error("position", inputs=["r", "theta_m"]),
        *_controller(loop, limit, "w_m", sensing.dt),
        dead_time(sensing.delay, sensing.dt, inputs=["u"], outputs=["u_late"]),
    ]

    def run(e: float, times: int) -> Motion:
        length, x = SAMPLES * times, at_breakaway(loop, body, e)
        t = sensing.dt * np.arange(length)
        seen = float(rounded(e, sensing.resolution))
        own = {"last": seen, "q": _integral(loop, seen), "last_e": seen}
        names = [label for block in drive for label in block.state_labels]
        start = [next((v for k, v in own.items() if n.endswith(k)), 0.0) for n in names]
        shaken = np.random.default_rng(0).uniform(-SHAKEN, SHAKEN, length) * sensing.resolution
        inputs = {"r": 0.0, "n_theta": shaken}
        return _motion(_quietly(simulate_sampled, body, drive, t, inputs, x, drive_x0=start))

    return run


def _controller(
    loop: Loop, limit: float | None, speed: str, dt: float | None = None
) -> list[ct.NonlinearIOSystem]:
    """A PID from e and a speed to u, sampled where dt is given; a limit holds its integral back."""
    gains = (loop.kp, loop.ki, loop.kd)
    if limit is None:
        parts = [controllers.pid(*gains, inputs=["e", speed])]
    else:
        time = controllers.tracking_time(loop.kp, loop.ki, None, "limit_cycles")
        seen = ["e", speed, "excess"]
        parts = [
            controllers.pid(*gains, tracking=time, inputs=seen, outputs=["u_cmd"]),
            limiter(limit, inputs=["u_cmd"], outputs=["u", "excess"]),
        ]
    return parts if dt is None else [sampled(parts[0], dt), *parts[1:]]


def _integral(loop: Loop, e: float) -> float:
    """The integrator's state at which the torque reaches breakaway; none without integral gain."""
    return (loop.kp * e - loop.curve.Fs) / loop.ki if loop.ki else 0.0


def at_breakaway(loop: Loop, body: Any, e: float) -> list[float]:
    """The states of a plant that is about to slip from e > 0 towards zero: bristles are bent."""
    bend = -loop.curve.Fs
    stiff = body.params.get("plant.sigma0", np.inf)
    first = {"theta": e, "z": bend / stiff}
    return [first.get(label, 0.0) for label in body.state_labels]


def continuous_run(model: Model, loop: Loop, seconds: float, limit: float | None) -> Run:
    """A run of the PID loop with all of a model, bristles and effects, in continuous time."""
    parts = [
        plant(model),
        controllers.error("position"),
        *_controller(loop, limit, "w"),
    ]
    seen = ["theta", "u", *(k for k in parts[0].output_labels if k == LOAD)]
    system = ct.interconnect(
        parts, inputs=["r"], outputs=seen, params={}, check_unused=False, name="loop"
    )

    def run(e: float, times: int) -> Motion:
        start = [*at_breakaway(loop, parts[0], e), _integral(loop, e)]
        return _motion(_quietly(simulate, system, _times(times, seconds), {"r": 0.0}, start))

    return run


def loop_run(system: Any, seconds: float) -> Run:
    """A run of any loop with the input r and the outputs theta and u: a step from rest."""
    missing = [k for k in ("theta", "u") if k not in (getattr(system, "output_labels", None) or ())]
    if missing or "r" not in system.input_labels:
        raise InputError(
            "limit_cycles needs a model with gains, or a position loop with the input r and the "
            f"outputs theta and u; {getattr(system, 'name', 'this')} has none of that kind."
        )

    def run(step: float, times: int) -> Motion:
        return _motion(_quietly(simulate, system, _times(times, seconds), {"r": step}), step)

    return run


def _times(times: int, seconds: float) -> np.ndarray:
    return np.linspace(0.0, times * seconds, min(POINTS * times, MOST))


def _quietly(simulated: Any, *given: Any, **more: Any) -> Any:
    """A response without its warnings: a drive that chatters at rest is what is looked for."""
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
    far = [float(np.ptp(e - y)) for y in sides.values()]
    return Motion(done.time, motor if far[0] <= far[1] else load - r, rows["u"], sides)
