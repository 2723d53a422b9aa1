"""A held, bounded or declared value that the log contradicts is named, with both values."""

import pytest

from lugrectl import Model, Refused, balance, diagnose, identify
from lugrectl.blocks.model import model_from_dict

from ..cases.balance_drive import FC, FV, J, noisy


@pytest.fixture(scope="module")
def log():
    return noisy()


def model(J=J, Fc=FC, Fv=FV, **effect):
    friction = {"model": "coulomb", "Fc": Fc, "Fv": Fv}
    effects = [{"name": "gravity", "phase": 0.0, **effect}] if effect else []
    return model_from_dict({"plant": {"J": J}, "friction": friction, "effects": effects}, "m")


def held(value):
    return {"value": value, "fixed": True}


@pytest.mark.cases
@pytest.mark.parametrize(
    ("declared", "said"),
    [
        (model(J=held(1e4 * J)), "J is held at 40 kg m2, but this log says 0.00"),
        (model(Fc=held(100.0 * FC)), "Fc is held at 12 N m, but this log says 0.1"),
        (model(Fv=held(1e4 * FV)), "Fv is held at 60 N m s/rad, but this log says 0.00"),
        (model(J={"min": 1.0}), "J is at least 1 kg m2, but this log says 0.00"),
        (model(amplitude=held(50.0)), "gravity.amplitude is held at 50 N m, but this log says 0.0"),
    ],
    ids=["J", "Fc", "Fv", "bound", "gravity"],
)
def test_a_value_with_which_nothing_can_be_answered_is_named(log, declared, said):
    no = diagnose(log, declared)
    assert no.verdict == "refused" and said in no.reason and "let it be fitted" in no.reason
    assert no.plain.parameters["J"].value == pytest.approx(J, rel=0.02)
    assert len(no.reason.split("but this log says")) == 2


def test_identify_refuses_it_with_the_plain_answer(log):
    with pytest.raises(Refused, match="J is held at 40 kg m2") as no:
        identify(log, model(J=held(1e4 * J)))
    assert "J" in no.value.plain.parameters


def test_a_held_value_that_leaves_some_of_the_torque_is_only_said(log):
    plain = balance(log, model(J=held(0.5 * J)))
    assert len(plain.against) == 1 and plain.against[0].startswith("J is held at 0.002 kg m2")
    assert not plain.hopeless


@pytest.mark.parametrize("declared", [model(), model(J=held(1.03 * J)), model(J={"min": 0.001})])
def test_values_near_those_of_the_log_are_not(log, declared):
    assert balance(log, declared).against == ()


@pytest.mark.slow
def test_a_declared_inertia_far_too_large_is_said_with_the_value_of_the_log(log):
    found = diagnose(log, Model.of(J=1e4 * J))
    assert found.model.J == pytest.approx(J, rel=0.02)
    assert "declared 40 kg m2" in " ".join(found.messages)
