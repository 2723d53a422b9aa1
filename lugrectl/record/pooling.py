"""Runs of one drive made alike: one sampling rate, and the channels that every run has."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from .record import Record
from .samples.resampling import HELD, between, held_mean
from .samples.rows import smallest_steps

_SAME = 1e-3  # rates that differ by less are one
_NEAR = 0.25  # rates that differ by more are not brought together


def pooled(records: Sequence[Record]) -> tuple[Record, ...]:
    """The runs at their commonest rate, where theirs differ by a little, with common channels.

    Each change is a message of the run. Runs whose rates differ a lot stay as they are.
    """
    if len(records) < 2:
        return tuple(records)
    return _with_common_channels(_at_one_rate(records))


def _at_one_rate(records: Sequence[Record]) -> list[Record]:
    rates = [float(f"{r.rate:.4g}") for r in records]
    common = Counter(rates).most_common(1)[0][0]
    dt = records[rates.index(common)].dt
    if any(abs(r.dt / dt - 1) > _NEAR for r in records):
        return list(records)
    return [r if abs(r.dt / dt - 1) < _SAME else _resampled(r, dt) for r in records]


def _resampled(record: Record, dt: float) -> Record:
    """The record with another step: u held with its time integral, motion by splines."""
    times, pieces, gaps = [], [], []
    for part in record.segments():
        stamps = record.t[part] - record.t[part.start]
        grid = dt * np.arange(int(stamps[-1] / dt + 1e-6) + 1)
        made = {}
        for role, values in record.channels().items():
            if role in HELD:
                made[role] = held_mean(stamps, values[part], grid, dt)
            elif role != "t":
                made[role] = between(role, stamps, values[part], grid)
        gaps.append(sum(map(len, times)))
        times.append(record.t[part.start] + grid)
        pieces.append(made)
    channels = {role: np.concatenate([p[role] for p in pieces]) for role in pieces[0]}
    resolution = record.resolution or smallest_steps(record.channels())
    sentence = (
        f"{record.source} has {record.rate:.6g} samples per second: resampled to {1 / dt:.6g}, "
        "the rate of the other runs."
    )
    made = replace(
        record, t=np.concatenate(times), **channels, dt=dt, gaps=tuple(gaps[1:]),
        resolution=resolution, log=None,
    )  # fmt: skip
    made = made.with_messages(sentence)
    return made if record.log is None else made.read_from(record.log)


def _with_common_channels(records: Sequence[Record]) -> tuple[Record, ...]:
    """Leave out w or theta where a run has none, if the other is in every run."""
    for role, other in (("w", "theta"), ("theta", "w")):
        without = [r for r in records if getattr(r, role) is None]
        if 0 < len(without) < len(records) and all(getattr(r, other) is not None for r in records):
            first = next(i for i, r in enumerate(records) if getattr(r, role) is not None)
            sentence = f"{without[0].source} has no {role}: it is left out in all runs."
            made = [replace(r, **{role: None}, log=None) for r in records]
            made[first] = made[first].with_messages(sentence)
            return tuple(
                m if r.log is None else m.read_from(r.log)
                for m, r in zip(made, records, strict=True)
            )
    return tuple(records)
