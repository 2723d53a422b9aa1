"""The form of an answer in a few lines: names and types, no values, for documents and results.

A form is a type, ``Maybe(form)`` for what may be None, ``[form]`` for any number of them,
``(form, form)`` for so many, ``{name: form}`` for entries or attributes. A name that ends in "?"
may be missing; ``{...: form}`` is of any names. More names than those are no fault.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

MISSING = object()


@dataclass(frozen=True)
class Maybe:
    """What may be None."""

    form: Any


def faults(value: Any, form: Any, at: str = "") -> Iterator[str]:
    """A sentence for each part of a value that is not of its form."""
    if isinstance(form, Maybe):
        yield from () if value is None else faults(value, form.form, at)
    elif isinstance(form, Mapping):
        yield from _named(value, form, at)
    elif isinstance(form, (list, tuple)):
        yield from _listed(value, form, at)
    elif not _is(value, form):
        yield f"{at}: {value!r:.60} is no {form.__name__}"


def _is(value: Any, kind: type) -> bool:
    if kind in (int, float):
        whole = isinstance(value, (int, np.integer)) and not isinstance(value, bool)
        real = isinstance(value, (float, np.floating)) and bool(np.isfinite(value))
        return whole or (kind is float and real)
    return isinstance(value, kind)


def _listed(value: Any, form: list | tuple, at: str) -> Iterator[str]:
    if not isinstance(value, (list, tuple)):
        yield f"{at}: {value!r:.60} is no list"
    elif isinstance(form, tuple) and len(value) != len(form):
        yield f"{at}: {len(value)} values, not {len(form)}"
    else:
        each = form if isinstance(form, tuple) else form * len(value)
        for i, (one, own) in enumerate(zip(value, each, strict=True)):
            yield from faults(one, own, f"{at}[{i}]")


def _named(value: Any, form: Mapping, at: str) -> Iterator[str]:
    for name, own in form.items():
        if name is ...:
            yield from _any_names(value, own, at)
            continue
        known = name.removesuffix("?")
        one = value.get(known, MISSING) if isinstance(value, Mapping) else _part(value, known)
        if one is not MISSING:
            yield from faults(one, own, f"{at}.{known}")
        elif not name.endswith("?"):
            yield f"{at}.{known} is missing"


def _part(value: Any, name: str) -> Any:
    return getattr(value, name, MISSING)


def _any_names(value: Any, form: Any, at: str) -> Iterator[str]:
    if not isinstance(value, Mapping):
        yield f"{at}: {value!r:.60} has no names"
        return
    for name, one in value.items():
        yield from () if isinstance(name, str) else (f"{at}: the name {name!r} is no text",)
        yield from faults(one, form, f"{at}.{name}")


NUMBER = Maybe(float)
ENDS = Maybe((NUMBER, NUMBER))

# Documents: summary(), to_json(), report.json and what --json prints.

ESTIMATE = {"value": NUMBER, "unit": str, "ci95": ENDS, "held?": bool, "together?": str}
CANDIDATE = {"name": str, "score": NUMBER}
FINDING = {"name": str, "parameters": {...: ESTIMATE}, "alternatives": [CANDIDATE]}
FITTED = {"declared": NUMBER, "refitted": NUMBER}
ERRORS = FITTED | {"augmented": NUMBER}
RESTARTED = {"signal": str, "unit": str, "samples": int, "horizon": NUMBER, "noise_floor": NUMBER}
RESTARTED |= {"fit?": {...: NUMBER}}
ERROR, IDENTIFIED_ERROR = RESTARTED | ERRORS, RESTARTED | FITTED
FREE_ERROR = ERRORS | {"signal": str, "unit": str, "in_sample": bool}
TORQUE_ERROR = ERRORS | {"unit": str}
MODEL = {"plant": {...: object}, "friction": {"model": str}, "effects": [{"name": str}]}
STATED = {"stated": {...: {...: object}}}
FACTS = {"samples": int, "rate": float, "duration": float, "dropped": int}
SUM = {"text": str, "value": NUMBER, "unit": str, "ci95": ENDS, "to_separate": Maybe(str)}
POINT = {"w": float, "torque": NUMBER, "ci95": ENDS, "samples": int}
BENCH_TABLE = {"columns": [str], "rows": [[object]]}
BENCH_VALUE = {"value": NUMBER, "unit": str, "ci95": [NUMBER]}
BENCH_TEST = {"kind": str, "text": str, "values": {...: BENCH_VALUE}, "table?": BENCH_TABLE}
PLAIN = {
    "parameters": {...: ESTIMATE}, "combinations": [SUM], "curve": [POINT], "left": NUMBER,
    "seconds": NUMBER, "bench_tests?": [BENCH_TEST],
}  # fmt: skip
SHARE = {"term": str, "rms": NUMBER, "share": NUMBER, "ci95": ENDS, "signals": [str]}
ROW = {"model": str, "elpd": NUMBER, "se": NUMBER, "torque": NUMBER, "parameters": int}
LIMIT = {"name": str, "share": NUMBER}
JOINT = {"names": [str], "matrix": [[float]]}
MEMBER = JOINT | {
    "weight": float, "model": MODEL | STATED, "values": [float], "positive": [bool],
    "unknown": [str],
}  # fmt: skip
DRIVE = {
    "rate": float, "resolution": float, "noise": float, "speed_noise": NUMBER, "torque": NUMBER,
    "speed": float,
}  # fmt: skip
RESIDUALS = {
    "signal": str, "lags": [int], "autocorrelation": [float], "cross": [float], "bound": float,
    "white": bool, "independent": bool,
}  # fmt: skip
TABLE = {
    "name": str, "signals": [str], "unit": str, "periodic": bool, "points": [float],
    "values": [object], "standard_error": [object], "share": NUMBER, "share_ci95": (NUMBER, NUMBER),
    "rms": NUMBER, "windows": int,
}  # fmt: skip
SWING = ESTIMATE | {"order": int}
MAP = {"w": [float], "u": [float], "error": [NUMBER], "held_out": [bool], "swing": [SWING]}
LAW = {
    "name": str, "elpd": NUMBER, "se": NUMBER, "torque": NUMBER, "error": NUMBER,
    "parameters": Maybe(int), "reason": Maybe(str),
}  # fmt: skip
LAWS = {"chosen": str, "alike": [str], "unit": str, "laws": [LAW]}
FILE = {"name": str, "sha256": str}
PROVENANCE = {"version": str, "date": str, "command": str, "files": [FILE]}
COMPENSATION = {
    "loop": str, "observer": Maybe(str), "signal": str, "unit": str, "none": NUMBER,
    "before": NUMBER, "after": NUMBER, "controller": {...: object}, "observer_gains": {...: object},
    "compensated": [str], "not_compensated": [{"name": str, "reason": str}],
    "reference": {...: object}, "messages": [str], "drive": Maybe({...: object}),
}  # fmt: skip

COMMON = {
    "schema": int, "parameters": {...: ESTIMATE}, "record": Maybe(FACTS),
    "records": [FACTS | {"name": str}], "laws": Maybe(LAWS), "messages": [str],
    "plain": Maybe(PLAIN), "covariance": Maybe(JOINT), "members": Maybe([MEMBER]),
    "drive": Maybe(DRIVE), "residuals": Maybe(RESIDUALS), "provenance": Maybe(PROVENANCE),
}  # fmt: skip
DIAGNOSIS = COMMON | {
    "verdict": str, "headline": str, "effects": [FINDING], "depends_on": [str],
    "experiment": Maybe(str), "error": Maybe(ERROR), "free_error": Maybe(FREE_ERROR),
    "torque_error": Maybe(TORQUE_ERROR), "model": MODEL | STATED, "ranking": [CANDIDATE],
    "table": Maybe(TABLE), "compensation": Maybe(COMPENSATION), "map": Maybe(MAP),
    "reason": Maybe(str), "budget": Maybe([SHARE]), "comparison": Maybe([ROW]),
    "detectable": Maybe([LIMIT]),
}  # fmt: skip
EMPTY = {"plant": {...: object}, "friction": {...: object}, "effects": [object]}
REFUSAL = DIAGNOSIS | {"model": EMPTY, "reason": str}
IDENTIFICATION = COMMON | {"error": Maybe(IDENTIFIED_ERROR), "model": MODEL | STATED}
ERROR_KEYS = ("signal", "unit", "declared", "refitted", "augmented", "noise_floor")
OUTCOME = {
    "file": str, "exit_code": int, "seconds": float, "reason": Maybe(str),
    "diagnosis": Maybe(DIAGNOSIS | {"model": EMPTY}),
}  # fmt: skip
FLEET = {
    "schema": int, "records": [OUTCOME], "counts": {...: int}, "unfinished": [str],
    "provenance": Maybe(PROVENANCE),
}  # fmt: skip

# Results, as the report, its pictures, the compensation and the observers read them.

ARRAY = np.ndarray
VALUE = {"value": float, "unit": str, "ci95": ENDS, "held": bool, "together": str}
TRIED = {"name": str, "score": NUMBER, "share": NUMBER}
FOUND = {"name": str, "parameters": {...: VALUE}, "alternatives": [TRIED]}
TRACES = {
    "t": ARRAY, "measured": ARRAY, "held_out": ARRAY, "simulated": {...: ARRAY},
    "residual": {...: ARRAY}, "signals": {...: ARRAY},
}  # fmt: skip
DISTRIBUTION = {"names": [str], "values": ARRAY, "matrix": ARRAY, "positive": ARRAY}
BELIEF = {"model": object, "joint": DISTRIBUTION, "weight": float}
TESTS = {"lags": ARRAY, "autocorrelation": ARRAY, "cross": ARRAY, "bound": float}
STRETCH = {"run": int, "dt": float, "t": ARRAY, "u": ARRAY, "theta": Maybe(ARRAY)}
STRETCH |= {"w": Maybe(ARRAY), "ok": ARRAY}
LEFT = {"t": ARRAY, "run": ARRAY, "value": ARRAY, "sliding": ARRAY}
ON_BENCH = {"kind": str, "text": str, "values": {...: VALUE}, "table": Maybe(BENCH_TABLE)}
BALANCE = {
    "parameters": {...: VALUE}, "combinations": [SUM], "curve": [POINT], "left": NUMBER,
    "seconds": float, "notes": [str], "reading": [str], "said": [str], "why_not": [str],
    "half_width": NUMBER, "residual": Maybe(LEFT), "stretches": [STRETCH], "motion": str,
    "bench_tests": [ON_BENCH],
}  # fmt: skip
COMPARISON = {
    "rows": [ROW], "budget": [SHARE], "detectable": [LIMIT], "least": float,
    "stretches": Maybe(int),
}  # fmt: skip
UNEXPLAINED = {
    "signals": [str], "points": ARRAY, "values": ARRAY, "error": ARRAY, "periodic": bool,
    "share": float, "share95": (float, float), "rms": float, "unit": str, "windows": int,
    "motion": str, "name": str,
}  # fmt: skip
POINTS = {
    "w": ARRAY, "u": ARRAY, "error": ARRAY, "held_out": ARRAY, "at": ARRAY, "curves": {...: ARRAY},
    "motion": str, "swing": [(int, VALUE)],
}  # fmt: skip
RECORD = {"t": ARRAY, "u": ARRAY, "dt": float, "samples": int, "source": str, "motion": str}
RESULT = {
    "estimates": {...: VALUE}, "messages": [str], "record": Maybe(RECORD), "records": [RECORD],
    "error": Maybe({...: object}), "traces": Maybe(TRACES), "joint": Maybe(DISTRIBUTION),
    "rivals": [BELIEF], "residuals": Maybe(TESTS), "torque_noise": NUMBER, "map": Maybe(POINTS),
    "plain": Maybe(BALANCE), "verdict": str, "effects": [FOUND], "depends_on": [str],
    "model": object, "declared": object, "laws": object, "provenance": object,
}  # fmt: skip
ANSWER = RESULT | {
    "experiment": Maybe(str), "reason": Maybe(str), "free_error": Maybe({...: object}),
    "torque_error": Maybe({...: object}), "ranking": [TRIED], "table": Maybe(UNEXPLAINED),
    "comparison": Maybe(COMPARISON), "compensation": object,
}  # fmt: skip
