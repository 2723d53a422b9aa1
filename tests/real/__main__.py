"""``python -m tests.real``: measured logs, what a judge says of each, and whether it is right.

A line for each row: "right" (verdict, names, values, residual), "named" (verdict and names
alone) or "WRONG"; then the totals.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from pathlib import Path

from ..scores.judges import THREADS
from . import page
from .ask import LIMIT, ask
from .row import Row, score
from .rows import all_rows

ROOT = Path(__file__).parents[2]
DATA = Path(os.environ.get("LUGRECTL_DATA", ROOT.parent / "shared" / "data"))
RESULTS = ROOT / "notebooks" / "results" / "real.json"


def parser() -> argparse.ArgumentParser:
    p = argparse.ArgumentParser(prog="python -m tests.real", description=__doc__)
    p.add_argument("--row", action="append", help="a name or a part of it; may be repeated")
    p.add_argument("--group", help="rows of one group: table, map, format")
    p.add_argument("--judge", default="lugrectl", help="lugrectl or MODULE:FUNCTION")
    p.add_argument("--data", type=Path, default=DATA, help="folder of the logs")
    p.add_argument("--limit", type=float, default=LIMIT, help="most seconds for a row")
    p.add_argument("--keep", nargs="?", type=Path, const=RESULTS, metavar="FILE",
                   help=f"write the results as JSON (default {RESULTS.name})")  # fmt: skip
    p.add_argument("--list", action="store_true", help="print the rows and run nothing")
    return p


def chosen(args: argparse.Namespace) -> list[Row]:
    """The rows that the options ask for."""
    rows = all_rows()
    if args.group:
        rows = [row for row in rows if row.group == args.group]
    if args.row:
        rows = [row for row in rows if any(_meant(text, row, rows) for text in args.row)]
    if not rows:
        raise SystemExit("No row has such a name; --list prints them.")
    return rows


def _meant(text: str, row: Row, rows: Sequence[Row]) -> bool:
    """Whether a text names this row: in full where one is called so, else in part."""
    return text == row.name if any(text == one.name for one in rows) else text in row.name


def main(argv: Sequence[str] | None = None) -> int:
    args = parser().parse_args(argv)
    rows = chosen(args)
    if args.list:
        for row in rows:
            print(f"{row.name:{page.WIDTH}s} {row.group:7s} {len(row.sources):2d} {row.known}")
        return 0
    os.environ |= dict.fromkeys(THREADS, "1")
    lines: list[page.Line] = []
    for row in rows:
        missing = row.missing(args.data)
        if missing:
            print(f"{row.name:{page.WIDTH}s} left out: {args.data / missing[0]} is not there")
            continue
        answer = ask(row, args.data, args.judge, args.limit)
        lines.append((row, answer, score(row, answer)))
        print(page.line(*lines[-1]), flush=True)
    print(page.closing(lines))
    if args.keep:
        page.keep(args.keep, args.judge, lines)
    return 0 if lines else 2


if __name__ == "__main__":
    sys.exit(main())
