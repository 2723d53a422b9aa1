"""Runs whose theta starts anywhere: a ripple has another phase in each."""

import pytest

from lugrectl import diagnose
from tests.drives import make

from ..cases.common import model_of, record_of

pytestmark = pytest.mark.slow
DRAWN = {"machine": "joint", "excitation": "moves", "seed": 7000, "rate": 500.0, "duration": 20.0}


def cases(runs):
    differing = ("offset", "phase", "temperature")
    case = make("torque_ripple", runs=runs, nuisances=differing, load=False, **DRAWN)
    return case, [record_of(c) for c in (case, *case.more)]


def test_a_ripple_of_another_phase_in_a_held_out_run_is_named():
    case, records = cases(2)
    result = diagnose(records[:-1], model_of(case), holdout=records[-1])
    assert (result.verdict, [e.name for e in result.effects]) == ("found", ["torque_ripple"])
    for name, true in case.truth["parameters"].items():
        assert result.effects[0].parameters[name].value == pytest.approx(true, rel=0.01)
