"""Sentences of the fit by simulation and of the plain answer that say the same: one of them."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from .order_of_notes import grave_first

# what both notice, in the words of the fit and in those of the plain answer, which are kept
ALIKE = (
    (r"w lags theta by ", r"w is \S+ ms behind dtheta/dt"),
    (
        r"w is not d theta/dt but \S+ times it: w is ignored",
        r"w is \S+ ms (behind|ahead of) dtheta",
    ),
    (r"w is not d theta/dt but \S+ times it: w is ignored", r"w is \S+ times dtheta/dt"),
    (r"The torque column lags the motion by ", r"u comes \S+ ms late"),
    (r"its sign was changed for the simulation", r"u has the wrong sign"),  # nothing was fitted
    (r"u stays at exactly ", r"u stays at the end of its register"),
)
# the same, but the words of the fit say more and are kept
FULLER = ((r"\d+ runs at steady speed were taken as one map", r"The runs keep one speed each"),)


def said_once(said: Sequence[str], notes: Sequence[str]) -> tuple[str, ...]:
    """The sentences of a finer answer, then those of the plain answer, each thing said once.

    A sentence on one of several logs stands with the name of that log only.
    """
    bare = {note.split(": ", 1)[1] for note in notes if ": " in note}
    kept = [s for s in said if s not in bare and not any(_same(ALIKE, s, n) for n in notes)]
    new = [n for n in notes if not any(_same(FULLER, s, n) for s in said)]
    return tuple(dict.fromkeys([*kept, *new]))


def _same(pairs: Sequence[tuple[str, str]], sentence: str, note: str) -> bool:
    """Whether a sentence of the fit and a note of the plain answer are one of these pairs."""
    return any(re.search(mine, sentence) and re.search(its, note) for mine, its in pairs)


def with_plain(result: Any, asked: Any) -> Any:
    """A result with the plain answer beside it, and what was noticed when the logs were read."""
    said = (*asked.plain.reading, *asked.plain.against)
    messages = grave_first(said_once(result.messages, said))
    return replace(result, plain=asked.plain, messages=messages, records=tuple(asked.seen))
