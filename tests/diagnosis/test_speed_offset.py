"""A speed that was logged alone and is off by a constant: an offset of a sensor is no torque."""

import numpy as np
import pytest

import lugrectl as lg

from ..cases.faulty_logs import columns

MODEL = lg.Model.of(friction="coulomb")


def logged(offset, seed=3):
    log = columns("w", seconds=12.0)
    del log["theta"]
    noise = np.random.default_rng(seed).normal(0.0, 0.02, len(log["w"]))
    return log | {"w": log["w"] + noise + offset}


@pytest.mark.cases
@pytest.mark.parametrize("offset", [0.5, -0.2])
def test_nothing_is_missing_beside_a_speed_with_an_offset(offset):
    found = lg.diagnose(logged(offset), MODEL)
    assert found.plain.parameters["w_offset"].value == pytest.approx(offset, abs=0.05)
    assert found.verdict == "adequate"


def test_a_speed_beside_an_angle_is_left_to_their_comparison():
    log = columns("w", seconds=12.0)
    log["w"] = log["w"] + 0.3
    found = lg.diagnose(log, MODEL)
    assert found.plain.parameters["w_offset"].value == pytest.approx(0.3, abs=0.02)
    assert found.verdict == "adequate"
