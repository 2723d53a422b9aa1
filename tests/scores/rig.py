"""``python -m tests.scores.rig``: draw records of the rig, diagnose them, count what was right.

One JSON line per record goes to DIR/results.jsonl as it is done; what is there is not done again.
Each is written to files, read and diagnosed as a user would, in a process of its own.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import tempfile
import time
import warnings
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np

from ..drives import CATALOGUE, STRANGERS, Case, exported, problems, sample
from ..drives.effects import find
from ..drives.record import model_text
from ..drives.sample import forms
from . import counts
from .judges import THREADS, apart

STRENGTHS = {"normal": 0.20, "weak": 0.08}
LIMIT = 1800  # s, for a record
ALIKE = (  # no record tells these from each other when both are there
    {"input_delay", "actuator_lag", "velocity_sensor_lag"},
    {"elastic_coupling", "backlash"},
    {"stribeck", "presliding"},
    {"constant_torque", "return_spring"},  # a spring with another rest
    {"gravity", "pose_dependent_inertia", "encoder_eccentricity"},
)
KEPT = ("verdict", "effects", "depends_on", "experiment", "error", "free_error", "torque_error",
        "record", "reason", "messages")  # fmt: skip


@dataclass(frozen=True)
class Task:
    """One record to draw and to diagnose."""

    kind: str  # "effect", "pair", "none" or "stranger"
    names: tuple[str, ...]
    strength: str
    seed: int
    hard: bool = False
    form: str = ""  # as which export it holds theta, w and u; "" as the rig's sensors give them

    @property
    def key(self) -> str:
        also = "".join(f" {word}" for word in ("hard" * self.hard, self.form) if word)
        return f"{'+'.join(self.names) or 'none'} {self.strength} {self.seed}{also}"

    @property
    def head(self) -> dict[str, Any]:
        """Which record it is, and when it was done."""
        own = {k: getattr(self, k) for k in ("key", "kind", "strength", "seed")}
        at = datetime.now(UTC).isoformat(timespec="seconds")
        return own | {"names": list(self.names), "at": at}

    def drawn(self, hard: float, forms_too: float) -> Task:
        """Made hard, and stored in another form, with these chances."""
        rng = np.random.default_rng([self.seed, *self.key.encode()])
        made, allowed = replace(self, hard=bool(rng.random() < hard)), forms(self.names)
        if not allowed or rng.random() >= forms_too:
            return made
        return replace(made, form=str(rng.choice(allowed)))


def planned(args: argparse.Namespace) -> list[Task]:
    """Every effect at every strength and seed, then the others, with seeds from the first on."""
    first, kinds, mixed = args.seeds.start, list(STRANGERS), _pairs(args.seeds.start)
    strengths = list(STRENGTHS) if args.strength == "both" else [args.strength]
    effects = {"all": list(CATALOGUE), "": []}.get(args.effects, args.effects.split(","))
    own = [("none", ()) if name == "none" else ("effect", (find(name).name,)) for name in effects]
    made = [Task(*one, s, seed) for seed in args.seeds for s in strengths for one in own]
    made += [Task("none", (), "normal", first + i) for i in range(args.none)]
    for i in range(args.unknown):
        made.append(Task("stranger", (kinds[i % len(kinds)],), strengths[0], first + i))
    made += [Task("pair", next(mixed), strengths[0], first + i) for i in range(args.pairs)]
    return list({t.key: t for t in (t.drawn(args.hard, args.exported) for t in made)}.values())


def _pairs(seed: int) -> Iterator[tuple[str, ...]]:
    """Two effects that one record can carry and tell apart, in an order of the seed's."""
    every = [pair for pair in combinations(CATALOGUE, 2) if together(*pair)]
    rng = np.random.default_rng(seed)
    while True:
        yield from (every[int(i)] for i in rng.permutation(len(every)))


def together(first: str, second: str) -> bool:
    """Whether the two can be hidden in one record; a load that is declared cannot."""
    if any({first, second} <= group for group in ALIKE):
        return False
    a, b = find(first), find(second)
    loads = {"gravity", "constant_torque"} & {first, second}
    return bool(set(a.excitations) & set(b.excitations)) and not (
        loads and "load" in (a.only, b.only)
    )


def line(task: Task) -> dict[str, Any]:
    """All that is kept of one record: its truth, the diagnosis of its files, the least error."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        names, strength = list(task.names) or "none", STRENGTHS[task.strength]
        case = sample(names, task.seed, hard=task.hard, strength=strength)
        case = exported(case, task.form) if task.form else case
        made = task.head | {"truth": truth(case, task), "problems": problems(case)}
        return made | answer(case)


def truth(case: Case, task: Task) -> dict[str, Any]:
    """What is hidden and where, without the samples."""
    known = {k: v for k, v in case.truth.items() if k not in ("drive", "effects", "parameters")}
    named = zip(task.names, case.truth["effects"], strict=True)
    known["effects"] = [{**entry, "name": name} for name, entry in named]
    known["travel"] = float(np.ptp(case.hidden.signals["theta_true"]))
    known["motion"] = case.model["motion"]
    return known


def answer(case: Case) -> dict[str, Any]:
    import lugrectl as lg

    with tempfile.TemporaryDirectory() as folder:
        paths, model = write(case, Path(folder))
        wall, cpu = time.perf_counter(), time.process_time()
        try:
            records = [lg.read_record(p, motion=case.model["motion"]) for p in paths]
            train, held_out = (records[:-1], records[-1]) if len(records) > 1 else (records, None)
            found = lg.diagnose(train, lg.read_model(model), holdout=held_out)
        except lg.Refused as refusal:
            return {"answer": {"verdict": "refused", "effects": [], "reason": str(refusal)}}
        spent = {"wall": time.perf_counter() - wall, "cpu": time.process_time() - cpu}
    said = found.summary()
    kept = {k: said.get(k) for k in KEPT} | {"ranking": (said.get("ranking") or [])[:4]}
    return {**spent, "answer": kept, "floor": floor(case, said.get("error"))}


def write(case: Case, folder: Path) -> tuple[list[Path], Path]:
    """Record files in SI units under the contract's names, and the model file."""
    paths = []
    for i, run in enumerate((case, *case.more)):
        paths.append(folder / f"run{i}.npz")
        np.savez(paths[-1], **run.columns)
    model = folder / "model.toml"
    model.write_text(model_text(case.model))
    return paths, model


def floor(case: Case, error: dict[str, Any] | None) -> float | None:
    """The least error of the signal on which the package was judged: that of the sensor itself."""
    if error is None or error["signal"] not in case.columns:
        return None
    true = case.hidden.signals[f"{error['signal']}_true"]
    kept = np.searchsorted(case.hidden.t, case.columns["t"] - 1e-9)
    return float(np.std(case.columns[error["signal"]] - true[kept]))


# --- all of them -------------------------------------------------------------------------


def parser() -> argparse.ArgumentParser:
    p = argparse.ArgumentParser(prog="python -m tests.scores.rig", description=__doc__)
    p.add_argument("--effects", default="", help="comma separated names, or all")
    p.add_argument("--strength", choices=[*STRENGTHS, "both"], default="both")
    p.add_argument("--seeds", type=seeds, default=range(50000, 50004), help="A:B or one number")
    p.add_argument("--none", type=int, default=0, help="records with nothing missing")
    p.add_argument("--unknown", type=int, default=0, help="with an effect outside the catalogue")
    p.add_argument("--pairs", type=int, default=0, help="records with two effects")
    p.add_argument("--hard", type=float, default=0.0, help="share of records with a difficulty")
    p.add_argument("--exported", type=float, default=0.0, help="share of records in other forms")
    p.add_argument("--jobs", type=int, default=1)
    p.add_argument("--out", type=Path, default=Path(tempfile.gettempdir()) / "lugrectl-rig")
    p.add_argument("--summary", type=Path, metavar="FILE", help="print a results file, run nothing")
    return p


def seeds(text: str) -> range:
    first, _, last = text.partition(":")
    return range(int(first), int(last) if last else int(first) + 1)


def read(path: Path) -> list[dict]:
    """Lines of a results file, the last of each key; a torn last line is left out."""
    lines: dict[str, dict] = {}
    for row in path.read_text().splitlines() if path.exists() else []:
        try:
            made = json.loads(row)
        except json.JSONDecodeError:
            continue
        lines[made["key"]] = made
    return list(lines.values())


def finished(task: Task) -> dict[str, Any]:
    """The line of a task; a crash of its own, a death or a lapse of time is told in it."""
    try:
        return apart(line, task, limit=LIMIT)
    except (TimeoutError, RuntimeError) as error:
        return task.head | {"crash": f"{type(error).__name__}: {error}"}


def main(argv: Sequence[str] | None = None) -> int:
    args = parser().parse_args(argv)
    if args.summary:
        print(counts.text(read(args.summary)))
        return 0
    os.environ |= dict.fromkeys(THREADS, "1")
    args.out.mkdir(parents=True, exist_ok=True)
    path, plan = args.out / "results.jsonl", planned(args)
    done = {x["key"] for x in read(path)}
    todo = [t for t in plan if t.key not in done]
    print(f"{len(plan)} records, {len(todo)} to do, results in {path}", file=sys.stderr)
    with path.open("a") as file, ThreadPoolExecutor(args.jobs) as pool:
        for i, made in enumerate(pool.map(finished, todo), 1):
            file.write(json.dumps(made) + "\n")
            file.flush()
            print(f"{i}/{len(todo)} {made['key']}: {counts.called(made)}", file=sys.stderr)
    wanted = {t.key for t in plan}
    print(counts.text([x for x in read(path) if x["key"] in wanted]))
    return 0


if __name__ == "__main__":
    sys.exit(main())
