"""Runs at steady speeds as one friction map, from made-up logs with known values."""

import json

import numpy as np
import pytest

import lugrectl as lg
from lugrectl.core.errors import InputError

FC, FV = 0.3, 0.02
SPEEDS = np.r_[-np.geomspace(0.5, 12, 8), np.geomspace(0.5, 12, 8)]
MODEL = lg.Model.of(friction="coulomb")
NOISE, SCATTER = 0.003, 0.002  # N m: of a sample, and of a run


def runs(added=None, speeds=SPEEDS, n=300, dt=0.01, has=("theta",), seed=1):
    """Fc sign(w) + Fv w + ``added``(w, theta), N m; each run is over other angles."""
    chance, made = np.random.default_rng(seed), []
    for w in speeds:
        t = dt * np.arange(n)
        theta = chance.uniform(-1, 1) + w * t
        u = FC * np.sign(w) + FV * w + (0.0 if added is None else added(w, theta))
        u = u + NOISE * chance.standard_normal(n) + SCATTER * chance.standard_normal()
        both = {"theta": theta, "w": w + 0.02 * chance.standard_normal(n)}
        made.append({"t": t, "u": u} | {k: both[k] for k in has})
    return made


def holds(estimate, truth, relative=0.2):
    """Whether the interval holds the truth and is no wider than a share of it."""
    low, high = estimate.ci95
    return low <= truth <= high and high - low < 2 * relative * abs(truth)


def named(found):
    return [e.name for e in found.effects]


@pytest.mark.slow
def test_plain_friction_is_adequate_with_its_values():
    found = lg.diagnose(runs(), MODEL)
    assert found.verdict == "adequate" and not found.effects
    assert holds(found.estimates["Fc"], FC, 0.05) and holds(found.estimates["Fv"], FV, 0.1)
    assert "J" not in found.estimates and found.model.J is None
    assert any("do not tell J" in m for m in found.messages)
    assert found.plain.is_map and len(found.plain.curve) == len(SPEEDS)
    assert holds(found.plain.parameters["Fc"], FC, 0.05)
    assert not {"J", "u_delay"} & found.plain.parameters.keys()
    held = [p.ci95[0] <= FC * np.sign(p.w) + FV * p.w <= p.ci95[1] for p in found.plain.curve]
    assert sum(held) >= len(SPEEDS) - 1


@pytest.mark.slow
def test_the_answer_has_the_face_of_a_map():
    found = lg.diagnose(runs(lambda w, x: 0.5 * np.sin(x + 0.4)), MODEL)
    document = json.loads(found.to_json())
    assert document["error"]["signal"] == "u" and document["torque_error"]["unit"] == "N m"
    assert document["error"]["augmented"] < 0.1 * document["error"]["refitted"]
    assert len(document["map"]["w"]) == len(document["map"]["held_out"]) == len(SPEEDS)
    assert sum(document["map"]["held_out"]) == 4
    assert {row["term"] for row in document["budget"]} >= {"coulomb", "viscous", "gravity"}
    assert document["comparison"][0]["model"] == "declared"
    steps = np.abs(found.map.u - FC * np.sign(found.map.w) - FV * found.map.w)
    assert np.max(steps) < 0.05 * FC  # without what hangs on the angle
    for curve in found.map.curves.values():
        assert len(curve) == len(found.map.at)
    assert [ax.get_xlabel() for ax in found.plot()].count("w [rad/s]") == 1
    assert found.map.plot().get_ylabel().startswith("mean torque")
    assert "Mean torque of the held-out runs" in str(found)


@pytest.mark.slow
def test_what_hangs_on_angle_and_speed_is_named():
    found = lg.diagnose(runs(lambda w, x: 0.08 * np.sign(w) * np.sin(2 * x + 0.4)), MODEL)
    assert found.verdict == "found" and named(found) == ["position_dependent_friction"]
    assert holds(found.effects[0].parameters["ratio"], 0.08 / FC)
    assert found.error["augmented"] < found.error["refitted"]


@pytest.mark.slow
def test_a_bend_of_the_friction_curve():
    bend = lg.diagnose(runs(lambda w, x: 0.1 * np.sign(w) * abs(w) ** 0.5 - FV * w), MODEL)
    assert named(bend) == ["sublinear_viscous"]
    assert bend.effects[0].parameters["exponent"].may_be(0.5)


@pytest.mark.slow
def test_one_direction_gives_the_sum():
    found = lg.diagnose(runs(lambda w, x: 0.05, speeds=np.geomspace(0.5, 12, 7)), MODEL)
    (total,) = found.plain.combinations
    assert total.text == "Fc + constant_torque" and total.ci95[0] <= FC + 0.05 <= total.ci95[1]
    assert "direction" in total.to_separate and "Fc" not in found.estimates
    assert holds(found.estimates["Fv"], FV)


def test_what_no_effect_explains_is_unexplained():
    def added(w, x):
        return 0.15 * np.sign(w) * np.exp(-(((abs(w) - 4) / 1.2) ** 2))

    speeds = np.linspace(0.5, 12, 8)
    found = lg.diagnose(runs(added, speeds=[*speeds, *-speeds]), MODEL)
    assert found.verdict == "unexplained" and "w" in found.depends_on and found.experiment


def test_torque_of_the_wrong_sign_is_refused_with_values_of_the_other():
    made = [run | {"u": -run["u"]} for run in runs()]
    found = lg.diagnose(made, MODEL)
    assert found.verdict == "refused" and "opposes" in found.reason and "u=-1" in found.experiment
    assert holds(found.plain.parameters["Fc"], FC, 0.05)
    assert any("-u" in m for m in found.messages)


def test_identify_gives_the_declared_friction():
    """On a linear axis, which has its own units."""
    fit = lg.identify(runs(), lg.Model.of(friction="coulomb", motion="linear"))
    assert fit.error["unit"] == fit.plain.parameters["Fc"].unit == "N"
    assert holds(fit.estimates["Fc"], FC, 0.05) and holds(fit.estimates["Fv"], FV, 0.1)
    assert fit.model.J is None and len(fit.map.w) == len(SPEEDS)
    assert fit.error["signal"] == "u" and "augmented" not in fit.error
    assert any("do not tell J" in m for m in fit.messages)


def test_too_few_runs_have_a_plain_answer():
    found = lg.diagnose(runs(speeds=[-6, -1, 1, 6.5]), MODEL)
    assert found.verdict == "refused" and "too few" in found.reason
    sums = [c for c in found.plain.combinations if c.text.startswith("Fc")]
    assert sums or "Fc" in found.plain.parameters


def test_a_run_that_is_held_out():
    made = runs(lambda w, x: 0.002 * w * abs(w), SPEEDS[1::2])
    apart = lg.diagnose(made[:-1], MODEL, holdout=made[-1])
    assert named(apart) == ["quadratic_drag"]
    assert apart.map.held_out.tolist() == [False] * (len(made) - 1) + [True]
    assert apart.error["augmented"] < 0.5 * apart.error["refitted"]
    moving = {"t": made[0]["t"], "u": made[0]["u"], "theta": np.sin(5 * made[0]["t"])}
    with pytest.raises(InputError, match="steady"):
        lg.diagnose(made[:-1], MODEL, holdout=moving)
