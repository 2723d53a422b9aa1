"""Gravity and a constant torque over a small angle.

There gravity is A sin(theta + phi) = b cos(x) + a sin(x), x = theta - middle. Its slope a is seen
early, its part b in the constant only by how the torque bends.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .constants import STEEP
from .fit import Fit

CONSTANT, SLOPE, BEND = "constant_torque", "slope", "bend"


def separated(made: Fit, V: np.ndarray) -> tuple[Fit, np.ndarray]:
    """The fit, and its covariance, with gravity's part in the constant taken off the constant.

    The fit has (constant + b) and the bend b (cos(x) - 1). With any phase alike, b / a is the
    tangent of an even angle: ``b`` has the prior STEEP^2 (a^2 + var a). Without the prior, a record
    in which no bend can be seen would know nothing of a constant torque that no gravity disturbs.
    """
    if not {CONSTANT, SLOPE, BEND} <= {*made.names}:
        return made, V
    k, a, b = (made.names.index(key) for key in (CONSTANT, SLOPE, BEND))
    prior = STEEP**2 * (made.p[a] ** 2 + V[a, a])
    gain = V[:, b] / (V[b, b] + prior)
    p, V = made.p - gain * made.p[b], V - np.outer(gain, V[b])
    change = np.eye(len(p))
    change[k, b] = -1.0
    return replace(made, p=change @ p), change @ V @ change.T
