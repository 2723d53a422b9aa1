"""One record: drawn, written to files, read and diagnosed as a user would, told as plain data."""

from __future__ import annotations

import contextlib
import os
import signal
import tempfile
import time
import traceback
import warnings
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from ..drives import exported, problems, sample
from ..drives.declared import model_text
from ..drives.record import Case
from . import limits
from .plan import STRENGTHS, Task

THREADS = ("OMP", "NUMBA", "OPENBLAS", "MKL")
TOLD = ("verdict", "effects", "depends_on", "experiment", "error", "free_error", "torque_error",
        "record", "reason", "messages")  # fmt: skip


def one_thread() -> None:
    """To be called before any library that reads it is loaded; children inherit it."""
    os.environ |= {f"{name}_NUM_THREADS": "1" for name in THREADS}


def case_of(task: Task) -> Case:
    names = list(task.names) or "none"
    short = {"rate": 500.0, "duration": 20.0} if task.short else {}
    case = sample(names, task.seed, hard=task.hard, strength=STRENGTHS[task.strength], **short)
    return exported(case, task.form) if task.form else case


def line(task: Task, *, limit: int = 1800) -> dict:
    """All that is kept of one record. Never raises: what went wrong is in it."""
    told = head(task)
    try:
        with _at_most(limit), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            case = case_of(task)
            told |= {"truth": truth(case, task), "problems": problems(case)}
            told |= answer(case)
    except Exception:  # one crash must not end the run; it is counted
        told["crash"] = traceback.format_exc(limit=-6)
    return told


def head(task: Task) -> dict[str, Any]:
    """Which record it is, and when it was done."""
    return {
        "key": task.key,
        "kind": task.kind,
        "names": list(task.names),
        "strength": task.strength,
        "seed": task.seed,
        "at": datetime.now(UTC).isoformat(timespec="seconds"),
    }


def truth(case: Case, task: Task) -> dict:
    """What is hidden and where, without the samples."""
    told = {k: v for k, v in case.truth.items() if k not in ("drive", "effects", "parameters")}
    named = zip(task.names, case.truth["effects"], strict=True)
    told["effects"] = [{**entry, "name": name} for name, entry in named]
    told["travel"] = float(np.ptp(case.hidden.signals["theta_true"]))
    told["motion"] = case.model["motion"]
    return told


def answer(case: Case) -> dict[str, Any]:
    """Diagnosis of the record's files, and the least error on it."""
    import lugrectl as lg

    with tempfile.TemporaryDirectory() as folder:
        paths, model = write(case, Path(folder))
        wall, cpu = time.perf_counter(), time.process_time()
        try:
            records = [lg.read_record(p, motion=case.model["motion"]) for p in paths]
            train, apart = (records[:-1], records[-1]) if len(records) > 1 else (records, None)
            found = lg.diagnose(train, lg.read_model(model), holdout=apart)
        except lg.Refused as refusal:
            return {"answer": {"verdict": "refused", "effects": [], "reason": str(refusal)}}
        spent = {"wall": time.perf_counter() - wall, "cpu": time.process_time() - cpu}
    said = found.summary()
    kept = {k: said.get(k) for k in TOLD} | {"ranking": (said.get("ranking") or [])[:4]}
    return {**spent, "answer": kept, "floor": limits.floor(case, records, found)}


def write(case: Case | Any, folder: Path) -> tuple[list[Path], Path]:
    """Record files in SI units under the contract's names, and the model file."""
    paths = []
    for i, run in enumerate((case, *case.more)):
        paths.append(folder / f"run{i}.npz")
        np.savez(paths[-1], **run.columns)
    model = folder / "model.toml"
    model.write_text(model_text(case.model))
    return paths, model


@contextlib.contextmanager
def _at_most(seconds: int) -> Iterator[None]:
    """Stop what takes too long; a process's main thread only."""

    def stop(signum, frame):
        raise TimeoutError(f"not done within {seconds} s")

    before = signal.signal(signal.SIGALRM, stop)
    signal.alarm(seconds)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)
