"""What the comparison names is withdrawn where it does not help the fit of predictions."""

import pytest

from lugrectl import diagnose
from lugrectl.diagnosis.question import Asked
from lugrectl.identification.selection import compare
from tests.rig import sample

from ..cases.common import model_of, record_of


def compared(record, model):
    asked = Asked.of(record, model)
    return compare(asked.plain.stretches, asked.model, asked.plain)


def test_an_effect_that_does_not_help_the_fit_is_not_missing():
    """A drive that stops and starts: bristles look like a limit of the torque in the table."""
    case = sample("none", 182007)
    record, model = record_of(case), model_of(case)
    assert compared(record, model).verdict == "found"
    found = diagnose(record, model)
    assert found.verdict == "adequate" and not found.effects
    assert found.error["augmented"] < 1.5 * found.error["noise_floor"]
    assert any("predicts as well without it" in message for message in found.messages)


def test_an_effect_that_helps_stays():
    case = sample(["quadratic_drag"], 182005)
    found = diagnose(record_of(case), model_of(case))
    assert (found.verdict, [e.name for e in found.effects]) == ("found", ["quadratic_drag"])
    assert not any("predicts as well without it" in message for message in found.messages)


@pytest.mark.parametrize("names", [["quadratic_drag"], ["viscous_asymmetry"]])
def test_a_comparison_holds_the_same_without_the_effect_named_last(names):
    seed = {"quadratic_drag": 182005, "viscous_asymmetry": 182004}[names[0]]
    case = sample(names, seed)
    found = compared(record_of(case), model_of(case))
    assert [e.name for e in found.effects] == names
    fewer = found.without
    assert fewer is not None and fewer.verdict == "adequate" and fewer.without is None
    assert not fewer.effects and fewer.rows == found.rows
    assert not {s.term for s in fewer.budget} & {*names}
