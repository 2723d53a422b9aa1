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
from .runs import Run, Windows, run_of

BLOCK = 2.0  # s, least length of a held-out block
GAP = 0.25  # s, between training and held-out samples
WINDOWS = (1.0, 0.5, 0.25)  # s, possible lengths of a training window
FEWEST = 25  # samples of such a window, at least
ENOUGH, LEAST = 8, 4  # windows: the longest length that gives as many is used; fewer are refused
MOST = 100_000  # samples that are judged, and as many that are trained on, spread evenly

Range = tuple[int, int]
SPREAD = "Of {:.3g} held-out samples {:.3g}, in evenly spread windows, were simulated."


class HeldOut(NamedTuple):
    """A stretch of a run that nothing may be fitted to or chosen by, from and to a time in s."""

    run: int
    start: float
    end: float


@dataclass(frozen=True, eq=False)
class Prepared:
    """Records prepared for judging and polishing.

    Attributes
    ----------
    records : tuple of Record
        The training records.
    model : Model
        The declared one.
    runs : tuple of Run
        Those of the records, then that of a record held out as a whole.
    train, test : tuple of Windows
        For each run: windows to fit on, and windows to judge, each a horizon long.
    held_out : tuple of HeldOut
        The stretches of ``test``.
    free : tuple of tuple of Windows
        For each run: stretches simulated without a restart, one in each.
    in_sample : bool
        Whether those hold training samples.
    horizon : float
        Time from restart to restart in s, as asked for.
    messages : tuple of str
        What was noticed.
    """

    records: tuple[Record, ...]
    model: Model
    runs: tuple[Run, ...]
    train: tuple[Windows, ...]
    test: tuple[Windows, ...]
    held_out: tuple[HeldOut, ...]
    free: tuple[tuple[Windows, ...], ...]
    in_sample: bool
    horizon: float
    messages: tuple[str, ...] = ()
    memory: dict[Any, Any] = field(default_factory=dict, repr=False)

    @property
    def t(self) -> np.ndarray:
        """The time of all runs one after the other, s."""
        return np.concatenate([run.t for run in self.runs])

    @property
    def everywhere(self) -> tuple[Windows, ...]:
        """For each run: windows over all of it but its beginning."""
        made = [
            _cut(run.pieces, run.samples(GAP, 2), run.samples(WINDOWS[0], FEWEST))
            for run in self.runs
        ]
        return _spread(made, MOST)[0]

    def fewer(self, most: int) -> tuple[Windows, ...]:
        """The training windows, or of many so many samples, evenly spread."""
        return _spread(self.train, most)[0]

    def along(
        self, windows: Sequence[Windows], signal: Callable[[Run, Windows], np.ndarray]
    ) -> np.ndarray:
        """A signal (windows, samples) along all runs one after the other, (N,); nan elsewhere."""
        made = []
        for run, where in zip(self.runs, windows, strict=True):
            own = np.full(len(run.t), np.nan)
            if len(where.start):
                own[where.counted] = signal(run, where)
            made.append(own)
        return np.concatenate(made)

    @property
    def channel(self) -> int:
        """0 for theta, 1 for w: what errors are computed on."""
        seen = [
            sum(w.start.size * np.isfinite(r.own[k]) for r, w in zip(self.runs, self.test))  # noqa: B905
            for k in (0, 1)
        ]
        return 1 if seen[1] >= seen[0] else 0

    @property
    def signal(self) -> str:
        """The channel on which errors are computed: w, or theta if only that was recorded."""
        return ("theta", "w")[self.channel]

    @property
    def unit(self) -> str:
        """Its unit."""
        return unit_for(("rad", "rad/s")[self.channel], self.model.motion)

    @property
    def noise_floor(self) -> float:
        """Standard deviation of that channel's own noise, the largest of all runs."""
        return float(np.nanmax([run.own[self.channel] for run in self.runs]))

    def known(self, run_offsets: Mapping[int, float], u_delay: float = 0.0) -> Prepared:
        """The same with the torque as it acted.

        An offset of its column (N m) by number of the run is taken off; positive ``u_delay`` (s)
        moves it later, a negative one earlier.
        """
        runs = tuple(
            replace(run, u=run.torque(run_offsets.get(i, 0.0), u_delay))
            for i, run in enumerate(self.runs)
        )
        return replace(self, runs=runs, memory={})


def prepared(
    records: Record | Sequence[Record],
    model: Model,
    holdout: str | Record | None,
    horizon: float,
    memory: float = 0.0,
) -> Prepared:
    """Split records into training windows and held-out windows.

    Parameters
    ----------
    records : Record or sequence of Record
        Runs of one drive; rates and channels may differ.
    model : Model
        The declared model.
    holdout : None, "last" or Record
        Every other block is held out, or the last half of the recorded time, or this record.
    horizon : float
        Time from restart to restart, s.
    memory : float
        Time over which the residual depends on itself, s: blocks are longer.

    Raises
    ------
    Refused
        If the records are too short or too slow for both parts.
    InputError
        If the records are of different kinds of motion.
    """
    given = (records,) if isinstance(records, Record) else tuple(records)
    apart = (holdout,) if isinstance(holdout, Record) else ()
    every = [consistent(r) for r in (*given, *apart)]
    _alike(every)
    _long_enough(every)
    runs = tuple(run_of(r) for r in every)
    train, test = _parts(runs, len(given) if apart else None, holdout == "last", horizon, memory)
    fitting, judging = _training(runs, train), _judging(runs, test, horizon)
    judged = sum(w.start.size for w in judging)
    if sum(w.start.size for w in fitting) < LEAST or not judged:
        raise _too_short(runs, horizon)
    whole = bool(apart) or holdout == "last"
    free = [
        tuple(_whole(run, a, b) for a, b in (own if whole else run.pieces) if b - a > 1)
        for run, own in zip(runs, test, strict=True)
    ]
    spread, said = _spread(judging, MOST)
    noticed = dict.fromkeys([run.said for run in runs if run.said] + said)
    return Prepared(
        tuple(every[: len(given)]), model, runs, _spread(fitting, MOST)[0], spread,
        _held_out(runs, judging), tuple(free), not whole, horizon, tuple(noticed),
    )  # fmt: skip


def _alike(records: Sequence[Record]) -> None:
    for r in records[1:]:
        if r.motion != records[0].motion:
            raise InputError(
                f"{r.source} is {r.motion} and {records[0].source} {records[0].motion}: give runs "
                "of one drive."
            )


def _long_enough(records: Sequence[Record]) -> None:
    """Refused where no record is; a shorter one beside others gives fewer windows or none."""
    faults = []
    for r in records:
        try:
            return long_enough_to_judge(r)
        except Refused as fault:
            faults.append(fault)
    raise faults[0]


def _parts(
    runs: Sequence[Run], apart: int | None, last: bool, horizon: float, memory: float
) -> tuple[list[list[Range]], list[list[Range]]]:
    """Ranges to fit on and to judge, for each run."""
    if apart is not None:
        whole = [list(run.pieces) for run in runs]
        none: list[list[Range]] = [[] for _ in runs]
        return whole[:apart] + none[apart:], none[:apart] + whole[apart:]
    return _halves(runs) if last else _alternate(runs, horizon, memory)


def _halves(runs: Sequence[Run]) -> tuple[list[list[Range]], list[list[Range]]]:
    """The first and the last half of the recorded time."""
    train, test = [], []
    left = 0.5 * sum(len(run.t) * run.dt for run in runs)
    for run in runs:
        cut = int(np.clip(round(left / run.dt), 0, len(run.t)))
        train.append([(a, min(b, cut)) for a, b in run.pieces if a < cut])
        test.append([(max(a, cut), b) for a, b in run.pieces if b > cut])
        left -= len(run.t) * run.dt
    return train, test


def _alternate(
    runs: Sequence[Run], horizon: float, memory: float
) -> tuple[list[list[Range]], list[list[Range]]]:
    """Alternating blocks of whole horizons; each starts with a gap.

    The last block of a piece extends to its end; a piece shorter than a block is one.
    """
    parts: tuple[list[list[Range]], list[list[Range]]] = ([], [])
    turn = 0
    for run in runs:
        gap, span = run.samples(GAP, 2), run.samples(horizon)
        length = gap + span * max(1, -(-run.samples(max(BLOCK, memory)) // span))
        own: tuple[list[Range], list[Range]] = ([], [])
        for a, b in run.pieces:
            if b - a < gap + span:
                continue
            starts = range(a, max(b - length, a) + 1, length)
            for s in starts:
                own[turn].append((s, b if s == starts[-1] else s + length))
                turn = 1 - turn
        for part, ranges in zip(parts, own, strict=True):
            part.append(ranges)
    return parts


def _cut(ranges: Sequence[Range], gap: int, length: int) -> Windows:
    starts: list[int] = []
    for a, b in ranges:
        starts += range(a + gap, b - length + 1, length)
    return Windows(np.array(starts, dtype=int), length)


def _training(runs: Sequence[Run], parts: Sequence[Sequence[Range]]) -> list[Windows]:
    """Windows in motion, the longest that are enough."""
    made: list[Windows] = []
    for seconds in WINDOWS if compiler() else WINDOWS[-1:]:  # NumPy is slow per step, not per lane
        made = [
            run.moving(_cut(part, run.samples(GAP, 2), run.samples(seconds, FEWEST)))
            for run, part in zip(runs, parts, strict=True)
        ]
        if sum(w.start.size for w in made) >= ENOUGH:
            break
    return made


def _judging(
    runs: Sequence[Run], parts: Sequence[Sequence[Range]], horizon: float
) -> list[Windows]:
    return [
        _cut(part, run.samples(GAP, 2), run.samples(horizon))
        for run, part in zip(runs, parts, strict=True)
    ]


def _whole(run: Run, start: int, end: int) -> Windows:
    """One window over a range but its beginning, in which an observer finds the state."""
    gap = min(run.samples(GAP, 2), end - start - 1)
    return Windows(np.array([start + gap]), end - start - gap)


def _spread(windows: Sequence[Windows], most: int) -> tuple[tuple[Windows, ...], list[str]]:
    """As many windows as have so many samples, and a sentence where some were left out."""
    whole = sum(w.start.size * w.length for w in windows)
    share = min(1.0, most / max(whole, 1))
    kept = tuple(w.spread(max(1, round(share * w.start.size))) for w in windows)
    used = sum(w.start.size * w.length for w in kept)
    return kept, [SPREAD.format(whole, used)] if used < whole else []


def _held_out(runs: Sequence[Run], windows: Sequence[Windows]) -> tuple[HeldOut, ...]:
    """The windows in time, joined where one follows another."""
    made: list[HeldOut] = []
    for i, (run, where) in enumerate(zip(runs, windows, strict=True)):
        for s in where.start:
            start, end = float(run.t[s]), float(run.t[s + where.length - 1])
            before = made[-1] if made and made[-1].run == i else None
            if before is not None and abs(start - before.end - run.dt) < 0.5 * run.dt:
                made[-1] = before._replace(end=end)
            else:
                made.append(HeldOut(i, start, end))
    return tuple(made)


def _too_short(runs: Sequence[Run], horizon: float) -> Refused:
    """What is missing for both parts: seconds, or samples in so many seconds."""
    needed, dt = 8 * (max(BLOCK, horizon) + GAP), max(run.dt for run in runs)
    if sum(b - a for run in runs for a, b in run.pieces) * dt < needed:
        what, record = "The record is", f"at least {needed:.0f} s of motion"
    else:
        what = f"At {1 / dt:.4g} Hz the record's pieces without loss are"
        record = f"{needed:.0f} s without loss at {FEWEST / min(WINDOWS):.0f} Hz or more"
    return Refused(
        f"{what} too short to fit the model and to check it on held-out samples.",
        f"Record {record}"
        + (f", shorten {option('horizon')}" if horizon > BLOCK else "")
        + f", or give a second run with {option('holdout')}.",
    )
