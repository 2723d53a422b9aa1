"""``python -m tests.scores.drawn --kind effect --seeds 100:140``: score a judge on drawn drives.

``--judge balance`` asks for the plain answer alone.
"""

from __future__ import annotations

import argparse
import importlib
import json
import warnings
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from .judges import judge_named, timed
from .points import false_names, points, table, value_summary, values
from .question import Answer, Question

RESULTS = Path(__file__).parents[2] / "notebooks" / "results"
GENERATORS = {
    "drives": "tests.drives.messy",
    "steady": "tests.drives.steady",
    "held_out": "tests.held_out.questions",
}


@dataclass(frozen=True)
class Row:
    """One record, judged."""

    question: Question
    answer: Answer
    points: float
    wrong: tuple[str, ...]
    values: dict[str, dict[str, Any] | None]

    @property
    def line(self) -> str:
        """What is printed of it."""
        q, answer = self.question, self.answer
        named = ", ".join(answer.effects) or answer.reason or "-"
        if answer.alternatives:
            named += " | " + ", ".join(answer.alternatives)
        if answer.depends_on:
            named += f" ({', '.join(sorted(answer.depends_on))})"
        alike = f" ~ {', '.join(sorted(q.alike))}" if q.alike else ""
        return (
            f"{q.seed:5d}  {q.about.get('machine', '')}  {q.effect}{alike}: {answer.verdict}  "
            f"{named}  {self.points:.1f}  {answer.seconds:.2f} s"
        )


def drawer(generator: str) -> Callable[[int, str], Question]:
    """The function that draws; ``generator`` is a name or a module."""
    return importlib.import_module(GENERATORS.get(generator, generator)).draw


def judged(seed: int, kind: str, generator: str, judge: str) -> Row:
    """Draw, judge and score one; a judge that fails has answered ``error``."""
    question = drawer(generator)(seed, kind)
    logs = [(log, {}) for log in (question.record, *question.more)]
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            answer = timed(judge_named(judge), logs, question.model)
    except Exception as error:  # one record must not end the bench
        answer = Answer("error", reason=f"{type(error).__name__}: {error}")
    wrong = tuple(sorted(false_names(question, answer)))
    return Row(question, answer, points(question, answer), wrong, values(question, answer))


def rows(seeds: range, jobs: int, **what: Any) -> Iterator[Row]:
    """The judged records in the order of their seeds."""
    work = partial(judged, **what)
    if jobs < 2:
        yield from map(work, seeds)
        return
    with ProcessPoolExecutor(jobs) as pool:
        yield from pool.map(work, seeds)


def summary(found: Sequence[Row]) -> dict[str, Any]:
    """Points, false names, seconds and coverage."""
    seconds = [row.answer.seconds for row in found if np.isfinite(row.answer.seconds)] or [0.0]
    held = [(name, v["inside"]) for row in found for name, v in row.values.items() if v]
    truths: dict[str, list[float]] = {}
    for row in sorted(found, key=lambda row: row.question.effect):
        truths.setdefault(row.question.effect, []).append(row.points)
    return {
        "records": len(found),
        "points": round(float(np.mean([row.points for row in found])), 4),
        "false_names": sum(bool(row.wrong) for row in found),
        "errors": sum(row.answer.verdict == "error" for row in found),
        "median_seconds": round(float(np.median(seconds)), 3),
        "worst_seconds": round(float(np.max(seconds)), 3),
        "coverage_plain": _share([ok for name, ok in held if "." not in name]),
        "coverage_effects": _share([ok for name, ok in held if "." in name]),
        "by_truth": {k: [round(float(np.mean(p)), 3), len(p)] for k, p in truths.items()},
    }


def _share(held: Sequence[bool]) -> float | None:
    return round(float(np.mean(held)), 3) if held else None


def keep(path: Path, key: str, said: dict[str, Any]) -> None:
    """Merge one summary into the JSON file of results."""
    kept = json.loads(path.read_text()) if path.exists() else {}
    kept[key] = said
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(dict(sorted(kept.items())), indent=1) + "\n")


def parser() -> argparse.ArgumentParser:
    p = argparse.ArgumentParser(prog="python -m tests.scores.drawn", description=__doc__)
    p.add_argument("--kind", default="effect", help="one of the generator's")
    p.add_argument("--seeds", default="100:140", help="FIRST:LAST, LAST not included")
    p.add_argument("--generator", default="drives", help=f"{', '.join(GENERATORS)} or a module")
    p.add_argument("--judge", default="lugrectl", help="lugrectl, balance, MODULE:FN")
    p.add_argument("--jobs", type=int, default=1)
    p.add_argument("--misses", action="store_true", help="print only what scores below 1")
    p.add_argument("--keep", metavar="COMMIT", help="keep the summary: messy.json, plain.json")
    return p


def main(argv: Sequence[str] | None = None) -> int:
    """Draw, judge, print; keep the summary where asked."""
    args = parser().parse_args(argv)
    first, _, last = args.seeds.partition(":")
    seeds = range(int(first), int(last) if last else int(first) + 1)
    what = {k: getattr(args, k) for k in ("kind", "generator", "judge")}
    found = []
    for row in rows(seeds, args.jobs, **what):
        found.append(row)
        if row.points < 1 or not args.misses:
            print(row.line, flush=True)
    said = summary(found)
    print(*(f"{name:30s} {value}" for name, value in said.items()), sep="\n")
    print(table([row.values for row in found]))
    if args.keep and args.judge == "balance":
        cpu = float(np.median([row.answer.cpu for row in found]))
        plain = {"commit": args.keep, "drives": len(found), "cpu": cpu}
        key = f"{args.generator}, {args.kind}, seeds {args.seeds}"
        keep(RESULTS / "plain.json", key, plain | value_summary([row.values for row in found]))
    elif args.keep:
        key = f"{args.kind}/{args.generator}/{args.judge}/{args.seeds}"
        keep(RESULTS / "messy.json", key, {"commit": args.keep} | said)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
