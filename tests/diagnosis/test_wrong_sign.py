"""A torque of the wrong sign: what was done with it is said exactly, with the option to use."""

import numpy as np
import pytest

from lugrectl import Model, diagnose, identify
from lugrectl.core.errors import Refused
from lugrectl.report import text

from ..cases.balance_drive import FC, simulate, torque

DT = 2e-3
DECLARED = Model.of(J=0.004, Fc=FC, Fv=0.006)


@pytest.fixture(scope="module")
def turned():
    u = torque(8.0, DT, seed=3)
    theta, _ = simulate(u, DT)
    noise = np.random.default_rng(0).normal(0.0, 1e-4, len(u))
    return {"t": DT * np.arange(len(u)), "u": -u, "theta": theta + noise}


def test_a_refusal_names_the_option_and_claims_no_change(turned):
    no = diagnose(turned, DECLARED)
    assert no.verdict == "refused" and 'wrong sign: give scale="u=-1"' in no.reason
    assert "was changed" not in " ".join(no.messages)
    assert "other sign" in text(no)  # whose values the plain answer has


def test_a_fit_is_refused_too_and_the_plain_answer_is_that_of_the_other_sign(turned):
    with pytest.raises(Refused, match="wrong sign") as no:
        identify(turned, DECLARED)
    assert 'scale="u=-1"' in str(no.value)
    assert no.value.plain.parameters["J"].value == pytest.approx(0.004, rel=0.01)


def test_the_option_repairs_it(turned):
    assert not identify(turned | {"u": -turned["u"]}, DECLARED).plain.refused
