"""Several runs of one drive: what differs between them is told from what is missing."""

from dataclasses import replace

import numpy as np
import pytest

from lugrectl import diagnose, identify
from tests.drives import make

from ..cases.common import model_of, record_of


@pytest.fixture(scope="module")
def runs():
    """Two runs of a drive; the second with an offset on its torque and more friction."""
    made = make("none", machine="servo", excitation="rich", seed=4104, rate=500.0, duration=14.0)
    first = record_of(made)
    again = make("none", machine="servo", excitation="moves", seed=4104, rate=500.0, duration=14.0)
    second = record_of(again)
    friction = 0.05 * np.sign(second.w) * made.truth["plant"]["Fc"]
    return first, replace(second, u=second.u + friction + 0.011), model_of(made)


@pytest.mark.slow
@pytest.mark.sample
def test_offset_and_friction_of_a_run_leave_the_values_of_the_drive(runs):
    first, second, model = runs
    found = identify([first, second], model)
    alone = identify(first, model)
    for k in ("J", "Fc", "Fv"):
        assert found.estimates[k].value == pytest.approx(alone.estimates[k].value, rel=0.03)
    assert not any("run 2" in m for m in alone.messages)
    assert set(found.estimates) == set(alone.estimates)
    assert found.declared is model and found.provenance.command == "lugrectl.identify"


@pytest.mark.slow
def test_they_are_not_called_a_missing_effect(runs):
    first, second, model = runs
    offset = replace(second, u=second.u - 0.05 * np.sign(second.w) * model.friction.values["Fc"])
    assert diagnose([first, offset], model).verdict == "adequate"
