"""A system at one instant, block by block: the block whose output is not a number, or a loop."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import control as ct
import numpy as np

from ...core.errors import Diverged
from .instant import AlgebraicLoop, Unsolved, loop_message
from .pointwise import settled_values


@dataclass
class Probe:
    """Evaluates a system block by block at one instant, by its own functions.

    python-control reports a NaN inside an interconnection as an algebraic loop. Here ``culprit``
    names the first output that is not finite although its block's inputs and states are.
    ``loops`` remembers, for each interconnection, the inputs of a loop that is linear.
    """

    t: float
    culprit: str = field(default="")
    loops: dict[int, np.ndarray] = field(default_factory=dict)

    def outputs(self, system: Any, x: np.ndarray, u: np.ndarray) -> np.ndarray:
        """Outputs of a system; AlgebraicLoop if they never settle."""
        if not isinstance(system, ct.InterconnectedSystem):
            return self._called(system, system._out, x, u)
        inputs = self._inputs(system, x, u)
        y = self._through(system, x, inputs)
        return _times(system.output_map, np.concatenate([y, inputs]))

    def rates(self, system: Any, x: np.ndarray, u: np.ndarray) -> np.ndarray:
        """Rates of a system; AlgebraicLoop as for the outputs."""
        if not system.nstates:
            return np.zeros(0)
        if not isinstance(system, ct.InterconnectedSystem):
            return self._called(system, system._rhs, x, u)
        parts = _parts(system, x, self._inputs(system, x, u))
        return np.concatenate([self.rates(block, own, held) for block, own, held in parts])

    def _called(self, block: Any, function: Any, x: np.ndarray, u: np.ndarray) -> np.ndarray:
        with np.errstate(all="ignore"):
            values = np.reshape(np.asarray(function(self.t, x, u), dtype=float), -1)
        if function == block._out:
            self._note(block, np.concatenate([x, u]), values)
        return values

    def _note(self, block: Any, given: np.ndarray, y: np.ndarray) -> None:
        bad = np.flatnonzero(~np.isfinite(y))
        if len(bad) and np.isfinite(given).all() and not self.culprit:
            label, value = block.output_labels[bad[0]], y[bad[0]]
            self.culprit = f"output {label} of block {block.name} is {value}"

    def _through(self, system: Any, x: np.ndarray, inputs: np.ndarray) -> np.ndarray:
        parts = _parts(system, x, inputs)
        return np.concatenate([self.outputs(block, own, held) for block, own, held in parts])

    def _inputs(self, system: Any, x: np.ndarray, u: np.ndarray) -> np.ndarray:
        """The inputs of all blocks of an interconnection."""
        external = _times(system.input_map, u)
        owners = np.repeat(np.arange(len(system.syslist)), [b.ninputs for b in system.syslist])
        before = self.culprit

        def step(inputs: np.ndarray) -> np.ndarray:
            return _times(system.connect_map, self._through(system, x, inputs)) + external

        try:
            found = settled_values(step, external, owners.tolist(), self.loops, id(system))
        except Unsolved as error:
            names = ", ".join(system.syslist[i].name for i in error.blocks)
            raise AlgebraicLoop(loop_message(system.name, names)) from None
        if np.isfinite(found).all():
            self.culprit = before  # what was tried on the way does not count
        return found


def culprit(system: Any, t: float, x: np.ndarray, u: np.ndarray) -> str:
    """``output y of block b is nan``, or empty; AlgebraicLoop if the outputs never settle."""
    probe = Probe(t)
    probe.outputs(system, np.asarray(x, dtype=float), np.asarray(u, dtype=float))
    return probe.culprit


class Instant:
    """A system at any instant, block by block where python-control reports a loop.

    Raises
    ------
    Diverged
        When an output of a block is not finite although what it reads is.
    AlgebraicLoop
        For a loop that cannot be solved.
    """

    def __init__(self, system: Any) -> None:
        self.system, self._loops = system, {}

    def rates(self, t: float, x: np.ndarray, u: np.ndarray) -> np.ndarray:
        try:
            return self.system._rhs(t, x, u)
        except RuntimeError:
            return self._probed(Probe.rates, t, x, u)

    def outputs(self, t: float, x: np.ndarray, u: np.ndarray) -> np.ndarray:
        try:
            return self.system._out(t, x, u)
        except RuntimeError:
            return self._probed(Probe.outputs, t, x, u)

    def _probed(self, what: Any, t: float, x: np.ndarray, u: np.ndarray) -> np.ndarray:
        probe = Probe(t, loops=self._loops)
        values = what(probe, self.system, x, u)
        if probe.culprit:
            raise Diverged(f"{self.system.name}: {probe.culprit} at t = {t:.6g} s.")
        return values


def _times(matrix: Any, values: np.ndarray) -> np.ndarray:
    """The product, with 0 times nan = 0."""
    rows = np.atleast_2d(np.asarray(matrix, dtype=float))
    return np.array([row[row != 0] @ values[row != 0] for row in rows], dtype=float)


def _parts(system: Any, x: np.ndarray, u: np.ndarray) -> list[tuple[Any, Any, Any]]:
    states = np.cumsum([b.nstates for b in system.syslist])[:-1]
    entries = np.cumsum([b.ninputs for b in system.syslist])[:-1]
    return list(zip(system.syslist, np.split(x, states), np.split(u, entries), strict=True))
