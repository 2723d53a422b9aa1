"""Which effects are tried, on which grids, and which of them are one and the same."""

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lugrectl.model import model_from_dict
from lugrectl.results import Candidate
from lugrectl.spec import members
from lugrectl.tracing import search
from lugrectl.tracing.choice import _comes_to, worth_trying
from lugrectl.tracing.coordinates import free_keys
from lugrectl.tracing.dated import dated
from lugrectl.tracing.explain import _settles, _Trace, explain, likely
from lugrectl.tracing.fit import fit
from lugrectl.tracing.job import begin
from lugrectl.tracing.predictor import Predictor
from lugrectl.tracing.screening import _closer
from tests.blind.plan import Task
from tests.blind.work import case_of
from tests.rig import make

from .test_tracing import model_of, quiet, record_of

PLANT = {"J": 0.01}
FRICTION = {
    "coulomb": {"Fc": 0.3, "Fv": 0.01},
    "stribeck": {"Fc": 0.3, "Fs": 0.4, "Fv": 0.01, "vs": 0.1},
    "lugre": {"Fc": 0.3, "Fs": 0.4, "Fv": 0.01, "vs": 0.1, "sigma0": 300.0, "sigma1": 1.0},
}


def tried(law, motion="rotary", **more):
    friction = {"model": law, **FRICTION[law]}
    data = {"plant": PLANT, "friction": friction, "motion": motion, **more}
    return set(worth_trying(model_from_dict(data, "here")))


def test_what_the_friction_law_has_is_not_tried_and_all_else_is():
    everything = set(members("effect"))
    assert everything - tried("coulomb") == {"dwell_stiction"}  # it acts on Fs
    assert everything - tried("stribeck") == {"stribeck"}
    assert everything - tried("lugre") == {"stribeck", "presliding"}


def test_a_second_of_a_kind_only_where_it_can_differ():
    declared = [
        {"name": "gravity", "amplitude": 0.1, "phase": 0.0},
        {"name": "torque_ripple", "amplitude": 0.1, "harmonic": 6, "phase": 0.0},
    ]
    names = tried("lugre", effects=declared)
    assert "gravity" not in names and "torque_ripple" in names
    assert "gravity" not in tried("lugre", motion="linear")


@given(
    st.lists(st.floats(0.01, 100.0), min_size=3, max_size=12, unique=True),
    st.integers(0, 11),
)
def test_a_finer_grid_stays_between_the_neighbours(points, pick):
    known = np.sort(points)
    i = pick % len(known)
    finer = _closer(known, float(known[i]))
    low = known[i - 1] if i else known[0] - (known[1] - known[0])
    high = known[i + 1] if i + 1 < len(known) else 2.0 * known[-1] - known[-2]
    assert np.all((finer >= low) & (finer <= high))
    assert np.min(np.abs(finer - known[i])) <= 0.11 * (high - low) + 1e-12


@pytest.mark.parametrize("gap, same", [(1e-8, True), (0.05, False)])
def test_backlash_without_a_gap_is_an_elastic_coupling(gap, same):
    case = make("none", machine="servo", excitation="rich", seed=4103, rate=500.0, duration=20.0)
    base = begin(record_of(case), model_of(case), None, 1.0, quiet).base
    shaft = {"load_inertia": 4e-4, "stiffness": 20.0, "damping": 0.01}
    made = []
    for name, own in (("elastic_coupling", shaft), ("backlash", shaft | {"gap": gap})):
        predictor = Predictor(base.predictor.model.with_effect(name, own), base.predictor.data)
        values = base.values | {f"{name}.{k}": v for k, v in own.items()}
        free = ["J", *(f"{name}.{k}" for k in own)]
        made.append(fit(predictor, values, free, base.where, base.noise, most=0, rough=True))
    simple, other = made
    assert _comes_to(other, simple) is same
    assert not _comes_to(simple, other)


@pytest.mark.slow
@pytest.mark.sample
def test_two_effects_are_not_a_late_torque():
    """With one of the two alone, half a sample explains much; the other explains more."""
    case = case_of(Task("pair", ("viscous_asymmetry", "thermal_drift"), "normal", 127702))
    base = begin(record_of(case), model_of(case), None, 1.0, quiet).base
    model = base.predictor.model.with_effect("viscous_asymmetry", {"ratio": -0.7})
    predictor = Predictor(model, base.predictor.data)
    values = base.values | {"viscous_asymmetry.ratio": -0.7}
    one = fit(predictor, values, free_keys(predictor), base.where, base.noise)
    late = dated(one)
    assert late is not None
    trace = _Trace(base, base.where)
    trace.current = one
    assert trace.rather(late, lambda what: None)
    best, _ = max(trace.sound(lambda what: None), key=lambda pair: pair[1].total)
    assert best.name == "thermal_drift"


@pytest.mark.parametrize("uneven", [False, True])
def test_other_effects_settle_it_where_they_are_as_likely(uneven):
    """Where windows are forgiven the likelihoods are no more to be compared."""

    def ended(total, unexplained):
        noise = SimpleNamespace(uneven=uneven)
        return SimpleNamespace(
            final=SimpleNamespace(total=total, noise=noise), unexplained=unexplained
        )

    left = ended(100.0, True)
    assert _settles(ended(120.0, False), left) and not _settles(ended(120.0, True), left)
    assert _settles(ended(80.0, False), left) is uneven


def test_only_the_effects_asked_for_are_tried():
    case = make("torque_ripple", machine="servo", seed=4102, rate=500.0, duration=20.0)
    job = begin(record_of(case), model_of(case), None, 1.0, quiet)
    test = job.parts.test
    found = explain(job.base, quiet, test, only=("gravity", "torque_ripple"))
    assert [step.trial.name for step in found.steps] == ["torque_ripple"]
    assert {c.name for c in found.ranking} <= {"gravity", "torque_ripple"}
    assert likely(found)[0] == "torque_ripple"
    assert not explain(job.base, quiet, test, only=("hard_stop",)).steps


def test_likely_is_what_was_named_and_what_came_near_it_at_first():
    ranking = [Candidate(name, score, 0.5, {}) for name, score in (("a", 9.0), ("b", 4.0))]
    step = SimpleNamespace(trial=SimpleNamespace(name="c"), tied=(ranking[1],))
    found = SimpleNamespace(ranking=ranking, steps=[step])
    assert likely(found) == ("c", "b", "a")
    assert likely(SimpleNamespace(ranking=[], steps=[])) == ()


@pytest.mark.slow
def test_the_search_is_over_with_a_fit_that_leaves_nothing(monkeypatch):
    """The plant as it was believed to be is another start where something is left only."""
    asked = []
    monkeypatch.setattr(search, "at_anchor", lambda light: asked.append(1) or light)

    def tried_on(name):
        asked.clear()
        case = make(name, machine="servo", seed=4102, rate=500.0, duration=20.0)
        base = begin(record_of(case), model_of(case), None, 1.0, quiet).base
        fits = search.contest(base, ["torque_ripple", "gravity"], 10.0, lambda said: None).fits
        return fits[0][0].name, bool(asked)

    assert tried_on("torque_ripple") == ("torque_ripple", False)
    assert tried_on("torque_bumps") == ("torque_ripple", True)
