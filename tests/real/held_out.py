"""``python -m tests.real.held_out``: torque error on runs that no fit has seen, by set and model.

RMS torque residual over RMS torque on the same samples of unseen runs, in per cent. Every model
is judged on the same smoothed signals. EMPS has one run only, so nothing there is unseen.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..scores.judges import THREADS
from .__main__ import DATA, RESULTS
from .models import MODELS, StandIn
from .motion import Motion, Run, motion_of, rms
from .page import WIDTH, commit, keep
from .row import Source
from .sets import SPLITS, Cut, Split

CHANNELS = ("u", "theta", "w")
DEFAULT = ("ours", "hand", "trees")


def run_of(source: Source, data: Path, split: Split) -> Run:
    """A run of a set: as the package reads it, and smoothed; one point if it is steady."""
    from lugrectl.record import read_log

    log = read_log(data / source.file, motion=split.model["motion"], **source.options)
    columns = {"t": log.t, **{k: log.channels[k] for k in CHANNELS if k in log.channels}}
    whole = np.all([np.isfinite(x) for x in columns.values()], axis=0)
    clean = {k: x[whole] for k, x in columns.items()}
    return Run(log, point(clean) if split.steady else motion_of(clean, split.by))


def point(log: Mapping[str, np.ndarray]) -> Motion:
    """Mean torque over mean speed, the first row left out."""
    w, u = (np.array([float(np.mean(log[k][1:]))]) for k in ("w", "u"))
    zero = np.zeros(1)
    return Motion(zero, u, None, w, zero, np.ones(1, bool))


def errors(split: Split, data: Path, models: Sequence[str]) -> dict[str, Any]:
    """For each model the error on the unseen runs of each cut, and over all of them together."""
    runs: dict[str, Run] = {}

    def read(sources: Sequence[Source]) -> list[Run]:
        for source in sources:
            if source.file not in runs:
                runs[source.file] = run_of(source, data, split)
        return [runs[source.file] for source in sources]

    made: dict[str, Any] = {"readme": [cut.readme for cut in split.cuts], "models": {}}
    if split.steady:
        made["readme"] = [split.readme]
    for name in models:
        pairs = [_of_cut(MODELS[name], split, cut, read) for cut in split.cuts]
        every = [_share(*pair) for pair in pairs]
        joined = _share(*(np.concatenate(x) for x in zip(*pairs, strict=True)))
        made["models"][name] = [joined] if split.steady else every
    return made


def _of_cut(model: Any, split: Split, cut: Cut, read: Any) -> tuple[np.ndarray, np.ndarray]:
    """Residual and torque on the samples that count of the unseen runs."""
    of, unseen = model(read(cut.train), split, cut), read(cut.unseen)
    if isinstance(of, StandIn):
        print(f"{split.name}: the diagnosis has no model: nothing is explained", file=sys.stderr)
    residual = np.concatenate([of(run)[run.motion.use] for run in unseen])
    return residual, np.concatenate([run.motion.u[run.motion.use] for run in unseen])


def _share(residual: np.ndarray, torque: np.ndarray) -> float:
    return rms(residual) / rms(torque)


def percent(values: Sequence[float | None]) -> str:
    return " ".join("-" if v is None else f"{100 * v:.2f}" for v in values)


def main(argv: Sequence[str] | None = None) -> int:
    p = argparse.ArgumentParser(prog="python -m tests.real.held_out", description=__doc__)
    p.add_argument("--set", help="sets whose name contains this")
    p.add_argument("--models", default=",".join(DEFAULT), help=f"of {','.join(MODELS)}")
    p.add_argument("--data", type=Path, default=DATA)
    p.add_argument("--keep", nargs="?", type=Path, const=RESULTS, metavar="FILE")
    args = p.parse_args(argv)
    os.environ |= dict.fromkeys(THREADS, "1")
    models = args.models.split(",")
    print(f"{'set':{WIDTH}s} {'README':>14s} " + " ".join(f"{m:>14s}" for m in models))
    kept = {}
    for split in SPLITS:
        if args.set and args.set not in split.name:
            continue
        missing = [f for f in split.files() if not (args.data / f).is_file()]
        if missing:
            print(f"{split.name:{WIDTH}s} left out: {args.data / missing[0]} is not there")
            continue
        made = kept[split.name] = errors(split, args.data, models)
        cells = [percent(made["readme"]), *(percent(made["models"][m]) for m in models)]
        print(f"{split.name:{WIDTH}s} " + " ".join(f"{c:>14s}" for c in cells), flush=True)
    if args.keep:
        keep(args.keep, "held_out", {"commit": commit(), "sets": kept})
    return 0


if __name__ == "__main__":
    sys.exit(main())
