"""Compiled systems as plain data, for threads, other processes and other machines."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ...core.errors import InputError
from ..codegen.adaptive_step import adaptive_code
from ..codegen.outputs import output_code
from .adaptive_run import Adaptive
from .backend import compiler, kind_of, load, load_steps


@dataclass(frozen=True)
class Portable:
    """The generated code of an adaptive run, with its labels; always picklable.

    Functions of a user may not pickle, and expression graphs are deep. A worker needs only the
    code: it compiles it, or loads its machine code from the cache on disk.
    """

    name: str
    states: tuple[str, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    backend: str
    run_code: str
    output_code: str

    @classmethod
    def of(cls, engine: Adaptive, outputs: Sequence[str] | None = None) -> Portable:
        """The code of a compiled system; ``outputs``: only these are computed."""
        program = engine.program
        wanted = tuple(program.outputs if outputs is None else outputs)
        unknown = [name for name in wanted if name not in program.outputs]
        if unknown:
            has = ", ".join(program.outputs) or "none"
            raise InputError(f"{program.name} has no output '{unknown[0]}'; it has {has}.")
        y = tuple(program.y[program.outputs.index(name)] for name in wanted)
        return cls(
            program.name,
            program.states,
            program.inputs,
            wanted,
            engine.backend,
            adaptive_code(program, kind_of(engine.backend)),
            output_code(replace(program, outputs=wanted, y=y)),
        )

    def loaded(self) -> Loaded:
        """The run, ready to use; fast after the first call."""
        return Loaded(self)


class Loaded(Adaptive):
    """An adaptive run from its code; the GIL is released while compiled code runs.

    A worker compiles with what it has, which may be another compiler.
    """

    def __init__(self, portable: Portable) -> None:
        self.program: Any = portable  # runs read only a program's name and labels
        alike = portable.backend == "python"
        self.backend = portable.backend if alike else compiler() or portable.backend
        self._run = load_steps(portable.run_code, self.backend).run
        self._outputs = load(portable.output_code, "numpy").outputs

    def response(
        self, t: np.ndarray, u: np.ndarray, x0: np.ndarray, p: np.ndarray, hold: bool, rtol: float
    ) -> tuple[np.ndarray, np.ndarray, float]:
        """States (n, N), outputs (ny, N), and when a relay did not come to rest (nan: never).

        Raises ``Diverged`` as ``Adaptive.run`` does.
        """
        states, unsettled = np.empty((0, len(t))), np.nan
        if len(x0) and len(t) > 1:
            run = self.run(t, u, x0, p, hold=hold, rtol=rtol)
            states, unsettled = run.states, run.unsettled
        elif len(x0):
            states = x0[:, None]
        return states, self.outputs(t, states, u, p), unsettled
