"""One comparison decides: what it names, what it leaves unnamed, and what it says of both."""

from __future__ import annotations

import math

import numpy as np
import pytest

import lugrectl as lg

from ..cases.balance_drive import FC, FV, J, log_of, recorded, simulate, torque

MODEL = lg.Model.of(J=1.03 * J, friction="coulomb", Fc=0.9 * FC, Fv=1.1 * FV)
BRISTLES = MODEL.to_dict()["plant"] | {
    "sigma0": 400.0,
    "sigma1": 0.05,
    "Fc": FC,
    "Fs": 1.001 * FC,
    "Fv": FV,
    "vs": 0.02,
}
SOFT = lg.Model.of(friction="lugre", **BRISTLES)
DT, COUNTS = 2e-3, 65536
RADIANS = {"theta": "rad", "w": "rad/s"}


def weight(theta, w):
    return 0.03 * math.sin(theta + 0.3)


def cogged(seconds=14.0, dt=1e-3, J=0.0015, parts=5):
    """A light drive with a ripple that is fast at its top speed, on Coulomb friction."""
    t = np.arange(round(seconds / dt)) * dt
    u = 0.5 * np.sin(math.pi * t) + 0.25 * np.sin(2 * math.pi * 1.7 * t + 1.0)
    theta = w = 0.0
    seen = []
    for pull in u.tolist():
        seen.append((theta, w))
        for _ in range(parts):
            friction = 0.2 * math.tanh(w / 0.02) + 0.01 * w
            w += dt / parts / J * (pull - 0.05 * math.sin(4 * theta + 0.3) - friction)
            theta += dt / parts * w
    theta, w = np.array(seen).T
    w = w + np.random.default_rng(5).normal(0.0, 0.01, len(t))
    return log_of(u, dt, np.round(theta / 1.5e-3) * 1.5e-3, w)


def said_of(load=None, seconds=14.0):
    return lg.diagnose(recorded(seconds, DT, load=load), MODEL)


@pytest.fixture(scope="module")
def nothing():
    return said_of()


@pytest.fixture(scope="module")
def weighed():
    return said_of(weight)


def test_nothing_is_missing_from_a_model_with_values_that_are_off(nothing):
    assert nothing.verdict == "adequate" and nothing.effects == nothing.depends_on == ()
    assert nothing.model.J == pytest.approx(J, rel=0.01)


def test_the_smallest_effects_that_would_have_been_seen_are_said(nothing):
    assert {"gravity", "coulomb_asymmetry"} <= {one.name for one in nothing.comparison.detectable}
    smooth = [one.share for one in nothing.comparison.detectable if one.name != "hard_stop"]
    assert all(0.0 < share < 0.5 for share in smooth)


def test_an_effect_is_named_with_values_to_start_a_fit_from(weighed):
    (effect,) = weighed.effects
    assert (weighed.verdict, effect.name) == ("found", "gravity")
    assert effect.parameters["amplitude"].value == pytest.approx(0.03, rel=0.03)
    assert effect.parameters["phase"].value == pytest.approx(0.3, abs=0.05)
    assert not weighed.comparison.detectable


def test_the_budget_says_where_the_torque_goes(weighed):
    shares = {one.term: one for one in weighed.comparison.budget}
    assert shares["gravity"].rms == pytest.approx(0.03 / math.sqrt(2), rel=0.25)
    for one in shares.values():
        assert one.ci95 is None or one.ci95[0] <= one.share <= one.ci95[1]


def test_windows_do_not_average_away_what_is_missing_where_no_inertia_is_declared():
    """The torque biases the inertia of narrow windows: they are no worse for that."""
    (effect,) = lg.diagnose(cogged(), lg.Model.of(friction="coulomb"), units=RADIANS).effects
    assert (effect.name, effect.parameters["harmonic"].value) == ("torque_ripple", 4.0)
    assert effect.parameters["amplitude"].value == pytest.approx(0.05, rel=0.05)


def runs(load, offset):
    """Two runs of the drive, the second with an offset of its torque."""
    made = []
    for seed, more in ((0, 0.0), (1, offset)):
        u = torque(8.0, DT, seed)
        theta, _ = simulate(u, DT, load=load)
        made.append({"t": np.arange(len(u)) * DT, "u": u + more, "theta": theta})
    return made


@pytest.fixture(scope="module")
def diagnosed():
    """The diagnosis of two runs of a drive with an undeclared weight."""
    return lg.diagnose(runs(weight, 0.0), SOFT)


def test_an_effect_is_named_from_several_runs(diagnosed):
    (effect,) = diagnosed.effects
    assert (diagnosed.verdict, effect.name) == ("found", "gravity")
    assert effect.parameters["amplitude"].value == pytest.approx(0.03, rel=0.01)
    low, high = effect.parameters["amplitude"].ci95
    assert low < effect.parameters["amplitude"].value < high
    assert diagnosed.error["augmented"] < 0.3 * diagnosed.error["refitted"]
    assert diagnosed.depends_on == ("theta",)


def test_an_offset_of_the_torque_of_one_run_is_no_missing_effect():
    assert lg.diagnose(runs(None, 0.02), MODEL).verdict == "adequate"
