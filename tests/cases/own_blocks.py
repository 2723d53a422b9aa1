"""Blocks as a user declares them; conftest.py makes their fixtures known."""

import numpy as np
import pytest

import lugrectl as lg


@pytest.fixture
def smooth():
    @lg.block("friction", out="F")
    def smooth_coulomb(w, Fc=lg.P(0.3, "N m", 0), Fv=lg.P(0.02, "N m s/rad", 0)):
        """F = Fc tanh(100 w) + Fv w."""
        return Fc * np.tanh(100.0 * w) + Fv * w

    return smooth_coulomb


@pytest.fixture
def momentum():
    @lg.block("observer", out="Fhat", states="x")
    def momentum_of_test(w, u, x, J=lg.P(0.002, "kg m2"), L=lg.P(50.0, "1/s")):
        Fhat = x - L * J * w
        return Fhat, L * (u - Fhat)

    return momentum_of_test
