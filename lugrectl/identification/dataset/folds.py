"""Blocked cross-validation: which samples are used for fitting and which are held out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from ...core.errors import Refused
from ...core.option_names import option
from ...engine.runtime.backend import compiler
from .dataset import Data
from .windows import Windows, in_motion, spread, windows

BLOCK = 2.0  # s, least length of a held-out block
GAP = 0.25  # s, between training and held-out samples; also the observer's lead-in
WINDOWS = (1.0, 0.5, 0.25)  # s, possible lengths of a training window (counted samples)
FEWEST = 25  # samples of such a window, at least
ENOUGH = 8  # windows: the longest length that gives as many is used
LEAST = 4  # training windows; a record with fewer is refused
MOST = 200_000  # counted samples to fit on; from a longer record, windows spread over it
ENOUGH_OF_MANY = 24  # windows of such a record, at least


@dataclass(frozen=True)
class Split:
    """Training windows, held-out windows (one for each restart), in samples."""

    train: Windows
    test: Windows
    free: tuple[tuple[int, int], ...]
    in_sample: bool


def split(
    data: Data,
    horizon: float,
    *,
    last: bool = False,
    held_out: int | None = None,
) -> Split:
    """Hold out every other block, the last half, or all runs from sample ``held_out`` on.

    Raises
    ------
    Refused
        If the record is too short for both parts.
    """
    gap = max(2, round(GAP / data.dt))
    span = max(1, round(horizon / data.dt))
    if held_out is not None:
        train = [(a, b) for a, b in data.runs if b <= held_out]
        test = [(a, b) for a, b in data.runs if a >= held_out]
    elif last:
        train, test = _halves(data.runs)
    else:
        train, test = _alternate(data.runs, gap, span, data.dt)
    possible = WINDOWS if compiler() else WINDOWS[-1:]  # NumPy is slow per step, not per window
    lengths = [max(FEWEST, round(length / data.dt)) for length in possible]
    cuts = [in_motion(windows(train, gap, length), data.log.w) for length in lengths]
    fitting = next((cut for cut in cuts if len(cut.start) >= ENOUGH), cuts[-1])
    judging = windows(test, gap, span)
    if len(fitting.start) < LEAST or not len(judging.start):
        raise _too_short(data, horizon)
    whole = test if (last or held_out is not None) else list(data.runs)
    fitting = spread(fitting, MOST, ENOUGH_OF_MANY)
    return Split(fitting, judging, tuple(whole), not (last or held_out is not None))


def _too_short(data: Data, horizon: float) -> Refused:
    """What is missing for both parts: seconds, or samples in so many seconds."""
    needed = 8 * (max(BLOCK, horizon) + GAP)
    if sum(b - a for a, b in data.runs) * data.dt < needed:
        what, record = "The record is", f"at least {needed:.0f} s of motion"
    else:
        what = f"At {1 / data.dt:.4g} Hz the record's pieces without loss are"
        record = f"{needed:.0f} s without loss at {FEWEST / min(WINDOWS):.0f} Hz or more"
    return Refused(
        f"{what} too short to fit the model and to check it on held-out samples.",
        f"Record {record}"
        + (f", shorten {option('horizon')}" if horizon > BLOCK else "")
        + f", or give a second run with {option('holdout')}.",
    )


def _halves(runs: Sequence[tuple[int, int]]) -> tuple[list, list]:
    middle = (runs[0][0] + runs[-1][1]) // 2
    train = [(a, min(b, middle)) for a, b in runs if a < middle]
    return train, [(max(a, middle), b) for a, b in runs if b > middle]


def _alternate(
    runs: Sequence[tuple[int, int]], gap: int, span: int, dt: float
) -> tuple[list, list]:
    """Alternating blocks of whole horizons, at least BLOCK long; each starts with a gap.

    The last block of a run extends to its end. A shorter run is a block of its own, if it has one
    horizon.
    """
    restarts = max(1, -(-round(BLOCK / dt) // span))
    length = gap + restarts * span
    runs = [(a, b) for a, b in runs if b - a >= gap + span]
    starts = [range(a, max(b - length, a) + 1, length) for a, b in runs]
    blocks = [
        (s, b if s == each[-1] else s + length)
        for each, (_, b) in zip(starts, runs, strict=True)
        for s in each
    ]
    return blocks[0::2], blocks[1::2]
