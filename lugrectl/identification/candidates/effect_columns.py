"""Every effect of the catalogue as columns: its own function along the measured motion.

An effect is linear in its strength, and in a phase after A f(x, phi) = A cos(phi) f(x, 0) +
A sin(phi) f(x, pi/2). What else it has is searched.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.sparse import csr_matrix

from ...blocks.block import Block
from .base_model import Base, Columns

AT_ONCE = 1_000_000  # numbers that a screening keeps at a time
FAR = 1e4  # rad from which single precision is too coarse for the highest orders


def searched(block: Block) -> list[str]:
    """The parameters in which the effect is not linear."""
    linear = (block.gain, spanned(block))
    return [k for k, p in block.own.items() if k not in linear and p.fitted]


def spanned(block: Block) -> str | None:
    """The phase or the rest, if it has one: two columns give any value of it."""
    return next((k for k, p in block.own.items() if p.span is not None), None)


def columns(
    base: Base, block: Block, values: Mapping[str, float], screening: bool = False
) -> Columns:
    """The columns of an effect for a strength of 1, with the bounds of its strength."""
    p, free = block.own[block.gain], spanned(block)
    one = {**values, block.gain: 1.0}
    if free is None:
        return Columns.free(column(base, block, one, screening)[:, None], p.low, p.high)
    span = block.own[free].span
    assert span is not None
    if block.own[free].angle:  # an amplitude with a phase may have either sign
        both = [column(base, block, {**one, free: x}, screening) for x in span]
        return Columns.free(np.column_stack(both))
    middle = float(np.mean(base.record.motion.theta))
    first = column(base, block, {**one, free: middle})
    second = column(base, block, {**one, free: middle + 1.0}) - first
    made = Columns.free(np.column_stack([first, second]))
    made.low[0], made.high[0] = p.low, p.high
    return made


def by_run(base: Base, made: Columns) -> Columns:
    """The same columns for each run alone: a position may count from another zero in each."""
    run = base.record.motion.run[base.record.rows.at]
    parts = [replace(made, X=made.X * (run == r)[:, None]) for r in np.unique(run)]
    return sum(parts[1:], parts[0])


def over(base: Base, block: Block, key: str, grid: np.ndarray) -> np.ndarray:
    """The columns of an effect for each value of a parameter, for screening: from fewer samples.

    They are in single precision. Those of one value are neighbours: (m, values) or, with a phase,
    (m, 2 values).
    """

    def make() -> np.ndarray:
        return _over(base, block, key, grid)

    if set(block.acts) <= {"torque"} and not {"u", "load"} & {*block.inputs}:
        return base.record.once(("over", block.name, key), None, make)
    if set(block.acts) <= {"input"}:
        return base.record.once(("over", block.name, key), base.u, make)
    return make()


def _over(base: Base, block: Block, key: str, grid: np.ndarray) -> np.ndarray:
    samples = len(base.record.motion) // base.record.fewer
    many = max(1, AT_ONCE // samples)
    parts = [grid[i : i + many] for i in range(0, len(grid), many)]
    return np.concatenate([_part(base, block, key, part) for part in parts], axis=1)


def _part(base: Base, block: Block, key: str, grid: np.ndarray) -> np.ndarray:
    free, view = spanned(block), _fewer(base, single=True)
    span = (None,) if free is None else block.own[free].span or ()
    made = []
    for x in span:
        own: dict[str, Any] = {block.gain: 1.0, key: grid[None, :].astype(view.kind)}
        own |= {} if free is None or x is None else {free: float(x)}
        made.append(_column(base, block, own, view))
    return np.stack(made, axis=2).reshape(len(made[0]), -1)


@dataclass(frozen=True, eq=False)
class _Samples:
    """Samples at which an effect is computed, and the operators that take them to the windows."""

    every: slice
    K: csr_matrix
    narrow: csr_matrix
    kind: type

    def of(self, x: np.ndarray) -> np.ndarray:
        """A signal (n,) as a column."""
        return x[self.every, None].astype(self.kind, copy=False)


def column(
    base: Base, block: Block, values: Mapping[str, Any], screening: bool = False
) -> np.ndarray:
    """The torque of an effect in the windows (m,), on the resisting side.

    ``screening``: from fewer samples.
    """
    record = base.record
    whole = _Samples(slice(None), record.rows.K, record.rows.narrow, float)
    return _column(base, block, values, _fewer(base) if screening else whole)[:, 0]


def _fewer(base: Base, single: bool = False) -> _Samples:
    record, every = base.record, slice(None, None, base.record.fewer)
    if single and np.abs(record.motion.theta).max() < FAR:
        return _Samples(every, *record.single, np.float32)
    return _Samples(every, *record.few, float)


def _column(base: Base, block: Block, values: Mapping[str, Any], view: _Samples) -> np.ndarray:
    """The same (m, k) for a value of shape (1, k)."""
    m, record = base.record.motion, base.record
    if "sensor" in block.acts:  # the true motion is the measured one without the error
        out = outputs(base, block, values)
        error = out[block.fresh.index("theta_m")][:, 0] - m.theta
        return np.asarray(record.rows.narrow @ m.bend(error)[:, None]) * -base.J
    out = outputs(base, block, values, view)
    torque, inertial = [], []
    seen: set[int] = set()
    for act, change in block.deeds(out):
        if act == "input":
            torque.append(view.of(base.u) - change)
        elif act == "torque":
            torque.append(change)
        elif act == "J":
            inertial.append(change * view.of(base.J * record.motion.stiff))
        elif act == "Fv":
            torque.append(change * view.of(base.viscous))
        elif id(change) not in seen:  # the levels of Coulomb and static friction move together
            seen.add(id(change))
            torque.append(_on_level(base, block, act, change, view))
    made = [view.K @ _whole(torque)] if torque else []
    made += [view.narrow @ _whole(inertial)] if inertial else []
    return made[0] + made[1] if len(made) > 1 else made[0]


def _whole(parts: Sequence[np.ndarray]) -> np.ndarray:
    """The sum of the parts, in an order in memory that suits the means."""
    total = parts[0]
    for part in parts[1:]:
        total = total + part
    return np.ascontiguousarray(total)


def _on_level(base: Base, block: Block, act: str, change: np.ndarray, view: _Samples) -> np.ndarray:
    if act.startswith("+"):
        return change * view.of(base.law.z)
    if block.abrupt:  # it jumps with the direction, and the bristle follows
        laws, law = base.record.laws, base.law
        follows = base.record.once("asymmetric", law, lambda: laws.asymmetric(law.x0))
        return view.of(follows * base.level)
    return change * view.of(base.coulomb)


def outputs(
    base: Base, block: Block, values: Mapping[str, Any], view: _Samples | None = None
) -> list[np.ndarray]:
    """What a block without states puts out along the motion, each (n, k) for values (1, k)."""
    m = base.record.motion
    view = view or _Samples(slice(None), base.record.rows.K, base.record.rows.narrow, float)
    signals = {"t": m.t, "theta": m.theta, "w": m.w, "u": base.u, "load": base.weight + m.d}
    shared = {k: base.J for k, p in block.parameters.items() if p.shared and k == "J"}
    made = block(*(view.of(signals[name]) for name in block.reads), **shared, **values)
    size = len(m.t[view.every])
    kept: dict[int, np.ndarray] = {}
    for o in made:
        x = np.asarray(o)
        wide = x.shape[1] if x.ndim == 2 else 1
        kept.setdefault(id(o), np.broadcast_to(x, (size, wide)))
    return [kept[id(o)] for o in made]
