"""A slow axis whose static friction is missing from the model."""

import pytest

from lugrectl import diagnose

from ..blind.plan import Task
from ..blind.work import case_of
from ..cases.common import model_of, record_of


@pytest.mark.slow
def test_only_the_stribeck_effect_is_missing_from_a_slow_axis_that_rests():
    """With a creep of 0.1 mm/s the fit needed 34 times the true stiction to hold the axis."""
    made = case_of(Task("effect", ("stribeck",), "weak", 99010))
    found = diagnose(record_of(made), model_of(made))
    assert found.verdict == "found"
    assert [e.name for e in found.effects] == ["stribeck"]
    assert found.effects[0].parameters["Fs"].value == pytest.approx(
        made.truth["parameters"]["Fs"], rel=0.01
    )
    assert found.error["augmented"] < 0.1 * found.error["refitted"]
