"""Many logs, each diagnosed separately: a fleet of axes."""

from __future__ import annotations

import os
import time
import warnings
from collections.abc import Callable, Generator, Iterable, Mapping, Sequence
from concurrent.futures import Executor
from contextlib import closing
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from multiprocessing import parent_process
from pathlib import Path
from typing import Any, cast

from ..blocks import AUTO
from ..blocks.declaration import block_named
from ..blocks.model import Model, Sent, as_model
from ..core.blas_threads import one_thread_each
from ..core.display import Shown
from ..core.errors import InputError, Refused
from ..core.jobs import JobError, run_jobs
from ..core.progress import Progress, Wanted, reporter, shows_progress
from ..core.provenance import Provenance, SourceFile, provenance, stamp
from ..core.result import Result, library, picked, plain
from ..core.validation import shown
from ..core.views import view
from ..record import Record, read_log
from ..record.as_record import is_last, is_record, record_files, there
from ..record.columns.table import is_table, source_of
from ..torque_balance.constants import ALPHA, FLOOR
from .asked import LIMIT, refuse_swapped, settings
from .diagnose import diagnose
from .result import VERDICTS, Diagnosis

FAILED = "failed"
OWN = "holdout must be 'last' or left out: each log is judged by its own samples, not by a file."
Logs = Any  # a path, a table, a Record, or several of them


@dataclass(frozen=True, repr=False)
class Outcome(Shown):
    """The result for one log.

    ``document`` is the diagnosis as plain data, None if the log could not be read; ``reason``
    says why there is no answer, ``exit_code`` is that of the command line.
    """

    file: str
    exit_code: int = 0
    seconds: float | None = None
    document: Mapping[str, Any] | None = field(default=None, repr=False)
    reason: str | None = None
    diagnosis: Diagnosis | None = field(default=None, repr=False)

    @property
    def verdict(self) -> str:
        """The diagnosis's verdict, or "failed"."""
        return self.document["verdict"] if self.document else FAILED

    @property
    def files(self) -> list[SourceFile]:
        """The files that the diagnosis was made from."""
        known = (self.document or {}).get("provenance") or {}
        return [SourceFile(f["name"], f["sha256"]) for f in known.get("files", ())]

    def row(self) -> dict[str, Any]:
        """One line of a table, as plain data; errors are RMS in ``unit``."""
        d = self.document or {}
        error = d.get("error") or {}
        keys = ("signal", "unit", "declared", "refitted", "augmented", "noise_floor")
        return {
            "file": self.file,
            "verdict": self.verdict,
            "effects": [_effect(e, d["verdict"]) for e in d.get("effects", ())],
            "depends_on": d.get("depends_on", []),
            **{k: error.get(k) for k in keys},
            "seconds": self.seconds,
            "message": self.reason or d.get("experiment"),
        }

    def summary(self) -> dict[str, Any]:
        """Plain Python, as in the JSON document."""
        own = picked(self, "file exit_code seconds")
        return own | {"diagnosis": self.document, "reason": self.reason}


def _effect(found: Mapping[str, Any], verdict: str) -> dict[str, Any]:
    parameters = found["parameters"].items()
    tied = found["alternatives"] if verdict == "ambiguous" else []
    return {
        "name": found["name"],
        "values": {k: p["value"] for k, p in parameters},
        "units": {k: p["unit"] for k, p in parameters},
        "alternatives": [a["name"] for a in tied],
    }


@dataclass(frozen=True, repr=False)
class Fleet(Result):
    """The answer of :func:`lugrectl.diagnose_each`, in the order of the logs.

    Attributes
    ----------
    outcomes : tuple of Outcome
        One for each log: its diagnosis, or why there is none.
    unfinished : tuple of str
        The logs that were not diagnosed because of an interrupt.
    model : Model or None
        The declared model.
    provenance : Provenance or None
        Version, date, command and files.

    Examples
    --------
    >>> t = 1e-2 * np.arange(400)
    >>> dead = {"t": t, "u": np.zeros(400), "w": np.sin(t)}
    >>> fleet = lg.diagnose_each([dead], lg.table1())
    >>> {name: count for name, count in fleet.counts.items() if count}
    {'refused': 1}
    """

    outcomes: tuple[Outcome, ...] = field(repr=False)
    unfinished: tuple[str, ...] = ()
    model: Model | None = field(default=None, repr=False)
    provenance: Provenance | None = field(default=None, repr=False)

    @cached_property
    def rows(self) -> list[dict[str, Any]]:
        """One plain dict per log: file, verdict, effects, errors (RMS), seconds, message."""
        return [outcome.row() for outcome in self.outcomes]

    @property
    def diagnoses(self) -> dict[str, Diagnosis]:
        """The diagnoses by file, without those that were not kept."""
        return {o.file: o.diagnosis for o in self.outcomes if o.diagnosis is not None}

    @property
    def failed(self) -> dict[str, str]:
        """Why a log has no diagnosis, by file; a refused one has a diagnosis that says why."""
        return {o.file: o.reason or "" for o in self.outcomes if o.document is None}

    @property
    def counts(self) -> dict[str, int]:
        """The number of logs with each verdict; the last is "failed"."""
        verdicts = [o.verdict for o in self.outcomes]
        return {name: verdicts.count(name) for name in (*VERDICTS, FAILED)}

    @property
    def exit_code(self) -> int:
        """0 when every log was answered, else the highest code of a single log."""
        return max((o.exit_code for o in self.outcomes), default=0)

    def summary(self) -> dict[str, Any]:
        """Plain Python, as in the JSON document; never NaN or Infinity."""
        own = picked(self, "counts unfinished provenance")
        return {"schema": 1, "records": plain(self.outcomes), **own}

    def to_frame(self) -> Any:
        """A DataFrame of :attr:`rows`, the effects as text; InputError without pandas."""
        rows = [row | {"effects": "; ".join(e["name"] for e in row["effects"])}
                | {"depends_on": ", ".join(row["depends_on"])} for row in self.rows]  # fmt: skip
        return library("pandas").DataFrame(rows)

    def save(self, folder: str | Path) -> list[Path]:
        """Write index.html, summary.csv and a folder for each diagnosis that was kept.

        Each of these holds report.html, report.json and, unless refused, model.toml. Returns the
        paths of the index and the table. Raises InputError where nothing can be written.
        """
        return view("fleet_page.write_all")(self, folder)

    def _title(self) -> str:
        counts = ", ".join(f"{n} {verdict}" for verdict, n in self.counts.items() if n)
        return f"Fleet of {len(self.outcomes)}: {counts or 'none finished'}"

    def __str__(self) -> str:
        return view("fleet_page.page")(self).text()

    def _repr_html_(self) -> str:
        return view("fleet_page.page")(self).fragment()


@shows_progress
def diagnose_each(
    records: Logs,
    model: Any,
    *,
    columns: Mapping[str, str] | str | None = None,
    units: Mapping[str, str] | str | None = None,
    scale: Mapping[str, float] | str | None = None,
    rate: float | None = None,
    holdout: str | None = None,
    horizon: float = 1.0,
    seed: int = 0,
    least: float = FLOOR,
    alpha: float = ALPHA,
    time_limit: float = LIMIT,
    law: str | None = None,
    jobs: int = 1,
    executor: Executor | None = None,
    progress: Wanted = None,
    keep: bool = True,
) -> Fleet:
    """Diagnose every log separately against one declared model.

    A log that cannot be read or answered does not stop the others. An interrupt (Ctrl-C) ends
    the work and returns the results so far.

    Parameters
    ----------
    records : path, folder, pattern, DataFrame, dict of arrays, Record, or several of them
        A folder stands for all its .csv, .mat, .npz and .parquet files. Each file is read by the
        process that diagnoses it, one at a time.
    model : Model, Parameters, dict or path
        The declared model; missing values are identified for each log.
    columns, units, scale, rate
        How to read each log, as in :func:`lugrectl.read_record`.
    holdout : None or "last"
        What is held out of each log: every other block, or the last half.
    horizon, seed, least, alpha, time_limit, law
        As in :func:`lugrectl.diagnose`.
    jobs : int
        Number of processes, each with one numerical thread (a script then needs
        ``if __name__ == "__main__":``); 1 works in the calling process.
    executor : concurrent.futures.Executor
        Runs the jobs instead (threads, Dask, MPI) and is not shut down.
    progress : callable, True, False or None
        ``progress(fraction, what)`` over all logs, or whether to show a bar. None: in Jupyter only.
    keep : bool
        False keeps rows and documents only, not the diagnoses with their samples: for fleets
        larger than memory.

    Returns
    -------
    Fleet
        An outcome for each log; ``print`` shows a table, ``to_frame`` gives a DataFrame, ``save``
        writes a page for each.

    Raises
    ------
    InputError
        For an empty folder, a path of nothing, a pattern without match, jobs below 1, another
        holdout, or an argument that cannot be meant.

    Examples
    --------
    Two logs of a fleet, in one of which the torque is not recorded and in the other one the motion:

    >>> t = 1e-2 * np.arange(400)
    >>> logs = [
    ...     {"t": t, "u": np.zeros(400), "w": np.sin(t)},
    ...     {"t": t, "u": np.sin(t), "w": np.zeros(400)},
    ... ]
    >>> fleet = lg.diagnose_each(logs, lg.table1())
    >>> [row["verdict"] for row in fleet.rows]
    ['refused', 'refused']

    A folder of logs, in four processes:

    >>> lg.diagnose_each("logs", "axis.toml", jobs=4).save("report")  # doctest: +SKIP
    """
    if isinstance(records, (str, os.PathLike)):
        there(records)
    options = {"holdout": holdout, "horizon": horizon, "seed": seed, "least": least}
    of = {"where": "law", "what": "friction law"}
    law = law if law in (None, AUTO) else block_named("friction", law, **of).name
    options |= {"alpha": alpha, "time_limit": time_limit, "law": law}
    reading = {"columns": columns, "units": units, "scale": scale, "rate": rate}
    how = {"jobs": jobs, "executor": executor, "keep": keep}
    return run_each(records, model, reading, options, progress=reporter(progress), **how)


def run_each(
    records: Logs,
    model: Model,
    reading: Mapping[str, Any],
    options: Mapping[str, Any],
    *,
    jobs: int = 1,
    executor: Executor | None = None,
    progress: Progress | None = None,
    keep: bool = True,
    render: Callable[[Diagnosis], Any] | None = None,
    done: Callable[[Outcome, Any], Outcome] | None = None,
    command: str = "lugrectl.diagnose_each",
) -> Fleet:
    """:func:`diagnose_each`, with the options of ``read_record`` and of ``diagnose``. ``render``
    turns a diagnosis into files in the worker process, and ``done`` receives them in this process
    as soon as the log is done. ``command`` is for the provenance."""
    refuse_swapped([records], model)
    several = [records] if is_record(records) else records
    if not isinstance(several, Iterable):
        raise InputError(f"records must be a path or a list of records, not {shown(records)}.")
    logs, model = record_files(list(several)), as_model(model)
    if not (executor is None or hasattr(executor, "submit")):
        raise InputError(f"executor must be a concurrent.futures.Executor, not {shown(executor)}.")
    names = _names(logs)
    if not (options["holdout"] is None or is_last(options["holdout"])):
        raise InputError(OWN)
    settings(**options)
    report = reporter(progress)
    here = executor is None and jobs == 1
    made: dict[int, Outcome] = {}

    def within(fraction: float, what: str) -> None:
        at = len(made)
        report((at + fraction) / len(logs), f"{at + 1} of {len(logs)}: {what}")

    task = partial(
        _diagnosed, model=model if here else Sent.of(model), reading=reading, options=options,
        keep=keep, render=render, progress=within if here else None, command=command,
    )  # fmt: skip
    report(0.0, f"0 of {len(logs)}")
    try:
        with one_thread_each(not here and executor is None):
            found = run_jobs(task, logs, executor=executor, jobs=jobs)
            with closing(cast("Generator[tuple[int, Any]]", found)):
                for index, answer in found:
                    if isinstance(answer, JobError):
                        answer = Outcome("", answer.exit_code, reason=answer.sentence), None
                    outcome = replace(answer[0], file=names[index])
                    made[index] = done(outcome, answer[1]) if done else outcome
                    report(len(made) / len(logs), f"{len(made)} of {len(logs)}")
    except KeyboardInterrupt:
        pass
    left = tuple(name for i, name in enumerate(names) if i not in made)
    outcomes = tuple(made[i] for i in sorted(made))
    files = [file for outcome in outcomes for file in outcome.files]
    return Fleet(outcomes, left, model, provenance(command, [model, *files]))


def _diagnosed(
    log: Any,
    model: Model | Sent,
    reading: Mapping[str, Any],
    options: Mapping[str, Any],
    keep: bool,
    render: Callable[[Diagnosis], Any] | None,
    progress: Progress | None,
    command: str,
) -> tuple[Outcome, Any]:
    """The outcome of one log, in any process, and what was rendered."""
    began = time.perf_counter()
    with warnings.catch_warnings():
        if parent_process() is not None:  # a worker's stderr is the user's terminal
            warnings.simplefilter("ignore")
        model = model.open() if isinstance(model, Sent) else model
        known = isinstance(log, Record)
        record = log if known else read_log(log, **{"motion": model.motion, **reading})
        d = diagnose(record, model, progress=progress or False, **options)
        d = stamp(d, command, [log, model])
        extra = render(d) if render else None
    code, took = 0 if d.reason is None else Refused.exit_code, time.perf_counter() - began
    return Outcome("", code, round(took, 2), d.summary(), d.reason, d if keep else None), extra


def _names(logs: Sequence[Any]) -> list[str]:
    """A name for each log; records of one source are numbered."""
    names = [source_of(x) if is_table(x) else getattr(x, "source", None) or str(x) for x in logs]
    used = [names[: i + 1].count(name) for i, name in enumerate(names)]
    return [name if n == 1 else f"{name} ({n})" for name, n in zip(names, used, strict=True)]
