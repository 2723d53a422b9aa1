"""A mode that cancels from T(s) is still in the system: the checks say so where it is unstable."""

from __future__ import annotations

import re

import control as ct
import pytest

import lugrectl as lg

S = ct.tf("s")
HIDDEN = {
    "real": ((S - 1) / ((S - 1) * (S + 1)), r"\(s = \+1 1/s\)"),
    "not controllable": (
        ct.ss([[-1, 0], [0, 1]], [[1], [0]], [[1, 1]], 0),
        r"\(s = \+1 1/s\)",
    ),
    "integrator": (S / (S * (S + 1)), r"\(s = [+-]0 1/s\)"),
    "pair": ((S**2 + 4) * (S + 2) / ((S**2 + 4) * (S + 1)), r"\+- 2j 1/s\)"),
}
CHECKS = {"spr": lg.spr_check, "l2": lg.l2_check, "bandwidth": lg.bandwidth_check}


@pytest.mark.parametrize("check", CHECKS.values(), ids=CHECKS)
@pytest.mark.parametrize("T, mode", HIDDEN.values(), ids=HIDDEN)
def test_an_unstable_mode_that_cancels_is_named(T, mode, check):
    said = check(T).reason
    assert "was cancelled from T(s): the system itself is not stable" in said

    assert re.search(mode, said)


@pytest.mark.parametrize("check", CHECKS.values(), ids=CHECKS)
def test_a_stable_mode_that_cancels_is_not_mentioned(check):
    assert "cancelled" not in check((S + 3) / ((S + 3) * (S + 1))).reason
