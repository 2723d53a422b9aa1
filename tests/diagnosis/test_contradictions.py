"""Records that no drive with the declared model can have are refused; odd but sound ones not."""

from dataclasses import replace

import numpy as np
import pytest

from lugrectl import diagnose
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
def test_the_torque_of_another_run_explains_nothing(plain, model):
    found = diagnose(replace(plain, u=plain.u[::-1].copy()), model)
    assert found.verdict == "unexplained"
    assert "nothing to do with the motion" in " ".join(found.messages)
    noise = np.random.default_rng(1).standard_normal(N)
    found = diagnose(replace(plain, u=noise), model)
    assert found.verdict in ("refused", "unexplained") and not found.effects


@pytest.mark.slow
def test_an_early_torque_is_a_delay(plain, model):
    found = diagnose(replace(plain, u=shifted(plain.u, -8)), model)
    assert [e.name for e in found.effects] == ["input_delay"]
    assert found.effects[0].parameters["delay"].value == pytest.approx(0.016, abs=0.002)


def test_a_late_speed_is_a_filter(plain, model):
    found = diagnose(replace(plain, w=shifted(plain.w, 10)), model)
    assert [e.name for e in found.effects] == ["velocity_sensor_lag"]


@pytest.mark.cases
@pytest.mark.parametrize("of", ["w", "theta"])
@pytest.mark.parametrize("share", [0.3, -0.3])
def test_a_copy_of_another_column_is_no_torque(plain, model, of, share):
    said = refused(replace(plain, u=share * getattr(plain, of)), model)
    assert "contradicts the declared inertia" in said


@pytest.mark.slow
def test_a_motion_of_a_few_steps_is_too_short(model):
    longer = record_of(drawn(16.0))
    q = float(np.ptp(longer.theta)) / 6
    coarse = replace(longer, w=None, theta=np.round(longer.theta / q) * q)
    assert "too short" in refused(coarse, model)
