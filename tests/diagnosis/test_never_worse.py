"""A fit is compared with the plain balance by its own noise, however far off the base is."""

import math

import numpy as np
import pytest

import lugrectl as lg

J, FC, FS, FV, VS, SIGMA0, GRAVITY, PHASE = 0.02, 0.3, 0.42, 0.02, 0.3, 200.0, 1.5, 0.3
SLOW, FAST = (0.35, 2.5), (0.2, 6.9)  # rad, rad/s of the two sines of the motion


def arm(seconds: float = 8.0, dt: float = 1e-3, fine: int = 20) -> dict[str, np.ndarray]:
    """An arm that a PD controller swings through a part of a turn; its torque is held."""
    h, n = dt / fine, round(seconds / dt)
    theta, w, z = 0.4, SLOW[0] * SLOW[1] + FAST[0] * FAST[1], 0.0
    log = np.empty((n, 3))
    for i in range(n):
        t = i * dt
        goal = 0.4 + sum(a * math.sin(b * t) for a, b in (SLOW, FAST))
        rate = sum(a * b * math.cos(b * t) for a, b in (SLOW, FAST))
        u = 40.0 * (goal - theta) + rate - w
        log[i] = t, u, theta
        for _ in range(fine):
            level = FC + (FS - FC) * math.exp(-((w / VS) ** 2))
            z = (z + h * w) / (1.0 + h * abs(w) * SIGMA0 / level)
            weight = GRAVITY * math.sin(theta + PHASE)
            w += h / J * (u - SIGMA0 * z - FV * w - weight)
            theta += h * w
    count = 2 * np.pi / 20_000
    return {"t": log[:, 0], "u": log[:, 1], "theta": np.round(log[:, 2] / count) * count}


@pytest.mark.slow
@pytest.mark.sample
def test_gravity_over_a_part_of_a_turn_leaves_the_fit_its_values():
    """Without gravity nothing fits; the noise of that fit must not judge the one with it."""
    found = lg.diagnose(arm(), {"motion": "rotary", "friction": "lugre"})
    assert found.verdict == "found" and [e.name for e in found.effects] == ["gravity"]
    assert not any("failed" in said for said in found.messages)
    for key, true in {"J": J, "Fc": FC, "Fv": FV, "Fs": FS}.items():
        assert found.estimates[key].value == pytest.approx(true, rel=0.03), key
        assert found.estimates[key].ci95 is not None
    assert found.torque_error["augmented"] < 0.02 * found.torque_error["refitted"]
    assert found.error["augmented"] < 0.02 * found.error["refitted"]
