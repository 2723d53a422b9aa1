"""What a system consists of, where nothing in it can change without being seen."""

from __future__ import annotations

import threading
from collections.abc import Mapping
from typing import Any

import control as ct
import numpy as np

from ..core.block_system import PICKLED, own_functions
from ..core.errors import InputError
from .adaptive_run import Engine, chosen_backend
from .graph import symbols_in
from .tracer import (
    AGAIN,
    Differs,
    Hybrid,
    Net,
    check,
    is_number,
    single,
    smooth_keys,
    traced_net,
)

PLAIN = (*PICKLED, ct.LinearICSystem)


def described(system: Any, *, by_trace: bool = True) -> Any:
    """All that decides what a system does, as a hashable value; None where it cannot be known.

    Of blocks of this package and of matrices it is known at once. A function of a user may read
    anything: such a block is described by the equations that a trace of it gives now, or not at
    all without ``by_trace``. TraceError for a block that keeps values between calls.
    """
    if type(system) not in PLAIN or "_rhs" in vars(system) or "_out" in vars(system):
        return None
    if not all(map(is_number, system.params.values())):
        return None
    inside = _inside(system, by_trace)
    if inside is None:
        return None
    labels = (system.input_labels, system.output_labels, system.state_labels)
    values = np.array([float(v) for v in system.params.values()]).tobytes()
    params = (tuple(system.params), values)
    return type(system), system.name, system.dt, *map(tuple, labels), params, inside


def _inside(system: Any, by_trace: bool) -> Any:
    if isinstance(system, ct.InterconnectedSystem):
        parts = [described(block, by_trace=by_trace) for block in system.syslist]
        parts += map(_array, (system.connect_map, system.input_map, system.output_map))
    elif isinstance(system, ct.StateSpace):
        matrices = (system.A, system.B, system.C, system.D)
        parts = [_array(m) for m in matrices] if own_functions(system) else [None]
    else:
        functions, parts = [system.updfcn] if system.nstates else [], []
        for function in (*functions, system.outfcn):  # of this package, and the systems in it
            ours = str(type(function).__module__).startswith("lugrectl.")
            systems = function.rests_on() if ours and hasattr(function, "rests_on") else None
            inside = [described(one, by_trace=False) for one in systems or ()]
            if systems is None or None in inside:
                return _equations(system) if by_trace else None
            parts.append((function, *inside))
    return None if None in parts else tuple(parts)


def _equations(block: Any) -> Any:
    """What a trace of a single block gives, compared with the block itself."""
    try:
        program = single(block)
        check(program, block, AGAIN)
    except Differs:  # by itself: among other blocks an even number of calls may hide it
        raise
    except Exception:  # the trace of the whole says which block, and why
        return None
    return None if program.fixed else program.outline()


def _array(value: Any) -> Any:
    array = np.asarray(value)
    return (array.shape, array.dtype.str, array.tobytes()) if array.dtype.kind in "biuf" else None


MOST = 400  # compiled codes that are kept
ALONE = threading.RLock()  # a system holds the parameters that it is asked with

_traced: dict[Any, Engine] = {}


def compiled(net: Net, params: Mapping[str, Any] | None = None) -> Engine:
    """The compiled net, as it is now: code of an earlier call, where the blocks are
    :func:`described` as they were then, or a new trace gives the same equations again."""
    with ALONE:
        given, blocks = dict(params or {}), [part.block for part in net.parts]
        for block in blocks:
            block._update_params(given)
        backend = None if net.groups else chosen_backend()
        numbers = all(map(is_number, given.values()))
        plain = tuple(map(described, blocks)) if numbers else (None,)
        widths = frozenset[str]().union(*map(smooth_keys, blocks))
        known = (backend, frozenset(given), widths, net.wiring, plain)
        ready = None if None in plain else _traced.get(known)
        if ready is not None:
            return ready
        hybrid = traced_net(net, given)
        sharp = hybrid.sharpened(given)
        key = (backend, sharp.outline())
        before = _traced.get(key)
        hybrid.check(*([AGAIN] if before else []))
        _no_unknown(hybrid, given)
        engine = Engine(sharp, backend) if before is None else before.of(sharp)
        steady = None not in plain and not hybrid.flow.fixed
        for kept in (key, known) if steady else (key,):
            _traced.pop(kept, None)  # it is the youngest; the oldest go
            _traced[kept] = engine
        for old in [*_traced][:-MOST]:
            del _traced[old]
        return engine


def _no_unknown(hybrid: Hybrid, given: Mapping[str, Any]) -> None:
    """python-control ignores a parameter that no block reads; here it is an error."""
    flow = hybrid.flow
    seen = symbols_in([*flow.xdot, *flow.y, *hybrid.ticked])
    read = {k for k, p in zip(flow.keys, flow.p, strict=True) if p.value in seen}
    known, systems = read.union(flow.fixed), [part.block for part in hybrid.net.parts]
    while systems:  # the keys of all parameters that have a default
        system = systems.pop()
        known |= {*system.params}
        systems += getattr(system, "syslist", ())
    unknown = [k for k, v in given.items() if k not in known and is_number(v)]
    if unknown:
        raise InputError(
            f"{hybrid.net.name}: no block reads the parameter '{unknown[0]}'; "
            f"there are {', '.join(sorted(known)) or 'none'}."
        )
