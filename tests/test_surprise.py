"""What only the held-out samples show, and what the windows do not agree on."""

from dataclasses import replace

import numpy as np
import pytest

from lugrectl import diagnose
from lugrectl.tracing.choice import FIRM
from lugrectl.tracing.coordinates import free_keys
from lugrectl.tracing.fit import fit
from lugrectl.tracing.job import begin
from lugrectl.tracing.once import firm_by_itself, from_one_window
from lugrectl.tracing.predictor import Predictor
from lugrectl.tracing.proof import firmness
from lugrectl.tracing.score import Score
from lugrectl.tracing.screening import lightened, screen
from lugrectl.tracing.split import split
from lugrectl.tracing.surprise import misled, openings, predicted, surprising, undated, when
from tests.blind.plan import Task
from tests.blind.work import case_of
from tests.rig import make, sample

from .test_tracing import model_of, quiet, record_of


@pytest.fixture(scope="module")
def plain():
    return make("none", machine="servo", excitation="rich", seed=4101, rate=500.0, duration=20.0)


@pytest.fixture(scope="module")
def job(plain):
    return begin(record_of(plain), model_of(plain), None, 1.0, quiet)


def pushed(record, span, torque):
    """A record whose torque was not all recorded for a while."""
    within = (record.t > span[0]) & (record.t < span[1])
    return replace(record, u=record.u - torque * within)


def test_fitted_and_held_out_blocks_can_be_exchanged(job):
    turned = split(job.data, 1.0, turned=True)
    assert set(turned.train.counted.ravel()) == set(job.parts.test.counted.ravel())
    assert set(turned.test.counted.ravel()) == set(job.parts.train.counted.ravel())


def test_a_torque_seen_only_in_held_out_samples_is_noticed(plain, job):
    assert not len(surprising(job.base, job.parts.test))
    span = (7.0, 8.5)  # blocks of 2.25 s, the second and every other held out
    held = job.data.t[job.parts.test.counted]
    assert np.any((held > span[0]) & (held < span[1]))
    there = begin(pushed(record_of(plain), span, 0.1), model_of(plain), None, 1.0, quiet)
    new = surprising(there.base, there.parts.test)
    found = there.data.t[there.parts.test.counted[new]]
    assert len(new) and np.all((found.max(axis=1) > span[0]) & (found.min(axis=1) < span[1]))
    assert " s" in when(there.base, there.parts.test, new)


@pytest.mark.slow
def test_it_is_not_called_adequate(plain):
    result = diagnose(pushed(record_of(plain), (7.0, 8.5), 0.1), model_of(plain))
    assert result.verdict == "unexplained" and result.depends_on
    assert any("exchanged" in m for m in result.messages)


def test_an_effect_that_is_not_there_is_not_firm(plain, job):
    def strength(name, torque):
        model = job.base.predictor.model.with_effect(name, {"torque": 1e-4})
        data = job.data.with_torque(job.data.u + torque)
        predictor = Predictor(model, data)
        values = job.base.values | {f"{name}.torque": 1e-4}
        found = fit(predictor, values, free_keys(predictor), job.base.where, job.base.noise)
        return firmness(found, name)

    assert strength("constant_torque", 0.0) < 2.0
    assert strength("constant_torque", 0.01) > 10.0


def test_where_the_moment_of_a_change_is_open_nothing_is_a_surprise(job):
    held = job.parts.test
    t = job.data.t[held.counted]
    late = (job.data.t > t[1].mean()) & (job.data.t <= t[1, -1])
    there = replace(job.base, predictor=job.base.predictor.on(
        job.data.with_torque(job.data.u - 0.1 * late)))  # fmt: skip
    assert 1 in surprising(there, held) and not undated(there, held)
    moment = {"friction_step.time": (t[1, 0] - 0.1, t[1, -1] + 0.1)}
    known = replace(there, instants=moment)
    assert 1 not in surprising(known, held) and undated(known, held)


def test_what_the_record_cannot_tell_apart_has_no_interval(job):
    own = {"stiffness": 0.01, "rest": 0.1}
    model = job.base.predictor.model.with_effect("constant_torque", {"torque": 0.01})
    predictor = Predictor(model.with_effect("return_spring", own), job.data)
    values = job.base.values | {"constant_torque.torque": 0.01}
    values |= {f"return_spring.{k}": v for k, v in own.items()}
    found = fit(predictor, values, free_keys(predictor), job.base.where, job.base.noise, most=2)
    pair = {"constant_torque.torque", "return_spring.rest"}
    assert [set(keys) for keys in found.flat()] == [pair]
    assert pair.isdisjoint(found.intervals()) and "J" in found.intervals()
    assert job.base.flat() == []


def test_the_time_of_a_change_is_sought_beside_what_the_plant_makes_up_for():
    """A refit hides half a step of friction in the level: what is left looks like another time."""
    case = case_of(Task("effect", ("friction_step",), "weak", 114000))
    base = begin(record_of(case), model_of(case), None, 1.0, quiet).base
    (trial,) = screen(Score(lightened(base)), ["friction_step"])
    truth = case.truth["parameters"]
    assert trial.values["friction_step.time"] == pytest.approx(truth["time"], abs=1.0)
    assert trial.values["friction_step.ratio"] == pytest.approx(truth["ratio"], rel=0.3)


def test_effects_that_held_out_samples_contradict_are_dropped(job):
    base, before = job.base, job.data.t[job.parts.train.counted.max()] / 3.0
    model = base.predictor.model.with_effect("inertia_step", {"ratio": -0.3, "time": before})
    predictor = Predictor(model, job.data)
    values = base.values | {"inertia_step.ratio": -0.3, "inertia_step.time": before}
    wrong = replace(base, predictor=predictor, values=values | {"J": 1.4 * base.values["J"]})
    right = replace(wrong, values=values | {"inertia_step.ratio": 0.0})
    little, least = (
        replace(wrong, values=values | {"inertia_step.ratio": r}) for r in (-1.6e-3, -3e-4)
    )
    assert misled(base, wrong, job.parts.test)
    assert not misled(base, little, job.parts.test)
    assert misled(base, little, job.parts.test, sure=False)  # a part of something at best
    assert not misled(base, least, job.parts.test, sure=False)
    assert not misled(little, base, job.parts.test, sure=False)
    assert not misled(base, right, job.parts.test)
    assert not misled(wrong, base, job.parts.test)


@pytest.mark.slow
@pytest.mark.sample
def test_dropping_them_is_said_and_leaves_what_they_explained(monkeypatch):
    case = make("torque_ripple", machine="servo", seed=4102, rate=500.0, duration=20.0)
    monkeypatch.setattr(
        "lugrectl.diagnosis.diagnose.misled", lambda before, after, test, sure: True
    )
    dropped = diagnose(record_of(case), model_of(case))
    assert dropped.verdict == "unexplained" and not dropped.effects
    assert dropped.depends_on[0] == "theta"
    assert any("torque_ripple" in m and "removed" in m for m in dropped.messages)


@pytest.mark.slow
@pytest.mark.sample
def test_what_happens_before_the_first_window_is_said():
    """A stop that the drive leaves within the first 0.14 s."""
    case = sample("hard_stop", 119200)
    fitted = begin(record_of(case), model_of(case), None, 1.0, quiet).base
    (said,) = openings(fitted)
    assert said.startswith("Between 0 and 0.25 s") and "N m is unexplained" in said
    sound = sample("none", 126510)
    assert openings(begin(record_of(sound), model_of(sound), None, 1.0, quiet).base) == ()


MET = -29.2  # rad, reached once in the fitted blocks and once in the others


def _with_a_stop(plain, torque):
    """The job of a record that lacks a torque by theta, and its fit with a stop."""
    record = record_of(plain)
    pushed = replace(record, u=record.u - torque(MET - record.theta))
    there = begin(pushed, model_of(plain), None, 1.0, quiet)
    base, own = there.base, {"position": MET + 0.02, "stiffness": 0.8, "side": -1.0}
    predictor = Predictor(base.predictor.model.with_effect("hard_stop", own), base.predictor.data)
    values = base.values | {f"hard_stop.{k}": v for k, v in own.items()}
    return there, fit(predictor, values, free_keys(predictor), base.where, base.noise)


def test_what_one_window_tells_is_confirmed_by_a_held_out_one(plain, job):
    log = job.data.log
    beyond = (log.theta[w.counted].min(axis=1) < MET for w in (job.parts.train, job.parts.test))
    assert [int(np.sum(b)) for b in beyond] == [1, 1]
    there, found = _with_a_stop(plain, lambda depth: np.maximum(depth, 0.0))
    base, test = there.base, there.parts.test
    assert found.values["hard_stop.stiffness"] == pytest.approx(1.0, rel=0.05)
    assert from_one_window(found, "hard_stop") and predicted(found, base, test)
    elsewhere = replace(found, values=found.values | {"hard_stop.position": MET - 1.0})
    assert not predicted(elsewhere, base, test)


@pytest.mark.slow
@pytest.mark.sample
def test_what_one_window_tells_stands_if_it_foresees_each_sample(plain):
    """A spring does as a stop; a step where the stop would be, and a bump, do not."""
    there, found = _with_a_stop(plain, lambda depth: np.maximum(depth, 0.0))
    assert firm_by_itself(there.base, found, "hard_stop") > FIRM
    for other in (lambda depth: 0.1 * (depth > 0.0), lambda depth: 0.1 * np.exp(-400 * depth**2)):
        there, found = _with_a_stop(plain, other)
        assert firm_by_itself(there.base, found, "hard_stop") == 0.0
