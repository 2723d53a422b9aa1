"""Blocks with rates that are not affine, advanced over a sample in a few Runge-Kutta steps.

Unlike the substeps of :func:`lugrectl.sampled`, which are as short as their error needs, these are
of one length, so that the engine can trace them: a run takes a twentieth of the time.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..engine.runtime.substeps import Substeps
from .sampled_block import in_steps, sampled, signals, usually_held

MOST = 24  # Runge-Kutta steps in a sample
REACH = 1.2  # of a rate times the length of a step; the method is stable up to 2.7
SMALL = 1e-6  # relative change of a state for a slope


def at_samples(block: Any, dt: float, points: Sequence[Mapping[str, float]]) -> Any:
    """A block in discrete time; ``points`` are usual inputs and states by name, 0 if left out."""
    if not block.nstates or block.isdtime(strict=True):
        return block
    if Substeps(block, dt).affine(block.params):
        return sampled(block, dt)
    steps = math.ceil(min(dt * _rate(block, points) / REACH, 1e6))
    if steps > MOST:
        return sampled(block, dt)
    held = usually_held(block)
    step = _Step(block, dt, max(steps, 2), tuple(s in held for s in block.input_labels))
    return in_steps(step)


def _rate(block: Any, points: Sequence[Mapping[str, float]]) -> float:
    """The fastest rate of the states in 1/s, at any of the points."""
    found = 0.0
    for point in points:
        v, x = (np.array([point.get(k, 0.0) for k in names])
                for names in (block.input_labels, block.state_labels))  # fmt: skip
        steps = SMALL * np.maximum(np.abs(x), 1e-3)
        columns = [
            (block.updfcn(0.0, x + d, v, block.params) - block.updfcn(0.0, x - d, v, block.params))
            / (2.0 * step)
            for d, step in zip(np.diag(steps), steps, strict=True)
        ]
        found = max(found, float(np.abs(np.linalg.eigvals(np.array(columns).T)).max()))
    return found


@dataclass(frozen=True, eq=False)
class _Step:
    """One sample in ``steps`` steps of the classical Runge-Kutta method of order 4."""

    system: Any
    dt: float
    steps: int
    held: tuple[bool, ...]

    def state(self, t: Any, s: Any, v: Any, params: Any) -> np.ndarray:
        """The states at the sample that is being taken."""
        n = int(self.system.nstates)
        start, last = signals(s[:n]), list(s[n:-1])
        now = [a if held else b for held, a, b in zip(self.held, last, v, strict=True)]

        def rates(x: Any, share: float) -> Any:
            given = [a + share * (b - a) for a, b in zip(last, now, strict=True)]
            return signals(self.system.updfcn(t, x, signals(given), params))

        x, h = start, self.dt / self.steps
        for k in range(self.steps):
            first, middle, end = (np.array([k, k + 0.5, k + 1]) / self.steps).tolist()
            k1 = rates(x, first)
            k2 = rates(x + 0.5 * h * k1, middle)
            k3 = rates(x + 0.5 * h * k2, middle)
            k4 = rates(x + h * k3, end)
            x = x + h / 6.0 * (k1 + 2.0 * (k2 + k3) + k4)
        return signals(np.where(signals(s[-1:])[0] < 0.5, start, x))
