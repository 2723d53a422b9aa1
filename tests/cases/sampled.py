"""Loops at a sample rate."""

from __future__ import annotations

import control as ct
import numpy as np

import lugrectl as lg
from lugrectl.simulation.response import simulate
from lugrectl.simulation.sampled_block import sampled

P, DT = lg.table1(), 1e-3


def step_response(block, u, x0, steps):
    """Outputs (ny, steps) of a discrete block."""
    t = block.dt * np.arange(steps)
    x0 = [*x0, *[0.0] * (block.nstates - len(x0))]
    return np.atleast_2d(ct.input_output_response(block, t, u, x0, squeeze=False).outputs)


def sine_error(observer, x0, dt):
    """Largest error of Fhat along 1 s of a 1 rad/s, 1 Hz sine, against the continuous block.

    The torque is the one that a drive with LuGre friction needs, held between samples.
    """
    t = dt * np.arange(round(1 / dt) + 1)
    wave = ct.nlsys(
        None,
        lambda t, x, u, p: np.array([np.sin(2 * np.pi * t), 0.3 * np.sin(7 * t)]),
        inputs=[],
        outputs=["w", "e"],
        name="wave",
    )
    w, e = np.sin(2 * np.pi * t), 0.3 * np.sin(7 * t)
    F = simulate(lg.friction("lugre"), t, w).outputs
    u = F + 2 * np.pi * P.J * np.cos(2 * np.pi * t)
    inputs = [k for k in ("u",) if k in observer.input_labels]
    along = ct.interconnect(
        [wave, observer], inputs=inputs, outputs=["Fhat"], params={}, check_unused=False
    )
    exact = simulate(along, t, u if inputs else None, x0, hold=True, rtol=1e-8, squeeze=False)
    found = step_response(sampled(observer, dt), inputs_of(observer, w=w, u=u, e=e), x0, len(t))
    return np.abs(found[0] - np.asarray(exact.outputs)[0]).max()


def inputs_of(system, **signals):
    return np.array([signals[k] for k in system.input_labels])
