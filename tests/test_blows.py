"""Effects with many optima: all sets are searched, and a missed window weighs little."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from lugrectl import diagnose
from lugrectl.spec import members
from lugrectl.tracing import choice
from lugrectl.tracing.blows import closer, forgiving, search_all, sharpened
from lugrectl.tracing.coordinates import free_keys
from lugrectl.tracing.fit import fit
from lugrectl.tracing.job import begin
from lugrectl.tracing.likelihood import excess, loglik
from lugrectl.tracing.predictor import Predictor
from tests.blind.plan import Task
from tests.blind.work import case_of
from tests.rig import make

from .test_tracing import model_of, quiet, record_of


@pytest.fixture(scope="module")
def case():
    return make(
        "backlash", machine="joint", excitation="moves", seed=4105, rate=500.0, duration=20.0
    )


@pytest.fixture(scope="module")
def base(case):
    return begin(record_of(case), model_of(case), None, 1.0, quiet).base


@pytest.mark.slow
@pytest.mark.sample
def test_a_box_and_its_sets_are_inverse(base):
    log = base.predictor.data.log
    box = members("effect")["backlash"].box(log, {"J": 0.2, "load_inertia": 0.05})
    for part in (0.1, 0.5, 0.9):
        x = box.low + part * (box.high - box.low)
        made = box.at(x)
        whole = made["J"] + made["load_inertia"]
        assert np.log(whole) == pytest.approx(x[0])
        same = members("effect")["backlash"].box(log, made)
        assert same.into(made) == pytest.approx(x)
        assert np.exp(same.low[0]) < whole < np.exp(same.high[0])


@pytest.mark.slow
@pytest.mark.sample
def test_a_fit_that_came_to_no_load_is_still_in_reach_of_the_box(base):
    box = members("effect")["backlash"].box(base.predictor.data.log, {"J": 0.2})
    none = dict.fromkeys(("load_inertia", "stiffness", "damping", "gap"), 0.0)
    x = box.into(none)
    assert np.all(np.isfinite(x)) and np.all(x <= box.high)


def test_a_missed_window_weighs_little(base):
    rng = np.random.default_rng(1)
    white = rng.normal(size=(6, 500, 2))
    white[3] *= 30.0
    noise = replace(base.noise, uneven=True)
    assert np.all(excess(white, base.noise) == 1.0)
    assert excess(white, noise)[3] == pytest.approx(900.0, rel=0.2)
    where = replace(base.where, start=base.where.start[:6], length=500)
    even, forgiven = (
        loglik(base.predictor, white, q, base.values, where) for q in (base.noise, noise)
    )
    assert forgiven[3] - even[3] > 1e5
    assert forgiven[[0, 1, 2, 4, 5]] == pytest.approx(even[[0, 1, 2, 4, 5]], abs=5.0)


def starting(case, base, **start):
    """A short fit of backlash whose values start at these factors of the true ones."""
    (truth,) = [e["parameters"] for e in case.truth["effects"]]
    own = {k: truth[k] * factor for k, factor in start.items()}
    predictor = Predictor(base.predictor.model.with_effect("backlash", own), base.predictor.data)
    values = base.values | {f"backlash.{k}": v for k, v in own.items()}
    free = free_keys(predictor)
    near = fit(predictor, values, free, base.where, base.noise, most=5, rough=True)
    return near, truth


@pytest.mark.slow
@pytest.mark.sample
def test_a_closer_look_is_never_worse(case, base):
    near, truth = starting(case, base, load_inertia=0.9, gap=1.02, stiffness=0.8, damping=0.8)
    found = closer(near, "backlash")
    assert forgiving(found).total > forgiving(near).total + 100.0
    assert found.values["backlash.gap"] == pytest.approx(truth["gap"], rel=0.02)
    assert forgiving(closer(found, "backlash")).total >= forgiving(found).total


def test_how_firm_backlash_is_goes_by_what_the_windows_gain(monkeypatch):
    monkeypatch.setattr(choice, "forgiving", lambda fitted: fitted)
    monkeypatch.setattr(choice, "firmness", lambda fitted, key: 0.25)
    rigid = SimpleNamespace(loglik=np.zeros(4))

    def sureness(gain, boxed=True):
        trial = SimpleNamespace(key="backlash", boxed=boxed)
        return choice.sureness(rigid, SimpleNamespace(loglik=np.array(gain)), trial)

    capped = [80.0, 105.0, 90.0, 105.0]  # at the median
    firm = np.sum(capped) / (2.0 * np.std(capped, ddof=1) * 2.0)
    assert sureness([80.0, 120.0, 90.0, 2400.0]) == pytest.approx(firm)
    assert sureness([400.0, 0.0, 0.0, 0.0]) == 0.25
    assert sureness([400.0, -300.0, -300.0, 400.0]) < 0.5
    assert sureness([80.0, 120.0, 90.0, 2400.0], boxed=False) == 0.25


@pytest.mark.slow
def test_backlash_is_found_from_far_away(case, base):
    start = {"load_inertia": 0.5, "gap": 1.6, "stiffness": 0.4, "damping": 0.5}
    near, truth = starting(case, base, **start)
    found = sharpened(replace(near, values=search_all(near, "backlash")))
    assert found.total > forgiving(near).total + 1000.0
    for name in ("load_inertia", "gap", "stiffness"):
        assert found.values[f"backlash.{name}"] == pytest.approx(truth[name], rel=0.15)


@pytest.mark.slow
def test_windows_that_missed_the_load_do_not_speak_against_it():
    drawn = case_of(Task("effect", ("backlash",), "normal", 124000))  # 10 s at 200 Hz
    result = diagnose(record_of(drawn), model_of(drawn))
    assert result.verdict == "found" and [e.name for e in result.effects] == ["backlash"]
    assert all(e.ci95 is None for e in result.estimates.values())
