"""Which compensation: the least tracking error among those that come to rest."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ..blocks.model import Model
from ..core.progress import Progress, reporter
from .assured import Tried
from .chance import Outcomes, hunting_at_most
from .member_runs import Choice, Jobs, Setting, Tracking, Waiting
from .standstill import HUNTS, RESTS

Pairs = Sequence[tuple[Model, int]]
NOTHING = Choice()
NEAR = (-0.1, -0.05, 0.05, 0.1)  # from the best of them, tried after it
RESTING, UNSURE, BESIDE = RULES = ("rests", "does not hunt", "swings no farther than without")
FIRST, MORE = 4, 5  # drives that are looked at first, and how many times as many then


@dataclass(eq=False)
class Standstill:
    """What becomes of one half of the members at rest, with each choice; asked again it is known.

    ``most`` of them may fail: so many that the interval of the chance ends at ``hunts``, or none
    where no number shows that.
    """

    run: Jobs
    pairs: Pairs
    setting: Setting
    still: float
    hunts: float
    seen: dict[Any, np.ndarray] = field(default_factory=dict)

    @property
    def most(self) -> int:
        return max(hunting_at_most(len(self.pairs), self.hunts), 0)

    def rows(self, choice: Choice, fails: Any = None) -> np.ndarray:
        """Return a :class:`Rest` of each member, of the first ones once more than ``most`` fail."""
        key = choice.observer, choice.scale
        rows = self.seen.get(key, np.zeros((0, 2)))
        while len(rows) < len(self.pairs) and (fails is None or fails(rows).sum() <= self.most):
            more = self.pairs[len(rows) : max(FIRST, MORE * len(rows))]
            work = Waiting(self.setting, choice, self.still)
            rows = self.seen[key] = np.vstack([rows, self.run(work, reporter(False), more)])
        return rows

    def holds(self, choice: Choice, rule: str) -> bool:
        """Return whether few enough members fail by one of the RULES."""
        none = self.rows(NOTHING)[:, 1] if rule == BESIDE else np.zeros(0)

        def fails(rows: np.ndarray) -> np.ndarray:
            fate, swing = rows.T
            if rule == BESIDE:
                return (fate != RESTS) & (swing > np.maximum(none[: len(rows)], self.still))
            return fate == HUNTS if rule == UNSURE else fate != RESTS

        return bool(fails(self.rows(choice, fails)).sum() <= self.most)

    def outcomes(self, choice: Choice) -> Outcomes:
        """Return the shares of all members."""
        return Outcomes.of(self.rows(choice)[:, 0])

    def share(self, choice: Choice) -> float | None:
        """Return the share that hunts of those that were looked at."""
        rows = self.seen.get((choice.observer, choice.scale))
        return None if rows is None else float(np.mean(rows[:, 0] == HUNTS))


@dataclass
class Tries:
    """Compensations on the first members, beside none."""

    run: Jobs
    pairs: Pairs
    setting: Setting
    confidence: float
    choices: list[Choice] = field(default_factory=list)
    tried: list[Tried] = field(default_factory=list)
    none: float = np.inf

    def add(self, choices: Sequence[Choice], report: Progress) -> None:
        """Try these, too, where they are new."""
        choices = [one for one in choices if one not in self.choices]
        errors = self.run(Tracking(self.setting, [NOTHING, *choices]), report, self.pairs)
        none, self.none = errors[:, 0], self._upper(errors[:, 0])
        self.choices += choices
        for choice, own in zip(choices, errors.T[1:], strict=True):
            name = (choice.observer or "").removesuffix("_observer")
            worse = float(np.mean(own > none))
            middle = float(np.median(own))
            self.tried.append(Tried(name, choice.scale, self._upper(own), middle, worse))

    def _upper(self, errors: np.ndarray) -> float:
        """Return the error that a share 1 - confidence of the members exceeds."""
        return float(np.quantile(errors, self.confidence, method="higher"))

    def near(self, best: Choice, report: Progress) -> None:
        """Try other shares of a choice."""
        self.add([replace(best, scale=round(best.scale + d, 2)) for d in NEAR], report)

    def better(self) -> list[Choice]:
        """Return the choices by their upper error, of those that are better than no compensation
        and worse than it on no more drives than the confidence leaves."""
        most, rows = 1.0 - self.confidence, zip(self.tried, self.choices, strict=True)
        able = [row for row in rows if row[0].worse <= most and row[0].upper < self.none]
        return [choice for _, choice in sorted(able, key=lambda row: row[0].upper)]


def chosen(tries: Tries, halves: Sequence[Standstill], report: Progress) -> tuple[Choice, str]:
    """Return the best choice that holds on both halves by the first of the RULES by which one
    does, and the rule."""

    def holding(rule: str) -> Choice:
        for i, choice in enumerate(every := tries.better()):
            part = (RULES.index(rule) + i / len(every)) / len(RULES)
            report(part, "waiting for drives to rest")
            if all(half.holds(choice, rule) for half in halves):
                return choice
        return NOTHING

    for rule in RULES:
        if (found := holding(rule)) is not NOTHING:
            tries.near(found, reporter(False))
            return holding(rule), rule
    return NOTHING, BESIDE
