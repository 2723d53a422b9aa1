"""``python -m tests.blind.slim RESULTS.jsonl KEPT.jsonl``: keep what the tables need, to commit."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from .__main__ import read

TOP = ("key", "kind", "names", "strength", "seed", "at", "problems", "cpu", "wall", "floor")
TRUTH = ("travel", "motion", "hard", "machine", "excitation", "rate", "duration", "position_only")
HIDDEN = ("name", "parameters", "depends_on", "visible")
ERROR = ("refitted", "augmented", "noise_floor")


def slim(line: Mapping[str, Any]) -> dict[str, Any]:
    """One line with what :mod:`tests.blind.score` counts and what a table names."""
    kept = picked(line, TOP)
    if "crash" in line:
        kept["crash"] = line["crash"].strip().splitlines()[-1]
    if "truth" in line:
        effects = [picked(e, HIDDEN) for e in line["truth"]["effects"]]
        kept["truth"] = picked(line["truth"], TRUTH) | {"effects": effects}
    if "answer" in line:
        kept["answer"] = _answer(line["answer"])
    return kept


def _answer(answer: Mapping[str, Any]) -> dict[str, Any]:
    effects = [
        {
            "name": e["name"],
            "parameters": {k: picked(p, ("value", "ci95")) for k, p in e["parameters"].items()},
            "alternatives": [picked(a, ("name",)) for a in e["alternatives"]],
        }
        for e in answer["effects"]
    ]
    error = picked(answer.get("error") or {}, ERROR)
    kept = picked(answer, ("verdict", "depends_on", "reason"))
    return kept | {"effects": effects, "error": error or None}


def picked(of: Mapping[str, Any], keys: Sequence[str]) -> dict[str, Any]:
    return {k: of[k] for k in keys if k in of}


def main(argv: Sequence[str] | None = None) -> int:
    p = argparse.ArgumentParser(prog="python -m tests.blind.slim", description=__doc__)
    p.add_argument("results", type=Path)
    p.add_argument("kept", type=Path)
    args = p.parse_args(argv)
    lines = [json.dumps(slim(line)) for line in read(args.results)]
    args.kept.write_text("\n".join(lines) + "\n")
    print(f"{args.kept}: {len(lines)} records, {args.kept.stat().st_size / 1e3:.0f} kB")
    return 0


if __name__ == "__main__":
    sys.exit(main())
