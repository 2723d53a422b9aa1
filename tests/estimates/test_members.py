"""Models drawn from what a fit knows."""

import json

import numpy as np
import pytest

import lugrectl as lg
from lugrectl.core.errors import Refused
from lugrectl.estimates.covariance import Joint
from lugrectl.estimates.findings import Estimate
from lugrectl.estimates.members import Belief, Members

VALUES = {"J": 0.002, "Fc": 0.3, "Fv": 0.02}


def estimates(spread, **values):
    return {
        k: Estimate(v, "", (v - 1.96 * spread * v, v + 1.96 * spread * v))
        for k, v in values.items()
    }


def correlated(spread=0.05, rho=-0.8):
    x = np.array(list(VALUES.values()))
    R = np.eye(3)
    R[1, 2] = R[2, 1] = rho
    C = np.outer(spread * x, spread * x) * R
    return Joint(tuple(VALUES), x, C, np.ones(3, bool))


def belief(weight=1.0, spread=0.05, **stated):
    model = lg.Model.of(friction="coulomb", **(VALUES | stated))
    return Belief.of(model, correlated(spread), estimates(spread, **VALUES), weight)


def test_intervals_are_those_of_what_is_drawn():
    x, sd = np.array([0.1, -0.1]), 0.05
    joint = Joint(("Fs", "offset"), x, sd**2 * np.eye(2), np.array([True, False]))
    drawn = np.array([*joint.sample(200_000, 0).values()])
    ends = np.quantile(drawn, [0.025, 0.975], axis=1).T
    assert joint.interval() == pytest.approx(ends, abs=0.1 * sd)
    assert np.all(joint.interval()[0] > 0.0)


def test_members_are_models_with_the_covariance_of_the_fit():
    drawn = Members([belief()], 4000, 0)
    logs = np.log([drawn[k] for k in VALUES])
    assert np.allclose(logs.std(axis=1), 0.05, rtol=0.05)
    assert np.corrcoef(logs)[1, 2] == pytest.approx(-0.8, abs=0.03)
    own = drawn[7].known()
    assert {k: own[k] for k in VALUES} == {k: drawn[k][7] for k in VALUES}


def test_values_stay_inside_stated_bounds_and_stiction_above_coulomb_friction():
    drawn = Members([belief(spread=0.5, Fc={"value": 0.3, "min": 0.25, "max": 0.4})], 500, 1)["Fc"]
    assert drawn.min() >= 0.25 and drawn.max() <= 0.4 and np.ptp(drawn) > 0.1
    model = lg.Model.of(friction="stribeck", J=0.002, Fc=0.3, Fs=0.31, Fv=0.02, vs=0.1)
    known = {k: v for k, v in model.known().items()}
    wide = Members([Belief.of(model, None, estimates(0.2, **known))], 500, 1)
    assert np.all(wide["Fs"] >= wide["Fc"])


def test_a_value_that_nothing_determines_is_refused_by_name():
    model = lg.Model.of(lg.table1())
    known = {k: v for k, v in model.known().items() if k not in ("sigma1", "vs")}
    drawn = Members([Belief.of(model, None, estimates(0.1, **known))], 5, 0)
    assert np.std(drawn["Fc"]) > 0.0
    with pytest.raises(Refused, match=r"does not determine sigma1, vs.*std = "):
        drawn[0]
    held = model.fix("vs")
    said = lg.Model.of(held, sigma1={"value": 0.6, "std": 0.2})
    drawn = Members([Belief.of(said, None, estimates(0.1, **known))], 2000, 0)
    assert drawn[0].known()["vs"] == 0.01
    assert np.std(np.log(drawn["sigma1"])) == pytest.approx(0.2 / 0.6, rel=0.1)


def test_models_are_drawn_by_their_weights():
    heavy = lg.Model.of(friction="coulomb", **VALUES, effects="gravity").with_values(
        {"gravity.amplitude": 0.1, "gravity.phase": 0.0}
    )
    own = estimates(0.1, **VALUES, **{"gravity.amplitude": 0.1, "gravity.phase": 0.2})
    other = Belief.of(heavy, None, own, 0.25)
    drawn = Members([belief(0.75), other], 2000, 3)
    with_it = [len(m.effects) for m in drawn[:400]]
    assert np.mean(with_it) == pytest.approx(0.25, abs=0.06)
    assert np.mean(np.isnan(drawn["gravity.amplitude"])) == pytest.approx(0.75, abs=0.03)
    with pytest.raises(lg.InputError, match="different models"):
        drawn.columns_of("plant")


def test_a_belief_returns_from_the_document():
    first = belief()
    again = Belief.read(json.loads(json.dumps(first.summary())))
    a, b = (Members([one], 10, 5) for one in (first, again))
    assert np.array_equal(a["Fc"], b["Fc"]) and a[3].known() == b[3].known()


def test_members_go_into_a_simulation_a_sweep_and_a_search_for_cycles():
    drawn = Members([belief()], 4, 0)
    t = np.linspace(0.0, 0.1, 11)
    one = lg.simulate(drawn[0], t, {"u": 1.0}).outputs[1]
    plant = lg.plant(lg.Model.of(friction="coulomb", **VALUES))
    many = lg.sweep(plant, t, [1.0, 0.0], drawn, outputs=["w"])
    assert np.allclose(many["w"][0], one, rtol=1e-4)
    assert lg.limit_cycles(drawn[0], kp=2.0, ki=1.0, kd=0.1)


def test_friction_that_is_hardly_known_is_what_the_torque_of_the_record_overcame():
    t = 1e-2 * np.arange(400)
    record = lg.Record(t=t, u=0.5 * np.sin(t), w=np.cos(t))
    model = lg.Model.of(friction="stribeck", J=0.002, Fc=0.3, Fs=0.35, Fv=0.02, vs=0.1)
    own = estimates(0.05, **{k: v for k, v in model.known().items() if k != "Fs"})
    own["Fs"] = Estimate(0.35, "N m", (0.3, 40.0))
    drawn = Members([Belief.of(model, None, own).moved_by([record])], 500, 0)["Fs"]
    assert drawn.max() <= 0.5 and np.quantile(drawn, 0.9) > 0.42
