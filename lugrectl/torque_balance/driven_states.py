"""Blocks with states along a measured motion: their rates integrated by generated code.

Strang splitting: one state after the other over half a step and back again, each by an
exponential step with its own slope. So a bristle is exact at a held speed however stiff it is,
and a spring with an inertia is a leapfrog; both are of second order for any other block.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

import numpy as np

from ..blocks.block import Block
from ..engine.codegen.python_source import Emitter, indent
from ..engine.expression.derivative import derivatives, jacobian
from ..engine.expression.graph import Graph, Node, evaluate, rename, sharp
from ..engine.runtime.backend import compiler, load
from ..engine.runtime.c_compiler import has_wide

FINE = 1e-3  # s, the longest step: reversals do not wait for the next sample
TURN = 0.25  # rad of a block's own oscillation, the longest step
MOST, STIFFEST = 1000, 64  # steps a sample at most: of an oscillation, of states that only decay
SMALL = 1e-4  # below this (e^q - 1)/q is a series
CHUNK = 4096  # samples whose signals between the samples are kept at a time
PROBES = 32  # samples at which a block is asked how fast it oscillates
EVEN = np.array([1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64, 96, 128, 192, 256, 384, 512, 768, MOST])

Signals = Mapping[str, np.ndarray]
Pieces = Sequence[tuple[slice, float]]

# the sets are innermost: a processor computes one while it waits for another
_LOOP = """
@fast
def run(sub, h, node, mid, p, fixed, x, now, later, out):
    for s in range(p.shape[1]):
{head}
    for k in range(out.shape[1]):
        for j in range(sub):
            i = k * sub + j
            ahead = {ahead}
            near = 1.0 / sub - ahead
            for s in range(p.shape[1]):
{body}
        for s in range(p.shape[1]):
{store}
"""
_LANES = """
def run(sub, h, node, mid, p, fixed, x, now, later, out):
{head}
    for k in range(out.shape[1]):
        for j in range(sub):
            i = k * sub + j
            ahead = {ahead}
            near = 1.0 / sub - ahead
{body}
{store}
"""


def changes(block: Block, results: Sequence[Any], signals: Mapping[str, Any]) -> list[Any]:
    """What each output changes: of an effect on the input the torque that is lost, of one on a
    sensor its error; other outputs are changes as they are."""
    made = []
    for i, name in enumerate(block.fresh):
        act = block.acts[i if len(block.fresh) == len(block.acts) else 0] if block.acts else ""
        out = results[i]
        if act == "input":
            out = signals["u"] - out
        elif act == "sensor":
            out = out - signals[name.removesuffix("_m")]
        made.append(out)
    return made


def driven(
    block: Block,
    sets: Sequence[Mapping[str, float]],
    signals: Signals,
    pieces: Pieces,
) -> list[np.ndarray]:
    """Changes by each output of a block with states, (n, sets) each.

    Parameters
    ----------
    block : Block
        With states; each piece begins where ``Block.start`` says.
    sets : list of dict
        All parameters of the block.
    signals : dict
        (n,) arrays of what the block reads, with w beside theta and theta beside w.
    pieces : list of (slice, float)
        Stretches of even time and their step in s: nothing looks from one into another.

    Notes
    -----
    A value stands for the mean around its sample with triangular weights, so that a torque
    between the samples is neither early nor late; where u is read by an effect on the input, for
    the mean over the cell in which u is held.
    """
    p = np.array([[float(one[k]) for one in sets] for k in block.parameters]).reshape(-1, len(sets))
    smooth = frozenset(
        k for k, own in block.parameters.items()
        if own.smooths and all(one[k] <= own.value for one in sets)
    )  # fmt: skip
    made_by = compiler() or "numpy"
    made_by = "even" if made_by == "c" and has_wide() else made_by
    return _through(block, p, signals, pieces, smooth, made_by)


def _through(
    block: Block, p: np.ndarray, signals: Signals, pieces: Pieces, smooth: frozenset[str], by: str
) -> list[np.ndarray]:
    code = _code(_Way(block.function, block.acts, smooth, by, block))
    n = len(next(iter(signals.values())))
    out = np.zeros((len(block.fresh), n, p.shape[1]))
    for piece, dt in pieces:
        own = {k: x[piece] for k, x in signals.items()}
        steps = code.substeps(p, own, dt)
        if by == "numpy":  # a loop in Python takes as long for all as for one
            steps[:] = steps.max()
        for sub in np.unique(steps).tolist():
            lanes = np.flatnonzero(steps == sub)
            out[:, piece, lanes] = code.run(np.ascontiguousarray(p[:, lanes]), own, dt, sub)
    return list(out)


@dataclass(frozen=True)
class _Way:
    """A block and how its code is made; the same function need not be compiled again."""

    function: Any
    acts: tuple[str, ...]
    smooth: frozenset[str]
    by: str
    block: Block = field(compare=False)


@dataclass(frozen=True, eq=False)
class _Code:
    """The compiled loop of a block, and its expressions."""

    block: Block
    loop: Any
    kept: int
    held: bool
    after: list[Node]
    slopes: list[Node]

    def start(self, own: Signals, lanes: int) -> np.ndarray:
        first = [0.0 if name == "0" else float(own[name][0]) for name in self.block.start]
        return np.repeat(np.array(first)[:, None], lanes, axis=1)

    def run(self, p: np.ndarray, own: Signals, dt: float, sub: int) -> np.ndarray:
        """Changes (outputs, n, sets) over one piece, in ``sub`` steps a sample."""
        n, lanes, many = len(next(iter(own.values()))), p.shape[1], len(self.block.fresh)
        out, x = np.zeros((many, n, lanes)), self.start(own, lanes)
        now, later = np.zeros((2, many, lanes))
        fixed = np.zeros((self.kept, lanes))
        for first in range(0, n, CHUNK):
            last = min(first + CHUNK, n)
            node, mid = _between(self.block.reads, own, first, last, dt, sub, self.held)
            part = np.zeros((many, last - first, lanes))
            with np.errstate(all="ignore"):
                self.loop(sub, dt / sub, node, mid, p, fixed, x, now, later, part)
            out[:, first:last] = part
        if not self.held:  # the first sample has only what comes after it
            out[:, 0] *= 2 * sub / (sub + 1)
        return out

    def substeps(self, p: np.ndarray, own: Signals, dt: float) -> np.ndarray:
        """Steps a sample for each set: by the length of a sample, and by how fast the states turn
        about one another where they start and where the motion drives them."""
        fine = int(np.clip(round(dt / FINE), 1, 10))
        m, lanes = len(self.block.states), p.shape[1]
        if m < 2:
            return np.full(lanes, fine)
        some = np.unique(np.linspace(0, len(next(iter(own.values()))) - 1, PROBES).astype(int))
        values: dict[str, Any] = {f"p{i}": row for i, row in enumerate(p)}
        values |= {f"m{i}": own[k][some, None] for i, k in enumerate(self.block.reads)}
        values |= {f"x{i}": row for i, row in enumerate(self.start(own, lanes))} | {"h": 1.0}
        there = evaluate(self.after, values)
        whirl, pull = np.zeros(lanes), np.zeros(lanes)
        for states in ({}, {f"x{i}": x for i, x in enumerate(there)}):
            found = evaluate(self.slopes, values | states)
            J = np.stack([np.broadcast_to(x, (len(some), lanes)) for x in found], axis=-1)
            J = np.nan_to_num(J, posinf=1e12, neginf=-1e12).reshape(len(some), lanes, m, m)
            turns = np.abs(np.linalg.eigvals(J).imag)
            others = np.linalg.eigvals(np.abs(J) * (1.0 - np.eye(m))).real
            whirl = np.maximum(whirl, turns.max(axis=(0, 2)))
            pull = np.maximum(pull, others.max(axis=(0, 2)))
        need = np.maximum(np.minimum(pull * dt / TURN, STIFFEST), whirl * dt / TURN)
        return np.maximum(fine, EVEN[np.searchsorted(EVEN[:-1], need)])


def _between(
    reads: Sequence[str], own: Signals, first: int, last: int, dt: float, sub: int, held: bool
) -> tuple[np.ndarray, np.ndarray]:
    """Signals at the start and in the middle of each step, (reads, (last - first) sub) each.

    Positions and speeds are those of the cubic through both; in the middle, the speed is the mean
    over the step. u is held, everything else in a straight line.
    """
    q = np.arange(sub)[:, None] / sub
    made: dict[str, tuple[np.ndarray, np.ndarray]] = {}
    for k in {*reads} - {"theta", "w"}:
        a, b = _ends(own[k], first, last)
        b = a if k == "u" and held else b
        made[k] = a + q * (b - a), a + (q + 0.5 / sub) * (b - a)
    if {"theta", "w"} & {*reads}:
        (x0, x1), (v0, v1) = (_ends(own[k], first, last) for k in ("theta", "w"))
        if last == len(own["w"]):  # beyond the end the speed stays
            x1[-1] = x0[-1] + v0[-1] * dt
        at = [_cubic(x0, v0 * dt, x1, v1 * dt, s) for s in (q, q + 0.5 / sub, q + 1.0 / sub)]
        made["theta"] = at[0][0], at[1][0]
        made["w"] = at[0][1] / dt, (at[2][0] - at[0][0]) * sub / dt
    each = [[made[k][i].T.ravel() for k in reads] for i in (0, 1)]
    node, mid = (np.array(rows).reshape(len(reads), -1) for rows in each)
    return node, mid


def _ends(x: np.ndarray, first: int, last: int) -> tuple[np.ndarray, np.ndarray]:
    """Values at both ends of the samples' intervals; the last value of all is held."""
    return x[first:last], np.append(x[first + 1 : last], x[min(last, len(x) - 1)])


def _cubic(x0: Any, v0: Any, x1: Any, v1: Any, q: Any) -> tuple[Any, Any]:
    """The cubic through x0 and x1 with the slopes v0 and v1, and its slope, at q from 0 to 1."""
    step = x1 - x0
    a, b = 3.0 * step - 2.0 * v0 - v1, v0 + v1 - 2.0 * step
    return x0 + q * (v0 + q * (a + q * b)), v0 + q * (2.0 * a + 3.0 * q * b)


@lru_cache(maxsize=256)
def _code(way: _Way) -> _Code:
    """The loop of a block in generated code."""
    block, graph = way.block, Graph()
    held = "input" in block.acts
    p = {k: graph.symbol(f"p{i}") for i, k in enumerate(block.parameters)}
    x = [graph.symbol(f"x{i}") for i in range(len(block.states))]
    node, mid = ([graph.symbol(f"{c}{i}") for i in range(len(block.reads))] for c in "gm")

    def called(signals: list[Node], states: Sequence[Node]) -> list[Node]:
        results = block(*signals, *states, **p)
        many, given = len(block.fresh), dict(zip(block.reads, signals, strict=True))
        both = [*changes(block, results[:many], given), *results[many:]]
        nodes = [one if isinstance(one, Node) else graph.constant(float(one)) for one in both]
        return sharp(nodes, [p[k] for k in way.smooth])

    many = len(block.fresh)
    rates = called(mid, x)[many:]
    after = _advanced(rates, x, graph.symbol("h"))
    middle = [0.5 * (a + b) for a, b in zip(x, after, strict=True)]
    out = (called(mid, middle) if held else called(node, x))[:many]
    slopes = [one for row in jacobian(rates, x) for one in row]
    text, kept = _source(block, out, after, held, way.by)
    return _Code(block, load(text, way.by).run, kept, held, after, slopes)


def _advanced(rates: Sequence[Node], states: Sequence[Node], h: Node) -> list[Node]:
    """The states after a step h: each alone over half of it, the last over all, and back."""
    own = [derivatives([f], x)[0] for f, x in zip(rates, states, strict=True)]
    now, last = list(states), len(states) - 1
    for i in (*range(last), last, *reversed(range(last))):
        to = {x.index: value for x, value in zip(states, now, strict=True)}
        rate, slope = rename([rates[i], own[i]], to)
        step = h if i == last else 0.5 * h
        now[i] = now[i] + step * rate * _grown(slope * step)
    return now


def _grown(q: Node) -> Any:
    """(e^q - 1)/q."""
    if q.is_constant(0.0):
        return 1.0
    small = np.abs(q) < SMALL
    q = np.minimum(q, 1.0)  # a state that runs away is not followed far
    divisor = np.where(small, 1.0, q)
    return np.where(small, 1.0 + q * (0.5 + q * (1.0 / 6.0)), (np.exp(q) - 1.0) / divisor)


def _source(
    block: Block, out: Sequence[Node], after: Sequence[Node], held: bool, by: str
) -> tuple[str, int]:
    """The text of the loop, and how many values of each set it keeps."""
    keys = [f"p{i}" for i in range(len(block.parameters))]
    kind = {"numpy": "array", "even": "wide"}.get(by, "scalar")
    emitter = Emitter(kind, fixed=[*keys, "h"])
    codes = emitter.write([*out, *after])
    outputs, new = codes[: len(out)], codes[len(out) :]
    each, depth = ("", (1, 3, 2)) if by == "numpy" else (", s", (2, 4, 3))
    known = [line.split(" = ")[0] for line in emitter.head]
    read = [f"{k} = p[{i}{each}]" for i, k in enumerate(keys)]
    head = [*read, *emitter.head, *(f"fixed[{i}{each}] = {k}" for i, k in enumerate(known))]
    body = [*read, *(f"{k} = fixed[{i}{each}]" for i, k in enumerate(known))]
    body += [f"{c}{i} = {of}[{i}, i]" for i in range(len(block.reads))
             for c, of in (("g", "node"), ("m", "mid"))]  # fmt: skip
    body += [f"x{i} = x[{i}{each}]" for i in range(len(new))]
    body += [*emitter.body, *(f"y{i} = {code}" for i, code in enumerate(outputs))]
    body += [f"n{i} = {code}" for i, code in enumerate(new)]
    body += [f"now[{i}{each}] += near * y{i}" for i in range(len(out))]
    body += [] if held else [f"later[{i}{each}] += ahead * y{i}" for i in range(len(out))]
    body += [f"x[{i}{each}] = n{i}" for i in range(len(new))]
    store = []
    for i in range(len(out)):
        store += [f"out[{i}, k{each}] = now[{i}{each}]", f"now[{i}{each}] = later[{i}{each}]"]
        store += [f"later[{i}{each}] = 0.0"]
    filled = (indent(lines, n) for lines, n in zip((head, body, store), depth, strict=True))
    parts = dict(zip(("head", "body", "store"), filled, strict=True))
    ahead = "0.0" if held else "j / (1.0 * sub * sub)"
    return (_LANES if by == "numpy" else _LOOP).format(ahead=ahead, **parts), len(known)
