"""Friction that jumps with the direction of motion, however a law writes the direction."""

from __future__ import annotations

import numpy as np
import pytest

import lugrectl as lg
from lugrectl.engine import Lanes
from lugrectl.engine.fixed_step import relays
from lugrectl.engine.tracer import trace

from ..conftest import there

DT = 1e-3
WRITTEN = {
    "greater": lambda w: np.where(w > 0.0, 1.0, -1.0),
    "less": lambda w: np.where(w < 0.0, -1.0, 1.0),
    "at least": lambda w: np.where(w >= 0.0, 1.0, -1.0),
    "three cases": lambda w: np.where(w > 0.0, 1.0, np.where(w < 0.0, -1.0, 0.0)),
}


def drive(side):
    @lg.block("friction", out="F", name=f"law_{id(side)}")
    def law(w, Fc=lg.P(0.3, "N m", 0), Fv=lg.P(0.02, "N m s/rad", 0)):
        return Fc * side(w) + Fv * w

    return lg.plant(lg.Model.of(J=0.002, friction=law))


def run(system):
    """A drive that is driven through standstill, at rest for a while at each reversal."""
    t = DT * np.arange(550)
    lanes = Lanes(system, backend="python")
    given = {"u": 0.5 * np.sin(12.0 * t), "d": 0.0 * t}
    u = np.column_stack([given[name] for name in lanes.inputs])
    x0 = np.zeros((1, len(lanes.states)))
    return lanes.run(x0, np.zeros(1, int), len(t), u, lanes.defaults[None], dt=DT)


@pytest.mark.slow
@pytest.mark.parametrize("how", WRITTEN)
def test_a_comparison_with_zero_is_a_direction(how):
    system = drive(WRITTEN[how])
    assert len(relays(trace(system))[1]) == 1
    found, expected = (run(made)[0][0] for made in (system, drive(np.sign)))
    motion = expected[:, :2]  # theta, w; at rest the output F is what the law says of w = 0
    assert np.mean(motion[:, 1] == 0.0) > 0.2 and np.ptp(motion[:, 0]) > 0.1
    np.testing.assert_allclose(found[:, :2], motion, rtol=1e-9, atol=1e-12)


def test_a_level_of_each_direction_beside_the_sign():
    """1.2 forward, 0.8 backward: the same as (1 + 0.2 sign w) sign w."""
    mixed = drive(lambda w: np.where(w > 0.0, 1.2, 0.8) * np.sign(w))
    signs = drive(lambda w: (1.0 + 0.2 * np.sign(w)) * np.sign(w))
    found, expected = (run(made)[0][0] for made in (mixed, signs))
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-12)


def test_a_comparison_with_another_speed_is_none():
    assert not relays(trace(drive(lambda w: np.where(w > 0.1, 1.0, 0.5))))[1]


@pytest.mark.parametrize("backend", ["c", "python"])
@pytest.mark.parametrize("w", [-5e-324, 1e-310, -1e-30])
def test_a_speed_next_to_nothing_is_a_rest(backend, w):
    """A step that ends at its zero would have no length, and the run no end."""
    lanes = Lanes(drive(np.sign), backend=there(backend))
    x0 = np.array([[w if name.endswith("w") else 0.0 for name in lanes.states]])
    u = np.zeros((50, len(lanes.inputs)))
    _, x = lanes.run(x0, np.zeros(1, int), len(u), u, lanes.defaults[None], dt=DT)
    assert np.all(np.abs(x) < 1e-15)
