"""Every state and every block is judged by its own size, not by that of its neighbours."""

from __future__ import annotations

import math

import control as ct
import numpy as np
import pytest

import lugrectl as lg
from lugrectl.engine.adaptive_run import chosen_backend

from ..benchmarks import item
from ..cases.own import moving, static
from ..cases.systems import engine_run

T = np.linspace(0, 5, 11)


def lag(t, x, u, p):
    return np.array([-50 * (x[0] - np.sin(20 * t))])


def exact(start, t):
    """dx/dt = -50 (x - sin 20 t)."""
    size = 50 / (50**2 + 20**2)
    steady = size * (50 * np.sin(20 * t) - 20 * np.cos(20 * t))
    return steady + (start + 20 * size) * np.exp(-50 * t)


@pytest.mark.parametrize("start", [1.0, -3e6])
@pytest.mark.parametrize("points", [3, 501])
def test_a_small_motion_after_a_large_start_is_right(start, points):
    system = moving(lag, "y", "lag")
    t = np.linspace(0, 5, points)
    late = t >= 1.0
    error = lg.simulate(system, t, 0.0, [start]).outputs - exact(start, t)
    assert np.abs(error[late]).max() < 1e-5


def test_a_zero_crossing_does_not_shorten_the_steps():
    """The velocity loop of Table 1: one step for each sample and few more."""
    loop = item.loop()
    run = engine_run(loop, chosen_backend(), item.t, item.x0, item.r, rtol=1e-6)
    assert run.steps < 13_000  # 18 800 relative to the present values
    fine = lg.simulate(loop, item.t, item.r, item.x0, rtol=1e-9)
    assert item.worst(run.x, fine.states) < 1e-6


def test_atol_is_the_error_near_zero():
    """Far below atol the motion may be coarse, and costs fewer calls of the block."""
    calls = []

    def counted(t, x, u, p):
        calls[-1] += 1
        return np.array([-math.atan(x[0]) - 400 * x[1], x[0]])  # math: LSODA runs it

    names = ["y", "z"]
    system = moving(counted, names, "swing")
    for atol in (None, 1e-3):
        calls.append(0)
        with pytest.warns(RuntimeWarning, match="LSODA"):
            lg.simulate(system, T, 0.0, [1e-2, 0.0], atol=atol)
    assert calls[1] < 0.5 * calls[0]
    traced = moving(lag, "y", "lag")
    loose = lg.simulate(traced, T, 0.0, [1.0], atol=0.1).outputs - exact(1.0, T)
    fine = lg.simulate(traced, T, 0.0, [1.0]).outputs - exact(1.0, T)
    assert np.abs(fine).max() < 1e-6 < np.abs(loose).max()


@pytest.mark.parametrize("atol", [-1.0, 0.0, math.nan, "x"])
def test_a_wrong_atol_is_one_sentence(atol):
    system = moving(lag, "y", "lag")
    with pytest.raises(lg.InputError, match="atol"):
        lg.simulate(system, T, 0.0, atol=atol)


@pytest.mark.parametrize("blocks", [lambda b: b, lambda b: [b]])
def test_a_block_without_states_that_cannot_be_traced_answers(blocks):
    soft = static(lambda t, x, u, p: np.array([math.tanh(u[0])]), "v", "y", "soft")
    t = np.linspace(0, 1, 11)
    with pytest.warns(RuntimeWarning, match="turned into a number"):
        found = lg.simulate(blocks(soft), t, {"v": t})
    row = np.atleast_2d(found.outputs)[list(found.output_labels).index("y")]
    np.testing.assert_allclose(row, np.tanh(t), atol=1e-9)


@pytest.mark.parametrize("rate", [1.0, 1e9])
def test_a_memory_is_noticed_beside_a_stiff_block_as_alone(rate):
    memory = {"n": 0}

    def flips(t, x, u, p):
        memory["n"] += not hasattr(u[0], "op")
        return 0.1 * u[0] + 1e-3 * (memory["n"] % 2)

    stiff = moving(lambda t, x, u, p: np.array([-rate * (x[0] - u[0])]), "v", "stiff")
    toggles = static(flips, "v", "y", "flips")
    loop = ct.interconnect([stiff, toggles], inputs="u", outputs="y")
    with pytest.warns(RuntimeWarning, match="flips: the traced equation of y differs"):
        try:
            lg.simulate(loop, np.linspace(0, 1, 5), 1.0)
        except lg.InputError:  # python-control may not find its outputs
            pass
