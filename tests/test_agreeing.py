"""Runs whose theta starts anywhere."""

from dataclasses import replace

import numpy as np
import pytest

from lugrectl import diagnose
from lugrectl.model import model_from_dict
from lugrectl.tracing.agreeing import agreeing
from lugrectl.tracing.held_out import adapted
from lugrectl.tracing.job import begin
from lugrectl.tracing.likelihood import whitened
from lugrectl.tracing.predictor import Predictor
from lugrectl.tracing.runs import alike, statements
from tests.rig import make

from .test_tracing import model_of, quiet, record_of

DRAWN = {"machine": "joint", "excitation": "moves", "seed": 7000, "rate": 500.0, "duration": 20.0}


def cases(effect, runs, nuisances=("offset", "phase", "temperature")):
    case = make(effect, runs=runs, nuisances=nuisances, load=False, **DRAWN)
    return case, [record_of(c) for c in (case, *case.more)]


def begun(case, records):
    return begin(records[:-1], model_of(case), records[-1], 1.0, quiet)


@pytest.fixture(scope="module")
def rippling():
    case, records = cases("torque_ripple", 3)
    return case, records, begun(case, records)


def with_ripple(case, job, data):
    own = {"name": "torque_ripple", **case.truth["parameters"]}
    model = model_from_dict({**case.model, "effects": [own]}, "here")
    known = {k: v for k, v in model.known().items() if "." in k}
    return model, job.base.values | alike(data) | case.truth["plant"] | known


def apart(zeros, case):
    """How far the runs are from agreeing, rad of the ripple's phase."""
    order = case.truth["parameters"]["harmonic"]
    zero = [case.truth["nuisance"]["zero"] if "nuisance" in case.truth else 0.0]
    moved = [zeros[i + 1] + c.truth["nuisance"]["zero"] - zero[0] for i, c in enumerate(case.more)]
    return np.abs(np.angle(np.exp(1j * order * np.array(moved))))


@pytest.mark.slow
@pytest.mark.sample
def test_runs_are_moved_until_a_ripple_agrees(rippling):
    case, _, job = rippling
    data = agreeing(job.base, job.parts.test)
    assert data is not None and data.order == 1.0
    assert np.all(apart(data.zeros, case) < 0.1)
    for run, zero in data.zeros.items():
        own = data.run == run
        np.testing.assert_allclose(data.y[own, 0] - job.data.y[own, 0], zero)
        np.testing.assert_allclose(data.log.theta[own] - job.data.log.theta[own], zero)


@pytest.mark.slow
def test_runs_that_agree_stay():
    case, records = cases("torque_ripple", 3, ("offset", "temperature"))
    job = begun(case, records)
    data = agreeing(job.base, job.parts.test)
    assert data is None or np.all(apart(data.zeros, case) < 0.05)


@pytest.mark.slow
def test_theta_is_what_a_declared_effect_says(rippling):
    case, records, _ = rippling
    gravity = {"name": "gravity", "amplitude": 0.5, "phase": 0.0}
    model = model_from_dict({**case.model, "effects": [gravity]}, "here")
    job = begin(records[:-1], model, records[-1], 1.0, quiet)
    assert agreeing(job.base, job.parts.test) is None


@pytest.mark.slow
@pytest.mark.sample
def test_a_phase_is_the_same_inside_and_outside_of_the_plant(rippling):
    case, _, job = rippling
    data = job.data.aligned({1: 0.2, 2: 0.1}, 1.0)
    model, values = with_ripple(case, job, data)
    values["run2.phase"] = 0.3
    inside, outside = (Predictor(model, data, inside=n) for n in (1, 0))
    a, b, as_recorded = (
        whitened(p, [v], job.base.where, job.base.noise)[0]
        for p, v in ((inside, values), (outside, values), (outside, values | {"run2.phase": 0.0}))
    )
    second = data.run[job.base.where.start] == 1
    np.testing.assert_allclose(as_recorded[~second], b[~second])
    change = float(np.std(b[second] - as_recorded[second]))
    assert change > 1.0
    assert np.std(a[second] - b[second]) < 0.02 * change
    assert {"run2.phase"} <= inside.declarations().keys()
    assert "run2.phase" not in Predictor(model_of(case), data).declarations()


@pytest.mark.slow
@pytest.mark.sample
def test_a_held_out_run_is_placed_by_its_lead_ins(rippling):
    case, _, job = rippling
    data = job.data.aligned({1: -case.more[0].truth["nuisance"]["zero"], 2: 0.0}, 1.0)
    model, values = with_ripple(case, job, data)
    fitted = replace(job.base, predictor=Predictor(model, data), values=values)
    found = adapted(fitted, job.parts.test, model_of(case))
    zeros = {1: data.zeros[1], 2: found.values["run3.phase"]}
    assert np.all(apart(zeros, case) < 0.05)
    nuisance = case.more[1].truth["nuisance"]
    assert found.values["run3.offset"] == pytest.approx(nuisance["offset"], abs=0.02)
    assert "theta shifted by" in statements(found.predictor.data, found.values, True)[1]
    assert "theta" not in statements(found.predictor.data, found.values, False)[1]


@pytest.mark.slow
@pytest.mark.sample
def test_of_runs_that_agree_a_held_out_one_may_not(rippling):
    case, _, job = rippling
    model, values = with_ripple(case, job, job.data)
    fitted = replace(job.base, predictor=Predictor(model, job.data), values=values)
    found = adapted(fitted, job.parts.test, model_of(case))
    assert found.values["run2.phase"] == 0.0 and found.values["run3.phase"] != 0.0
    assert len(statements(found.predictor.data, found.values, True)) == 2


@pytest.mark.slow
@pytest.mark.parametrize("runs", [2, 4])
def test_a_ripple_of_another_phase_in_each_run_is_named(runs):
    case, records = cases("torque_ripple", runs)
    result = diagnose(records[:-1], model_of(case), holdout=records[-1])
    assert (result.verdict, [e.name for e in result.effects]) == ("found", ["torque_ripple"])
    for name, true in case.truth["parameters"].items():
        assert result.effects[0].parameters[name].value == pytest.approx(true, rel=0.01)
    assert result.error["augmented"] < 0.7 * result.error["refitted"]
    assert any("theta shifted by" in message for message in result.messages)
