"""Low-pass filter of a recorded speed that is not used in the fit."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

import numpy as np

from ..spec import members
from .data import Data
from .fit import Fitted, again
from .predictor import Predictor

LAG = "velocity_sensor_lag"
LATE = (LAG, "actuator_lag", "input_delay")
HALF = (0.4, 0.6)  # samples by which a speed computed as a position difference is late
HEAVY = 30.0  # times its own noise: such a speed determines the filter and hardly anything else


def with_lag(final: Fitted) -> Fitted:
    """The fitted model with the first-order lag by which the recorded speed is late."""
    data, heavy = final.predictor.data, _heavy(final.predictor.data)
    model = final.predictor.model.with_effect(LAG, {"time_constant": data.late})
    values = {f"{LAG}.time_constant": data.late}
    return again(
        replace(
            final,
            predictor=Predictor(model, heavy),
            values=final.values | values,
            anchor=final.anchor | values,
            noise=replace(final.noise, w=heavy.noise.w),
        )
    )


def halfway(final: Fitted, effects: Collection[str]) -> bool:
    """True if a speed recorded without a position has the lag of a position difference.

    Without a position, a late torque looks the same as a late speed. If the speed comes in steps
    of a counter, a late torque is therefore also taken for the lag of the speed.
    """
    data, (low, high) = final.predictor.data, HALF
    if not np.isnan(data.noise.theta):
        return False
    steps = data.counts[1] > data.noise.w
    late = {name for name in effects if name in (LATE if steps else (LAG,))}
    times = (final.values[f"{name}.{members('effect')[name].gain}"] for name in late)
    return any(low < time / data.dt < high for time in times)


def _heavy(data: Data) -> Data:
    """The data with that speed as a second sensor that has a large noise."""
    assert data.w is not None
    y = np.column_stack([data.y[:, 0], data.w])
    return replace(data, y=y, w=None, noise=replace(data.noise, w=HEAVY * data.floor))
