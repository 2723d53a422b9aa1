"""Judges: what answers a row. Each is called with the logs (path, options) and the declared model.

A judge may return an ``Answer``, a dict of its fields, or a ``Diagnosis``, of which the document
counts; :func:`answer_of` understands all three.
"""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from .score import Answer, Estimate

Logs = Sequence[tuple[Path, Mapping[str, Any]]]
Judge = Callable[[Logs, Mapping[str, Any]], Any]
CHANNELS = ("u", "theta", "w")


def judge_named(name: str, prototype: str | None = None) -> Judge:
    """The judge of a name: "lugrectl", "prototype" or "MODULE:FUNCTION"."""
    if name == "prototype":
        if prototype is None:
            raise SystemExit("--judge prototype needs --prototype DIR, the folder of its modules.")
        sys.path.insert(0, prototype)
        importlib.import_module("comparison_prototype")  # before the clock runs
        return of_prototype
    if name == "lugrectl":
        import lugrectl

        _ = lugrectl.read_record, lugrectl.diagnose
        return diagnosed
    module, colon, function = name.partition(":")
    if not colon:
        raise SystemExit(f"--judge: {name} is neither a known judge nor MODULE:FUNCTION.")
    return getattr(importlib.import_module(module), function)


def diagnosed(logs: Logs, model: Mapping[str, Any]) -> Any:
    """The package's diagnosis."""
    import lugrectl as lg

    motion = model.get("motion")
    try:
        records = [lg.read_record(path, motion=motion, **options) for path, options in logs]
    except lg.Refused as refusal:
        return Answer("refused", reason=str(refusal))
    return lg.diagnose(records if len(records) > 1 else records[0], dict(model))


def of_prototype(logs: Logs, model: Mapping[str, Any]) -> Answer:
    """The research prototype, on the rows as they were recorded."""
    compare: Any = importlib.import_module("comparison_prototype").compare
    said = compare([arrays(path, model, options) for path, options in logs], flat(model))
    budget, found = said["budget"], said["parameters"]
    values: dict[str, Estimate] = {
        f"{effect}.{key}": (float(v), None, None)
        for effect, (pairs, _) in found.items()
        for key, v in pairs.items()
    }
    if budget.get("sure"):  # else its number for J is not meant
        values["J"] = (float(budget["J"]), None, None)
    if budget.get("w_lag"):
        values["w_lag"] = (float(budget["w_lag"]), None, None)
    names = (tuple(said[k]) for k in ("effects", "alternatives", "depends_on"))
    reason = " ".join(said["notes"])
    return Answer(said["verdict"], *names, parameters=values, reason=reason)


def arrays(path: Path, model: Mapping[str, Any], options: Mapping[str, Any]) -> dict[str, Any]:
    """The columns of a log in SI units; rows in which a number is missing are left out."""
    from lugrectl.record import read_log

    log = read_log(path, motion=model.get("motion"), **options)
    columns = {"t": log.t, **{k: log.channels[k] for k in CHANNELS if k in log.channels}}
    whole = np.all([np.isfinite(x) for x in columns.values()], axis=0)
    return {k: x[whole] for k, x in columns.items()}


def flat(model: Mapping[str, Any]) -> dict[str, Any]:
    """The declared values by name, and the amplitude of a declared gravity."""
    law = {k: v for k, v in model.get("friction", {}).items() if k != "model"}
    loads = [e for e in model.get("effects", []) if e["name"] == "gravity"]
    more = {"gravity": loads[0].get("amplitude", 0.0)} if loads else {}
    return {**model.get("plant", {}), **law, **more, "motion": model.get("motion", "rotary")}


def answer_of(said: Any) -> Answer:
    """What a judge returned, as an Answer."""
    if isinstance(said, Answer):
        return said
    if not isinstance(said, Mapping):
        return of_document(said.summary())
    lists = {k: tuple(said.get(k, ())) for k in ("effects", "alternatives", "depends_on")}
    more = {k: said[k] for k in ("parameters", "left", "reason") if said.get(k) is not None}
    return Answer(said["verdict"], **lists, **more)


def of_document(d: Mapping[str, Any]) -> Answer:
    """The answer that the JSON document of a diagnosis gives."""
    others = (a["name"] for e in d["effects"] for a in e["alternatives"])
    return Answer(
        d["verdict"],
        tuple(e["name"] for e in d["effects"]),
        tuple(dict.fromkeys(others)),
        tuple(d["depends_on"]),
        values_of(d),
        (d["plain"] or {}).get("left"),
        reason=d["reason"] or "",
    )


def values_of(d: Mapping[str, Any]) -> dict[str, Estimate]:
    """Certain values of the balance, its sums, and over them those of the finer fit."""
    plain = d["plain"] or {"parameters": {}, "combinations": []}
    made = {k: _triple(e) for k, e in plain["parameters"].items()}
    made |= {c["text"]: _triple(c) for c in plain["combinations"]}
    return made | {k: _triple(e) for k, e in d["parameters"].items() if not e.get("held")}


def _triple(e: Mapping[str, Any]) -> Estimate:
    low, high = e["ci95"] or (None, None)
    return e["value"], low, high
