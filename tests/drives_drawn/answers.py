"""The plain answer of a log, by the package or by a file with another ``balance``.

An answer maps names (J, Fc, Fv, constant_torque, gravity.amplitude, gravity.phase, ...) to
(value, low, high), in SI units, with an interval of 95 %. It may hold "notes" too: a list of
sentences.
"""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path

OTHER_NAMES = {
    "offset": "constant_torque",
    "gravity": "gravity.amplitude",
    "gravity phase": "gravity.phase",
}


def answer(log: dict, damaged: bool = False) -> dict:
    """What the package says of a log {t, u, theta and/or w}: the one place that calls it."""
    import lugrectl as lg

    plain = lg.balance(log, {"friction": "lugre"})
    known = plain.summary()["parameters"].items()
    found = {name: (e["value"], *e["ci95"]) for name, e in known}
    return found | {"notes": list(plain.said)}


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
