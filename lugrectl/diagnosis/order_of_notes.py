"""The order of notes: first what casts doubt on the whole answer, then all others as they came."""

from __future__ import annotations

import re
from collections.abc import Iterable

# how such a note begins, behind the name of its log where there are several, the gravest first
GRAVE = (
    r"The header says ",  # another unit was given than the log states
    r"\w+ is stated in \S+ but in fact in ",  # the data contradict it
    r"u and \w+ seem to be swapped",
    r"The declared law '\S+' (has no \w+ friction|does not fit)",
    r"The fit by simulation failed",
    r"Values are those of the balance of torques, without errors",  # there was no such fit
    r"The values are those of the torque balance alone",
    r"On held-out samples the simulation with the added effect misses",
)


def grave_first(notes: Iterable[str]) -> tuple[str, ...]:
    """The notes, those first that say why the values or names may be wrong."""
    return tuple(sorted(notes, key=_rank))


def _rank(note: str) -> int:
    """The place of a note's kind; that of all which are not grave is the last."""
    found = (i for i, start in enumerate(GRAVE) if re.match(rf"(\S.*?: )?{start}", note))
    return next(found, len(GRAVE))
