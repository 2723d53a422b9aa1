"""Many fixed-step runs of one system along one record."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from ...core.bare_system import BareSystem
from ...core.errors import InputError
from ..codegen.fixed_step import array_code, is_wide, lane_code
from ..expression.numpy_protocol import WIDTH
from ..tracing.tracer import trace
from .adaptive_run import chosen_outputs
from .backend import compiler, each_beside, has_wide, load, threads

if TYPE_CHECKING:
    import control as ct

Rounding = tuple[np.ndarray, np.ndarray]

MANY = 20_000  # substeps: fewer are not worth a thread
LEAST_WIDE = 4  # from this many lanes on a block is faster than one lane after another


class Lanes:
    """Many fixed-step runs (lanes) of one traced system along one record.

    The system, a block or an interconnection in continuous time, is traced once, as it is now;
    TraceError where that cannot be. tanh(x/p) of a state x is sign(x) where the default of p only
    smooths it. ``backend`` is "c", "numba", "numpy", or None: the first one available; "c"
    computes several lanes at once if compiler, processor and library support it. ``outputs`` are
    the requested ones in order, None for all; ``defaults`` the values of ``parameters``.
    """

    def __init__(
        self,
        system: ct.NonlinearIOSystem | BareSystem,
        *,
        backend: str | None = None,
        outputs: Sequence[str] | None = None,
    ) -> None:
        self.backend = backend or compiler() or "numpy"
        program = chosen_outputs(trace(system), outputs)
        self.program = program.sharpened(of=program.x)
        self.states, self.inputs = self.program.states, self.program.inputs
        self.outputs, self.parameters = self.program.outputs, self.program.parameters
        self.defaults = self.program.defaults.copy()
        plain = self.backend == "numpy"
        text = array_code(self.program) if plain else lane_code(self.program, "scalar", 1)
        self._run: Callable[..., None] = load(text, self.backend).run

    @cached_property
    def _wide(self) -> Callable[..., None] | None:
        """The loop over blocks of lanes, if available."""
        if self.backend != "c" or not has_wide() or not is_wide(self.program):
            return None
        return load(lane_code(self.program, "wide", WIDTH), "wide").run

    def run(
        self,
        x0: np.ndarray,
        start: np.ndarray,
        length: int,
        u: np.ndarray,
        p: np.ndarray,
        *,
        dt: float,
        substeps: int = 2,
        t0: float | np.ndarray = 0.0,
        series: np.ndarray | None = None,
        y: np.ndarray | None = None,
        gain: np.ndarray | None = None,
        rounding: Rounding | None = None,
        rtol: float = 1e-4,
        floor: np.ndarray | float = 0.0,
    ) -> tuple[np.ndarray, np.ndarray]:
        """Run L lanes over ``length`` samples each; sample k of the record is at t0 + k dt,
        where each lane may have its own t0, (L,).

        At each sample the output is stored, then the state corrected by
        ``gain @ (y - output)`` if ``y`` is given, then integrated over dt in ``substeps``
        equal steps (or more, see ``rtol``) with the input held. A lane that diverges ends in
        inf or nan.

        ``x0`` (L, n) are the states at the start, ``start`` (L,) the samples at which the lanes
        begin, ``p`` (L, q) their parameters. ``u`` (N, m) or (S, N, m) are inputs, held over each
        sample interval; ``series`` (L,) says which of S a lane uses. ``y`` (N, ny) are measured
        outputs (nan: no correction by that output at that sample), ``gain`` is (n, ny) or
        (L, n, ny). ``rounding`` (N, ny) and (ny,) are the part of a correction to leave out, and
        the size of ``y - output`` up to which it is left out: samples that repeat one rounded
        value count as one. A substep whose estimated error exceeds ``rtol`` of the largest value
        that the state has had in the lane, at least ``floor``, is divided (a crossing of zero
        speed under static friction); inf: never.

        Returns outputs before the correction (L, length, ny) and states after the last interval
        (L, n). InputError when the shapes do not fit together or a lane leaves the record.

        L-stable Rosenbrock steps of order 4. A step ends where a state reaches zero whose own
        rate contains its sign (see :mod:`.codegen.fixed_step`); other kinks are not located. A
        condition on time is weighted by its share of the step. At the default rtol a result, as a
        function of the parameters, has noise of about 1e-7 of its range: finite differences need
        much larger steps.
        """
        x0, p = _plain(np.atleast_2d(x0)), _plain(np.atleast_2d(p))
        u, n, ny = np.asarray(u, dtype=float), len(self.states), len(self.outputs)
        u = _plain(u if u.ndim == 3 else u[None])
        tables = ("x0", x0, self.states), ("p", p, self.parameters), ("u", u, self.inputs)
        for label, rows, names in tables:
            if rows.ndim != 2 + (rows is u) or rows.shape[-1] != len(names):
                raise InputError(f"{label} needs the columns {', '.join(names)}, not {rows.shape}.")
        count, samples = len(x0), u.shape[1]
        if len(p) != count:
            raise InputError(f"p has {len(p)} rows for {count} lanes.")
        start = _indices(start, count, samples - length, "start")
        series = _indices(series, count, len(u) - 1, "series")
        y, gain = self._correction(y, gain, count, samples)
        dull, half = (np.empty((0, ny)), np.zeros(ny)) if rounding is None else rounding
        y_hat, x_end = np.empty((count, length, ny)), np.empty((count, n))
        given = (x0, start, int(length), u, series, p, y, gain, gain.size > 0)
        steps = (float(dt), int(substeps), float(rtol), _repeated(floor, n))
        given = (*given, _plain(dull), _plain(half), _repeated(t0, count), *steps, y_hat, x_end)
        wide = self._wide if count >= LEAST_WIDE and length else None
        large = self.backend != "numpy" and count * length * substeps > MANY
        loop, block = wide or self._run, WIDTH if wide else 1
        # in one call, or in whole blocks on threads: compiled code releases the GIL
        blocks = -(-count // block)
        parts = 4 * threads() if large and min(threads(), blocks) > 1 else 1
        edges = block * np.linspace(0, blocks, min(blocks, parts) + 1).astype(int)
        edges = np.minimum(edges, count).tolist()
        with np.errstate(all="ignore"):
            for _ in each_beside(lambda k: loop(*given, *edges[k : k + 2]), range(len(edges) - 1)):
                pass
        return y_hat, x_end

    def _correction(
        self, y: np.ndarray | None, gain: np.ndarray | None, count: int, samples: int
    ) -> tuple[np.ndarray, np.ndarray]:
        n, ny = len(self.states), len(self.outputs)
        if y is None or gain is None:
            return np.empty((0, ny)), np.empty((0, n, ny))
        y, gain = _plain(y), np.asarray(gain, dtype=float)
        if y.shape != (samples, ny) or gain.shape not in ((n, ny), (count, n, ny)):
            raise InputError(
                f"y must be ({samples}, {ny}) and gain ({n}, {ny}) or ({count}, {n}, {ny}); "
                f"they are {y.shape} and {gain.shape}."
            )
        return y, _plain(np.broadcast_to(gain, (count, n, ny)))


def _plain(values: np.ndarray, kind: type = float) -> np.ndarray:
    """The array in a fixed memory layout, so that only one version is compiled."""
    return np.require(values, kind, ["C", "W"])


def _repeated(values: np.ndarray | float, count: int) -> np.ndarray:
    return _plain(np.broadcast_to(np.asarray(values, dtype=float), (count,)))


def _indices(values: Any, count: int, highest: int, label: str) -> np.ndarray:
    given = np.asarray(0 if values is None else values)
    whole = _plain(np.broadcast_to(given, (count,)), np.int64)
    if np.any(whole < 0) or np.any(whole > highest):
        raise InputError(f"{label} must be between 0 and {highest}: else a lane leaves the record.")
    return whole
