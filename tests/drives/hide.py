"""An effect at a wanted strength beside friction, and what a refit leaves of it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from .effects import Effect, Size
from .machines import NO_LOAD, Machine
from .run import Run, Setup, Table, simulate

COARSE = 100e-6  # good enough to search with; the last runs are fine again


def present(machine: Machine, sizes: dict[str, tuple[Size, float]]) -> tuple[Table, Machine]:
    """Effect table and machine with these effects at these sizes."""
    table: Table = {}
    for name, (size, x) in sizes.items():
        if size.friction is not None:
            machine = size.friction(machine, x)
        else:
            table[name] = size.build(x)
    return table, machine


def search(miss: Callable[[float], float], size: Size, tries: int, close: float) -> float:
    """The x with miss(x) nearest to 0: steps along a power law, kept inside a bracket.

    `miss` is log(wanted / achieved).
    """
    x, best, least = size.start, size.start, np.inf
    short, long = size.low, size.high  # too little and too much effect
    if size.power < 0.0:
        short, long = long, short
    tried: set[float] = set()
    for _ in range(tries):
        x = float(np.clip(x, size.low, size.high))
        if x in tried:
            break
        tried.add(x)
        off = miss(x)
        if abs(off) < least:
            best, least = x, abs(off)
        if abs(off) < close:
            break
        short, long = (x, long) if off > 0.0 else (short, x)
        new = x * float(np.exp(np.clip(off / size.power, -1.2, 1.2)))
        low, high = min(short, long), max(short, long)
        inside = low < new < high
        x = new if inside else float(np.sqrt(max(low, 0.1 * x) * min(high, 10.0 * x)))
    return best


def calibrate(setup: Setup, effect: Effect, size: Size, strength: float) -> tuple[float, Run]:
    """The number that carries the strength, and the record with this effect alone."""
    runs: dict[float, Run] = {}

    def try_with(rig: Setup) -> Callable[[float], float]:
        def miss(x: float) -> float:
            runs[x] = simulate(rig, *present(setup.machine, {effect.name: (size, x)}))
            ratio = runs[x].effect_rms / runs[x].friction_rms
            return float(np.log(strength / max(ratio, 1e-9))) if np.isfinite(ratio) else -9.0

        return miss

    x = search(try_with(replace(setup, step=COARSE)), size, 9, 0.04)
    runs.clear()
    x = search(try_with(setup), replace(size, start=x), 3, 0.1)
    return x, runs[x]


def absorbed(run: Run) -> np.ndarray:
    """Columns: what J, the friction levels and a declared load may take over."""
    s, m = run.signals, run.setup.machine
    w, angle = s["w_true"], s["theta_true"]
    way = np.tanh(w / (0.1 * m.vs))
    slow = np.exp(-np.minimum((w / m.vs) ** 2, 50.0))
    shapes = [np.gradient(w, run.t), w, way, way * slow, np.clip(s["z"] * m.sigma0, -m.Fs, m.Fs)]
    if m.load[0] != NO_LOAD:
        shapes += [np.sin(angle), np.cos(angle)] if m.rotary else [np.ones_like(w)]
    return np.column_stack([x / max(float(np.sqrt(np.mean(x**2))), 1e-12) for x in shapes])


def visible(run: Run) -> float:
    """RMS of the effect torque without what a refit of the declared structure can take over."""
    A, effect = absorbed(run), run.signals["effect"]
    left = effect - A @ np.linalg.lstsq(A, effect, rcond=None)[0]
    return float(np.sqrt(np.mean(left**2)))
