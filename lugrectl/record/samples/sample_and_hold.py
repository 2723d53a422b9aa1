"""Channels that are renewed only every k-th row: sampled more slowly than they were logged."""

from __future__ import annotations

import numpy as np

from .clock import typical_step
from .rows import Stamped

_MOST = 64  # rows; a channel held for longer is one that stands
_SURE = 0.97  # of its changes come every k-th row
_FEWEST = 20  # changes that show it


def renewed_every(x: np.ndarray) -> tuple[int, int]:
    """Every how many rows a channel (N,) changes, and the row (below that) where; (1, 0) if it may
    change in any row. NaN counts as no change."""
    good = np.flatnonzero(np.isfinite(x))
    at = good[1:][np.diff(x[good]) != 0]
    if len(at) < _FEWEST:
        return 1, 0
    # each change off the beat spoils two distances at most
    if np.count_nonzero(np.diff(at) == 1) > 2 * (1 - _SURE) * len(at) + 1:
        return 1, 0
    for every in range(_MOST, 1, -1):
        shares = np.bincount(at % every, minlength=every) / len(at)
        if shares.max() >= _SURE and len(at) >= max(_FEWEST, 0.1 * len(x) / every):
            return every, int(shares.argmax())
    return 1, 0


def keep_renewed(log: Stamped) -> None:
    """Keep the rows that were sampled; leave out a second motion signal that is slower.

    A torque that is stepped between a few levels is held on purpose: its rows stay.
    """
    found = {role: renewed_every(log.channels[role]) for role in log.required}
    found = {role: (every, row) for role, (every, row) in found.items() if every > 1}
    if not found:
        return
    dt = typical_step(np.diff(log.t)[~log.new[1:]])
    motion = [role for role in ("theta", "w") if role in log.channels]
    slow = [role for role in motion if role in found]
    if len(motion) == 2 and len(slow) == 1:
        (role,) = slow
        other = "theta" if role == "w" else "w"
        _say(log, role, found.pop(role)[0] * dt, f": left out, as {other} is renewed in every row")
        del log.channels[role]
        slow = []
    if "u" in found and not slow and _has_levels(log.channels["u"], *found["u"]):
        del found["u"]
    if found:
        every, row = max(found.values())
        _say(log, " and ".join(found), every * dt, ": only these rows are used")
        log.keep(np.arange(len(log.t)) % every == row)


def _say(log: Stamped, names: str, step: float, then: str) -> None:
    verb = "are" if " and " in names else "is"
    log.say(f"{names} {verb} renewed only every {1e3 * step:.4g} ms{then}.")


def _has_levels(u: np.ndarray, every: int, row: int) -> bool:
    """Whether a torque takes the same values again and again, as a program of steps does."""
    samples = u[row::every]
    samples = samples[np.isfinite(samples)]
    return len(np.unique(samples)) < 0.3 * len(samples)
