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
from lugrectl.engine import adaptive_run

NEAR = 1e-5  # of the largest value of a row, or of 1
TIGHT = {"rtol": 1e-9, "atol": 1e-11}
NAMES = {"inputs": ("inputs", "U"), "x0": ("initial_state", "X0", "x0"), "params": ("params",)}
SHAPING = ("return_states", "return_x", "transpose", "rtol", "atol")
_original: Any = ct.input_output_response
_inside = False


def repeated(*given: Any, **named: Any) -> Any:
    """python-control's answer, unchanged; what ours was is written down."""
    global _inside
    found = _original(*given, **named)
    if _inside:
        return found
    _inside = True
    try:
        kind, why = _compared(found, *given, **named)
    finally:
        _inside = False
    line = {"test": os.environ.get("PYTEST_CURRENT_TEST", ""), "kind": kind, "why": why}
    with open(os.environ["LUGRECTL_REPEATED"], "a", encoding="utf-8") as file:
        file.write(json.dumps(line) + "\n")
    return found


def _compared(found: Any, *given: Any, **named: Any) -> tuple[str, str]:
    """Whether ours agrees, and the reason if it does not."""
    bound = inspect.signature(_original).bind(*given, **named)
    asked = {**bound.arguments.pop("kwargs", {}), **bound.arguments}
    system, t = asked["sys"], asked.get("timepts", asked.get("T"))
    if "t_eval" in asked or "evaluation_times" in asked:
        return "skipped", "other times of evaluation than those of the inputs"
    options = {k: asked[n] for k, names in NAMES.items() for n in names if n in asked}
    before = dict(getattr(system, "_current_params", {}))
    theirs = found
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            ours = lg.simulate(system, t, **{"inputs": 0.0, "x0": 0.0, **options}, rtol=1e-9)
        except Exception as error:
            return "refused", f"{type(error).__name__}: {error}"
        if system.nstates and not system.isdtime(strict=True):  # at a tolerance to compare at
            again = {k: v for k, v in named.items() if k not in SHAPING}
            again["solve_ivp_kwargs"] = {**(asked.get("solve_ivp_kwargs") or {}), **TIGHT}
            try:
                theirs = _original(*given, **again)
            except Exception:
                pass
    if hasattr(system, "_current_params"):
        system._current_params = before
    if not isinstance(theirs, ct.TimeResponseData) or not theirs.success:
        return "skipped", "python-control's simulation failed"
    for a, b in ((ours.y, theirs.y), (ours.x, theirs.x)):
        if a is None or b is None or not np.size(b):
            continue
        if np.size(a) != np.size(b):
            return "differs", f"the shape is {np.shape(a)}, not {np.shape(b)}"
        off = np.abs(np.reshape(a, np.shape(b)) - b)
        worst = np.max(off / np.maximum(np.max(np.abs(b), axis=-1, keepdims=True), 1.0))
        if not worst < NEAR:
            return "differs", f"by {worst:.3g}"
    return "agrees", ""


adaptive_run.compiler = lambda: None  # many short runs: compiling would take longer
for _name, _loaded in list(sys.modules.items()):
    if _name.split(".")[0] == "control" and vars(_loaded).get("input_output_response") is _original:
        _loaded.input_output_response = repeated  # type: ignore[attr-defined]
