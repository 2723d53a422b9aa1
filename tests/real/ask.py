"""A judge asked for one row, in a process of its own: its function cannot stand in ``__main__``."""

from __future__ import annotations

import time
from pathlib import Path

from ..scores.judges import apart, judge_named, timed
from ..scores.question import Answer
from .row import Row

LIMIT = 300.0  # s


def ask(row: Row, data: Path, judge: str, limit: float = LIMIT) -> Answer:
    """The answer of a judge, within ``limit`` seconds; "timeout" or "crash" where there is none."""
    began = time.perf_counter()
    try:
        return apart(answered, row, data, judge, limit=limit)
    except TimeoutError as error:
        return Answer("timeout", reason=str(error), seconds=time.perf_counter() - began)
    except RuntimeError as error:
        return Answer("crash", reason=str(error))


def answered(row: Row, data: Path, judge: str) -> Answer:
    """The answer of a judge in this process, with the seconds that it took after imports."""
    logs = [(data / source.file, source.options) for source in row.sources]
    return timed(judge_named(judge), logs, row.model)
