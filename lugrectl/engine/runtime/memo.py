"""Compiled code, kept for the next call, and the check that it is still right."""

from __future__ import annotations

import threading
from collections.abc import Mapping
from typing import Any

from ...core.errors import InputError
from ..expression.graph import symbols_in
from ..tracing.equations import Program
from ..tracing.tracer import smooth_keys, traced
from ..tracing.verify import AGAIN, check
from .adaptive_run import Adaptive, chosen_backend

MOST = 200  # of each kind of compiled code that is kept
ALONE = threading.RLock()  # a system holds the parameters that it is asked with

_traced: dict[Any, Adaptive] = {}


def compiled(system: Any, params: Mapping[str, Any] | None = None) -> Adaptive:
    """The compiled system, as it is at this moment.

    Code of an earlier call serves again where the equations are the same: the system is
    :func:`described` as it was then, or a new trace of it gives them again. Whatever the
    functions of a user read, they read it again.
    """
    with ALONE:
        return _compiled(system, dict(params or {}))


def _compiled(system: Any, given: Mapping[str, Any]) -> Adaptive:
    from ..tracing.ingredients import described, numbers_alone  # it loads python-control

    backend, plain = chosen_backend(), None
    system._update_params(given)
    if numbers_alone(given):
        plain = described(system)
    known = (backend, frozenset(given), smooth_keys(system), plain)
    ready = None if plain is None else _traced.get(known)
    if ready is not None:
        return ready
    program = traced(system, given)
    sharp = program.sharpened(given)
    key = (backend, sharp.outline())
    before = _traced.get(key)
    check(program, system, given, *([AGAIN] if before else []))
    _no_unknown(system, program, given)
    engine = before.of(sharp) if before else Adaptive(sharp)
    keep(_traced, key, engine)
    if plain is not None and not program.fixed:
        keep(_traced, known, engine)
    return engine


def keep(kept: dict[Any, Any], key: Any, value: Any) -> None:
    """Enter a value as the youngest; the oldest go."""
    with ALONE:
        kept.pop(key, None)
        kept[key] = value
        for old in [*kept][:-MOST]:
            del kept[old]


def _no_unknown(system: Any, program: Program, given: Mapping[str, Any]) -> None:
    """python-control ignores a parameter that no block reads; here it is an error."""
    seen = symbols_in([*program.xdot, *program.y])
    read = {k for k, p in zip(program.keys, program.p, strict=True) if p.value in seen}
    known = read | set(program.fixed) | default_keys(system)
    unknown = [k for k, v in given.items() if k not in known and isinstance(v, (int, float))]
    if unknown:
        raise InputError(
            f"{system.name}: no block reads the parameter '{unknown[0]}'; "
            f"there are {', '.join(sorted(known)) or 'none'}."
        )


def default_keys(system: Any) -> set[str]:
    """The keys of all parameters that have a default."""
    own = set(system.params)
    return own.union(*(default_keys(block) for block in getattr(system, "syslist", ())))
