"""The recommended observer: what is simulated, the order, the reasons, what is taken in."""

import json
import pickle

import numpy as np
import pytest

import lugrectl as lg
from lugrectl.simulation.sampled_block import rounded

from ..cases.observed import P

FEW = ["natural", "disturbance", "position_coulomb", "existing"]


@pytest.fixture(scope="module")
def found():
    return lg.recommend_observer(
        P, observers=FEW[:2] + FEW[3:], rate=1000, resolution=1e-6, frequency=2.0
    )


def logged(rate=500.0, step=0.0, noise=0.0, n=1500):
    """A log of a sine: theta rounded to a step, w with noise."""
    t = np.arange(n) / rate
    theta = 0.4 * np.sin(2 * np.pi * t)
    w = 0.8 * np.pi * np.cos(2 * np.pi * t) + noise * np.random.default_rng(0).normal(size=n)
    return {
        "t": t,
        "u": 0.3 * np.sign(np.cos(2 * np.pi * t)),
        "theta": rounded(theta, step),
        "w": w,
    }


def drive(log, **known):
    """What is assumed about the drive of a log."""
    own = {"observers": "disturbance", "uncertainty": 0.0, "frequency": 8.0}
    return lg.recommend_observer(P, log, **own, **known).drive


def test_the_order_is_that_of_the_largest_error(found):
    worst = [row.worst for row in found]
    assert worst == sorted(worst) and len(found) == 3
    for row in found:
        assert row.worst == max(row.errors.values()) == row.errors[row.worst_case]
    assert found.best.name == found.names[0] == "disturbance"
    assert found.none > 5 * found.best.worst


def test_each_wrong_parameter_that_an_observer_knows_is_tried(found):
    assert set(found["disturbance"].errors) == {"exact parameters", "J x0.8", "J x1.2"}
    assert found["disturbance"].complete and not found["natural"].complete
    assert list(found["natural"].errors) == ["exact parameters", "Fc, Fs x0.8", "Fc, Fs x1.2"]
    own = {"uncertainty": {"vs": 0.5}, "frequency": 4.0}
    alone = lg.recommend_observer(P, observers="natural", rate=250, **own)
    assert list(alone[0].errors) == ["exact parameters", "vs x0.5", "vs x1.5"]


def test_reasons_name_the_figures_that_decide(found):
    first, last = found[0].reasons, found[-1].reasons
    assert first[0].startswith("Its error is at most") and "without an observer" in first[0]
    assert "that of disturbance" in last[0] and "too large to try" in last[0]
    assert any("must know J." in said for said in first)
    assert any("errors decay with 500 1/s" in said for said in first)
    for row in found:
        assert all(said.endswith(".") and said[0].isupper() for said in row.reasons)


def test_a_drive_with_a_position_only_takes_observers_of_the_position():
    own = {"measured": "theta", "uncertainty": 0, "frequency": 8.0}
    made = lg.recommend_observer(P, rate=500, observers=FEW, **own)
    assert made.names == ("position_coulomb",) and made.signal == "theta" and made.unit == "rad"
    assert set(made.refused) == set(FEW) - {"position_coulomb"}
    assert "reads w, and this drive measures only theta" in made.refused["natural"]
    assert made.controller["kd"] == pytest.approx(P.J * made.drive["bandwidth"])


@pytest.mark.slow
def test_an_observer_of_bristles_is_not_admissible_on_a_drive_without_them():
    drive = {"J": 0.5, "friction": "coulomb", "Fc": 1.0, "Fv": 0.1, "motion": "linear"}
    made = lg.recommend_observer(drive, rate=500, observers=["natural", "disturbance"],
                                 speed=0.3, frequency=4.0)  # fmt: skip
    assert made.names == ("disturbance",) and made.unit == "m/s"
    assert "coulomb friction does not have" in made.refused["natural"]
    assert "sigma0" in made.refused["natural"]


def test_an_observer_that_makes_the_loop_worse_at_its_rate_is_not_admissible():
    """A disturbance observer of 1000 1/s, with a dead time of 2 ms."""
    spec = {"rate": 500, "delay": 2e-3, "bandwidth": 80, "uncertainty": 0.0}
    given = {"disturbance": {"tau": 1e-3}}
    made = lg.recommend_observer(P, spec, observers="disturbance", gains=given)
    assert not made and made.best is None
    assert "it does not help at 500 Hz" in made.refused["disturbance"]
    assert "No observer is admissible" in made.messages[-1]
    assert repr(made).splitlines()[0] == "Recommended observer: none"


@pytest.mark.slow
def test_a_weak_answer_says_so():
    made = lg.recommend_observer(P, rate=100, observers=["natural", "disturbance"])
    assert made.messages[0].startswith("The sensor is taken as exact")
    assert made.messages[1].startswith("Even the best observer may help little")
    assert made["natural"].worst > made.none and made["natural"].noise == 0.0


@pytest.mark.slow
def test_gains_without_a_rule_can_be_left_out():
    own = {
        "rate": 500,
        "uncertainty": 0.0,
        "frequency": 4.0,
        "gains": {"disturbance": {"tau": 0.01}},
    }
    both = ["disturbance", "natural"]
    made = lg.recommend_observer(P, observers=both, certified=True, **own)
    assert made.names == ("natural",) and "certified=True" in made.refused["disturbance"]
    free = lg.recommend_observer(P, observers="disturbance", **own)
    assert free[0].gains == {"tau": 0.01} and free[0].certificate is None
    assert "nothing is guaranteed" in free[0].reasons[-1]


def test_a_record_gives_rate_step_and_noise():
    spec = drive(logged(500.0, 1e-3, 0.02))
    assert spec["rate"] == pytest.approx(500.0)
    assert spec["resolution"] == pytest.approx(1e-3) and spec["noise"] < 1e-3
    assert spec["speed_noise"] == pytest.approx(0.02, rel=0.1)
    assert spec["measured"] == ["theta", "w"]
    assert spec["speed"] == pytest.approx(0.8 * 0.8 * np.pi, rel=0.02)


def test_the_answer_has_the_forms_of_every_result(found):
    made = json.loads(found.to_json())
    assert made["best"] == "disturbance" and made["ranked"][0]["certificate"]["rate"] == 500.0
    assert made == json.loads(json.dumps(found.to_dict()))
    assert len(repr(found).splitlines()) < 9 and "1. disturbance" in str(found)
    assert "<table>" in found._repr_html_()
    frame = found.to_frame()
    assert list(frame.index) == list(found.names) and frame["admissible"].all()
    again = pickle.loads(pickle.dumps(found))
    assert again.to_json() == found.to_json()
    assert found["natural_observer"] is found["natural"]


def test_the_plot_has_a_line_for_each_observer(found):
    plt = pytest.importorskip("matplotlib.pyplot")
    ax = found.plot()
    assert [label.get_text() for label in ax.get_yticklabels()] == list(reversed(found.names))
    plt.close(ax.figure)


def test_what_was_not_considered_is_named(found):
    with pytest.raises(lg.InputError, match="'proposed' was not considered"):
        found["proposed"]
    made = lg.recommend_observer(
        P, rate=200, measured="theta", observers=["natural"], uncertainty=0.0
    )
    with pytest.raises(lg.InputError, match="natural is not admissible: it reads w"):
        made["natural"]
