"""``python -m tests.scores.readme``: write README's figures from the result files.

Between ``<!-- figures:NAME -->`` and ``<!-- end -->`` stands what the function of that name makes
of the files in ``notebooks/results``; limit cycles it simulates. ``--picture`` draws
``notebooks/demo.png`` and writes the text of the demo. ``--check`` writes nothing and fails where
README says something else.
"""

from __future__ import annotations

import argparse
import json
import re
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

from .counts import rows as counted_rows
from .rig import read

ROOT = Path(__file__).parents[2]
README = ROOT / "README.md"
RESULTS = ROOT / "notebooks" / "results"
MINOR = ("  offset", "  of it")  # rows of the budget that README has no room for
BLOCK = re.compile(r"(<!-- figures:(\w+) -->\n)(.*?)(<!-- end -->)", re.DOTALL)


def newest() -> Path:
    """The result file of the latest blind run."""
    return max(RESULTS.glob("blind-*.jsonl"))


def right() -> str:
    """How often it is right: six lines."""
    path = newest()
    lines, known = read(path), json.loads((RESULTS / "about.json").read_text())
    seeds, date = [x["seed"] for x in lines], max(x["at"] for x in lines)[:10]
    own, its = known[path.name]["commit"], known["messy.json"]["commit"]
    commits = own + f"; messy: commit {its}" * (its != own)
    said = f"{len(lines)} records of an independent simulator, seeds {min(seeds)} to {max(seeds)}"
    rows = [*counted_rows(lines), *messy()]
    return f"{table(('what is hidden', 'right'), rows)}\n\n{said}, {date}, commit {commits}.\n"


def messy() -> list[tuple[str, str]]:
    """How often it is right on drives as machines are."""
    kept, made = json.loads((RESULTS / "messy.json").read_text()), []
    for kind, words in (("effect", "messy: one effect"), ("none", "messy: nothing missing")):
        runs = [run for key, run in kept.items() if key.startswith(f"{kind}/")]
        points = sum(run["points"] * run["records"] for run in runs)
        made.append((words, f"{round(points, 1):g} points of {sum(r['records'] for r in runs)}"))
    return made


def speed() -> str:
    """How long it takes: a line for each."""
    s = json.loads((RESULTS / "speed.json").read_text())
    nothing, one = (s["diagnose"][kind]["seconds"] for kind in ("nothing missing", "one effect"))
    loop = "velocity loop of the paper with the proposed observer, 10 s at 1 kHz"
    faster = float(f"{s['times_faster']:.2g}")
    spent = f"{spread(nothing)} with nothing missing, {spread(one)} with one effect"
    rows = [
        (loop, f"{s['simulate_ms']:.1f} ms, {faster:.0f} times faster than python-control (LSODA)"),
        ("diagnosis of 30 s at 1 kHz", spent),
    ]
    cores = f"{s['cores']} core{'s' * (s['cores'] != 1)} ({s['processor']})"
    return f"{table(('what', 'time'), rows)}\n\n{s['date']}, {cores}, commit {s['commit']}.\n"


def spread(seconds: Sequence[float]) -> str:
    """The shortest and the longest."""
    return " to ".join(dict.fromkeys(f"{x:.0f}" for x in (min(seconds), max(seconds)))) + " s"


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A Markdown table of text, to the left."""
    lines = [head, [":---"] * len(head), *rows]
    return "\n".join(f"|{'|'.join(line)}|" for line in lines)


def demo() -> str:
    """What the demo prints first: verdict and torque budget."""
    return f"```\n{(RESULTS / 'demo.txt').read_text()}```\n"


def cycles() -> str:
    """Limit cycles of a position loop with friction believed too high."""
    import lugrectl as lg

    names, p = ("natural", "existing", "proposed"), lg.table1()
    both = [lg.compare_observers(p, names, scenarios="cycle", equal=e) for e in (False, True)]
    sizes = {name: [found[name].cycle for found in both] for name in names}
    # below a nanoradian it is rounding
    shown = {
        k: [f"{1e3 * x:.1f} mrad" if x > 1e-9 else "none" for x in v] for k, v in sizes.items()
    }
    head = "cycle after 0.1 rad, friction believed 1.2 times", "same gains", "same linear feedback"
    return f"{table(head, [(name, *said) for name, said in shown.items()])}\n"


def shown(report: str) -> str:
    """What README has room for: the verdict with what it is worth, and the torque budget."""
    verdict, effect = report.split("\n\n")[:2]
    effect = effect.split("\n  Shares are of")[0]  # how to read it stands in the report
    effect = "\n".join(row for row in effect.splitlines() if not row.startswith(MINOR))
    return f"{verdict}\n\n{effect}\n"


BLOCKS: dict[str, Callable[[], str]] = {one.__name__: one for one in (demo, right, speed, cycles)}


def filled(text: str) -> str:
    """The text with every marked block written anew; KeyError for a mark that is not known."""
    return BLOCK.sub(lambda m: f"{m[1]}{BLOCKS[m[2]]()}{m[4]}", text)


def picture(path: Path) -> str:
    """Before and after, residual torque and ranking of the demo's diagnosis; returns its text."""
    from importlib.resources import files

    from matplotlib.figure import Figure

    import lugrectl as lg
    from lugrectl.report import canvas, diagnosis_plots

    demo = files("lugrectl") / "demo"
    found = lg.diagnose(str(demo / "record.csv"), str(demo / "model.toml"))
    with canvas.style():
        figure = Figure(figsize=(12.4, 6.8), layout="constrained")
        grid = figure.add_gridspec(2, 2)
        diagnosis_plots.motion(found, figure.add_subplot(grid[0, :]))
        diagnosis_plots.torque(found, figure.add_subplot(grid[1, 0]))
        diagnosis_plots.bars(found, figure.add_subplot(grid[1, 1]))
        figure.savefig(path, dpi=80, metadata={"Software": None})
    return str(found)


def main(argv: Sequence[str] | None = None) -> int:
    p = argparse.ArgumentParser(prog="python -m tests.scores.readme", description=__doc__)
    p.add_argument("--check", action="store_true", help="write nothing, fail where README differs")
    p.add_argument("--picture", action="store_true", help="draw notebooks/demo.png instead")
    args = p.parse_args(argv)
    if args.picture:
        text = picture(ROOT / "notebooks" / "demo.png")
        (RESULTS / "demo.txt").write_text(shown(text))
        return 0
    text = README.read_text()
    made = filled(text)
    if not args.check:
        README.write_text(made)
    elif made != text:
        print("README.md: run python -m tests.scores.readme", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
