"""The diagnosis of a record alone, without what could have been reached on it.

Drawing a record takes longer than judging it, so a folder keeps those that were drawn.
"""

from __future__ import annotations

import json
import tempfile
import traceback
import warnings
from dataclasses import dataclass, field
from hashlib import sha1
from pathlib import Path
from typing import Any

import numpy as np

from ..drives import problems
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
    path = None if cache is None else place(task, cache)
    if path is not None and path.exists():
        return _load(path)
    case = work.case_of(task)
    others = tuple(Kept(c.columns, c.model) for c in case.more)
    made = Kept(case.columns, case.model, work.truth(case, task), list(problems(case)), others)
    if path is not None:
        path.parent.mkdir(parents=True, exist_ok=True)
        save(made, path, task.key)
    return made


def place(task: Task, cache: Path) -> Path:
    """The file of a task's record."""
    return cache / f"{sha1(task.key.encode()).hexdigest()[:10]}.npz"


def save(made: Kept, path: Path, key: str) -> None:
    """Write a record, whole or not at all."""
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
    """What the diagnosis says of a record."""
    with tempfile.TemporaryDirectory() as folder:
        told, *_ = work.diagnosed(*work.write(record, Path(folder)), record.model["motion"])
    return told
