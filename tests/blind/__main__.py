"""``python -m tests.blind``: draw records, diagnose them, say how often the answer was right.

One JSON line per record goes to DIR/results.jsonl as it is done; what is there is not done again.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from functools import partial
from pathlib import Path

from . import front, page, work
from .plan import STRENGTHS, Task, tasks

ROUND = 50  # records for each process before it is replaced: compiled code is never given back
DEFAULT = {"none": 200, "strangers": 48, "pairs": 60}  # where no effects are asked for


def parser() -> argparse.ArgumentParser:
    p = argparse.ArgumentParser(prog="python -m tests.blind", description=__doc__)
    p.add_argument("--effects", help="comma separated: all, known (to the package), none, names")
    p.add_argument("--strength", choices=[*STRENGTHS, "both"], default="both")
    p.add_argument("--seeds", type=seeds, default=range(50000, 50004), help="A:B or one number")
    p.add_argument("--none", type=int, help="records with nothing missing")
    p.add_argument(
        "--unknown", dest="strangers", type=int, help="records with an effect outside the catalogue"
    )
    p.add_argument("--pairs", type=int, help="records with two effects")
    p.add_argument("--hard", type=float, default=0.0, help="share of records with a difficulty")
    p.add_argument("--exported", type=float, default=0.0, help="share of records in other forms")
    p.add_argument("--short", action="store_true", help="records of 20 s at 500 Hz, to try out")
    p.add_argument("--jobs", type=int, default=1)
    p.add_argument("--limit", type=int, default=1800, help="most seconds for a record")
    p.add_argument("--out", type=Path, default=Path(tempfile.gettempdir()) / "lugrectl-blind")
    p.add_argument("--retry", action="store_true", help="do again what crashed")
    p.add_argument("--summary", type=Path, metavar="FILE", help="print a results file, run nothing")
    return p


def seeds(text: str) -> range:
    first, _, last = text.partition(":")
    return range(int(first), int(last)) if last else range(int(first), int(first) + 1)


def planned(args: argparse.Namespace) -> list[Task]:
    """The tasks that the options ask for."""
    counts = {k: getattr(args, k) for k in DEFAULT}
    asked = args.effects is not None or any(n is not None for n in counts.values())
    counts = {k: n if n is not None else 0 if asked else DEFAULT[k] for k, n in counts.items()}
    effects = _effects(args.effects if asked else "all")
    strengths = list(STRENGTHS) if args.strength == "both" else [args.strength]
    shares = {"hard": args.hard, "exported": args.exported}
    return tasks(effects, strengths, args.seeds, **counts, **shares, short=args.short)


def _effects(text: str | None) -> list[str]:
    from ..drives import CATALOGUE

    groups = {"all": list(CATALOGUE)}
    if text and "known" in text.split(","):
        import lugrectl as lg

        groups["known"] = [name for name in CATALOGUE if name in lg.effects()]
    return [
        name for entry in (text or "").split(",") if entry for name in groups.get(entry, [entry])
    ]


def read(path: Path) -> list[dict]:
    """Lines of a results file, the last of each key; a torn last line is left out."""
    lines: dict[str, dict] = {}
    for row in path.read_text().splitlines() if path.exists() else []:
        try:
            line = json.loads(row)
        except json.JSONDecodeError:
            continue
        lines[line["key"]] = line
    return list(lines.values())


def run(todo: Sequence[Task], do: Callable[[Task], dict], jobs: int) -> Iterator[dict]:
    """Lines as they are done, in processes of one thread each.

    Where a process dies, the records that may have been its own are done again one by one, and
    the one that does it again is told as a crash.
    """
    left = {t.key: t for t in todo}
    while left:
        try:
            yield from _pooled(left, list(left.values())[: ROUND * jobs], do, jobs)
        except BrokenProcessPool:
            for task in list(left.values())[:jobs]:
                try:
                    yield from _pooled(left, [task], do, 1)
                except BrokenProcessPool:
                    yield work.head(left.pop(task.key)) | {"crash": "the process died"}


def _pooled(
    left: dict[str, Task], todo: Sequence[Task], do: Callable[[Task], dict], jobs: int
) -> Iterator[dict]:
    """Do these tasks and take each off those that are left."""
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(jobs, mp_context=context) as pool:
        running = {pool.submit(do, task): task for task in todo}
        for future in as_completed(running):
            made = future.result()
            del left[running[future].key]
            yield made


def main(argv: Sequence[str] | None = None) -> int:
    args = parser().parse_args(argv)
    if args.summary:
        lines = read(args.summary)
        print(page.text(lines))
        return 0
    work.one_thread()
    args.out.mkdir(parents=True, exist_ok=True)
    path = args.out / "results.jsonl"
    done = {x["key"] for x in read(path) if not (args.retry and "crash" in x)}
    plan = planned(args)
    todo = [t for t in plan if t.key not in done]
    print(f"{len(plan)} records, {len(todo)} to do, results in {path}", file=sys.stderr)
    do = partial(work.line, limit=args.limit)
    with path.open("a") as file:
        for i, line in enumerate(run(todo, do, args.jobs), 1):
            file.write(json.dumps(line) + "\n")
            file.flush()
            print(
                f"{i}/{len(todo)} {line['key']}: {front.called(line)}", file=sys.stderr, flush=True
            )
    wanted = {t.key for t in plan}
    lines = [x for x in read(path) if x["key"] in wanted]
    print(page.text(lines))
    return 0


if __name__ == "__main__":
    sys.exit(main())
