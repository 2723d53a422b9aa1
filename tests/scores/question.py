"""What a generator of records hands over, what a judge answers, and what the answer is worth."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

Estimate = tuple[float, float | None, float | None]  # value, 95 % interval where there is one
LAW = frozenset({"stribeck", "presliding", "sublinear_viscous"})  # parts of the friction law
MOST_BESIDE, MOST_CAUSES = 2, 3


@dataclass(frozen=True)
class Question:
    """One record with what is true of it.

    ``kind``: "effect", "unknown", or any other where there is nothing to name.
    ``record``: ``t`` and ``u`` with ``theta``, ``w`` or both, equally long, s, N m, rad, rad/s.
    ``model``: the declared model as the tables of a model file; its values may be 10 or 20 % off.
    ``effect``: the one to be named, ``none``, or a name outside the catalogue.
    ``signals``: for an effect outside the catalogue, sets of signals that are right answers.
    ``background``: names that may stand beside it and are not wrong.
    ``values``: true parameters by name (``J``, ``Fc``, ``Fv``, ``effect.parameter``).
    ``hidden``, ``friction``: RMS torque of the effect (0 where it is none) and of friction, N m.
    ``alike``: other names that explain this record as well.
    ``about``: what the drive is, in words. ``more``: further runs.
    """

    seed: int
    kind: str
    record: dict[str, np.ndarray]
    model: dict[str, Any]
    effect: str
    values: dict[str, float]
    signals: tuple[frozenset[str], ...] = ()
    background: frozenset[str] = LAW
    hidden: float = 0.0
    friction: float = 0.0
    alike: frozenset[str] = frozenset()
    about: str = ""
    more: tuple[dict[str, np.ndarray], ...] = ()


@dataclass(frozen=True)
class Answer:
    """What a judge says of a log.

    ``verdict``: as in the package, or "crash" or "timeout". ``effects`` are names, the likeliest
    first; ``alternatives`` explain as well. ``parameters``: name -> (value, low, high).
    ``left``: share of RMS torque that remains. ``seconds`` and ``cpu``: after all imports.
    ``reason``: of a refusal, or of there being no answer.
    """

    verdict: str
    effects: tuple[str, ...] = ()
    alternatives: tuple[str, ...] = ()
    depends_on: tuple[str, ...] = ()
    parameters: dict[str, Estimate] = field(default_factory=dict)
    left: float | None = None
    seconds: float = float("nan")
    cpu: float = float("nan")
    reason: str = ""


def points(question: Question, answer: Answer) -> float:
    """Points between 0 and 1.

    ``found`` with the truth first and at most two from the background beside it: 1. ``ambiguous``
    with at most three causes, the truth among them: 0.5, or 1 where all of them explain the record
    as well. ``unexplained`` with the truth among the names: 0.5. With nothing to name: 1 where no
    name is outside the background. Outside the catalogue: ``unexplained``, depending on the right
    signals, and nothing named but background: 1.
    """
    clean = not false_names(question, answer)
    if question.kind == "unknown":
        right = frozenset(answer.depends_on) in question.signals
        return float(right and clean and answer.verdict == "unexplained")
    if question.kind != "effect":
        return float(clean and answer.verdict in ("adequate", "found", "ambiguous"))
    if answer.verdict == "unexplained":
        return 0.5 if question.effect in answer.effects else 0.0
    if answer.verdict not in ("found", "ambiguous") or not answer.effects:
        return 0.0
    beside = answer.effects[1:]
    if len(beside) > MOST_BESIDE or not set(beside) <= question.background | {question.effect}:
        return 0.0
    if answer.verdict == "found":
        return float(answer.effects[0] == question.effect)
    causes = {answer.effects[0], *answer.alternatives}
    if question.effect not in causes or len(causes) > MOST_CAUSES:
        return 0.0
    return 1.0 if causes <= question.alike | {question.effect} else 0.5


def false_names(question: Question, answer: Answer) -> frozenset[str]:
    """What is named and is neither there nor background."""
    if answer.verdict not in ("found", "ambiguous", "unexplained"):
        return frozenset()
    allowed = question.background
    if question.kind == "effect":
        allowed |= {question.effect}
        if answer.verdict == "ambiguous":  # several causes, one of them true
            allowed |= question.alike
    return frozenset(answer.effects) - allowed


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
        inside = bool(low - value <= -off <= high - value)
        made[name] = {"error": 100 * off / of, "half": 50 * (high - low) / of, "inside": inside}
    return made


def coverage(rows: list[dict[str, dict[str, Any] | None]]) -> dict[str, dict[str, float]]:
    """Of each value over all records: how often it was known, given and covered; medians in %."""
    made = {}
    for name in dict.fromkeys(name for row in rows for name in row):
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
