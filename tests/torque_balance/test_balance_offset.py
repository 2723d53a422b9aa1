"""A speed that is off at rest, a torque that hardly changes, and sums that say nothing."""

import numpy as np
import pytest

import lugrectl as lg

from ..cases.balance_drive import FC, FV, J, inside, log_of, simulate, torque
from ..cases.faulty_logs import columns, late

MODEL = lg.Model.of(friction="coulomb")
DT = 2e-3


def answered(offset, seconds=10.0):
    """The balance of a run of u and w alone, w off by a constant."""
    u = torque(seconds, DT)
    _, w = simulate(u, DT)
    noise = np.random.default_rng(3).normal(0.0, 0.02, len(u))
    return lg.balance(log_of(u, DT, w=w + noise + offset), MODEL)


def test_a_true_speed_has_no_offset():
    found = answered(0.0)
    assert "w_offset" not in found.names
    assert inside(found.parameters["Fc"], FC)


def test_an_offset_that_may_be_0_is_not_said_and_not_subtracted():
    """A speed in steps of 0.05 rad/s: its offset comes out as 0.008 with an error of 0.02."""
    u = torque(10.0, DT, seed=4)
    _, w = simulate(u, DT)
    found = lg.balance(log_of(u, DT, w=np.round(w / 0.05) * 0.05), MODEL)
    assert not any("too high" in note or "too low" in note for note in found.notes)
    assert "w_offset" not in found.parameters or found.parameters["w_offset"].may_be(0.0)


def test_an_offset_of_the_speed_is_no_torque():
    shifted = answered(0.5)
    truth = {"J": J, "Fc": FC, "Fv": FV, "w_offset": 0.5, "constant_torque": 0.0}
    assert all(inside(shifted.parameters[k], true) for k, true in truth.items())
    assert any("rad/s too high" in note for note in shifted.notes)


@pytest.mark.slow
def test_a_delay_from_many_changes_of_torque_is_certain_however_slow_the_residual():
    """A slow unknown torque is remembered for long; the torque still changes as often."""
    rows = 25
    log = late(rows)(columns(seed=5))
    log["u"] += 0.01 * np.sin(2.1 * log["t"])
    found = lg.balance(log, MODEL)
    assert found.parameters["u_delay"].value == pytest.approx(-rows * DT, abs=1e-3)
    assert found.parameters["J"].value == pytest.approx(J, rel=0.01)
