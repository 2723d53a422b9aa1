"""The rooms of the package, the way of a record through them, and where to add what.

A page of the reference: ``python -m sphinx .docs reference``.
"""

from __future__ import annotations

import ast
import importlib
from pathlib import Path

import lugrectl

from .rst import code, filled, listed, prose, table, title

ROOT = Path(lugrectl.__file__).parent
WAY = (  # in the order in which `diagnose` comes to them
    "record.as_record.read_record",
    "record.uniform_time.stretches",
    "torque_balance.motion.Motion",
    "torque_balance.windows.Rows",
    "torque_balance.values.base_row",
    "torque_balance.search.Search",
    "torque_balance.table.Table",
    "torque_balance.verdict.Decision",
    "torque_balance.last_fit.LastFit",
    "torque_balance.verdict.answer",
    "diagnosis.simulation.polished",
    "diagnosis.simulation.errors",
    "report.text",
)
ADD = (  # what, in which room, how
    ("an effect, a friction law", "blocks", "one function with ``@block`` and its equation"),
    ("where its values are searched", "torque_balance", "``search`` reads its declaration"),
    ("an observer, a controller", "blocks", "one function; it is in all comparisons by its name"),
    (
        "a file format",
        "record",
        "a reader beside the others, or an entry point in ``lugrectl.readers``",
    ),
    ("a check of a linear system", "linear", "a function that returns a result with a picture"),
    ("a sentence of an answer", "diagnosis", "beside what it is about, once"),
    ("a number on which an answer depends", "the room that uses it", "with its meaning"),
)


def pages() -> dict[str, str]:
    """One page."""
    rooms = [(code(room), prose(_said(room)), listed(map(code, _uses(room)))) for room in _rooms()]
    way = [(str(i), code(name), prose(_of(name))) for i, name in enumerate(WAY, 1)]
    more = [title("The way of a record", "-"), table(("", "function", "what it does"), way)]
    more += [title("Where to add what", "-"), table(("what", "room", "how"), ADD)]
    return {
        "architecture": filled(
            "topic",
            title=title("Architecture"),
            table=table(("room", "what is in it", "rooms that it uses"), rooms, "20 45 35"),
            more="\n\n".join(more),
            entries="",
        )
    }


def _rooms() -> list[str]:
    folders = [p.parent for p in sorted(ROOT.rglob("__init__.py")) if p.parent != ROOT]
    names = [".".join(p.relative_to(ROOT).parts) for p in folders]
    return [n for n in names if "." not in n]


def _said(room: str) -> str:
    """What the room says of itself, in one line."""
    return (importlib.import_module(f"lugrectl.{room}").__doc__ or "").split("\n")[0]


def _of(name: str) -> str:
    module, _, function = name.rpartition(".")
    made = getattr(importlib.import_module(f"lugrectl.{module}"), function)
    return " ".join((made.__doc__ or "").split("\n\n")[0].split())


def _uses(room: str) -> list[str]:
    """The rooms at the top that its files import."""
    folder, found = ROOT.joinpath(*room.split(".")), set()
    for path in folder.rglob("*.py"):
        inside = ("lugrectl", *path.relative_to(ROOT).parts[:-1])
        for node in ast.walk(ast.parse(path.read_text("utf-8"))):
            if isinstance(node, ast.ImportFrom) and node.level:
                target = [*inside[: len(inside) - node.level + 1], *(node.module or "").split(".")]
                found.add(_room(target[1:]))
    return sorted(found - {room, ""} - {room.split(".")[0]})


def _room(target: list[str]) -> str:
    """The room of a module."""
    return target[0] if target and ROOT.joinpath(target[0]).is_dir() else ""
