"""The plain answer of a log, by the package or by a file with another ``balance``.

An answer maps names (J, Fc, Fv, constant_torque, gravity.amplitude, gravity.phase, ...) to
(value, low, high), in SI units, with an interval of 95 %. It may hold "notes" too: a list of
sentences.
"""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path

import numpy as np

OTHER_NAMES = {
    "offset": "constant_torque",
    "gravity": "gravity.amplitude",
    "gravity phase": "gravity.phase",
}


def answer(log: dict, damaged: bool = False) -> dict:
    """What the package says of a log {t, u, theta and/or w}: the one place that calls it."""
    from lugrectl.identification.balance import balance
    from lugrectl.model import model_from_dict

    model = model_from_dict({"plant": {}, "friction": {"model": "lugre"}}, "drawn drive")
    pieces, notes = read(log) if damaged else whole(log)
    plain = balance(pieces, model).to_dict()
    found = {name: (p["value"], *p["ci95"]) for name, p in plain["parameters"].items()}
    return found | {"notes": notes + list(plain.get("notes", []))}


def whole(log: dict) -> tuple[list, list[str]]:
    """A sound log is one stretch as it is."""
    from lugrectl.record.stretch import Stretch

    t, theta, w = log["t"], log.get("theta"), log.get("w")
    dt = (t[-1] - t[0]) / (len(t) - 1)
    return [Stretch(0, dt, t, log["u"], theta, w, np.ones(len(t), bool))], []


def read(log: dict) -> tuple[list, list[str]]:
    """A damaged one goes through the package's search for bad rows."""
    from lugrectl.record.log import Log
    from lugrectl.record.stretches import stretches

    channels = {k: v for k, v in log.items() if k != "t"}
    labels = {k: {"t": "s", "u": "N m", "theta": "rad", "w": "rad/s"}[k] for k in log}
    return stretches([Log("record", log["t"], channels, "row {}".format, labels, "rotary", ())])


def answer_of_file(path: str | Path):
    """The same of a file whose ``balance(log)["parameters"]`` is {name: (value, low, high)}."""
    spec = importlib.util.spec_from_file_location(Path(path).stem, path)
    if spec is None or spec.loader is None:
        raise SystemExit(f"{path} is no Python file")
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)

    def say(log, damaged=False):
        found = module.balance(log)
        named = {OTHER_NAMES.get(name, name): tuple(v) for name, v in found["parameters"].items()}
        return named | {"notes": found.get("notes", [])}

    return say
