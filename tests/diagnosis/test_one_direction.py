"""A log in one direction: friction there is a sum, and the answer says so everywhere."""

from dataclasses import replace

import numpy as np
import pytest

from lugrectl import Model, identify
from lugrectl.diagnosis.one_direction import next_way, not_alone, one_way
from lugrectl.diagnosis.question import Asked
from lugrectl.estimates.findings import Estimate
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
    return identify(log(), declared(Fc=FC))


def test_a_sum_is_not_printed_as_if_it_were_the_value(identified):
    Fc = identified.estimates["Fc"]
    assert Fc.ci95 is None and Fc.together == SUM and Fc.value == pytest.approx(FC + LOAD, rel=0.02)
    assert f"only {SUM}" in text(identified)
    assert identified.estimates["J"].ci95 is not None


def test_the_notes_name_the_other_direction_and_move_no_declared_value(identified):
    notes = " ".join(identified.messages)
    assert "one direction only" in notes and "Record the other direction, too." in notes
    assert f"With Fc as declared, {FC} N m, the constant torque is 0.05 N m." in notes
    moved = [m for m in identified.messages if "beyond their 95 % intervals" in m]
    assert not any("Fc is" in m for m in moved)


def test_json_says_what_the_value_stands_for(identified):
    assert identified.summary()["parameters"]["Fc"]["together"] == SUM


@pytest.mark.parametrize("model", [declared(), declared(Fc=FC)], ids=["open", "declared"])
def test_the_other_direction_is_what_to_record_next(model):
    plain = Asked.of(log(4.0), model).plain
    said = next_way(plain, "First so.")
    assert said == f"First so. Record the other direction, too: it separates the parts of {SUM}."


def test_held_values_and_both_directions_are_as_they_were():
    found = {"Fc": Estimate(0.2, "N m", (0.1, 0.3))}
    plain = Asked.of(log(4.0), declared().fix("J")).plain
    held = {"Fc": replace(found["Fc"], held=True)}
    assert not_alone(held, plain) == held
    nothing = replace(plain, together={})
    assert not_alone(found, nothing) == found and next_way(nothing, None) is None
    assert one_way(found, nothing, declared()) == []


def test_runs_in_one_direction_each_say_what_the_fit_and_the_plain_balance_know():
    """The fit leaves the offset of each run free, so that a constant torque counts as Fc."""
    forward = log(4.0)
    u = -forward["u"]
    theta, _ = simulate(u, DT, w0=-20.0, load=lambda theta, w: LOAD)
    backward = forward | {"u": u, "theta": theta}
    plain = Asked.of([forward, backward], declared()).plain
    assert plain.parameters["Fc"].value == pytest.approx(FC, rel=0.02)
    fitted = not_alone({"Fc": Estimate(FC + LOAD, "N m", (0.1, 0.2))}, plain)
    assert fitted["Fc"].together == SUM and fitted["Fc"].ci95 is None
    (said,) = one_way(fitted, plain, declared())
    assert "Each run moves in one direction only" in said and "constant_torque = 0.05 N m" in said
    assert next_way(plain, None) is None
    turned = Asked.of([backward, forward], declared()).plain
    assert turned.together["Fc"].text == "Fc - constant_torque"


def test_runs_that_turn_back_are_not_sums():
    t = np.arange(0.0, 4.0, DT)
    u = 0.5 * np.sin(2.0 * np.pi * 0.8 * t)
    theta, _ = simulate(u, DT, load=lambda theta, w: LOAD)
    run = {"t": t, "u": u, "theta": theta}
    assert Asked.of([run, run], declared()).plain.together == {}
