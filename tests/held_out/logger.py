"""What the data logger of a rig writes: torque, angle and speed with their sensors' faults."""

import numpy as np

from .loop import TACHO
from .machines import Rig, between
from .motion_facts import lagged


def torque(rng, rig: Rig, o: dict, level: float, rows, need: str):
    """The torque channel, and how late it is against the torque that acts."""
    Tc, Ts = rig.Tc, 1.0 / rig.fs
    kind = str(rng.choice(["command", "current", "mean current"], p=[0.4, 0.35, 0.25]))
    kind = "command" if need == "command" else kind
    moved = int(rng.choice([0, 0, 1, 2, 3])) if kind != "command" else 0
    about = {"source": kind, "offset": 0.0, "noise": 0.0}
    if kind == "command":
        return o["cmd"][rows], {**about, "late": -rig.values.get("delay", 0.0)}
    if kind == "current":
        x, late = o["u"][rows], 0.0
    else:
        total = np.concatenate([[0.0], np.cumsum(o["u_mean"])])
        x, late = (total[rows] - total[np.maximum(rows - rig.every, 0)]) / rig.every, 0.5 * Ts
    if moved:
        x = np.concatenate([np.full(moved, x[0]), x[:-moved]])
    about["noise"] = level * between(rng, 0.002, 0.06)
    about["offset"] = level * float(rng.uniform(-0.03, 0.03)) if rng.random() < 0.5 else 0.0
    x = x + about["offset"] + about["noise"] * rng.standard_normal(x.size)
    if rng.random() < 0.5:
        step = rig.control["umax"] / 2 ** int(rng.integers(9, 14))
        x = np.round(x / step) * step
        about["step"] = step
    return x, {**about, "late": late + moved * Ts, "averaged": Tc * rig.every * (late > 0)}


def filter_delay(tau: float, Tc: float) -> float:
    """How late a slow signal leaves a sampled first-order filter."""
    keep = np.exp(-Tc / tau) if tau > 0 else 0.0
    return float(Tc * keep / (1 - keep))


def speed(rng, rig: Rig, o: dict, rows):
    """The speed channel: of the firmware, or of a tacho beside it."""
    s, Ts = rig.sensor, 1.0 / rig.fs
    lag = rig.values.get("w_lag", 0.0)
    if rng.random() < 0.7 or s["kind"] == TACHO:
        source = ("difference of counts", "time between edges", "tacho")[int(s["kind"])]
        late = filter_delay(s.get("tau", 0.0), rig.Tc)
        late += 0.5 * rig.Tc if s["kind"] < TACHO else 0.0
        x = o["w_read"]
    else:
        source, tau = "tacho", between(rng, 0.1, 1.5) * Ts
        x, late = lagged(o["w"], tau, rig.Tc), filter_delay(tau, rig.Tc)
        x = x + rig.wmax * between(rng, 2e-4, 3e-3) * rng.standard_normal(x.size)
    return lagged(x, lag, rig.Tc)[rows], {"source": source, "late": late}


def angle(rng, rig: Rig, o: dict, rows):
    """The angle channel: encoder counts, or a resolver with two ripples per turn."""
    x = o["read"][rows].copy()
    about = {"source": "encoder", "step": rig.sensor["q"], "late": 0.0}
    if rig.lines >= 20_000 and rng.random() < 0.25:
        step = 2 * np.pi / 2 ** int(rng.integers(14, 18))
        x = o["theta"][rows] + step * rng.uniform(0.2, 1) * rng.standard_normal(rows.size)
        if rig.sensor.get("ecc"):
            s = rig.sensor
            x += s["ecc"] * np.sin(s["ecc_n"] * o["theta"][rows] + s["ecc_ph"])
        x = np.round(x / step) * step
        about |= {"source": "resolver", "step": step}
    else:
        about["late"] = 0.0
        x += 0.5 * rig.sensor["q"]  # a count names the middle of its step
    return x, about


def write(rng, rig: Rig, o: dict, level: float, kind: str, need: str = ""):
    """The log and what is hidden in its channels; `need` is one that must be there."""
    rows = np.arange(0, o["w"].size, rig.every)
    log = {"t": rows * rig.Tc}
    log["u"], about_u = torque(rng, rig, o, level, rows, need)
    about = {"u": about_u}
    which = str(rng.choice(["theta", "w", "both"], p=[0.3, 0.15, 0.55]))
    if need in ("w", "theta") and need != which:
        which = "both"
    if which != "w":
        log["theta"], about["theta"] = angle(rng, rig, o, rows)
    if which != "theta":
        log["w"], about["w"] = speed(rng, rig, o, rows)
    if kind != "plain":
        stamp(rng, rig, log, about)
    return log, about


def stamp(rng, rig: Rig, log: dict, about: dict) -> None:
    """Times as loggers write them: late by some jitter, rounded, some rows lost."""
    if rng.random() < 0.2:
        about["jitter"] = float(rng.uniform(0.005, 0.05)) / rig.fs
        log["t"] = log["t"] + about["jitter"] * rng.standard_normal(log["t"].size).clip(-3, 3)
    if rng.random() < 0.3:
        log["t"] = np.round(log["t"], 6 if rig.fs > 500 else 5)
    if rng.random() < 0.08:
        keep = rng.random(log["t"].size) > rng.uniform(0.0005, 0.005)
        about["lost_rows"] = int((~keep).sum())
        for name in log:
            log[name] = log[name][keep]
