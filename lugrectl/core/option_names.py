"""How a sentence names an option: ``option("units", "t=ms")`` is ``--units t=ms`` while the command
line runs, and ``units="t=ms"`` otherwise.
"""

from __future__ import annotations

import shlex
from collections.abc import Iterator
from contextlib import contextmanager

_CALLS = {"blocks": "lg.load_blocks"}  # options in place of which Python has a function
_at = {"command line": False}  # of the process: a thread speaks as what began it


@contextmanager
def on_command_line() -> Iterator[None]:
    """Let sentences name options as they are typed, as long as this lasts."""
    before, _at["command line"] = _at["command line"], True
    try:
        yield
    finally:
        _at["command line"] = before


def speak_as(typed: bool) -> None:
    """The same for all of a process, one that the command line began."""
    _at["command line"] = typed


def is_typed() -> bool:
    """Whether options are typed: the command line runs."""
    return _at["command line"]


def option(name: str, value: str = "") -> str:
    """An option by the name of its argument, with its value if one is given. Numbers and words in
    capitals stand for themselves; Python quotes other values, a shell those with spaces."""
    if is_typed():
        plain = not value or shlex.quote(value) == value
        shown = value if plain else f'"{value}"'
        return f"--{name.replace('_', '-')} {shown}".rstrip()
    bare = value.isupper() or value.replace(".", "", 1).isdecimal()
    shown = value if bare else f'"{value}"'
    if name in _CALLS:
        return f"{_CALLS[name]}({shown})" if value else _CALLS[name]
    return f"{name}={shown}" if value else name
