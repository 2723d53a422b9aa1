"""The C program of the work item, compiled where a compiler is found."""

from __future__ import annotations

import ctypes
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from . import item

# vectorising the scalar step of so few states makes it slower
FLAGS = ("-O3", "-fno-tree-vectorize", "-fno-tree-slp-vectorize", "-fPIC", "-shared")


def compiler() -> str | None:
    return next(filter(None, map(shutil.which, ("gcc", "cc", "clang"))), None)


def compiled(folder: Path) -> Callable[[float, int], tuple[np.ndarray, float]]:
    """``run(rtol, times)``: states (6, N) and the shortest time of so many runs in s."""
    library = folder / "loop.so"
    source = Path(__file__).with_name("loop.c")
    command = [compiler() or "cc", *FLAGS, "-o", str(library), str(source), "-lm"]
    subprocess.run(command, check=True, capture_output=True)
    best = ctypes.CDLL(str(library)).best
    best.restype = ctypes.c_double
    law = [_law(p) for p in (item.plant, item.believed)]
    numbers = np.array([*law[0], *law[1], item.KP, item.KI, item.K1, item.K2])

    def run(rtol: float, times: int) -> tuple[np.ndarray, float]:
        out = np.empty((len(item.t), len(item.STATES)))
        arrays = [_pointer(a) for a in (numbers, item.t, item.r)]
        seconds = best(
            *arrays,
            ctypes.c_int(len(item.t)),
            _pointer(item.x0),
            ctypes.c_double(rtol),
            _pointer(out),
            ctypes.c_int(times),
        )
        return out.T, seconds

    return run


def _law(p: Any) -> list[float]:
    keys = ("J", "sigma0", "sigma1", "Fc", "Fs", "Fv", "vs")
    return [*(getattr(p, key) for key in keys), 1 / p.J, 1 / p.vs]


def _pointer(values: np.ndarray) -> Any:
    return values.ctypes.data_as(ctypes.POINTER(ctypes.c_double))
