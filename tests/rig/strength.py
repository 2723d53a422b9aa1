"""Scale an effect until its torque has the wanted RMS next to that of friction."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from .bench import Run, Setup, Table, simulate
from .hiding import Effect, Size
from .machines import Machine

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
