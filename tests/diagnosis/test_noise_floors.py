"""The noise beside an error is that of the sensors, whatever the motion and the model."""

import numpy as np
import pytest

from lugrectl import Model, diagnose
from lugrectl.record.signal_noise import sensor_noise, smallest_step
from lugrectl.report import text

from ..cases.balance_drive import FC, simulate, torque

SIGMA = 1e-4
NOISE = np.random.default_rng(0).normal(0.0, SIGMA, 4000)


def test_a_motion_in_one_direction_is_no_resolution():
    """The smallest change of an angle that never stops is a part of its motion."""
    t = 1e-3 * np.arange(4000)
    theta = 20.0 * t + np.sin(3.0 * t) + NOISE
    assert smallest_step(theta) == smallest_step(-theta) == 0.0
    assert sensor_noise(theta) == pytest.approx(SIGMA, rel=0.1)


def test_counts_are_seen_where_the_motion_rests_or_turns_back():
    count, t = 2.0 * np.pi / 4096, 1e-3 * np.arange(4000)
    for theta in (np.sin(3.0 * t), 0.5 * t):
        assert smallest_step(np.floor(theta / count) * count) == pytest.approx(count)


def rounded(theta):
    return np.floor(theta * 1024 / np.pi) * np.pi / 1024


def noisy(theta):
    return theta + np.resize(NOISE, len(theta))


@pytest.mark.cases
@pytest.mark.parametrize("seen", [rounded, noisy], ids=["counts", "white noise"])
def test_the_noise_of_the_torque_is_what_a_right_model_leaves(seen):
    """With an effect that the declared model does not contain."""
    dt = 2e-3
    u = torque(7.0, dt, seed=3)
    theta, _ = simulate(u, dt, load=lambda theta, w: 0.03 * np.sin(6.0 * theta))
    log = {"t": dt * np.arange(len(u)), "u": u, "theta": seen(theta)}
    found = diagnose(log, Model.of(J=0.004, Fc=FC, Fv=0.006))
    error = found.torque_error
    assert 0.8 * error["augmented"] < error["noise_floor"] <= error["augmented"]
    said = " ".join(text(found).split())
    assert "The torque is that of single samples, and so is its noise." in said
