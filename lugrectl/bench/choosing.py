"""Which compensation: the least tracking error among those that come to rest."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ..blocks.model import Model
from ..core.progress import Progress, reporter
from .assured import Tried
from .chance import Outcomes, hunting_at_most
from .member_runs import Choice, Setting, Waiting, Work
from .standstill import HUNTS, RESTS

Run = Callable[..., np.ndarray]  # of a task on pairs of members and seeds, with progress
Pairs = Sequence[tuple[Model, int]]
NEAR = (-0.1, -0.05, 0.05, 0.1)  # from the best of them, tried after it
RESTING, UNSURE, BESIDE = RULES = ("rests", "does not hunt", "swings no farther than without")
FIRST, MORE = 4, 5  # drives that are looked at first, and how many times as many then


def upper(errors: np.ndarray, confidence: float) -> float:
    """The error that a share 1 - confidence of the members exceeds."""
    return float(np.quantile(errors, confidence, method="higher"))


class Standstill:
    """What becomes of one half of the members at rest, with each choice; asked again it is known.

    ``most`` of them may fail: so many that the interval of the chance ends at ``hunts``, or none
    where no number shows that.
    """

    def __init__(self, run: Run, pairs: Pairs, setting: Setting, still: float, hunts: float):
        self.run, self.pairs, self.setting, self.still = run, pairs, setting, still
        self.most = max(hunting_at_most(len(pairs), hunts), 0)
        self.seen: dict[Any, np.ndarray] = {}

    def rows(self, choice: Choice | None, fails: Any = None) -> np.ndarray:
        """A :class:`Rest` of each member, of the first ones once more than ``most`` fail."""
        key = choice and (choice.observer, choice.scale)
        rows = self.seen.get(key, np.zeros((0, 2)))
        while len(rows) < len(self.pairs) and (fails is None or fails(rows).sum() <= self.most):
            more = self.pairs[len(rows) : max(FIRST, MORE * len(rows))]
            work = Waiting(self.setting, choice, self.still)
            rows = self.seen[key] = np.vstack([rows, self.run(work, reporter(False), more)])
        return rows

    def holds(self, choice: Choice, rule: str) -> bool:
        """Whether few enough members fail by one of the RULES."""
        none = self.rows(None)[:, 1] if rule == BESIDE else np.zeros(0)

        def fails(rows: np.ndarray) -> np.ndarray:
            fate, swing = rows.T
            if rule == BESIDE:
                return (fate != RESTS) & (swing > np.maximum(none[: len(rows)], self.still))
            return fate == HUNTS if rule == UNSURE else fate != RESTS

        return bool(fails(self.rows(choice, fails)).sum() <= self.most)

    def outcomes(self, choice: Choice | None) -> Outcomes:
        """The shares of all members."""
        return Outcomes.of(self.rows(choice)[:, 0])

    def share(self, choice: Choice) -> float | None:
        """The share that hunts of those that were looked at."""
        rows = self.seen.get((choice.observer, choice.scale))
        return None if rows is None else float(np.mean(rows[:, 0] == HUNTS))


@dataclass
class Tries:
    """Compensations on the first members, beside none."""

    run: Run
    pairs: Pairs
    setting: Setting
    confidence: float
    choices: list[Choice] = field(default_factory=list)
    tried: list[Tried] = field(default_factory=list)
    none: float = np.inf

    def add(self, choices: Sequence[Choice], report: Progress) -> None:
        """Try these, too, where they are new."""
        choices = [one for one in choices if one not in self.choices]
        errors = self.run(Work(self.setting, [None, *choices]), report, self.pairs)
        self.none = upper(errors[:, 0], self.confidence)
        self.choices += choices
        self.tried += [
            Tried(
                choice.observer.removesuffix("_observer"),
                choice.scale,
                upper(own, self.confidence),
                float(np.median(own)),
                float(np.mean(own > errors[:, 0])),
            )
            for choice, own in zip(choices, errors.T[1:], strict=True)
        ]

    def near(self, best: Choice, report: Progress) -> None:
        """Try other shares of a choice."""
        self.add([replace(best, scale=round(best.scale + d, 2)) for d in NEAR], report)

    def better(self) -> list[Choice]:
        """The choices by their upper error, of those that are better than no compensation and worse
        than it on no more drives than the confidence leaves."""
        most = 1.0 - self.confidence
        able = [
            i for i, one in enumerate(self.tried) if one.worse <= most and one.upper < self.none
        ]
        return [self.choices[i] for i in sorted(able, key=lambda i: self.tried[i].upper)]


def chosen(
    tries: Tries, halves: Sequence[Standstill], report: Progress
) -> tuple[Choice | None, str]:
    """The best choice that holds on both halves by the first of the RULES by which one does."""

    def holding(rule: str) -> Choice | None:
        for i, choice in enumerate(every := tries.better()):
            part = (RULES.index(rule) + i / len(every)) / len(RULES)
            report(part, "waiting for drives to rest")
            if all(half.holds(choice, rule) for half in halves):
                return choice
        return None

    for rule in RULES:
        if found := holding(rule):
            tries.near(found, reporter(False))
            return holding(rule), rule
    return None, BESIDE
