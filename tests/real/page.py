"""Lines for the screen, and the file in which results are kept."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from ..scores.question import Answer
from .row import Row, Score, total

Line = tuple[Row, Answer, Score]
WIDTH = 26  # of the names


def line(row: Row, answer: Answer, score: Score) -> str:
    """One line: right or not, verdict, names, J, what is left, seconds, what is wrong."""
    mark = "right" if score.right else "named" if score.named else "WRONG"
    J = answer.parameters.get("J")
    left = "" if answer.left is None else f"left {100 * answer.left:.1f} %"
    parts = [
        f"{row.name:{WIDTH}s} {mark:5s}",
        f"{answer.verdict}: {called(answer)}" if called(answer) else answer.verdict,
        "" if J is None else f"J {J[0]:.4g}",
        left,
        f"{answer.seconds:.1f} s, CPU {answer.cpu:.1f} s",
        "; ".join(score.why),
    ]
    return " | ".join(filter(None, parts))


def called(answer: Answer) -> str:
    """The names, with alternatives and signals."""
    names = ", ".join(answer.effects)
    others = f" (or {', '.join(answer.alternatives)})" if answer.alternatives else ""
    signals = f" on {', '.join(answer.depends_on)}" if answer.verdict == "unexplained" else ""
    return f"{names}{others}{signals}".strip()


def totals(lines: Sequence[Line]) -> dict[str, dict[str, Any]]:
    """Counts and seconds by group."""
    made = {}
    for group in dict.fromkeys(row.group for row, *_ in lines):
        own = [(answer, score) for row, answer, score in lines if row.group == group]
        cpu = [answer.cpu for answer, _ in own if np.isfinite(answer.cpu)]
        times = {"median_cpu": float(np.median(cpu)), "worst_cpu": max(cpu)} if cpu else {}
        made[group] = total([score for _, score in own]) | times
    return made


def closing(lines: Sequence[Line]) -> str:
    """A line for each group."""
    said = "{}: {named} of {rows} named right, {right} of {rows} with values and residual"
    time = "; CPU {median_cpu:.1f} s median, {worst_cpu:.1f} s worst"
    made = totals(lines)
    return "\n".join(
        (said + (time if "median_cpu" in of else "")).format(group, **of)
        for group, of in made.items()
    )


def keep(path: Path, judge: str, lines: Sequence[Line]) -> None:
    """Write the results of a judge into a file; those of other judges stay as they are."""
    data = json.loads(path.read_text()) if path.exists() else {}
    rows = {row.name: asdict(answer) | asdict(score) for row, answer, score in lines}
    data[judge] = {"total": totals(lines), "rows": rows}
    path.write_text(json.dumps(data, indent=1, default=float) + "\n")
