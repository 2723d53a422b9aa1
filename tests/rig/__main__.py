"""``python -m tests.rig OUTDIR --effects all --seeds 0:3``: a folder per case."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path

from . import CATALOGUE, EXCITATIONS, MACHINES, STRANGERS, problems, sample

GROUPS = {"all": list(CATALOGUE), "strangers": list(STRANGERS), "none": ["none"]}


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="tests.rig", description=__doc__)
    parser.add_argument("outdir", type=Path)
    parser.add_argument(
        "--effects",
        default="all",
        help="comma separated: all, strangers, none, names, or a+b for two at once",
    )
    parser.add_argument("--seeds", default="0:3", help="first:last+1, or one number")
    parser.add_argument("--tries", type=int, default=5, help="draws per case until it is usable")
    parser.add_argument("--machine", choices=MACHINES)
    parser.add_argument("--excitation", choices=EXCITATIONS)
    parser.add_argument("--rate", type=float)
    parser.add_argument("--duration", type=float)
    parser.add_argument("--strength", type=float)
    parser.add_argument("--declared-error", type=float)
    parser.add_argument("--torque-noise", type=float)
    parser.add_argument("--position-only", action="store_true", default=None)
    return parser


def _seeds(text: str) -> range:
    first, _, last = text.partition(":")
    return range(int(first), int(last)) if last else range(int(first), int(first) + 1)


def main() -> int:
    args = vars(_parser().parse_args())
    outdir, effects, seeds = args.pop("outdir"), args.pop("effects"), _seeds(args.pop("seeds"))
    tries = args.pop("tries")
    fixed = {key: value for key, value in args.items() if value is not None}
    names = [name for entry in effects.split(",") for name in GROUPS.get(entry, [entry])]
    index = []
    for name in names:
        for seed in seeds:
            effect = name.split("+") if "+" in name else name
            case = sample(effect, seed, tries, **fixed)
            folder = case.write(outdir / f"{name}-{seed:02d}")
            wrong = problems(case)
            index.append({"case": folder.name, "problems": wrong})
            print(folder.name, "; ".join(wrong) or "ok", flush=True)
    bad = sum(bool(entry["problems"]) for entry in index)
    print(f"{len(index)} cases, {bad} with problems")
    (outdir / f"index-{effects.replace(',', '-')}.json").write_text(json.dumps(index, indent=1))
    return 0


if __name__ == "__main__":
    sys.exit(main())
