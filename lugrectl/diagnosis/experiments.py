"""What to record next: what tells explanations apart, or leads to an unknown one."""

from __future__ import annotations

import math
from collections.abc import Sequence

from ..estimates.balance import Balance
from ..estimates.findings import Finding
from ..record import Record
from ..torque_balance.constants import FEW

ADVICE = {  # if the residual depends on several of these signals, the first one counts
    "t": "repeat the same run, cold and warm, and log temperature and load as well. What returns "
    "at the same times depends on the motion",
    "theta": "record slow moves over the same positions, in both directions and at two speeds",
    "a": "record the same move at two accelerations",
    "u": "record the same motion with a known added load, so that torque and motion differ",
    "w": "record constant speeds, from slow to fast, in both directions",
}
INERTIA = "Record a motion that starts, stops and changes its speed fast: it shows the inertia."

LEAST = 18.0  # s of motion with which a model can be fitted and checked on held-out samples
SHORT = (
    "The record is short: {0:.3g} s, in which {1} independent stretches of motion were compared. "
    "With fewer than {2} the comparison is uncertain."
)
LONGER = "Record {:.0f} s or more of such motion first: this record is short."


def short(records: Sequence[Record], stretches: int | None) -> tuple[str, ...]:
    """A sentence where so few independent stretches were compared that an answer is uncertain."""
    if stretches is None or stretches >= FEW or _duration(records) >= LEAST:
        return ()
    return (SHORT.format(_duration(records), stretches, FEW),)


def longer(records: Sequence[Record], stretches: int | None, then: str | None) -> str | None:
    """What to record next: where a record is short, more of it, and then what ``then`` says."""
    if not short(records, stretches) or not stretches:
        return then
    first = LONGER.format(max(LEAST, math.ceil(_duration(records) * FEW / stretches)))
    return " ".join(filter(None, (first, then)))


def _duration(records: Sequence[Record]) -> float:
    return sum(record.summary()["duration"] for record in records)


def next_experiment(
    verdict: str, depends_on: Sequence[str], effects: Sequence[Finding], plain: Balance, sure: bool
) -> str | None:
    """One sentence; None where nothing is open."""
    tied = next((finding for finding in effects if finding.alternatives), None)
    if verdict == "ambiguous" and tied is not None:
        said = tied.apart()
        return f"{said[0].upper()}{said[1:]}."
    if verdict == "unexplained":
        known = (said for k, said in ADVICE.items() if k in depends_on)
        return f"To identify the missing effect: {next(known, ADVICE['a'])}."
    if not (sure or plain.is_map):
        return INERTIA
    how = next((c.to_separate for c in plain.combinations if c.to_separate), "")
    return f"{how[0].upper()}{how[1:]}, too." if how else None
