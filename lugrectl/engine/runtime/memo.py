"""Compiled code, kept for the next call, and the check that it is still right."""

from __future__ import annotations

import threading
from collections.abc import Mapping
from typing import Any

from ...core.errors import InputError
from ..expression.graph import symbols_in
from ..tracing.ingredients import described, is_number, numbers_alone
from ..tracing.network import Net
from ..tracing.tracer import Hybrid, smooth_keys, traced_net
from ..tracing.verify import AGAIN
from .adaptive_run import Adaptive, chosen_backend
from .sampled_run import Held

MOST = 400  # compiled codes that are kept
ALONE = threading.RLock()  # a system holds the parameters that it is asked with

_traced: dict[Any, Adaptive] = {}


def compiled(net: Net, params: Mapping[str, Any] | None = None) -> Adaptive:
    """The compiled net, as it is at this moment: :class:`Held`, where it has sampled blocks.

    Code of an earlier call serves again where the equations are the same: the blocks are
    :func:`described` as they were then, or a new trace of them gives the same equations again.
    Whatever the functions of a user read, they read it again.
    """
    with ALONE:
        given, blocks = dict(params or {}), [part.block for part in net.parts]
        for block in blocks:
            block._update_params(given)
        backend = None if net.groups else chosen_backend()
        plain = tuple(map(described, blocks)) if numbers_alone(given) else (None,)
        widths = frozenset[str]().union(*map(smooth_keys, blocks))
        known = (backend, frozenset(given), widths, net.wiring, plain)
        ready = None if None in plain else _traced.get(known)
        if ready is not None:
            return ready
        hybrid = traced_net(net, given)
        sharp = hybrid.sharpened(given)
        key = (backend, sharp.outline())
        before = _traced.get(key)
        hybrid.check(given, *([AGAIN] if before else []))
        _no_unknown(hybrid, given)
        engine = made_of(sharp, backend) if before is None else before.of(sharp)
        _keep(key, engine)
        if None not in plain and not hybrid.flow.fixed:
            _keep(known, engine)
        return engine


def made_of(hybrid: Hybrid, backend: str | None) -> Adaptive:
    """The code of equations."""
    return Adaptive(hybrid.flow, backend) if hybrid.tick is None else Held(hybrid, backend)


def _keep(key: Any, value: Adaptive) -> None:
    """Enter a value as the youngest; the oldest go."""
    _traced.pop(key, None)
    _traced[key] = value
    for old in [*_traced][:-MOST]:
        del _traced[old]


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
