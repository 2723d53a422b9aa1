"""The command line, from its own parser."""

from __future__ import annotations

import argparse

from lugrectl.cli.options import parser

from .rst import code, filled, literal, prose, table, title

_TITLES = {"positional arguments": "argument"}


def pages() -> dict[str, str]:
    """One page for all commands."""
    top = parser()
    commands = next(a for a in top._actions if isinstance(a, argparse._SubParsersAction))
    said = {c.dest: c.help or "" for c in commands._choices_actions}
    rows = [(f":ref:`{k} <command-{k}>`", prose(said[k])) for k in commands.choices]
    sections = [_section(k, one) for k, one in commands.choices.items()]
    return {
        "command": filled(
            "topic",
            title=title("Command line"),
            table=f"{prose(top.description or '')}\n\n{prose(top.epilog or '')}",
            more=table(("command", "what it does"), rows, "20 80"),
            entries="\n\n".join(sections),
        )
    }


def _section(name: str, command: argparse.ArgumentParser) -> str:
    usage = command.format_usage().removeprefix("usage: ").replace(f"\n{' ' * 7}", "\n")
    parts = [f".. _command-{name}:", title(f"lugrectl {name}", "-")]
    parts += [prose(command.description or ""), literal(usage)]
    for group in command._action_groups:
        shown = [a for a in group._group_actions if a.help != argparse.SUPPRESS]
        rows = [(_names(a), prose(_help(a))) for a in shown if a.dest != "help"]
        if rows and group.description:
            parts += [prose(group.description)]
        parts += (
            [table((_TITLES.get(group.title, "option"), "meaning"), rows, "35 65")] if rows else []
        )
    return "\n\n".join(filter(None, parts))


def _names(action: argparse.Action) -> str:
    value = action.metavar
    if value is None and action.choices and action.option_strings:
        value = "|".join(map(str, action.choices))
    if not action.option_strings:
        return code(str(value or action.dest))
    takes = "" if action.nargs == 0 or value is None else f" {value}"
    return ", ".join(code(f"{o}{takes}") for o in action.option_strings)


def _help(action: argparse.Action) -> str:
    said = action.help or ""
    if action.choices and not action.option_strings:
        return f"one of {', '.join(map(str, action.choices))}. {said}"
    return said
