"""What an answer is worth."""

from __future__ import annotations

from .case import Answer, Case

LAW = frozenset({"stribeck", "presliding", "sublinear_viscous"})  # parts of the friction law
MOST_BESIDE = 2
MOST_CAUSES = 3


def points(case: Case, answer: Answer) -> float:
    """Points between 0 and 1.

    ``found`` with the truth first and at most two from the background beside it: 1. ``ambiguous``
    with at most three causes, the truth among them: 0.5, or 1 where all of them explain the record
    as well. ``unexplained`` with the truth among the names: 0.5. With nothing to name, or sound:
    1 where no name is outside the background. Outside the catalogue: ``unexplained``, depending on
    the right signals, and nothing named but background: 1.
    """
    if case.kind in ("none", "sound"):
        silent = answer.verdict in ("adequate", "found", "ambiguous")
        return float(silent and not false_names(case, answer))
    if case.kind == "unknown":
        right = answer.verdict == "unexplained" and answer.depends_on in case.signals
        return float(right and not false_names(case, answer))
    if answer.verdict == "unexplained":
        return 0.5 if case.effect in answer.effects else 0.0
    if answer.verdict not in ("found", "ambiguous") or not answer.effects:
        return 0.0
    beside = answer.effects[1:]
    if len(beside) > MOST_BESIDE or not set(beside) <= _harmless(case) | {case.effect}:
        return 0.0
    if answer.verdict == "found":
        return float(answer.effects[0] == case.effect)
    causes = {answer.effects[0], *answer.alternatives}
    if case.effect not in causes or len(causes) > MOST_CAUSES:
        return 0.0
    return 1.0 if causes <= case.alike | {case.effect} else 0.5


def false_names(case: Case, answer: Answer) -> frozenset[str]:
    """What is named and is neither there, nor background, nor a part of the friction law."""
    if answer.verdict not in ("found", "ambiguous", "unexplained"):
        return frozenset()
    allowed = _harmless(case)
    if case.kind == "effect":
        allowed |= {case.effect}
        if answer.verdict == "ambiguous":  # several causes, one of them true
            allowed |= case.alike
    return frozenset(answer.effects) - allowed


def covered(case: Case, answer: Answer) -> dict[str, bool]:
    """Whether the interval of each true parameter that the answer gives holds the truth."""
    both = case.values.keys() & answer.intervals.keys()
    held = {}
    for name in sorted(both):
        low, high = answer.intervals[name]
        held[name] = low <= case.values[name] <= high
    return held


def _harmless(case: Case) -> frozenset[str]:
    return case.background | LAW
