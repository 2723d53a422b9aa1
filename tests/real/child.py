"""One row in a process of its own: a judge that hangs or dies costs its own row only."""

from __future__ import annotations

import multiprocessing
import time
import traceback
from dataclasses import replace
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from ..scores.judges import judge_named, timed
from ..scores.question import Answer
from .row import Row

LIMIT = 300.0  # s


def ask(row: Row, data: Path, judge: str, limit: float = LIMIT) -> Answer:
    """The answer of a judge, within ``limit`` seconds; "timeout" or "crash" where there is none."""
    context = multiprocessing.get_context("spawn")
    here, there = context.Pipe(duplex=False)
    process = context.Process(target=_work, args=(there, row, data, judge))
    began = time.perf_counter()
    process.start()
    there.close()
    try:
        answer = here.recv() if here.poll(limit) else Answer("timeout", reason=f"{limit:g} s")
    except EOFError:
        answer = Answer("crash", reason="the process died")
    if answer.verdict == "timeout":
        answer = replace(answer, seconds=time.perf_counter() - began)
        process.kill()
    process.join()
    return answer


def answered(row: Row, data: Path, judge: str) -> Answer:
    """The answer of a judge in this process, with the seconds that it took after imports."""
    logs = [(data / source.file, source.options) for source in row.sources]
    return timed(judge_named(judge), logs, row.model)


def _work(pipe: Connection, *given: Any) -> None:
    try:
        answer = answered(*given)
    except (Exception, SystemExit) as error:
        print(traceback.format_exc(), flush=True)
        answer = Answer("crash", reason=f"{type(error).__name__}: {error}".splitlines()[0])
    pipe.send(answer)
    pipe.close()
