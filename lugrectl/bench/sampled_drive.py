"""A sampled drive: its encoder, its sample rate and dead time, and the torque that it holds."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from typing import Any

import numpy as np

from ..blocks.drive import dead_time
from ..blocks.plant import plant
from ..engine.runtime.sampled_run import interpreted
from ..simulation.encoder import Sensing, encoder
from ..simulation.sampled_response import COARSE, simulate_sampled
from ..simulation.stepped_block import at_samples
from .terms import Terms, around

LARGEST = 1.5  # of the largest speed of the reference


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
