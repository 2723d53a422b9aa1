"""The excitation to record: within its limits, and better than its jogs alone."""

from __future__ import annotations

import json

import numpy as np
import pytest

import lugrectl as lg
from lugrectl.cli import main

from . import drives

MODEL = lg.Model.of(J=0.002, Fc=0.3)


@pytest.mark.parametrize("theta", [None, 2.0])
def test_it_stays_within_the_limits(theta):
    plan = lg.response_plan(MODEL, rate=500, w=30, u=3, theta=theta)
    speed = np.gradient(plan.theta, plan.t)
    assert np.abs(plan.w).max() <= 30 and np.abs(plan.theta).max() <= (theta or np.inf) + 1e-9
    assert np.abs(MODEL.J * np.gradient(speed, plan.t)).max() < 3 - 0.3 - 3 * plan.sine
    assert np.sum(np.diff(np.sign(speed[speed != 0])) != 0) > 20


def test_its_multisine_is_twice_friction_where_the_limits_allow_it():
    plans = [lg.response_plan(MODEL, rate=500, w=200, u=u) for u in (30, 1)]
    assert plans[0].sine == pytest.approx(0.6) and plans[1].sine < 0.2


def test_what_it_needs_is_said():
    with pytest.raises(lg.InputError, match="J must be declared"):
        lg.response_plan(lg.Model.of(Fc=0.3), rate=500, w=30, u=3)
    with pytest.raises(lg.InputError, match="does not exceed Fc"):
        lg.response_plan(MODEL, rate=500, w=30, u=0.2)


@pytest.mark.slow
def test_a_log_so_recorded_answers_better_than_its_jogs_alone():
    drive = drives.draw(5000)
    plan = lg.response_plan(
        lg.Model.of(J=drive.inertia, Fc=drive.Fc), rate=drive.rate, w=60, u=drive.most
    )
    jogs = np.diff(plan.theta, prepend=0.0) * drive.rate
    found = []
    for w in (plan.w, jogs):
        log = drives.played(drive, plan.theta, w, np.random.default_rng(1))
        one = lg.frequency_response(log, lg.Model.of())
        true = np.abs(drive.response(one.frequency))
        found.append((one.certain.mean(), np.median(np.abs(np.log(one.magnitude / true)))))
    (sure, error), (sure_alone, error_alone) = found
    assert sure > 1.3 * sure_alone and error < 0.5 * error_alone


def test_the_command_writes_it(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    lg.write_model(MODEL, "my.toml")
    asked = ["bode", "--model", "my.toml", "--plan", "x.csv", "--rate", "500"]
    assert main([*asked, "--limits", "w=30,u=3,theta=2", "--json"]) == 0
    made = json.loads(capsys.readouterr().out)
    rows = np.loadtxt("x.csv", delimiter=",", skiprows=1)
    assert np.allclose(rows[:, 1], made["w"]) and len(rows) == 15000
    assert main([*asked, "--limits", "w=30"]) == 2 and main([*asked, "--limits", "v=3"]) == 2
