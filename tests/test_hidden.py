"""A load in its gap: where it is when a window begins, the blow that it deals next tells."""

from dataclasses import replace

import numpy as np
import pytest

from lugrectl import diagnose
from lugrectl.tracing.blows import forgiving
from lugrectl.tracing.fit import tuned
from lugrectl.tracing.hidden import placed, with_hidden
from lugrectl.tracing.job import begin
from lugrectl.tracing.likelihood import excess, whitened
from lugrectl.tracing.predictor import Predictor
from lugrectl.tracing.proof import GATE
from lugrectl.tracing.windows import windows
from tests.blind.plan import Task
from tests.blind.work import case_of
from tests.rig import make, sample

from .test_blind import verdict
from .test_tracing import model_of, quiet, record_of


@pytest.fixture(scope="module")
def true():
    """The true values of a drive whose load bounces, on windows of 1 s."""
    case = make(
        "backlash", machine="joint", excitation="moves", seed=4105, rate=500.0, duration=20.0
    )
    base = begin(record_of(case), model_of(case), None, 1.0, quiet).base
    model = base.predictor.model.with_effect("backlash", {})
    (own,) = [e["parameters"] for e in case.truth["effects"]]
    values = {k: case.truth["plant"].get(k, v) for k, v in base.values.items()}
    values |= {f"backlash.{k}": v for k, v in own.items()}
    noise = replace(base.noise, jump=0.2 * base.noise.jump)
    predictor = Predictor(model, base.predictor.data)
    found = replace(base, predictor=predictor, values=values, noise=noise)
    return forgiving(found)


def louder(fitted):
    """How much louder than expected each window is."""
    white = whitened(fitted.predictor, [fitted.values], fitted.where, fitted.noise)[0]
    return excess(white, fitted.noise)


def elsewhere(fitted, parts):
    """The same with the load put somewhere at each start."""
    hidden = {int(s): np.array(at) for s, at in zip(fitted.where.start, parts, strict=True)}
    return replace(fitted, where=replace(fitted.where, hidden=hidden))


def test_a_load_that_was_put_elsewhere_is_found_again(true):
    rng = np.random.default_rng(0)
    count = len(true.where.start)
    astray = elsewhere(true, rng.uniform(-1.0, 1.0, (count, 2)) * (1.0, 0.1))
    found = placed(astray)
    lost, back = louder(astray), louder(found)
    assert np.sum(lost > 2.0) >= 5
    assert np.sum(back > 2.0) <= 1
    assert tuned(found).total > tuned(astray).total + 100.0


def test_places_are_parts_of_the_reach_and_go_with_their_windows(true):
    count = len(true.where.start)
    moved = elsewhere(true, [(0.5, -0.25)] * count)
    few = replace(moved.where, start=moved.where.start[2:4])
    predictor, values = true.predictor, true.values
    (x0,) = predictor.initial([values], few)
    names = predictor.lanes.states
    twist, w_load = (x0[:, names.index(f"backlash_{k}")] for k in ("twist", "w_load"))
    far = 0.6 * values["backlash.gap"]
    ringing = np.sqrt(values["backlash.stiffness"] / values["backlash.load_inertia"])
    assert twist == pytest.approx([0.5 * far] * 2)
    assert w_load - x0[:, 1] == pytest.approx([-0.25 * far * ringing] * 2)
    other = predictor.initial([values], windows([(0, 700)], 100, 500))
    plain = predictor.initial([values], replace(few, hidden={}))
    assert other.shape == (1, 1, len(names))
    assert np.array_equal(np.delete(x0, [3, 4], axis=1), np.delete(plain[0], [3, 4], axis=1))


def test_fits_with_places_find_the_way_back(true):
    astray = tuned(elsewhere(true, [(-0.9, 0.0)] * len(true.where.start)))
    known, found = with_hidden(true), with_hidden(astray)
    assert known.total > true.total + 10.0 * GATE
    assert known.total - found.total < 0.2 * (known.total - astray.total)


@pytest.mark.slow
def test_a_gap_is_named_where_the_position_alone_was_recorded():
    """Nothing promised anything, and such a noise has no colour; yet something was missing."""
    case = case_of(Task("effect", ("backlash",), "normal", 135101, form="a position alone"))
    result = diagnose(record_of(case), model_of(case))
    assert (result.verdict, [e.name for e in result.effects]) == ("found", ["backlash"])


@pytest.mark.slow
def test_a_gap_beside_an_eccentric_encoder_is_all_there_is():
    """What was left was a load that had been missed."""
    result, names = verdict(sample(["backlash", "encoder_eccentricity"], 134202))
    assert (result.verdict, sorted(names)) == ("found", ["backlash", "encoder_eccentricity"])
