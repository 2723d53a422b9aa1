"""Positions without jumps: wrapped angles and counters unwrapped, pasted runs cut."""

from __future__ import annotations

import numpy as np

from .stamped import Stamped

_TURNS = 16  # most turns after which a counter wraps (57 turns would look like 360 deg)


def make_continuous(log: Stamped) -> None:
    """Unwrap positions, and begin a new part where one jumps for another reason."""
    if log.motion != "rotary":
        return
    for role in ("theta", "theta_load"):
        if role in log.channels:
            log.channels[role], said = unwrapped(role, log.channels[role], log.labels.get(role))
            log.say(*said)


def unwrapped(
    role: str, theta: np.ndarray, label: str | None = None
) -> tuple[np.ndarray, list[str]]:
    """Return an angle (rad) without jumps by whole turns, and a sentence if there were any.

    Jumps by 360 mean that degrees were read as radians: the angle is then converted, too. NaN
    is skipped. An angle counts as wrapped only if it stays within the turns by which it jumps
    and is smooth without the jumps.
    """
    good = np.flatnonzero(np.isfinite(theta))
    values = theta[good]
    travel = float(np.ptp(values)) if values.size else 0.0
    for turn, most, factor in ((2 * np.pi, _TURNS, 1.0), (360.0, 1, np.pi / 180)):
        period = turn * min(max(1, round(travel / turn)), most)
        jumps = _jumps(values, period)
        if not jumps.any():
            continue
        result = theta.copy()
        result[good] = factor * np.unwrap(values, period=period)
        said = f"{role} jumps by {period:.4g} {np.count_nonzero(jumps)} times: unwrapped"
        if factor != 1.0:
            stated = f"stated in {label}" if label else "without a unit"
            said += f", and converted from deg ({stated}, but a turn is 360)"
        return result, [said + "."]
    return theta, []


def _jumps(values: np.ndarray, period: float) -> np.ndarray:
    """Return where values wrap by the period; nowhere if that does not explain the jumps."""
    steps = np.diff(values)
    jumps = np.abs(steps) > period / 2
    if not jumps.any() or np.ptp(values) > 1.02 * period:
        return np.zeros(0, bool)
    after = np.abs(np.abs(steps[jumps]) - period)
    usual = np.abs(steps[~jumps]).max(initial=0.0)
    return jumps if np.all(after <= 2 * usual + 0.01 * period) else np.zeros(0, bool)
