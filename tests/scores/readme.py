"""``python -m tests.scores.readme``: write README's figures from the result files.

Between ``<!-- figures:right -->`` and ``<!-- end -->`` stands how often a diagnosis is right, by
the newest ``notebooks/results/blind-*.jsonl``; between ``<!-- figures:speed -->`` and
``<!-- end -->`` how long things take, by ``notebooks/results/speed.json``; between
``<!-- figures:demo -->`` and ``<!-- end -->`` what the demo prints, by
``notebooks/results/demo.txt``, which ``--picture`` writes when it draws ``notebooks/demo.png``;
between ``<!-- figures:cycles -->`` and ``<!-- end -->`` limit cycles, which it simulates.
``--check`` writes nothing and fails where README says something else.
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
    seeds = [x["seed"] for x in lines]
    its = known.get("messy.json", {}).get("commit", known[path.name]["commit"])
    other = f"; messy: commit {its}" if its != known[path.name]["commit"] else ""
    said = (
        f"{len(lines)} records of an independent simulator, seeds {min(seeds)} to {max(seeds)}, "
        f"{max(x['at'] for x in lines)[:10]}, commit {known[path.name]['commit']}"
        f"{other}."
    )
    rows = [*counted_rows(lines), *messy()]
    return f"{table(('what is hidden', 'right'), rows)}\n\n{said}\n"


def messy() -> list[tuple[str, str]]:
    """How often it is right on drives as machines are, of both generators."""
    path = RESULTS / "messy.json"
    kept = json.loads(path.read_text()) if path.exists() else {}
    said = {"effect": "messy: one effect", "none": "messy: nothing missing"}
    made = []
    for kind, words in said.items():
        runs = [run for key, run in kept.items() if key.startswith(f"{kind}/")]
        count = sum(run["records"] for run in runs)
        points = sum(run["points"] * run["records"] for run in runs)
        if not count:
            continue
        made.append((words, f"{round(points, 1):g} points of {count}"))
    return made


def speed() -> str:
    """How long it takes: a line for each."""
    s = json.loads((RESULTS / "speed.json").read_text())
    nothing, one = (s["diagnose"][kind]["seconds"] for kind in ("nothing missing", "one effect"))
    faster = float(f"{s['times_faster']:.2g}")
    rows = [
        (
            "velocity loop of the paper with the proposed observer, 10 s at 1 kHz",
            f"{s['simulate_ms']:.1f} ms, {faster:.0f} times faster than python-control (LSODA)",
        ),
        (
            "diagnosis of 30 s at 1 kHz",
            f"{spread(nothing)} with nothing missing, {spread(one)} with one effect",
        ),
    ]
    cores = f"{s['cores']} core{'s' * (s['cores'] != 1)} ({s['processor']})"
    said = f"{s['date']}, {cores}, commit {s['commit']}."
    return f"{table(('what', 'time'), rows)}\n\n{said}\n"


def spread(seconds: Sequence[float]) -> str:
    """The shortest and the longest."""
    low, high = f"{min(seconds):.0f}", f"{max(seconds):.0f}"
    return f"{low} s" if low == high else f"{low} to {high} s"


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

    names = ("natural", "existing", "proposed")
    alike, raised = (
        lg.compare_observers(lg.table1(), names, scenarios="cycle", equal=equal)
        for equal in (False, True)
    )
    rows = [(name, swing(alike[name].cycle), swing(raised[name].cycle)) for name in names]
    head = (
        "cycle after 0.1 rad, friction believed 1.2 times",
        "same gains",
        "same linear feedback",
    )
    return f"{table(head, rows)}\n"


def swing(size: float) -> str:
    """A limit cycle, peak to peak; below a nanoradian it is rounding."""
    return f"{1e3 * size:.1f} mrad" if size > 1e-9 else "none"


def shown(report: str) -> str:
    """What README has room for: the verdict with what it is worth, and the torque budget."""
    verdict, effect = report.split("\n\n")[:2]
    effect = effect.split("\n  Shares are of")[0]  # how to read it stands in the report
    effect = "\n".join(row for row in effect.splitlines() if not row.startswith(MINOR))
    return f"{verdict}\n\n{effect}\n"


BLOCKS: dict[str, Callable[[], str]] = {
    "demo": demo,
    "right": right,
    "speed": speed,
    "cycles": cycles,
}


def filled(text: str, blocks: dict[str, str]) -> str:
    """The text with every marked block replaced; KeyError for a mark that is not known."""
    return BLOCK.sub(lambda m: f"{m[1]}{blocks[m[2]]}{m[4]}", text)


def marks(text: str) -> list[str]:
    """The names of the blocks that a text has."""
    return [m[2] for m in BLOCK.finditer(text)]


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
    missing = sorted(set(BLOCKS) - set(marks(text)))
    made = filled(text, {name: make() for name, make in BLOCKS.items()})
    if not args.check:
        README.write_text(made)
    for name in missing:
        print(f"README.md has no block <!-- figures:{name} -->", file=sys.stderr)
    if args.check and made != text:
        print("README.md: run python -m tests.scores.readme", file=sys.stderr)
    return int(bool(missing) or (args.check and made != text))


if __name__ == "__main__":
    sys.exit(main())
