"""A run at steady speed is one point of the friction curve, with a scatter of its own."""

import numpy as np

import lugrectl as lg

FC, FV = 0.3, 0.02
SPEEDS = (-16.0, -8.0, -4.0, -2.0, 2.0, 4.0, 8.0, 16.0)


def steady(speeds, seed=0, scatter=0.01, samples=200, dip=0.0, drag=0.0):
    """Runs at these speeds: friction, the scatter of each run, and noise of the samples."""
    chance, runs = np.random.default_rng(seed), []
    for w in speeds:
        friction = (FC + dip * np.exp(-((w / 3.0) ** 2))) * np.sign(w) + FV * w
        friction += drag * w * abs(w)
        u = friction + scatter * chance.standard_normal()
        run = {"t": 5e-3 * np.arange(samples), "u": u + 1e-3 * chance.standard_normal(samples)}
        runs.append(run | {"w": w + 1e-3 * chance.standard_normal(samples)})
    return runs


def covers(e, truth):
    return e.ci95 is not None and e.ci95[0] <= truth <= e.ci95[1]


def test_intervals_hold_although_runs_differ_by_more_than_their_noise():
    """The noise of the samples alone would give a tenth of the width."""
    found = [lg.balance(steady(SPEEDS, seed)) for seed in range(24)]
    for key, truth in (("Fc", FC), ("Fv", FV), ("constant_torque", 0.0)):
        held = [covers((plain.parameters | plain.uncertain)[key], truth) for plain in found]
        assert sum(held) >= 21, key


def test_longer_runs_tell_no_more_of_friction():
    short, long = (lg.balance(steady(SPEEDS, 1, samples=n)) for n in (200, 1600))
    widths = [np.ptp(plain.parameters["Fc"].ci95) for plain in (short, long)]
    assert widths[1] > 0.8 * widths[0]
    more = lg.balance(steady(4 * SPEEDS, 1))
    assert np.ptp(more.parameters["Fc"].ci95) < 0.75 * widths[0]


def test_each_run_is_a_point_of_the_curve():
    plain = lg.balance(steady(SPEEDS))
    assert [round(point.w) for point in plain.curve] == [round(w) for w in SPEEDS]
    held = [covers(point, FC * np.sign(point.w) + FV * point.w) for point in plain.curve]
    assert sum(held) >= len(SPEEDS) - 1


def test_a_fall_at_low_speed_is_none_of_the_level():
    """Friction falls with speed below 3 rad/s: the level is that of the fast runs."""
    plain = lg.balance(steady([*SPEEDS, *(1.5 * w for w in SPEEDS)], 2, 1e-3, dip=0.15))
    assert covers(plain.parameters["Fc"], FC) and covers(plain.parameters["Fv"], FV)
    assert plain.left < 0.01


def test_a_declared_drag_is_not_counted_twice():
    model = lg.Model.of().with_effect("quadratic_drag", {"coefficient": 5e-3})
    plain = lg.balance(steady([*SPEEDS, *(1.5 * w for w in SPEEDS)], 2, 1e-3, drag=5e-3), model)
    found = plain.parameters["quadratic_drag.coefficient"]
    assert covers(found, 5e-3) and np.ptp(found.ci95) < 0.1 * 5e-3
