"""The rows of a log on their way to uniform time: what is left out, and what is said of it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ..columns.units import si_unit
from ..log import Log
from ..record import smallest_step
from .resampling import MOTION

REQUIRED = ("u", "w", "theta")


def count(number: int, noun: str) -> str:
    """'1 row', '3 rows'."""
    return f"{number} {noun}{'' if number == 1 else 's'}"


def runs(mask: np.ndarray) -> list[tuple[int, int]]:
    """(start, length) of every run of True."""
    edges = np.flatnonzero(np.diff(np.r_[False, mask, False]))
    return [(int(a), int(b - a)) for a, b in zip(edges[::2], edges[1::2], strict=True)]


@dataclass
class Stamped:
    """Rows with their stamps ``t`` (s); a bad or missing sample of a channel is NaN.

    ``rows`` are their places in the log; ``new`` marks the first row of each part that does not
    continue the one before. ``said`` are sentences, ``steps`` the smallest recorded steps of the
    motion by role. ``known`` holds what was found in a channel, with the arrays it was found in:
    a step replaces an array that it changes, and never writes into it.
    """

    source: str
    motion: str
    t: np.ndarray
    channels: dict[str, np.ndarray]
    where: Callable[[int], str]
    labels: dict[str, str | None] = field(default_factory=dict)
    rows: np.ndarray = field(default_factory=lambda: np.empty(0, int))
    new: np.ndarray = field(default_factory=lambda: np.empty(0, bool))
    dropped: int = 0
    said: list[str] = field(default_factory=list)
    steps: dict[str, float] = field(default_factory=dict)
    known: dict[str, tuple[np.ndarray, np.ndarray, Any]] = field(default_factory=dict)

    @classmethod
    def of(cls, log: Log) -> Stamped:
        """All rows of a log."""
        finite = {
            role: np.where(np.isinf(x), np.nan, x) if np.isinf(x).any() else x
            for role, x in log.channels.items()
        }
        made = cls(log.source, log.motion, log.t, finite, log.where, log.labels)
        made.rows = np.arange(len(log.t))
        made.new = np.isin(made.rows, (0, *log.cuts))
        return made

    def copy(self) -> Stamped:
        """The same rows; a change of the copy leaves these as they are."""
        return replace(
            self,
            channels={role: x.copy() for role, x in self.channels.items()},
            t=self.t.copy(),
            rows=self.rows.copy(),
            new=self.new.copy(),
            said=[*self.said],
            steps={**self.steps},
            known={},
        )

    @property
    def required(self) -> list[str]:
        """The roles of torque and motion that the log has."""
        return [role for role in REQUIRED if role in self.channels]

    @property
    def used(self) -> list[str]:
        """The same, and a measured load torque."""
        return [*self.required, *(["d"] if "d" in self.channels else [])]

    @property
    def position(self) -> np.ndarray | None:
        return self.channels.get("theta")

    def keep(self, mask: np.ndarray) -> None:
        """Leave out the other rows; a part begins at the first of its rows that is left."""
        part = np.cumsum(self.new)[mask]
        self.t, self.rows = self.t[mask], self.rows[mask]
        self.new = np.diff(part, prepend=part[0] - 1 if len(part) else 0) > 0
        self.channels = {role: values[mask] for role, values in self.channels.items()}

    def place(self, row: int) -> str:
        """'line 2102' or 'row 2100' of one of these rows."""
        return self.where(int(self.rows[row]))

    def value(self, role: str, row: int) -> str:
        """The value of a channel in one of these rows with its unit."""
        unit = si_unit(role, self.motion)
        return f"{self.channels[role][row]:.6g}{' ' if unit else ''}{unit}"

    def say(self, *sentences: str) -> None:
        self.said += sentences

    def parts(self) -> list[slice]:
        """The rows of each part."""
        edges = [*np.flatnonzero(self.new), len(self.t)]
        return [slice(int(a), int(b)) for a, b in zip(edges, edges[1:], strict=False)]


def smallest_steps(channels: dict[str, np.ndarray]) -> dict[str, float]:
    """Smallest steps of the motion channels; without theta, that of the summed w in its place."""
    motion = {r: x for r, x in channels.items() if r in MOTION}
    if "theta" not in motion and "w" in motion:
        motion["theta"] = np.cumsum(np.nan_to_num(motion["w"], posinf=0.0, neginf=0.0))
    return {r: smallest_step(x) for r, x in motion.items()}
