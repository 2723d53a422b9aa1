"""Chooses the engine of a net: all traced, with sampled blocks called, or all called."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from typing import Any

import numpy as np

from ...core.errors import InputError
from ..expression.graph import symbols_in
from ..expression.numpy_protocol import TraceError
from ..tracing.ingredients import described, is_number, numbers_alone
from ..tracing.network import Net
from ..tracing.network_equations import Hybrid, traced_net
from ..tracing.tracer import smooth_keys
from ..tracing.verify import AGAIN
from .interpreted_run import Called
from .memo import ALONE, default_keys, keep
from .sampled_run import Held

_compiled: dict[Any, Held] = {}


def engine(
    net: Net, params: Mapping[str, Any] | None = None, method: str | None = None
) -> tuple[Held | Called, np.ndarray]:
    """The engine of a net and its parameter vector.

    If a continuous block cannot be traced, LSODA integrates all of them, with a warning that
    names the block. A sampled block that cannot be traced is called at its updates.
    """
    none = np.zeros(0)
    if method not in (None, "rosenbrock"):
        return Called(net, params, method), none
    try:
        held = compiled_net(net, params)
        return held, held.hybrid.flow.arguments(params)
    except TraceError as error:
        why = str(error)
    try:
        return Called(net, params, why=why), none
    except TraceError as error:
        why = str(error)
        warnings.warn(f"{why}; LSODA is used instead.", RuntimeWarning, stacklevel=5)
        return Called(net, params, "LSODA", why=why), none


def compiled_net(net: Net, params: Mapping[str, Any] | None = None) -> Held:
    """The compiled net, as it is at this moment; kept as by :func:`.memo.compiled`."""
    with ALONE:
        return _found(net, dict(params or {}))


def _found(net: Net, given: Mapping[str, Any]) -> Held:
    plain = _described(net, given) if numbers_alone(given) else None
    smooth = frozenset[str]().union(*(smooth_keys(part.block) for part in net.parts))
    known = (frozenset(given), smooth, plain)
    ready = None if plain is None else _compiled.get(known)
    if ready is not None:
        return ready
    hybrid = traced_net(net, given)
    sharp = hybrid.sharpened(given)
    key = sharp.outline()
    before = _compiled.get(key)
    hybrid.check(given, *([AGAIN] if before else []))
    _no_unknown(net, hybrid, given)
    held = before.of(sharp) if before else Held(sharp)
    keep(_compiled, key, held)
    if plain is not None and not hybrid.flow.fixed:
        keep(_compiled, known, held)
    return held


def _described(net: Net, params: Mapping[str, Any] | None) -> Any:
    """As :func:`.ingredients.described`."""
    for part in net.parts:
        part.block._update_params(params)
    blocks = tuple(described(part.block) for part in net.parts)
    return None if None in blocks else (blocks, net.wiring)


def _no_unknown(net: Net, hybrid: Hybrid, given: Mapping[str, Any]) -> None:
    flow, tick = hybrid.flow, hybrid.tick
    seen = symbols_in([*flow.xdot, *hybrid.y, *(tick.new_q + tick.new_h if tick else ())])
    read = {k for k, p in zip(flow.keys, flow.p, strict=True) if p.value in seen}
    known = read.union(flow.fixed, *(default_keys(part.block) for part in net.parts))
    unknown = [k for k, v in given.items() if k not in known and is_number(v)]
    if unknown:
        raise InputError(
            f"{net.name}: no block reads the parameter '{unknown[0]}'; "
            f"there are {', '.join(sorted(known)) or 'none'}."
        )
