"""Sound drives: exact logs without background, of the kinds that lead to false alarms."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .case import Case
from .first import LAW, Drawn, Silly, _friction, simulated
from .machine import Machine, declare, draw_machine, elements
from .plant import RATE, TORQUE, VELOCITY

DRIVES = ("pulses", "steps", "coast_down", "slow_scan", "run_up")


def exact(seed: int) -> Case:
    """One log with nothing to find, its torque held from sample to sample."""
    drive = DRIVES[seed // 2 % len(DRIVES)]
    for attempt in range(60):
        g = np.random.default_rng([seed, 5, attempt])
        try:
            return _attempt(seed, drive, g)
        except Silly:
            continue
    raise RuntimeError(f"no plausible {drive} at seed {seed}")


def _attempt(seed: int, drive: str, g: np.random.Generator) -> Case:
    m = replace(
        draw_machine(g, "none"),
        law=str(g.choice(["lugre", "karnopp"])),
        delta=2.0,
        power=1.0,
        u="command",
        w=str(g.choice(["tacho", "none"])),
        tacho=0.0,
        counts=2**22,
    )
    motion, mode = excitation(m, g, drive)
    drawn = Drawn(m, "none", {}, 0.0, motion, mode, exact=True)
    run = simulated(drawn, elements(m, g), 0)
    keep = slice(0, None, m.every)
    record = {"t": run["t"][keep].copy(), "u": run["command"][keep].copy()}
    record["theta"] = run["theta"][keep].copy()
    if m.w == "tacho":
        record["w"] = run["w"][keep].copy()
    if g.random() < 0.5:  # a good encoder and a good tachometer
        quantum = 2 * np.pi / 100000
        record["theta"] = np.round(record["theta"] / quantum) * quantum
        if "w" in record:
            record["w"] += 1e-4 * m.top * g.standard_normal(len(record["w"]))
    return Case(
        seed,
        "sound",
        record,
        declare(m, g),
        "none",
        {"J": m.J, "Fc": m.Fc, "Fv": m.Fv},
        background=LAW,
        friction=_friction(run),
        about={"machine": m.few, "law": m.law, "drive": drive},
    )


def excitation(m: Machine, g: np.random.Generator, drive: str):
    """``(reference, dref, ddref)`` and the mode; in torque mode the reference is the torque."""
    t = np.arange(int(g.uniform(12, 30) * RATE)) / RATE
    zero = np.zeros(len(t))
    if drive == "slow_scan":
        period = g.uniform(4, 8)
        v = m.top * g.uniform(0.05, 0.3) * np.sign(np.sin(2 * np.pi * t / period))
        keep = np.exp(-1 / (RATE * 0.05))
        v = _low_pass(v, keep)
        return (np.cumsum(v) / RATE, v, np.gradient(v) * RATE), VELOCITY
    if drive == "run_up":
        v = m.top * np.minimum(t / t[-1] * g.uniform(1, 2), 1) * np.where(g.random() < 0.5, 1, -1)
        return (np.cumsum(v) / RATE, v, np.gradient(v) * RATE), VELOCITY
    high = m.Fc + m.J * m.pull * g.uniform(0.5, 1)
    if drive == "coast_down":
        u = np.where(t % 4.0 < g.uniform(0.4, 1.0), high, 0.0) * np.sign((t // 4.0) % 2 - 0.5)
    elif drive == "pulses":
        period, width = g.uniform(0.5, 2), g.uniform(0.1, 0.4)
        u = high * ((t % period) < width * period) * np.sign((t // period) % 2 - 0.5)
    else:
        hold = g.uniform(0.2, 0.8)
        levels = g.uniform(0.9, 1.3, int(t[-1] / hold) + 2) * m.Fc
        levels *= np.where(np.arange(len(levels)) % 2, 1, -1)
        u = levels[(t / hold).astype(int)]
    return (u, zero, zero), TORQUE


def _low_pass(x: np.ndarray, keep: float) -> np.ndarray:
    from scipy.signal import lfilter

    return lfilter([1 - keep], [1, -keep], x)
