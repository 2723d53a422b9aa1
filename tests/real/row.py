"""A row of the bench: the logs of a drive, what is declared, and what a right answer says."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

VERDICTS = ("adequate", "found", "ambiguous", "unexplained", "refused")


@dataclass(frozen=True)
class Source:
    """A file below the data folder, and the options of ``read_record`` that it needs."""

    file: str
    options: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Value:
    """A range in which a value is right, SI; in the unit of u where u is a voltage.

    ``names`` mean the same quantity: the first that the answer gives inside the range will do.
    ``needed``: an answer without it is not right. ``covering``: the interval covers all of it.
    """

    names: tuple[str, ...]
    low: float
    high: float
    needed: bool = False
    covering: bool = False


@dataclass(frozen=True)
class Way:
    """One kind of right answer.

    ``names``: from each set one effect is named, as the likeliest or as an alternative.
    ``beside``: what may be named as well. ``depends_on``: signals of which at least one is named;
    empty: not judged. ``values``: ranges of this way alone. ``absent``: values that are not given.
    ``not_because``: texts that the reason of a refusal does not hold.
    """

    verdicts: frozenset[str]
    names: tuple[frozenset[str], ...] = ()
    beside: frozenset[str] = frozenset()
    depends_on: frozenset[str] = frozenset()
    values: tuple[Value, ...] = ()
    absent: tuple[str, ...] = ()
    not_because: tuple[str, ...] = ()


@dataclass(frozen=True)
class Row:
    """One or several runs of one drive, and what is known of it.

    ``group``: "table" (the rows of the comparison of measured logs), "map" (runs at steady speed),
    "format" (a log of the table in its second file format). ``right``: any of these ways.
    ``left``: share of RMS torque that the plain fit by hand leaves on these runs.
    """

    name: str
    group: str
    sources: tuple[Source, ...]
    model: Mapping[str, Any]
    right: tuple[Way, ...]
    values: tuple[Value, ...] = ()
    left: float | None = None
    known: str = ""

    def files(self, data: Path) -> list[Path]:
        return [data / source.file for source in self.sources]

    def missing(self, data: Path) -> list[str]:
        """The files that are not there."""
        return [source.file for source in self.sources if not (data / source.file).is_file()]


def value(names: str, low: float, high: float, **more: bool) -> Value:
    """``value("u_delay or input_delay.delay", 0.02, 0.03)``."""
    return Value(tuple(names.split(" or ")), low, high, **more)


def way(verdicts: str, *names: str, beside: str = "", depends_on: str = "", **more: Any) -> Way:
    """``way("found ambiguous", "gravity constant_torque")``: one of the two is named."""
    groups = tuple(frozenset(group.split()) for group in names)
    sets = (frozenset(text.split()) for text in (verdicts, beside, depends_on))
    said, extra, signals = sets
    return Way(said, groups, extra, signals, **more)
