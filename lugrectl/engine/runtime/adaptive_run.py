"""One run of a traced system with error control and located events."""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass

import numpy as np

from ...core.errors import Diverged
from ..codegen.adaptive_step import adaptive_code
from ..codegen.outputs import output_code
from ..tracing.equations import Program
from .backend import compiler, kind_of, load, load_steps


@dataclass(frozen=True)
class Run:
    """States (n, N) at the grid points, the number of trial steps, and the last time at which
    the error test was given up because a relay did not come to rest (nan: never)."""

    states: np.ndarray
    steps: int
    unsettled: float


def floor_of(rtol: float, atol: float | None) -> float:
    """The value of a state below which its error is absolute."""
    return 1e-9 if atol is None else float(atol) / float(rtol)


def chosen_backend() -> str:
    """What runs a single system here: "c" or "numba" where there is one, else "python"."""
    return compiler() or "python"


class Adaptive:
    """Compiled adaptive run and outputs of a program.

    Parameters
    ----------
    program : Program
        A traced system.
    backend : str or None
        "c", "numba", "python", or None: the first one available.
    """

    def __init__(self, program: Program, backend: str | None = None) -> None:
        self.program = program
        self.backend = backend or chosen_backend()
        self._run = load_steps(adaptive_code(program, kind_of(self.backend)), self.backend).run
        self._outputs = load(output_code(program), "numpy").outputs

    def of(self, program: Program) -> Adaptive:
        """The same code for a program of the same outline, which may have other defaults."""
        made = copy(self)
        made.program = program
        return made

    def run(
        self,
        t: np.ndarray,
        u: np.ndarray,
        x0: np.ndarray,
        p: np.ndarray,
        *,
        hold: bool,
        rtol: float,
        atol: float | None = None,
        sizes: np.ndarray | None = None,
    ) -> Run:
        """States at the times t (N,) for inputs u (m, N), held or linear between them.

        The error of each step is at most ``rtol``: the states' errors, each divided by the
        state's size, as the root of the sum of their squares. The size is the largest value of
        the last swing, which is forgotten in about the time in which the state fell (at least
        ``atol / rtol``, default 1e-9, and 1e-7 of its largest value so far). ``sizes`` (3 n,)
        carries the sizes from one part of a run to the next: zeros before the first.

        Raises
        ------
        Diverged
            Names the state and the time.
        """
        shape = (len(self.program.states), len(t))
        status = np.append([0.0, 0.0, 0.0, np.nan, 0.0], [] if sizes is None else sizes)
        arguments = [np.require(a, float, ["C", "W"]) for a in (t, u, x0, p)]
        grid, inputs, start, values = arguments
        accuracy = float(rtol), floor_of(rtol, atol)
        if self.backend != "python":
            states = np.empty(shape)
            good = self._run(grid, inputs, bool(hold), start, values, *accuracy, states, status)
        else:
            grid, inputs, start, values = (a.tolist() for a in arguments)
            lists = [[0.0] * shape[1] for _ in range(shape[0])]
            good = self._run(grid, inputs, bool(hold), start, values, *accuracy, lists, status)
            states = np.array(lists).reshape(shape)
        if not good:
            label = self.program.states[int(status[2])]
            raise Diverged(
                f"{self.program.name}: state {label} grows without bound, is not a number, or "
                f"changes faster than steps can follow, at t = {status[1]:.6g} s."
            )
        if sizes is not None:
            sizes[:] = status[5:]
        return Run(states, int(status[4]), float(status[3]))

    def outputs(self, t: np.ndarray, x: np.ndarray, u: np.ndarray, p: np.ndarray) -> np.ndarray:
        """Outputs (ny, N) at the times t, all at once."""
        y = np.empty((len(self.program.outputs), len(t)))
        with np.errstate(all="ignore"):
            self._outputs(t, x, u, p, y)
        return y
