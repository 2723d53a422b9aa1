"""Runs at steady speed: each is a point with a scatter of its own, and few leave much open."""

import numpy as np
import pytest

import lugrectl as lg

FC, FS, FV, VS = 0.3, 0.4, 0.02, 2.0
STRIBECK = lg.Model.of(friction="stribeck")
SPEEDS = (-16.0, -8.0, -4.0, -2.0, 2.0, 4.0, 8.0, 16.0)
MORE = (*SPEEDS, *(1.5 * w for w in SPEEDS))


def steady(speeds, fall=0.0, drag=0.0, *, vs=VS, Fv=FV, seed=0, scatter=1e-3, samples=200, dt=5e-3):
    """Runs at these speeds: friction, the scatter of each run, and noise of the samples."""
    chance, runs = np.random.default_rng(seed), []
    for w in speeds:
        level = FC + fall * np.exp(-((w / vs) ** 2))
        u = level * np.sign(w) + Fv * w + drag * w * abs(w) + scatter * chance.standard_normal()
        noise = 1e-3 * chance.standard_normal((2, samples))
        runs.append({"t": dt * np.arange(samples), "w": w + noise[0], "u": u + noise[1]})
    return runs


def both_ways(speeds, **more):
    return steady([*speeds, *(-w for w in speeds)], **more)


def covers(e, truth):
    return e.ci95 is not None and e.ci95[0] <= truth <= e.ci95[1]


@pytest.mark.slow
def test_intervals_hold_although_runs_differ_by_more_than_their_noise():
    """The noise of the samples alone would give a tenth of the width."""
    found = [lg.balance(steady(SPEEDS, seed=seed, scatter=0.01)) for seed in range(6)]
    for key, truth in (("Fc", FC), ("Fv", FV), ("constant_torque", 0.0)):
        held = [covers((plain.parameters | plain.uncertain)[key], truth) for plain in found]
        assert sum(held) >= 5, key


def test_a_fall_at_low_speed_is_none_of_the_level():
    """Friction falls with speed below 3 rad/s: the level is that of the fast runs."""
    plain = lg.balance(steady(MORE, fall=0.15, vs=3.0, seed=2))
    assert covers(plain.parameters["Fc"], FC) and covers(plain.parameters["Fv"], FV)
    assert plain.left < 0.01


SLOWEST_8 = np.linspace(8.0, 30.0, 5)


def test_a_fall_below_the_slowest_run_stays_open():
    found = lg.diagnose(both_ways(SLOWEST_8, fall=FS - FC), STRIBECK)
    assert found.verdict == "adequate"
    assert not any(k in found.estimates and found.estimates[k].ci95 for k in ("Fs", "vs"))
    assert "slower than 8 rad/s" in found.experiment
    assert covers(found.estimates["Fc"], FC)


def test_a_declared_fall_that_no_run_shows_stays_as_declared():
    model = lg.Model.of(friction="stribeck", Fc=FC, Fs=FS, Fv=FV, vs=VS)
    found = lg.identify(both_ways(SLOWEST_8, fall=FS - FC), model)
    assert found.model.friction.values["Fs"] == FS and found.model.friction.values["vs"] == VS


@pytest.mark.slow
def test_drag_is_named_beside_a_law_whose_fall_could_imitate_it():
    """Where it is large, a fit without it has little Coulomb friction, and a start of Fs."""
    runs = both_ways(np.geomspace(1.5, 40.0, 6), drag=8e-4)
    found = lg.diagnose(runs, lg.Model.of(J=0.005, friction="lugre"))
    assert [e.name for e in found.effects] == ["quadratic_drag"]
    assert found.effects[0].parameters["coefficient"].value == pytest.approx(8e-4, rel=0.02)
    assert found.estimates["Fc"].value == pytest.approx(FC, rel=0.02)
    assert "Fs" not in found.estimates


def test_as_many_values_as_runs_test_nothing():
    found = lg.diagnose(both_ways([2.0, 8.0, 30.0])[:4], STRIBECK)
    assert found.verdict == "refused" and "nothing can be tested" in found.reason
    assert "more speeds" in found.experiment and found.plain.is_map
