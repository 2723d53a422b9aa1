"""Signals at one instant as numbers, by calling the blocks' own functions.

python-control passes through an interconnection once for each block and then reports an
algebraic loop, also where a block gives a NaN; a chain through several channels of one block needs
more passes, and a loop that is linear, or linear piece by piece, has an answer.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from scipy.sparse.csgraph import connected_components

from ...core.errors import Diverged
from .network import Wires, is_wired

Answer = Callable[[np.ndarray], np.ndarray] | None  # outputs of a block; None: they are held
SIZES = 10.0 ** np.arange(-6.0, 7.0, 1.5)  # of the points at which a loop must be linear
CLOSE = 1e-9
TRIES = 50  # pieces that are entered on the way to the solution
PIECE = 1e-7  # of the size of a point: a slope is taken over this


def settle(
    wires: Wires,
    u: np.ndarray,
    answers: Sequence[Answer],
    outputs: np.ndarray,
    loops: dict[Any, np.ndarray],
) -> tuple[list[np.ndarray], np.ndarray]:
    """Inputs of each block, and all outputs, which are the given ones of blocks without answer.

    As soon as a value is not finite, with that value. ``loops`` remembers the inputs of a loop
    that has one solution, so that the next instant need not look for it. Raises AlgebraicLoop.
    """
    at = _Instant(wires, u, answers, outputs)
    key = id(wires.blocks), *(answer is None for answer in answers)
    values = at.closed(loops[key], new=False) if key in loops else None
    if values is None:
        values = at.passed()
    if values is None:
        loop = at.looped()
        values = at.closed(loop, new=True) if len(loop) else None
        if values is None:
            owners = np.repeat(range(len(answers)), [b.ninputs for b in wires.blocks])
            raise wires.loop(sorted({int(owners[k]) for k in loop}))
        loops[key] = loop
    return [values[place] for place in wires.inputs], at.outputs


class _Instant:
    """The blocks at one instant; a block is called again only if one of its inputs changed."""

    def __init__(self, wires: Wires, u: np.ndarray, answers: Sequence[Answer], y: Any) -> None:
        self.wires, self.outside = wires, _times(wires.entry, u)
        self.answers, self.outputs = answers, np.array(y, dtype=float)
        self.seen: list[Any] = [None] * len(answers)

    def passed(self, loop: Any = (), own: Any = ()) -> np.ndarray | None:
        """The inputs when nothing changes any more, those in ``loop`` being given; None: never.

        The first passes give blocks zeros that the system never has: what is not finite may pass.
        """
        values, self.seen = self._given(loop, own), [None] * len(self.answers)
        for _ in range(len(self.outputs) + 2):
            changed = False
            for i, place in enumerate(self.wires.inputs):
                if values[place].tobytes() != self.seen[i]:
                    self._call(i, values[place])
                    values, changed = self._given(loop, own), True
            if not changed:
                return values
        return None if np.isfinite(self.outputs).all() else values

    def _given(self, loop: Any = (), own: Any = ()) -> np.ndarray:
        """The inputs that follow from the outputs."""
        values = _times(self.wires.connect, self.outputs) + self.outside
        if len(loop):
            values[loop] = own
        return values

    def _call(self, i: int, values: np.ndarray) -> None:
        self.seen[i], answer = values.tobytes(), self.answers[i]
        if answer is not None:
            self.outputs[self.wires.outputs[i]] = answer(values)

    def looped(self) -> np.ndarray:
        """The inputs that depend on themselves, seen by a small and a large change of each."""
        values = self.outside
        base, count = self._step(values), len(values)
        reach = np.zeros((count, count))
        for k in range(count):
            for size in (1e-3, 1.7e3):
                moved = values.copy()
                moved[k] += size
                reach[k, self._step(moved) != base] = 1
        _, group = connected_components(reach, connection="strong")
        sizes = np.bincount(group)
        return np.array([k for k in range(count) if reach[k, k] or sizes[group[k]] > 1], dtype=int)

    def _step(self, values: np.ndarray) -> np.ndarray:
        """The inputs that follow from the outputs of all blocks at the given inputs."""
        for i, place in enumerate(self.wires.inputs):
            self._call(i, values[place])
        return self._given()

    def closed(self, loop: np.ndarray, *, new: bool) -> np.ndarray | None:
        """The values where those in the loop are equal to what follows from them, by Newton.

        None if the loop has no or more than one solution; a ``new`` one is tried at points of all
        sizes: it must be linear about most of them, with determinants of one sign.
        """
        eye, own = np.eye(len(loop)), np.zeros(len(loop))

        def follows(given: np.ndarray) -> np.ndarray:
            if self.passed(loop, given) is None:
                return np.full(len(loop), np.nan)
            return self._given()[loop]

        def slope(at: np.ndarray, size: float) -> np.ndarray:
            return np.column_stack([follows(at + size * k) - follows(at) for k in eye]) / size

        for k in range(TRIES):
            after = follows(own)
            values = self._given(loop, own)
            if np.all(np.abs(after - own) <= CLOSE * (1e-300 + np.abs(values).max())):
                if new and not _one_solution(follows, slope, len(loop)):
                    return None
                return self.passed(loop, own)
            rise = slope(own, PIECE * max(1.0, np.abs(own).max()) if k else 1.0)
            if not np.isfinite(rise).all():
                return None
            own = own + np.linalg.lstsq(eye - rise, after - own)[0]
        return None


def _one_solution(follows: Any, slope: Any, count: int) -> bool:
    random, signs, linear = np.random.default_rng(0), set(), []
    for size in np.repeat(SIZES, 4):
        at = size * random.standard_normal(count)
        step = 0.01 * size * random.standard_normal(count)
        a, b, c = follows(at - step), follows(at), follows(at + step)
        linear.append(np.allclose(a + c, 2.0 * b, rtol=1e-9, atol=1e-12 * size))
        rise = slope(at, PIECE * max(1.0, np.abs(at).max()))
        signs.add(np.sign(np.linalg.det(np.eye(count) - rise)))
    return len(signs) == 1 and 0.0 not in signs and bool(np.mean(linear) > 0.8)


def _times(matrix: np.ndarray, values: np.ndarray) -> np.ndarray:
    """The product, with 0 times nan = 0."""
    if np.isfinite(values).all():
        return matrix @ values
    return np.array([row[row != 0] @ values[row != 0] for row in matrix], dtype=float)


class Instant:
    """A system at any instant, block by block where python-control reports a loop.

    Raises Diverged when an output of a block is not finite although what it reads is, and
    AlgebraicLoop for a loop that cannot be solved. ``culprit`` is the first such output.
    """

    def __init__(self, system: Any, name: str = "") -> None:
        self.system, self.name, self.culprit = system, name, ""
        self.loops: dict[Any, np.ndarray] = {}

    def rates(self, t: float, x: np.ndarray, u: np.ndarray) -> np.ndarray:
        try:
            return self.system._rhs(t, x, u)
        except RuntimeError:
            return self._named(t, self.inside_rates(self.system, t, x, u))

    def outputs(self, t: float, x: np.ndarray, u: np.ndarray) -> np.ndarray:
        try:
            return self.system._out(t, x, u)
        except RuntimeError:
            return self._named(t, self.inside_outputs(self.system, t, x, u))

    def through(self, wires: Wires, t: float, x: np.ndarray, u: np.ndarray) -> Any:
        """Inputs of each block and all outputs, of blocks that act at every instant."""
        return self._named(t, self.settled(wires, t, x, u))

    def _named(self, t: float, values: Any) -> Any:
        if self.culprit:
            raise Diverged(f"{self.name}: {self.culprit} at t = {t:.6g} s.")
        return values

    def inside_outputs(self, system: Any, t: float, x: np.ndarray, u: np.ndarray) -> np.ndarray:
        """Outputs of a system on any level by those of its blocks."""
        if is_wired(system):
            inputs, y = self.settled(Wires.inside(system), t, x, u)
            return _times(np.atleast_2d(system.output_map), np.concatenate([y, *inputs]))
        with np.errstate(all="ignore"):
            y = np.reshape(np.asarray(system._out(t, x, u), dtype=float), -1)
        bad = np.flatnonzero(~np.isfinite(y))
        if len(bad) and np.isfinite(x).all() and np.isfinite(u).all() and not self.culprit:
            label = system.output_labels[bad[0]]
            self.culprit = f"output {label} of block {system.name} is {y[bad[0]]}"
        return y

    def inside_rates(self, system: Any, t: float, x: np.ndarray, u: np.ndarray) -> np.ndarray:
        if not system.nstates:
            return np.zeros(0)
        if not is_wired(system):
            with np.errstate(all="ignore"):
                return np.reshape(np.asarray(system._rhs(t, x, u), dtype=float), -1)
        wires = Wires.inside(system)
        inputs, _ = self.settled(wires, t, x, u)
        parts = zip(wires.blocks, wires.split("states", x), inputs, strict=True)
        return np.concatenate([self.inside_rates(block, t, *own) for block, *own in parts])

    def settled(self, wires: Wires, t: float, x: np.ndarray, u: np.ndarray) -> Any:
        """Inputs of each block and all outputs."""
        before = self.culprit
        answers = [
            lambda v, block=block, own=own: self.inside_outputs(block, t, own, v)
            for block, own in zip(wires.blocks, wires.split("states", x), strict=True)
        ]
        none = np.zeros(wires.connect.shape[1])
        inputs, y = settle(wires, np.asarray(u, dtype=float), answers, none, self.loops)
        if np.isfinite(y).all():
            self.culprit = before  # what was tried on the way does not count
        return inputs, y


def culprit(wires: Wires, t: float, x: np.ndarray, u: np.ndarray) -> str:
    """``output y of block b is nan``, or empty; AlgebraicLoop if the outputs never settle."""
    at = Instant(None)
    at.settled(wires, t, np.asarray(x, dtype=float), u)
    return at.culprit
