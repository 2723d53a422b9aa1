"""Models drawn from what a fit knows."""

import numpy as np
import pytest

import lugrectl as lg
from lugrectl.core.errors import Refused
from lugrectl.estimates.findings import Estimate, Joint
from lugrectl.estimates.fitted import Belief, Members


def estimates(spread, **values):
    return {
        k: Estimate(v, "", (v - 1.96 * spread * v, v + 1.96 * spread * v))
        for k, v in values.items()
    }


def test_intervals_are_those_of_what_is_drawn():
    x, sd = np.array([0.1, -0.1]), 0.05
    joint = Joint(("Fs", "offset"), x, sd**2 * np.eye(2), np.array([True, False]))
    drawn = np.array([*joint.sample(200_000, 0).values()])
    ends = np.quantile(drawn, [0.025, 0.975], axis=1).T
    assert joint.interval() == pytest.approx(ends, abs=0.1 * sd)
    assert np.all(joint.interval()[0] > 0.0)


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


def test_friction_that_is_hardly_known_is_what_the_torque_of_the_record_overcame():
    t = 1e-2 * np.arange(400)
    record = lg.Record(t=t, u=0.5 * np.sin(t), w=np.cos(t))
    model = lg.Model.of(friction="stribeck", J=0.002, Fc=0.3, Fs=0.35, Fv=0.02, vs=0.1)
    own = estimates(0.05, **{k: v for k, v in model.known().items() if k != "Fs"})
    own["Fs"] = Estimate(0.35, "N m", (0.3, 40.0))
    drawn = Members([Belief.of(model, None, own).moved_by([record])], 500, 0)["Fs"]
    assert drawn.max() <= 0.5 and np.quantile(drawn, 0.9) > 0.42
