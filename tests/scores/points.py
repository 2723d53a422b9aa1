"""What an answer to a drawn record is worth: points for names, errors and coverage of values."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from .question import Answer, Question

LAW = frozenset({"stribeck", "presliding", "sublinear_viscous"})  # parts of the friction law
MOST_BESIDE = 2
MOST_CAUSES = 3
SILENT = ("none", "sound", "dip")  # kinds with nothing to name


def points(question: Question, answer: Answer) -> float:
    """Points between 0 and 1.

    ``found`` with the truth first and at most two from the background beside it: 1. ``ambiguous``
    with at most three causes, the truth among them: 0.5, or 1 where all of them explain the record
    as well. ``unexplained`` with the truth among the names: 0.5. With nothing to name, or sound:
    1 where no name is outside the background. Outside the catalogue: ``unexplained``, depending on
    the right signals, and nothing named but background: 1.
    """
    if question.kind in SILENT:
        silent = answer.verdict in ("adequate", "found", "ambiguous")
        return float(silent and not false_names(question, answer))
    if question.kind == "unknown":
        right = frozenset(answer.depends_on) in question.signals
        right = right and answer.verdict == "unexplained"
        return float(right and not false_names(question, answer))
    if answer.verdict == "unexplained":
        return 0.5 if question.effect in answer.effects else 0.0
    if answer.verdict not in ("found", "ambiguous") or not answer.effects:
        return 0.0
    beside = answer.effects[1:]
    if len(beside) > MOST_BESIDE or not set(beside) <= _harmless(question) | {question.effect}:
        return 0.0
    if answer.verdict == "found":
        return float(answer.effects[0] == question.effect)
    causes = {answer.effects[0], *answer.alternatives}
    if question.effect not in causes or len(causes) > MOST_CAUSES:
        return 0.0
    return 1.0 if causes <= question.alike | {question.effect} else 0.5


def false_names(question: Question, answer: Answer) -> frozenset[str]:
    """What is named and is neither there, nor background, nor a part of the friction law."""
    if answer.verdict not in ("found", "ambiguous", "unexplained"):
        return frozenset()
    allowed = _harmless(question)
    if question.kind == "effect":
        allowed |= {question.effect}
        if answer.verdict == "ambiguous":  # several causes, one of them true
            allowed |= question.alike
    return frozenset(answer.effects) - allowed


def _harmless(question: Question) -> frozenset[str]:
    return question.background | LAW


def values(question: Question, answer: Answer) -> dict[str, dict[str, Any] | None]:
    """Per value with a truth: error and half-width in %, and whether the truth is inside.

    None for a value that was not given. 100 % is the value; of a constant torque Fc, of a phase a
    radian.
    """
    made: dict[str, dict[str, Any] | None] = {}
    for name, true in question.values.items():
        value, low, high = answer.parameters.get(name, (None, None, None))
        if value is None or low is None or high is None:
            made[name] = None
            continue
        off, of = value - true, abs(true)
        if name.endswith("phase"):
            off, of = float(np.angle(np.exp(1j * off))), 1.0
        if name == "constant_torque":
            of = question.values.get("Fc", of)
        inside = low - value <= -off <= high - value
        numbers = {"error": 100 * off / of, "half": 50 * (high - low) / of}
        made[name] = numbers | {"inside": bool(inside), "value": value, "true": true}
    return made


def table(rows: Sequence[dict[str, Any]]) -> str:
    """Coverage, errors and half-widths of each value over all drives, one line each."""
    head = f"{'':28s}{'drives':>7s}{'given':>7s}{'inside':>8s}"
    lines = [head + f"{'error: median':>15s}{'90 %':>9s}{'worst':>9s}{'half-width':>12s}"]
    for name in dict.fromkeys(name for row in rows for name in row):
        every = [row[name] for row in rows if name in row]
        given = [v for v in every if v]
        if given:
            errors = np.array([abs(v["error"]) for v in given])
            numbers = np.median(errors), np.quantile(errors, 0.9), errors.max()
            inside = 100 * np.mean([v["inside"] for v in given])
            half = np.median([v["half"] for v in given])
            line = f"{name:28s}{len(every):7d}{len(given):7d}{inside:7.1f}%"
            lines.append(line + "{:14.3g}%{:8.3g}%{:8.3g}%".format(*numbers) + f"{half:11.3g}%")
    return "\n".join(lines)


def value_summary(rows: Sequence[dict[str, Any]], names=("J", "Fc", "Fv")) -> dict[str, Any]:
    """The figures of :func:`table` for some values as plain numbers."""
    made = {}
    for name in names:
        given = [v for row in rows if (v := row.get(name))]
        if given:
            made[name] = {
                "given": len(given),
                "known": sum(name in row for row in rows),
                "inside": float(np.mean([v["inside"] for v in given])),
                "error": float(np.median([abs(v["error"]) for v in given])),
                "half": float(np.median([v["half"] for v in given])),
            }
    return made
