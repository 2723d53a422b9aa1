"""Records that no drive with the declared model can have are refused; odd but sound ones not."""

import math
from dataclasses import replace

import numpy as np
import pytest

from lugrectl import diagnose
from lugrectl.record import Record
from tests.drives import make

from ..cases.common import model_of, record_of

RATE, N = 500.0, 5000
T = np.arange(N) / RATE


@pytest.fixture(scope="module")
def case():
    return drawn(N / RATE)


def drawn(seconds):
    return make("none", machine="stage", excitation="torque", seed=31, rate=RATE, duration=seconds)


@pytest.fixture(scope="module")
def plain(case):
    return record_of(case)


@pytest.fixture(scope="module")
def model(case):
    return model_of(case)


@pytest.fixture(scope="module")
def rotary(model):
    return replace(model, motion="rotary", J=0.01)


def refused(record, model):
    found = diagnose(record, model)
    assert found.verdict == "refused"
    return found.reason


def shifted(x, k):
    """x, k samples later."""
    return np.concatenate([np.full(max(k, 0), x[0]), x[max(-k, 0) : len(x) - max(k, 0)],
                           np.full(max(-k, 0), x[-1])])  # fmt: skip


@pytest.mark.slow
@pytest.mark.sample
def test_the_torque_of_another_run_explains_nothing(plain, model):
    found = diagnose(replace(plain, u=plain.u[::-1].copy()), model)
    assert found.verdict == "unexplained"
    assert "nothing to do with the motion" in " ".join(found.messages)
    noise = np.random.default_rng(1).standard_normal(N)
    found = diagnose(replace(plain, u=noise), model)
    assert found.verdict in ("refused", "unexplained") and not found.effects


def test_an_early_torque_is_a_delay(plain, model):
    found = diagnose(replace(plain, u=shifted(plain.u, -8)), model)
    assert [e.name for e in found.effects] == ["input_delay"]
    assert found.effects[0].parameters["delay"].value == pytest.approx(0.016, abs=0.002)


@pytest.mark.cases
@pytest.mark.parametrize("early", [1, 2, 10])
def test_an_early_speed_beside_the_position_changes_nothing(plain, model, early):
    assert diagnose(replace(plain, w=shifted(plain.w, -early)), model).verdict == "adequate"


def test_a_late_speed_is_a_filter(plain, model):
    found = diagnose(replace(plain, w=shifted(plain.w, 10)), model)
    assert [e.name for e in found.effects] == ["velocity_sensor_lag"]


@pytest.mark.slow
@pytest.mark.sample
def test_a_drive_that_coasts_most_of_the_time_is_sound(rotary):
    """Kicked by a held torque, one way and the other, and left alone."""
    rng, dt, w = np.random.default_rng(0), 1 / RATE, 0.0
    kicks, u, speed = rng.uniform(0.8, 2.0, N), np.zeros(N), np.zeros(N)
    for k in range(N):
        speed[k] = w + 1e-3 * rng.standard_normal()
        u[k] = kicks[k // 50] * (1.0 if T[k] % 4 < 2 else -1.0) * (T[k] % 2 < 0.5)
        pull = float(u[k])
        for _ in range(10):
            w += 0.1 * dt / 0.01 * (pull - 0.2 * math.tanh(w / 0.02) - 0.05 * w)
    assert np.mean(u == 0.0) > 0.5
    assert diagnose(Record(T, u, speed, dt=dt), rotary).verdict == "adequate"


@pytest.mark.cases
@pytest.mark.parametrize("of", ["w", "theta"])
@pytest.mark.parametrize("share", [0.3, -0.3])
def test_a_copy_of_another_column_is_no_torque(plain, model, of, share):
    said = refused(replace(plain, u=share * getattr(plain, of)), model)
    assert "contradicts the declared inertia" in said


def test_a_motion_of_a_few_steps_is_too_short(model):
    longer = record_of(drawn(16.0))
    q = float(np.ptp(longer.theta)) / 6
    coarse = replace(longer, w=None, theta=np.round(longer.theta / q) * q)
    assert "too short" in refused(coarse, model)


def test_the_fit_takes_a_late_torque_earlier(case, plain, model):
    d = diagnose(replace(plain, u=shifted(plain.u, 25)), model)
    assert d.verdict == "adequate" and "comes 50 ms late" in " ".join(d.messages)
    assert d.model.J == pytest.approx(case.truth["plant"]["J"], rel=1e-3)
    assert d.error["refitted"] < 10.0 * d.error["noise_floor"]
