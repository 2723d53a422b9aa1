"""Derivatives of fixed-step runs with respect to parameters, from the graph."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..errors import InputError
from .derivative import derivatives
from .lanes import Lanes
from .switching import average_jumps
from .tangent_code import (
    PARTS,
    Levels,
    Linear,
    Matrix,
    Pieces,
    mean_offset,
    recursion,
    slopes,
    vector,
)

DEEPEST = 3  # times that this is repeated
CHANGE = 0.02  # part of a piece's change of state that A may fail to explain
USUAL = 0.1  # how much of the lane's usual change of state counts beside that
STEEPEST = 1.0  # growth of a state over a piece, in powers of e
FORGOTTEN = -30.0  # the same of a state whose end says nothing of its beginning

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


@dataclass(frozen=True, eq=False)
class _Record:
    """What a run was given: u (S, N, m), p (L, q), indices for each lane."""

    u: np.ndarray
    p: np.ndarray
    start: np.ndarray
    series: np.ndarray
    t0: np.ndarray
    dt: float
    length: int
    rtol: float

    def place(self, lane: np.ndarray, row: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return self.series[lane], self.start[lane] + row

    def values(self, lane: np.ndarray) -> np.ndarray:
        """Parameters (q, points), or (q,) where all lanes have the same."""
        return self.p[0] if np.all(self.p == self.p[0]) else self.p.T[:, lane]


class Tangent:
    """Runs as :meth:`Lanes.run` makes them, with derivatives by parameters.

    S = dx/dp obeys dS/dt = A S + B with A = df/dx, B = df/dp along the run, and becomes
    S - K dy/dp where the state is corrected. A and B are exact and worked out for all substeps
    at once, at the mean state of each; over a substep they are held, and S is propagated by an
    L-stable rational approximant of the exponential. Where the run does not bear that out
    (speed passing through zero under static friction) it is made again in shorter pieces.

    Parameters
    ----------
    lanes : Lanes
        Its outputs must hold every state.
    outputs : sequence of str
        The outputs wanted, in order.
    wrt : sequence of str or None
        Names of the columns: parameters of the system (None: all), or any other name, for what
        only inputs, the start or the measurement depend on.

    Raises
    ------
    InputError
        When a state is not among the outputs of ``lanes``, or an output is unknown.

    Notes
    -----
    The gain counts as independent of the parameters. What acts only close to rest (vs, Fs) can
    be off by several per cent of its largest derivative in a run without correction, where it
    is felt in a few substeps only. Under static friction a run that is hardly resolved
    (``rtol``) has other reversals, and other derivatives.
    """

    def __init__(
        self, lanes: Lanes, outputs: Sequence[str], wrt: Sequence[str] | None = None
    ) -> None:
        self.lanes, self.program, program = lanes, lanes.program, lanes.program
        self.outputs = tuple(outputs)
        self.wrt = tuple(lanes.parameters if wrt is None else wrt)
        put_out = [node.index for node in program.y]
        states = zip(program.states, program.x, strict=True)
        missing = [name for name, x in states if x.index not in put_out]
        missing += [name for name in outputs if name not in program.outputs]
        if missing:
            raise InputError(f"{program.name}: '{missing[0]}' must be among the lanes' outputs.")
        self._states = [put_out.index(x.index) for x in program.x]
        self._shown = [program.outputs.index(name) for name in outputs]
        self._own = [name for name in self.wrt if name in program.parameters]
        self._rates = average_jumps(program.xdot, {node.value for node in program.p})
        self._f = vector(program, self._rates)
        self._A = slopes(program, self._rates, ())
        own = zip(self._rates, program.x, strict=True)
        self._decay = vector(program, [derivatives([f], x)[0] for f, x in own])
        self._known: dict[tuple[str, ...], tuple[Matrix, Matrix]] = {}

    @np.errstate(all="ignore")  # a lane may blow up
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
        series: np.ndarray | int = 0,
        y: np.ndarray | None = None,
        seen: np.ndarray | int = 0,
        gain: np.ndarray | None = None,
        rtol: float = 1e-6,
        dx0: np.ndarray | None = None,
        du: Moved | None = None,
        dseen: np.ndarray | None = None,
    ) -> Slopes:
        """Run L lanes with their derivatives; arguments as in :meth:`Lanes.run`, and:

        Parameters
        ----------
        y, gain : arrays
            With columns for ``outputs`` only.
        dx0 : (L, n, q)
            Derivative of the start.
        du : mapping
            By (input, column of ``wrt``): the derivative (S, N) of that input.
        dseen : (L, length, ny, q)
            Derivative of what is measured.

        Raises
        ------
        InputError
            When ``du`` names an unknown input or column, or as :meth:`Lanes.run`.
        """
        x0 = np.atleast_2d(np.asarray(x0, dtype=float))
        u, p = np.asarray(u, dtype=float), np.atleast_2d(np.asarray(p, dtype=float))
        many, moved = len(x0), dict(du or {})
        start, series, seen, clock = (np.broadcast_to(v, many) for v in (start, series, seen, t0))
        record = _Record(u if u.ndim == 3 else u[None], p, start, series, clock, dt, length, rtol)
        y = None if y is None or gain is None else np.asarray(y, dtype=float)
        y = y[None] if y is not None and y.ndim == 2 else y
        self._check(moved)
        every, x_end = self._finely(record, x0, substeps, y, seen, gain)
        samples = every[:, ::substeps]
        predicted = samples[..., self._shown]
        x = np.moveaxis(every[..., self._states], -1, 0).copy()  # (n, L, substeps)
        end = np.concatenate([x[..., 1:], x_end.T[..., None]], axis=-1)
        K = np.zeros((many, len(x), len(self._shown)))
        missed = np.full(predicted.shape, np.nan)
        if y is not None:
            K[:] = gain
            missed = y[seen[:, None], start[:, None] + np.arange(length)] - predicted
            x[..., ::substeps] += np.einsum("lio,lko->ilk", K, np.nan_to_num(missed))
        levels = self._pieces(record, x, end, moved)
        shown = self._outputs_along(record, np.moveaxis(samples[..., self._states], -1, 0), moved)
        S = np.zeros((many, len(x), len(self.wrt)))
        S[:] = 0.0 if dx0 is None else dx0
        dy = np.zeros((*predicted.shape, len(self.wrt)))
        order = levels.order()
        recursion(
            self.lanes.backend,
            np.searchsorted(levels.all("lane")[order], np.arange(many + 1)),
            order,
            np.where(levels.all("after") == 0.0, levels.all("row"), -1),
            levels.all("h"),
            self._linear(0, levels.all("slopes"), moved),
            shown,
            K,
            np.isfinite(missed),
            np.empty((0, 0, 0, 0)) if dseen is None else np.asarray(dseen, dtype=float),
            S,
            dy,
        )
        return Slopes(predicted, dy, x_end, S)

    def _check(self, moved: Moved) -> None:
        for name, column in moved:
            if name not in self.program.inputs or column not in self.wrt:
                raise InputError(
                    f"du names ('{name}', '{column}'); the inputs are "
                    f"{', '.join(self.program.inputs)}, the columns {', '.join(self.wrt)}."
                )

    def _finely(
        self,
        record: _Record,
        x0: np.ndarray,
        substeps: int,
        y: np.ndarray | None,
        seen: np.ndarray,
        gain: Any,
    ) -> tuple[np.ndarray, np.ndarray]:
        """The run with each substep as a sample."""
        measured: dict[str, Any] = {}
        if y is not None:
            whole = np.full((len(y), y.shape[1] * substeps, len(self.program.y)), np.nan)
            whole[:, ::substeps, self._shown] = y
            K = np.zeros((*np.shape(gain)[:-1], len(self.program.y)))
            K[..., self._shown] = gain
            measured = {"y": whole, "gain": K, "seen": seen}
        return self.lanes.run(
            x0,
            record.start * substeps,
            record.length * substeps,
            np.repeat(record.u, substeps, axis=1),
            record.p,
            dt=record.dt / substeps,
            substeps=1,
            t0=record.t0,
            series=record.series,
            rtol=record.rtol,
            **measured,
        )

    def _pieces(self, record: _Record, x: np.ndarray, end: np.ndarray, moved: Moved) -> Levels:
        """All substeps, cut until A and B describe the run; x and end (n, L, substeps)."""
        n, many, count = x.shape
        substeps = count // record.length
        lane, place = np.repeat(np.arange(many), count), np.tile(np.arange(count), many)
        row, part = np.divmod(place, substeps)
        after, h = part / substeps, np.full(len(lane), record.dt / substeps)
        made = self._described(record, lane, row, after, h, x, end, moved)
        usual = np.mean(np.abs(end - x), axis=-1) * substeps / record.dt
        levels = Levels([made], [])
        for _ in range(DEEPEST):
            coarse = self._coarse(made, usual)
            if not np.any(coarse):
                break
            made = self._cut(record, made[coarse], moved)
            levels.pieces.append(made)
            levels.cut.append(coarse)
        return levels

    def _described(
        self,
        record: _Record,
        lane: np.ndarray,
        row: np.ndarray,
        after: np.ndarray,
        h: np.ndarray,
        x: np.ndarray,
        end: np.ndarray,
        moved: Moved,
    ) -> Pieces:
        """Pieces with A and B in the middle between their ends."""
        x, end = x.reshape(len(x), -1), end.reshape(len(x), -1)
        where = record.place(lane, row)
        t = record.t0[lane] + (where[1] + after) * record.dt
        u, p = np.ascontiguousarray(record.u[where].T), record.values(lane)
        clock, linear = (t + 0.5 * h, t, h), 0.5 * (x + end)
        bend = self._f.at(*clock, end, u, p) - self._f.at(*clock, x, u, p)
        A = Linear(self._A.rows, self._A.columns, self._A.inner, self._A.at(*clock, linear, u, p))
        mean = linear + mean_offset(self.lanes.backend, h, A, h * bend)
        forgets = h * self._decay.at(*clock, end, u, p) < FORGOTTEN
        mean = np.where(forgets, end, mean)
        values = self._matrices(moved)[0].at(*clock, mean, u, p)
        entries = self._spread(0, values, moved, where)
        missed = self._f.at(*clock, mean, u, p) - (end - x) / h
        bend, missed = np.where(forgets, np.nan, bend), np.where(forgets, 0.0, np.abs(missed))
        return Pieces(lane, row, after, t, h, x, end, u, bend, missed, entries)

    def _coarse(self, pieces: Pieces, usual: np.ndarray) -> np.ndarray:
        """Over which pieces A does not explain how the rates change, or grows too much."""
        change, gap, A = pieces.end - pieces.x, pieces.bend.copy(), self._A
        steep = np.zeros(len(pieces.lane), dtype=bool)
        for i, j, value in zip(A.rows, A.columns, pieces.slopes, strict=False):
            gap[i] -= value * change[j]
            if i == j:
                steep |= value * pieces.h > STEEPEST
        allowed = CHANGE * (np.abs(change) / pieces.h + USUAL * usual[:, pieces.lane])
        unlike = (np.abs(gap) > allowed) | (pieces.missed > allowed)  # nan: forgotten, no gap
        return steep | np.any(unlike, axis=0)

    def _cut(self, record: _Record, pieces: Pieces, moved: Moved) -> Pieces:
        """Each of them run again as shorter ones."""
        many, h = len(pieces.lane), float(pieces.h[0]) / PARTS
        y, last = self.lanes.run(
            pieces.x.T,
            np.zeros(many, dtype=int),
            PARTS,
            np.repeat(pieces.u.T[:, None], PARTS, axis=1),
            record.p[pieces.lane],
            dt=h,
            substeps=1,
            t0=pieces.t,
            series=np.arange(many),
            rtol=record.rtol,
        )
        x = np.moveaxis(y[..., self._states], -1, 0)
        end = np.concatenate([x[..., 1:], last.T[..., None]], axis=-1)
        lane, row, after = (np.repeat(a, PARTS) for a in (pieces.lane, pieces.row, pieces.after))
        after = after + np.tile(np.arange(PARTS), many) * (h / record.dt)
        return self._described(record, lane, row, after, np.full(len(lane), h), x, end, moved)

    def _outputs_along(self, record: _Record, x: np.ndarray, moved: Moved) -> Linear:
        """Derivatives of the outputs by states and columns at all samples; x (n, L, length)."""
        lane, row = (a.ravel() for a in np.indices(x.shape[1:]))
        where = record.place(lane, row)
        t, u = record.t0[lane] + where[1] * record.dt, np.ascontiguousarray(record.u[where].T)
        x, h = np.ascontiguousarray(x).reshape(len(x), -1), np.zeros(len(lane))
        values = self._matrices(moved)[1].at(t, t, h, x, u, record.values(lane))
        return self._linear(1, self._spread(1, values, moved, where), moved)

    def _matrices(self, moved: Moved) -> tuple[Matrix, Matrix]:
        """Derivatives of rates and of outputs by states, parameters and moved inputs."""
        program, inputs = self.program, _inputs(moved)
        if inputs not in self._known:
            by = [program.p[program.parameters.index(n)] for n in self._own]
            by += [program.u[program.inputs.index(n)] for n in inputs]
            shown = [program.y[i] for i in self._shown]
            self._known[inputs] = slopes(program, self._rates, by), slopes(program, shown, by)
        return self._known[inputs]

    def _places(self, which: int, moved: Moved) -> list[tuple[int, int, int, Any]]:
        """Entry, its row, its column, and the derivative that it is multiplied by (or None)."""
        matrix, n, own = self._matrices(moved)[which], len(self._states), self._own
        made: list[tuple[int, int, int, Any]] = []
        for e, (i, j) in enumerate(zip(matrix.rows, matrix.columns, strict=True)):
            if j < n:
                made.append((e, i, j, None))
            elif j < n + len(own):
                made.append((e, i, n + self.wrt.index(own[j - n]), None))
            else:
                name = _inputs(moved)[j - n - len(own)]
                keys = [key for key in moved if key[0] == name]
                made += [(e, i, n + self.wrt.index(key[1]), key) for key in keys]
        return made

    def _spread(
        self,
        which: int,
        values: np.ndarray,
        moved: Moved,
        where: tuple[np.ndarray, np.ndarray],
    ) -> np.ndarray:
        """The entries for the columns, one for each moved input and column."""
        if not moved:
            return values
        known = {key: np.atleast_2d(series)[where] for key, series in moved.items()}
        rows = [(values[e], key) for e, _, _, key in self._places(which, moved)]
        return np.array([v if key is None else v * known[key] for v, key in rows])

    def _linear(self, which: int, values: np.ndarray, moved: Moved) -> Linear:
        places = np.array([p[1:3] for p in self._places(which, moved)], dtype=np.int64)
        rows, columns = places.reshape(-1, 2).T.copy()
        return Linear(rows, columns, int(np.sum(columns < len(self._states))), values)


def _inputs(moved: Moved) -> tuple[str, ...]:
    return tuple(sorted({name for name, _ in moved}))
