"""The base class of all verdicts: truth value, summary, printing."""

from __future__ import annotations

import html
from collections.abc import Sequence
from dataclasses import fields
from typing import Any


class Verdict:
    """Base of the frozen verdict dataclasses; truthy when the property holds."""

    def summary(self) -> dict[str, Any]:
        """Plain Python: ``holds`` and every field; a complex number becomes [re, im]."""
        values = {f.name: _plain(getattr(self, f.name)) for f in fields(self)}  # type: ignore
        return {"holds": bool(self), **values}

    def __str__(self) -> str:
        rows = self.summary().items()
        return "\n".join([type(self).__name__, *(f"  {name}: {_text(v)}" for name, v in rows)])

    def _repr_html_(self) -> str:
        return f"<pre>{html.escape(str(self))}</pre>"


def _plain(value: Any) -> Any:
    if isinstance(value, tuple):
        return [_plain(v) for v in value]
    return [value.real, value.imag] if isinstance(value, complex) else value


def _text(value: Any) -> str:
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def show_poles(poles: Sequence[complex]) -> str:
    """Poles in 1/s in one line, a complex pair once."""
    one_each = [p for p in poles if p.imag >= 0]
    return ", ".join(
        f"{p.real:+.4g} +- {p.imag:.4g}j" if p.imag else f"{p.real:+.4g}" for p in one_each
    )
