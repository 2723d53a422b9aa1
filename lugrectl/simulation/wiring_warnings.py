"""What looks wrong about a wiring: an input that nothing feeds, a feedback of the wrong sign."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from scipy.linalg import block_diag

from ..core.validation import nearest
from ..engine.tracer import Net

OPTIONAL = ("d",)  # a load: 0 is what is usually meant
AT = (1e-2, 1.0, 1e2, 1e4)  # 1/s: points of the positive real axis
TINY = 1e-6  # step of the differences


def warn_of_wiring(net: Net, given: Any, params: Mapping[str, Any] | None) -> None:
    """Warn of inputs that nothing feeds in a list of blocks, and of feedback of the wrong sign."""
    if net.alone:
        system = net.parts[0].block
        if net.looped:
            matrix = np.asarray(system.connect_map, dtype=float)
            _warn_of_sign(net.name, list(system.syslist), matrix, params)
        return
    if isinstance(given, Mapping):
        for label in net.outside:
            if label not in given and label not in OPTIONAL and (said := _unfed(net, label)):
                warnings.warn(said, RuntimeWarning, stacklevel=4)
    _warn_of_sign(net.name, [part.block for part in net.parts], net.connect, params)


def _unfed(net: Net, label: str) -> str:
    """The warning on an input that nothing feeds; empty where no output is left over for it."""
    readers = ", ".join(part.block.name for part in net.parts if label in part.inputs)
    read = {k for part in net.parts for k in part.inputs}
    idle = []
    for part in net.parts:
        declared = _declared(part.block)
        # an observer is often only watched
        watched = declared is not None and declared.kind == "observer" and label[:1] != "F"
        if part.outputs and not read & {*part.outputs} and label not in part.inputs and not watched:
            idle.append(f"{', '.join(part.outputs)} of {part.block.name}")
    near = nearest(label, [k for k in net.signals if k not in read])
    if near is not None:
        hint = f"Did you mean {near} of {net.makers(near)}?"
    elif idle:
        hint = f"Nothing reads {'; '.join(idle)}: is it meant?"
    else:
        return ""
    return (
        f"{net.name}: nothing feeds the input {label} of {readers}; it is 0. {hint} Give "
        f"inputs={{'{label}': 0}} if 0 is meant."
    )


def _declared(block: Any) -> Any:
    """The declaration of a block of this package, of the continuous one where it is sampled."""
    return getattr(_continuous(block).outfcn, "block", None)


def _continuous(block: Any) -> Any:
    return getattr(getattr(block.outfcn, "step", None), "system", block)


def _warn_of_sign(
    name: str, blocks: Sequence[Any], matrix: np.ndarray, params: Mapping[str, Any] | None
) -> None:
    """Warn where an error e that rises makes itself rise further.

    v = matrix y are the inputs of all blocks, y their outputs. For each controller that reads e,
    the loop is cut there; its gain on the positive real axis must not be positive.
    """
    entries = np.cumsum([0, *(block.ninputs for block in blocks)])
    for i, block in enumerate(blocks):
        made = _declared(block)
        if made is None or made.kind != "controller" or "e" not in made.inputs:
            continue
        row = entries[i] + made.inputs.index("e")
        if _plainly_right(block, blocks, matrix, row, params):
            continue
        gains, others = [], [k for k in range(len(matrix)) if k != row]
        try:
            for s in AT:  # what arrives at this input for 1 put in there
                H = matrix @ block_diag(*(_gain(each, s, params) for each in blocks))
                rest = np.eye(len(others)) - H[np.ix_(others, others)]
                reached = np.linalg.solve(rest, H[others, row])
                gains.append(float(H[row, row] + H[row, others] @ reached))
        except Exception:  # a block that cannot be evaluated at rest is reported by the simulation
            continue
        if all(np.isfinite(gain) and gain > 0.0 for gain in gains):
            warnings.warn(
                f"{name}: the feedback through {block.name} has the wrong sign: it drives the "
                "error away from zero. The controllers here act on e = measured - reference "
                "(lugrectl.error) with positive gains.",
                RuntimeWarning,
                stacklevel=5,
            )


def _plainly_right(
    block: Any, blocks: Sequence[Any], matrix: np.ndarray, row: int, params: Any
) -> bool:
    """Whether e comes from ``error`` of a signal that a block measures, with no negative gain."""
    values = {**block.params, **(params or {})}
    gains = [values[k] for k in block.params if k.rpartition(".")[2] in ("kp", "ki", "kd")]
    ends = np.concatenate([[i] * b.noutputs for i, b in enumerate(blocks)]).astype(int)
    sources = np.flatnonzero(matrix[row])
    if len(sources) != 1 or matrix[row, sources[0]] < 0 or not all(g >= 0 for g in gains):
        return False
    source = int(ends[sources[0]])
    made = _declared(blocks[source])
    first = sum(b.ninputs for b in blocks[:source])
    return (
        made is not None
        and made.name == "error"
        and not matrix[first].any()
        and bool((matrix[first + 1] >= 0).all() and matrix[first + 1].any())
    )


def _gain(block: Any, s: float, params: Any) -> np.ndarray:
    """C (s - A)^-1 B + D of a block at rest, in discrete time at exp(s dt)."""
    block = _continuous(block)
    n, m = int(block.nstates or 0), int(block.ninputs)

    def values(at: np.ndarray) -> np.ndarray:
        given = (0.0, at[:n], at[n:], params)
        rates = block.dynamics(*given) if n else np.zeros(0)
        return np.concatenate([np.ravel(rates), np.ravel(block.output(*given))])

    steps = TINY * np.eye(n + m)
    J = np.array([(values(h) - values(-h)) / (2 * TINY) for h in steps]).T
    A, B, C, D = J[:n, :n], J[:n, n:], J[n:, :n], J[n:, n:]
    at = np.exp(min(s * float(block.dt), 50.0)) if block.isdtime(strict=True) else s
    return D + C @ np.linalg.solve(at * np.eye(n) - A, B) if n else D
