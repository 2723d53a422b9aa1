"""A speed that was recorded alone and is half a sample late is a position's difference."""

from types import SimpleNamespace

import numpy as np
import pytest

from lugrectl.tracing.late import LAG, halfway

STEP, NOISE = 2e-4, 1e-4


@pytest.mark.parametrize(
    "effect, samples, theta, step, answer",
    [
        (LAG, 0.5, np.nan, 0.0, True),
        (LAG, 0.9, np.nan, 0.0, False),
        (LAG, 0.5, 1e-6, 0.0, False),
        ("input_delay", 0.5, np.nan, STEP, True),
        ("input_delay", 0.5, np.nan, 0.0, False),
        ("actuator_lag", 0.5, np.nan, STEP, True),
        ("gravity", 0.5, np.nan, STEP, False),
    ],
)
def test_half_a_sample_late_is_a_difference(effect, samples, theta, step, answer):
    noise = SimpleNamespace(theta=theta, w=NOISE)
    data = SimpleNamespace(dt=0.005, counts=(0.0, step), noise=noise)
    time = "delay" if effect == "input_delay" else "time_constant"
    final = SimpleNamespace(
        predictor=SimpleNamespace(data=data), values={f"{effect}.{time}": samples * data.dt}
    )
    assert halfway(final, [effect]) is answer
