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
from .plan import STRENGTHS, Task

THREADS = ("OMP", "NUMBA", "OPENBLAS", "MKL")
TOLD = ("verdict", "depends_on", "experiment", "error", "free_error", "torque_error", "record")


def one_thread() -> None:
    """To be called before any library that reads it is loaded; children inherit it."""
    os.environ |= {f"{name}_NUM_THREADS": "1" for name in THREADS}


def case_of(task: Task) -> Case:
    names = list(task.names) or "none"
    short = {"rate": 500.0, "duration": 20.0} if task.short else {}
    case = sample(names, task.seed, hard=task.hard, strength=STRENGTHS[task.strength], **short)
    return exported(case, task.form) if task.form else case


def line(task: Task, *, exact: bool = True, trees: bool = False, limit: int = 1800) -> dict:
    """All that is kept of one record. Never raises: what went wrong is in it."""
    told = head(task)
    try:
        with _at_most(limit), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            case = case_of(task)
            told |= {"truth": truth(case, task), "problems": problems(case)}
            told |= answer(case, exact, trees)
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


def answer(case: Case, exact: bool, trees: bool) -> dict:
    """Diagnosis of the record's files, and what could have been reached."""
    import lugrectl as lg

    from . import limits

    with tempfile.TemporaryDirectory() as folder:
        paths, model_path = write(case, Path(folder))
        told, records, found = diagnosed(paths, model_path, case.model["motion"])
        if found is None:
            return told
        train, apart = cut(records)
        told["floor"] = limits.floor(case, records, found)
        if exact:
            told["exact"] = limits.exact(case, train, apart)
        if trees:
            from .trees import trees_error

            refitted = lg.identify(train, lg.read_model(model_path), holdout=apart).model
            told["trees"] = trees_error(found, refitted.to_dict(), records)
    return told


def diagnosed(paths: list[Path], model: Path, motion: str) -> tuple[dict[str, Any], list, Any]:
    """What is kept of the answer, the records, and the answer; none where they are refused."""
    import lugrectl as lg

    wall, cpu = time.perf_counter(), time.process_time()
    try:
        records = [lg.read_record(p, motion=motion) for p in paths]
        train, apart = cut(records)
        found = lg.diagnose(train, lg.read_model(model), holdout=apart)
    except lg.Refused as refusal:
        return {"answer": {"verdict": "refused", "effects": [], "reason": str(refusal)}}, [], None
    spent = {"wall": time.perf_counter() - wall, "cpu": time.process_time() - cpu}
    return {**spent, "answer": _answer(found.summary())}, records, found


def cut(records: list) -> tuple[list, Any]:
    """The records to fit, and the last of several, which is held out."""
    return (records[:-1], records[-1]) if len(records) > 1 else (records, None)


def write(case: Case | Any, folder: Path) -> tuple[list[Path], Path]:
    """Record files in SI units under the contract's names, and the model file."""
    paths = []
    for i, run in enumerate((case, *case.more)):
        paths.append(folder / f"run{i}.npz")
        np.savez(paths[-1], **run.columns)
    model = folder / "model.toml"
    model.write_text(model_text(case.model))
    return paths, model


def _answer(summary: dict) -> dict:
    told = {k: summary.get(k) for k in (*TOLD, "reason", "messages")}
    told["effects"] = summary["effects"]
    told["ranking"] = (summary.get("ranking") or [])[:4]
    return told


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
