"""Many logs, each diagnosed by itself: a fleet of axes."""

from __future__ import annotations

import inspect
import time
import warnings
from collections.abc import Callable, Generator, Iterable, Mapping, Sequence
from concurrent.futures import Executor
from contextlib import closing
from dataclasses import dataclass, field, replace
from functools import cached_property
from multiprocessing import parent_process
from pathlib import Path
from typing import Any, cast

from .display import Row, Shown
from .errors import InputError, Refused
from .jobs import JobError, run_jobs
from .model import Model
from .outputs import Result, library, plain
from .progress import Wanted, reporter, shows_progress
from .record import Record, read_record
from .results import VERDICTS, Diagnosis
from .workers import Sent, one_thread_each, record_files

FAILED = "failed"
_READING = ("columns", "units", "scale", "rate")
Progress = Callable[[float, str], None]
Logs = str | Path | Record | Iterable[str | Path | Record]


@dataclass(frozen=True, repr=False)
class Outcome(Shown):
    """What became of one log.

    ``document`` is the diagnosis as plain data, None where the log could not be read;
    ``reason`` says why it was not answered, ``exit_code`` is that of the command line.
    """

    file: str
    exit_code: int = 0
    seconds: float | None = None
    document: Mapping[str, Any] | None = None
    reason: str | None = None
    diagnosis: Diagnosis | None = field(default=None, repr=False)

    @property
    def verdict(self) -> str:
        """The diagnosis's verdict, or "failed"."""
        return self.document["verdict"] if self.document else FAILED

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

    def _title(self) -> str:
        return f"Outcome {self.file}: {self.verdict}"

    def _rows(self) -> Iterable[Row]:
        effects = ", ".join(e["name"] for e in (self.document or {}).get("effects", ()))
        rows = [Row("effects", effects), Row("reason", self.reason), Row("took", self.seconds, "s")]
        return [row for row in rows if row.value]

    def summary(self) -> dict[str, Any]:
        """Plain Python, as in the JSON document."""
        return {
            "file": self.file,
            "exit_code": self.exit_code,
            "seconds": self.seconds,
            "diagnosis": self.document,
            "reason": self.reason,
        }


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

    ``unfinished`` names the logs that an interrupt left out.
    """

    outcomes: tuple[Outcome, ...] = field(repr=False)
    unfinished: tuple[str, ...] = ()
    model: Model | None = field(default=None, repr=False)

    @cached_property
    def rows(self) -> list[dict[str, Any]]:
        """One plain dict per log: file, verdict, effects, errors (RMS), seconds, message."""
        return [outcome.row() for outcome in self.outcomes]

    @property
    def diagnoses(self) -> dict[str, Diagnosis]:
        """The diagnoses by file; those not kept are left out."""
        return {o.file: o.diagnosis for o in self.outcomes if o.diagnosis is not None}

    @property
    def failed(self) -> dict[str, str]:
        """Why a log has no diagnosis, by file; a refused one has a diagnosis that says why."""
        return {o.file: o.reason or "" for o in self.outcomes if o.document is None}

    @property
    def counts(self) -> dict[str, int]:
        """How many logs have which verdict; the last is "failed"."""
        verdicts = [o.verdict for o in self.outcomes]
        return {name: verdicts.count(name) for name in (*VERDICTS, FAILED)}

    @property
    def exit_code(self) -> int:
        """0 when every log was answered, else the highest code of a single log."""
        return max((o.exit_code for o in self.outcomes), default=0)

    def summary(self) -> dict[str, Any]:
        """Plain Python, as in the JSON document; never NaN or Infinity."""
        return plain(
            {
                "schema": 1,
                "records": [outcome.summary() for outcome in self.outcomes],
                "counts": self.counts,
                "unfinished": self.unfinished,
            }
        )

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
        from .report.fleet_page import write_all

        return write_all(self, folder)

    def _title(self) -> str:
        counts = ", ".join(f"{n} {verdict}" for verdict, n in self.counts.items() if n)
        return f"Fleet of {len(self.outcomes)}: {counts or 'none finished'}"

    def _rows(self) -> Iterable[Row]:
        rows = [Row("against", self.model.name)] if self.model else []
        for verdict, count in self.counts.items():
            files = [o.file for o in self.outcomes if o.verdict == verdict]
            rows += [Row(verdict, files)] if count else []
        return rows + ([Row("unfinished", self.unfinished)] if self.unfinished else [])

    def __str__(self) -> str:
        from .report.fleet_page import text

        return text(self)

    def _repr_html_(self) -> str:
        from .report.fleet_page import fragment

        return fragment(self)


@shows_progress
def diagnose_each(
    records: Logs,
    model: Model,
    *,
    jobs: int = 1,
    executor: Executor | None = None,
    progress: Wanted = None,
    keep: bool = True,
    **options: Any,
) -> Fleet:
    """Diagnose every log by itself against one declared model.

    A log that cannot be read or answered does not stop the others. An interrupt ends the work
    and returns what is done.

    Parameters
    ----------
    records : path, folder, pattern, Record, or several of them
        Of a folder all .csv, .mat, .npz and .parquet files; files are read where the work is
        done, one at a time.
    model : Model
        The declared model; missing values are identified, for each log anew.
    jobs : int
        That many processes, each with one numerical thread (a script then needs
        ``if __name__ == "__main__":``); 1 works here and now.
    executor : concurrent.futures.Executor
        Carries the work instead (threads, Dask, MPI) and is not shut down.
    progress : callable, True, False or None
        ``progress(fraction, what)`` over all logs, or whether to show a bar. None: in Jupyter only.
    keep : bool
        False keeps rows and documents only, not the diagnoses with their samples: for fleets
        larger than memory.
    options
        ``columns units scale rate`` of :func:`lugrectl.read_record` and ``holdout`` (None or
        "last"), ``horizon``, ``seed`` of :func:`lugrectl.diagnose`.

    Raises
    ------
    InputError
        For an empty folder, a pattern without match, jobs below 1, another holdout.
    """
    return run_each(
        records,
        model,
        jobs=jobs,
        executor=executor,
        progress=reporter(progress),
        keep=keep,
        **options,
    )


def run_each(
    records: Logs,
    model: Model,
    *,
    jobs: int = 1,
    executor: Executor | None = None,
    progress: Progress | None = None,
    keep: bool = True,
    render: Callable[[Diagnosis], Any] | None = None,
    done: Callable[[Outcome, Any], Outcome] | None = None,
    **options: Any,
) -> Fleet:
    """:func:`diagnose_each`; ``render`` makes something of a diagnosis where it was made, and
    ``done`` gets it here as soon as the log is through."""
    logs = record_files(_several(records))
    names = _names(logs)
    reading, options = _split(options, model)
    report = progress or (lambda fraction, what: None)
    here = executor is None and jobs == 1
    made: dict[int, Outcome] = {}

    def within(fraction: float, what: str) -> None:
        at = len(made)
        report((at + fraction) / len(logs), f"{at + 1} of {len(logs)}: {what}")

    carried = model if here else Sent.of(model)
    task = Task(carried, reading, options, keep, render, within if here else None)
    report(0.0, f"0 of {len(logs)}")
    try:
        with one_thread_each(not here and executor is None):
            found = run_jobs(task, logs, executor=executor, jobs=jobs)
            with closing(cast("Generator[tuple[int, Any]]", found)):
                for index, answer in found:
                    outcome, extra = _outcome(names[index], answer)
                    made[index] = done(outcome, extra) if done else outcome
                    report(len(made) / len(logs), f"{len(made)} of {len(logs)}")
    except KeyboardInterrupt:
        pass
    left = tuple(name for i, name in enumerate(names) if i not in made)
    return Fleet(tuple(made[i] for i in sorted(made)), left, model)


@dataclass(frozen=True)
class Task:
    """What is done with one log, wherever that is; returns the outcome and what was rendered."""

    model: Model | Sent
    reading: Mapping[str, Any]
    options: Mapping[str, Any]
    keep: bool
    render: Callable[[Diagnosis], Any] | None
    progress: Progress | None

    def __call__(self, log: Path | Record) -> tuple[Outcome, Any]:
        began = time.perf_counter()
        model = self.model.open() if isinstance(self.model, Sent) else self.model
        with warnings.catch_warnings():
            if parent_process() is not None:  # a worker's stderr is the user's terminal
                warnings.simplefilter("ignore")
            d = self._diagnosed(log, model)
            extra = self.render(d) if self.render else None
        refused = d.verdict == "refused"
        outcome = Outcome(
            file="",
            exit_code=Refused.exit_code if refused else 0,
            seconds=round(time.perf_counter() - began, 2),
            document=d.summary(),
            reason=d.reason if refused else None,
            diagnosis=d if self.keep else None,
        )
        return outcome, extra

    def _diagnosed(self, log: Path | Record, model: Model) -> Diagnosis:
        seen: list[Record] = []
        try:
            if not isinstance(log, Record):
                log = read_record(log, motion=model.motion, **self.reading)
            seen.append(log)
            from .diagnosis import diagnose  # not needed for a log that cannot be read

            return diagnose(log, model, progress=self.progress or False, **self.options)
        except Refused as no:
            return refusal(no, model, seen)


def refusal(no: Refused, model: Model, records: Sequence[Record]) -> Diagnosis:
    """The diagnosis that says why the records read so far cannot answer."""
    return Diagnosis(
        "refused",
        reason=str(no),
        experiment=no.experiment,
        declared=model,
        record=records[0] if records else None,
        messages=tuple(m for record in records for m in record.messages),
    )


def _outcome(name: str, answer: Any) -> tuple[Outcome, Any]:
    if isinstance(answer, JobError):
        return Outcome(name, answer.exit_code, reason=answer.sentence), None
    outcome, extra = answer
    return replace(outcome, file=name), extra


def _several(records: Logs) -> list[str | Path | Record]:
    return [records] if isinstance(records, (str, Path, Record)) else list(records)


def _names(logs: Sequence[Path | Record]) -> list[str]:
    """A name for each log; records of one source are numbered."""
    used: dict[str, int] = {}
    names = []
    for log in logs:
        name = log.source if isinstance(log, Record) else str(log)
        used[name] = used.get(name, 0) + 1
        names.append(name if used[name] == 1 else f"{name} ({used[name]})")
    return names


def _split(options: Mapping[str, Any], model: Model) -> tuple[dict[str, Any], dict[str, Any]]:
    """The options of the reader and those of the diagnosis; TypeError for an unknown one."""
    from .diagnosis import diagnose

    reading = {k: v for k, v in options.items() if k in _READING}
    rest = {k: v for k, v in options.items() if k not in _READING}
    if rest.get("holdout") not in (None, "last"):
        raise InputError(
            "each log is judged on its own samples: holdout is 'last' or left out, not a file."
        )
    inspect.signature(diagnose).bind(None, model, progress=None, **rest)
    return reading, rest
