"""A log in one direction: friction there is a sum, and the answer says so everywhere."""

import numpy as np
import pytest

from lugrectl import Model, balance, diagnose, identify
from lugrectl.report import text
from lugrectl.report.wording import toml_of

from ..cases.balance_drive import FC, simulate
from ..drives import sample
from ..scores.rig import STRENGTHS, write

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


def test_runs_that_turn_back_are_not_sums():
    t = np.arange(0.0, 4.0, DT)
    u = 0.5 * np.sin(2.0 * np.pi * 0.8 * t)
    theta, _ = simulate(u, DT, load=lambda theta, w: LOAD)
    run = {"t": t, "u": u, "theta": theta}
    found = balance([run, run], declared())
    assert "Fc" in found.parameters and not found.combinations


@pytest.fixture(scope="module")
def spindle():
    """A drive with a drag that the declared model has not, faster and slower, never back."""
    J, Fc, Fv, drag, t = 0.012, 0.25, 0.03, 0.0012, np.arange(0.0, 12.0, DT)
    want = 13.5 + 10.0 * np.sin(0.7 * t + 1.0) * np.cos(0.23 * t) + np.sin(11.0 * t)
    rate = np.gradient(want, DT)
    u = J * rate + Fc + Fv * want + drag * want**2
    w, theta, seen = want[0], 0.0, []
    for torque in u:
        seen.append(theta)
        for _ in range(8):
            w += DT / 8 * (torque - Fc - Fv * w - drag * w * w) / J
            theta += DT / 8 * w
    step = 2 * np.pi / 65536
    log = {"t": t, "u": u, "theta": np.round(np.array(seen) / step) * step}
    return diagnose(log, Model.of(J=J)), (Fc, Fv, drag)


def test_a_sum_holds_in_the_model_that_is_shown(spindle):
    """The plain balance has no drag: its sum of Fc and Fv is that of another model."""
    found, (Fc, Fv, drag) = spindle
    assert [e.name for e in found.effects] == ["quadratic_drag"]
    assert found.model.known()["quadratic_drag.coefficient"] == pytest.approx(drag, rel=0.02)
    known = found.estimates
    assert known["Fc"].together == SUM and known["Fc"].value == pytest.approx(Fc, rel=0.03)
    assert known["Fv"].ci95 is not None and known["Fv"].value == pytest.approx(Fv, rel=0.03)
    assert "Record the other direction, too" in found.experiment
    assert "Only together" not in text(found)


def test_what_never_shows_is_marked_in_the_model_file(spindle):
    """A drive that never rests shows Fs by the fall of friction with speed alone."""
    found, _ = spindle
    lines = {line.split(" =")[0]: line for line in toml_of(found, None).splitlines()}
    assert lines["Fc"].endswith(f"only {SUM}") and "std" in lines["Fv"]
    assert lines["Fs"].endswith("not determined") and lines["vs"].endswith("not determined")


def test_runs_in_one_direction_each_show_both_together():
    forward = log(4.0)
    u = -forward["u"]
    theta, _ = simulate(u, DT, w0=-20.0, load=lambda theta, w: LOAD)
    backward = forward | {"u": u, "theta": theta}
    plain = balance([forward, backward], declared())
    assert plain.parameters["Fc"].value == pytest.approx(FC, rel=0.02)
    fitted = identify([forward, backward], declared()).estimates
    assert fitted["Fc"].may_be(FC)


@pytest.mark.cases
@pytest.mark.parametrize("effect", ["viscous_asymmetry", "none"])
def test_halves_of_a_short_record_show_both_directions(effect, tmp_path):
    """These moves of 10 s have blocks of 2 s of which every other one goes one way."""
    seed, hard = (233000, False) if effect == "viscous_asymmetry" else (233008, True)
    (path,), model = write(sample(effect, seed, hard=hard, strength=STRENGTHS["weak"]), tmp_path)
    found = diagnose(path, model)
    assert [one.name for one in found.effects] == [effect] * (effect != "none")
    assert found.verdict == ("adequate" if effect == "none" else "found")
