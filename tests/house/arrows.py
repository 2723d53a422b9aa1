"""Which room of the package imports which."""

from __future__ import annotations

import ast
from functools import cache
from pathlib import Path

ROOT = Path(__file__).parents[2]
PACKAGE = ROOT / "lugrectl"
FACE = {"__init__", "__main__", "results"}  # files beside the rooms


@cache
def walked(path: Path) -> tuple[ast.AST, ...]:
    """The nodes of a file."""
    return tuple(ast.walk(ast.parse(path.read_text())))


def room(path: Path) -> str:
    return path.relative_to(PACKAGE).parts[0].removesuffix(".py")


def imported(path: Path) -> set[tuple[str, ...]]:
    """The modules of the package that a file imports, at its top or within a function."""
    found = set()
    for node in walked(path):
        if isinstance(node, ast.ImportFrom) and node.level:
            base = path.relative_to(PACKAGE).parts[: -node.level]
            module = tuple(node.module.split(".")) if node.module else ()
            names = [()] if module else [(alias.name,) for alias in node.names]
            found |= {(*base, *module, *name) for name in names}
    return found


@cache
def arrows(folder: str) -> set[tuple[str, str]]:
    """Which room of a folder imports which; the public face imports all."""
    inside = () if folder == "." else (folder,)
    found = set()
    for path in (PACKAGE / folder).rglob("*.py"):
        own = path.relative_to(PACKAGE / folder).parts[0].removesuffix(".py")
        for module in imported(path):
            if module[: len(inside)] == inside and len(module) > len(inside):
                found.add((own, module[len(inside)]))
    return {(a, b) for a, b in found if a != b and not FACE & {a, b}}
