"""Pieces of reStructuredText."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Iterable, Sequence
from pathlib import Path
from string import Template

_TEMPLATES = Path(__file__).parents[1] / "templates"
_LITERAL = re.compile(r"(``.+?``|:\w+:`[^`]+`|^ *>>> .*(?:\n.*\S.*)*)", re.M)


def filled(template: str, /, **parts: str) -> str:
    """A page of a template; runs of empty lines, where a part is empty, become one."""
    text = Template((_TEMPLATES / f"{template}.rst").read_text("utf-8")).substitute(parts)
    return re.sub(r"\n{3,}", "\n\n", text).strip("\n") + "\n"


def escaped(text: str) -> str:
    """Plain text in which no character is markup."""
    return re.sub(r"([\\*`|]|_(?!\w))", r"\\\1", text)


def prose(text: str) -> str:
    """Text of a docstring: its roles, literals and examples stay, all else is no markup."""
    parts = _LITERAL.split(text)
    return "".join(p if i % 2 else escaped(p) for i, p in enumerate(parts))


def title(text: str, line: str = "=") -> str:
    return f"{text}\n{line * max(len(text), 3)}"


def literal(text: str, language: str = "text") -> str:
    return f".. code-block:: {language}\n\n{textwrap.indent(text.rstrip(), '   ')}"


def table(head: Sequence[str], rows: Iterable[Sequence[str]], widths: str = "auto") -> str:
    """A table of cells that are markup already; empty without rows."""
    lines = [_row(cells) for cells in rows]
    if not lines:
        return ""
    start = f".. list-table::\n   :header-rows: 1\n   :widths: {widths}\n"
    return "\n".join([start, _row(head), *lines])


def _row(cells: Sequence[str]) -> str:
    rows = [textwrap.indent(cell or "\\-", "       ")[7:] for cell in cells]
    return "\n".join(f"   {'* -' if i == 0 else '  -'} {cell}" for i, cell in enumerate(rows))


def code(text: str) -> str:
    """A literal inside a line."""
    return f"``{text}``" if text else ""


def listed(names: Iterable[str]) -> str:
    return ", ".join(names)


def toctree(names: Iterable[str], options: str = ":hidden:") -> str:
    lines = "\n".join(f"   {name}" for name in names)
    return f".. toctree::\n   {options}\n\n{lines}"
