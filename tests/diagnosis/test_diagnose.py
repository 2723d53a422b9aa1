"""Sentences on errors that a comparison of models does not improve."""

import math

import pytest

from lugrectl.diagnosis.old_diagnose import free_worse
from lugrectl.identification.selection import Comparison

from ..cases.made_up import diagnosis


def free(declared, augmented):
    return {"signal": "w", "unit": "rad/s", "declared": declared, "augmented": augmented}


@pytest.mark.parametrize("verdict, final", [("found", "augmented"), ("adequate", "refitted")])
def test_a_free_run_that_gets_worse_is_said_with_both_errors(verdict, final):
    found = Comparison(verdict, effects=diagnosis().effects if verdict == "found" else ())
    (said,) = free_worse(free(0.5, 0.75), found)
    assert f"the {final} model misses w by 0.75 rad/s, the declared one by 0.5 rad/s" in said


@pytest.mark.parametrize(
    "pair", [(0.5, 0.4), (0.5, 0.5001), (None, 0.5), (0.5, None), (math.nan, 0.5)]
)
def test_a_free_run_that_is_not_worse_needs_no_sentence(pair):
    assert free_worse(free(*pair), Comparison("adequate")) == []
