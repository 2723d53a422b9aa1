"""Code of the loop over lanes, samples and steps that also computes derivatives."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from ..expression.derivative import jacobian
from ..expression.graph import Node, rename
from ..tracing.equations import Program
from .fixed_step import step_code, unpack
from .python_source import Emitter, indent, lines_of
from .relay import Relays, relays
from .rosenbrock import SparseLU

_LOOP = """
import numpy as np


@fast
def run(x_start, start, length, u, stride, series, p, y, seen, gain, correct, dull, half, t0, dt,
        substeps, rtol, floor, rows, by, y_rows, y_by, edges, target, source, push, dseen, y_hat,
        dy, x_end, S, first, last):
    q = S.shape[2]
    P, b, d = np.zeros(({n}, {n})), np.empty(len(rows)), np.empty(len(y_rows))
    for lane in range(first, last):
        own, view, s = series[lane], seen[lane], S[lane]
{unpack}
{head}
        for j in range(length):
            k = start[lane] + j
            t = t0[lane] + k * dt
            slope = dy[lane, j]
{read}
{output}
            for e in range(len(d)):
                for one in range(edges[y_by[e]], edges[y_by[e] + 1]):
                    value = d[e] if source[one] < 0 else d[e] * push[own, k, source[one]]
                    slope[y_rows[e], target[one]] += value
            if correct:
{correct}
{scale}
            for turn in range(substeps):
                t = t0[lane] + (k + turn / substeps) * dt
                left = dt / substeps
                h = left
                while left > 0.0:
{step}
{finish}
"""

_PUSH = """
for e in range(len(b)):
    for one in range(edges[by[e]], edges[by[e] + 1]):
        value = b[e] if source[one] < 0 else b[e] * push[own, k, source[one]]
        for i in range({n}):
            s[i, target[one]] += P[i, rows[e]] * value
"""

Rows = Sequence[Sequence[Node]]


@dataclass(frozen=True, eq=False)
class Entries:
    """The nonzero entries of a matrix of derivatives: their row, and the variable (``by``).

    ``by`` is an index into the parameters followed by the inputs.
    """

    nodes: list[Node]
    rows: np.ndarray
    by: np.ndarray


def entries(program: Program, roots: Sequence[Node]) -> Entries:
    """The derivatives of the roots by parameters and inputs."""
    matrix = jacobian(roots, [*program.p, *program.u])
    full = [
        (node, i, j)
        for i, row in enumerate(matrix)
        for j, node in enumerate(row)
        if not node.is_constant(0.0)
    ]
    places = np.array([place for _, *place in full], dtype=np.int64).reshape(-1, 2)
    return Entries([node for node, *_ in full], *places.T.copy())


def tangent_code(program: Program) -> tuple[str, Entries, Entries]:
    """The function ``run``, and the entries of the derivatives of rates and of outputs."""
    fixed = [node.value for node in program.p]
    sample, step, carry = (Emitter("scalar", letter, fixed) for letter in "abc")
    switching = relays(program)
    rates = switching.rates
    inside, outside = entries(program, rates), entries(program, program.y)
    states = [node.value for node in program.x]
    output = _output(program, outside, sample)
    carried = [*_carried(program, rates, inside, carry), *lines_of(_PUSH.format(n=len(states)))]
    carried += _at_zeros(switching)
    inner = step_code(program, "scalar", step, carried)
    text = _LOOP.format(
        n=len(states),
        unpack=indent(unpack(program, "scalar"), 2),
        head=indent(sample.head + step.head + carry.head, 2),
        read=indent([f"{node.value} = u[own, k, {i}]" for i, node in enumerate(program.u)], 3),
        output=indent(output, 3),
        correct=indent(_correct(states, len(program.y)), 4),
        scale=indent([f"s{i} = max(s{i}, abs({x}))" for i, x in enumerate(states)], 3),
        step=indent(inner, 5),
        finish=indent([f"x_end[lane, {i}] = {x}" for i, x in enumerate(states)], 2),
    )
    return text, inside, outside


def _output(program: Program, outside: Entries, emitter: Emitter) -> list[str]:
    """Outputs, and their derivatives by the states times S."""
    C = jacobian(program.y, program.x)
    codes = iter(emitter.write([*program.y, *_flat(C), *outside.nodes]))
    lines = [f"y_hat[lane, j, {o}] = {next(codes)}" for o in range(len(program.y))]
    lines += _times("slope", C, codes)
    lines += [f"d[{e}] = {code}" for e, code in enumerate(codes)]
    return [*emitter.body, *lines]


def _times(to: str, matrix: Rows, codes: Iterator[str]) -> list[str]:
    """to = matrix S in all columns; ``codes`` gives the entries row by row."""
    lines = [f"r{j} = s[{j}, c]" for j in range(len(matrix[0]))]
    for i, row in enumerate(matrix):
        factors = [(entry, next(codes)) for entry in row]
        terms = [f"{f} * r{j}" for j, (e, f) in enumerate(factors) if not e.is_constant(0.0)]
        lines.append(f"{to}[{i}, c] = {' + '.join(terms) or '0.0'}")
    return ["for c in range(q):", *(f"    {line}" for line in lines)]


def _correct(states: Sequence[str], ny: int) -> list[str]:
    """x += gain e, S += gain (dy - dy_hat) as in :func:`.fixed_step.correction`."""
    lines: list[str] = []
    for o in range(ny):
        lines += [f"m{o} = y[view, k, {o}] - y_hat[lane, j, {o}]"]
        lines += [f"k{o} = 1.0 if m{o} == m{o} else 0.0", f"m{o} = m{o} if k{o} > 0.0 else 0.0"]
        lines += [
            "if len(dull) > 0:",
            f"    k{o} = k{o} * (1.0 - dull[k, {o}]) if abs(m{o}) < half[{o}] else k{o}",
            f"    m{o} = m{o} - dull[k, {o}] * max(-half[{o}], min(half[{o}], m{o}))",
        ]
    for i, x in enumerate(states):
        lines += [f"g{i}_{o} = gain[lane, {i}, {o}] * k{o}" for o in range(ny)]
        terms = [x, *(f"gain[lane, {i}, {o}] * m{o}" for o in range(ny))]
        lines.append(f"{x} = {' + '.join(terms)}")
    inner = [f"r{o} = slope[{o}, c]" for o in range(ny)]
    inner += ["if len(dseen):", *(f"    r{o} -= dseen[lane, j, {o}, c]" for o in range(ny))]
    for i in range(len(states)):
        inner.append(f"s[{i}, c] -= " + " + ".join(f"g{i}_{o} * r{o}" for o in range(ny)))
    return [*lines, "for c in range(q):", *(f"    {line}" for line in inner)]


def _carried(
    program: Program, rates: Sequence[Node], inside: Entries, emitter: Emitter
) -> list[str]:
    """S <- (I + Z P) S, and P, b = h B for the other terms, of a step of length h from x to n.

    Z = h A, and P = (I - 2/3 Z + 1/6 Z^2)^-1 (I - 1/6 Z) is an approximant of (exp(Z) - I) / Z:
    I + Z P is L-stable, and of order 3 if A does not change.
    """
    graph, n = program.graph, len(program.x)
    h, begin = graph.symbol("h"), graph.symbol("begin")
    middle = {program.t.index: program.t + 0.5 * h, begin.index: program.t}

    def at(roots: Sequence[Node], state: Sequence[Node]) -> list[Node]:
        place = {x.index: value for x, value in zip(program.x, state, strict=True)}
        return rename(roots, middle | place)

    def slopes(state: Sequence[Node]) -> list[list[Node]]:
        return [[h * a for a in at(row, state)] for row in jacobian(rates, program.x)]

    new = [graph.symbol(f"n{i}") for i in range(n)]
    mean = [0.5 * (x + y) for x, y in zip(program.x, new, strict=True)]
    change = zip(at(rates, program.x), at(rates, new), strict=True)
    offset = _offset(slopes(mean), [h * (b - a) for a, b in change])
    mean = [m + o for m, o in zip(mean, offset, strict=True)]
    Z = slopes(mean)
    Z2 = _product(Z, Z)
    lu = SparseLU(graph, _sum((1.0, _unit(Z)), (-2.0 / 3.0, Z), (1.0 / 6.0, Z2)))
    right = _sum((1.0, _unit(Z)), (-1.0 / 6.0, Z))
    P = _turned([lu.solve(column) for column in _turned(right)])
    M = _sum((1.0, _unit(Z)), (1.0, _product(Z, P)))
    b = [h * node for node in at(inside.nodes, mean)]
    codes = iter(emitter.write([*_flat(M), *_flat(P), *b]))
    lines = _times("s", M, codes)
    lines += [f"P[{i}, {j}] = {next(codes)}" for i in range(n) for j in range(n)]
    return [*emitter.body, *lines, *(f"b[{e}] = {code}" for e, code in enumerate(codes))]


def _at_zeros(switching: Relays) -> list[str]:
    """S at the end of a step in which a state x reaches zero: the instant moves by -s_x / dx/dt.

    S <- S + (dx/dt after - dx/dt before) s_x / (dx/dt before of that state), in each row.
    """
    lines = []
    for relay in switching.every:
        pairs = switching.turned()[relay.place]
        nodes = [pairs[relay.place][0], *(last - first for first, last in pairs.values())]
        emitter = Emitter("scalar", f"turn{relay.place}_")
        rate, *jumps = emitter.write(nodes)
        inner = [f"moved = s[{relay.place}, c] / ({rate})"]
        inner += [f"s[{i}, c] += moved * ({jump})" for i, jump in zip(pairs, jumps, strict=True)]
        body = [*emitter.body, "for c in range(q):", *(f"    {line}" for line in inner)]
        lines += [f"if {relay.land} > 0.0:", *(f"    {line}" for line in body)]
    return lines


def _offset(Z: Rows, bend: Sequence[Node]) -> list[Node]:
    """Mean state over a step minus the mean of its ends; ``bend`` is h times the rates' change.

    For constant A it is (1/z - coth(z/2) / 2) dx. The approximant -(z/12) / (1 - z/6) is also
    correct for z tending to -infinity: then the mean is the state at the end.
    """
    lu = SparseLU(bend[0].graph, _sum((1.0, _unit(Z)), (-1.0 / 6.0, Z)))
    return [solved * (-1.0 / 12.0) for solved in lu.solve(bend)]


def _flat(rows: Rows) -> list[Node]:
    return [node for row in rows for node in row]


def _turned(rows: Rows) -> list[list[Node]]:
    return [list(column) for column in zip(*rows, strict=True)]


def _unit(like: Rows) -> list[list[Node]]:
    graph = like[0][0].graph
    places = range(len(like))
    return [[graph.constant(float(i == j)) for j in places] for i in places]


def _sum(*terms: tuple[float, Rows]) -> list[list[Node]]:
    """Matrices times numbers, added up."""
    graph, n = terms[0][1][0][0].graph, len(terms[0][1])
    return [[graph.total(f * rows[i][j] for f, rows in terms) for j in range(n)] for i in range(n)]


def _product(a: Rows, b: Rows) -> list[list[Node]]:
    graph, places = a[0][0].graph, range(len(a))
    return [[graph.total(a[i][m] * b[m][j] for m in places) for j in places] for i in places]
