"""``lugrectl bode --tune``: the gains that follow from a response, or from a model alone."""

from __future__ import annotations

import math
from argparse import Namespace
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from ..core.errors import InputError, Refused
from ..core.provenance import stamp
from .plotting import answered

if TYPE_CHECKING:
    from ..blocks.model import Model
    from ..commissioning import FrequencyResponse


def check_options(a: Namespace) -> None:
    """Raise InputError for options of --tune without it, and where there is nothing to do."""
    given = [k for k in ("ms", "bandwidth", "dead_time", "no_hunting") if getattr(a, k)]
    if given and not a.tune:
        raise InputError(f"--{given[0].replace('_', '-')} is for gains: use it with --tune.")
    if not a.records and not a.tune:
        raise InputError("give a record; without one, --tune P-PI gives the gains of the model.")


def with_gains(
    found: FrequencyResponse, a: Namespace, model: Model
) -> tuple[FrequencyResponse, Refused | None]:
    """The response with its gains, or with why there are none."""
    if not a.tune:
        return found, None
    try:
        return replace(found, gains=_tuned(found, a, model=model)), None
    except Refused as no:
        return replace(found, messages=(*found.messages, f"No gains: {no}")), no


def said_of(found: FrequencyResponse) -> str:
    return "\n".join(map(repr, [found, *([found.gains] if found.gains else [])]))


def of_model(a: Namespace, model: Model, kind: str | None) -> int:
    """Print the gains of a model, and draw them into a file."""
    found = stamp(_tuned(model, a, rate=a.rate), a.typed, [model])
    answered(found, a, kind, found.to_json() if a.json else repr(found))
    return 0


def _tuned(axis: Any, a: Namespace, **known: Any) -> Any:
    from ..commissioning import tune

    given = {"Ms": a.ms, "dead_time": a.dead_time}
    given["bandwidth"] = a.bandwidth and 2.0 * math.pi * a.bandwidth
    known |= {k: v for k, v in given.items() if v is not None}
    return tune(axis, a.tune, hunting=not a.no_hunting, **known)
