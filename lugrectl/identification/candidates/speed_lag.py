"""A measured speed that lags the position, as a row of the table.

No torque shows it: w(t) = dtheta/dt (t - lag) is a fact of the two signals, and the motion of the
record is corrected for it before anything else. Here it is named, with the torque that it would
have cost: J lag d2w/dt2.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .base_model import Base, rms
from .candidate import Contender, Entry

NAME = "velocity_sensor_lag"
TORQUE_LAG = "actuator_lag"


def row(base: Base) -> Contender | None:
    """The row, or None where w is missing or was computed from theta."""
    if base.record.lag is None:
        return None
    lag, se = base.record.lag
    m = base.record.motion
    jerk = np.asarray(base.record.rows.narrow @ m.slope(base.record.motion.stiff))
    torque = base.J * lag * jerk
    gain = 0.5 * (lag / max(se, 1e-12)) ** 2 if lag > 0 else 0.0
    return Contender(
        entry=Entry(NAME, {"time_constant": lag}),
        base=base,
        columns=base.columns,
        made=base.made,
        own=0,
        blocks=base.score + gain / len(base.score),
        torque=torque,
        J=base.J,
        whole=rms(torque) / base.friction_rms,
    )


def sure(c: Contender) -> bool:
    """Whether the lag is beyond half a sample and five of its standard errors."""
    assert c.base.record.lag is not None
    lag, se = c.base.record.lag
    late = lag > max(5 * se, 0.5 * c.base.record.motion.dt)
    return late and bool(np.isfinite(rms(c.torque)))


def instead_of(c: Contender) -> list[Contender]:
    """A late speed in place of a lag of the torque, where no angle was recorded: the balance of
    one is that of the other but for friction near rest."""
    alone = c.base.record.motion.measured[0] is None
    if c.name != TORQUE_LAG or not alone:
        return []
    return [replace(c, entry=replace(c.entry, name=NAME))]
