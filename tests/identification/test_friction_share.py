"""What counts as friction, of which all torques are shares."""

from __future__ import annotations

import numpy as np
import pytest

import lugrectl as lg
from lugrectl.core.numeric import rms
from lugrectl.identification.balance import balance
from lugrectl.identification.candidates.base_model import LEVELS
from lugrectl.identification.selection.compare import record_of
from lugrectl.identification.selection.verdict import decide
from lugrectl.record import read_log, stretches

MODEL = lg.Model.of(friction="coulomb")


def slow_joint():
    """A geared joint that swings slowly and sticks at each end, while its torque turns over."""
    rng, t = np.random.default_rng(0), 0.01 * np.arange(340)
    swing = np.cos(2.3 * t)
    w = 1.4 * np.sign(swing) * np.maximum(np.abs(swing) - 0.12, 0.0)
    u = 1.1 * np.clip(swing / 0.12, -1, 1) + 0.05 * np.gradient(w, t)
    noise = rng.standard_normal((2, len(t)))
    theta, w = np.cumsum(w) * 0.01, w + 0.08 * noise[0] * (w != 0)
    log = {"t": t, "u": u + 0.25 * noise[1], "w": np.round(w / 0.0088) * 0.0088}
    return log | {"theta": np.round(theta / 3.8e-4) * 3.8e-4}


def test_friction_is_all_of_its_shapes():
    """Near rest its shapes are large and cancel: what some of them add up to is no torque."""
    found, _ = stretches([read_log(slow_joint())])
    with np.errstate(all="ignore"):
        base = decide(record_of(found, MODEL, balance(found, MODEL))).table.base
    assert abs(base.made.b[LEVELS][-1]) > 0.01  # what noise smears of a reversal
    friction = rms(base.columns.X[:, LEVELS] @ base.made.b[LEVELS])
    assert base.friction_rms == pytest.approx(friction, rel=1e-6)
