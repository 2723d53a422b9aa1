"""Blocks with states along a measured motion, integrated by the engine.

Position and speed between the samples are those of the cubic through both; u is held by an effect
on it, everything else goes in straight lines. A step of the states takes the signals of its middle.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache, wraps
from typing import Any, TypeVar

import numpy as np

from ..blocks.block import Block
from ..core.bare_system import BareSystem
from ..engine.runtime.batch_run import Lanes
from .numerics import cubic

FINE = 1e-3  # s, the longest step: reversals do not wait for the next sample
ROOM = 2**22  # numbers that are kept at a time

Signals = Mapping[str, np.ndarray]
Pieces = Sequence[tuple[slice, float]]
T = TypeVar("T")


@dataclass(frozen=True, eq=False)
class Known:
    """A block as the key of what is known of it: its function and declaration are one object."""

    block: Block

    def __hash__(self) -> int:
        return hash((self.block.kind, self.block.name, self.block.function))

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Known) and self.block == other.block


def once_a_block(function: Callable[[Block], T]) -> Callable[[Block], T]:
    """What is asked of a block, answered once for each."""

    @lru_cache(maxsize=256)
    def answered(known: Known) -> T:
        return function(known.block)

    @wraps(function)
    def asked(block: Block) -> T:
        return answered(Known(block))

    return asked


def changes(block: Block, results: Sequence[Any], signals: Mapping[str, Any]) -> list[Any]:
    """What each output changes: torque lost at the input, a sensor's error, or itself."""
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
    block: Block, sets: Sequence[Mapping[str, float]], signals: Signals, pieces: Pieces
) -> list[np.ndarray]:
    """Changes by each output of a block with states, (n, sets) each; each piece begins where
    ``Block.start`` says. TraceError where the engine cannot read the block's function.

    ``signals`` are (n,) arrays of what the block reads, with w beside theta and theta beside w.
    A value stands for the mean around its sample with triangular weights, so that a torque
    between the samples is neither early nor late; where u is read by an effect on the input, for
    the mean over the cell in which u is held.
    """
    out = np.zeros((len(block.fresh), len(next(iter(signals.values()))), len(sets)))
    for piece, dt in pieces:
        own = {k: x[piece] for k, x in signals.items()}
        k = int(np.clip(round(dt / FINE), 1, 10))
        some = max(1, ROOM // (len(block.states) * k * len(own[block.reads[0]])))
        for first in range(0, len(sets), some):
            few = slice(first, first + some)
            out[:, piece, few] = _along(block, sets[few], own, dt, k)
    return list(out)


def _along(
    block: Block, sets: Sequence[Mapping[str, float]], own: Signals, dt: float, k: int
) -> np.ndarray:
    """Changes (outputs, n, sets) over one piece, by ``k`` steps a sample."""
    held, lanes, n = "input" in block.acts, _lanes(block), len(own[block.reads[0]])
    many, shares = len(block.fresh), (np.arange(k) + 0.5) / k
    between = _between(own, shares, dt, held)
    p = np.array([[float(one[name]) for name in lanes.parameters] for one in sets])
    first = [0.0 if name == "0" else float(own[name][0]) for name in block.start]
    sums, last = lanes.run(
        np.tile([*first, *[0.0] * many], (len(sets), 1)), np.zeros(len(sets), int), n * k,
        np.column_stack([between[name] for name in block.reads])[None],
        p.reshape(len(sets), -1), dt=dt / k, substeps=1,
    )  # fmt: skip
    sums = np.concatenate([sums, last[:, None, -many:]], axis=1)
    means = np.moveaxis(np.diff(sums, axis=1) / (dt / k), 0, 2).reshape(n, k, many, len(sets))
    if held:
        return means.mean(1).swapaxes(0, 1)
    return _around(means, shares).swapaxes(0, 1)


def _between(own: Signals, shares: np.ndarray, dt: float, held: bool) -> dict[str, np.ndarray]:
    """Signals (n shares,) between the samples; beyond the end the speed stays."""
    made = {}
    for name, x in own.items():
        rise = np.append(np.diff(x), 0.0) * (name != "u" or not held)
        made[name] = (x[:, None] + shares * rise[:, None]).ravel()
    if {"theta", "w"} <= own.keys():
        theta, rise = cubic(own["theta"], own["w"] * dt, shares)
        made |= {"theta": theta.ravel(), "w": rise.ravel() / dt}
    return made


def _around(means: np.ndarray, shares: np.ndarray) -> np.ndarray:
    """Means over steps (n, k, ...) -> around the samples (n, ...), by triangles, without what these
    take off slow changes; the first sample has only what comes after it."""
    before, after = (np.tensordot(means, w / len(w), (1, 0)) for w in (shares, 1.0 - shares))
    made = after
    made[1:] += before[:-1]
    made[0] *= 2.0
    spread = float(np.mean((1.0 - shares) * shares**2))
    made[1:-1] -= spread * (made[2:] - 2.0 * made[1:-1] + made[:-2])
    return made


@once_a_block
def _lanes(block: Block) -> Lanes:
    """The states of a block and the integrals of its changes, as the engine reads them."""
    many = len(block.fresh)
    sums = tuple(f"sum of {name}" for name in block.fresh)

    def rates(_t: Any, x: Any, u: Any, p: Mapping[str, Any]) -> np.ndarray:
        values = {k: p[k] for k in block.parameters}
        results = block(*u, *x[: len(block.states)], **values)
        signals = dict(zip(block.reads, u, strict=True))
        return np.array([*results[many:], *changes(block, results[:many], signals)])

    return Lanes(BareSystem(
        rates, lambda _t, x, _u, _p: x[len(block.states) :], inputs=block.reads, outputs=sums,
        states=(*block.states, *sums), params={k: x or 0.0 for k, x in block.defaults().items()},
        name=block.name,
    ))  # fmt: skip
