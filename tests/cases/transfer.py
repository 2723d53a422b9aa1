"""Responses of linear blocks."""

from __future__ import annotations

import control as ct
import numpy as np
import pytest

s = ct.tf("s")
OMEGA = np.array([0.03, 0.7, 2.0, 11.0, 83.0, 900.0])


def response(block, output=0, input=0):
    """Frequency response of a block from one input to one output."""
    linear = ct.linearize(block, np.zeros(block.nstates), np.zeros(block.ninputs))
    return np.array([linear(1j * w, squeeze=False)[output, input] for w in OMEGA])


def same(block, transfer, output=0, input=0):
    expected = np.array([transfer(1j * w) for w in OMEGA])
    assert response(block, output, input) == pytest.approx(expected, rel=1e-6, abs=1e-9)
