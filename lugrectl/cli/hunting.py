"""``lugrectl hunt``: the friction limit cycles of a loop, or their absence."""

from __future__ import annotations

import sys
from argparse import Namespace
from dataclasses import replace
from math import isfinite
from typing import Any

from ..core.errors import InputError, Refused
from .plotting import answered, format_of

EXIT = {"rests": 0, "hunts": 1, "undecided": 3}


def hunt(a: Namespace) -> int:
    """0 where every start comes to rest, 1 where one does not, 3 where it is undecided; with
    ``--speed`` 0 where both speeds are known."""
    kind = format_of(a.plot)
    gains = {k: getattr(a, k) for k in ("kp", "ki", "kd", "kv")}
    given = {k: getattr(a, k) for k in ("rate", "dead_time", "counts", "limit", "time_limit")}
    vary = dict(map(_range, a.vary)) if a.vary else None
    moving = _moving(a, gains, vary) if a.speed else None
    vary = None if moving else vary
    found = _over(a, gains | given, vary) if a.report else _of_model(a, gains | given, vary)
    found = replace(found, stick_slip=moving) if moving else found
    answered(moving or found, a, kind, found.to_json() if a.json else repr(found))
    return int(not isfinite(moving.speed_end)) if moving else EXIT[found.outcome]


def _moving(a: Namespace, gains: dict[str, Any], vary: Any) -> Any:
    """Below which speeds the loop sticks and slips."""
    from ..blocks.model import read_model
    from ..hunting import stick_slip_speed
    from .progress import Bar

    if a.report:
        raise InputError("--speed is for one drive: give --model instead of --report.")
    if a.rate or a.dead_time or a.counts or a.limit:
        raise Refused(
            "--speed is answered for a loop in continuous time without a limit: leave out --rate, "
            "--dead-time, --counts and --limit."
        )
    with Bar(sys.stderr) as bar:
        return stick_slip_speed(read_model(a.model), **gains, vary=vary, progress=bar)


def _of_model(a: Namespace, loop: dict[str, Any], vary: Any) -> Any:
    from ..blocks.model import read_model
    from ..hunting import limit_cycles
    from .progress import Bar

    with Bar(sys.stderr) as bar:
        return limit_cycles(read_model(a.model), **loop, vary=vary, progress=bar)


def _over(a: Namespace, loop: dict[str, Any], vary: Any) -> Any:
    """The chance of hunting over the drives that a report leaves possible."""
    from ..bench import hunting_chance
    from .progress import Bar

    if vary:
        raise InputError("--vary is for one drive: give --model instead of --report.")
    with Bar(sys.stderr) as bar:
        return hunting_chance(a.report, members=a.members, progress=bar, **loop)


def _range(text: str) -> tuple[str, tuple[float, float]]:
    """ "ki=1:50" as ("ki", (1, 50))."""
    name, _, ends = text.partition("=")
    try:
        low, high = map(float, ends.split(":"))
    except ValueError:
        raise InputError(
            f"--vary is '{text}', but a gain and its ends are needed, such as ki=1:50."
        ) from None
    return name.strip(), (low, high)
