"""The result of a comparison."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Share:
    """Where a part of the torque goes."""

    term: str
    rms: float
    share: float


@dataclass(frozen=True)
class Comparison:
    """What the table says of a record."""

    verdict: str
    effects: tuple[str, ...] = ()
    alternatives: tuple[str, ...] = ()
    depends_on: tuple[str, ...] = ()
    rows: tuple = ()
    seconds: float = 0.0
    decision: object = None
