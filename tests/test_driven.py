"""A load that the measured motion drives: found in the balance, not feigned by other effects."""

from dataclasses import replace

import numpy as np
import pytest

from lugrectl.spec import members
from lugrectl.tracing.driven import Driven, convincing, driven
from lugrectl.tracing.fit import Fitted
from lugrectl.tracing.job import begin
from lugrectl.tracing.predictor import Predictor
from lugrectl.tracing.screening import Trial
from lugrectl.tracing.search import carries, loaded
from tests.rig import make

from .test_tracing import model_of, quiet, record_of

OTHERS = ("none", "torque_ripple", "contact_pulses")
DRIVE = {"machine": "joint", "excitation": "multisine", "rate": 500.0, "duration": 20.0}


def base_of(case):
    return begin(record_of(case), model_of(case), None, 1.0, quiet).base


def loose(base: Fitted) -> Fitted:
    """The model with a load of which nothing is known."""
    model = base.predictor.model.with_effect("backlash", {})
    own = {f"backlash.{k}": p.value for k, p in members("effect")["backlash"].own.items()}
    return replace(base, predictor=Predictor(model, base.predictor.data), values=base.values | own)


@pytest.mark.parametrize(
    "seed", [4201, *(pytest.param(s, marks=pytest.mark.slow) for s in (4202, 4203))]
)
@pytest.mark.sample
@pytest.mark.slow
def test_the_load_behind_a_gap_from_nothing(seed):
    case = make("backlash", seed=seed, **DRIVE)
    loads = driven(loose(base_of(case)), "backlash")
    assert convincing(loads)
    best, truth = max(loads, key=lambda one: one.share).values, case.truth["parameters"]
    assert best["J"] == pytest.approx(case.truth["plant"]["J"], rel=0.1)
    assert best["backlash.load_inertia"] == pytest.approx(truth["load_inertia"], rel=0.15)
    assert best["backlash.gap"] == pytest.approx(truth["gap"], rel=0.1)


@pytest.mark.parametrize(
    "name",
    [pytest.param("elastic_coupling", marks=pytest.mark.sample), *OTHERS],
)
@pytest.mark.slow
def test_no_load_where_there_is_none(name):
    base = base_of(make(name, seed=4204, **DRIVE))
    assert not convincing(driven(loose(base), "backlash"))
    assert loaded(base, "backlash") is None


def test_what_convinces():
    takes = Driven({}, 0.95, 0.1)
    assert not convincing([]) and not convincing([takes])
    assert convincing([takes, Driven({}, 0.5, 0.6)])
    assert not convincing([Driven({}, 0.8, 0.8)])


def test_a_motion_that_never_slides_tells_nothing():
    base = base_of(make("none", seed=4205, **DRIVE))
    data = base.predictor.data
    still = replace(data, log=replace(data.log, w=np.zeros_like(data.log.w)))
    found = loose(base)
    assert driven(replace(found, predictor=found.predictor.on(still)), "backlash") == []


def test_what_is_added_to_a_scaled_level_is_tried_inside_the_plant():
    base = base_of(make("none", seed=4206, **DRIVE))

    def trial(*found):
        model = base.predictor.model
        for name in found:
            model = model.with_effect(name, {})
        predictor = Predictor(model, base.predictor.data)
        candidate = predictor.like(model.with_effect("load_dependent_friction", {}))
        there = replace(base, predictor=candidate)
        return Trial("load_dependent_friction", there, "load_dependent_friction", {}, 0.0)

    assert not trial().rough and not trial("viscous_asymmetry").rough
    assert trial("position_dependent_friction").rough


@pytest.mark.slow
def test_a_load_carries_what_was_found_before_it():
    case = make("backlash", seed=4201, **DRIVE)
    trial, found = loaded(base_of(case), "backlash")
    assert carries(found, trial.key)
