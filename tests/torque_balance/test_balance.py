"""The plain torque balance on logs of a drive whose values are known."""

from __future__ import annotations

import numpy as np
import pytest

import lugrectl as lg

from ..cases.balance_drive import FC, FV, J, inside, log_of, recorded, simulate, torque

MODEL, DT = lg.Model.of(), 2e-3


@pytest.fixture(scope="module")
def log():
    return recorded()


@pytest.fixture(scope="module")
def plain(log):
    return lg.balance(log, MODEL)


def test_inertia_and_friction_are_within_their_intervals(plain):
    for key, truth in (("J", J), ("Fc", FC), ("Fv", FV), ("constant_torque", 0.0)):
        assert inside(plain.parameters[key], truth), key
    assert plain.parameters["J"].value == pytest.approx(J, rel=0.01)
    assert plain.parameters["Fc"].value == pytest.approx(FC, rel=0.01)
    assert plain.parameters["Fv"].value == pytest.approx(FV, rel=0.02)


def test_a_held_torque_has_no_delay_and_little_is_left(plain):
    delay = plain.parameters["u_delay"]
    assert inside(delay, 0.0) and abs(delay.value) < 2e-4
    assert plain.left < 0.02


def test_the_curve_has_both_directions_and_the_friction_of_the_drive(plain):
    w = np.array([p.w for p in plain.curve])
    torque = np.array([p.torque for p in plain.curve])
    assert (w < 0).any() and (w > 0).any() and (np.diff(w) > 0).all()
    fast = np.abs(w) > 2
    assert torque[fast] == pytest.approx((FC * np.sign(w) + FV * w)[fast], rel=0.05)


@pytest.mark.slow
@pytest.mark.parametrize("samples", [-5, 15])
def test_a_late_torque_is_a_delay_and_leaves_the_friction_right(log, samples):
    u = np.roll(log["u"], -samples)[20:-20]
    found = lg.balance(log_of(u, DT, log["theta"][20:-20]), MODEL)
    delay = found.values()["u_delay"]
    assert delay == pytest.approx(samples * DT, abs=1e-3)
    assert found.values()["Fc"] == pytest.approx(FC, rel=0.02)
    assert found.values()["J"] == pytest.approx(J, rel=0.03)
    assert samples > 0 or any("u comes 10 ms late" in note for note in found.notes)


def test_a_dead_torque_channel_is_said(log):
    found = lg.balance(log | {"u": np.zeros_like(log["u"])}, MODEL)
    assert not found.parameters and "dead" in found.notes[-1]


def test_short_records_are_answered_with_a_sentence():
    found = lg.balance(recorded(seconds=0.02), MODEL)
    assert not found.parameters and found.notes


@pytest.mark.slow
def test_runs_of_different_rates_are_one_data_set():
    runs = [recorded(4.0, dt, seed) for seed, dt in enumerate((1e-3, 2e-3, 4e-3))]
    found = lg.balance(runs, MODEL)
    assert inside(found.parameters["J"], J) and inside(found.parameters["Fc"], FC)
    assert abs(found.parameters["u_delay"].value) < 3e-4


def test_a_speed_with_gain_and_offset_is_noticed(log):
    u = torque(10.0, 2e-3)
    _, w = simulate(u, 2e-3)
    rng = np.random.default_rng(1)
    off = 1.08 * w + 0.4 + 0.01 * rng.standard_normal(len(w))
    found = lg.balance(log | {"w": off}, MODEL)
    assert found.parameters["w_gain"].value == pytest.approx(1.08, abs=0.004)
    assert found.parameters["w_offset"].value == pytest.approx(0.4, abs=0.01)
    assert any("1.077 times" in note for note in found.notes)
    assert inside(found.parameters["Fc"], FC)


def test_torque_that_the_model_does_not_explain_is_said(log, plain):
    said = "stays that the declared model does not explain"
    u = log["u"] + 0.3 * FC * np.sin(5.0 * log["theta"])
    assert any(said in note for note in lg.balance(log_of(u, DT, log["theta"]), MODEL).notes)
    assert not any(said in note for note in plain.notes)
