"""Many fixed-step runs of one system along one record."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from ..core.bare_system import BareSystem
from ..core.errors import InputError
from .backend import call, compiler, each_beside, has_wide, kind_of, laid_out, load, threads
from .fixed_step import is_wide, lane_code
from .graph import WIDTH
from .tracer import trace

if TYPE_CHECKING:
    import control as ct

MANY = 20_000  # substeps: fewer are not worth a thread
LEAST_WIDE = 4  # from this many lanes on a block is faster than one lane after another


class Lanes:
    """Many fixed-step runs (lanes) of one continuous system along one record.

    tanh(x/p) of a state x is sign(x) where the default of p only smooths it. ``backend`` is "c",
    which computes several lanes at once if it can, "numba", "python", or None: the first one there.
    """

    def __init__(
        self,
        system: ct.NonlinearIOSystem | BareSystem,
        *,
        backend: str | None = None,
        outputs: Sequence[str] | None = None,
    ) -> None:
        self.backend = backend or compiler() or "python"
        program = trace(system)
        outputs = program.outputs if outputs is None else tuple(outputs)
        if unknown := [name for name in outputs if name not in program.outputs]:
            has = ", ".join(program.outputs) or "none"
            raise InputError(f"{program.name} has no output '{unknown[0]}'; it has {has}.")
        y = tuple(program.y[program.outputs.index(name)] for name in outputs)
        program = replace(program, outputs=outputs, y=y)
        self.program = program.sharpened(of=program.x)
        self.states, self.inputs = self.program.states, self.program.inputs
        self.outputs, self.parameters = self.program.outputs, self.program.parameters
        self.defaults = self.program.defaults.copy()

    @cached_property
    def _single(self) -> Callable[..., Any]:
        """The loop over lanes, one after another."""
        return load(lane_code(self.program, kind_of(self.backend), 1), self.backend).run

    @cached_property
    def _wide(self) -> Callable[..., Any] | None:
        """The loop over blocks of lanes, if available."""
        if self.backend != "c" or not has_wide() or not is_wide(self.program):
            return None
        return load(lane_code(self.program, "wide", WIDTH), "wide").run

    def run(
        self,
        x0: np.ndarray,
        start: Any,
        length: int,
        u: np.ndarray,
        p: np.ndarray,
        *,
        dt: float,
        substeps: int = 2,
        t0: float | np.ndarray = 0.0,
        series: Any = 0,
        y: np.ndarray | None = None,
        gain: np.ndarray | None = None,
        rounding: tuple[np.ndarray, np.ndarray] | None = None,
        rtol: float = 1e-4,
        floor: np.ndarray | float = 0.0,
    ) -> tuple[np.ndarray, np.ndarray]:
        """Outputs (L, length, ny) of L lanes before the corrections, and their last states (L, n).

        A lane begins at the sample ``start`` of the inputs u (N, m), or of (S, N, m) those of its
        ``series``, with the states x0 (L, n) and the parameters p (L, q); sample k is at t0 + k dt.
        At each sample its state is corrected by ``gain @ (y - output)``, where y (N, ny) is given
        and not nan, then integrated over dt in ``substeps`` equal steps with the input held.
        ``rounding`` (N, ny) and (ny,) are the part of a correction to leave out, and the size up to
        which. A step with an error above ``rtol`` of the largest value of a state in the lane, at
        least ``floor``, is divided (inf: never). A lane that diverges ends in inf or nan.
        InputError where the shapes do not fit together or a lane leaves the record.
        """
        x0, p, u = (np.asarray(a, dtype=float) for a in (x0, p, u if np.ndim(u) == 3 else [u]))
        count, ny, wanted = len(x0), len(self.outputs), (self.states, self.parameters, self.inputs)
        if [x0.shape[1], p.shape[1], u.shape[2], len(p)] != [*map(len, wanted), count]:
            raise InputError("x0, p and u need a column for each state, parameter and input.")
        start, series, t0 = (np.broadcast_to(np.asarray(a), (count,)) for a in (start, series, t0))
        for first, most in ((start, u.shape[1] - length), (series, len(u) - 1)):
            if np.any(first < 0) or np.any(first > most):
                raise InputError("a lane leaves the record.")
        if y is None or gain is None:
            y, gain = np.empty((0, ny)), np.empty((0, len(self.states), ny))
        else:
            gain = np.broadcast_to(gain, (count, len(self.states), ny))
            if np.shape(y) != (u.shape[1], ny):
                raise InputError("y needs the samples of u, and a column for each output.")
        dull, half = (np.empty((0, ny)), np.zeros(ny)) if rounding is None else rounding
        floor = np.broadcast_to(np.asarray(floor, dtype=float), (len(self.states),))
        given = (x0, start, int(length), u, series, p, y, gain, gain.size > 0, dull, half)
        given = (*given, t0.astype(float), float(dt), int(substeps), float(rtol), floor)
        y_hat, x_end = np.empty((count, length, ny)), np.empty((count, len(self.states)))
        wide = self._wide if count >= LEAST_WIDE and length else None
        loop, block = wide or self._single, WIDTH if wide else 1
        # in one call, or in whole blocks on threads: compiled code releases the GIL
        blocks, large = -(-count // block), count * length * substeps > MANY
        large = large and self.backend != "python"
        parts = 4 * threads() if large and min(threads(), blocks) > 1 else 1
        edges = block * np.linspace(0, blocks, min(blocks, parts) + 1).astype(int)
        edges = np.minimum(edges, count).tolist()
        given = laid_out(given, self.backend)

        def part(ends: Any) -> None:
            call(loop, self.backend, (*given, *ends), [y_hat, x_end])

        with np.errstate(all="ignore"):
            for _ in each_beside(part, zip(edges, edges[1:], strict=False)):
                pass
        return y_hat, x_end
