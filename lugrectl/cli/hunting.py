"""``lugrectl hunt``: the friction limit cycles of a loop, or their absence."""

from __future__ import annotations

import sys
from argparse import Namespace
from typing import Any

from ..core.errors import InputError
from .plotting import answered, format_of


def hunt(a: Namespace) -> int:
    """0 where there is no limit cycle, 1 where there is one or the loop diverges."""
    kind = format_of(a.plot)
    gains = {k: getattr(a, k) for k in ("kp", "ki", "kd", "kv")}
    sampled = {"rate": a.rate, "dead_time": a.dead_time, "counts": a.counts}
    vary = dict(map(_range, a.vary)) if a.vary else None
    found = _over(a, gains | sampled, vary) if a.report else _of_model(a, gains | sampled, vary)
    answered(found, a, kind, found.to_json() if a.json else repr(found))
    return 0 if found else 1


def _of_model(a: Namespace, loop: dict[str, Any], vary: Any) -> Any:
    from ..blocks.model import read_model
    from ..hunting import limit_cycles

    return limit_cycles(read_model(a.model), **loop, vary=vary)


def _over(a: Namespace, loop: dict[str, Any], vary: Any) -> Any:
    """The chance of hunting over the drives that a report leaves possible."""
    from ..compensated_loop import hunting_chance
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
