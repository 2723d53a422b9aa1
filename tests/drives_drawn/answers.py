"""The plain answer of a log, by the package or by a file with another ``balance``.

An answer maps names (J, Fc, Fv, constant_torque, gravity.amplitude, gravity.phase, ...) to
(value, low, high), in SI units, with an interval of 95 %.
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


def answer(log: dict) -> dict:
    """What the package says of a log {t, u, theta and/or w}: the one place that calls it."""
    from lugrectl.identification.balance import balance
    from lugrectl.model import model_from_dict

    model = model_from_dict({"plant": {}, "friction": {"model": "lugre"}}, "drawn drive")
    plain = balance(stretches(log), model).to_dict()
    found = plain["parameters"]
    return {name: (p["value"], *p["ci95"]) for name, p in found.items()}


def stretches(log: dict) -> list:
    """A sound log is one stretch as it is; a damaged one goes through the package's reading."""
    if _sound(log):
        from lugrectl.record.stretch import Stretch

        t, theta, w = log["t"], log.get("theta"), log.get("w")
        dt = (t[-1] - t[0]) / (len(t) - 1)
        return [Stretch(0, dt, t, log["u"], theta, w, np.ones(len(t), bool))]
    from lugrectl.record.log import Log
    from lugrectl.record.stretches import stretches as cut

    channels = {k: v for k, v in log.items() if k != "t"}
    units = {"t": "s", "u": "N m", "theta": "rad", "w": "rad/s"}
    labels = {k: units[k] for k in log}
    return cut([Log("record", log["t"], channels, lambda i: f"row {i}", labels, "rotary", ())])[0]


def _sound(log):
    steps = np.diff(log["t"])
    even = np.ptp(steps) < 1e-6 * abs(np.median(steps))
    return even and not log.get("damaged") and all(np.isfinite(v).all() for v in log.values())


def answer_of_file(path: str | Path):
    """The same of a file that defines ``balance(log) -> {"parameters": {name: (v, low, high)}}``."""
    spec = importlib.util.spec_from_file_location(Path(path).stem, path)
    if spec is None or spec.loader is None:
        raise SystemExit(f"{path} is no Python file")
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)

    def say(log):
        found = module.balance(log)["parameters"]
        return {OTHER_NAMES.get(name, name): tuple(v) for name, v in found.items()}

    return say
