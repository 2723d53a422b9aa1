"""A parser whose complaints are one sentence, and the help of ``lugrectl`` itself."""

from __future__ import annotations

import argparse
import difflib
import math
import sys
import textwrap
from collections.abc import Mapping, Sequence
from typing import Any, NoReturn

from ..core.provenance import version
from .checks import joined

UNBUILT = ("compare", "plan", "export")  # commands that are announced
_EXAMPLE = """Example:
  lugrectl diagnose run.csv --model my.toml --out report"""


class Parser(argparse.ArgumentParser):
    """A parser whose complaints are one sentence, with what was probably meant."""

    _given: Sequence[str] = ()

    def parse_args(self, args: Any = None, namespace: Any = None) -> Any:
        found, left = self.parse_known_args(args, namespace)
        if left:
            found.parser.error(f"unrecognized arguments: {' '.join(left)}")
        return found

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        self._given = joined(sys.argv[1:] if args is None else args)
        return super().parse_known_args(self._given, namespace)

    def error(self, message: str) -> NoReturn:
        """Leave with code 2 after one sentence; no usage in front of it."""
        if "invalid choice" in message and (new := {*UNBUILT} & {*self._given[:1]}):
            said = f"{new.pop()} is not built yet; {self.prog} --help shows what there is.\n"
            self.exit(2, f"{self.prog}: error: {said}")
        typed, near = next(filter(None, map(self._meant, self._given)), ("", ""))
        hint = f" (did you mean {near}?)" if near else ""
        if "--model" in message and not hint:
            model = next((word for word in self._given if word.lower().endswith(".toml")), None)
            hint = " (lugrectl model > my.toml writes one to start from)"
            hint = f" (give --model {model})" if model else hint
        what = message.split(" (choose from")[0] if hint and "choose from" in message else message
        for action in self._actions if not near or "invalid choice" in message else ():
            what = _of_places(what, action)
        if "are required" in message and near:  # the option that is missing is the misspelt one
            what = f"there is no option {typed}"
        said = f"{what.removesuffix('.')}{hint}; {self.prog} --help shows what there is.\n"
        self.exit(2, f"{self.prog}: error: {said}")

    def _meant(self, word: str) -> tuple[str, str] | None:
        """A word that is no option, and no command, of this parser, and what it resembles."""
        known = list(self._option_string_actions)
        if not word.startswith("-"):
            known = [c for a in self._actions if not a.option_strings for c in a.choices or ()]
        typed, bare = word.partition("=")[0], {k.lstrip("-").lower(): k for k in known}
        near = difflib.get_close_matches(typed.lstrip("-").lower(), bare, 1)
        return (typed, bare[near[0]]) if near and typed not in known else None


def _of_places(what: str, action: argparse.Action) -> str:
    """A complaint about the place of a command or property, in words, and with its choices."""
    if action.option_strings or not action.choices:
        return what
    name = str(action.metavar or action.dest)
    what = what.replace(f"argument {name}: invalid choice:", f"there is no {name.lower()}")
    missing = f"required: {name}"
    return what.replace(missing, f"{missing} ({', '.join(map(str, action.choices))})")


class Version(argparse.Action):
    """The installed version, looked up only when it is asked for."""

    def __init__(self, option_strings: Any, dest: str, **options: Any) -> None:
        super().__init__(option_strings, dest, nargs=0, **options)

    def __call__(self, parser: argparse.ArgumentParser, *_: Any) -> None:
        print(f"lugrectl {version()}")
        parser.exit(0)


def overview(top: Parser, groups: Mapping[str, Mapping[str, str]]) -> str:
    """The text of ``lugrectl --help``: what each command does, in groups."""
    width = max(len(name) for commands in groups.values() for name in commands) + 4
    parts = ["usage: lugrectl COMMAND [options]", _filled(top.description)]
    for title, commands in groups.items():
        rows = [f"  {name:<{width - 2}}{what}" for name, what in commands.items()]
        parts.append("\n".join([f"{title}:", *rows]))
    options = "Options:\n  --help, -h  show this help\n  --version   show the version"
    return "\n\n".join([*parts, options, _EXAMPLE, _filled(top.epilog)]) + "\n"


def _filled(text: str | None) -> str:
    return textwrap.fill(text or "", 80, break_on_hyphens=False)


# --- types of options ----------------------------------------------------------------------


def finite(text: str) -> float:
    """A finite number."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise argparse.ArgumentTypeError(f"'{text}' is not a finite number")
    return value


def positive(text: str) -> float:
    """A finite number above 0."""
    if (value := finite(text)) <= 0:
        raise argparse.ArgumentTypeError(f"{text} is not above 0")
    return value


def share(text: str) -> float:
    """A number between 0 and 1."""
    value = positive(text)
    if value >= 1.0:
        raise argparse.ArgumentTypeError(f"{text} is not below 1; give a share such as 0.015.")
    return value


def seed(text: str, least: int = 0) -> int:
    """A whole number from 0 on."""
    if not text.isdecimal() or int(text) < least:
        raise argparse.ArgumentTypeError(f"'{text}' is not a whole number of at least {least}")
    return int(text)


def count(text: str) -> int:
    """A whole number from 1 on."""
    return seed(text, 1)
