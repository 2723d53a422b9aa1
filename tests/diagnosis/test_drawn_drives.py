"""Drawn drives: speeds that are none of a sensor, and several runs of one drive."""

import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import butter, filtfilt, lfilter

from lugrectl import Model, diagnose, identify
from tests.drives import make

from ..cases.common import model_of, record_of
from ..commissioning.drives import draw, log

pytestmark = pytest.mark.slow
SERVO = {"machine": "servo", "seed": 4104, "rate": 500.0, "duration": 14.0}


@pytest.fixture(scope="module")
def case():
    return make("none", machine="joint", excitation="stopgo", seed=4107, rate=500.0, duration=20.0)


@pytest.fixture(scope="module")
def counted(case):
    """A coarse encoder with its plain difference, which is no second sensor."""
    record = record_of(case)
    count = np.ptp(record.theta) * 1e-5
    theta = np.round(record.theta / count) * count
    return replace(record, theta=theta, w=np.diff(theta, prepend=theta[0]) / record.dt)


def test_the_noise_of_a_filtered_speed_is_no_missing_effect(case, counted):
    w = filtfilt(*butter(2, 80.0 * counted.dt), counted.w)
    assert diagnose(replace(counted, theta=None, w=w), model_of(case)).verdict == "adequate"


@pytest.mark.sample
def test_a_late_speed_that_repeats_theta_is_no_effect_and_its_lag_is_said(case, counted):
    """It is the logger's filter, not a sensor of the drive."""
    late = replace(counted, w=lfilter(*butter(1, 40.0 * counted.dt), counted.w))
    lag = 1e3 / (2.0 * np.pi * 20.0) + 0.5e3 * late.dt  # ms: a difference is half a sample late
    result = diagnose(late, model_of(case))
    assert result.verdict == "adequate"
    (said,) = [m for m in result.messages if re.match(r"w is \S+ ms behind", m)]
    assert float(said.split()[2]) == pytest.approx(lag, rel=0.05)


@pytest.fixture(scope="module")
def runs():
    """Two runs of a drive; the second with an offset on its torque and more friction."""
    made = make("none", excitation="rich", **SERVO)
    second = record_of(make("none", excitation="moves", **SERVO))
    friction = 0.05 * np.sign(second.w) * made.truth["plant"]["Fc"]
    return record_of(made), replace(second, u=second.u + friction + 0.011), model_of(made)


@pytest.mark.sample
def test_offset_and_friction_of_a_run_leave_the_values_of_the_drive(runs):
    first, second, model = runs
    found, alone = identify([first, second], model), identify(first, model)
    for k in ("J", "Fc", "Fv"):
        assert found.estimates[k].value == pytest.approx(alone.estimates[k].value, rel=0.03)
    assert not any("run 2" in m for m in alone.messages)
    assert set(found.estimates) == set(alone.estimates)
    assert found.declared is model and found.provenance.command == "lugrectl.identify"


def test_a_ripple_of_another_phase_in_a_held_out_run_is_named():
    """Runs whose theta starts anywhere."""
    case = make("torque_ripple", machine="joint", excitation="moves", seed=7000, rate=500.0,
                duration=20.0, runs=2, load=False)  # fmt: skip
    result = diagnose(record_of(case), model_of(case), holdout=record_of(case.more[0]))
    assert (result.verdict, [e.name for e in result.effects]) == ("found", ["torque_ripple"])
    for name, true in case.truth["parameters"].items():
        assert result.effects[0].parameters[name].value == pytest.approx(true, rel=0.01)


@pytest.mark.parametrize("seed", [pytest.param(9030, marks=pytest.mark.sample), 9015])
def test_a_load_behind_a_spring_is_no_gap(seed):
    """Jogs and a multisine through the resonance; with the whole inertia held, a gap explained
    more."""
    drive = draw(seed)
    record = {k: v for k, v in log(drive, 20.0).items() if k != "r"}
    found = diagnose(record, Model.of(friction="lugre"))
    assert found.verdict == "found" and found.effects[0].name == "elastic_coupling"
    assert "backlash" not in [effect.name for effect in found.effects]
    own = found.effects[0].parameters
    assert own["load_inertia"].value == pytest.approx(drive.masses[1], rel=0.03)
    assert own["stiffness"].value == pytest.approx(drive.springs[0], rel=0.03)
