"""Channels that are renewed only every k-th row: sampled more slowly than they were logged."""

from __future__ import annotations

import numpy as np

from .clock import typical_step, use_true_times
from .rows import Stamped, means_from

_MOST = 64  # rows; a channel held for longer is one that stands
_SURE = 0.97  # of its changes come every k-th row
_FEWEST = 20  # changes that show it
_ROUNDED = 1e-6  # rows, for rounding


def renewed_every(x: np.ndarray) -> tuple[float, float]:
    """Every how many rows (2.5, if it has a clock of its own) a channel (N,) changes, and the place
    below that where; (1, 0) if it may change in any row. NaN counts as no change."""
    good = np.flatnonzero(np.isfinite(x))
    changes = np.diff(x[good])
    at = good[1:][changes != 0]
    # each change off the beat spoils two distances at most
    if len(at) < _FEWEST or np.sum(np.diff(at) == 1) > 2 * (1 - _SURE) * len(at) + 1:
        return 1, 0
    for every in range(_MOST, 1, -1):
        shares = np.bincount(at % every, minlength=every) / len(at)
        if shares.max() >= _SURE and len(at) >= max(_FEWEST, 0.1 * len(x) / every):
            return every, int(shares.argmax())
    every, first = _beat(at, len(x))
    on_beat = np.mean((at - first) % every < 1.0)
    held = on_beat >= _SURE and len(at) >= max(_FEWEST, 0.1 * len(x) / every)
    size = np.abs(changes[changes != 0])  # nearly all of one: an encoder at one speed, no beat
    counts = np.mean(np.abs(size - np.median(size)) < 1e-6 * np.median(size)) >= _SURE
    return (every, first) if held and every <= _MOST and not counts else (1, 0)


def _beat(at: np.ndarray, rows: int) -> tuple[float, float]:
    """The even beat that most changes, in the rows ``at``, are the first row of or after."""
    steps = np.diff(at)
    least = np.quantile(steps, 1 - _SURE, method="higher")  # one of them: there may be few
    rough = float(np.mean(steps[(steps >= least) & (steps <= least + 1)]))
    size = int(2 ** np.ceil(np.log2(4 * rows)))
    spectrum = np.abs(np.fft.rfft(np.bincount(at, minlength=rows), size))
    low, high = (int(round(size / (rough + off))) for off in (0.5, -0.5))
    every = size / (low + int(np.argmax(spectrum[low : high + 1])))
    start = np.angle(np.mean(np.exp(2j * np.pi * at / every))) * every / (2 * np.pi)
    for _ in range(2):
        beat = np.rint((at - start) / every)
        every, start = np.polyfit(beat, at, 1)
    after = at - every * np.rint((at - start) / every)
    return float(every), float(np.quantile(after, 0.5 * (1 - _SURE)) - _ROUNDED) % float(every)


def keep_renewed(log: Stamped) -> None:
    """Keep the rows that were sampled; leave out a second motion signal that is slower. A torque
    that is stepped between a few levels stays; one that is renewed more often is averaged."""

    def say(names: str, every: float, then: str) -> None:
        verb = "are" if " and " in names else "is"
        log.say(f"{names} {verb} renewed only every {1e3 * every * dt:.4g} ms{then}.")

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
        say(role, found.pop(role)[0], f": left out, as {other} is renewed in every row")
        del log.channels[role]
        slow = []
    if "u" in found and not slow:
        values = log.channels["u"][_rows(*found["u"], len(log.t))]
        values = values[np.isfinite(values)]
        if len(np.unique(values)) < 0.3 * len(values):  # the same again and again: a program
            del found["u"]
    if found:
        every, first = max(found.values())
        say(" and ".join(found), every, ": only these rows are used")
        rows = _rows(every, first, len(log.t))
        if "u" not in found:
            means = np.full(len(log.t), np.nan)
            means[rows] = means_from(rows, log.channels["u"])  # its integral is kept
            log.channels["u"] = means
        log.keep(np.isin(np.arange(len(log.t)), rows))
        if slow and every % 1:  # its clock is even, the rows in which it was seen first are not
            use_true_times(log)


def _rows(every: float, first: float, rows: int) -> np.ndarray:
    """The rows at a beat, or the first ones after it."""
    return np.ceil(np.arange(first, rows - 1 + _ROUNDED, every)).astype(int)
