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
from functools import partial
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np

from ..drives import CATALOGUE, STRANGERS, Case, exported, problems, sample
from ..drives.declared import model_text
from ..drives.effects import find
from ..drives.run import replay
from ..drives.sample import forms
from . import counts
from .judges import THREADS, apart

STRENGTHS = {"normal": 0.20, "weak": 0.08}
ALIKE = (  # no record tells these from each other when both are there
    {"input_delay", "actuator_lag", "velocity_sensor_lag"},
    {"elastic_coupling", "backlash"},
    {"stribeck", "presliding"},
    {"constant_torque", "return_spring"},  # a spring with another rest
    {"gravity", "pose_dependent_inertia", "encoder_eccentricity"},
)
DEFAULT = {"none": 200, "strangers": 48, "pairs": 60}  # where no effects are asked for
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
    short: bool = False  # 20 s at 500 Hz, for a quick look
    form: str = ""  # as which export it holds theta, w and u; "" as the rig's sensors give them

    @property
    def key(self) -> str:
        words = (self.hard and "hard", self.short and "short", self.form)
        also = "".join(f" {word}" for word in words if word)
        return f"{'+'.join(self.names) or 'none'} {self.strength} {self.seed}{also}"

    def case(self) -> Case:
        """The record."""
        short = {"rate": 500.0, "duration": 20.0} if self.short else {}
        names, strength = list(self.names) or "none", STRENGTHS[self.strength]
        case = sample(names, self.seed, hard=self.hard, strength=strength, **short)
        return exported(case, self.form) if self.form else case


@dataclass(frozen=True)
class Plan:
    """Every effect at every strength and seed, then the others; ``hard``, ``exported``: shares.

    Records with nothing missing, strangers and pairs take seeds from the first on, and the first
    strength.
    """

    effects: Sequence[str]
    strengths: Sequence[str]
    seeds: range
    none: int = 0
    strangers: int = 0
    pairs: int = 0
    hard: float = 0.0
    short: bool = False
    exported: float = 0.0

    def tasks(self) -> list[Task]:
        first, strength, kinds = self.seeds.start, self.strengths[0], list(STRANGERS)
        made = [
            Task("none", (), s, seed) if n == "none" else Task("effect", (find(n).name,), s, seed)
            for seed in self.seeds
            for s in self.strengths
            for n in self.effects
        ]
        made += [Task("none", (), "normal", first + i) for i in range(self.none)]
        strange = [(kinds[i % len(kinds)],) for i in range(self.strangers)]
        made += [Task("stranger", n, strength, first + i) for i, n in enumerate(strange)]
        mixed = _pairs(first)
        made += [Task("pair", next(mixed), strength, first + i) for i in range(self.pairs)]
        made = [self._form(replace(self._hardened(t), short=self.short)) for t in made]
        return list({task.key: task for task in made}.values())

    def _hardened(self, task: Task) -> Task:
        chance = np.random.default_rng([task.seed, *task.key.encode()]).random()
        return replace(task, hard=bool(chance < self.hard))

    def _form(self, task: Task) -> Task:
        rng = np.random.default_rng([task.seed, *b"export", *task.key.encode()])
        allowed = forms(task.names)
        if rng.random() >= self.exported or not allowed:
            return task
        return replace(task, form=str(rng.choice(allowed)))


def _pairs(seed: int) -> Iterator[tuple[str, ...]]:
    """Two effects that one record can carry and tell apart, in an order of the seed's."""
    every = [pair for pair in combinations(CATALOGUE, 2) if together(*pair)]
    rng = np.random.default_rng(seed)
    while True:
        for i in rng.permutation(len(every)):
            yield every[int(i)]


def together(first: str, second: str) -> bool:
    """Whether the two can be hidden in one record; a load that is declared cannot."""
    if any({first, second} <= group for group in ALIKE):
        return False
    a, b = find(first), find(second)
    loads = {"gravity", "constant_torque"}
    clash = (a.only == "load" and b.name in loads) or (b.only == "load" and a.name in loads)
    return bool(set(a.excitations) & set(b.excitations)) and not clash


# --- one record --------------------------------------------------------------------------


def head(task: Task) -> dict[str, Any]:
    """Which record it is, and when it was done."""
    at = datetime.now(UTC).isoformat(timespec="seconds")
    own = {k: getattr(task, k) for k in ("key", "kind", "names", "strength", "seed")}
    return own | {"names": list(task.names), "at": at}


def line(task: Task) -> dict[str, Any]:
    """All that is kept of one record: its truth, the diagnosis of its files, the least error."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        case = task.case()
        made = head(task) | {"truth": truth(case, task), "problems": problems(case)}
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
    return {**spent, "answer": kept, "floor": floor(case, records, found)}


def write(case: Case, folder: Path) -> tuple[list[Path], Path]:
    """Record files in SI units under the contract's names, and the model file."""
    paths = []
    for i, run in enumerate((case, *case.more)):
        paths.append(folder / f"run{i}.npz")
        np.savez(paths[-1], **run.columns)
    model = folder / "model.toml"
    model.write_text(model_text(case.model))
    return paths, model


def floor(case: Case, records: Sequence[Any], found: Any) -> float | None:
    """RMS error of the rig's own plant over the windows on which the package was judged.

    It starts from the state that the machine truly had, runs under the torque as recorded and
    shares nothing with the package. No estimate of the state can reach it, for position by far.
    """
    if found.traces is None or found.error is None:
        return None
    signal, horizon = found.error["signal"], found.error["horizon"]
    edges = np.cumsum([0, *(r.samples for r in records)])
    held_out = np.zeros(edges[-1], dtype=bool)
    seen = found.traces.held_out[: edges[-1]]
    held_out[: len(seen)] = seen
    errors = []
    for run, r, a in zip((case, *case.more), records, edges[:-1], strict=True):
        starts = restarts(r.t, held_out[a : a + r.samples], horizon)
        if len(starts):
            errors.append(_missed(run, signal, starts, horizon))
    e = np.concatenate(errors or [np.empty(0)])
    return float(np.sqrt(np.mean(e**2))) if len(e) else None


def restarts(t: np.ndarray, held_out: np.ndarray, horizon: float) -> np.ndarray:
    """Times at which a window of the horizon starts within the held-out stretches."""
    dt = float(np.median(np.diff(t)))
    span = max(1, round(horizon / dt))
    flags = np.flatnonzero(np.diff(np.concatenate([[0], held_out.astype(int), [0]])))
    windows = zip(flags[::2], flags[1::2], strict=True)
    return np.array([t[i] for a, b in windows for i in range(a, b - span + 1, span)])


def _missed(run: Case, signal: str, starts: np.ndarray, horizon: float) -> np.ndarray:
    """Recorded minus simulated, at the recorded samples inside the windows."""
    done, c = run.hidden, run.columns
    every, half = done.t, 0.5 / done.setup.rate
    kept = np.searchsorted(every, c["t"] - 1e-9)
    torque = done.signals["u"].copy()
    offset = run.truth.get("nuisance", {}).get("offset", 0.0)
    zero = run.truth.get("nuisance", {}).get("zero", 0.0)
    torque[kept] = c["u"] - offset
    restart = np.zeros(len(every), dtype=bool)
    restart[np.minimum(np.searchsorted(every, starts - half), len(every) - 1)] = True
    theta, w = replay(done, torque, restart)
    at = np.searchsorted(starts, every + half, side="right") - 1
    inside = (at >= 0) & (every + half < starts[np.maximum(at, 0)] + horizon)
    simulated = {"theta": theta + zero, "w": w}[signal][kept]
    return (c[signal] - simulated)[inside[kept]]


# --- all of them -------------------------------------------------------------------------


def parser() -> argparse.ArgumentParser:
    p = argparse.ArgumentParser(prog="python -m tests.scores.rig", description=__doc__)
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
    p.add_argument("--limit", type=float, default=1800, help="most seconds for a record")
    p.add_argument("--out", type=Path, default=Path(tempfile.gettempdir()) / "lugrectl-rig")
    p.add_argument("--retry", action="store_true", help="do again what crashed")
    p.add_argument("--summary", type=Path, metavar="FILE", help="print a results file, run nothing")
    return p


def seeds(text: str) -> range:
    first, _, last = text.partition(":")
    return range(int(first), int(last) if last else int(first) + 1)


def planned(args: argparse.Namespace) -> list[Task]:
    """The tasks that the options ask for."""
    shares = {k: getattr(args, k) for k in DEFAULT}
    asked = args.effects is not None or any(n is not None for n in shares.values())
    shares = {k: n if n is not None else 0 if asked else DEFAULT[k] for k, n in shares.items()}
    shares |= {k: getattr(args, k) for k in ("hard", "exported", "short")}
    strengths = list(STRENGTHS) if args.strength == "both" else [args.strength]
    return Plan(_effects(args.effects if asked else "all"), strengths, args.seeds, **shares).tasks()


def _effects(text: str | None) -> list[str]:
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
            made = json.loads(row)
        except json.JSONDecodeError:
            continue
        lines[made["key"]] = made
    return list(lines.values())


def finished(task: Task, limit: float) -> dict[str, Any]:
    """The line of a task; a crash of its own, a death or a lapse of time is told in it."""
    try:
        return apart(line, task, limit=limit)
    except TimeoutError as error:
        return head(task) | {"crash": f"not done within {error}"}
    except RuntimeError as error:
        return head(task) | {"crash": str(error)}


def main(argv: Sequence[str] | None = None) -> int:
    args = parser().parse_args(argv)
    if args.summary:
        print(counts.text(read(args.summary)))
        return 0
    os.environ |= dict.fromkeys(THREADS, "1")
    args.out.mkdir(parents=True, exist_ok=True)
    path = args.out / "results.jsonl"
    done = {x["key"] for x in read(path) if not (args.retry and "crash" in x)}
    plan = planned(args)
    todo = [t for t in plan if t.key not in done]
    print(f"{len(plan)} records, {len(todo)} to do, results in {path}", file=sys.stderr)
    with path.open("a") as file, ThreadPoolExecutor(args.jobs) as pool:
        for i, made in enumerate(pool.map(partial(finished, limit=args.limit), todo), 1):
            file.write(json.dumps(made) + "\n")
            file.flush()
            print(f"{i}/{len(todo)} {made['key']}: {counts.called(made)}", file=sys.stderr)
    wanted = {t.key for t in plan}
    print(counts.text([x for x in read(path) if x["key"] in wanted]))
    return 0


if __name__ == "__main__":
    sys.exit(main())
