"""``python -m tests.blind.maps``: draw friction maps, diagnose them, say how often it was right."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import dataclass

import lugrectl as lg

from ..drives.steady import EFFECTS, STRANGERS, draw
from .__main__ import seeds
from .score import credit

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
        found = lg.diagnose(runs, made.model).summary()
    except lg.Refused as no:
        return Answer(name, seed, f"refused: {no}", 0.0, ())
    effects = [e for e in found["effects"] if "harmonic" not in e["parameters"]]
    held = [
        estimate["ci95"][0] <= made.values[k] <= estimate["ci95"][1]
        for e in effects
        for k, estimate in e["parameters"].items()
        if e["name"] == name and estimate["ci95"] and k in made.values
    ]
    said = f"{found['verdict']} {' '.join(e['name'] for e in effects)}"
    return Answer(name, seed, said, _right(name, found["verdict"], effects), tuple(held))


def _right(name: str, verdict: str, effects: list[dict]) -> float:
    """As for the records, whatever a swing with the angle makes of the verdict."""
    if name in STRANGERS:
        return float(verdict == "unexplained")
    if name == "none":
        return float(not effects and verdict != "unexplained")
    if verdict != "unexplained":
        verdict = "ambiguous" if any(e["alternatives"] for e in effects) else "found"
    return credit({"names": [name], "answer": {"verdict": verdict, "effects": effects}})


def main(arguments: Sequence[str] | None = None) -> int:
    p = argparse.ArgumentParser(prog="python -m tests.blind.maps", description=__doc__)
    p.add_argument("--effects", default="all", help=f"{', '.join(SETS)}, or one name")
    p.add_argument("--strength", type=float, default=0.2, help="of friction")
    p.add_argument("--seeds", type=seeds, default=range(600, 606), help="A:B or one number")
    args = p.parse_args(arguments)
    answers = []
    for name in SETS.get(args.effects, (args.effects,)):
        for seed in args.seeds:
            answers.append(answered(name, seed, args.strength))
            if answers[-1].right < 1.0:
                print(f"{name} {seed}: {answers[-1].said}", flush=True)
    held = [inside for a in answers for inside in a.held]
    share = sum(a.right for a in answers) / len(answers)
    print(f"right: {share:.0%} of {len(answers)}; intervals that hold: {sum(held)} of {len(held)}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
