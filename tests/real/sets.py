"""How each set is cut into runs that are fitted and runs that no fit sees; never by sample.

The model by hand is that of the set's README: its columns, filter, shift, and what it left on
unseen runs where the README says so.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from .motion import Filter
from .row import Source
from .rows import VOLT
from .screws import FIRST_RUNS, OPTIONS, THIRD_RUNS

ROTARY: Mapping[str, Any] = {"motion": "rotary"}
BASIC = ("a", "w", "sign", "1")
SWUNG = (*BASIC, "sin", "cos")
LOADED = (*BASIC, "sin", "load")


@dataclass(frozen=True)
class Cut:
    """Runs that are fitted, runs that are not; ``shift`` of u, s, in the fit by hand.

    ``readme``: share of RMS torque that the README's fit leaves on the unseen runs.
    """

    train: tuple[Source, ...]
    unseen: tuple[Source, ...]
    shift: float = 0.0
    readme: float | None = None


@dataclass(frozen=True)
class Split:
    """A set with its cuts. ``steady``: every run is one point of a friction map."""

    name: str
    cuts: tuple[Cut, ...]
    columns: tuple[str, ...]
    by: Filter
    model: Mapping[str, Any] = field(default_factory=lambda: ROTARY)
    steady: bool = False
    readme: float | None = None

    def files(self) -> list[str]:
        """The files of all its runs."""
        every = (s.file for cut in self.cuts for s in (*cut.train, *cut.unseen))
        return list(dict.fromkeys(every))


def _cut(
    folder: str,
    train: str,
    unseen: str,
    shift: float = 0.0,
    readme: float | None = None,
    options: Mapping[str, Any] | None = None,
) -> Cut:
    def sources(names: str) -> tuple[Source, ...]:
        return tuple(Source(f"{folder}/{n}.csv", options or {}) for n in names.split())

    return Cut(sources(train), sources(unseen), shift, readme)


def _arm(axis: int, columns: tuple[str, ...], ab: float, ba: float) -> Split:
    folder, a, b = "real/kuka-kr300", f"axis{axis}_A", f"axis{axis}_B"
    cuts = (_cut(folder, a, b, readme=ab), _cut(folder, b, a, readme=ba))
    return Split(f"kuka axis {axis}", cuts, columns, Filter(0.004, 12.0, 0.01))


def _each(files: list[str]) -> tuple[Cut, ...]:
    """Each run left out in turn."""
    sources = [Source(file, OPTIONS) for file in files]
    return tuple(Cut(tuple(s for s in sources if s is not one), (one,)) for one in sources)


def _splits() -> list[Split]:
    swing, servo, motor = "real/dfki-pendulum", "real/bam-xl330", "real/odrive-bldc"
    three, four = "kp100_sin_sin kp100_sin_time_square kp100_up_and_down", "kp400_sin_time_square"
    speed = {"columns": {"w": "y"}, "units": {"w": "deg/s"}}
    dfki = (
        _cut(swing, "ddp", "direct_collocation", 0.012, 0.169),
        _cut(swing, "direct_collocation", "ddp", 0.008, 0.133),
    )
    bam = (_cut(servo, three, four, readme=0.187), _cut(servo, four, three, readme=0.192))
    chirp = (_cut(motor, "chirp1 chirp2", "chirp3", readme=0.0183, options=VOLT),)
    step = (_cut(motor, "step1 step2", "step3", readme=0.0025, options=VOLT),)
    rig = (_cut("real/un-dcmotor", "prbs_open_exp", "step_open_exp", 0.030, options=speed),)
    worm, bend = Filter(0.1, 1.0, 0.0), ("w+", "w-", "sign", "1", "bump+", "bump-")
    return [
        _arm(1, BASIC, 0.354, 0.258),
        _arm(2, SWUNG, 0.373, 0.241),
        _arm(3, SWUNG, 0.378, 0.542),
        Split("dfki swings", dfki, SWUNG, Filter(0.002, 8.0, 0.1)),
        Split("bam", bam, LOADED, Filter(0.005, 12.0, 0.1)),
        Split("odrive chirp", chirp, BASIC, Filter(0.0055, 8.0, 1.0)),
        Split("odrive step", step, BASIC, Filter(0.0055, 8.0, 1.0)),
        Split("un open loop", rig, ("a", "w", "1"), Filter(0.02, 4.0, 0.1)),
        Split("screw drive 1", _each(FIRST_RUNS), ("w", "sign", "1"), worm, steady=True),
        Split("screw drive 3", _each(THIRD_RUNS), bend, worm, steady=True, readme=0.036),
    ]


SPLITS = tuple(_splits())
