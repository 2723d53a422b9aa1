"""A pytest plugin: each call of ``control.input_output_response`` is repeated by ``lg.simulate``.

``python -m pytest -p tests.cases.repeating --pyargs control.tests``, with the path of a file of
JSON lines in LUGRECTL_REPEATED: one line for each call that python-control answers.
"""

from __future__ import annotations

import inspect
import json
import os
import sys
import warnings
from typing import Any

import control as ct
import numpy as np

import lugrectl as lg
from lugrectl.engine.runtime import adaptive_run

NEAR = 1e-5  # of the largest value of a row, or of 1
TIGHT = {"rtol": 1e-9, "atol": 1e-11}
_original: Any = ct.input_output_response
_inside = False


def repeated(*given: Any, **named: Any) -> Any:
    """python-control's answer, unchanged; what ours was is written down."""
    global _inside
    found = _original(*given, **named)
    if not _inside:
        _inside = True
        try:
            _write(*_compared(found, *given, **named))
        finally:
            _inside = False
    return found


def _compared(found: Any, *given: Any, **named: Any) -> tuple[str, str]:
    """Whether ours agrees, and the reason if it does not."""
    bound = inspect.signature(_original).bind(*given, **named)
    asked = {**bound.arguments.pop("kwargs", {}), **bound.arguments}
    system = asked["sys"]
    t = asked.get("timepts", asked.get("T"))
    if "t_eval" in asked or "evaluation_times" in asked:
        return "skipped", "other times of evaluation than those of the inputs"
    options = {
        "inputs": asked.get("inputs", asked.get("U", 0.0)),
        "x0": asked.get("initial_state", asked.get("X0", asked.get("x0", 0.0))),
        "params": asked.get("params"),
    }
    before = dict(getattr(system, "_current_params", {}))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            ours = lg.simulate(system, t, rtol=1e-9, **options)
        except Exception as error:
            return "refused", f"{type(error).__name__}: {error}"
        theirs = _tight(found, given, named, asked)
    if hasattr(system, "_current_params"):
        system._current_params = before
    return _agreement(ours, theirs)


def _tight(found: Any, given: Any, named: Any, asked: Any) -> Any:
    """The same at a tolerance at which answers can be compared; the given one if that fails."""
    if not asked["sys"].nstates or asked["sys"].isdtime(strict=True):
        return found
    options = {**named, "solve_ivp_kwargs": {**(asked.get("solve_ivp_kwargs") or {}), **TIGHT}}
    for dropped in ("return_states", "return_x", "transpose", "rtol", "atol"):
        options.pop(dropped, None)
    try:
        return _original(*given, **options)
    except Exception:
        return found


def _agreement(ours: Any, theirs: Any) -> tuple[str, str]:
    if not isinstance(theirs, ct.TimeResponseData):
        return "skipped", "the answer is a tuple"
    if not theirs.success:
        return "skipped", "python-control's simulation failed"
    for what in ("y", "x"):
        a, b = getattr(ours, what), getattr(theirs, what)
        if a is None or b is None or not np.size(b):
            continue
        a, b = np.asarray(a), np.asarray(b)
        if a.size != b.size:
            return "differs", f"{what} has the shape {a.shape}, not {b.shape}"
        a, b = a.reshape(b.shape), b.reshape(b.shape)
        size = np.maximum(np.max(np.abs(b), axis=-1, keepdims=True), 1.0)
        worst = float(np.max(np.abs(a - b) / size))
        if not worst < NEAR:
            return "differs", f"{what} by {worst:.3g}"
    return "agrees", ""


def _write(kind: str, why: str) -> None:
    line = {"test": os.environ.get("PYTEST_CURRENT_TEST", ""), "kind": kind, "why": why}
    with open(os.environ["LUGRECTL_REPEATED"], "a", encoding="utf-8") as file:
        file.write(json.dumps(line) + "\n")


adaptive_run.compiler = lambda: None  # many short runs: compiling would take longer
for _name, _loaded in list(sys.modules.items()):
    if _name.split(".")[0] == "control" and vars(_loaded).get("input_output_response") is _original:
        _loaded.input_output_response = repeated  # type: ignore[attr-defined]
