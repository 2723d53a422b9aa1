"""Finds the block whose output is not a number, and the blocks of an algebraic loop."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import control as ct
import numpy as np

from .net import looped
from .trace import AlgebraicLoop


@dataclass
class Probe:
    """Evaluates a system block by block at one instant, by its own functions.

    python-control reports a NaN inside an interconnection as an algebraic loop. Here ``culprit``
    names the first output that is not finite although its block's inputs and states are.
    """

    t: float
    culprit: str = field(default="")

    def outputs(self, system: Any, x: np.ndarray, u: np.ndarray) -> np.ndarray:
        """Outputs of a system; AlgebraicLoop if they never settle."""
        if not isinstance(system, ct.InterconnectedSystem):
            with np.errstate(all="ignore"):
                y = np.reshape(np.asarray(system._out(self.t, x, u), dtype=float), -1)
            self._note(system, np.concatenate([x, u]), y)
            return y
        inputs, y = self._settled(system, x, u)
        return _times(system.output_map, np.concatenate([y, inputs]))

    def _note(self, block: Any, given: np.ndarray, y: np.ndarray) -> None:
        bad = np.flatnonzero(~np.isfinite(y))
        if len(bad) and np.isfinite(given).all() and not self.culprit:
            label, value = block.output_labels[bad[0]], y[bad[0]]
            self.culprit = f"output {label} of block {block.name} is {value}"

    def _settled(self, system: Any, x: np.ndarray, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        external = _times(system.input_map, u)
        inputs = external
        for _ in range(len(system.syslist) + 1):
            parts = [self.outputs(b, own, held) for b, own, held in _parts(system, x, inputs)]
            y = np.concatenate(parts)
            new = _times(system.connect_map, y) + external
            if np.array_equal(new, inputs, equal_nan=True) or not np.isfinite(new).all():
                return new, y
            inputs = new
        raise AlgebraicLoop(self._loop(system, x, inputs))

    def _loop(self, system: Any, x: np.ndarray, inputs: np.ndarray) -> str:
        owner = np.repeat(np.arange(len(system.syslist)), [b.ninputs for b in system.syslist])
        reach, row = np.zeros((len(system.syslist),) * 2), 0
        random = np.random.default_rng(0)
        for i, (block, own, held) in enumerate(_parts(system, x, inputs)):
            base, moved = self.outputs(block, own, held), np.zeros(block.noutputs, dtype=bool)
            for size in (1e-3, 1.0):
                shifted = held + size * random.standard_normal(len(held))
                moved |= self.outputs(block, own, shifted) != base
            for quick in moved:
                if quick:
                    reach[i, owner[np.flatnonzero(system.connect_map[:, row])]] = 1
                row += 1
        names = ", ".join(system.syslist[i].name for i in looped(reach))
        return (
            f"{system.name}: algebraic loop through {names}; each output depends on its input at "
            "the same instant: put a state (a lag, a sensor) between them."
        )


def culprit(system: Any, t: float, x: np.ndarray, u: np.ndarray) -> str:
    """``output y of block b is nan``, or empty; AlgebraicLoop if the outputs never settle."""
    probe = Probe(t)
    probe.outputs(system, np.asarray(x, dtype=float), np.asarray(u, dtype=float))
    return probe.culprit


def _times(matrix: Any, values: np.ndarray) -> np.ndarray:
    """The product, with 0 times nan = 0."""
    rows = np.atleast_2d(np.asarray(matrix, dtype=float))
    return np.array([row[row != 0] @ values[row != 0] for row in rows], dtype=float)


def _parts(system: Any, x: np.ndarray, u: np.ndarray) -> list[tuple[Any, Any, Any]]:
    states = np.cumsum([b.nstates for b in system.syslist])[:-1]
    entries = np.cumsum([b.ninputs for b in system.syslist])[:-1]
    return list(zip(system.syslist, np.split(x, states), np.split(u, entries), strict=True))
