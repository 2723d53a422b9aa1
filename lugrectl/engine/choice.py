"""Chooses the engine of a net: all traced, with sampled blocks called, or all called."""

from __future__ import annotations

import warnings
import weakref
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..errors import InputError
from .called import Called
from .check import check
from .compiled import _default_keys, _fingerprint, _is_number, _token
from .graph import symbols_in
from .held import Held
from .net import Net
from .symbolic import TraceError


@dataclass(frozen=True)
class _Known:
    """A compiled net and the data it was made from."""

    blocks: tuple[weakref.ref, ...]
    fingerprint: Any
    overridden: frozenset[str]
    engine: Held

    def fits(self, net: Net, fingerprint: Any, given: Mapping[str, Any]) -> bool:
        """Whether only values of parameters differ, none of which was needed as a number."""
        flow = self.engine.hybrid.flow
        numbers = {k for k, v in given.items() if _is_number(v)}
        return (
            self.fingerprint == fingerprint
            and [ref() for ref in self.blocks] == [part.block for part in net.parts]
            and self.overridden <= numbers <= {*flow.keys, *flow.fixed}
            and all(_token(given.get(k, v)) == _token(v) for k, v in flow.fixed.items())
        )


_compiled: list[_Known] = []


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
    except TraceError:
        pass
    try:
        return Called(net, params), none
    except TraceError as error:
        warnings.warn(f"{error}; LSODA is used instead.", RuntimeWarning, stacklevel=5)
        return Called(net, params, "LSODA"), none


def compiled_net(net: Net, params: Mapping[str, Any] | None = None) -> Held:
    """The compiled net; that of an earlier call if only numbers have changed."""
    given = dict(params or {})
    others = tuple((k, _token(v)) for k, v in given.items() if not _is_number(v))
    wiring = tuple((part.inputs, part.outputs, part.group) for part in net.parts)
    fingerprint = (
        *(_fingerprint(part.block) for part in net.parts),
        *(wiring, net.outside, net.groups, net.earlier, others, net.name),
    )
    for entry in [e for e in _compiled if e.fits(net, fingerprint, given)]:
        try:
            for program, block in entry.engine.hybrid.checked:
                block._update_params(params)
                check(program, block, params, scales=(1.0,))
            return entry.engine
        except TraceError:  # something that a block reads outside its parameters has changed
            _compiled.remove(entry)
    held = Held(net, params)
    _no_unknown(net, held, given)
    blocks = tuple(weakref.ref(part.block) for part in net.parts)
    numbers = frozenset(k for k, v in given.items() if _is_number(v))
    _compiled[:] = [*_compiled[-7:], _Known(blocks, fingerprint, numbers, held)]
    return held


def _no_unknown(net: Net, held: Held, given: Mapping[str, Any]) -> None:
    flow, tick = held.hybrid.flow, held.hybrid.tick
    seen = symbols_in([*flow.xdot, *held.hybrid.y, *(tick.new_q + tick.new_h if tick else ())])
    read = {k for k, p in zip(flow.keys, flow.p, strict=True) if p.value in seen}
    known = read.union(flow.fixed, *(_default_keys(part.block) for part in net.parts))
    unknown = [k for k, v in given.items() if k not in known and _is_number(v)]
    if unknown:
        raise InputError(
            f"{net.name}: no block reads the parameter '{unknown[0]}'; "
            f"there are {', '.join(sorted(known)) or 'none'}."
        )
