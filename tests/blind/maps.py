"""``python -m tests.blind.maps``: draw friction maps, diagnose them, say how often it was right."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterable
from dataclasses import dataclass

import lugrectl as lg
from lugrectl.errors import Refused
from lugrectl.model import model_from_dict
from lugrectl.results import Finding

from ..rig.steady import EFFECTS, STRANGERS, draw

SETS = {"all": EFFECTS, "strangers": STRANGERS, "none": ("none",)}


@dataclass(frozen=True)
class Answer:
    """What was said of one map: ``right`` is 1, 1/2 or 0, ``held`` one entry per interval."""

    name: str
    seed: int
    said: str
    right: float
    held: tuple[bool, ...]


def answered(name: str, seed: int, strength: float) -> Answer:
    """One map with its answer; a swing with the angle, of which the map says all, is apart."""
    made = draw(name, seed, strength)
    runs = [lg.Record(**run, source=f"run{i}") for i, run in enumerate(made.runs)]
    try:
        found = lg.diagnose(runs, model_from_dict(made.model, "drawn"))
    except Refused as no:
        return Answer(name, seed, f"refused: {no}", 0.0, ())
    named = {e.name: e for e in found.effects if "harmonic" not in e.parameters}
    told = named[name].parameters if name in named else {}
    held = [
        e.ci95[0] <= made.values[k] <= e.ci95[1] for k, e in told.items()
        if e.ci95 and k in made.values
    ]  # fmt: skip
    said = f"{found.verdict} {' '.join(named)}"
    return Answer(name, seed, said, _right(name, found.verdict, named), tuple(held))


def _right(name: str, verdict: str, named: dict[str, Finding]) -> float:
    """As for the records: the name alone is right, among at most three half."""
    if name in STRANGERS:
        return float(verdict == "unexplained")
    if verdict == "unexplained":
        return 0.0
    if name == "none":
        return float(not named)
    tied = {c.name for e in named.values() for c in e.alternatives}
    if len(named) != 1 or len(tied) > 2:
        return 0.0
    return 1.0 if name in named and not tied else 0.5 if name in {*named, *tied} else 0.0


def main(arguments: Iterable[str] | None = None) -> int:
    p = argparse.ArgumentParser(prog="python -m tests.blind.maps", description=__doc__)
    p.add_argument("--effects", default="all", help=f"{', '.join(SETS)}, or one name")
    p.add_argument("--strength", type=float, default=0.2, help="of friction")
    p.add_argument("--seeds", default="600:606", help="A:B")
    args = p.parse_args(None if arguments is None else list(arguments))
    first, last = map(int, args.seeds.split(":"))
    names = SETS.get(args.effects, (args.effects,))
    answers = []
    for name in names:
        for seed in range(first, last):
            answers.append(answered(name, seed, args.strength))
            if answers[-1].right < 1.0:
                print(f"{name} {seed}: {answers[-1].said}", flush=True)
    held = [inside for a in answers for inside in a.held]
    share = sum(a.right for a in answers) / len(answers)
    print(f"right: {share:.0%} of {len(answers)}; intervals that hold: {sum(held)} of {len(held)}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
