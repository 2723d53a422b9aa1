"""A titled part of a report."""

from __future__ import annotations

from dataclasses import dataclass

from ..core.display import Grid


@dataclass(frozen=True)
class Section:
    """A titled part of a report: paragraphs, then a table, then a footnote."""

    title: str
    lines: tuple[str, ...] = ()
    grid: Grid | None = None
    footnote: str = ""
    formula: bool = False
