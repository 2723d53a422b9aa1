"""The comparison alone as the judge of a record, without a fit of the model that it names.

Drawing a record takes longer than judging it, so a folder keeps those that were drawn.
"""

from __future__ import annotations

import json
import tempfile
import time
import traceback
import warnings
from dataclasses import dataclass, field
from hashlib import sha1
from pathlib import Path
from typing import Any

import numpy as np

from ..rig import problems
from . import work
from .plan import Task


@dataclass(frozen=True)
class Kept:
    """What a user has of a record, and the truth without the samples."""

    columns: dict[str, np.ndarray]
    model: dict
    truth: dict = field(default_factory=dict)
    problems: list = field(default_factory=list)
    more: tuple[Kept, ...] = ()


def kept(task: Task, cache: Path | None) -> Kept:
    """The record of a task, from the folder ``cache`` where it is there."""
    name = sha1(task.key.encode()).hexdigest()[:10]
    path = None if cache is None else cache / f"{name}.npz"
    if path is not None and path.exists():
        return _load(path)
    case = work.case_of(task)
    others = tuple(Kept(c.columns, c.model) for c in case.more)
    made = Kept(case.columns, case.model, work.truth(case, task), list(problems(case)), others)
    if path is not None:
        path.parent.mkdir(parents=True, exist_ok=True)
        _save(made, path, task.key)
    return made


def _save(made: Kept, path: Path, key: str) -> None:
    said = {"key": key, "model": made.model, "truth": made.truth, "problems": made.problems}
    runs = [made, *made.more]
    samples = {f"{i} {k}": x for i, run in enumerate(runs) for k, x in run.columns.items()}
    part = path.with_suffix(".part.npz")
    np.savez_compressed(part, said=np.array(json.dumps(said, default=float)), **samples)  # pyright: ignore
    part.replace(path)


def _load(path: Path) -> Kept:
    with np.load(path) as data:
        said = json.loads(str(data["said"]))
        runs: dict[int, dict[str, np.ndarray]] = {}
        for name in data.files:
            if name != "said":
                i, _, k = name.partition(" ")
                runs.setdefault(int(i), {})[k] = data[name]
    first, *others = (runs[i] for i in sorted(runs))
    model = said["model"]
    more = tuple(Kept(columns, model) for columns in others)
    return Kept(first, model, said["truth"], said["problems"], more)


def line(task: Task, *, cache: Path | None = None) -> dict[str, Any]:
    """All that is kept of one record. Never raises: what went wrong is in it."""
    made = work.head(task)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            record = kept(task, cache)
            made |= {"truth": record.truth, "problems": record.problems}
            made |= judged(record)
    except Exception:  # one crash must not end the run; it is counted
        made["crash"] = traceback.format_exc(limit=-6)
    return made


def judged(record: Any) -> dict[str, Any]:
    """What the table says of a record, in the form of a diagnosis."""
    import lugrectl as lg
    from lugrectl.diagnosis.question import Asked
    from lugrectl.identification.selection import compare

    with tempfile.TemporaryDirectory() as folder:
        paths, model = work.write(record, Path(folder))
        asked = Asked.of(paths[:-1] if len(paths) > 1 else paths, model)
    wall, cpu = time.perf_counter(), time.process_time()
    try:
        plain = asked.plain
        found = compare(plain.stretches, asked.model, plain)
    except lg.Refused as refusal:
        return {"answer": {"verdict": "refused", "effects": [], "reason": str(refusal)}}
    spent = {"wall": time.perf_counter() - wall, "cpu": time.process_time() - cpu}
    return {**spent, "answer": _answer(found)}


def _answer(found: Any) -> dict[str, Any]:
    effects = [_named(e) | {"alternatives": []} for e in found.effects]
    if effects:
        effects[0]["alternatives"] = [_named(e) for e in found.alternatives]
    return {
        "verdict": found.verdict,
        "depends_on": list(found.depends_on),
        "effects": effects,
        "messages": list(found.messages),
        "rows": [row.summary() for row in found.rows[:8]],
    }


def _named(effect: Any) -> dict[str, Any]:
    values = {k: {"value": v, "ci95": None} for k, v in effect.values.items()}
    return {"name": effect.name, "parameters": values}
