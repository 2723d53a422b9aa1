"""A speed that was logged alone and is off by a constant: an offset of a sensor is no torque."""

import numpy as np
import pytest

import lugrectl as lg
from lugrectl.diagnosis.plain_answer import plain_answer
from lugrectl.diagnosis.question import Asked
from lugrectl.diagnosis.study import prepared
from lugrectl.identification.selection import compare

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
    plain = Asked.of(logged(offset), MODEL).plain
    assert plain.speed_offset == pytest.approx(offset, abs=0.05)
    assert compare(plain.stretches, MODEL, plain).verdict == "adequate"


def test_the_fit_has_the_speed_without_its_offset_and_says_so():
    asked = Asked.of(logged(0.5), MODEL)
    ready = prepared(asked.records(), MODEL, None, 1.0)
    lowered = ready.lowered(asked.plain)
    (said,) = set(lowered.doubts) - set(ready.doubts)
    assert said.startswith("w is 0.") and "rad/s too high" in said
    np.testing.assert_allclose(lowered.data.y[:, 1], ready.data.y[:, 1] - 0.5, atol=0.05)
    np.testing.assert_allclose(lowered.data.log.w, ready.data.log.w - 0.5, atol=0.06)
    right = Asked.of(logged(0.0), MODEL)
    same = prepared(right.records(), MODEL, None, 1.0)
    assert same.lowered(right.plain) is same


def test_a_speed_beside_an_angle_is_left_to_their_comparison():
    log = columns("w", seconds=12.0)
    log["w"] = log["w"] + 0.3
    plain = plain_answer(list(Asked.of(log, MODEL).logs), MODEL)
    assert plain.speed_offset == pytest.approx(0.3, abs=0.02)
    assert compare(plain.stretches, MODEL, plain).verdict == "adequate"
