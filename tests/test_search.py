"""The search for the best values of an effect."""

from dataclasses import replace

import numpy as np
import pytest

from lugrectl.spec import P
from lugrectl.tracing.fit import again
from lugrectl.tracing.job import begin
from lugrectl.tracing.predictor import Predictor
from lugrectl.tracing.screening import Trial, _within, lightened
from lugrectl.tracing.search import _anew
from tests.blind.plan import Task
from tests.blind.work import case_of

from .test_tracing import model_of, quiet, record_of

SOFT = {"presliding.sigma0": 6550.0, "presliding.sigma1": 93.6}


@pytest.mark.slow
def test_a_better_optimum_is_found_far_from_a_poor_one():
    """Soft, much damped bristles where there are stiffer ones with a sixth of the damping."""
    case = case_of(Task("effect", ("presliding",), "weak", 128200))
    base = begin(record_of(case), model_of(case), None, 1.0, quiet).base
    model = base.predictor.model.with_effect("presliding")
    values = base.values | {"J": 0.1079, "Fc": 2.167, "Fs": 2.55, "Fv": 0.8936, "vs": 0.0262} | SOFT
    poor = again(replace(base, predictor=Predictor(model, base.predictor.data), values=values))
    assert poor.values["presliding.sigma1"] > 80.0
    trial = Trial("presliding", poor, "presliding", poor.values, np.inf)
    _, best = _anew((trial, poor), lightened(base), base.total)
    assert best.total > poor.total + 500.0
    for name, true in case.truth["parameters"].items():
        assert abs(best.values[f"presliding.{name}"] / true - 1.0) < 0.03


@pytest.mark.parametrize(
    "low, high, strength, within",
    [
        (-0.95, 20.0, 0.4, 0.4),
        (-0.95, 20.0, -1.11, -0.665),
        (-0.95, 20.0, 30.0, 14.0),
        (0.0, 0.9, 2.0, 0.63),
        (0.0, 0.9, -0.1, None),
        (0.0, np.inf, -0.1, None),
        (0.0, 0.9, np.nan, None),
    ],
)
def test_a_step_beyond_a_bound_starts_short_of_it_and_none_goes_the_wrong_way(
    low, high, strength, within
):
    found = _within(P(0.0, "1", low, high, neutral=0.0), strength)
    assert found == (within if within is None else pytest.approx(within))
