"""Every observer and controller at a sample rate, exact or in substeps."""

import control as ct
import numpy as np
import pytest

import lugrectl as lg
from lugrectl.simulation.response import simulate
from lugrectl.simulation.sampled_block import sampled

from ..cases.observed import P, believing
from ..cases.own import static
from ..cases.sampled import step_response

DT, LOW = 1e-3, believing(0.8)
MOTION = ("theta", "w", "e", "s", "r", "dr", "ddr", "ar")


def motion(t):
    """A turn to and fro at 1 rad/s, and errors that change slowly, in the order of MOTION."""
    w, a = np.sin(2 * np.pi * t), 2 * np.pi * np.cos(2 * np.pi * t)
    theta, e = (1 - np.cos(2 * np.pi * t)) / (2 * np.pi), 0.3 * np.sin(7 * t)
    return np.array([theta, w, e, e, theta, w, a, a])


def along(block, seconds=0.1):
    """The outputs in continuous time and at 1 kHz, along the motion; the torque is held."""
    t = DT * np.arange(round(seconds / DT) + 1)
    known = dict(zip(MOTION, motion(t), strict=True))
    F = simulate(lg.friction("lugre"), t, known["w"]).outputs
    known["u"] = F + P.J * known["ddr"]
    source = static(lambda t, x, u, p: motion(t), [], list(MOTION), "motion")
    held, rows = [k for k in ("u",) if k in block.input_labels], list(block.output_labels)
    wired = ct.interconnect(
        [source, block], inputs=held, outputs=rows, params={}, check_unused=False
    )
    x0 = np.zeros(block.nstates)
    options = {"hold": True, "rtol": 1e-8, "squeeze": False}
    exact = simulate(wired, t, known["u"] if held else None, x0, **options)
    given = np.array([known[k] for k in block.input_labels])
    found = step_response(sampled(block, DT), given, x0, len(t))
    return np.atleast_2d(found), np.atleast_2d(exact.outputs)


BLOCKS = {  # block, and its error at 1 kHz, relative to the largest value of each output
    "temperature": (lambda: lg.temperature_observer(LOW), 1e-5),
    "adaptive": (lambda: lg.adaptive_observer(LOW), 1e-5),
    "position Coulomb": (lambda: lg.position_coulomb_observer(LOW), 1e-2),
    "position LuGre": (lambda: lg.position_lugre_observer(LOW), 5e-4),
    "general Coulomb": (lambda: lg.general_coulomb_observer(LOW), 1e-4),
    "friction state": (lambda: lg.friction_state_observer(LOW), 5e-4),
    "normal force": (lambda: lg.normal_force_observer(LOW), 1e-3),
    "Lyapunov": (lambda: lg.lyapunov_observer(LOW), 1e-3),
    "adaptive Slotine-Li": (lambda: lg.adaptive_slotine_li(), 1e-5),
    "dual observers": (lambda: lg.dual_observer_control(LOW), 1e-5),
    "backstepping": (lambda: lg.backstepping_smc(P), 1e-4),
    "repetitive": (lambda: lg.repetitive_control(P), 1e-5),
}


@pytest.mark.parametrize(("make", "error"), BLOCKS.values(), ids=BLOCKS)
def test_a_block_at_1_khz_is_the_continuous_one(make, error):
    found, exact = along(make())
    size = np.maximum(np.abs(exact).max(axis=1, keepdims=True), 1e-3)
    assert np.abs(exact).max() > 0.01
    assert np.max(np.abs(found - exact) / size) < error
