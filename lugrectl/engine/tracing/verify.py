"""Checks that a trace gives the same values as the system itself."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ...core.bare_system import BareSystem
from ..expression.numpy_protocol import TraceError
from .equations import Program
from .pointwise import Instant

if TYPE_CHECKING:
    import control as ct

AGAIN = (1.0, 30.0)  # for equations that were checked at all scales before
NEAR = 1e-11  # of the arguments: how far rounding may move them
POSITIVE = (1.0, 1e2, 1e4)  # where no other point gives a value: a root or a logarithm


class Differs(TraceError):
    """A trace does not give what the system itself gives."""


def check(
    program: Program,
    system: ct.NonlinearIOSystem | BareSystem,
    params: Mapping[str, Any] | None = None,
    scales: Sequence[float] = (1.0, 1e-3, 30.0, 0.1),
) -> None:
    """Compare a trace with the system's own functions at random points of these sizes.

    Raises TraceError if they differ: a function keeps internal state, draws random numbers, or
    computes something else for symbols than for numbers.
    """
    random = np.random.default_rng(len(program.graph.nodes))
    single = {k for k in program.keys if program.keys.count(k) == 1 and k not in program.fixed}
    compared = 0
    for scale, signed in [*((k, True) for k in scales), *((k, False) for k in POSITIVE)]:
        if compared and not signed:
            break
        pairs = zip(program.keys, program.arguments(params), strict=True)
        spread = 0.0 if scale == 1.0 else 0.2
        values = {k: v * (1 + spread * random.uniform(-1, 1)) for k, v in pairs if k in single}
        t = abs(scale * random.standard_normal())
        x, u = (scale * random.standard_normal(len(s)) for s in (program.x, program.u))
        x, u = (x, u) if signed else (np.abs(x), np.abs(u))
        own = _own(system, t, x, u, {**(params or {}), **values})
        if own is not None:
            p = program.arguments({**(params or {}), **values})
            ours = np.concatenate(program.values(t, x, u, p))
            compared += _compare(program, own, ours, (t, x, u, p))
    system._update_params(params)
    if not compared and program.xdot + program.y:
        raise TraceError(f"{program.name}: gives no finite value at any point that was tried")


def _own(system: Any, t: float, x: Any, u: Any, params: Mapping[str, Any]) -> np.ndarray | None:
    """The system's rates and outputs; None if there are none at this point.

    python-control reports some loops that have an answer as algebraic; these are evaluated
    block by block.
    """
    system._update_params(params)
    try:
        with np.errstate(all="ignore"):
            return np.concatenate([system._rhs(t, x, u), system._out(t, x, u)])
    except ArithmeticError:
        return None
    except RuntimeError:
        at = Instant(system)
    try:
        parts = at.inside_rates(system, t, x, u), at.inside_outputs(system, t, x, u)
        return np.concatenate(parts)
    except (RuntimeError, ArithmeticError, ValueError):
        return None


def _slack(program: Program, ours: np.ndarray, at: Sequence[Any]) -> np.ndarray:
    """What rounding may change, for each value by itself: its change with arguments changed by
    NEAR of their size, where large terms cancel."""
    random, slack = np.random.default_rng(0), np.full(len(ours), 1e-300)
    for _ in range(4):
        t, x, u, p = (a * (1 + NEAR * random.choice([-1.0, 1.0], np.shape(a))) for a in at)
        with np.errstate(all="ignore"):
            moved = np.concatenate(program.values(t, x, u, p))
            slack = np.fmax(slack, 10 * np.abs(moved - ours))
    return slack


def _compare(program: Program, own: np.ndarray, ours: np.ndarray, at: Sequence[Any]) -> bool:
    """Whether the point is usable: some value is finite."""
    bad = ~np.isclose(ours, own, rtol=1e-9, atol=0.0, equal_nan=True)
    if np.any(bad):
        slack = _slack(program, ours, at)
        bad = ~np.isclose(ours, own, rtol=1e-9, atol=slack, equal_nan=True)
    if np.any(bad):
        label = (program.states + program.outputs)[int(np.flatnonzero(bad)[0])]
        raise Differs(
            f"{program.name}: the traced equation of {label} differs from the system's own "
            "(does a block keep values between calls, or draw random numbers?)"
        )
    return bool(np.any(np.isfinite(own)))
