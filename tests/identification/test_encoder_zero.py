"""Runs whose theta starts anywhere: a run that is held out is placed, others are not yet."""

from dataclasses import replace

import numpy as np
import pytest

from lugrectl import diagnose
from lugrectl.blocks.model import model_from_dict
from lugrectl.identification.dataset.run_effects import alike, statements
from lugrectl.identification.likelihood.held_out_run import adapted
from lugrectl.identification.likelihood.predictor import Predictor
from tests.rig import make

from ..cases.common import begun, model_of, record_of

pytestmark = pytest.mark.slow
DRAWN = {"machine": "joint", "excitation": "moves", "seed": 7000, "rate": 500.0, "duration": 20.0}
SAMPLE = pytest.mark.sample


def cases(runs):
    differing = ("offset", "phase", "temperature")
    case = make("torque_ripple", runs=runs, nuisances=differing, load=False, **DRAWN)
    return case, [record_of(c) for c in (case, *case.more)]


@pytest.fixture(scope="module")
def rippling():
    case, records = cases(3)
    return case, begun(records[:-1], model_of(case), records[-1])


def with_ripple(case, job, data):
    """The fit of the declared model with the true ripple and plant, on these data."""
    own = {"name": "torque_ripple", **case.truth["parameters"]}
    model = model_from_dict({**case.model, "effects": [own]}, "here")
    known = {k: v for k, v in model.known().items() if "." in k}
    values = job.base.values | alike(data) | case.truth["plant"] | known
    return replace(job.base, predictor=Predictor(model, data), values=values)


def apart(zeros, case):
    """How far the runs are from agreeing, rad of the ripple's phase."""
    order = case.truth["parameters"]["harmonic"]
    first = case.truth["nuisance"]["zero"] if "nuisance" in case.truth else 0.0
    moved = [zeros[i + 1] + c.truth["nuisance"]["zero"] - first for i, c in enumerate(case.more)]
    return np.abs(np.angle(np.exp(1j * order * np.array(moved))))


@SAMPLE
def test_a_held_out_run_is_placed_by_its_lead_ins(rippling):
    case, job = rippling
    data = job.data.aligned({1: -case.more[0].truth["nuisance"]["zero"], 2: 0.0}, 1.0)
    found = adapted(with_ripple(case, job, data), job.parts.test, model_of(case))
    zeros = {1: data.zeros[1], 2: found.values["run3.phase"]}
    assert np.all(apart(zeros, case) < 0.05)
    nuisance = case.more[1].truth["nuisance"]
    assert found.values["run3.offset"] == pytest.approx(nuisance["offset"], abs=0.02)
    assert "theta shifted by" in statements(found.predictor.data, found.values, True)[1]
    assert "theta" not in statements(found.predictor.data, found.values, False)[1]


@SAMPLE
def test_of_runs_that_agree_a_held_out_one_may_not(rippling):
    case, job = rippling
    found = adapted(with_ripple(case, job, job.data), job.parts.test, model_of(case))
    assert found.values["run2.phase"] == 0.0 and found.values["run3.phase"] != 0.0
    assert len(statements(found.predictor.data, found.values, True)) == 2


@pytest.mark.parametrize("runs", [2, 4])
def test_a_ripple_of_another_phase_in_a_held_out_run_is_named(runs):
    case, records = cases(runs)
    result = diagnose(records[:-1], model_of(case), holdout=records[-1])
    assert (result.verdict, [e.name for e in result.effects]) == ("found", ["torque_ripple"])
    for name, true in case.truth["parameters"].items():
        assert result.effects[0].parameters[name].value == pytest.approx(true, rel=0.01)
    assert result.error["augmented"] < 0.7 * result.error["refitted"]
    assert any("theta shifted by" in message for message in result.messages)
