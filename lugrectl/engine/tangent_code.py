"""Derivatives along a run: the Jacobians, the pieces they hold on, and their recursion."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields

import numpy as np

from .derivative import derivatives
from .emit import Emitter, indent
from .graph import Node
from .load import load
from .program import Program

_VALUES = """
def values(t, begin, h, x, u, p, out):
{code}
"""

# S <- R(Z) S + h phi(Z) B with Z = h A and the Pade approximants of exp(Z) and of
# (exp(Z) - I) / Z whose numerators have degree 2 and whose one denominator has degree 3:
# L-stable, of order 5 where A does not change. Sizes are arguments: compiled once for all.
RECURSION = """
import numpy as np


@fast
def run(first, order, sample, h, ab, rows, columns, inner, cd, c_rows, c_columns, gain, known,
        seen, S, dy):
    n, q, ny = S.shape[1], S.shape[2], dy.shape[2]
    Z, Z2, den, right = np.empty((n, n)), np.empty((n, n)), np.empty((n, n)), np.empty((n, q))
    for lane in range(len(first) - 1):
        s = S[lane]
        for turn in range(first[lane], first[lane + 1]):
            piece = order[turn]
            k = sample[piece]
            if k >= 0:
                out = dy[lane, k]
                observe(s, cd[:, lane * dy.shape[1] + k], c_rows, c_columns, n, out)
                for o in range(ny):
                    if known[lane, k, o]:
                        for i in range(n):
                            g = gain[lane, i, o]
                            for c in range(q):
                                s[i, c] -= g * out[o, c]
                                if len(seen):
                                    s[i, c] += g * seen[lane, k, o, c]
            step = h[piece]
            Z[:] = 0.0
            for e in range(inner):
                Z[rows[e], columns[e]] = step * ab[e, piece]
            for i in range(n):
                for j in range(n):
                    total = 0.0
                    for m in range(n):
                        total += Z[i, m] * Z[m, j]
                    Z2[i, j] = total
            for i in range(n):
                for j in range(n):
                    total = 0.0
                    for m in range(n):
                        total += Z[i, m] * Z2[m, j]
                    one = 1.0 if i == j else 0.0
                    den[i, j] = one - 0.6 * Z[i, j] + 0.15 * Z2[i, j] - total / 60.0
                for c in range(q):
                    right[i, c] = s[i, c]
                for m in range(n):
                    weight = 0.4 * Z[i, m] + 0.05 * Z2[i, m]
                    if weight != 0.0:
                        for c in range(q):
                            right[i, c] += weight * s[m, c]
            for e in range(inner, len(rows)):
                m, c, b = rows[e], columns[e] - n, step * ab[e, piece]
                right[m, c] += b
                for i in range(n):
                    right[i, c] += b * (Z2[i, m] / 60.0 - 0.1 * Z[i, m])
            solve(den, right)
            s[:] = right


@fast
def settle(h, a, rows, columns, bend):
    n, pieces = bend.shape
    Z, den, right = np.empty((n, n)), np.empty((n, n)), np.empty((n, 1))
    for piece in range(pieces):
        Z[:] = 0.0
        for e in range(len(a)):
            Z[rows[e], columns[e]] = h[piece] * a[e, piece]
        for i in range(n):
            right[i, 0] = bend[i, piece]
            for j in range(n):
                total = 0.0
                for m in range(n):
                    total += Z[i, m] * Z[m, j]
                one = 1.0 if i == j else 0.0
                den[i, j] = one - 0.1 * Z[i, j] + total / 60.0
                right[i, 0] -= 0.1 * Z[i, j] * bend[j, piece]
        solve(den, right)
        for i in range(n):
            bend[i, piece] = right[i, 0] / -12.0


@small
def observe(s, cd, rows, columns, n, out):
    q = s.shape[1]
    out[:] = 0.0
    for e in range(len(rows)):
        i, j, value = rows[e], columns[e], cd[e]
        if j >= n:
            out[i, j - n] += value
        else:
            for c in range(q):
                out[i, c] += value * s[j, c]


@small
def solve(a, b):
    n, q = b.shape
    for k in range(n):
        best = k
        for i in range(k + 1, n):
            if abs(a[i, k]) > abs(a[best, k]):
                best = i
        if best != k:
            for j in range(k, n):
                a[k, j], a[best, j] = a[best, j], a[k, j]
            for c in range(q):
                b[k, c], b[best, c] = b[best, c], b[k, c]
        pivot = 1.0 / a[k, k]
        for i in range(k + 1, n):
            factor = a[i, k] * pivot
            if factor != 0.0:
                for j in range(k + 1, n):
                    a[i, j] -= factor * a[k, j]
                for c in range(q):
                    b[i, c] -= factor * b[k, c]
    for i in range(n - 1, -1, -1):
        for j in range(i + 1, n):
            if a[i, j] != 0.0:
                for c in range(q):
                    b[i, c] -= a[i, j] * b[j, c]
        pivot = 1.0 / a[i, i]
        for c in range(q):
            b[i, c] *= pivot
"""

PARTS = 16  # pieces into which one is cut over which A and B change too much
_BLOCK = 4096  # points whose intermediate results fit into the processor's cache


@dataclass(frozen=True, eq=False)
class Matrix:
    """The entries of a matrix of expressions that are not zero, evaluated at many points.

    Columns are states, then other variables; the first ``inner`` entries are in the former.
    """

    rows: np.ndarray
    columns: np.ndarray
    inner: int
    values: Callable[..., None]

    def at(
        self,
        t: np.ndarray,
        begin: np.ndarray,
        h: np.ndarray,
        x: np.ndarray,
        u: np.ndarray,
        p: np.ndarray,
    ) -> np.ndarray:
        """Values (entries, points); t, begin, h (points,), x (n, points), u (m, points),
        p (q, points) or (q,)."""
        out = np.empty((len(self.rows), len(t)))
        with np.errstate(all="ignore"):
            for a in range(0, len(t), _BLOCK):
                s = slice(a, a + _BLOCK)
                own = p[:, s] if p.ndim == 2 else p
                self.values(t[s], begin[s], h[s], x[:, s], u[:, s], own, out[:, s])
        return out


def vector(program: Program, roots: Sequence[Node]) -> Matrix:
    """The roots themselves, as one column."""
    index = np.arange(len(roots))
    return Matrix(index, 0 * index, len(roots), _compiled(program, roots))


def slopes(program: Program, roots: Sequence[Node], variables: Sequence[Node]) -> Matrix:
    """d root / d variable; the states are the first variables."""
    nodes: list[Node] = []
    places: list[tuple[int, int]] = []
    for j, variable in enumerate([*program.x, *variables]):
        for i, slope in enumerate(derivatives(roots, variable)):
            if not slope.is_constant(0.0):
                nodes.append(slope)
                places.append((i, j))
    rows, columns = np.array(places, dtype=np.int64).reshape(-1, 2).T.copy()
    inner = int(np.sum(columns < len(program.x)))
    return Matrix(rows, columns, inner, _compiled(program, nodes))


def _compiled(program: Program, roots: Sequence[Node]) -> Callable[..., None]:
    unpack = []
    for letter, nodes in (("x", program.x), ("u", program.u), ("p", program.p)):
        unpack += [f"{node.value} = {letter}[{i}]" for i, node in enumerate(nodes)]
    emitter = Emitter("array", "v")
    store = [f"out[{i}] = {code}" for i, code in enumerate(emitter.write(roots))]
    code = indent([*unpack, *emitter.head, *emitter.body, *store], 1)
    return load(_VALUES.format(code=code), "numpy").values


@dataclass(frozen=True, eq=False)
class Pieces:
    """Stretches of time with held inputs; the last axis of each array has one place for each.

    ``row`` counts samples within the lane, ``after`` is where a piece begins as a part of the
    interval; ``x`` and ``end`` (n, P) are the states at both ends, ``bend`` how much the rates
    change, ``missed`` by how much those at the mean state fail to explain the motion (nan and 0
    for states that forget their beginning), ``slopes`` entries of A and B.
    """

    lane: np.ndarray
    row: np.ndarray
    after: np.ndarray
    t: np.ndarray
    h: np.ndarray
    x: np.ndarray
    end: np.ndarray
    u: np.ndarray
    bend: np.ndarray
    missed: np.ndarray
    slopes: np.ndarray

    def __getitem__(self, which: np.ndarray) -> Pieces:
        return Pieces(*(getattr(self, f.name)[..., which] for f in fields(self)))


@dataclass(frozen=True, eq=False)
class Levels:
    """Pieces, those that some of them were cut into, and so on; masks of which were cut."""

    pieces: list[Pieces]
    cut: list[np.ndarray]

    def order(self) -> np.ndarray:
        """Indices of the pieces that stand, lane by lane in the order of time."""
        sizes = [len(p.h) for p in self.pieces]
        offsets = np.cumsum([0, *sizes])
        order, count = offsets[-2] + np.arange(sizes[-1]), np.ones(sizes[-1], dtype=int)
        for cut, size, offset in reversed(list(zip(self.cut, sizes, offsets, strict=False))):
            more = np.ones(size, dtype=int)
            more[cut] = count.reshape(-1, PARTS).sum(axis=1)
            whole, old = offset + np.repeat(np.arange(size), more), np.repeat(cut, more)
            whole[old] = order
            order, count = whole, more
        return order

    def all(self, name: str) -> np.ndarray:
        arrays = [getattr(p, name) for p in self.pieces]
        return np.concatenate(arrays, axis=-1) if len(arrays) > 1 else arrays[0]


@dataclass(frozen=True, eq=False)
class Linear:
    """Entries of a matrix [states | columns of S] along a run; ``values`` (entries, points)."""

    rows: np.ndarray
    columns: np.ndarray
    inner: int
    values: np.ndarray

    def dense(self, height: int, width: int) -> np.ndarray:
        """(points, height, width)."""
        whole = np.zeros((self.values.shape[1], height, width))
        for i, j, value in zip(self.rows, self.columns, self.values, strict=True):
            whole[:, i, j] += value
        return whole


def mean_offset(backend: str, h: np.ndarray, A: Linear, bend: np.ndarray) -> np.ndarray:
    """Mean state over a piece less the mean of its ends, (n, P), for ``bend`` = h (f1 - f0).

    For constant A it is (1/z - coth(z/2) / 2) dx, z = h A, here the approximant of order 4
    -(z/12) (1 - z/10) / (1 - z/10 + z^2/60), right as well where z tends to -infinity: then
    the mean is the state at the end.
    """
    n = len(bend)
    with np.errstate(all="ignore"):
        if backend == "numba":
            offset = bend.copy()
            rows, columns = A.rows[: A.inner], A.columns[: A.inner]
            load(RECURSION, "numba").settle(h, A.values, rows, columns, offset)
            return offset
        Z = h[:, None, None] * A.dense(n, n)
        right = (np.eye(n) - 0.1 * Z) @ bend.T[..., None]
        den = np.eye(n) - 0.1 * Z + Z @ Z / 60.0
        return np.linalg.solve(den, right)[..., 0].T / -12.0


def recursion(
    backend: str,
    first: np.ndarray,
    order: np.ndarray,
    sample: np.ndarray,
    h: np.ndarray,
    along: Linear,
    shown: Linear,
    gain: np.ndarray,
    known: np.ndarray,
    seen: np.ndarray,
    S: np.ndarray,
    dy: np.ndarray,
) -> None:
    """S from the start to the end of each lane, and the outputs' derivatives on the way.

    Pieces ``order[first[lane]]`` to ``order[first[lane + 1] - 1]`` make up a lane; ``sample``
    is the sample that a piece begins, -1 inside an interval. Points of ``shown`` are the
    samples, lane by lane. ``seen`` may be empty.
    """
    with np.errstate(all="ignore"):
        if backend == "numba":
            a = (along.values, along.rows, along.columns, along.inner)
            c = (shown.values, shown.rows, shown.columns)
            load(RECURSION, "numba").run(first, order, sample, h, *a, *c, gain, known, seen, S, dy)
        else:
            _batched(order, sample, h, along, shown, gain, known, seen, S, dy)


def _batched(order, sample, h, along, shown, gain, known, seen, S, dy) -> None:
    """The same with NumPy: one map for each interval, then all lanes together."""
    lanes, length, ny, q = dy.shape
    n = S.shape[1]
    maps = _maps(h, along.dense(n, n + q), n)[order]
    opens = np.flatnonzero(sample[order] >= 0)
    count = np.diff(np.append(opens, len(order)))
    whole = maps[opens]
    for turn in range(1, int(np.max(count, initial=1))):
        on = count > turn
        later = maps[opens[on] + turn]
        whole[on] = later[..., :n] @ whole[on]
        whole[on, :, n:] += later[..., n:]
    whole = whole.reshape(lanes, length, n, n + q)
    cd = shown.dense(ny, n + q).reshape(lanes, length, ny, n + q)
    for k in range(length):
        dy[:, k] = cd[:, k, :, :n] @ S + cd[:, k, :, n:]
        missed = (seen[:, k] if len(seen) else 0.0) - dy[:, k]
        S += (gain * known[:, k, None]) @ missed
        S[:] = whole[:, k, :, :n] @ S + whole[:, k, :, n:]


def _maps(h: np.ndarray, ab: np.ndarray, n: int) -> np.ndarray:
    """[M | N] of each piece, S -> M S + N."""
    ab = h[:, None, None] * ab
    Z, B, one = ab[..., :n], ab[..., n:], np.eye(n)
    Z2 = Z @ Z
    den = one - 0.6 * Z + 0.15 * Z2 - Z @ Z2 / 60.0
    right = [one + 0.4 * Z + 0.05 * Z2, (one - 0.1 * Z + Z2 / 60.0) @ B]
    return np.linalg.solve(den, np.concatenate(right, axis=-1))
