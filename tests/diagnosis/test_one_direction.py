"""A log in one direction: friction there is a sum, and the answer says so everywhere."""

import numpy as np
import pytest

from lugrectl import Model, balance, diagnose, identify
from lugrectl.report import text

from ..cases.balance_drive import FC, simulate

DT, LOAD = 2e-3, 0.05
SUM = "Fc + constant_torque"


def log(seconds=8.0):
    """A drive that never turns back, with a constant load beside its friction."""
    t = np.arange(0.0, seconds, DT)
    u = 0.35 + 0.08 * np.sin(2.0 * np.pi * 0.6 * t) + 0.04 * np.sin(2.0 * np.pi * 1.7 * t)
    theta, _ = simulate(u, DT, w0=20.0, load=lambda theta, w: LOAD)
    noise = np.random.default_rng(0).normal(0.0, 1e-4, len(t))
    return {"t": t, "u": u, "theta": theta + noise}


def declared(**values):
    return Model.of(J=0.004, Fv=0.006, **values)


@pytest.fixture(scope="module")
def identified():
    return identify(log(5.0), declared(Fc=FC))


@pytest.mark.slow
def test_a_sum_is_not_printed_as_if_it_were_the_value(identified):
    Fc = identified.estimates["Fc"]
    assert Fc.ci95 is None and Fc.together == SUM and Fc.value == pytest.approx(FC + LOAD, rel=0.02)
    assert f"only {SUM}" in text(identified)
    assert identified.estimates["J"].ci95 is not None


def test_the_notes_name_the_other_direction_and_move_no_declared_value(identified):
    notes = " ".join(identified.messages)
    assert "moves in one direction" in notes
    moved = [m for m in identified.messages if "beyond their 95 % intervals" in m]
    assert not any("Fc is" in m for m in moved)


def test_json_says_what_the_value_stands_for(identified):
    assert identified.summary()["parameters"]["Fc"]["together"] == SUM


@pytest.mark.cases
@pytest.mark.parametrize("model", [declared(), declared(Fc=FC)], ids=["open", "declared"])
def test_the_other_direction_is_what_to_record_next(model):
    found = diagnose(log(4.0), model)
    assert "Record the other direction, too" in found.experiment


@pytest.mark.slow
def test_runs_that_turn_back_are_not_sums():
    t = np.arange(0.0, 4.0, DT)
    u = 0.5 * np.sin(2.0 * np.pi * 0.8 * t)
    theta, _ = simulate(u, DT, load=lambda theta, w: LOAD)
    run = {"t": t, "u": u, "theta": theta}
    found = balance([run, run], declared())
    assert "Fc" in found.parameters and not found.combinations


@pytest.mark.slow
def test_runs_in_one_direction_each_show_both_together():
    forward = log(4.0)
    u = -forward["u"]
    theta, _ = simulate(u, DT, w0=-20.0, load=lambda theta, w: LOAD)
    backward = forward | {"u": u, "theta": theta}
    plain = balance([forward, backward], declared())
    assert plain.parameters["Fc"].value == pytest.approx(FC, rel=0.02)
    fitted = identify([forward, backward], declared()).estimates
    assert fitted["Fc"].may_be(FC)
