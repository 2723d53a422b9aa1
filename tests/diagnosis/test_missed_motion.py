"""The error of a simulation and the torque that is not explained are compared, not left side by
side."""

import numpy as np
import pytest

from lugrectl.diagnosis.missed_motion import missed_motion, moved

J, FV = 0.002, 0.02
VALUES = {"J": J, "Fv": FV}


def error(missed, signal="theta", unit="rad"):
    return {"signal": signal, "unit": unit, "augmented": missed, "noise_floor": 1e-4,
            "horizon": 1.0}  # fmt: skip


@pytest.mark.parametrize("Fv", [0.0, 1e-5, FV, 2.0])
@pytest.mark.parametrize("position", [True, False])
def test_a_held_torque_moves_a_drive_as_its_equation_says(Fv, position):
    w = theta = 0.0
    h = 1e-5
    for _ in range(50_000):
        rate = (0.001 - Fv * w) / J
        theta, w = theta + h * (w + 0.5 * h * rate), w + h * rate
    assert moved(0.001, 0.5, J, Fv, position) == pytest.approx(theta if position else w, rel=5e-3)


def test_an_error_that_the_left_torque_may_be_agrees_with_it():
    (said,) = missed_motion(error(0.01), 0.001, "N m", VALUES)
    assert "0.0010 N m" in said and "up to 0.045 rad in 1 s" in said and "agrees" in said


def test_a_larger_one_comes_from_how_the_drive_breaks_away():
    (said,) = missed_motion(error(0.2), 0.001, "N m", VALUES)
    assert "misses 0.20 rad" in said and "breaks away" in said


def test_noise_wants_no_reason():
    assert missed_motion(error(2e-4), 1e-6, "N m", VALUES) == []
    assert missed_motion(error(None), 1e-6, "N m", VALUES) == []
    assert np.isfinite(moved(1e-6, 1.0, J, 0.0, True))
