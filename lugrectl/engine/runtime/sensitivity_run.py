"""Derivatives of fixed-step runs with respect to parameters, from the graph."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ...core.errors import InputError
from ..codegen.sensitivity import tangent_code
from .backend import load
from .batch_run import Lanes, Rounding

Moved = Mapping[tuple[str, str], np.ndarray]


@dataclass(frozen=True, eq=False)
class Slopes:
    """A run and its derivatives.

    ``y`` (L, length, ny) and ``dy`` (L, length, ny, q): outputs before the correction; ``x``
    (L, n) and ``dx`` (L, n, q): states after the last interval.
    """

    y: np.ndarray
    dy: np.ndarray
    x: np.ndarray
    dx: np.ndarray


class Tangent:
    """Runs as those of :meth:`Lanes.run`, with derivatives by parameters.

    S = dx/dp obeys dS/dt = A S + B with A = df/dx, B = df/dp along the run, and becomes
    S - K dy/dp when the state is corrected. A and B are exact derivatives at the mean state of
    each step of the run, and held over the step; S is propagated by an L-stable rational
    approximant of the exponential.

    Parameters
    ----------
    lanes : Lanes
        The system and the backend; with "numpy" the loop is interpreted, which is slow.

    Notes
    -----
    The gain is assumed to be independent of the parameters. If static friction holds the drive,
    the derivatives are only as accurate as the run (``rtol``): a coarse run has other reversals.
    """

    def __init__(self, lanes: Lanes) -> None:
        self.lanes = lanes
        text, inside, outside = tangent_code(lanes.program)
        self._entries = (inside.rows, inside.by, outside.rows, outside.by)
        kind = lanes.backend if lanes.compiled else "python"
        self._run: Callable[..., None] = load(text, kind).run

    def run(
        self,
        x0: np.ndarray,
        start: np.ndarray,
        length: int,
        u: np.ndarray,
        p: np.ndarray,
        wrt: Sequence[str] | None = None,
        *,
        dt: float,
        substeps: int = 2,
        t0: float | np.ndarray = 0.0,
        series: np.ndarray | None = None,
        y: np.ndarray | None = None,
        seen: np.ndarray | None = None,
        gain: np.ndarray | None = None,
        rounding: Rounding | None = None,
        rtol: float = 1e-6,
        floor: np.ndarray | float = 0.0,
        dx0: np.ndarray | None = None,
        du: Moved | None = None,
        dseen: np.ndarray | None = None,
    ) -> Slopes:
        """Run L lanes with their derivatives; arguments as in :meth:`Lanes.run`, and:

        Parameters
        ----------
        wrt : sequence of str or None
            Names of the columns: parameters of the system (None: all), or any other name of a
            quantity on which only inputs, the start or the measurement depend.
        dx0 : (L, n, q)
            Derivative of the start.
        du : mapping
            By (input, column of ``wrt``): the derivative (S, N) of that input.
        dseen : (L, length, ny, q)
            Derivative of the measured outputs.

        Raises
        ------
        InputError
            When ``du`` names an unknown input or column, or as :meth:`Lanes.run`.
        """
        columns, moved = tuple(self.lanes.parameters if wrt is None else wrt), dict(du or {})
        given = self.lanes.arguments(
            x0, start, length, u, p, dt=dt, substeps=substeps, t0=t0, series=series, y=y, seen=seen,
            gain=gain, rounding=rounding, per_substep=False, rtol=rtol, floor=floor,
        )  # fmt: skip
        (many, n), ny, q = given[0].shape, len(self.lanes.outputs), len(columns)
        y_hat, x, dx = np.empty((many, length, ny)), np.empty((many, n)), np.zeros((many, n, q))
        dy = np.empty((*y_hat.shape, q))
        dx[:] = 0.0 if dx0 is None else dx0
        dy_seen = np.empty((0, 0, 0, 0))
        if dseen is not None:
            dy_seen = np.array(np.broadcast_to(dseen, dy.shape), dtype=float)
        places = self._places(columns, list(moved))
        push = np.zeros((*given[3].shape[:2], len(moved)))
        for i, series_slope in enumerate(moved.values()):
            push[..., i] = series_slope
        arguments = (*given, *self._entries, *places, push, dy_seen, y_hat, dy, x, dx)
        self.lanes.spread(self._run, arguments, many, many * length * substeps)
        return Slopes(y_hat, dy, x, dx)

    def _places(
        self, columns: Sequence[str], moved: Sequence[tuple[str, str]]
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """For parameters, then inputs: edges of their entries in two lists, the columns to which
        they contribute, and the series that multiplies the contribution (-1: none)."""
        for name, column in moved:
            if name not in self.lanes.inputs or column not in columns:
                raise InputError(
                    f"du names ('{name}', '{column}'); the inputs are "
                    f"{', '.join(self.lanes.inputs)}, the columns {', '.join(columns)}."
                )
        found = [[(columns.index(k), -1)] if k in columns else [] for k in self.lanes.parameters]
        for name in self.lanes.inputs:
            own = [(i, column) for i, (k, column) in enumerate(moved) if k == name]
            found.append([(columns.index(column), i) for i, column in own])
        edges = np.cumsum([0, *map(len, found)]).astype(np.int64)
        flat = np.array([one for some in found for one in some], dtype=np.int64)
        target, source = flat.reshape(-1, 2).T.copy()
        return edges, target, source
