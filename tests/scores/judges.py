"""Judges: what answers a log. Each is called with the logs and the declared model.

The logs are pairs of a path or columns, and the options of reading it. A judge returns an
``Answer``, or a ``Diagnosis``, of which the document counts.
"""

from __future__ import annotations

import importlib
import multiprocessing
import time
import traceback
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from multiprocessing.connection import Connection
from typing import Any

from .question import Answer, Estimate

Logs = Sequence[tuple[Any, Mapping[str, Any]]]
Judge = Callable[[Logs, Mapping[str, Any]], Any]
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")


def apart(work: Callable[..., Any], *given: Any, limit: float) -> Any:
    """What ``work(*given)`` returns, in a process of its own: one that fails costs nothing else.

    Raises TimeoutError after ``limit`` seconds, and RuntimeError with what went wrong there.
    """
    context = multiprocessing.get_context("spawn")
    here, there = context.Pipe(duplex=False)
    process = context.Process(target=_answer, args=(there, work, given))
    process.start()
    there.close()
    try:
        if not here.poll(limit):
            raise TimeoutError(f"{limit:g} s")
        made, wrong = here.recv()
    except EOFError:
        raise RuntimeError("the process died") from None
    finally:
        process.kill()
        process.join()
    if wrong:
        raise RuntimeError(wrong)
    return made


def _answer(pipe: Connection, work: Callable[..., Any], given: Sequence[Any]) -> None:
    try:
        made, wrong = work(*given), ""
    except (Exception, SystemExit) as error:
        print(traceback.format_exc(), flush=True)
        made, wrong = None, f"{type(error).__name__}: {error}".splitlines()[0]
    pipe.send((made, wrong))


def judge_named(name: str) -> Judge:
    """The judge of a name: "lugrectl", "balance" or "MODULE:FUNCTION"."""
    own = {"lugrectl": diagnosed, "balance": balanced}
    if name in own:
        import lugrectl

        _ = lugrectl.read_record, lugrectl.diagnose, lugrectl.balance  # before the clock runs
        return own[name]
    module, colon, function = name.partition(":")
    if not colon:
        raise SystemExit(f"--judge: {name} is neither a known judge nor MODULE:FUNCTION.")
    return getattr(importlib.import_module(module), function)


def timed(judge: Judge, logs: Logs, model: Mapping[str, Any]) -> Answer:
    """The answer, with the seconds that it took."""
    began, cpu = time.perf_counter(), time.process_time()
    said = judge(logs, model)
    answer = said if isinstance(said, Answer) else of_document(said.summary())
    seconds = time.perf_counter() - began
    return replace(answer, seconds=seconds, cpu=time.process_time() - cpu)


def diagnosed(logs: Logs, model: Mapping[str, Any]) -> Any:
    """The package's diagnosis."""
    import lugrectl as lg

    try:
        records = [_read(log, options, model) for log, options in logs]
    except lg.Refused as refusal:
        return Answer("refused", reason=str(refusal))
    return lg.diagnose(records if len(records) > 1 else records[0], dict(model))


def balanced(logs: Logs, model: Mapping[str, Any]) -> Answer:
    """The package's plain answer to one log, which knows nothing but that there is friction."""
    import lugrectl as lg

    plain = lg.balance(_read(*logs[0], model), {"friction": "lugre"})
    known = plain.summary()["parameters"]
    return Answer("plain", parameters=_triples(known), reason=" ".join(plain.said))


def _read(log: Any, options: Mapping[str, Any], model: Mapping[str, Any]) -> Any:
    import lugrectl as lg

    if isinstance(log, Mapping):
        return log
    return lg.read_record(log, motion=model.get("motion"), **options)


def of_document(d: Mapping[str, Any]) -> Answer:
    """The answer that the JSON document of a diagnosis gives."""
    others = (a["name"] for e in d["effects"] for a in e["alternatives"])
    return Answer(
        d["verdict"],
        tuple(e["name"] for e in d["effects"]),
        tuple(dict.fromkeys(others)),
        tuple(d["depends_on"] or ()),
        values_of(d),
        (d["plain"] or {}).get("left"),
        reason=d["reason"] or "",
    )


def values_of(d: Mapping[str, Any]) -> dict[str, Estimate]:
    """Certain values of the balance, its sums, and over them those of the finer fit."""
    plain = d["plain"] or {"parameters": {}, "combinations": []}
    made = _triples(plain["parameters"]) | _triples({c["text"]: c for c in plain["combinations"]})
    made |= _triples({k: e for k, e in d["parameters"].items() if not e.get("held")})
    own = {f"{e['name']}.{k}": v for e in d["effects"] for k, v in e["parameters"].items()}
    return made | _triples(own)


def _triples(entries: Mapping[str, Mapping[str, Any]]) -> dict[str, Estimate]:
    return {k: (e["value"], *(e.get("ci95") or (None, None))) for k, e in entries.items()}
