"""A sampled drive: its encoder, its sample rate and dead time, and the torque that it holds."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import control as ct
import numpy as np

from ..blocks.drive import dead_time
from ..blocks.plant import plant
from ..engine.runtime.sampled_run import interpreted
from ..simulation.sampled_response import simulate_sampled
from .loop import Terms, around
from .stepped_block import at_samples

WHOLE = 1.5 * 2.0**52  # a number of this size has no fraction: to add and subtract it rounds
LARGEST = 1.5  # of the largest speed of the reference
COARSE = 1e-4  # error allowed in a step of the plant


@dataclass(frozen=True)
class Sensing:
    """What a drive measures, and how often.

    ``dt`` and ``delay`` in s; ``noise`` of the position in rad and its ``resolution`` in rad,
    0 for none; ``speed_noise`` in rad/s where the drive has a speed of its own, None where it
    takes the difference of two positions.
    """

    dt: float
    noise: float = 0.0
    resolution: float = 0.0
    speed_noise: float | None = None
    delay: float = 0.0

    def errors(self, samples: int, seed: int = 0) -> dict[str, np.ndarray]:
        """The noise of position and speed by the names of the drive's inputs."""
        random = np.random.default_rng(seed)
        sizes = {"n_theta": self.noise, "n_w": self.speed_noise or 0.0}
        return {k: random.normal(0.0, size, samples) for k, size in sizes.items()}

    def quiet(self) -> Sensing:
        """The same drive with an exact sensor."""
        return Sensing(self.dt, 0.0, 0.0, None if self.speed_noise is None else 0.0, self.delay)


@dataclass(frozen=True)
class _Encoder:
    """theta_m = q round((theta + n_theta)/q); w_m is its difference, or w + n_w.

    ``moves``: the next state, which is theta_m.
    """

    step: float
    dt: float
    own: bool
    moves: bool

    def __call__(self, t: Any, x: Any, v: Any, params: Any) -> np.ndarray:
        angle = rounded(v[0] + v[2], self.step)
        if self.moves:
            return np.array([angle])
        return np.array([angle, v[1] + v[3] if self.own else (angle - x[0]) / self.dt])

    def rests_on(self) -> tuple[Any, ...]:
        """Nothing but its arguments decides the answer."""
        return ()


def rounded(x: Any, step: float) -> Any:
    """x to the nearest multiple of a step, 0 for none; in arithmetic that the engine can trace."""
    return step * ((x / step + WHOLE) - WHOLE) if step else x


def encoder(sensing: Sensing) -> ct.NonlinearIOSystem:
    """The sensor as a block: inputs theta, w, n_theta, n_w, outputs theta_m, w_m."""
    given = (sensing.resolution, sensing.dt, sensing.speed_noise is not None)
    return ct.nlsys(
        _Encoder(*given, moves=True),
        _Encoder(*given, moves=False),
        inputs=["theta", "w", "n_theta", "n_w"],
        outputs=["theta_m", "w_m"],
        states=["last"],
        dt=sensing.dt,
        name="encoder",
    )


def sampled_run(
    terms: Terms,
    name: str,
    kind: str,
    gains: Mapping[str, Any],
    sensing: Sensing,
    rows: Mapping[str, np.ndarray],
    believed: Mapping[str, float] | None = None,
) -> dict[str, np.ndarray]:
    """Signals by name of the loop with an observer in a sampled drive.

    ``rows``: the reference r, its derivatives and a load d by name, (N,) each; ``believed``:
    parameters of the observer in place of those of the drive. Raises Diverged.
    """
    parts = [
        encoder(sensing),
        dead_time(sensing.delay, sensing.dt, inputs=["u"], outputs=["u_late"]),
        *around(terms, name, kind, gains, believed or {}),
    ]
    t = sensing.dt * np.arange(len(rows["r"]))
    speed = rows["r"] if kind == "velocity" else rows["dr"]
    points = _points(terms, LARGEST * float(np.max(np.abs(speed))))
    drive = [at_samples(block, sensing.dt, points) for block in parts]
    body = plant(terms.model, inputs=["u_late", "d"])
    read = {k for block in (body, *drive) for k in block.input_labels}
    given = {k: x for k, x in (dict(rows) | sensing.errors(len(t))).items() if k in read}
    with warnings.catch_warnings(), interpreted():
        warnings.simplefilter("ignore")  # a loop that does not work is a result here
        done = simulate_sampled(body, drive, t, given, rtol=COARSE)
    return dict(zip(done.output_labels or (), np.asarray(done.outputs), strict=True))


def _points(terms: Terms, fastest: float) -> list[dict[str, float]]:
    """Inputs and states of an observer by name, at rest and in motion."""
    known = terms.values()
    torque = max(known.get("Fs", 0.0), known.get("Fc", 0.0))
    z = torque / known["sigma0"] if "sigma0" in known else 0.0
    sizes = dict.fromkeys(("u", "zeta", "f", "Fhat"), torque) | {"zhat": z}
    return [
        sizes
        | dict.fromkeys(("w", "w_m", "what"), w)
        | {"xi": known["J"] * w + known.get("sigma1", 0.0) * z}
        for w in (0.0, 0.1 * fastest, fastest)
    ]
