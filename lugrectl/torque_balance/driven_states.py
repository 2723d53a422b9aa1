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
from ..engine.expression.affine import affine
from ..engine.expression.derivative import derivatives, jacobian
from ..engine.expression.graph import Graph, Node, rename, sharp, symbols_in
from ..engine.runtime.backend import compiler, load
from ..engine.runtime.c_compiler import has_wide

FINE = 1e-3  # s, the longest step: reversals do not wait for the next sample
TURN = 0.25  # rad of a block's own oscillation, the longest step
PULL = 2.0  # of two states that only pull at each other, the same
MOST, STIFFEST = 1000, 64  # steps a sample at most: of those that oscillate, of those that do not
LARGE = 1e12
SMALL = 1e-4  # below this (e^q - 1)/q is a series
PLACES = "amb"  # letters of the signals in the first half of a step, its middle, its second half
CHUNK = 32768  # steps whose signals are kept at a time
STEPS = 2.0 ** np.arange(-15.0, 2.0)  # s, by which it is asked
PROBES = 16  # samples at which a block is asked how fast it oscillates
EVEN = np.array([1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64, 96, 128, 192, 256, 384, 512, 768, MOST])

Signals = Mapping[str, np.ndarray]
Pieces = Sequence[tuple[slice, float]]

# the sets are innermost: a processor computes one while it waits for another
_LOOP = """
@fast
def run(sub, first, last, h, given, p, fixed, x, now, later, out):
    for s in range(p.shape[1]):
{head}
    for k in range(last - first):
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
def run(sub, first, last, h, given, p, fixed, x, now, later, out):
{head}
    for k in range(last - first):
        for j in range(sub):
            i = k * sub + j
            ahead = {ahead}
            near = 1.0 / sub - ahead
{body}
{store}
"""

# the cubics through positions x and their steps v, at the quarters of each step
_CUBICS = """
@fast
def run(sub, h, x, v, of_theta, of_w, given):
    for k in range(x.shape[0] - 1):
        rise = x[k + 1] - x[k]
        second = 3.0 * rise - 2.0 * v[k] - v[k + 1]
        third = v[k] + v[k + 1] - 2.0 * rise
        for j in range(sub):
            i = k * sub + j
{at}
            if of_theta >= 0:
                given[0, of_theta, i] = x1
                given[1, of_theta, i] = x2
                given[2, of_theta, i] = x3
            if of_w >= 0:
                given[0, of_w, i] = (x2 - x0) * (2.0 / h)
                given[1, of_w, i] = (x4 - x0) * (1.0 / h)
                given[2, of_w, i] = (x4 - x2) * (2.0 / h)
"""
# every set of each probed sample is a lane of its own
_PROBE = """
@fast
def run(steps, given, p, x, slopes):
    for k in range(steps.shape[0]):
        h = steps[k]
        for s in range(p.shape[1]):
{body}
"""
_PROBE_LANES = """
def run(steps, given, p, x, slopes):
    for k in range(steps.shape[0]):
        h = steps[k]
{body}
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
            lanes = steps == sub if np.ptp(steps) else slice(None)
            many, made = sub, code.run(np.ascontiguousarray(p[:, lanes]), own, dt, sub)
            while many < MOST and not np.all(np.isfinite(made)):  # a step too long for it
                many *= 4
                made = code.run(np.ascontiguousarray(p[:, lanes]), own, dt, many)
            out[:, piece, lanes] = made
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
    """The compiled loop of a block, and what tells how fast its states turn."""

    block: Block
    loop: Any
    probe: Any
    cubics: Any
    kept: int
    held: bool

    def start(self, own: Signals, lanes: int) -> np.ndarray:
        first = [0.0 if name == "0" else float(own[name][0]) for name in self.block.start]
        return np.repeat(np.array(first)[:, None], lanes, axis=1)

    def run(self, p: np.ndarray, own: Signals, dt: float, sub: int) -> np.ndarray:
        """Changes (outputs, n, sets) over one piece, in ``sub`` steps a sample."""
        n, lanes, many = len(next(iter(own.values()))), p.shape[1], len(self.block.fresh)
        out, x = np.zeros((many, n, lanes)), self.start(own, lanes)
        now, later = np.zeros((2, many, lanes))
        fixed = np.zeros((self.kept, lanes))
        some = max(1, CHUNK // sub)
        for first in range(0, n, some):
            last = min(first + some, n)
            given = self._between(own, first, last, dt, sub)
            with np.errstate(all="ignore"):
                self.loop(sub, first, last, dt / sub, given, p, fixed, x, now, later, out)
        return out if self.held else _sharper(out, sub)

    def _between(self, own: Signals, first: int, last: int, dt: float, sub: int) -> np.ndarray:
        """Signals in each step, (3, reads, (last - first) sub): in its first half, its middle and
        its second half.

        Positions and speeds are those of the cubic through both; a speed is the mean over the
        step or its half. u is held by an effect on it, everything else goes in straight lines.
        """
        reads = self.block.reads
        given = np.empty((len(PLACES), len(reads), (last - first) * sub))
        for i, k in enumerate(reads):
            if k not in ("theta", "w"):
                a, b = _ends(own[k], first, last)
                b = a if k == "u" and self.held else b
                for j, share in enumerate((0.25, 0.5, 0.75)):
                    part = (np.arange(sub) + share) / sub
                    given[j, i] = (a[:, None] + part * (b - a)[:, None]).ravel()
        if {"theta", "w"} & {*reads}:
            rows = [reads.index(k) if k in reads else -1 for k in ("theta", "w")]
            self.cubics(sub, dt / sub, *_knots(own, first, last, dt), *rows, given)
        return given

    def substeps(self, p: np.ndarray, own: Signals, dt: float) -> np.ndarray:
        """Steps a sample for each set: by the length of a sample, and by how fast the states turn
        about one another where they start and where the motion drives them."""
        fine = int(np.clip(round(dt / FINE), 1, 10))
        m, lanes = len(self.block.states), p.shape[1]
        if m < 2:
            return np.full(lanes, fine)
        slopes = self._probed(p, own)
        both = slopes * slopes.swapaxes(1, 2) * (1.0 - np.eye(m))[:, :, None, None]
        most, turn = both.max(axis=(1, 2, 3)), -both[[0, -1]].min(axis=(0, 1, 2, 3))
        pull = np.zeros(lanes)
        for more, step in zip(most, STEPS, strict=True):  # beyond, it is unstable
            pull = np.where(np.sqrt(pull) * step < PULL, np.maximum(pull, more), pull)
        need = np.maximum(
            np.sqrt(np.maximum(turn, 0.0)) / TURN,
            np.minimum((m - 1) * np.sqrt(pull) / PULL, STIFFEST / dt),
        )
        return np.maximum(fine, EVEN[np.searchsorted(EVEN[:-1], need * dt)])

    def _probed(self, p: np.ndarray, own: Signals) -> np.ndarray:
        """Slopes of the rates by the states (steps, states, states, samples, sets), where they
        start and where the motion of some samples drives them."""
        reads, m, lanes = self.block.reads, len(self.block.states), p.shape[1]
        evenly = np.linspace(0, len(next(iter(own.values()))) - 1, PROBES)
        ends = [f(own[k]) for k in reads for f in (np.argmin, np.argmax)]
        some = np.concatenate([evenly, ends]).astype(int)
        given = np.repeat([own[k][some] for k in reads], lanes, axis=1)
        x = np.tile(self.start(own, lanes), len(some))
        slopes = np.zeros((len(STEPS), m * m, x.shape[1]))
        with np.errstate(all="ignore"):
            self.probe(STEPS, given, np.tile(p, len(some)), x, slopes)
        slopes = np.clip(np.nan_to_num(slopes), -LARGE, LARGE)
        return slopes.reshape(len(STEPS), m, m, len(some), lanes)


def _sharper(out: np.ndarray, sub: int) -> np.ndarray:
    """Means around the samples without what they take off slow changes; the first sample has only
    what comes after it."""
    out[:, 0] *= 2.0
    s = (np.arange(sub) + 0.5) / sub
    spread = float(np.mean((1.0 - s) * s**2))
    some, last, before = max(1, CHUNK // out.shape[2]), out.shape[1] - 1, out[:, :1].copy()
    for a in range(1, last, some):
        b = min(a + some, last)
        part = np.concatenate([before, out[:, a : b + 1]], axis=1)
        out[:, a:b] -= spread * (part[:, 2:] - 2.0 * part[:, 1:-1] + part[:, :-2])
        before = part[:, -2:-1].copy()
    return out


def _knots(own: Signals, first: int, last: int, dt: float) -> tuple[np.ndarray, np.ndarray]:
    """Positions and their steps at both ends of the samples' intervals."""
    x, v = own["theta"][first : last + 1], own["w"][first : last + 1] * dt
    if len(x) == last - first:  # beyond the end the speed stays
        return np.append(x, x[-1] + v[-1]), np.append(v, v[-1])
    return np.ascontiguousarray(x), v


def _ends(x: np.ndarray, first: int, last: int) -> tuple[np.ndarray, np.ndarray]:
    """Values at both ends of the samples' intervals; the last value of all is held."""
    return x[first:last], np.append(x[first + 1 : last], x[min(last, len(x) - 1)])


@lru_cache(maxsize=256)
def _code(way: _Way) -> _Code:
    """The loop of a block in generated code."""
    block, graph = way.block, Graph()
    held = "input" in block.acts
    p = {k: graph.symbol(f"p{i}") for i, k in enumerate(block.parameters)}
    x = [graph.symbol(f"x{i}") for i in range(len(block.states))]
    places = [[graph.symbol(f"{c}{i}") for i in range(len(block.reads))] for c in PLACES]

    def called(signals: list[Node], states: Sequence[Node]) -> list[Node]:
        results = block(*signals, *states, **p)
        many, given = len(block.fresh), dict(zip(block.reads, signals, strict=True))
        both = [*changes(block, results[:many], given), *results[many:]]
        nodes = [one if isinstance(one, Node) else graph.constant(float(one)) for one in both]
        return sharp(nodes, [p[k] for k in way.smooth])

    many = len(block.fresh)
    rates = [called(signals, x)[many:] for signals in places]
    after, middle = _advanced(rates, x, graph.symbol("h"))
    out = called(places[1], middle)[:many]
    slopes = [one for row in jacobian(rates[1], x) for one in row]
    text, kept = _source(block, out, after, held, way.by)
    probe = load(_probe_source(block, slopes, after, way.by), way.by).run
    return _Code(block, load(text, way.by).run, probe, _cubics(way.by), kept, held)


def _advanced(
    rates: Sequence[Sequence[Node]], states: Sequence[Node], h: Node
) -> tuple[list[Node], list[Node]]:
    """The states after a step h, each alone over the first half, the last over all, and back;
    and in its middle, where the last one is its mean.

    ``rates`` are those by the signals of the first half, the middle and the second half.
    """
    now, middle, last = list(states), list(states), len(states) - 1
    first = [(i, 0, 0.5 * h) for i in range(last)]
    for i, part, step in (*first, (last, 1, h), *[(i, 2, s) for i, _, s in reversed(first)]):
        end, mean = _alone(rates[part][i], states, now, i, step)
        if part == 1:
            middle = [*now[:last], mean]
        now[i] = end
    return now, middle


def _alone(
    rate: Node, states: Sequence[Node], now: Sequence[Node], i: int, step: Any
) -> tuple[Any, Any]:
    """State i after a step in which the others stay, and its mean: exact where its rate is a
    straight line. Where the rate turned back within the step, as at the end of a stroke, the line
    is that of the end."""
    both = [rate, *derivatives([rate], states[i])]

    def at(value: Any) -> list[Any]:
        to = dict(enumerate(now)) | {i: value}
        return rename(both, {states[k].index: y for k, y in to.items()})

    x: Any = now[i]
    f, a = at(x)
    grown, mean = _grown(a * step)
    end, middle = x + step * f * grown, x + step * f * mean
    if affine([rate], [states[i]])[0] is not None:
        return end, middle
    back, a = at(end)
    turned = np.logical_and(f * back < 0.0, a < 0.0)
    goal = end - back / np.where(turned, a, -1.0)
    q = np.where(turned, a, 0.0) * step
    grown, _ = _grown(q)
    left = (x - goal) * (1.0 + q * grown), (x - goal) * grown
    return np.where(turned, goal + left[0], end), np.where(turned, goal + left[1], middle)


def _grown(q: Any) -> tuple[Any, Any]:
    """(e^q - 1)/q, by which a step's rate grows, and (e^q - 1 - q)/q^2, for its mean."""
    if q.is_constant(0.0):
        return 1.0, 0.5
    small = np.abs(q) < SMALL
    q = np.minimum(q, 1.0)  # a state that runs away is not followed far
    divisor = np.where(small, 1.0, q)
    grown = np.where(small, 1.0 + q * (0.5 + q * (1.0 / 6.0)), (np.exp(q) - 1.0) / divisor)
    return grown, np.where(small, 0.5 + q * (1.0 / 6.0), (grown - 1.0) / divisor)


def _source(
    block: Block, out: Sequence[Node], after: Sequence[Node], held: bool, by: str
) -> tuple[str, int]:
    """The text of the loop, and how many values of each set it keeps."""
    keys = [f"p{i}" for i in range(len(block.parameters))]
    emitter = Emitter(_kind(by), fixed=[*keys, "h"])
    codes = emitter.write([*out, *after])
    outputs, new = codes[: len(out)], codes[len(out) :]
    each, depth = ("", (1, 3, 2)) if by == "numpy" else (", s", (2, 4, 3))
    known = [line.split(" = ")[0] for line in emitter.head]
    read = [f"{k} = p[{i}{each}]" for i, k in enumerate(keys)]
    head = [*read, *emitter.head, *(f"fixed[{i}{each}] = {k}" for i, k in enumerate(known))]
    body = [*read, *(f"{k} = fixed[{i}{each}]" for i, k in enumerate(known))]
    used = symbols_in([*out, *after])
    places = [(j, c, i) for j, c in enumerate(PLACES) for i in range(len(block.reads))]
    body += [f"{c}{i} = given[{j}, {i}, i]" for j, c, i in places if f"{c}{i}" in used]
    body += [f"x{i} = x[{i}{each}]" for i in range(len(new))]
    body += [*emitter.body, *(f"y{i} = {code}" for i, code in enumerate(outputs))]
    body += [f"n{i} = {code}" for i, code in enumerate(new)]
    body += [f"now[{i}{each}] += near * y{i}" for i in range(len(out))]
    body += [] if held else [f"later[{i}{each}] += ahead * y{i}" for i in range(len(out))]
    body += [f"x[{i}{each}] = n{i}" for i in range(len(new))]
    store = []
    for i in range(len(out)):
        store += [f"out[{i}, first + k{each}] = now[{i}{each}]"]
        store += [f"now[{i}{each}] = later[{i}{each}]"]
        store += [f"later[{i}{each}] = 0.0"]
    filled = (indent(lines, n) for lines, n in zip((head, body, store), depth, strict=True))
    parts = dict(zip(("head", "body", "store"), filled, strict=True))
    ahead = "0.0" if held else "(j + 0.5) / (1.0 * sub * sub)"
    return (_LANES if by == "numpy" else _LOOP).format(ahead=ahead, **parts), len(known)


def _probe_source(block: Block, slopes: Sequence[Node], after: Sequence[Node], by: str) -> str:
    """The text of the loop that asks for the slopes of the rates as the states are driven on."""
    emitter = Emitter(_kind(by))
    codes = emitter.write([*slopes, *after])
    each, depth = ("", 2) if by == "numpy" else (", s", 3)
    used = symbols_in([*slopes, *after])
    body = [f"p{i} = p[{i}{each}]" for i in range(len(block.parameters))]
    places = [(c, i) for c in PLACES for i in range(len(block.reads))]
    body += [f"{c}{i} = given[{i}{each}]" for c, i in places if f"{c}{i}" in used]
    body += [f"x{i} = x[{i}{each}]" for i in range(len(after))]
    body += emitter.body
    body += [f"slopes[k, {i}{each}] = {code}" for i, code in enumerate(codes[: len(slopes)])]
    new = codes[len(slopes) :]
    body += [f"n{i} = {code}" for i, code in enumerate(new)]
    body += [f"x[{i}{each}] = n{i}" for i in range(len(new))]
    return (_PROBE_LANES if by == "numpy" else _PROBE).format(body=indent(body, depth))


def _kind(by: str) -> str:
    """How an expression is written for a compiler."""
    return {"numpy": "array", "even": "wide"}.get(by, "scalar")


def _cubics(by: str) -> Any:
    """The function that fills in positions and speeds between the samples."""
    shares = (0.0, 0.25, 0.5, 0.75, 1.0)
    lines = [f"q{i} = (j + {share}) / (1.0 * sub)" for i, share in enumerate(shares)]
    lines += [f"x{i} = x[k] + q{i} * (v[k] + q{i} * (second + q{i} * third))" for i in range(5)]
    return load(_CUBICS.format(at=indent(lines, 3)), by).run
