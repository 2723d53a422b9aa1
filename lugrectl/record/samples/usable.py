"""What of a log can be used: rows in time, without bad samples, positions without jumps."""

from __future__ import annotations

import numpy as np

from ..log import Log
from . import bad_samples
from .clock import keep_renewed, put_in_time, use_true_times
from .needed_torque import leave_out_untrue_torque, unwrap_torque
from .rows import Stamped, smallest_steps


def usable(log: Log) -> Stamped:
    """A copy of the usable rows of a log, which are kept with it; each finding is a sentence."""
    checksum = log.checksum()
    if checksum not in log.kept:
        log.kept.clear()
        log.kept[checksum] = _found(log)
    return log.kept[checksum].copy()


def _found(log: Log) -> Stamped:
    made = Stamped.of(log)
    for role in ("d", "theta_load"):
        if role in made.channels and not made.channels[role].any():
            del made.channels[role]
            made.say(f"{role} is 0 in every row: left out.")
    for role, other in (("w", "theta"), ("theta", "w"), ("d", "u")):
        if {role, other} <= set(made.channels):
            share, usual = (np.isfinite(made.channels[r]).mean() for r in (role, other))
            if share < 0.5 * usual:  # it holds next to no number
                del made.channels[role]
                made.say(f"{role} has a number in {100 * share:.2g} % of the rows: left out.")
    put_in_time(made)
    bad_samples.say_missing(made)
    for role in made.motion_roles:
        bad_samples.leave_out_code(made, role)
        bad_samples.leave_out_outliers(made, role)
    bad_samples.unwrap_positions(made)
    use_true_times(made)
    bad_samples.cut_at_jumps(made)
    made.steps = smallest_steps(made.channels)  # a bad sample would hide them
    unwrap_torque(made)  # its wraps would look like bad samples
    bad_samples.leave_out_code(made, "u")
    bad_samples.leave_out_outliers(made, "u")
    keep_renewed(made)
    leave_out_untrue_torque(made)
    return made
