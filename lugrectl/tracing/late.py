"""The filter behind which a speed comes that was left out of the fit."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .data import Data
from .fit import Fitted, again
from .predictor import Predictor

LAG = "velocity_sensor_lag"
HALF = (0.4, 0.6)  # samples by which a position's difference is late
HEAVY = 30.0  # times its own noise: that speed tells the filter, and hardly anything else


def with_lag(final: Fitted) -> Fitted:
    """The fitted model with the first-order lag that makes the recorded speed late."""
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


def halfway(final: Fitted) -> bool:
    """Whether a speed that was recorded alone has the lag of a position's difference."""
    data, (low, high) = final.predictor.data, HALF
    late = final.values[f"{LAG}.time_constant"] / data.dt
    return bool(np.isnan(data.noise.theta)) and low < late < high


def _heavy(data: Data) -> Data:
    """The data with that speed as a second, poor sensor."""
    assert data.w is not None
    y = np.column_stack([data.y[:, 0], data.w])
    return replace(data, y=y, w=None, noise=replace(data.noise, w=HEAVY * data.floor))
