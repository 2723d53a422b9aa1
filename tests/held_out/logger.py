"""What the data logger of a rig writes: torque, angle and speed with their sensors' faults."""

import numpy as np

from .loop import TACHO
from .machines import Rig, between
from .motion_facts import lagged


def torque(rng, rig: Rig, o: dict, level: float, rows, need: str):
    """The torque channel, and its offset: a command, or a current, at times some rows late."""
    kind = str(rng.choice(["command", "current", "mean current"], p=[0.4, 0.35, 0.25]))
    kind = "command" if need == "command" else kind
    moved = int(rng.choice([0, 0, 1, 2, 3])) if kind != "command" else 0
    if kind == "command":
        return o["cmd"][rows], 0.0
    x = o["u"][rows]
    if kind == "mean current":
        total = np.concatenate([[0.0], np.cumsum(o["u_mean"])])
        x = (total[rows] - total[np.maximum(rows - rig.every, 0)]) / rig.every
    if moved:
        x = np.concatenate([np.full(moved, x[0]), x[:-moved]])
    noise = level * between(rng, 0.002, 0.06)
    offset = level * float(rng.uniform(-0.03, 0.03)) if rng.random() < 0.5 else 0.0
    x = x + offset + noise * rng.standard_normal(x.size)
    if rng.random() < 0.5:
        step = rig.control["umax"] / 2 ** int(rng.integers(9, 14))
        x = np.round(x / step) * step
    return x, offset


def speed(rng, rig: Rig, o: dict, rows):
    """The speed channel: of the firmware, or of a tacho beside it."""
    if rng.random() < 0.7 or rig.sensor["kind"] == TACHO:
        x = o["w_read"]
    else:
        x = lagged(o["w"], between(rng, 0.1, 1.5) / rig.fs, rig.Tc)
        x = x + rig.wmax * between(rng, 2e-4, 3e-3) * rng.standard_normal(x.size)
    return lagged(x, rig.values.get("w_lag", 0.0), rig.Tc)[rows]


def angle(rng, rig: Rig, o: dict, rows):
    """The angle channel: encoder counts, or a resolver with two ripples per turn."""
    if rig.lines < 20_000 or rng.random() >= 0.25:
        return o["read"][rows] + 0.5 * rig.sensor["q"]  # a count names the middle of its step
    step, s = 2 * np.pi / 2 ** int(rng.integers(14, 18)), rig.sensor
    x = o["theta"][rows] + step * rng.uniform(0.2, 1) * rng.standard_normal(rows.size)
    if s.get("ecc"):
        x += s["ecc"] * np.sin(s["ecc_n"] * o["theta"][rows] + s["ecc_ph"])
    return np.round(x / step) * step


def write(rng, rig: Rig, o: dict, level: float, kind: str, need: str = ""):
    """The log and the offset of its torque; `need` is a channel that must be there."""
    rows = np.arange(0, o["w"].size, rig.every)
    log = {"t": rows * rig.Tc}
    log["u"], offset = torque(rng, rig, o, level, rows, need)
    which = str(rng.choice(["theta", "w", "both"], p=[0.3, 0.15, 0.55]))
    if need in ("w", "theta") and need != which:
        which = "both"
    if which != "w":
        log["theta"] = angle(rng, rig, o, rows)
    if which != "theta":
        log["w"] = speed(rng, rig, o, rows)
    if kind != "plain":
        stamp(rng, rig, log)
    return log, offset


def stamp(rng, rig: Rig, log: dict) -> None:
    """Times as loggers write them: late by some jitter, rounded, some rows lost."""
    if rng.random() < 0.2:
        jitter = float(rng.uniform(0.005, 0.05)) / rig.fs
        log["t"] = log["t"] + jitter * rng.standard_normal(log["t"].size).clip(-3, 3)
    if rng.random() < 0.3:
        log["t"] = np.round(log["t"], 6 if rig.fs > 500 else 5)
    if rng.random() < 0.08:
        keep = rng.random(log["t"].size) > rng.uniform(0.0005, 0.005)
        for name in log:
            log[name] = log[name][keep]
