"""Several runs of one drive: what differs between them is told from what is missing."""

from dataclasses import replace

import numpy as np
import pytest

from lugrectl import diagnose, identify
from tests.rig import make

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
def test_offset_and_friction_of_a_run_are_found(runs):
    first, second, model = runs
    found = identify([first, second], model)
    (said,) = [m for m in found.messages if "between run 2 and run 1" in m]
    assert float(said.split("offset ")[1].split(" N m")[0]) == pytest.approx(
        0.011, abs=0.001
    )  # 0.4 % of Fc
    assert 2.0 < float(said.split("friction ")[1].split(" %")[0]) < 6.0
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


@pytest.mark.slow
@pytest.mark.sample
def test_a_run_that_is_held_out_may_differ_too(runs):
    """What is its own is said, and is no error of the model."""
    first, second, model = runs
    offset = replace(second, u=second.u - 0.05 * np.sign(second.w) * model.friction.values["Fc"])
    result = diagnose(first, model, holdout=offset)
    assert result.verdict == "adequate"
    (said,) = [m for m in result.messages if "between run 2 and run 1" in m]
    assert float(said.split("offset ")[1].split(" N m")[0]) == pytest.approx(
        0.011, abs=0.001
    )  # 0.4 % of Fc
    assert result.error["refitted"] < 0.2 * result.error["declared"]
