"""The sound samples of a log: runs of one rate and one set of channels, as they were read."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..core.errors import Refused
from ..record.stretches import Stretch

SHORTEST = 40  # samples: a shorter piece is left out
SAME_RATE = 0.01  # relative difference of two sample times that are one

Function = Callable[[np.ndarray], np.ndarray]


@dataclass(frozen=True, eq=False)
class Samples:
    """Channels of one rate, piece after piece.

    ``t`` (s) are times with the runs one after the other, ``stamp`` (s) those of each log, ``u``
    (N m), ``theta`` (rad) and ``w`` (rad/s) are (n,), theta or w None where not
    recorded, ``d`` (N m) the measured load torque. ``ok`` (n,) marks sound samples, ``run`` (n,)
    the log they come from. ``pieces`` are slices of even time with the step ``dt`` (s). ``count``
    (rad) is the step of the encoder, 0 where theta lies on no lattice.
    """

    dt: float
    t: np.ndarray
    stamp: np.ndarray
    u: np.ndarray
    theta: np.ndarray | None
    w: np.ndarray | None
    d: np.ndarray
    ok: np.ndarray
    run: np.ndarray
    pieces: tuple[slice, ...]
    count: float

    @classmethod
    def of(cls, stretches: Sequence[Stretch], times: Sequence[np.ndarray]) -> Samples:
        """The samples of stretches of one rate, at the given times."""
        ends = np.cumsum([0, *(len(s.u) for s in stretches)]).tolist()
        first = stretches[0]

        def joined(key: str) -> np.ndarray | None:
            return None if getattr(first, key) is None else np.concatenate(
                [getattr(s, key) for s in stretches]
            )  # fmt: skip

        loads = [np.zeros(len(s.u)) if s.d is None else s.d for s in stretches]
        return cls(
            dt=float(np.median([s.dt for s in stretches])),
            t=np.concatenate(times),
            stamp=np.concatenate([s.t for s in stretches]),
            u=np.concatenate([s.u for s in stretches]),
            theta=joined("theta"),
            w=joined("w"),
            d=np.concatenate(loads),
            ok=np.concatenate([s.ok for s in stretches]),
            run=np.repeat([s.run for s in stretches], np.diff(ends)),
            pieces=tuple(map(slice, ends[:-1], ends[1:])),
            count=max(s.count for s in stretches),
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
        return replace(self, theta=theta, w=w, pieces=in_turn(at), **made)


def joined(x: np.ndarray, at: Sequence[slice]) -> np.ndarray:
    """Parts of x (n, ...), one after the other."""
    return np.concatenate([x[one] for one in at])


def in_turn(at: Sequence[slice]) -> tuple[slice, ...]:
    """The places that parts have one after the other."""
    ends = np.cumsum([0, *(one.stop - one.start for one in at)]).tolist()
    return tuple(map(slice, ends[:-1], ends[1:]))


def sampled(stretches: Sequence[Stretch]) -> list[Samples]:
    """The stretches of a log by rate and channels; runs follow one another in time. Where others
    move, those that rest throughout say nothing.

    Raises Refused where no stretch is long enough.
    """
    long = [s for s in stretches if len(s.u) >= SHORTEST and s.ok.any()]
    if not long:
        raise Refused(f"no {SHORTEST} sound samples stand in a row.", "Record a longer run.")
    times = list(_in_turn(long))
    groups: dict[tuple, list[int]] = {}
    for i, s in enumerate(long):
        kind = next((k for k in groups if _alike(k, s)), (s.dt, s.theta is None, s.w is None))
        groups.setdefault(kind, []).append(i)
    made = [Samples.of([long[i] for i in g], [times[i] for i in g]) for g in groups.values()]
    return [one for one in made if one.moves] or made


def _alike(kind: tuple[float, bool, bool], s: Stretch) -> bool:
    same = (s.theta is None, s.w is None) == kind[1:]
    return same and abs(s.dt / kind[0] - 1.0) < SAME_RATE


def _in_turn(stretches: Sequence[Stretch]) -> Iterator[np.ndarray]:
    """The times of each stretch: those of the first run as recorded, others behind it."""
    shift, end, run = 0.0, float(stretches[0].t[0]), stretches[0].run
    for s in stretches:
        if s.run != run:
            shift, run = end + s.dt - float(s.t[0]), s.run
        end = float(s.t[-1]) + shift
        yield s.t + shift
