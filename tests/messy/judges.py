"""Judges: each takes a case and returns an answer."""

from __future__ import annotations

import importlib
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from .case import Answer, Case

Judge = Callable[[Case], Answer]


def judge_of(text: str, prototype: str | None = None) -> Judge:
    """``lugrectl``, ``MODULE:FUNCTION`` or ``prototype`` (which needs its folder)."""
    if text == "lugrectl":
        return lugrectl
    if text == "prototype":
        return _prototype(prototype or "")
    module, _, function = text.partition(":")
    return getattr(importlib.import_module(module), function)


def lugrectl(case: Case) -> Answer:
    """The package's own diagnosis of the record against the declared model."""
    import lugrectl as lg

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "model.toml"
        path.write_text(toml(case.model))
        start = time.perf_counter()
        report = lg.diagnose(case.record, lg.read_model(path)).to_dict()
    return of_report(report, time.perf_counter() - start)


def of_report(report: dict[str, Any], seconds: float) -> Answer:
    """The answer that a report in JSON gives."""
    effects = report["effects"]
    others = [other["name"] for effect in effects for other in effect.get("alternatives") or ()]
    return Answer(
        report["verdict"],
        tuple(effect["name"] for effect in effects),
        tuple(dict.fromkeys(others)),
        frozenset(report.get("depends_on") or ()),
        _intervals(report),
        seconds,
    )


def _intervals(report: dict[str, Any]) -> dict[str, tuple[float, float]]:
    """95 % intervals by name: those of the plain balance, overridden by those of the effects."""
    found = {}
    plain = (report.get("plain") or {}).get("parameters") or {}
    named = [(name, entry) for name, entry in plain.items()]
    for effect in report["effects"]:
        named += [(f"{effect['name']}.{key}", e) for key, e in effect["parameters"].items()]
    for name, entry in named:
        low, high = entry.get("ci95") or (None, None)
        if low is not None and high is not None:
            found[name] = (float(low), float(high))
    return found


def toml(tables: dict[str, Any]) -> str:
    """The tables of a declared model as the text of a model file."""
    lines = [f"{k} = {_value(v)}" for k, v in tables.items() if not isinstance(v, dict | list)]
    for name, table in tables.items():
        if isinstance(table, dict):
            lines += ["", f"[{name}]", *(f"{k} = {_value(v)}" for k, v in table.items())]
        elif isinstance(table, list):
            for entry in table:
                lines += ["", f"[[{name}]]", *(f"{k} = {_value(v)}" for k, v in entry.items())]
    return "\n".join(lines) + "\n"


def _value(value: Any) -> str:
    return f'"{value}"' if isinstance(value, str) else repr(float(value))


def _prototype(folder: str) -> Judge:
    """A comparison kept outside the project, by the folder of its file."""
    if folder not in sys.path:
        sys.path.insert(0, folder)
    compare = importlib.import_module("comparison_prototype").compare

    def judge(case: Case) -> Answer:
        model = case.model
        gravity = sum(e["amplitude"] for e in model.get("effects", ()) if e["name"] == "gravity")
        tables = {**model["plant"], **model["friction"], "motion": model["motion"]}
        start = time.perf_counter()
        said = compare({**case.record}, {**tables, "gravity": gravity})
        return Answer(
            said["verdict"],
            tuple(e if isinstance(e, str) else e["name"] for e in said.get("effects") or ()),
            tuple(e if isinstance(e, str) else e["name"] for e in said.get("alternatives") or ()),
            frozenset(said.get("depends_on") or ()),
            seconds=time.perf_counter() - start,
        )

    return judge
