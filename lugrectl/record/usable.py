"""What of a log can be used: rows in time, without bad samples, positions without jumps."""

from __future__ import annotations

from .bad_samples import leave_out_bad_samples
from .clock import put_in_time
from .held import keep_renewed
from .log import Log
from .position import make_continuous
from .stamped import Stamped
from .torque import leave_out_untrue_torque


def usable(log: Log) -> Stamped:
    """The rows of a log that can be used, each finding as a sentence.

    Stamps are put in order, bad samples become nan, wrapped positions are unwrapped, and a part
    begins where time or position do not go on. Nothing is filled in or resampled.
    """
    made = Stamped.of(log)
    put_in_time(made)
    leave_out_bad_samples(made)
    make_continuous(made)
    keep_renewed(made)
    leave_out_untrue_torque(made)
    return made
