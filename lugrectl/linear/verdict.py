"""The base class of all verdicts: truth value, summary, printing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields
from typing import Any, Self

from ..core.result import Result


class Verdict(Result):
    """Base of the frozen verdict dataclasses; truthy when the property holds."""

    _source: Any = None

    def summary(self) -> dict[str, Any]:
        """Plain Python: ``holds`` and every field; a complex number becomes [re, im]."""
        values = {f.name: _plain(getattr(self, f.name)) for f in fields(self)}  # type: ignore
        return {"holds": bool(self), **values}

    def of(self, source: Any) -> Self:
        """The verdict, which remembers what was checked, for :meth:`plot`."""
        object.__setattr__(self, "_source", source)
        return self

    def __str__(self) -> str:
        rows = [f"  {row.name}: {row.text()}" for row in self._rows()]
        return "\n".join([self._title(), *rows])

    def _title(self) -> str:
        return f"{type(self).__name__}: {'holds' if self else 'does not hold'}"


def _plain(value: Any) -> Any:
    if isinstance(value, tuple):
        return [_plain(v) for v in value]
    return [value.real, value.imag] if isinstance(value, complex) else value


def show_poles(poles: Sequence[complex]) -> str:
    """Poles in 1/s in one line, a complex pair once."""
    one_each = [p for p in poles if p.imag >= 0]
    return ", ".join(
        f"{p.real:+.4g} +- {p.imag:.4g}j" if p.imag else f"{p.real:+.4g}" for p in one_each
    )
