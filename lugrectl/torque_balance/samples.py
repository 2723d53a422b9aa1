"""The sound samples of a log: runs of one rate and one set of channels, as they were read."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..core.errors import Refused
from ..record import Stretch

SHORTEST = 40  # samples: a shorter piece is left out
SAME_RATE = 0.01  # relative difference of two sample times that are one

Function = Callable[[np.ndarray], np.ndarray]


@dataclass(frozen=True, eq=False)
class Samples:
    """Channels of one rate, piece after piece, (n,) each in SI units."""

    dt: float
    t: np.ndarray  # with the runs one after the other
    stamp: np.ndarray  # times of each log
    u: np.ndarray
    theta: np.ndarray | None
    w: np.ndarray | None
    d: np.ndarray  # measured load torque
    ok: np.ndarray  # sound samples
    run: np.ndarray  # the log they come from
    pieces: tuple[slice, ...]  # of even time
    count: float  # rad: step of the encoder, 0 where theta lies on no lattice

    @classmethod
    def of(cls, stretches: Sequence[Stretch], times: Sequence[np.ndarray]) -> Samples:
        """The samples of stretches of one rate, at the given times."""
        sizes = [len(s.u) for s in stretches]
        loads = [np.zeros(len(s.u)) if s.d is None else s.d for s in stretches]
        recorded = [k for k in ("u", "ok", "theta", "w") if getattr(stretches[0], k) is not None]
        made: dict[str, Any] = {"theta": None, "w": None}
        made |= {k: np.concatenate([getattr(s, k) for s in stretches]) for k in recorded}
        return cls(
            dt=float(np.median([s.dt for s in stretches])),
            t=np.concatenate(times),
            stamp=np.concatenate([s.t for s in stretches]),
            d=np.concatenate(loads),
            run=np.repeat([s.run for s in stretches], sizes),
            pieces=in_turn(sizes),
            count=max(s.count for s in stretches),
            **made,
        )

    def __len__(self) -> int:
        return len(self.u)

    def each(self, function: Function, x: np.ndarray) -> np.ndarray:
        """A function of each piece of x (n,), put together: nothing looks across a cut."""
        return np.concatenate([function(x[at]) for at in self.pieces])

    @property
    def moves(self) -> bool:
        return any(np.ptp(x) > 0 for x in (self.theta, self.w) if x is not None)

    def some(self, most: int) -> Samples:
        """Evenly spread parts of a long log, ``most`` samples in all; itself where it is short."""
        if len(self) <= most:
            return self
        size = max(most // 12, 10 * SHORTEST)
        period = int(size * len(self) / most)
        at = [slice(a, min(a + size, p.stop)) for p in self.pieces
              for a in range(p.start, p.stop, period)]  # fmt: skip
        return self.only([one for one in at if one.stop - one.start >= SHORTEST])

    def only(self, at: Sequence[slice]) -> Samples:
        """Parts of the log as pieces of their own."""
        theta, w = (None if x is None else joined(x, at) for x in (self.theta, self.w))
        made = {k: joined(getattr(self, k), at) for k in ("t", "stamp", "u", "d", "ok", "run")}
        pieces = in_turn([one.stop - one.start for one in at])
        return replace(self, theta=theta, w=w, pieces=pieces, **made)


def joined(x: np.ndarray, at: Sequence[slice]) -> np.ndarray:
    """Parts of x (n, ...), one after the other."""
    return np.concatenate([x[one] for one in at])


def in_turn(sizes: Sequence[int]) -> tuple[slice, ...]:
    """The places of parts of these sizes, one after the other."""
    ends = np.cumsum([0, *sizes]).tolist()
    return tuple(map(slice, ends[:-1], ends[1:]))


def sampled(stretches: Sequence[Stretch]) -> list[Samples]:
    """The stretches of a log by rate and channels; runs follow one another in time. Where others
    move, those that rest throughout say nothing. Refused where no stretch is long enough."""
    long = [s for s in stretches if len(s.u) >= SHORTEST and s.ok.any()]
    if not long:
        raise Refused(f"no {SHORTEST} sound samples stand in a row.", "Record a longer run.")
    times = list(_times(long))
    groups: dict[tuple, list[int]] = {}
    for i, s in enumerate(long):
        own = s.theta is None, s.w is None
        alike = (k for k in groups if k[1:] == own and abs(s.dt / k[0] - 1.0) < SAME_RATE)
        groups.setdefault(next(alike, (s.dt, *own)), []).append(i)
    made = [Samples.of([long[i] for i in g], [times[i] for i in g]) for g in groups.values()]
    return [one for one in made if one.moves] or made


def _times(stretches: Sequence[Stretch]) -> Iterator[np.ndarray]:
    """The times of each stretch: those of the first run as recorded, others behind it."""
    shift, end, run = 0.0, float(stretches[0].t[0]), stretches[0].run
    for s in stretches:
        if s.run != run:
            shift, run = end + s.dt - float(s.t[0]), s.run
        end = float(s.t[-1]) + shift
        yield s.t + shift
