"""``python -m tests.messy --kind effect --seeds 100:140``: score a judge on messy records."""

from __future__ import annotations

import argparse
from pathlib import Path

from .bench import RESULTS, keep, pairs, rows, summary
from .kept import GENERATORS


def main() -> None:
    """Draw, judge, print; keep the summary where asked."""
    given = _parser().parse_args()
    first, _, last = given.seeds.partition(":")
    seeds = range(int(first), int(last) if last else int(first) + 1)
    what = {k: getattr(given, k) for k in ("kind", "generator", "judge", "prototype", "cache")}
    found = []
    for row in rows(seeds, given.jobs, **what):
        found.append(row)
        if row.points < 1 or not given.misses:
            print(row.line, flush=True)
    said = summary(found)
    print(*pairs(said), sep="\n")
    if given.keep:
        key = f"{given.kind}/{given.generator}/{given.judge}/{seeds.start}:{seeds.stop}"
        keep(Path(given.keep), key, said)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m tests.messy", description=__doc__)
    parser.add_argument("--kind", choices=("effect", "none", "unknown", "sound"), default="effect")
    parser.add_argument("--seeds", default="100:140", help="FIRST:LAST, LAST not included")
    parser.add_argument("--generator", choices=GENERATORS, default="first")
    parser.add_argument("--judge", default="lugrectl", help="lugrectl, prototype, MODULE:FUNCTION")
    parser.add_argument("--prototype", help="folder of comparison_prototype.py")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--misses", action="store_true", help="print only what scores below 1")
    parser.add_argument("--keep", nargs="?", const=str(RESULTS), help="JSON file of results")
    parser.add_argument("--cache", help="folder of drawn cases")
    return parser


if __name__ == "__main__":
    main()
