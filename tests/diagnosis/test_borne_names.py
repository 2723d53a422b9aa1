"""A small torque is named only where the simulation of held-out samples gains from it."""

from dataclasses import replace

import pytest

from lugrectl.diagnosis.never_worse import borne
from lugrectl.identification.selection import Comparison, Named

BACKLASH, RIPPLE = Named("backlash", {}, 0.007), Named("torque_ripple", {}, 0.2)
FOUND = Comparison("found", effects=(BACKLASH,), least=0.015, stretches=100)


def error(declared, refitted, augmented):
    return {"declared": declared, "refitted": refitted, "augmented": augmented}


@pytest.mark.parametrize("errors", [(None, 1.0, 1.2), (0.5, 1.0, 0.6), (None, 1.0, 0.97)])
def test_a_small_effect_without_a_gain_is_not_named(errors):
    left = borne(FOUND, error(*errors))
    assert left.verdict == "adequate" and left.effects == ()
    assert "backlash would be a torque of 0.7 % of friction" in left.messages[-1]


def test_a_gain_or_a_large_torque_keeps_the_name():
    assert borne(FOUND, error(None, 1.0, 0.9)) is FOUND
    large = replace(FOUND, effects=(RIPPLE,))
    assert borne(large, error(None, 1.0, 1.5)) is large
    both = borne(replace(FOUND, effects=(RIPPLE, BACKLASH)), error(None, 1.0, 1.5))
    assert both.verdict == "found" and both.effects == (RIPPLE,)


def test_in_a_short_record_the_motion_has_to_say_the_same():
    short = replace(FOUND, effects=(RIPPLE,), stretches=12)
    assert borne(short, error(None, 1.0, 1.0)).verdict == "adequate"
    assert borne(short, error(None, 1.0, 0.5)) is short
