"""Score a judge on many messy records."""

from __future__ import annotations

import json
import time
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from .case import Answer
from .judges import judge_of
from .kept import case_of
from .score import covered, false_names, points

RESULTS = Path(__file__).parents[2] / "notebooks" / "results" / "messy.json"


@dataclass(frozen=True)
class Row:
    """One record, judged."""

    seed: int
    machine: str
    truth: str
    alike: tuple[str, ...]
    answer: Answer
    points: float
    wrong: tuple[str, ...]
    held: dict[str, bool]
    seconds: float

    @property
    def line(self) -> str:
        """What is printed of it."""
        named = ", ".join(self.answer.effects) or "-"
        if self.answer.alternatives:
            named += " | " + ", ".join(self.answer.alternatives)
        if self.answer.depends_on:
            named += f" ({', '.join(sorted(self.answer.depends_on))})"
        alike = f" ~ {', '.join(self.alike)}" if self.alike else ""
        return (
            f"{self.seed:5d}  {self.machine}  {self.truth}{alike}: {self.answer.verdict}  {named}"
            f"  {self.points:.1f}  {self.seconds:.2f} s"
        )


def judged(seed: int, kind: str, generator: str, judge: str, prototype, cache) -> Row:
    """Draw, judge and score one case; a judge that fails has answered ``error``."""
    case = case_of(seed, kind, generator, cache)
    start = time.perf_counter()
    try:
        answer = judge_of(judge, prototype)(case)
    except Exception as error:  # one record must not end the bench
        answer = Answer(f"error ({type(error).__name__}: {error})")
    spent = time.perf_counter() - start
    return Row(
        seed,
        str(case.about.get("machine", "")),
        case.effect if case.kind != "sound" else str(case.about.get("drive", "sound")),
        tuple(sorted(case.alike)),
        answer,
        points(case, answer),
        tuple(sorted(false_names(case, answer))),
        covered(case, answer),
        answer.seconds if np.isfinite(answer.seconds) else spent,
    )


def rows(seeds: range, jobs: int, **what: Any) -> Iterator[Row]:
    """The judged records in the order of their seeds."""
    work = partial(judged, **what)
    if jobs < 2:
        yield from map(work, seeds)
        return
    with ProcessPoolExecutor(jobs) as pool:
        yield from pool.map(work, seeds)


def summary(found: list[Row]) -> dict[str, Any]:
    """Points, false names, seconds and coverage."""
    seconds = [row.seconds for row in found]
    held = [(name, ok) for row in found for name, ok in row.held.items()]
    plain = [ok for name, ok in held if "." not in name]
    finer = [ok for name, ok in held if "." in name]
    return {
        "records": len(found),
        "points": round(float(np.mean([row.points for row in found])), 4),
        "false_names": sum(bool(row.wrong) for row in found),
        "errors": sum(row.answer.verdict.startswith("error") for row in found),
        "median_seconds": round(float(np.median(seconds)), 3),
        "worst_seconds": round(float(np.max(seconds)), 3),
        "coverage_plain": _share(plain),
        "coverage_effects": _share(finer),
        "by_truth": by_truth(found),
    }


def _share(held: list[bool]) -> float | None:
    return round(float(np.mean(held)), 3) if held else None


def by_truth(found: list[Row]) -> dict[str, list[float]]:
    """Truth -> (mean points, records)."""
    truths = sorted({row.truth for row in found})
    table = {name: [row.points for row in found if row.truth == name] for name in truths}
    return {name: [round(float(np.mean(p)), 3), len(p)] for name, p in table.items()}


def keep(path: Path, key: str, said: dict[str, Any]) -> None:
    """Merge one summary into the JSON file of results."""
    kept = json.loads(path.read_text()) if path.exists() else {}
    kept[key] = said
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(dict(sorted(kept.items())), indent=1) + "\n")


def pairs(said: dict[str, Any]) -> Iterator[str]:
    """The summary as lines of a table."""
    for name, (mean, number) in said["by_truth"].items():
        yield f"{name:30s} {mean:5.2f}  {number:4d}"
    for name, value in said.items():
        if name != "by_truth":
            yield f"{name:30s} {value}"
