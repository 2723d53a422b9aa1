"""The help of ``lugrectl`` itself: one line for each command, in groups."""

from __future__ import annotations

import argparse
import textwrap
from typing import Any

_GROUPS = {
    "On records": ("demo", "diagnose", "identify", "plot", "bode"),
    "On models": ("model", "check", "hunt", "assure"),
    "To look up": ("effects", "schema", "reproduce"),
}
_REST = "More"
_EXAMPLE = """Example:
  lugrectl diagnose run.csv --model my.toml --out report"""


def overview(top: argparse.ArgumentParser, commands: Any) -> str:
    """The text of ``lugrectl --help``, from the parser and its action with the commands."""
    said = {c.dest: c.help or "" for c in commands._choices_actions}
    known = {name for names in _GROUPS.values() for name in names}
    groups = {**_GROUPS, _REST: tuple(name for name in said if name not in known)}
    width = max(map(len, said)) + 4
    parts = ["usage: lugrectl COMMAND [options]", _filled(top.description)]
    for title, names in groups.items():
        rows = [f"  {name:<{width - 2}}{said[name]}" for name in names if name in said]
        parts += ["\n".join([f"{title}:", *rows])] if rows else []
    options = "Options:\n  --help, -h  show this help\n  --version   show the version"
    return "\n\n".join([*parts, options, _EXAMPLE, _filled(top.epilog)]) + "\n"


def _filled(text: str | None) -> str:
    return textwrap.fill(text or "", 80, break_on_hyphens=False)
