"""Shared by the tests of loops: the drive, its linear truth, and access to systems by name."""

from dataclasses import replace

import control as ct
import numpy as np

import lugrectl as lg

P = lg.table1()
LOW = replace(P, Fc=0.8 * P.Fc, Fs=0.8 * P.Fs)
OUTPUTS = ["theta", "w", "F", "Fhat", "u", "e"]
OMEGA = np.array([0.4, 3.0, 20.0, 83.0, 400.0])
s = ct.tf("s")
C = 1.6 + 0.16 / s
T = C / (P.J * s + C)
H = 2 / (s + 2)


def simulate(loop, t, u, x0=0.0, **options):
    tolerances = {"rtol": 1e-6, "atol": 1e-9} | options
    return ct.input_output_response(
        loop, t, u, x0, solve_ivp_method="LSODA", solve_ivp_kwargs=tolerances
    )


def signal(resp, name):
    return np.atleast_2d(resp.outputs)[resp.output_labels.index(name)]


def transfer(system, output, input="r"):
    """Frequency response of the linearisation at rest, where |w| z has no first-order part."""
    linear = ct.linearize(system, np.zeros(system.nstates), np.zeros(system.ninputs))
    i, j = system.output_labels.index(output), system.input_labels.index(input)
    return np.array([linear(1j * w, squeeze=False)[i, j] for w in OMEGA])


def at(tf):
    return np.array([tf(1j * w) for w in OMEGA])


def state(system, **values):
    """A state vector from ``block_state`` names; the rest is zero."""
    x = np.zeros(system.nstates)
    for name, value in values.items():
        x[system.state_labels.index(name)] = value
    return x


def outputs(system, x, u, params=None):
    y = system.output(0.0, x, np.atleast_1d(u), params=params)
    return dict(zip(system.output_labels, y, strict=True))
