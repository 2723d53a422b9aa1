"""The base class of all verdicts: truth value, summary, printing."""

from __future__ import annotations

import math
import re
from dataclasses import fields
from typing import Any, NamedTuple, Self

from ..core.result import Result

PER_SAMPLE = {"rad/s": "rad/sample", "1/s": "1/sample", "s": "samples"}
SECONDS = re.compile(r"(?<=\d )(rad/s|1/s|s)\b|rad/s\b")
NO_RATE = "; per sample, as T has no stated sample time: give its dt for rad/s and Hz"


class Verdict(Result):
    """Base of the frozen verdict dataclasses; truthy when the property holds."""

    reason: str
    _source: Any = None

    def summary(self) -> dict[str, Any]:
        """Plain Python: ``holds`` and every field; a complex number becomes [re, im]."""
        values = {f.name: _plain(getattr(self, f.name)) for f in fields(self)}  # type: ignore
        return {"holds": bool(self), **values}

    def of(self, source: Any) -> Self:
        """The verdict, which remembers what was checked, for :meth:`plot`.

        Without a stated sample time (dt is True) it is per sample.
        """
        object.__setattr__(self, "_source", source)
        if getattr(source, "dt", None) is True:
            self._per_sample()
        return self

    def _per_sample(self) -> None:
        units = {
            k: PER_SAMPLE[u] for k, u in self._units.items() if u in PER_SAMPLE and k != "gain"
        }
        reason = SECONDS.sub(lambda unit: PER_SAMPLE[unit[0]], self.reason)
        object.__setattr__(self, "_units", units)
        object.__setattr__(self, "reason", reason.rstrip(".") + NO_RATE)

    def __str__(self) -> str:
        rows = [f"  {row.name}: {row.text()}" for row in self._rows()]
        return "\n".join([self._title(), *rows])

    def _title(self) -> str:
        return f"{type(self).__name__}: {'holds' if self else 'does not hold'}"


def _plain(value: Any) -> Any:
    if isinstance(value, tuple):
        return [_plain(v) for v in value]
    return [value.real, value.imag] if isinstance(value, complex) else value


class Realness(NamedTuple):
    """The kind of T ("SPR", "WSPR", "PR", "not PR"), why, its band edge and its margin;
    ``rounded``: floating point cannot tell it from a neighbour."""

    kind: str
    reason: str
    edge: float = math.inf
    margin: float = 0.0
    rounded: bool = False


class Margin(NamedTuple):
    """A margin, and its frequency in rad/s (nan where there is none)."""

    value: float = math.inf
    at: float = math.nan


NONE, UNKNOWN = Margin(), Margin(math.nan)
