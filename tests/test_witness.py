"""A second encoder and a thermometer bear witness to effects."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from lugrectl.tracing.coordinates import free_keys
from lugrectl.tracing.fit import fit
from lugrectl.tracing.job import begin
from lugrectl.tracing.predictor import Predictor
from lugrectl.tracing.witness import contradicted, statements
from tests.rig import make

from .test_tracing import model_of, quiet, record_of

SERVO = {"machine": "servo", "rate": 500.0, "duration": 20.0}


def fitted(case, name, **changed):
    """The declared model with the effect at its true values, on the case's record."""
    record = replace(record_of(case), **changed)
    base = begin(record, model_of(case), None, 1.0, quiet).base
    own = case.truth["parameters"]
    model = base.predictor.model.with_effect(name, own)
    predictor = Predictor(model, base.predictor.data)
    values = base.values | {f"{name}.{k}": v for k, v in own.items()}
    return fit(predictor, values, free_keys(predictor), base.where, base.noise, most=8, rough=True)


@pytest.fixture(scope="module")
def elastic():
    return make("elastic_coupling", excitation="rich", seed=4102, channels=("theta_load",), **SERVO)


def test_an_encoder_behind_the_coupling_agrees_with_its_twist(elastic):
    found = fitted(elastic, "elastic_coupling")
    assert not contradicted(found, "elastic_coupling")
    (sentence,) = statements(found)
    moved, left = (float(size) for size in re.findall(r"(\S+) rad", sentence))
    assert left < 0.3 * moved


def test_an_encoder_that_sees_no_twist_contradicts_a_coupling(elastic):
    stiff = fitted(elastic, "elastic_coupling", theta_load=record_of(elastic).theta)
    assert contradicted(stiff, "elastic_coupling")


def test_encoders_that_differ_are_noticed_where_no_coupling_was_found(elastic):
    base = begin(record_of(elastic), model_of(elastic), None, 1.0, quiet).base
    (sentence,) = statements(base)
    assert sentence.startswith("theta and theta_load differ by")


@pytest.mark.parametrize("follows", [True, False])
def test_a_drift_is_compared_with_the_temperature(follows):
    case = make("thermal_drift", excitation="sparse", seed=4103, channels=("temperature",), **SERVO)
    t = record_of(case).t
    other = {} if follows else {"temperature": 20.0 + np.sin(t)}
    (sentence,) = statements(fitted(case, "thermal_drift", **other))
    assert ("follows the temperature: " in sentence) == follows
