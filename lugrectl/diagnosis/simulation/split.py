"""Records split into training windows and samples that no fit and no choice has seen."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np

from ...blocks.block import unit_for
from ...blocks.model import Model
from ...core.errors import InputError, Refused
from ...core.option_names import option
from ...engine.runtime.backend import compiler
from ...record import Record, consistent, long_enough_to_judge
from .runs import GAP, Range, Run, Windows, run_of

BLOCK = 2.0  # s, least length of a held-out block
WINDOWS = (1.0, 0.5, 0.25)  # s, possible lengths of a training window
FEWEST = 25  # samples of such a window, at least
ENOUGH, LEAST = 8, 4  # windows: the longest length that gives as many is used; fewer are refused
MOST = 100_000  # samples that are judged, and as many to train on, in evenly spread windows
SPREAD = "Not all {} held-out samples were simulated, but evenly spread windows of {}."
Parts = list[list[Range]]


class HeldOut(NamedTuple):
    """A stretch of a run that nothing may be fitted to or chosen by, between two times in s."""

    run: int
    start: float
    end: float


@dataclass(frozen=True, eq=False)
class Prepared:
    """Records prepared for judging and polishing.

    ``records`` are the training ones, ``runs`` these and then one held out as a whole. By run:
    ``train`` are windows to fit on, ``test`` those that are judged, a horizon long, and ``free``
    ranges simulated without a restart, ``in_sample`` where these hold training samples.
    ``held_out`` are all stretches set apart, whether judged or not. ``horizon`` in s. ``memory``
    keeps what was computed of models.
    """

    records: tuple[Record, ...]
    model: Model
    runs: tuple[Run, ...]
    train: tuple[Windows, ...]
    test: tuple[Windows, ...]
    free: Sequence[Sequence[Range]]
    in_sample: bool
    held_out: tuple[HeldOut, ...]
    horizon: float
    messages: tuple[str, ...] = ()
    memory: dict[Any, Any] = field(default_factory=dict, repr=False)

    @property
    def channel(self) -> int:
        """What errors are computed on: 1 for w, 0 for theta where more held-out samples have it."""
        many = [where.counted.size for where in self.test]
        theta, w = many @ np.isfinite([run.own for run in self.runs])
        return int(w >= theta)

    @property
    def signal(self) -> str:
        return ("theta", "w")[self.channel]

    @property
    def unit(self) -> str:
        return unit_for(("rad", "rad/s")[self.channel], self.model.motion)

    @property
    def noise_floor(self) -> float:
        """Standard deviation of that channel's own noise, the largest of all runs."""
        return float(np.nanmax([run.own[self.channel] for run in self.runs]))

    @property
    def everywhere(self) -> tuple[Windows, ...]:
        """For each run: windows over all of it but the beginnings of its pieces."""
        return spread([run.windows(run.pieces, run.count(1.0)) for run in self.runs], MOST)

    def along(
        self, windows: Sequence[Windows], columns: int, signals: Callable[[Run, Windows], Any]
    ) -> np.ndarray:
        """Signals (windows, samples, columns) along all runs in turn, else nan, (columns, N)."""
        made = [np.full((len(run.t), columns), np.nan) for run in self.runs]
        for run, where, own in zip(self.runs, windows, made, strict=True):
            if where.start.size:
                own[where.counted] = signals(run, where)
        return np.concatenate(made).T

    def with_torque(self, run_offsets: Mapping[int, float], u_delay: float = 0.0) -> Prepared:
        """The same with the torque as it acted: an offset (N m) of the column of a run, by its
        number, is taken off; ``u_delay`` (s) moves all later, earlier where below 0."""
        torques = [run.torque(run_offsets.get(i, 0.0), u_delay) for i, run in enumerate(self.runs)]
        runs = tuple(replace(run, u=u) for run, u in zip(self.runs, torques, strict=True))
        return replace(self, runs=runs, memory={})


def prepared(
    records: Record | Sequence[Record],
    model: Model,
    holdout: str | Record | None,
    horizon: float,
    memory: float = 0.0,
) -> Prepared:
    """Split records, whose rates and channels may differ, into training and held-out windows.

    ``holdout`` None sets every other block apart, "last" the last half of the recorded time, a
    Record itself. ``horizon`` is the time from restart to restart, ``memory`` that over which the
    residual depends on itself: blocks are longer than both, s. Refused where records are too short
    or too slow for both parts, InputError where they are of different kinds of motion.
    """
    given = (records,) if isinstance(records, Record) else tuple(records)
    apart = (holdout,) if isinstance(holdout, Record) else ()
    every = [consistent(r) for r in (*given, *apart)]
    _usable(every)
    runs, whole = tuple(map(run_of, every)), bool(apart) or holdout == "last"
    pieces = [[*run.pieces] for run in runs]
    if apart:
        train, test = [*pieces[:-1], []], [*([] for _ in given), pieces[-1]]
    else:
        train, test = _halves(runs) if whole else _alternate(runs, horizon, memory)
    fitting = _training(runs, train)
    both = [*zip(runs, test, strict=True)]
    judging = [run.windows(own, run.count(horizon), run.pieces) for run, own in both]
    if sum(w.start.size for w in fitting) < LEAST or not any(w.start.size for w in judging):
        raise _too_short(runs, horizon)
    kept = spread(judging, MOST)
    every_one, used = (sum(w.counted.size for w in windows) for windows in (judging, kept))
    said = [run.said for run in runs if run.said]
    said += [SPREAD.format(every_one, used)] if used < every_one else []
    apart = [(i, *run.t[[a + run.gap, b - 1]]) for i, (run, own) in enumerate(both) for a, b in own]
    held_out = tuple(HeldOut(i, float(start), float(end)) for i, start, end in apart if start < end)
    parts = runs, spread(fitting, MOST), kept, test if whole else pieces, not whole, held_out
    return Prepared(tuple(every[: len(given)]), model, *parts, horizon, tuple(dict.fromkeys(said)))


def spread(windows: Sequence[Windows], most: int) -> tuple[Windows, ...]:
    """As many windows of all runs as have so many samples, evenly spread, at least one of each."""
    share, made = most / max(sum(w.start.size * w.length for w in windows), 1), []
    for w in windows:
        kept = min(w.start.size, max(1, round(share * w.start.size)))
        made.append(w.at(np.linspace(0, w.start.size - 1, kept).round().astype(int)))
    return tuple(made)


def _usable(records: Sequence[Record]) -> None:
    """Refused where the longest record is too short: others beside it only have fewer windows."""
    long_enough_to_judge(max(records, key=lambda r: r.duration))
    for r in records:
        if r.motion != records[0].motion:
            kinds = f"{r.source} is {r.motion} and {records[0].source} {records[0].motion}"
            raise InputError(f"{kinds}: give runs of one drive.")


def _halves(runs: Sequence[Run]) -> tuple[Parts, Parts]:
    """The first and the last half of the recorded time, by run."""
    parts: tuple[Parts, Parts] = [], []
    left = 0.5 * sum(len(run.t) * run.dt for run in runs)
    for run in runs:
        cut = int(np.clip(round(left / run.dt), 0, len(run.t)))
        left -= len(run.t) * run.dt
        parts[0].append([(a, min(b, cut)) for a, b in run.pieces if a < cut])
        parts[1].append([(max(a, cut), b) for a, b in run.pieces if b > cut])
    return parts


def _alternate(runs: Sequence[Run], horizon: float, memory: float) -> tuple[Parts, Parts]:
    """Alternating blocks of whole horizons behind a gap; a piece's last one extends to its end."""
    parts: tuple[Parts, Parts] = [[] for _ in runs], [[] for _ in runs]
    turn = 0
    for i, run in enumerate(runs):
        span = run.count(horizon)
        length = run.gap + span * max(1, -(-run.count(max(BLOCK, memory)) // span))
        for a, b in run.pieces:
            starts = [*range(a, max(b - length, a) + 1, length)] if b - a >= run.gap + span else []
            for s in starts:
                parts[turn][i].append((s, b if s == starts[-1] else s + length))
                turn = 1 - turn
    return parts


def _training(runs: Sequence[Run], parts: Parts) -> list[Windows]:
    """Windows in motion, the longest that are enough; without a compiler short ones, as each step
    is slow and all windows take it at once."""
    made: list[Windows] = []
    for seconds in WINDOWS if compiler() else WINDOWS[-1:]:
        both = zip(runs, parts, strict=True)
        made = [run.moving(run.windows(part, run.count(seconds, FEWEST))) for run, part in both]
        if sum(w.start.size for w in made) >= ENOUGH:
            break
    return made


def _too_short(runs: Sequence[Run], horizon: float) -> Refused:
    """What is missing for both parts: seconds, or samples in so many seconds."""
    needed, dt = 8 * (max(BLOCK, horizon) + GAP), max(run.dt for run in runs)
    what, record = "The record is", f"at least {needed:.0f} s of motion"
    if sum((b - a) * run.dt for run in runs for a, b in run.pieces) >= needed:
        what = f"At {1 / dt:.4g} Hz the record's pieces without loss are"
        record = f"{needed:.0f} s without loss at {FEWEST / min(WINDOWS):.0f} Hz or more"
    shorter = f", shorten {option('horizon')}" if horizon > BLOCK else ""
    return Refused(
        f"{what} too short to fit the model and to check it on held-out samples.",
        f"Record {record}{shorter}, or give a second run with {option('holdout')}.",
    )
