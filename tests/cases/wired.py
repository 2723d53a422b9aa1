"""Shared by the tests of loops: the drive, its linear truth, and access to systems by name."""

import control as ct
import numpy as np

from .observed import P, believing

LOW = believing(0.8)
OUTPUTS = ["theta", "w", "F", "Fhat", "u", "e"]
OMEGA = np.array([0.4, 3.0, 20.0, 83.0, 400.0])
s = ct.tf("s")
C = 1.6 + 0.16 / s
T = C / (P.J * s + C)
H = 2 / (s + 2)


def joined(parts, inputs, outputs):
    """The blocks connected by their names."""
    return ct.interconnect(
        parts, inputs=inputs, outputs=outputs, params={}, check_unused=False, name="joined"
    )


def simulate(loop, t, u, x0=0.0, **options):
    tolerances = {"rtol": 1e-6, "atol": 1e-9} | options
    return ct.input_output_response(
        loop, t, u, x0, solve_ivp_method="LSODA", solve_ivp_kwargs=tolerances
    )


def transfer(system, output, input="r"):
    """Frequency response of the linearisation at rest, where |w| z has no first-order part."""
    linear = ct.linearize(system, np.zeros(system.nstates), np.zeros(system.ninputs))
    i, j = system.output_labels.index(output), system.input_labels.index(input)
    return np.array([linear(1j * w, squeeze=False)[i, j] for w in OMEGA])


def at(tf):
    return np.array([tf(1j * w) for w in OMEGA])


def outputs(system, x, u, params=None):
    y = system.output(0.0, x, np.atleast_1d(u), params=params)
    return dict(zip(system.output_labels, y, strict=True))
