"""``python -m tests.scores.drawn --kind effect --seeds 100:140``: score a judge on drawn drives.

``--judge balance`` asks for the plain answer alone.
"""

from __future__ import annotations

import argparse
import importlib
import json
import warnings
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from .judges import judge_named, timed
from .question import Answer, Question, coverage, false_names, points, values

RESULTS = Path(__file__).parents[2] / "notebooks" / "results"
GENERATORS = {
    "drives": "tests.drives.questions",
    "steady": "tests.drives.steady",
    "held_out": "tests.held_out.questions",
}
PLAIN = ("J", "Fc", "Fv")  # what plain.json keeps


@dataclass(frozen=True)
class Row:
    """One record, judged."""

    question: Question
    answer: Answer

    @property
    def points(self) -> float:
        return points(self.question, self.answer)

    @property
    def line(self) -> str:
        """What is printed of it."""
        q, a = self.question, self.answer
        named = " ".join([*a.effects, "|", *a.alternatives, "|", *a.depends_on, a.reason])
        head = f"{q.seed:5d}  {q.about}  {q.effect} {'~ ' * bool(q.alike)}{' '.join(q.alike)}"
        return f"{head}: {a.verdict}  {named}  {self.points:.1f}  {a.seconds:.2f} s"


def judged(seed: int, kind: str, generator: str, judge: str) -> Row:
    """Draw and judge one; a judge that fails has answered ``error``."""
    module = importlib.import_module(GENERATORS.get(generator, generator))
    question = module.draw(seed, kind)
    logs = [(log, {}) for log in (question.record, *question.more)]
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            answer = timed(judge_named(judge), logs, question.model)
    except Exception as error:  # one record must not end the bench
        answer = Answer("error", reason=f"{type(error).__name__}: {error}")
    return Row(question, answer)


def summary(found: Sequence[Row]) -> dict[str, Any]:
    """Points, false names, seconds and coverage."""
    seconds = [row.answer.seconds for row in found if np.isfinite(row.answer.seconds)] or [0.0]
    each = [values(row.question, row.answer) for row in found]
    held = [(name, v["inside"]) for row in each for name, v in row.items() if v]
    truths: dict[str, list[float]] = {}
    for row in sorted(found, key=lambda row: row.question.effect):
        truths.setdefault(row.question.effect, []).append(row.points)
    return {
        "records": len(found),
        "points": round(float(np.mean([row.points for row in found])), 4),
        "false_names": sum(bool(false_names(row.question, row.answer)) for row in found),
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
    path.write_text(json.dumps(dict(sorted({**kept, key: said}.items())), indent=1) + "\n")


def parser() -> argparse.ArgumentParser:
    p = argparse.ArgumentParser(prog="python -m tests.scores.drawn", description=__doc__)
    p.add_argument("--kind", default="effect", help="one of the generator's")
    p.add_argument("--seeds", default="100:140", help="FIRST:LAST, LAST not included")
    p.add_argument("--generator", default="drives", help=f"{', '.join(GENERATORS)} or a module")
    p.add_argument("--judge", default="lugrectl", help="lugrectl, balance, MODULE:FN")
    p.add_argument("--jobs", type=int, default=1)
    p.add_argument("--keep", metavar="COMMIT", help="keep the summary: messy.json, plain.json")
    return p


def main(argv: Sequence[str] | None = None) -> int:
    """Draw, judge, print; keep the summary where asked."""
    args = parser().parse_args(argv)
    first, last = map(int, args.seeds.split(":"))
    work = partial(judged, kind=args.kind, generator=args.generator, judge=args.judge)
    found = []
    with ProcessPoolExecutor(args.jobs) as pool:
        for row in (pool.map if args.jobs > 1 else map)(work, range(first, last)):
            found.append(row)
            print(row.line, flush=True)
    said = summary(found)
    known = coverage([values(row.question, row.answer) for row in found])
    for name, value in {**said, **known}.items():
        print(f"{name:30s} {value}")
    if args.keep and args.judge == "balance":
        cpu = float(np.median([row.answer.cpu for row in found]))
        plain = {"commit": args.keep, "drives": len(found), "cpu": cpu}
        plain |= {name: known[name] for name in PLAIN if name in known}
        keep(RESULTS / "plain.json", f"{args.generator}, {args.kind}, seeds {args.seeds}", plain)
    elif args.keep:
        key = f"{args.kind}/{args.generator}/{args.judge}/{args.seeds}"
        keep(RESULTS / "messy.json", key, {"commit": args.keep} | said)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
