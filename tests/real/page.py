"""Lines for the screen, and the file in which results are kept."""

from __future__ import annotations

import json
import subprocess
from collections.abc import Mapping, Sequence
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


def commit() -> str | None:
    """The commit of the package that was judged, None outside a checkout."""
    command = ["git", "rev-parse", "--short", "HEAD"]
    try:
        done = subprocess.run(command, cwd=Path(__file__).parent, capture_output=True, text=True)
    except OSError:
        return None
    return done.stdout.strip() or None


def kept(lines: Sequence[Line]) -> dict[str, Any]:
    """Results of one judge as plain values."""
    rows = {row.name: _row(row, answer, score) for row, answer, score in lines}
    return {"commit": commit(), "total": totals(lines), "rows": rows}


def _row(row: Row, answer: Answer, score: Score) -> dict[str, Any]:
    said = {k: v for k, v in asdict(answer).items() if v not in ((), {}, "", None)}
    for key in ("seconds", "cpu"):
        said[key] = round(said[key], 2) if np.isfinite(said[key]) else None
    return {"group": row.group, "named": score.named, "right": score.right, "why": score.why} | said


def keep(path: Path, judge: str, made: Mapping[str, Any]) -> None:
    """Write the results of a judge into a file; those of other judges stay as they are."""
    data = json.loads(path.read_text()) if path.exists() else {}
    data[judge] = dict(made)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(data, indent=1, default=float, allow_nan=False) + "\n")
